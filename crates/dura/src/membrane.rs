//! The law of a thin sheet that bears tension and no pressure.
//!
//! # Theory
//! A sheet of Saint Venant and Kirchhoff in plane stress, with the Green strain E, the product of
//! Young's modulus and thickness Eh, and Poisson's ratio ν:
//! ```text
//! S = Eh / (1 - ν²) ((1 - ν) E + ν tr(E) 1)
//! ```
//! What would be compressed wrinkles instead (tension field: Pipkin, IMA J. Appl. Math. 36, 1986).
//! With the principal strains e₁ ≥ e₂ it is slack for `e₁ ≤ 0`, and for `e₂ < -ν e₁` bears
//! `S = Eh e₁` along the first alone. Both join without a step.

use glam::Vec2;
use trepan_geometry::Vec3;

/// Stiffness of a sheet.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Law {
    /// Young's modulus times thickness, N/mm.
    pub stretch_n_per_mm: f32,
    /// Poisson's ratio.
    pub poisson: f32,
    /// Strain in every direction at rest.
    pub strain: f32,
    /// Green strain at which it tears.
    pub tears_at: f32,
    /// Pressure of the brain below for a way inwards, N/mm³.
    pub below: f32,
}

/// Rest shape of a triangle: its area, mm², and the gradients of its shape functions, 1/mm.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Shape {
    area_mm2: f32,
    gradients: [Vec2; 3],
}

impl Shape {
    pub fn of([a, b, c]: [Vec3; 3]) -> Self {
        let (ab, ac) = (b - a, c - a);
        let first = ab.normalize_or_zero();
        let (length, along) = (ab.length(), ac.dot(first));
        let across = (ac - along * first).length();
        // The triangle as (0, 0), (length, 0), (along, across).
        let (to_b, to_c) = (Vec2::new(1.0 / length, -along / (length * across)), Vec2::new(0.0, 1.0 / across));
        Self { area_mm2: 0.5 * length * across, gradients: [-to_b - to_c, to_b, to_c] }
    }

    /// Area, mm².
    pub fn area_mm2(&self) -> f32 {
        self.area_mm2
    }

    /// Stiffness that no motion of its corners exceeds at small strain, N/mm.
    pub fn stiffest(&self, law: &Law) -> f32 {
        let squares: f32 = self.gradients.iter().map(|g| g.length_squared()).sum();
        law.stretch_n_per_mm / (1.0 - law.poisson * law.poisson) * self.area_mm2 * squares
    }

    /// Forces on the corners at their present places, N, and the largest strain; `closed`: share of
    /// the strain at rest that is still there.
    #[inline]
    pub fn forces(&self, law: &Law, closed: f32, now: [Vec3; 3]) -> ([Vec3; 3], f32) {
        let along = |axis: fn(&Vec2) -> f32| -> Vec3 { (0..3).map(|a| now[a] * axis(&self.gradients[a])).sum() };
        let (f, g) = (along(|g| g.x), along(|g| g.y));
        let rest = law.strain * closed;
        let [xx, yy, xy] = [0.5 * (f.dot(f) - 1.0) + rest, 0.5 * (g.dot(g) - 1.0) + rest, 0.5 * f.dot(g)];
        let (mean, apart) = (0.5 * (xx + yy), 0.5 * (xx - yy));
        let radius = (apart * apart + xy * xy).sqrt();
        let (most, least) = (mean + radius, mean - radius);
        if most <= 0.0 {
            return ([Vec3::ZERO; 3], most);
        }
        let poisson = law.poisson;
        let [sxx, syy, sxy] = if least >= -poisson * most {
            let plane = law.stretch_n_per_mm / (1.0 - poisson * poisson);
            [xx + poisson * yy, yy + poisson * xx, (1.0 - poisson) * xy].map(|s| plane * s)
        } else {
            let axis = Vec2::new(apart + radius, xy).normalize_or(Vec2::Y);
            [axis.x * axis.x, axis.y * axis.y, axis.x * axis.y].map(|s| law.stretch_n_per_mm * most * s)
        };
        let (p, q) = ((f * sxx + g * sxy) * -self.area_mm2, (f * sxy + g * syy) * -self.area_mm2);
        (self.gradients.map(|n| p * n.x + q * n.y), most)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const LAW: Law = Law { stretch_n_per_mm: 40.0, poisson: 0.3, strain: 0.0, tears_at: 0.15, below: 0.0 };
    const REST: [Vec3; 3] = [Vec3::ZERO, Vec3::new(2.0, 0.1, 0.0), Vec3::new(0.8, 1.7, 0.2)];

    #[test]
    fn a_strip_under_tension_is_as_stiff_as_its_material_and_one_that_is_pressed_is_slack() {
        let rest = [Vec3::ZERO, Vec3::X, Vec3::Y];
        let shape = Shape::of(rest);
        let pulled = |x: f32, y: f32| shape.forces(&LAW, 0.0, rest.map(|p| Vec3::new(x * p.x, y * p.y, 0.0))).0;
        // Green strains 0.01 along x and -0.003 across: no force across.
        let (x, y) = (1.02f32.sqrt(), (1.0f32 - 0.006).sqrt());
        let force = pulled(x, y)[1];
        assert!((force.x + 0.5 * 40.0 * 0.01 * x).abs() < 1e-4 && force.y.abs() < 1e-4, "{force}");
        let narrower = pulled(x, 0.9)[1];
        assert!((narrower.x - force.x).abs() < 1e-4 && narrower.y.abs() < 1e-4, "a wrinkled strip bears the same");
        assert_eq!(pulled(0.99, 0.98), [Vec3::ZERO; 3]);
    }

    proptest! {
        /// Force is the slope of the energy, wherever the sheet is, and nothing turns or moves it.
        #[test]
        fn force_has_neither_sum_nor_moment_and_does_the_energys_work(
            d in prop::array::uniform9(-0.2f32..0.2), e in prop::array::uniform9(-1.0f32..1.0),
        ) {
            let shape = Shape::of(REST);
            let by = |v: [f32; 9], s: f32| [0, 1, 2].map(|a| s * Vec3::new(v[3 * a], v[3 * a + 1], v[3 * a + 2]));
            let add = |a: [Vec3; 3], b: [Vec3; 3]| [0, 1, 2].map(|n| a[n] + b[n]);
            let now = add(REST, by(d, 1.0));
            let (forces, _) = shape.forces(&LAW, 0.0, now);
            let sum: Vec3 = forces.into_iter().sum();
            let moment: Vec3 = (0..3).map(|n| now[n].cross(forces[n])).sum();
            prop_assert!(sum.length() < 1e-4 && moment.length() < 1e-3, "{} {}", sum, moment);
            // Around a closed path of small steps the work is none: force comes from an energy.
            let (u, v) = (by(e, 2e-2), by([e[4], e[0], e[8], e[2], e[6], e[1], e[3], e[7], e[5]], 2e-2));
            let work = |from: [Vec3; 3], step: [Vec3; 3]| -> f32 {
                let parts = 16;
                (0..parts).map(|part| {
                    let at = [0, 1, 2].map(|n| from[n] + step[n] * ((part as f32 + 0.5) / parts as f32));
                    let forces = shape.forces(&LAW, 0.0, at).0;
                    (0..3).map(|n| forces[n].dot(step[n])).sum::<f32>() / parts as f32
                }).sum()
            };
            let back = |s: [Vec3; 3]| s.map(|p| -p);
            let (a, b, c) = (add(now, u), add(add(now, u), v), add(now, v));
            let around = work(now, u) + work(a, v) + work(b, back(u)) + work(c, back(v));
            let scale = work(now, u).abs() + work(a, v).abs() + 1e-3;
            prop_assert!(around.abs() < 0.02 * scale, "{} of {}", around, scale);
        }
    }
}
