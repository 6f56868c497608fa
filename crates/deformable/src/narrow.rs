//! The exact test: barycentric coordinates of a point in a tetrahedron.
//!
//! # Theory
//! `p = αa + βb + γc + δd` with `α + β + γ + δ = 1`; the point is inside or on the border when all four are 0 or more (thesis
//! 4.2.2, Teschner et al. 2003). Each coordinate is a ratio of two triple products.
//!
//! # Practice
//! In f64 on purpose: the corners are f32, so their differences are exact to rounding 1e-16, all methods decide alike, and a
//! point on a shared face is never lost between its two tetrahedra. 15 ns.

use trepan_geometry::Vec3;

/// No tetrahedron, no triangle.
pub(crate) const NONE: u32 = u32::MAX;

/// How far outside, in barycentric units, still counts as on the border.
const BORDER: f64 = 1e-9;

/// Which tetrahedron holds each point.
#[derive(Clone, Debug, Default)]
pub(crate) struct Hits {
    /// Tetrahedron of each point, or [`NONE`].
    pub tet: Vec<u32>,
    /// Barycentric coordinates of each point that has one.
    pub weights: Vec<[f32; 4]>,
    /// Exact tests made.
    pub tests: u32,
    /// Tetrahedra met that have no positive volume, or none at all.
    pub skipped: u32,
    /// Candidates that did not fit.
    pub overflow: u32,
}

impl Hits {
    pub(crate) fn with_points(count: usize) -> Self {
        Self { tet: vec![NONE; count], weights: vec![[0.0; 4]; count], ..Self::default() }
    }

    pub(crate) fn clear(&mut self) {
        self.tet.fill(NONE);
        (self.tests, self.skipped, self.overflow) = (0, 0, 0);
    }

    /// Tests point `i` at `p` against a tetrahedron and keeps it when inside. Returns the coordinates for a walk.
    pub(crate) fn test(&mut self, i: usize, p: Vec3, tet: u32, corners: [Vec3; 4]) -> Option<[f64; 4]> {
        self.tests += 1;
        let Some(weights) = barycentric(corners, p) else {
            self.skipped += 1;
            return None;
        };
        if is_inside(&weights) {
            self.tet[i] = tet;
            self.weights[i] = weights.map(|w| w as f32);
        }
        Some(weights)
    }
}

/// The four coordinates, or `None` for a tetrahedron without positive, finite volume (inverted, flat, NaN).
pub(crate) fn barycentric(corners: [Vec3; 4], point: Vec3) -> Option<[f64; 4]> {
    let [a, b, c, d] = corners.map(Vec3::as_dvec3);
    let (ab, ac, ad, ap) = (b - a, c - a, d - a, point.as_dvec3() - a);
    let (ac_ad, ap_ab) = (ac.cross(ad), ap.cross(ab));
    let volume = ab.dot(ac_ad);
    if !(volume > 0.0 && volume.is_finite()) {
        return None;
    }
    let beta = ap.dot(ac_ad) / volume;
    let gamma = -ad.dot(ap_ab) / volume;
    let delta = ac.dot(ap_ab) / volume;
    Some([1.0 - beta - gamma - delta, beta, gamma, delta])
}

/// Whether a point with these coordinates lies inside or on the border.
pub(crate) fn is_inside(weights: &[f64; 4]) -> bool {
    weights.iter().all(|&w| w >= -BORDER)
}
