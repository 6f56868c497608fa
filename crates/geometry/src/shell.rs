//! Pointshells: points on a tool's surface with inward normals.
//!
//! # Theory
//! McNeely et al. 1999 cover the moving object with points that each carry an inward normal; a
//! voxel that contains a point gives a contact. The thesis (Eq 3.1) places the points of a sphere
//! at equal steps of latitude and longitude, which concentrates them at the poles: steps of 10
//! degrees give 466 points in principle, many times denser at the poles than at the equator. A
//! Fibonacci lattice (González 2010, Mathematical Geosciences 42, Eq 1) spreads any number evenly.
//!
//! # Practice
//! 466 points for a burr on bone, 211 for a probe on tissue (thesis, 3.4.1 and 4.4). Built once at
//! load time; the loop transforms the points by the tool's pose.

use crate::Vec3;

/// Distribution of the points over the sphere.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Spread {
    /// Even spread, any count.
    #[default]
    Fibonacci,
    /// The thesis's Eq 3.1: equal angles, dense at the poles. For comparison only.
    LatitudeLongitude,
}

/// Points on a tool's surface in the tool frame, with unit normals into the tool.
#[derive(Clone, Debug, PartialEq)]
pub struct Pointshell {
    /// Positions, tool frame, mm.
    pub points: Vec<Vec3>,
    /// Unit normals, pointing into the tool; one for each point.
    pub inward_normals: Vec<Vec3>,
}

impl Pointshell {
    /// Number of points of the thesis's rigid shell.
    pub const RIGID_COUNT: usize = 466;
    /// Number of points of the thesis's deformable shell.
    pub const DEFORMABLE_COUNT: usize = 211;

    /// A sphere around the tool's origin. `LatitudeLongitude` rounds `count` to the nearest full
    /// grid of rings plus the two poles.
    pub fn sphere(radius_mm: f32, count: usize, spread: Spread) -> Self {
        let directions = match spread {
            Spread::Fibonacci => fibonacci(count),
            Spread::LatitudeLongitude => latitude_longitude(count),
        };
        Self {
            points: directions.iter().map(|&d| d * radius_mm).collect(),
            inward_normals: directions.iter().map(|&d| -d).collect(),
        }
    }

    /// Each point with its inward normal.
    pub fn iter(&self) -> impl Iterator<Item = (Vec3, Vec3)> {
        self.points.iter().copied().zip(self.inward_normals.iter().copied())
    }
}

/// `count` unit directions on the Fibonacci lattice.
fn fibonacci(count: usize) -> Vec<Vec3> {
    let golden_angle = core::f64::consts::PI * (3.0 - 5.0f64.sqrt());
    (0..count)
        .map(|i| {
            let z = 1.0 - (2.0 * i as f64 + 1.0) / count as f64;
            let ring = (1.0 - z * z).sqrt();
            let angle = golden_angle * i as f64;
            Vec3::new((ring * angle.cos()) as f32, (ring * angle.sin()) as f32, z as f32)
        })
        .collect()
}

/// Rings of equal latitude step and equal count, and the poles; about `count` directions in total.
fn latitude_longitude(count: usize) -> Vec<Vec3> {
    let rings = (((count.max(8) - 2) as f64 / 2.0).sqrt()).round().max(2.0) as usize;
    let per_ring = ((count.max(8) - 2) as f64 / rings as f64).round() as usize;
    let mut directions = vec![Vec3::Z, Vec3::NEG_Z];
    for ring in 1..=rings {
        let beta = core::f64::consts::PI * ring as f64 / (rings + 1) as f64;
        for step in 0..per_ring {
            let alpha = core::f64::consts::TAU * step as f64 / per_ring as f64;
            directions.push(Vec3::new(
                (alpha.cos() * beta.sin()) as f32,
                (alpha.sin() * beta.sin()) as f32,
                beta.cos() as f32,
            ));
        }
    }
    directions
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Ratio of the largest to the smallest nearest-neighbour distance.
    fn unevenness(shell: &Pointshell) -> f32 {
        let nearest = |i: usize| {
            let p = shell.points[i];
            shell
                .points
                .iter()
                .enumerate()
                .filter(|&(j, _)| j != i)
                .map(|(_, q)| p.distance(*q))
                .fold(f32::MAX, f32::min)
        };
        let all: Vec<f32> = (0..shell.points.len()).map(nearest).collect();
        all.iter().copied().fold(0.0, f32::max) / all.iter().copied().fold(f32::MAX, f32::min)
    }

    #[test]
    fn the_default_spread_is_even_and_the_printed_one_is_not() {
        let even = Pointshell::sphere(2.0, Pointshell::RIGID_COUNT, Spread::Fibonacci);
        let crowded = Pointshell::sphere(2.0, Pointshell::RIGID_COUNT, Spread::LatitudeLongitude);
        assert_eq!(even.points.len(), 466);
        assert!(unevenness(&even) < 1.6, "{}", unevenness(&even));
        assert!(unevenness(&crowded) > 3.0, "{}", unevenness(&crowded));
    }

    #[test]
    fn normals_point_inwards_and_are_units() {
        for spread in [Spread::Fibonacci, Spread::LatitudeLongitude] {
            let shell = Pointshell::sphere(3.0, Pointshell::DEFORMABLE_COUNT, spread);
            for (p, n) in shell.points.iter().zip(&shell.inward_normals) {
                assert!((p.length() - 3.0).abs() < 1e-5);
                assert!((*p + *n * 3.0).length() < 1e-5);
            }
        }
    }
}
