//! Eight vectors at once, with the bits that one after the other would have.

use core::ops::{Add, Mul, Sub};
use trepan_geometry::Vec3;
use wide::f32x8;

/// Eight vectors.
#[derive(Clone, Copy)]
pub struct Vec3x8 {
    /// First coordinates.
    pub x: f32x8,
    /// Second coordinates.
    pub y: f32x8,
    /// Third coordinates.
    pub z: f32x8,
}

impl Vec3x8 {
    /// Eight vectors, lane by lane.
    #[inline]
    pub fn new(all: [Vec3; 8]) -> Self {
        Self { x: all.map(|v| v.x).into(), y: all.map(|v| v.y).into(), z: all.map(|v| v.z).into() }
    }

    /// Scalar products.
    #[inline]
    pub fn dot(self, other: Self) -> f32x8 {
        self.x * other.x + self.y * other.y + self.z * other.z
    }

    /// Vector products.
    #[inline]
    pub fn cross(self, other: Self) -> Self {
        Self {
            x: self.y * other.z - other.y * self.z,
            y: self.z * other.x - other.z * self.x,
            z: self.x * other.y - other.x * self.y,
        }
    }

    /// Lengths.
    #[inline]
    pub fn length(self) -> f32x8 {
        self.dot(self).sqrt()
    }

    /// Those of `self` where `which` has its bits, else those of `other`.
    #[inline]
    pub fn where_or(self, which: f32x8, other: Self) -> Self {
        Self { x: which.select(self.x, other.x), y: which.select(self.y, other.y), z: which.select(self.z, other.z) }
    }

    /// The vector of a lane.
    #[inline]
    pub fn lane(&self, lane: usize) -> Vec3 {
        Vec3::new(self.x.as_array()[lane], self.y.as_array()[lane], self.z.as_array()[lane])
    }
}

impl Add for Vec3x8 {
    type Output = Self;
    #[inline]
    fn add(self, other: Self) -> Self {
        Self { x: self.x + other.x, y: self.y + other.y, z: self.z + other.z }
    }
}

impl Sub for Vec3x8 {
    type Output = Self;
    #[inline]
    fn sub(self, other: Self) -> Self {
        Self { x: self.x - other.x, y: self.y - other.y, z: self.z - other.z }
    }
}

impl Mul<f32x8> for Vec3x8 {
    type Output = Self;
    #[inline]
    fn mul(self, times: f32x8) -> Self {
        Self { x: self.x * times, y: self.y * times, z: self.z * times }
    }
}
