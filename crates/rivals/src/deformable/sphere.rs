//! Balls as bounding volumes (Hubbard 1996).
//!
//! # Theory
//! The ball of some nodes is centred in their box and reaches the furthest of them. A margin m
//! along each axis is at most √3 m along any direction.
//!
//! # Practice
//! 16 bytes and one distance for each test, the same in every direction.
//!
//! # Sources
//! Hubbard 1996, section 3: a tree of balls, tested top-down. Liberties: his balls come from the
//! medial axis of a rigid body, these from halving the tetrahedra. James and Pai 2004 move balls by
//! reduced coordinates, which a mesh of free nodes does not have.

use super::volume_tree::{Volume, search};
use trepan_deformable::Descriptor;
use trepan_deformable::kit::Extent;
use trepan_geometry::Vec3;

/// A ball.
#[derive(Clone, Copy, Debug)]
pub struct Sphere {
    centre: Vec3,
    radius: f32,
}

/// Rounding of radius and distance, as a share of their size.
const ROUNDING: f32 = 1e-6;

impl Volume for Sphere {
    fn around(points: impl Iterator<Item = Vec3> + Clone) -> Self {
        let mut extent = Extent::EMPTY;
        points.clone().for_each(|p| extent.grow(p));
        let centre = Vec3::from(0.5 * (extent.low + extent.high));
        let radius = points.map(|p| p.distance_squared(centre)).fold(0.0, f32::max).sqrt();
        Self { centre, radius: radius + ROUNDING * (radius + centre.abs().max_element()) }
    }

    #[inline]
    fn meets(&self, low: Vec3, high: Vec3, margin_mm: f32) -> bool {
        let reach = (self.radius + 3f32.sqrt() * margin_mm) * (1.0 + ROUNDING);
        (low - self.centre).max(self.centre - high).max(Vec3::ZERO).length_squared() <= reach * reach
    }

    fn size_mm(&self) -> f32 {
        2.0 * self.radius
    }
}

/// A tree of balls.
pub const METHOD: Descriptor = Descriptor::of("sphere-tree", "Hubbard 1996", search::<Sphere>);
