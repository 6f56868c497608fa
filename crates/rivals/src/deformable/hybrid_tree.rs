//! A tree of boxes whose upper half is refitted bottom-up and whose lower half only where it is
//! looked at.
//!
//! # Theory
//! Larsson and Akenine-Möller 2001: most of the lower nodes are never visited in a step. So the
//! nodes half way down are fitted straight to the mesh nodes below them, the upper ones to their
//! children; below, a node is fitted to its own mesh nodes when the box above it meets the region
//! of interest.
//!
//! # Practice
//! Each mesh node is read once for each half-way box that has it, 1.5 times on average, in place of
//! four corners of about five tetrahedra: so an update costs a fifth of a scan.
//!
//! # When not to use it
//! When the points are all over the mesh: then every lower node is fitted to all mesh nodes below
//! it, level by level.
//!
//! # Sources
//! Larsson and Akenine-Möller 2001: upper half bottom-up, lower half top-down where visited;
//! thesis 2.1.2. Liberties: a binary tree of tetrahedra, where theirs has eight children and
//! triangles; the other side of a test is the tool's box instead of a second tree.

use super::volume_tree::{LEAF, Node, halved};
use trepan_deformable::Descriptor;
use trepan_deformable::kit::Extent;
use trepan_deformable::kit::distinct_rows;
use trepan_deformable::kit::push_bounded;
use trepan_deformable::kit::{BroadPhase, Phased, box_of};
use trepan_geometry::{Aabb, Vec3};
use trepan_mesh::Csr;

/// A binary tree of boxes, lazily fitted below half way.
#[derive(Debug)]
pub struct HybridTree {
    shape: Vec<Node>,
    order: Vec<u32>,
    bounds: Vec<Extent>,
    /// Nodes whose boxes are fitted to the mesh in every update, parents before children.
    half_way: Vec<u32>,
    upper: Vec<u32>,
    mesh_nodes: Csr,
    /// Tetrahedra below a node that is half way down, at most.
    below: u32,
    boxes: Vec<(u32, Extent)>,
}

/// Tetrahedra below a node that is half way down: the square root of a leaf times the mesh, at
/// least this many.
const LEAST_BELOW: usize = 4 * LEAF;

impl HybridTree {
    /// A tree over a mesh at rest.
    pub fn new(positions: &[Vec3], tets: &[[u32; 4]]) -> Self {
        let (shape, order) = halved(positions, tets);
        let below = (((tets.len() * LEAF) as f64).sqrt() as usize).max(LEAST_BELOW);
        let (mut half_way, mut upper, mut open) = (Vec::new(), Vec::new(), vec![0u32]);
        while let Some(at) = open.pop() {
            let node = shape[at as usize];
            if node.right == 0 || (node.last - node.first) as usize <= below {
                half_way.push(at);
            } else {
                upper.push(at);
                open.extend([node.right, at + 1]);
            }
        }
        let tets_below = |at: &u32| shape[*at as usize].tets(&order).iter().flat_map(|&t| tets[t as usize]);
        let mesh_nodes = distinct_rows(half_way.iter().map(tets_below));
        let bounds = vec![Extent::EMPTY; shape.len()];
        let (below, boxes) = (below as u32, Vec::with_capacity(tets.len()));
        Self { shape, order, bounds, half_way, upper, mesh_nodes, below, boxes }
    }

    /// Boxes half way down, then those above.
    fn fit_upper(&mut self, positions: &[Vec3]) {
        for (k, &at) in self.half_way.iter().enumerate() {
            let nodes = self.mesh_nodes.row(k).iter().map(|&n| &positions[n as usize]);
            self.bounds[at as usize] = Extent::of(nodes.filter(|p| p.is_finite()));
        }
        for &at in self.upper.iter().rev() {
            let mut bounds = self.bounds[at as usize + 1];
            bounds.merge(&self.bounds[self.shape[at as usize].right as usize]);
            self.bounds[at as usize] = bounds;
        }
    }

    /// Goes down where boxes meet the region, fits what lies below half way, and lists the
    /// tetrahedra reached.
    fn fit_lower(&mut self, at: u32, positions: &[Vec3], tets: &[[u32; 4]], region: &Extent) {
        let node = self.shape[at as usize];
        if !self.bounds[at as usize].overlaps(region) {
            return;
        }
        if node.right == 0 {
            let met = node.tets(&self.order).iter().map(|&t| (t, box_of(positions, &tets[t as usize])));
            return self.boxes.extend(met.filter(|(_, b)| b.overlaps(region)));
        }
        for child in [at + 1, node.right] {
            self.fit_below(positions, tets, child, node);
            self.fit_lower(child, positions, tets, region);
        }
    }

    /// A child of a node that was fitted to the mesh itself; children of upper nodes are fitted
    /// already.
    fn fit_below(&mut self, positions: &[Vec3], tets: &[[u32; 4]], child: u32, parent: Node) {
        if parent.last - parent.first > self.below {
            return;
        }
        let mut bounds = Extent::EMPTY;
        for &t in self.shape[child as usize].tets(&self.order) {
            bounds.merge(&box_of(positions, &tets[t as usize]));
        }
        self.bounds[child as usize] = bounds;
    }
}

impl BroadPhase for HybridTree {
    fn update(&mut self, positions: &[Vec3], tets: &[[u32; 4]], region: &Aabb) {
        self.boxes.clear();
        self.fit_upper(positions);
        self.fit_lower(0, positions, tets, &Extent::from(*region));
        self.boxes.sort_unstable_by_key(|(t, _)| *t);
    }

    fn pairs(&mut self, points: &[Vec3], out: &mut Vec<[u32; 2]>) -> u32 {
        out.clear();
        let mut overflow = 0;
        for (t, bounds) in &self.boxes {
            for (i, _) in points.iter().enumerate().filter(|(_, p)| bounds.contains(**p)) {
                overflow += push_bounded(out, [i as u32, *t]);
            }
        }
        overflow
    }
}

/// The tree of boxes, refitted where it is looked at.
pub const METHOD: Descriptor = Descriptor::of("hybrid-tree", "Larsson and Akenine-Möller 2001", |inputs| {
    Box::new(Phased::new(HybridTree::new(&inputs.mesh.positions, &inputs.mesh.tets), inputs.points))
});
