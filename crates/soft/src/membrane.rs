//! A thin membrane on a body's surface that carries tension only, such as the pia-arachnoid.
//!
//! # Theory
//! An incompressible neo-Hookean membrane has the energy `μt/2 (λ₁² + λ₂² + 1/(λ₁λ₂)² - 3)` for
//! each area at rest, with the stretches λ₁ ≥ λ₂ in its plane and its shear modulus times thickness
//! μt.
//! What would be compressed wrinkles instead (tension field: Pipkin, IMA J. Appl. Math. 36, 1986):
//! λ₂ is at least `λ₁^-1/2`, the width that a strip takes under tension, and no tension is
//! negative. With `C = Fᵀ F`, its eigenvalues l and eigenvectors n in the plane:
//! ```text
//! L = max(l₂, l₁^-1/2)   S = μt (max(0, 1 - 1/(l₁² L)) n₁n₁ᵀ + max(0, 1 - 1/(L² l₁)) n₂n₂ᵀ)
//! ```
//! No change of F meets more than 6 μt (both stretches grow, at rest), so on the nodes of a
//! triangle with area A and gradients g no stiffness is over `6 μt A λ_max(Σ g gᵀ)`.

use glam::{DMat2, DMat3, DVec2, DVec3};
use trepan_geometry::Vec3;

/// A membrane on the surface of a body.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Membrane {
    /// Corners of every triangle, mesh nodes; empty = no membrane.
    pub triangles: Vec<[u32; 3]>,
    /// Shear modulus times thickness, N/mm.
    pub shear_n_per_mm: f32,
}

/// Rest shape of a triangle of a membrane.
#[derive(Clone, Copy, Debug)]
pub struct TriangleShape {
    /// Area, mm².
    pub area_mm2: f64,
    /// Two perpendicular unit vectors in its plane.
    pub axes: [DVec3; 2],
    /// Gradients of the three shape functions along these, 1/mm.
    pub gradients: [DVec2; 3],
}

impl TriangleShape {
    /// The shape of a triangle with these rest corners, mm. Not finite for one without area.
    pub fn of(corners: [DVec3; 3]) -> Self {
        let [a, b] = [1, 2].map(|i| corners[i] - corners[0]);
        let first = a.normalize();
        let second = a.cross(b).cross(a).normalize();
        let edges = DMat2::from_cols(DVec2::new(a.dot(first), a.dot(second)), DVec2::new(b.dot(first), b.dot(second)));
        let inverse = edges.inverse().transpose();
        let gradients = [-inverse.x_axis - inverse.y_axis, inverse.x_axis, inverse.y_axis];
        Self { area_mm2: 0.5 * edges.determinant(), axes: [first, second], gradients }
    }

    /// Bound of the stiffness on its nodes, N/mm, for a membrane of 1 N/mm.
    fn stiffest(&self) -> f64 {
        let [xx, yy, xy] =
            self.gradients.iter().fold([0.0; 3], |[xx, yy, xy], g| [xx + g.x * g.x, yy + g.y * g.y, xy + g.x * g.y]);
        let largest = 0.5 * (xx + yy) + (0.25 * (xx - yy).powi(2) + xy * xy).sqrt();
        6.0 * self.area_mm2 * largest
    }

    /// Stiffness between each two corners at their present places, N/mm, for a membrane of 1 N/mm.
    ///
    /// `add` takes both and the block, the change of the force with the place; it is not called
    /// where the triangle is slack.
    pub(crate) fn stiffness(&self, now: [DVec3; 3], mut add: impl FnMut(usize, usize, DMat3)) {
        let along = |axis: fn(&DVec2) -> f64| (0..3).map(|a| now[a] * axis(&self.gradients[a])).sum::<DVec3>();
        let (f, g) = (along(|g| g.x), along(|g| g.y));
        let (mean, apart, shear) = (0.5 * (f.dot(f) + g.dot(g)), 0.5 * (f.dot(f) - g.dot(g)), f.dot(g));
        let radius = apart.hypot(shear);
        let (wide, narrow) = (mean + radius, mean - radius);
        // The eigenvector of the larger stretch, and what lies across it.
        let pull = DVec2::new(apart + radius, shear).try_normalize().unwrap_or(DVec2::Y);
        let (x, y) = (f * pull.x + g * pull.y, f * -pull.y + g * pull.x);
        // Tension along both, and its change with the square of either stretch.
        let ([of_wide, of_narrow], [ww, wn, nn]) = if narrow > wide.powf(-0.5) {
            let (w, n) = (1.0 / wide, 1.0 / narrow);
            ([1.0 - w * w * n, 1.0 - n * n * w], [2.0 * w * w * w * n, w * w * n * n, 2.0 * n * n * n * w])
        } else if wide > 1.0 {
            ([1.0 - wide.powf(-1.5), 0.0], [1.5 * wide.powf(-2.5), 0.0, 0.0])
        } else {
            return;
        };
        // What turns the pull: equal tensions turn with nothing but their change.
        let turning = if wide - narrow > 1e-9 { (of_wide - of_narrow) / (wide - narrow) } else { ww - wn };
        let outer = |a: DVec3, b: DVec3| DMat3::from_cols(a * b.x, a * b.y, a * b.z);
        let [of_x, of_y] = [pull, pull.perp()].map(|axis| self.gradients.map(|g| g.dot(axis)));
        let sheared = |a: usize| x * of_y[a] + y * of_x[a];
        for (a, b) in (0..3).flat_map(|a| (0..3).map(move |b| (a, b))) {
            let tension = of_wide * of_x[a] * of_x[b] + of_narrow * of_y[a] * of_y[b];
            let strain = (outer(x, x) * (ww * of_x[a] * of_x[b])
                + outer(y, y) * (nn * of_y[a] * of_y[b])
                + outer(x, y) * (wn * of_x[a] * of_y[b])
                + outer(y, x) * (wn * of_y[a] * of_x[b]))
                * 2.0;
            let block = strain + outer(sheared(a), sheared(b)) * turning + DMat3::from_diagonal(DVec3::splat(tension));
            add(a, b, block * self.area_mm2);
        }
    }
}

impl Membrane {
    /// Whether there is none.
    pub fn is_none(&self) -> bool {
        self.triangles.is_empty() || self.shear_n_per_mm == 0.0
    }

    /// Rest shape of a triangle.
    pub fn shape(&self, triangle: usize, positions: &[Vec3]) -> TriangleShape {
        TriangleShape::of(self.triangles[triangle].map(|n| positions[n as usize].as_dvec3()))
    }

    /// Stiffness, N/mm, that a triangle's never exceeds against any motion of its corners, however
    /// deformed it is.
    pub fn stiffest(&self, triangle: usize, positions: &[Vec3]) -> f64 {
        f64::from(self.shear_n_per_mm) * self.shape(triangle, positions).stiffest()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Energy of a triangle, N mm, by its definition.
    fn energy(rest: [DVec3; 3], now: [DVec3; 3]) -> f64 {
        let shape = TriangleShape::of(rest);
        let along = |axis: fn(DVec2) -> f64| (0..3).map(|a| now[a] * axis(shape.gradients[a])).sum::<DVec3>();
        let (f, g) = (along(|g| g.x), along(|g| g.y));
        let (half, r) = (0.5 * (f.dot(f) + g.dot(g)), (0.25 * (f.dot(f) - g.dot(g)).powi(2) + f.dot(g).powi(2)).sqrt());
        let l1 = (half + r).max(1.0);
        let l2 = (half - r).max(l1.powf(-0.5));
        0.5 * shape.area_mm2 * (l1 + l2 + 1.0 / (l1 * l2) - 3.0)
    }

    proptest! {
        #[test]
        fn no_motion_of_the_corners_is_stiffer_than_the_bound(
            x in proptest::array::uniform9(-0.5f64..0.5),
            d in proptest::array::uniform9(-1.0f64..1.0),
        ) {
            let rest = [DVec3::ZERO, DVec3::new(1.2, 0.1, 0.0), DVec3::new(0.4, 0.9, 0.2)];
            let by = |v: [f64; 9], s: f64| [0, 1, 2].map(|a| s * DVec3::new(v[3 * a], v[3 * a + 1], v[3 * a + 2]));
            let at = |s: f64| {
                let (now, step) = (by(x, 1.0), by(d, s));
                energy(rest, [0, 1, 2].map(|a| rest[a] + now[a] + step[a]))
            };
            let h = 1e-4;
            let second = (at(h) - 2.0 * at(0.0) + at(-h)) / (h * h);
            let length = d.iter().map(|d| d * d).sum::<f64>();
            let bound = TriangleShape::of(rest).stiffest();
            prop_assert!(second <= 1.001 * bound * length + 1e-5, "{second} {}", bound * length);
        }
    }

    #[test]
    fn the_stiffness_is_the_second_change_of_the_energy() {
        let rest = [DVec3::ZERO, DVec3::new(1.2, 0.1, 0.0), DVec3::new(0.4, 0.9, 0.2)];
        let shape = TriangleShape::of(rest);
        let states = [(1e-3, 5e-4, true), (0.2, 0.1, true), (0.1, 0.1, true), (0.3, -0.2, true), (-0.1, -0.2, false)];
        for (wide, narrow, is_stiff) in states {
            let [x, y] = shape.axes;
            let now = rest.map(|p| p + x * (wide * p.dot(x)) + y * (narrow * p.dot(y)));
            let mut dense = vec![[DMat3::ZERO; 3]; 3];
            shape.stiffness(now, |a, b, block| dense[a][b] += block);
            let step = [x * 0.3 - y * 0.2, y * 0.7 + x.cross(y) * 0.6, x * -0.4 - y * 0.1];
            let h = 1e-4;
            let at = |s: f64| energy(rest, [0, 1, 2].map(|a| now[a] + step[a] * (s * h)));
            let second = (at(1.0) - 2.0 * at(0.0) + at(-1.0)) / (h * h);
            let product = |a: usize, b: usize| step[a].dot(dense[a][b] * step[b]);
            let found: f64 = (0..9).map(|k| product(k / 3, k % 3)).sum();
            assert_eq!(found > 1e-3, is_stiff, "{wide} {narrow}: {found} of {second}");
            assert!((found - second).abs() < 1e-4 * second + 1e-7, "{wide} {narrow}: {found} of {second}");
        }
    }

    #[test]
    fn a_strip_under_tension_narrows_and_has_three_times_the_shear_modulus() {
        let rest = [DVec3::ZERO, DVec3::X, DVec3::Y];
        let stretched = |l: f64, width: f64| energy(rest, [DVec3::ZERO, DVec3::X * l, DVec3::Y * width]);
        let l: f64 = 1.02;
        let second = (stretched(l, 1.0 / l.sqrt()) - 0.0) * 2.0 / (l - 1.0).powi(2) / 0.5;
        assert!((second - 3.0).abs() < 0.1, "{second}");
        assert_eq!(stretched(l, 0.8), stretched(l, 0.7), "it wrinkles");
        assert_eq!(stretched(0.9, 0.8), 0.0, "it is slack");
    }
}
