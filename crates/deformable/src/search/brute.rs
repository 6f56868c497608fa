//! The oracle: every point against every tetrahedron, in f64.
//!
//! # When not to use it
//! In anything but tests and charts: 212 points against 22 thousand tetrahedra take 70 ms.

use crate::method::Descriptor;
use crate::narrow::{Hits, NONE};
use crate::scene::Scene;
use crate::seam::Search;
use crate::surface::MovingSurface;

/// No structure, no memory.
struct Brute;

/// The oracle.
pub const METHOD: Descriptor = Descriptor { is_oracle: true, ..Descriptor::of("brute", "none", |_| Box::new(Brute)) };

impl Search for Brute {
    fn find(&mut self, scene: &Scene, _: &mut MovingSurface, hits: &mut Hits) {
        for tet in 0..scene.tets.len() as u32 {
            for i in 0..scene.points.len() {
                if hits.tet[i] == NONE {
                    hits.test(scene, i, tet);
                }
            }
        }
    }
}
