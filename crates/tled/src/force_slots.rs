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
use crate::node_groups::NodeGroups;
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
    inverse_volume: Vec<f32>,
    /// First slot of each group, and of each place; one more entry than there are.
    of_groups: Vec<u32>,
    of_places: Vec<u32>,
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
        let mut of_groups = vec![0u32; node_groups.place_of.len() + 1];
        owned.iter().flatten().for_each(|&group| of_groups[group as usize + 1] += 1);
        (1..of_groups.len()).for_each(|i| of_groups[i] += of_groups[i - 1]);
        let mut next = of_groups.clone();
        let mut take = |&group: &u32| {
            next[group as usize] += 1;
            next[group as usize] - 1
        };
        let slots = owned.iter().map(|groups| groups.iter().map(&mut take).collect()).collect();
        let count = owned.iter().map(Vec::len).sum();
        let first_of = |place: usize| of_groups[node_groups.place_of.partition_point(|&p| (p as usize) < place)];
        let force_slots = Self {
            sums: Field::zeroed(count),
            shares: Scalars::zeroed(if inverse_volume.is_empty() { 0 } else { count }),
            volume_change: Scalars::zeroed(inverse_volume.len()),
            inverse_volume,
            of_places: (0..=places).map(first_of).collect(),
            of_groups,
        };
        (force_slots, slots)
    }

    /// Element force on the node at `place`, N, and the number of sleeping parts around it.
    #[inline(always)]
    pub fn force(&self, place: usize) -> Vec4 {
        let slots = self.of_places[place] as usize..self.of_places[place + 1] as usize;
        slots.fold(Vec4::ZERO, |sum, slot| sum + self.sums.vector(slot))
    }

    /// Number of node groups whose volume change is averaged.
    pub fn node_groups(&self) -> usize {
        self.inverse_volume.len()
    }

    /// Averages the volume change of some node groups.
    pub fn average(&self, node_groups: Range<usize>) {
        for group in node_groups {
            let slots = self.of_groups[group] as usize..self.of_groups[group + 1] as usize;
            let sum = slots.fold(0.0, |sum, slot| sum + self.shares.get(slot));
            self.volume_change.set(group, sum * self.inverse_volume[group]);
        }
    }
}
