//! Force slots: one for every node group of every part, gathered per node in a fixed order.
//!
//! # Theory
//! Slots are sorted by node group and then by part, node groups by place. So a node group owns one
//! run of slots and a node a longer one. The sum of a run has the same bits whichever threads wrote
//! and added it.
//!
//! ```text
//! slots   │ group 0: parts 0, 3 │ group 1: part 0 │ group 2: parts 0, 1, 3 │ …
//! ```

use crate::field::{Field, Scalars};
use crate::node_groups::{NodeGroups, Runs};
use glam::Vec4;
use std::ops::Range;

/// The slots and their contents.
pub(crate) struct ForceSlots {
    /// By slot: force of a part's elements on a node, N; fourth number 1 where the part sleeps.
    pub sums: Field,
    /// By slot: a quarter of the volume change of a part's elements in a node group, mm³. Empty
    /// without averaged pressure, as are the next two fields.
    pub shares: Scalars,
    /// By group: mean `J - 1` of its elements.
    pub volume_change: Scalars,
    inverse_volume: Scalars,
    runs: Runs,
}

impl ForceSlots {
    /// Creates the slots for parts with the node groups `owned`; also returns the slots of each
    /// part. `inverse_volume` is by node group with averaged pressure, else empty.
    pub fn of(
        owned: &[Vec<u32>],
        node_groups: &NodeGroups,
        places: usize,
        inverse_volume: Vec<f32>,
    ) -> (Self, Vec<Vec<u32>>) {
        let runs = node_groups.runs(owned.iter().flatten().copied(), places);
        let mut left = runs.slots.iter().copied();
        let slots = owned.iter().map(|groups| left.by_ref().take(groups.len()).collect()).collect();
        let force_slots = Self {
            sums: Field::zeroed(runs.slots.len()),
            shares: Scalars::zeroed(if inverse_volume.is_empty() { 0 } else { runs.slots.len() }),
            volume_change: Scalars::zeroed(inverse_volume.len()),
            inverse_volume: Scalars::of(&inverse_volume),
            runs,
        };
        (force_slots, slots)
    }

    /// Element force on the node at `place`, N, and the number of sleeping parts around it.
    #[inline(always)]
    pub fn force(&self, place: usize) -> Vec4 {
        let slots = self.runs.of_places[place] as usize..self.runs.of_places[place + 1] as usize;
        slots.fold(Vec4::ZERO, |sum, slot| sum + self.sums.vector(slot))
    }

    /// Number of node groups whose volume change is averaged.
    pub fn node_groups(&self) -> usize {
        self.inverse_volume.len()
    }

    /// Sets the volume of a node group, mm³; nothing is averaged over an empty one.
    pub fn set_volume(&self, group: usize, volume_mm3: f64) {
        self.inverse_volume.set(group, if volume_mm3 > 0.0 { (1.0 / volume_mm3) as f32 } else { 0.0 });
    }

    /// Averages the volume change of some node groups.
    pub fn average(&self, node_groups: Range<usize>) {
        for group in node_groups {
            let slots = self.runs.of_groups[group] as usize..self.runs.of_groups[group + 1] as usize;
            let sum = slots.fold(0.0, |sum, slot| sum + self.shares.get(slot));
            self.volume_change.set(group, sum * self.inverse_volume.get(group));
        }
    }
}
