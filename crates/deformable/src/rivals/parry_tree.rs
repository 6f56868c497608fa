//! The ready-made tree: parry's `Bvh`, each leaf one tetrahedron's box.
//!
//! # Practice
//! Built by parry's binned surface-area heuristic, leaves updated in place, refitted without
//! rebuilding. A leaf whose tetrahedron is nowhere keeps its last box and gives no pair. Nothing is
//! allocated after `new`.
//!
//! # When not to use it
//! For one small tool, as all trees that follow every tetrahedron.

use crate::bounded::push_bounded;
use crate::extent::Extent;
use crate::method::Descriptor;
use crate::phase::{BroadPhase, Phased, box_of};
use parry3d::bounding_volume::Aabb as Box3;
use parry3d::partitioning::{Bvh, BvhBuildStrategy};
use trepan_geometry::{Aabb, Vec3};

/// Parry's bounding-volume hierarchy.
pub struct ParryTree {
    tree: Bvh,
    boxes: Vec<Extent>,
}

impl ParryTree {
    /// A tree over a mesh at rest.
    pub fn new(positions: &[Vec3], tets: &[[u32; 4]]) -> Self {
        let boxes: Vec<Extent> = tets.iter().map(|tet| box_of(positions, tet)).collect();
        let leaves: Vec<Box3> = boxes.iter().map(to_parry).collect();
        Self { tree: Bvh::from_leaves(BvhBuildStrategy::Binned, &leaves), boxes }
    }
}

fn to_parry(b: &Extent) -> Box3 {
    Box3::new(b.low.to_array().into(), b.high.to_array().into())
}

impl BroadPhase for ParryTree {
    fn update(&mut self, positions: &[Vec3], tets: &[[u32; 4]], _region: &Aabb) {
        for (t, tet) in tets.iter().enumerate() {
            self.boxes[t] = box_of(positions, tet);
            if self.boxes[t] != Extent::EMPTY {
                self.tree.insert_or_update_partially(to_parry(&self.boxes[t]), t as u32, 0.0);
            }
        }
        self.tree.refit_without_opt();
    }

    fn pairs(&mut self, points: &[Vec3], out: &mut Vec<[u32; 2]>) -> u32 {
        out.clear();
        let mut overflow = 0;
        for (i, &p) in points.iter().enumerate().filter(|(_, p)| p.is_finite()) {
            for t in self.tree.intersect_aabb(&Box3::new(p, p)) {
                if self.boxes[t as usize].contains(p) {
                    overflow += push_bounded(out, [i as u32, t]);
                }
            }
        }
        out.sort_unstable_by_key(|&[point, tet]| (tet, point));
        overflow
    }
}

/// The tree of the crate parry.
pub const METHOD: Descriptor = Descriptor::of("parry-tree", "parry3d", |inputs| {
    Box::new(Phased::new(ParryTree::new(&inputs.mesh.positions, &inputs.mesh.tets), inputs.points))
});
