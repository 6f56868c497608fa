//! What the parts hand to the nodes: a slot for every group of every part, gathered in a fixed
//! order.
//!
//! # Theory
//! Slots lie sorted by group and then by part, node_groups by place. So a group owns one run of
//! slots and a node a longer one, and adding up a run gives the same bits whoever wrote it and
//! whoever adds.
//!
//! ```text
//! slots   │ group 0: parts 0, 3 │ group 1: part 0 │ group 2: parts 0, 1, 3 │ …
//! ```

use crate::field::{Field, Scalars};
use crate::node_groups::NodeGroups;
use glam::Vec4;
use std::ops::Range;

/// The slots and what is in them.
pub(crate) struct ForceSlots {
    /// By slot: force of a part's elements on a node, N, and 1 where the part sleeps.
    pub sums: Field,
    /// By slot: a quarter of the volume change of a part's elements around a group, mm³; empty
    /// where locking is not cured, and so are the next two.
    pub shares: Scalars,
    /// By group: mean `J - 1` around it.
    pub swelling: Scalars,
    inverse_volume: Vec<f32>,
    /// Where the run of each group begins, and of each place; one more than there are.
    of_groups: Vec<u32>,
    of_places: Vec<u32>,
}

impl ForceSlots {
    /// Slots for parts with these node_groups; gives those of each part. One over the node_groups'
    /// volumes where locking is cured, else nothing.
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
        let slots = owned.iter().map(|own| own.iter().map(&mut take).collect()).collect();
        let count = owned.iter().map(Vec::len).sum();
        let first_of = |place: usize| of_groups[node_groups.place_of.partition_point(|&p| (p as usize) < place)];
        let force_slots = Self {
            sums: Field::zeroed(count),
            shares: Scalars::zeroed(if inverse_volume.is_empty() { 0 } else { count }),
            swelling: Scalars::zeroed(inverse_volume.len()),
            inverse_volume,
            of_places: (0..=places).map(first_of).collect(),
            of_groups,
        };
        (force_slots, slots)
    }

    /// Force of the elements on the node at `place`, N, and how many of the parts around it sleep.
    #[inline(always)]
    pub fn force(&self, place: usize) -> Vec4 {
        let slots = self.of_places[place] as usize..self.of_places[place + 1] as usize;
        slots.fold(Vec4::ZERO, |sum, slot| sum + self.sums.vector(slot))
    }

    /// NodeGroups whose volume change is averaged.
    pub fn node_groups(&self) -> usize {
        self.inverse_volume.len()
    }

    /// Averages the volume change around some node_groups.
    pub fn average(&self, node_groups: Range<usize>) {
        for group in node_groups {
            let slots = self.of_groups[group] as usize..self.of_groups[group + 1] as usize;
            let sum = slots.fold(0.0, |sum, slot| sum + self.shares.get(slot));
            self.swelling.set(group, sum * self.inverse_volume[group]);
        }
    }
}
