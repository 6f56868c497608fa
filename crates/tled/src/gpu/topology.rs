//! Which corners meet at which node, and in what order their numbers lie on the device.
//!
//! # Theory
//! Every corner of every element owns a slot. Slots lie sorted by group (see `node_groups.rs`),
//! node_groups by place, so that one run of slots belongs to a group and a longer one to a node.
//!
//! ```text
//! slots   │ group 0 │ group 1 │ …    a group: the elements of one material around a node
//!         │ place 0│     place 1     │ …         a place: a node
//! ```

use crate::layout::Layout;
use crate::node_groups::NodeGroups;
use trepan_gpu::{Buffer, Gpu, GpuError};
use trepan_soft::Body;

/// The mesh on the device.
pub(crate) struct Topology {
    /// Places of every element's corners, then their slots, then their node_groups.
    pub corners: Buffer<[u32; 4]>,
    /// Where a place's run of slots begins, one more than places.
    pub starts: Buffer<u32>,
    /// By group: mean `J - 1` around it; one number without averaged pressure.
    pub volume_change: Buffer<f32>,
    /// The same on this side, for averaged nodal pressure.
    pub runs: Runs,
}

/// Slots of the corners, and the runs that they make.
pub(crate) struct Runs {
    /// Where a group's run of slots begins, one more than node_groups.
    pub of_groups: Vec<u32>,
    /// The element of every slot.
    pub owners: Vec<u32>,
    of_places: Vec<u32>,
    slots: Vec<[u32; 4]>,
}

impl Topology {
    pub fn new(
        gpu: &Gpu,
        body: &Body,
        layout: &Layout,
        node_groups: &NodeGroups,
        averages: bool,
    ) -> Result<Self, GpuError> {
        let groups_of: Vec<[u32; 4]> = layout.tet_at.iter().map(|&t| node_groups.of_tet(body, layout, t)).collect();
        let runs = Runs::of(&groups_of, node_groups, layout.node_at.len());
        let place = |group: u32| node_groups.place_of[group as usize];
        let mut corners: Vec<[u32; 4]> = groups_of.iter().map(|tet| tet.map(place)).collect();
        corners.extend_from_slice(&runs.slots);
        if averages {
            corners.extend_from_slice(&groups_of);
        }
        Ok(Self {
            corners: Buffer::from_slice(gpu, "corners", &corners)?,
            starts: Buffer::from_slice(gpu, "starts", &runs.of_places)?,
            volume_change: Buffer::zeroed(gpu, "volume_change", if averages { node_groups.place_of.len() } else { 1 })?,
            runs,
        })
    }
}

impl Runs {
    fn of(groups_of: &[[u32; 4]], node_groups: &NodeGroups, places: usize) -> Self {
        let mut of_groups = vec![0u32; node_groups.place_of.len() + 1];
        groups_of.iter().flatten().for_each(|&group| of_groups[group as usize + 1] += 1);
        (1..of_groups.len()).for_each(|i| of_groups[i] += of_groups[i - 1]);
        let (mut next, mut owners) = (of_groups.clone(), vec![0u32; 4 * groups_of.len()]);
        let mut slots = Vec::with_capacity(groups_of.len());
        for (element, tet) in groups_of.iter().enumerate() {
            slots.push(tet.map(|group| {
                let slot = next[group as usize];
                next[group as usize] += 1;
                owners[slot as usize] = element as u32;
                slot
            }));
        }
        let first_of = |place: usize| of_groups[node_groups.place_of.partition_point(|&p| (p as usize) < place)];
        let of_places = (0..=places).map(first_of).collect();
        Self { of_groups, owners, of_places, slots }
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
            let node_groups = NodeGroups::of(&body, &layout, apart);
            let groups_of: Vec<[u32; 4]> =
                layout.tet_at.iter().map(|&t| node_groups.of_tet(&body, &layout, t)).collect();
            let runs = Runs::of(&groups_of, &node_groups, layout.node_at.len());
            let mut taken = vec![false; 4 * groups_of.len()];
            for (element, (tet, slots)) in groups_of.iter().zip(&runs.slots).enumerate() {
                for (&group, &slot) in tet.iter().zip(slots) {
                    let place = node_groups.place_of[group as usize] as usize;
                    assert!((runs.of_groups[group as usize]..runs.of_groups[group as usize + 1]).contains(&slot));
                    assert!((runs.of_places[place]..runs.of_places[place + 1]).contains(&slot));
                    assert_eq!(runs.owners[slot as usize] as usize, element);
                    assert!(!std::mem::replace(&mut taken[slot as usize], true));
                }
            }
            assert!(taken.iter().all(|t| *t));
        }
    }
}
