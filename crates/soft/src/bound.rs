//! How long a step may be and how slow the body swings: highest and lowest eigenfrequency of the rest state.
//!
//! # Theory
//! Central differences are stable for `dt ≤ 2/ω_max`, `ω²` being the eigenvalues of `M⁻¹K`. The true `ω_max` comes from power
//! iteration, from below; it never exceeds the largest of the single elements' (Irons and Treharne 1971), and for one tetrahedron with
//! lumped mass `ω² ≤ 4 (λ+2μ)/ρ Σ_a |∇N_a|²`.
//! The lowest frequency comes from inverse iteration, `K u = M a` by conjugate gradients from the deflection under own weight on, and
//! Rayleigh's quotient `ω² = uᵀKu / uᵀMu`: an upper bound, within about 1 %.

use crate::{Body, Material, Shape, Stiffness};
use glam::DVec3;

const POWER_STEPS: usize = 200;
const GRADIENT_STEPS: usize = 4000;
const INVERSE_STEPS: usize = 8;

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

/// Lowest angular eigenfrequency of the rest state, rad/ms; `None` when the body is not held by its fixed nodes.
pub fn lowest_frequency(body: &Body) -> Option<f64> {
    lowest_frequency_of(body, &Stiffness::of(body))
}

/// The same with the masses of a stiffness.
pub fn lowest_frequency_of(body: &Body, stiffness: &Stiffness) -> Option<f64> {
    if !body.is_held() || !stiffness.fixed().contains(&false) {
        return None;
    }
    let inverse: Vec<f64> = stiffness.diagonal().iter().map(|d| 1.0 / d).collect();
    let pull = DVec3::new(0.8, -1.0, 0.4);
    let mut shape: Vec<DVec3> = stiffness.fixed().iter().map(|fixed| if *fixed { DVec3::ZERO } else { pull }).collect();
    let mut guess = vec![DVec3::ZERO; shape.len()];
    let mut found = f64::MAX;
    for _ in 0..INVERSE_STEPS {
        let before = found;
        shape = deflect(stiffness, &inverse, &shape, guess);
        found = rayleigh(stiffness, &shape);
        if before - found < 1e-3 * found {
            break;
        }
        guess = shape.iter().map(|u| *u / (found * found)).collect();
    }
    Some(found)
}

/// Rayleigh's frequency of a deflection.
fn rayleigh(stiffness: &Stiffness, u: &[DVec3]) -> f64 {
    let mut ku = vec![DVec3::ZERO; u.len()];
    stiffness.apply(u, &mut ku);
    let swung: f64 = u.iter().zip(stiffness.masses_g()).map(|(u, m)| m * u.length_squared()).sum();
    (dot(u, &ku) / swung).sqrt()
}

/// One inverse iteration: u of `K u = M a` to three digits, by conjugate gradients from a guess on.
fn deflect(stiffness: &Stiffness, inverse: &[f64], a: &[DVec3], guess: Vec<DVec3>) -> Vec<DVec3> {
    let precondition = |r: &[DVec3]| -> Vec<DVec3> { r.iter().zip(inverse).map(|(r, d)| *r * *d).collect() };
    let weight: Vec<DVec3> = a.iter().zip(stiffness.masses_g()).map(|(a, m)| *a * *m).collect();
    let goal = 1e-6 * dot(&weight, &precondition(&weight));
    let (mut u, mut kp) = (guess, vec![DVec3::ZERO; a.len()]);
    stiffness.apply(&u, &mut kp);
    let mut r: Vec<DVec3> = weight.iter().zip(&kp).map(|(w, k)| *w - *k).collect();
    let mut z = precondition(&r);
    let (mut p, mut rz) = (z.clone(), dot(&r, &z));
    for _ in 0..GRADIENT_STEPS {
        if rz <= goal {
            break;
        }
        stiffness.apply(&p, &mut kp);
        let along = rz / dot(&p, &kp);
        u.iter_mut().zip(&p).for_each(|(u, p)| *u += *p * along);
        r.iter_mut().zip(&kp).for_each(|(r, kp)| *r -= *kp * along);
        z = precondition(&r);
        let next = dot(&r, &z);
        p.iter_mut().zip(&z).for_each(|(p, z)| *p = *z + *p * (next / rz));
        rz = next;
    }
    u
}

fn dot(a: &[DVec3], b: &[DVec3]) -> f64 {
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
        // scikit-fem, same split, consistent masses: 2.2329 Hz; lumping and Rayleigh's quotient move it a little.
        let hertz = lowest_frequency(&beam([10, 2, 2])).unwrap() / (2.0 * std::f64::consts::PI) * 1000.0;
        assert!((hertz / 2.2329 - 1.0).abs() < 0.05, "{hertz}");
    }

    #[test]
    fn a_body_without_supports_has_no_lowest_frequency() {
        assert_eq!(lowest_frequency(&Body { fixed: vec![], ..beam([2, 1, 1]) }), None);
    }
}
