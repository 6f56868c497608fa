//! Discrete oriented polytopes with 18 sides as bounding volumes (Klosowski et al. 1998).
//!
//! # Theory
//! The slabs between the least and the greatest value of `x·d` along nine fixed directions: the
//! three axes and the six diagonals of their planes. A margin m along each axis is 2 m along a
//! diagonal `(1, ±1, 0)`.
//!
//! # Practice
//! 72 bytes; a fit costs three times that of boxes, a test up to nine slabs; holds slanted parts
//! more tightly.
//!
//! # Sources
//! Klosowski et al. 1998, section 3 (k-DOPs, k = 18 among those tried) and section 4 (descent).
//! Liberties: both trees there are of k-DOPs, here the tool is its box.

use super::volume_tree::{Volume, search};
use trepan_deformable::Descriptor;
use trepan_geometry::Vec3;

/// An 18-DOP.
#[derive(Clone, Copy, Debug)]
pub struct KDop {
    low: [f32; SLABS],
    high: [f32; SLABS],
}

const SLABS: usize = 9;

/// A point along the nine directions.
#[inline]
fn along(p: Vec3) -> [f32; SLABS] {
    let Vec3 { x, y, z } = p;
    [x, y, z, x + y, x - y, y + z, y - z, z + x, z - x]
}

/// Rounding of a slanted coordinate, as a share of its size.
const ROUNDING: f32 = 1e-6;

impl Volume for KDop {
    fn around(points: impl Iterator<Item = Vec3> + Clone) -> Self {
        let mut dop = Self { low: [f32::INFINITY; SLABS], high: [f32::NEG_INFINITY; SLABS] };
        for at in points.map(along) {
            for slab in 0..SLABS {
                dop.low[slab] = dop.low[slab].min(at[slab]);
                dop.high[slab] = dop.high[slab].max(at[slab]);
            }
        }
        dop
    }

    #[inline]
    fn meets(&self, low: Vec3, high: Vec3, margin_mm: f32) -> bool {
        // Least and greatest value of the box along each direction.
        let (a, b) = (low, high);
        let least = [a.x, a.y, a.z, a.x + a.y, a.x - b.y, a.y + a.z, a.y - b.z, a.z + a.x, a.z - b.x];
        let most = [b.x, b.y, b.z, b.x + b.y, b.x - a.y, b.y + b.z, b.y - a.z, b.z + b.x, b.z - a.x];
        (0..SLABS).all(|slab| {
            let room = 2.0 * margin_mm + ROUNDING * (least[slab].abs() + most[slab].abs());
            self.low[slab] - room <= most[slab] && least[slab] <= self.high[slab] + room
        })
    }

    fn size_mm(&self) -> f32 {
        (0..3).map(|axis| self.high[axis] - self.low[axis]).fold(0.0, f32::max)
    }
}

/// A tree of polytopes with 18 sides.
pub const METHOD: Descriptor = Descriptor::of("k-dop-tree", "Klosowski et al. 1998", search::<KDop>);
