//! Which corners meet at which node, and in what order their numbers lie on the device.
//!
//! # Theory
//! Every corner of every element owns a slot. Slots lie sorted by seat (see `seats.rs`), seats by place, so that one run of slots belongs to a seat and a longer one to a node.
//!
//! ```text
//! slots   │ seat 0 │ seat 1 │ seat 2 │ …         a seat: the elements of one material around a node, where locking is cured
//!         │ place 0│     place 1     │ …         a place: a node
//! ```

use crate::layout::Layout;
use crate::seats::Seats;
use trepan_gpu::{Buffer, Gpu, GpuError};
use trepan_soft::Body;

/// The mesh on the device.
pub(crate) struct Topology {
    /// Places of every element's corners, then their slots, then their seats.
    pub corners: Buffer<[u32; 4]>,
    /// Where a place's run of slots begins, one more than places.
    pub starts: Buffer<u32>,
    /// By seat: mean `J - 1` around it; one number where locking is not cured.
    pub swelling: Buffer<f32>,
    /// The same on this side, for the cure of locking.
    pub runs: Runs,
}

/// Slots of the corners, and the runs that they make.
pub(crate) struct Runs {
    /// Where a seat's run of slots begins, one more than seats.
    pub of_seats: Vec<u32>,
    /// The element of every slot.
    pub owners: Vec<u32>,
    of_places: Vec<u32>,
    slots: Vec<[u32; 4]>,
}

impl Topology {
    pub fn new(gpu: &Gpu, body: &Body, layout: &Layout, seats: &Seats, cures: bool) -> Result<Self, GpuError> {
        let seats_of: Vec<[u32; 4]> = layout.tet_at.iter().map(|&t| seats.of_tet(body, layout, t)).collect();
        let runs = Runs::of(&seats_of, seats, layout.node_at.len());
        let place = |seat: u32| seats.place_of[seat as usize];
        let mut corners: Vec<[u32; 4]> = seats_of.iter().map(|tet| tet.map(place)).collect();
        corners.extend_from_slice(&runs.slots);
        if cures {
            corners.extend_from_slice(&seats_of);
        }
        Ok(Self {
            corners: Buffer::from_slice(gpu, "corners", &corners)?,
            starts: Buffer::from_slice(gpu, "starts", &runs.of_places)?,
            swelling: Buffer::zeroed(gpu, "swelling", if cures { seats.place_of.len() } else { 1 })?,
            runs,
        })
    }
}

impl Runs {
    fn of(seats_of: &[[u32; 4]], seats: &Seats, places: usize) -> Self {
        let mut of_seats = vec![0u32; seats.place_of.len() + 1];
        seats_of.iter().flatten().for_each(|&seat| of_seats[seat as usize + 1] += 1);
        (1..of_seats.len()).for_each(|i| of_seats[i] += of_seats[i - 1]);
        let (mut next, mut owners) = (of_seats.clone(), vec![0u32; 4 * seats_of.len()]);
        let mut slots = Vec::with_capacity(seats_of.len());
        for (element, tet) in seats_of.iter().enumerate() {
            slots.push(tet.map(|seat| {
                let slot = next[seat as usize];
                next[seat as usize] += 1;
                owners[slot as usize] = element as u32;
                slot
            }));
        }
        let first_of = |place: usize| of_seats[seats.place_of.partition_point(|&p| (p as usize) < place)];
        let of_places = (0..=places).map(first_of).collect();
        Self { of_seats, owners, of_places, slots }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use trepan_soft::{Material, boxes};

    #[test]
    fn every_corner_owns_one_slot_in_the_run_of_its_seat_and_of_its_node() {
        let mesh = boxes::split_box([3, 2, 2], trepan_geometry::Vec3::splat(9.0));
        let mut body = Body::uniform(mesh, vec![], Material::BRAIN);
        body.materials.push(Material::TUMOUR);
        body.material_of_tet.iter_mut().step_by(3).for_each(|m| *m = 1);
        let layout = Layout::of(&body);
        for apart in [false, true] {
            let seats = Seats::of(&body, &layout, apart);
            let seats_of: Vec<[u32; 4]> = layout.tet_at.iter().map(|&t| seats.of_tet(&body, &layout, t)).collect();
            let runs = Runs::of(&seats_of, &seats, layout.node_at.len());
            let mut taken = vec![false; 4 * seats_of.len()];
            for (element, (tet, slots)) in seats_of.iter().zip(&runs.slots).enumerate() {
                for (&seat, &slot) in tet.iter().zip(slots) {
                    let place = seats.place_of[seat as usize] as usize;
                    assert!((runs.of_seats[seat as usize]..runs.of_seats[seat as usize + 1]).contains(&slot));
                    assert!((runs.of_places[place]..runs.of_places[place + 1]).contains(&slot));
                    assert_eq!(runs.owners[slot as usize] as usize, element);
                    assert!(!std::mem::replace(&mut taken[slot as usize], true));
                }
            }
            assert!(taken.iter().all(|t| *t));
        }
    }
}
