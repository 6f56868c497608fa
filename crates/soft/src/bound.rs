//! How long a step may be and how slow the body swings: highest and lowest eigenfrequency of the
//! rest state.
//!
//! # Theory
//! Central differences are stable for `dt ≤ 2/ω_max`, `ω²` being the eigenvalues of `M⁻¹K`. The
//! true `ω_max` comes from power iteration, from below; it never exceeds the largest of the single
//! elements' (Irons and Treharne 1971), and for one tetrahedron with lumped mass
//! `ω² ≤ 4 (λ+2μ)/ρ Σ_a |∇N_a|²`. The lowest frequency is the least of Rayleigh's quotient
//! `ω² = uᵀKu / uᵀMu`, found by conjugate gradients with the diagonal as preconditioner (Bradbury
//! and Fletcher 1966): one product with K a step, and about as many steps as one solution of
//! `K u = f` takes. An upper bound, within about 1 %.

use crate::{Body, Material, Shape, Stiffness};
use glam::DVec3;

const POWER_STEPS: usize = 200;
const GRADIENT_STEPS: usize = 4000;
/// Steps between two looks at ω², and by how much of itself it must have fallen to go on.
const LOOK: usize = 20;
const ENOUGH: f64 = 5e-4;

/// Stable step by single elements, ms: safe always, up to twice too careful.
pub fn element_bound_ms(body: &Body) -> f64 {
    let omega2 = |t| element_omega2(&body.shape(t), body.material(t));
    2.0 / (0..body.mesh.tets.len()).map(omega2).fold(0.0, f64::max).sqrt()
}

/// Bound of ω² of one free tetrahedron, 1/ms²: `4 (λ+2μ)/ρ Σ_a |∇N_a|²`.
pub fn element_omega2(shape: &Shape, material: &Material) -> f64 {
    4.0 * material.wave_speed().powi(2) * shape.gradients.iter().map(|g| g.length_squared()).sum::<f64>()
}

/// Stable step by power iteration, ms: the true bound less 1 %, never below the element bound.
pub fn power_bound_ms(body: &Body) -> f64 {
    power_bound_of_ms(body, &Stiffness::of(body))
}

/// The same with the masses of a stiffness, none of them below the body's.
pub fn power_bound_of_ms(body: &Body, stiffness: &Stiffness) -> f64 {
    let by_element = element_bound_ms(body);
    let by_power = 2.0 / highest_frequency(stiffness);
    if by_power.is_finite() { (0.99 * by_power).max(by_element) } else { by_element }
}

/// Highest angular eigenfrequency of the rest state, rad/ms; 0 when every node is fixed.
pub fn highest_frequency(stiffness: &Stiffness) -> f64 {
    let (masses, fixed) = (stiffness.masses_g(), stiffness.fixed());
    let mut x: Vec<DVec3> = (0..masses.len()).map(|n| if fixed[n] { DVec3::ZERO } else { start(n) }).collect();
    let mut y = vec![DVec3::ZERO; x.len()];
    let mut found = 0.0;
    for _ in 0..POWER_STEPS {
        let length = x.iter().zip(masses).map(|(x, m)| m * x.length_squared()).sum::<f64>().sqrt();
        if length <= 0.0 {
            return 0.0;
        }
        x.iter_mut().for_each(|x| *x /= length);
        stiffness.apply(&x, &mut y);
        let before = found;
        found = dot(&x, &y);
        x.iter_mut().zip(&y).zip(masses).for_each(|((x, y), m)| *x = *y / *m);
        if (found - before).abs() < 1e-6 * found {
            break;
        }
    }
    found.sqrt()
}

/// Lowest angular eigenfrequency of the rest state, rad/ms; `None` when the body is not held by its
/// fixed nodes.
pub fn lowest_frequency(body: &Body) -> Option<f64> {
    lowest_frequency_of(body, &Stiffness::of(body))
}

/// The same with the masses of a stiffness.
pub fn lowest_frequency_of(body: &Body, stiffness: &Stiffness) -> Option<f64> {
    if !body.is_supported() || !stiffness.fixed().contains(&false) {
        return None;
    }
    let masses = stiffness.masses_g();
    let inverse: Vec<f64> = stiffness.diagonal().iter().map(|d| 1.0 / d).collect();
    let pull = DVec3::new(0.8, -1.0, 0.4);
    let sag = |n: usize| if stiffness.fixed()[n] { DVec3::ZERO } else { pull * (masses[n] * inverse[n]) };
    let mut u: Vec<DVec3> = (0..masses.len()).map(sag).collect();
    let [mut ku, mut way, mut kway, mut slope] = [(); 4].map(|()| vec![DVec3::ZERO; u.len()]);
    stiffness.apply(&u, &mut ku);
    let mut omega2 = dot(&u, &ku) / swing(&u, &u, masses);
    let (mut steepness, mut before) = (f64::INFINITY, f64::INFINITY);
    for step in 1..=GRADIENT_STEPS {
        // Polak and Ribière: how much of the last way is kept.
        let (mut steeper, mut kept) = (0.0, 0.0);
        for n in 0..u.len() {
            let now = ku[n] - u[n] * (omega2 * masses[n]);
            steeper += now.length_squared() * inverse[n];
            kept += (now - slope[n]).dot(now) * inverse[n];
            slope[n] = now;
        }
        let keep = (kept / steepness).max(0.0);
        way.iter_mut().zip(slope.iter().zip(&inverse)).for_each(|(w, (s, i))| *w = *w * keep - *s * *i);
        steepness = steeper;
        stiffness.apply(&way, &mut kway);
        let Some(far) = lowest_along([dot(&u, &ku), dot(&u, &kway), dot(&way, &kway)], {
            [swing(&u, &u, masses), swing(&u, &way, masses), swing(&way, &way, masses)]
        }) else {
            break;
        };
        u.iter_mut().zip(&way).for_each(|(u, w)| *u += *w * far);
        ku.iter_mut().zip(&kway).for_each(|(ku, kw)| *ku += *kw * far);
        omega2 = dot(&u, &ku) / swing(&u, &u, masses);
        if step % LOOK == 0 {
            if before - omega2 < ENOUGH * omega2 {
                break;
            }
            before = omega2;
        }
    }
    Some(omega2.sqrt())
}

/// Where along u + a w Rayleigh's quotient is least, from the products `[uKu, uKw, wKw]` and
/// `[uMu, uMw, wMw]`; `None` where it is nowhere.
fn lowest_along([uku, ukw, wkw]: [f64; 3], [umu, umw, wmw]: [f64; 3]) -> Option<f64> {
    // Its derivative's numerator: p a² + q a + r.
    let (p, q, r) = (wkw * umw - ukw * wmw, wkw * umu - uku * wmw, ukw * umu - uku * umw);
    let root = (q * q - 4.0 * p * r).max(0.0).sqrt();
    let a = if q > 0.0 { -2.0 * r / (q + root) } else { (root - q) / (2.0 * p) };
    (a.is_finite() && a != 0.0).then_some(a)
}

/// `aᵀ M b`.
fn swing(a: &[DVec3], b: &[DVec3], masses: &[f64]) -> f64 {
    a.iter().zip(b).zip(masses).map(|((a, b), m)| m * a.dot(*b)).sum()
}

/// Sum of the products of two fields.
pub(crate) fn dot(a: &[DVec3], b: &[DVec3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a.dot(*b)).sum()
}

/// A start vector without symmetry, the same in every run.
fn start(node: usize) -> DVec3 {
    let part = |salt: f64| ((node as f64 + 1.0) * salt).sin();
    DVec3::new(part(12.9898), part(78.233), part(37.719))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::boxes;
    use trepan_geometry::Vec3;

    fn beam(cells: [usize; 3]) -> Body {
        let mesh = boxes::split_box(cells, Vec3::new(100.0, 20.0, 20.0));
        let fixed = boxes::nodes_where(&mesh, |p| p.x < 1e-3);
        Body::uniform(mesh, fixed, Material::THESIS)
    }

    #[test]
    fn the_true_bound_lies_between_one_and_two_element_bounds() {
        let body = beam([10, 2, 2]);
        let (safe, power) = (element_bound_ms(&body), power_bound_ms(&body));
        assert!(safe <= power && power < 2.0 * safe, "{safe} {power}");
    }

    #[test]
    fn a_clamped_beam_swings_at_the_frequency_of_an_independent_code() {
        // scikit-fem, same split, consistent masses: 2.2329 Hz; lumping and Rayleigh's quotient
        // move it a little.
        let hertz = lowest_frequency(&beam([10, 2, 2])).unwrap() / (2.0 * std::f64::consts::PI) * 1000.0;
        assert!((hertz / 2.2329 - 1.0).abs() < 0.05, "{hertz}");
    }

    #[test]
    fn the_lowest_frequency_is_that_of_the_dense_matrix() {
        for poisson in [0.3, 0.49] {
            let body = Body {
                materials: vec![Material::NeoHookean { young_mpa: 0.003, poisson, density_g_mm3: 1e-3 }],
                ..beam([6, 2, 2])
            };
            let stiffness = Stiffness::of(&body);
            let free: Vec<usize> = (0..3 * stiffness.fixed().len()).filter(|i| !stiffness.fixed()[i / 3]).collect();
            let mut unit = vec![DVec3::ZERO; stiffness.fixed().len()];
            let mut column = unit.clone();
            let mut dense = faer::Mat::<f64>::zeros(free.len(), free.len());
            for (j, &to) in free.iter().enumerate() {
                unit[to / 3][to % 3] = 1.0;
                stiffness.apply(&unit, &mut column);
                unit[to / 3][to % 3] = 0.0;
                for (i, &at) in free.iter().enumerate() {
                    let masses = stiffness.masses_g()[at / 3] * stiffness.masses_g()[to / 3];
                    dense[(i, j)] = column[at / 3][at % 3] / masses.sqrt();
                }
            }
            let all = dense.self_adjoint_eigenvalues(faer::Side::Lower).unwrap();
            let (least, found) = (all[0].sqrt(), lowest_frequency_of(&body, &stiffness).unwrap());
            assert!((1.0 - 1e-9..1.01).contains(&(found / least)), "{found} {least}");
        }
    }

    #[test]
    fn a_body_without_supports_has_no_lowest_frequency() {
        assert_eq!(lowest_frequency(&Body { fixed: vec![], ..beam([2, 1, 1]) }), None);
    }
}
