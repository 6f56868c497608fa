//! Boxes with a tolerance over the border triangles, and a flood inwards from where the tool
//! enters.
//!
//! # Theory
//! Bielser and Gross 2000: a hierarchy of boxes over the surface only. A box is larger than what it
//! holds by a tolerance; where the triangles stay inside, nothing is updated, and where they do
//! not, the boxes above are, from there upwards. From the triangles that the tool meets, and from
//! the tetrahedra in which it was, the search goes on inwards through neighbours.
//!
//! # Practice
//! Each surface node is read about twice in a step; the interior costs nothing until it is reached.
//!
//! # When not to use it
//! With a tool that leaps into the tissue: no surface is near it and no tetrahedron remembered.
//!
//! # Sources
//! Bielser and Gross 2000, surface and volume collision detection; thesis 2.3.2. Liberties: a ball
//! instead of a scalpel's edge, so that the flood takes the place of the trace of its tip; boxes
//! grow on the way up and are not made tight again.

use super::volume_tree::{Node, halved};
use trepan_deformable::Descriptor;
use trepan_deformable::kit::Extent;
use trepan_deformable::kit::Scene;
use trepan_deformable::kit::{Flood, Lost};
use trepan_deformable::kit::{Hits, NONE};
use trepan_deformable::kit::{MovingSurface, distinct_rows};
use trepan_deformable::{Search, SearchInputs};
use trepan_geometry::Vec3;
use trepan_mesh::{Csr, Surface};

struct SurfaceBoxes {
    shape: Vec<Node>,
    parents: Vec<u32>,
    /// Border triangles in the order of the tree: the tetrahedra behind them.
    tets: Vec<u32>,
    /// Tree nodes that are leaves, and the mesh nodes of each.
    leaves: Vec<u32>,
    nodes: Csr,
    boxes: Vec<Extent>,
    tolerance_mm: f32,
    last: Vec<u32>,
    lost: Lost,
    flood: Flood,
}

/// Tolerance, as a share of a grid cell (1.45 edges).
const TOLERANCE: f32 = 0.1;

impl SurfaceBoxes {
    fn new(inputs: &SearchInputs) -> Self {
        let surface = Surface::of(inputs.mesh);
        let triangles: Vec<[u32; 4]> = surface.triangles.iter().map(|&[a, b, c]| [a, b, c, c]).collect();
        let (shape, order) = halved(&inputs.mesh.positions, &triangles);
        let mut parents = vec![NONE; shape.len()];
        for (at, node) in (0..).zip(&shape).filter(|(_, node)| node.right != 0) {
            (parents[at as usize + 1], parents[node.right as usize]) = (at, at);
        }
        let leaves: Vec<u32> = (0..shape.len() as u32).filter(|&at| shape[at as usize].right == 0).collect();
        let nodes_of = |&at: &u32| shape[at as usize].tets(&order).iter().flat_map(|&t| triangles[t as usize]);
        Self {
            nodes: distinct_rows(leaves.iter().map(nodes_of)),
            boxes: vec![Extent::EMPTY; shape.len()],
            tets: order.iter().map(|&t| surface.tet_of_triangle[t as usize]).collect(),
            tolerance_mm: TOLERANCE * inputs.cell_mm,
            last: vec![NONE; inputs.points],
            lost: Lost::with_capacity(inputs.points),
            flood: Flood::over(inputs.mesh.tets.len()),
            shape,
            parents,
            leaves,
        }
    }

    /// Updates the leaves whose triangles left their boxes, and the boxes above these.
    fn update(&mut self, positions: &[Vec3]) {
        for (k, &leaf) in self.leaves.iter().enumerate() {
            let own = self.nodes.row(k).iter().map(|&n| &positions[n as usize]);
            let tight = Extent::of(own.filter(|p| p.is_finite()));
            if self.boxes[leaf as usize].holds(&tight) {
                continue;
            }
            let mut bounds = tight.widened(self.tolerance_mm);
            self.boxes[leaf as usize] = bounds;
            let mut at = self.parents[leaf as usize];
            while at != NONE && !self.boxes[at as usize].holds(&bounds) {
                self.boxes[at as usize].merge(&bounds);
                bounds = self.boxes[at as usize];
                at = self.parents[at as usize];
            }
        }
    }

    /// Seeds the flood with the tetrahedra behind the triangles in boxes that meet the region.
    fn enter(&mut self, at: usize, region: &Extent, hits: &mut Hits) {
        if !self.boxes[at].overlaps(region) {
            return;
        }
        let node = self.shape[at];
        if node.right != 0 {
            self.enter(at + 1, region, hits);
            return self.enter(node.right as usize, region, hits);
        }
        for &tet in &self.tets[node.first as usize..node.last as usize] {
            self.flood.reach(tet, hits);
        }
    }
}

impl Search for SurfaceBoxes {
    fn find(&mut self, scene: &Scene, _: &mut MovingSurface, hits: &mut Hits) {
        self.update(scene.positions);
        self.lost.clear();
        for (i, &p) in scene.points.iter().enumerate().filter(|(_, p)| p.is_finite()) {
            self.lost.push(i as u32, p);
        }
        let region = self.lost.bounds();
        self.flood.begin();
        self.enter(0, &region, hits);
        for i in 0..self.last.len() {
            if self.last[i] != NONE {
                self.flood.reach(self.last[i], hits);
            }
        }
        self.flood.run(scene, &region, &mut self.lost, hits);
        self.last.copy_from_slice(&hits.tet);
    }

    fn reset(&mut self) {
        self.last.fill(NONE);
    }
}

/// The boxes over the surface.
pub const METHOD: Descriptor = Descriptor {
    is_complete: false,
    ..Descriptor::of("surface-boxes", "Bielser and Gross 2000", |inputs| Box::new(SurfaceBoxes::new(inputs)))
};
