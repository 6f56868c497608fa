//! The ready-made tree: parry's `Bvh`, each leaf one tetrahedron's box.
//!
//! # Practice
//! Built by parry's binned surface-area heuristic. The tool's box, wider by as much as any node can
//! have moved since (`motion.rs`), asks the tree in one descent; what it finds is tested with its
//! present box. When that margin is over half of an edge, all leaves are updated and the tree is
//! refitted. A leaf whose tetrahedron is nowhere keeps its last places. Nothing is allocated after
//! `new`.
//!
//! # When not to use it
//! When all nodes leap in every step: the whole tree is then refitted in each.
//!
//! # Sources
//! The crate parry3d, its `Bvh`. Liberties: none in the tree; it is asked with a widened box.

use super::motion::{Fitted, Motion};
use parry3d::bounding_volume::Aabb as Box3;
use parry3d::partitioning::{Bvh, BvhBuildStrategy};
use trepan_deformable::Descriptor;
use trepan_deformable::SearchInputs;
use trepan_deformable::kit::Extent;
use trepan_deformable::kit::{BroadPhase, Indexed, Phased, box_of};
use trepan_deformable::search::UniformGrid;
use trepan_geometry::{Aabb, Vec3};

/// Parry's bounding-volume hierarchy.
pub struct ParryTree {
    tree: Bvh,
    motion: Motion,
    fitted: Fitted,
    loose_mm: f32,
    near: Indexed<UniformGrid>,
}

/// Margin over which the tree is refitted, as a share of a grid cell (1.45 edges).
const LOOSE: f32 = 0.35;

impl ParryTree {
    /// A tree over a mesh at rest.
    pub fn new(inputs: &SearchInputs) -> Self {
        let (positions, tets) = (&inputs.mesh.positions, &inputs.mesh.tets);
        let leaves: Vec<Box3> = tets.iter().map(|tet| to_parry(&box_of(positions, tet))).collect();
        let (motion, fitted) = Motion::of(positions);
        Self {
            tree: Bvh::from_leaves(BvhBuildStrategy::Binned, &leaves),
            motion,
            fitted,
            loose_mm: LOOSE * inputs.cell_mm,
            near: Indexed::new(UniformGrid::new(inputs.cell_mm, inputs.points), tets.len()),
        }
    }

    /// Fits every leaf to the last places of its nodes.
    fn refit(&mut self, tets: &[[u32; 4]]) {
        for (t, tet) in tets.iter().enumerate() {
            self.tree.insert_or_update_partially(to_parry(&box_of(&self.motion.places, tet)), t as u32, 0.0);
        }
        self.tree.refit_without_opt();
        self.fitted = self.motion.now();
    }
}

fn to_parry(b: &Extent) -> Box3 {
    Box3::new(b.low.to_array().into(), b.high.to_array().into())
}

impl BroadPhase for ParryTree {
    fn update(&mut self, positions: &[Vec3], tets: &[[u32; 4]], region: &Aabb) {
        self.motion.follow(positions);
        if self.motion.since(self.fitted) > self.loose_mm {
            self.refit(tets);
        }
        self.near.clear();
        let region = Extent::from(*region);
        let wide = region.widened(self.motion.since(self.fitted));
        if wide.low.cmple(wide.high).all() {
            for t in self.tree.intersect_aabb(&to_parry(&wide)) {
                self.near.offer(t, box_of(positions, &tets[t as usize]), &region);
            }
        }
        self.near.sort();
    }

    fn pairs(&mut self, points: &[Vec3], out: &mut Vec<[u32; 2]>) -> u32 {
        self.near.pairs(points, out)
    }
}

/// The tree of the crate parry.
pub const METHOD: Descriptor =
    Descriptor::of("parry-tree", "parry3d", |inputs| Box::new(Phased::new(ParryTree::new(inputs), inputs.points)));
