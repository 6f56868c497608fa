//! Directions spread evenly over the sphere, and which of them are neighbours.

use glam::DVec3;
use std::f64::consts::PI;
use std::sync::OnceLock;

/// How many.
pub const COUNT: usize = 4000;
/// Neighbours of each.
const NEIGHBOURS: usize = 6;
/// Solid angle of each, sr.
pub const SHARE: f64 = 4.0 * PI / COUNT as f64;

/// The directions of all balls.
pub struct Directions {
    /// Unit vectors.
    pub all: Vec<DVec3>,
    /// Of each the nearest others.
    pub beside: Vec<[u16; NEIGHBOURS]>,
}

impl Directions {
    /// The directions, made once.
    pub fn get() -> &'static Self {
        static MADE: OnceLock<Directions> = OnceLock::new();
        MADE.get_or_init(Self::make)
    }

    /// Points of a Fibonacci lattice.
    fn make() -> Self {
        let golden = PI * (3.0 - 5f64.sqrt());
        let at = |i: usize| {
            let z = 1.0 - (2.0 * i as f64 + 1.0) / COUNT as f64;
            let (sin, cos) = (golden * i as f64).sin_cos();
            DVec3::new(cos, sin, 0.0) * (1.0 - z * z).sqrt() + z * DVec3::Z
        };
        let all: Vec<DVec3> = (0..COUNT).map(at).collect();
        let nearest = |u: &DVec3| {
            let mut others: Vec<(f64, u16)> = all.iter().zip(0..).map(|(v, n)| (u.distance_squared(*v), n)).collect();
            others.select_nth_unstable_by(NEIGHBOURS, |a, b| a.0.total_cmp(&b.0));
            let mut found = others.iter().filter(|(apart, _)| *apart > 0.0).map(|(_, n)| *n);
            std::array::from_fn(|_| found.next().expect("there are more directions than neighbours"))
        };
        let beside = all.iter().map(nearest).collect();
        Self { all, beside }
    }
}
