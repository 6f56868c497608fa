//! Random starts that walk to their point and are remembered: fast, and never sure.
//!
//! # Theory
//! Pairs of features are drawn at random, each is improved locally, and good ones are kept for the
//! next step (survey of Teschner et al. 2005, section 5; Raghupathi et al. 2004). Here a pair is a
//! tool point and a tetrahedron, and improvement is the walk across the face towards the point
//! (`walk.rs`). A start is the tetrahedron of another point that was found, or any.
//!
//! # Practice
//! The same in every run: the generator's seed is fixed. Cost is set by [`DRAWN`], accuracy
//! follows: one trades for the other.
//!
//! # When not to use it
//! Where no point may be missed.
//!
//! # Sources
//! Teschner et al. 2005, section 5. Liberties: features are points and tetrahedra, where theirs are
//! pairs of edges or vertices; distance falls by barycentric coordinates.

use trepan_deformable::Descriptor;
use trepan_deformable::Search;
use trepan_deformable::kit::MovingSurface;
use trepan_deformable::kit::Scene;
use trepan_deformable::kit::walk;
use trepan_deformable::kit::{Hits, NONE};

/// Walks from random tetrahedra in one step, beside one for each point that has a start.
pub const DRAWN: usize = 24;

struct Stochastic {
    last: Vec<u32>,
    random: u64,
}

const SEED: u64 = 0x9e37_79b9_7f4a_7c15;

impl Stochastic {
    /// A number below `count`, by a shifting generator (Marsaglia 2003).
    fn below(&mut self, count: usize) -> usize {
        self.random ^= self.random << 13;
        self.random ^= self.random >> 7;
        self.random ^= self.random << 17;
        (self.random >> 33) as usize % count
    }
}

impl Search for Stochastic {
    fn find(&mut self, scene: &Scene, _: &mut MovingSurface, hits: &mut Hits) {
        let count = scene.points.len();
        for i in 0..count {
            if self.last[i] != NONE {
                walk(scene, i, self.last[i], hits);
            }
        }
        for _ in 0..DRAWN {
            let (i, tet) = (self.below(count), self.below(scene.tets.len()));
            if hits.tet[i] == NONE {
                walk(scene, i, tet as u32, hits);
            }
        }
        for i in 0..count {
            let start = hits.tet[self.below(count)];
            if hits.tet[i] == NONE && start != NONE {
                walk(scene, i, start, hits);
            }
        }
        self.last.copy_from_slice(&hits.tet);
    }

    fn reset(&mut self) {
        self.last.fill(NONE);
        self.random = SEED;
    }
}

/// The random starts.
pub const METHOD: Descriptor = Descriptor {
    is_complete: false,
    ..Descriptor::of("stochastic", "Teschner et al. 2005", |inputs| {
        Box::new(Stochastic { last: vec![NONE; inputs.points], random: SEED })
    })
};
