//! What the parts hand to the nodes: a slot for every seat of every part, gathered in a fixed order.
//!
//! # Theory
//! Slots lie sorted by seat and then by part, seats by place. So a seat owns one run of slots and a node a longer one, and adding up a run gives the same bits
//! whoever wrote it and whoever adds.
//!
//! ```text
//! slots   │ seat 0: parts 0, 3 │ seat 1: part 0 │ seat 2: parts 0, 1, 3 │ …
//! ```

use crate::field::{Field, Scalars};
use crate::seats::Seats;
use glam::Vec4;
use std::ops::Range;

/// The slots and what is in them.
pub(crate) struct Handed {
    /// By slot: force of a part's elements on a node, N, and 1 where the part sleeps.
    pub sums: Field,
    /// By slot: a quarter of the volume change of a part's elements around a seat, mm³; empty where locking is not cured, and so are the next two.
    pub shares: Scalars,
    /// By seat: mean `J - 1` around it.
    pub swelling: Scalars,
    inverse_volume: Vec<f32>,
    /// Where the run of each seat begins, and of each place; one more than there are.
    of_seats: Vec<u32>,
    of_places: Vec<u32>,
}

impl Handed {
    /// Slots for parts with these seats; gives those of each part. One over the seats' volumes where locking is cured, else nothing.
    pub fn of(owned: &[Vec<u32>], seats: &Seats, places: usize, inverse_volume: Vec<f32>) -> (Self, Vec<Vec<u32>>) {
        let mut of_seats = vec![0u32; seats.place_of.len() + 1];
        owned.iter().flatten().for_each(|&seat| of_seats[seat as usize + 1] += 1);
        (1..of_seats.len()).for_each(|i| of_seats[i] += of_seats[i - 1]);
        let mut next = of_seats.clone();
        let mut take = |&seat: &u32| {
            next[seat as usize] += 1;
            next[seat as usize] - 1
        };
        let slots = owned.iter().map(|own| own.iter().map(&mut take).collect()).collect();
        let count = owned.iter().map(Vec::len).sum();
        let first_of = |place: usize| of_seats[seats.place_of.partition_point(|&p| (p as usize) < place)];
        let handed = Self {
            sums: Field::zeroed(count),
            shares: Scalars::zeroed(if inverse_volume.is_empty() { 0 } else { count }),
            swelling: Scalars::zeroed(inverse_volume.len()),
            inverse_volume,
            of_places: (0..=places).map(first_of).collect(),
            of_seats,
        };
        (handed, slots)
    }

    /// Force of the elements on the node at `place`, N, and how many of the parts around it sleep.
    #[inline(always)]
    pub fn force(&self, place: usize) -> Vec4 {
        let slots = self.of_places[place] as usize..self.of_places[place + 1] as usize;
        slots.fold(Vec4::ZERO, |sum, slot| sum + self.sums.vector(slot))
    }

    /// Seats whose volume change is averaged.
    pub fn seats(&self) -> usize {
        self.inverse_volume.len()
    }

    /// Averages the volume change around some seats.
    pub fn average(&self, seats: Range<usize>) {
        for seat in seats {
            let slots = self.of_seats[seat] as usize..self.of_seats[seat + 1] as usize;
            let sum = slots.fold(0.0, |sum, slot| sum + self.shares.get(slot));
            self.swelling.set(seat, sum * self.inverse_volume[seat]);
        }
    }
}
