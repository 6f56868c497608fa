//! Discrete oriented polytopes with 18 sides as bounding volumes (Klosowski et al. 1998).
//!
//! # Theory
//! The slabs between the least and the greatest value of `x·d` along nine fixed directions: the
//! three axes and the six diagonals of their planes. The hull of two is the wider slab along each
//! direction.
//!
//! # Practice
//! 72 bytes; a refit costs three times that of boxes, a test up to nine slabs; holds slanted parts
//! more tightly.

use super::volume_tree::{Volume, search};
use crate::method::Descriptor;
use trepan_geometry::Vec3;

/// An 18-DOP; empty when a `low` exceeds its `high`.
#[derive(Clone, Copy, Debug)]
pub struct KDop {
    low: [f32; SLABS],
    high: [f32; SLABS],
}

const SLABS: usize = 9;

const EMPTY: KDop = KDop { low: [f32::INFINITY; SLABS], high: [f32::NEG_INFINITY; SLABS] };

/// A point along the nine directions. Corners and points take the same sums, so rounding loses
/// nothing along one direction.
#[inline]
fn along(p: Vec3) -> [f32; SLABS] {
    let Vec3 { x, y, z } = p;
    [x, y, z, x + y, x - y, y + z, y - z, z + x, z - x]
}

impl Volume for KDop {
    fn for_points(_: &[Vec3]) -> Self {
        EMPTY
    }

    fn clear(&mut self) {
        *self = EMPTY;
    }

    fn add_corners(&mut self, corners: &[Vec3; 4]) {
        corners.map(along).iter().for_each(|&at| self.add_child(&Self { low: at, high: at }));
    }

    fn add_child(&mut self, child: &Self) {
        for slab in 0..SLABS {
            self.low[slab] = self.low[slab].min(child.low[slab]);
            self.high[slab] = self.high[slab].max(child.high[slab]);
        }
    }

    fn holds(&self, p: Vec3) -> bool {
        let at = along(p);
        (0..SLABS).all(|slab| {
            let room = ROUNDING * at[slab].abs();
            self.low[slab] - room <= at[slab] && at[slab] <= self.high[slab] + room
        })
    }
}

/// A point inside a tetrahedron may be rounded to outside a slanted slab by this share.
const ROUNDING: f32 = 4e-7;

/// A tree of polytopes with 18 sides.
pub const METHOD: Descriptor = Descriptor::of("k-dop-tree", "Klosowski et al. 1998", search::<KDop>);
