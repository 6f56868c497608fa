//! The oracle: every point against every tetrahedron, in f64.
//!
//! # When not to use it
//! In anything but tests and charts: 212 points against 22 thousand tetrahedra take 70 ms.

use crate::{
    narrow::{Hits, NONE},
    scene::Scene,
};

/// No structure, no memory.
pub(crate) struct Brute;

impl Brute {
    pub(crate) fn find(&mut self, scene: &Scene, hits: &mut Hits) {
        for tet in 0..scene.tets.len() as u32 {
            for i in 0..scene.points.len() {
                if hits.tet[i] == NONE {
                    hits.test(scene, i, tet);
                }
            }
        }
    }
}
