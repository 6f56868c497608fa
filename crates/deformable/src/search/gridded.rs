//! A broad phase and the exact test on each of its pairs.

use crate::{
    broad::{BroadPhase, UniformGrid},
    narrow::{Hits, NONE},
    scene::Scene,
};

/// Pairs from a grid over the points; with one endless cell this is a plain scan over all boxes.
pub(crate) struct Gridded {
    grid: UniformGrid,
    pairs: Vec<[u32; 2]>,
}

/// Room for this many candidate tetrahedra at each point.
const CANDIDATES: usize = 64;

impl Gridded {
    pub(crate) fn new(cell_mm: f32, points: usize, tets: usize) -> Self {
        Self { grid: UniformGrid::new(cell_mm, points, tets), pairs: Vec::with_capacity(points * CANDIDATES) }
    }

    pub(crate) fn find(&mut self, scene: &Scene, hits: &mut Hits) {
        self.grid.update(scene.positions, scene.tets, &scene.ball_box());
        hits.overflow += self.grid.pairs(scene.points, &mut self.pairs);
        for &[point, tet] in &self.pairs {
            let i = point as usize;
            if hits.tet[i] == NONE {
                hits.test(i, scene.points[i], tet, scene.corners(tet));
            }
        }
    }
}
