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

use crate::node_groups::{NodeGroups, Runs};
use trepan_gpu::{Buffer, Gpu, GpuError};
use trepan_soft::Body;
use trepan_soft::simd::Layout;

/// The mesh on the device.
pub(crate) struct Topology {
    /// Places of every element's corners, then their slots, then their node_groups.
    pub corners: Buffer<[u32; 4]>,
    /// Where a place's run of slots begins, one more than places.
    pub starts: Buffer<u32>,
    /// By group: mean `J - 1` around it; one number without averaged pressure.
    pub volume_change: Buffer<f32>,
    /// Slots of the corners, element by element and then triangle by triangle, and the runs that
    /// they make, on this side.
    pub runs: Runs,
    /// Places of the corners of every triangle of the membrane, the first one again as the fourth.
    pub sheet_corners: Vec<[u32; 4]>,
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
        let triangles: &[[u32; 3]] = if body.membrane.is_none() { &[] } else { &body.membrane.triangles };
        let place_of = |node: u32| layout.place_of[node as usize];
        let sheet_corners: Vec<[u32; 4]> = triangles.iter().map(|&[a, b, c]| [a, b, c, a].map(place_of)).collect();
        let of_sheet = sheet_corners.iter().flatten().map(|&place| node_groups.any_at(place));
        let owned = groups_of.iter().flatten().copied().chain(of_sheet);
        let runs = node_groups.runs(owned, layout.node_at.len());
        let place = |group: u32| node_groups.place_of[group as usize];
        let mut corners: Vec<[u32; 4]> = groups_of.iter().map(|tet| tet.map(place)).collect();
        corners.extend_from_slice(&runs.slots.as_chunks().0[..groups_of.len()]);
        if averages {
            corners.extend_from_slice(&groups_of);
        }
        Ok(Self {
            corners: Buffer::from_slice(gpu, "corners", &corners)?,
            starts: Buffer::from_slice(gpu, "starts", &runs.of_places)?,
            volume_change: Buffer::zeroed(gpu, "volume_change", if averages { node_groups.place_of.len() } else { 1 })?,
            runs,
            sheet_corners,
        })
    }
}

/// The element of every slot.
pub(crate) fn owners(runs: &Runs) -> Vec<u32> {
    let mut owners = vec![0; runs.slots.len()];
    runs.slots.iter().enumerate().for_each(|(corner, &slot)| owners[slot as usize] = corner as u32 / 4);
    owners
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
            let runs = node_groups.runs(groups_of.iter().flatten().copied(), layout.node_at.len());
            let (owners, corners) = (owners(&runs), runs.slots.as_chunks::<4>().0);
            let mut taken = vec![false; 4 * groups_of.len()];
            for (element, (tet, slots)) in groups_of.iter().zip(corners).enumerate() {
                for (&group, &slot) in tet.iter().zip(slots) {
                    let place = node_groups.place_of[group as usize] as usize;
                    assert!((runs.of_groups[group as usize]..runs.of_groups[group as usize + 1]).contains(&slot));
                    assert!((runs.of_places[place]..runs.of_places[place + 1]).contains(&slot));
                    assert_eq!(owners[slot as usize] as usize, element);
                    assert!(!std::mem::replace(&mut taken[slot as usize], true));
                }
            }
            assert!(taken.iter().all(|t| *t));
        }
    }
}
