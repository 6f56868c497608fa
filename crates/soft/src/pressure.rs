//! Pressure of a fluid on some triangles of a body's surface.
//!
//! # Theory
//! On a triangle with corners a, b, c, counter-clockwise seen from outside, pressure p pushes
//! inwards with `p A = p/2 (b - a) × (c - a)`, a third of it on each corner. It follows the surface
//! as that moves and turns.

use glam::DVec3;
use trepan_geometry::Vec3;

/// Pressure on a surface.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SurfacePressure {
    /// Corners of every triangle, mesh nodes, counter-clockwise seen from outside
    /// ([`trepan_mesh::Surface`] gives them so).
    pub triangles: Vec<[u32; 3]>,
    /// Pressure p, MPa; positive pushes inwards (10 mmHg = 1.33e-3).
    pub mpa: f32,
}

impl SurfacePressure {
    /// Calls `push` with every corner and the force on it, N, for a surface whose nodes are at
    /// `position`. Triangles of nodes that do not exist are the caller's to leave out.
    #[inline]
    pub fn each(&self, position: impl Fn(u32) -> Vec3, mut push: impl FnMut(u32, Vec3)) {
        for &[a, b, c] in &self.triangles {
            let (pa, pb, pc) = (position(a), position(b), position(c));
            let force = (pb - pa).cross(pc - pa) * (-self.mpa / 6.0);
            [a, b, c].into_iter().for_each(|n| push(n, force));
        }
    }

    /// The same in f64, added to `to` by node.
    pub(crate) fn add_to(&self, positions: &[DVec3], to: &mut [DVec3]) {
        for &[a, b, c] in &self.triangles {
            let [pa, pb, pc] = [a, b, c].map(|n| positions[n as usize]);
            let force = (pb - pa).cross(pc - pa) * (f64::from(self.mpa) / -6.0);
            [a, b, c].into_iter().for_each(|n| to[n as usize] += force);
        }
    }
}
