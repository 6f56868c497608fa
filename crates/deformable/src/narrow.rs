//! The exact test: barycentric coordinates of a point in a tetrahedron.
//!
//! # Theory
//! `p = αa + βb + γc + δd` with `α + β + γ + δ = 1`; the point is inside or on the border when all
//! four are 0 or more (thesis 4.2.2, Teschner et al. 2003). Each coordinate is a ratio of two
//! triple products.
//!
//! # Practice
//! In f64 on purpose: the corners are f32, so their differences are exact to rounding 1e-16, all
//! methods decide alike, and a point on a shared face is never lost between its two tetrahedra. 15
//! ns for the first point in a tetrahedron, 4 ns for each further one.

use crate::scene::Scene;
use glam::DVec3;
use trepan_geometry::Vec3;

/// No tetrahedron, no triangle.
pub const NONE: u32 = u32::MAX;

/// How far outside, in barycentric units, still counts as on the border.
const BORDER: f64 = 1e-9;

/// Which tetrahedron holds each point.
#[derive(Clone, Debug)]
pub struct Hits {
    /// Tetrahedron of each point, or [`NONE`].
    pub tet: Vec<u32>,
    /// Barycentric coordinates of each point that has one.
    pub weights: Vec<[f32; 4]>,
    /// Exact tests made.
    pub tests: u32,
    /// Tetrahedra met that have no positive volume, or none at all.
    pub skipped: u32,
    /// The last of these.
    pub last_skipped: u32,
    /// Candidates that did not fit.
    pub overflow: u32,
    /// Frames of this step's last tetrahedra, by their number's last bits.
    frames: [Framed; FRAMES],
}

/// A tetrahedron and its frame, `None` when it has no positive, finite volume.
type Framed = (u32, Option<Frame>);

/// Frames kept: neighbouring points ask for the same few.
const FRAMES: usize = 16;

impl Hits {
    /// Room for so many points.
    pub fn with_points(count: usize) -> Self {
        Self {
            tet: vec![NONE; count],
            weights: vec![[0.0; 4]; count],
            tests: 0,
            skipped: 0,
            last_skipped: 0,
            overflow: 0,
            frames: [(NONE, None); FRAMES],
        }
    }

    /// Forgets all.
    pub fn clear(&mut self) {
        self.tet.fill(NONE);
        (self.tests, self.skipped, self.overflow) = (0, 0, 0);
        self.frames = [(NONE, None); FRAMES];
    }

    /// Tests point `i` against a tetrahedron and keeps it when inside. Returns the coordinates for
    /// a walk; none from a tetrahedron that was taken away.
    #[inline]
    pub fn test(&mut self, scene: &Scene, i: usize, tet: u32) -> Option<[f64; 4]> {
        self.tests += 1;
        if !scene.is_live(tet) {
            return None;
        }
        let slot = &mut self.frames[tet as usize % FRAMES];
        if slot.0 != tet {
            *slot = (tet, Frame::of(scene.corners(tet)));
        }
        let Some(frame) = &slot.1 else {
            self.skipped += 1;
            self.last_skipped = tet;
            return None;
        };
        let weights = frame.weights(scene.points[i]);
        if is_inside(&weights) {
            self.tet[i] = tet;
            self.weights[i] = weights.map(|weight| weight as f32);
        }
        Some(weights)
    }
}

/// A tetrahedron's first corner and the gradients of the three other corners' coordinates, 1/mm.
#[derive(Clone, Copy, Debug)]
struct Frame {
    origin: DVec3,
    gradients: [DVec3; 3],
}

impl Frame {
    /// `None` for a tetrahedron without positive, finite volume (inverted, flat, NaN).
    #[inline]
    fn of([a, b, c, d]: [Vec3; 4]) -> Option<Self> {
        let origin = a.as_dvec3();
        let (ab, ac, ad) = (b.as_dvec3() - origin, c.as_dvec3() - origin, d.as_dvec3() - origin);
        let facing_b = ac.cross(ad);
        let volume = ab.dot(facing_b);
        if !is_volume(volume) {
            return None;
        }
        let per_volume = 1.0 / volume;
        let gradients = [facing_b * per_volume, ad.cross(ab) * per_volume, ab.cross(ac) * per_volume];
        Some(Self { origin, gradients })
    }

    /// The four coordinates of a point.
    #[inline]
    fn weights(&self, point: Vec3) -> [f64; 4] {
        let from_a = point.as_dvec3() - self.origin;
        let [b, c, d] = &self.gradients;
        let (b, c, d) = (from_a.dot(*b), from_a.dot(*c), from_a.dot(*d));
        [1.0 - b - c - d, b, c, d]
    }
}

/// Whether a tetrahedron has positive, finite volume, by the same arithmetic as the exact test.
#[inline]
pub fn is_sound([a, b, c, d]: [Vec3; 4]) -> bool {
    let origin = a.as_dvec3();
    is_volume((b.as_dvec3() - origin).dot((c.as_dvec3() - origin).cross(d.as_dvec3() - origin)))
}

#[inline]
fn is_volume(volume: f64) -> bool {
    volume > 0.0 && volume < f64::INFINITY
}

/// Whether a point with these coordinates lies inside or on the border.
#[inline]
pub fn is_inside(weights: &[f64; 4]) -> bool {
    weights[0].min(weights[1]).min(weights[2].min(weights[3])) >= -BORDER
}
