//! Balls as bounding volumes (Hubbard 1996; refitted as in James and Pai 2004's BD-tree, but
//! bottom-up).
//!
//! # Theory
//! The ball of two balls with centres a distance d apart: the larger one, when it holds the other
//! (r ≥ d + s), else one of radius (d + r + s)/2 on the line through both centres. A tetrahedron's
//! ball is round its centroid.
//!
//! # Practice
//! 16 bytes and one distance for each test, the same in every direction; each merge loosens the
//! ball, so the upper levels are much larger than what they hold.

use super::volume_tree::{Volume, search};
use crate::method::Descriptor;
use trepan_geometry::Vec3;

/// A ball; empty when its radius is negative.
#[derive(Clone, Copy, Debug)]
pub struct Sphere {
    centre: Vec3,
    radius: f32,
}

/// Rounding of radius and centre, as a share of their size.
const ROUNDING: f32 = 4e-7;

impl Volume for Sphere {
    fn for_points(_: &[Vec3]) -> Self {
        Self { centre: Vec3::ZERO, radius: -1.0 }
    }

    fn clear(&mut self) {
        self.radius = -1.0;
    }

    fn add_corners(&mut self, corners: &[Vec3; 4]) {
        let centre = corners.iter().sum::<Vec3>() * 0.25;
        let radius = corners.iter().map(|c| c.distance_squared(centre)).fold(0.0, f32::max).sqrt();
        self.add_child(&Self { centre, radius: radius + ROUNDING * (radius + centre.abs().max_element()) });
    }

    fn add_child(&mut self, child: &Self) {
        let apart = self.centre.distance(child.centre);
        if child.radius < 0.0 || self.radius >= apart + child.radius {
            return;
        }
        if self.radius < 0.0 || child.radius >= apart + self.radius {
            return *self = *child;
        }
        let radius = 0.5 * (apart + self.radius + child.radius);
        self.centre += (child.centre - self.centre) * ((radius - self.radius) / apart);
        self.radius = radius + ROUNDING * (radius + self.centre.abs().max_element());
    }

    fn holds(&self, p: Vec3) -> bool {
        self.radius >= 0.0 && self.centre.distance_squared(p) <= self.radius * self.radius * (1.0 + ROUNDING)
    }
}

/// A tree of balls.
pub const METHOD: Descriptor = Descriptor::of("sphere-tree", "Hubbard 1996", search::<Sphere>);
