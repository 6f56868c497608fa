//! A broad phase and the exact test on each of its pairs.

use crate::{
    broad::BroadPhase,
    narrow::{Hits, NONE},
    scene::Scene,
};

/// Any [`BroadPhase`] and room for its pairs.
pub(crate) struct Phased {
    phase: Box<dyn BroadPhase>,
    pairs: Vec<[u32; 2]>,
}

/// Room for this many candidate tetrahedra at each point.
const CANDIDATES: usize = 64;

impl Phased {
    pub(crate) fn new(phase: impl BroadPhase + 'static, points: usize) -> Self {
        Self { phase: Box::new(phase), pairs: Vec::with_capacity(points * CANDIDATES) }
    }

    pub(crate) fn find(&mut self, scene: &Scene, hits: &mut Hits) {
        self.phase.update(scene.positions, scene.tets, &scene.ball_box());
        hits.overflow += self.phase.pairs(scene.points, &mut self.pairs);
        for &[point, tet] in &self.pairs {
            let i = point as usize;
            if hits.tet[i] == NONE {
                hits.test(scene, i, tet);
            }
        }
    }
}
