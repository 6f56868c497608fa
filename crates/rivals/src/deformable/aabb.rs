//! Axis-aligned boxes as bounding volumes (van den Bergen 1997).
//!
//! # Practice
//! The cheapest to fit, 32 bytes and six comparisons; the loosest round slanted parts.
//!
//! # Sources
//! Van den Bergen 1997; see `volume_tree.rs` for what is refitted when.

use super::volume_tree::{Volume, search};
use trepan_deformable::Descriptor;
use trepan_deformable::kit::Extent;
use trepan_geometry::Vec3;

/// An axis-aligned box.
#[derive(Clone, Copy, Debug)]
pub struct Aabox(Extent);

impl Volume for Aabox {
    fn around(points: impl Iterator<Item = Vec3> + Clone) -> Self {
        let mut extent = Extent::EMPTY;
        points.for_each(|p| extent.grow(p));
        Self(extent)
    }

    #[inline]
    fn meets(&self, low: Vec3, high: Vec3, margin_mm: f32) -> bool {
        self.0.widened(margin_mm).overlaps(&Extent { low: low.into(), high: high.into() })
    }

    fn size_mm(&self) -> f32 {
        (self.0.high - self.0.low).max_element()
    }
}

/// A tree of boxes.
pub const METHOD: Descriptor = Descriptor::of("aabb-tree", "van den Bergen 1997", search::<Aabox>);
