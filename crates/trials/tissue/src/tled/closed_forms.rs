//! Homogeneous deformations of a cube by every law: what holds a face, against the closed form.
//!
//! # Theory
//! With principal stretches λ and Kirchhoff stress `τ_i = λ_i ∂W/∂λ_i` the force on a face is `τ/λ`
//! times its area at rest. Simple shear of amount γ keeps the volume and needs `τ_xz = μ γ` for
//! neo-Hookean and Mooney-Rivlin tissue, `μ γ + (λ/2 + μ) γ³` for St. Venant-Kirchhoff's; Ogden's
//! has the principal stretches `r, 1/r` with `r - 1/r = γ` and `(τ_r - τ_1/r)/(r + 1/r)`.

use trepan_evidence::suite::{Findings, Gate, Row};
use trepan_geometry::{Vec3, units};
use trepan_soft::{Body, Loads, Material, SoftSolver, boxes};
use trepan_tled::{Config, Damping, Tled};

const EDGE_MM: f64 = 20.0;
const LIMIT_PERCENT: f64 = 0.5;

/// Uniaxial and biaxial stretch with free sides, and simple shear, of every material.
pub fn run(findings: &mut Findings) {
    for (name, material) in materials() {
        for stretch in [0.7, 0.85, 1.2, 1.5] {
            // St. Venant-Kirchhoff has no such state: it gives way under compression.
            if stretch > 0.7 || name != "St. Venant-Kirchhoff" {
                uniaxial(name, material, stretch, findings);
            }
            if stretch > 1.0 {
                biaxial(name, material, stretch, findings);
            }
        }
        shear(name, material, 0.3, findings);
    }
}

fn materials() -> [(&'static str, Material); 4] {
    let density_g_mm3 = units::WATER_G_PER_MM3;
    [
        ("neo-Hookean", Material::NeoHookean { young_mpa: 0.003, poisson: 0.45, density_g_mm3 }),
        ("St. Venant-Kirchhoff", Material::StVenantKirchhoff { young_mpa: 0.003, poisson: 0.45, density_g_mm3 }),
        ("Mooney-Rivlin", Material::MooneyRivlin { c10_mpa: 3e-4, c01_mpa: 2e-4, poisson: 0.45, density_g_mm3 }),
        ("Ogden", Material::BRAIN_OGDEN),
    ]
}

fn uniaxial(name: &str, material: Material, stretch: f64, findings: &mut Findings) {
    let side = free_side(|t| kirchhoff(material, [t, t, stretch])[0]);
    let exact = kirchhoff(material, [side, side, stretch])[2] / stretch;
    let u = move |p: Vec3| p * Vec3::new(side as f32 - 1.0, side as f32 - 1.0, stretch as f32 - 1.0);
    judge(&format!("uniaxial stretch {stretch}, {name}"), held(material, u).z, exact, findings);
}

fn biaxial(name: &str, material: Material, stretch: f64, findings: &mut Findings) {
    let side = free_side(|t| kirchhoff(material, [t, stretch, stretch])[0]);
    let exact = kirchhoff(material, [side, stretch, stretch])[2] / stretch;
    let u = move |p: Vec3| p * Vec3::new(side as f32 - 1.0, stretch as f32 - 1.0, stretch as f32 - 1.0);
    judge(&format!("biaxial stretch {stretch}, {name}"), held(material, u).z, exact, findings);
}

fn shear(name: &str, material: Material, gamma: f64, findings: &mut Findings) {
    let (mu, kappa) = (material.shear_mpa(), material.bulk_mpa());
    let r = 0.5 * (gamma + (gamma * gamma + 4.0).sqrt());
    let principal = kirchhoff(material, [r, 1.0, 1.0 / r]);
    let exact = match material {
        Material::Ogden { .. } => (principal[0] - principal[2]) / (r + 1.0 / r),
        Material::StVenantKirchhoff { .. } => mu * gamma + (0.5 * kappa + mu * 2.0 / 3.0) * gamma.powi(3),
        _ => mu * gamma,
    };
    let u = move |p: Vec3| Vec3::X * (gamma as f32 * p.z);
    judge(&format!("simple shear {gamma}, {name}"), held(material, u).x, exact, findings);
}

fn judge(scene: &str, held_n: f64, exact_mpa: f64, findings: &mut Findings) {
    let exact_n = exact_mpa * EDGE_MM * EDGE_MM;
    let error = 100.0 * (held_n / exact_n - 1.0).abs();
    findings.rows.push(Row::new(scene, "tled").metric("force_n", held_n).metric("force_error_percent", error));
    let name = format!("{scene}: force against the closed form, percent");
    findings.gates.push(Gate::at_most(name, error, LIMIT_PERCENT));
}

/// What holds the top of a cube in a state of displacements u, N.
fn held(material: Material, u: impl Fn(Vec3) -> Vec3) -> glam::DVec3 {
    let body = Body::uniform(boxes::split_box([4; 3], Vec3::splat(EDGE_MM as f32)), vec![], material);
    let config = Config { damping: Damping::None, ..Config::default() };
    let mut solver = Tled::new(&body, &config).expect("the cube is sound");
    for (n, &p) in body.mesh.positions.iter().enumerate() {
        solver.set_node(n as u32, u(p), Vec3::ZERO);
    }
    solver.step(&Loads::default(), 1e-3);
    let top = boxes::nodes_where(&body.mesh, |p| f64::from(p.z) > EDGE_MM - 1e-3);
    top.iter().map(|&n| solver.support_force(n).as_dvec3()).sum()
}

/// The side stretch at which the side's stress vanishes.
pub fn free_side(stress: impl Fn(f64) -> f64) -> f64 {
    let (mut low, mut high) = (0.2, 1.6);
    for _ in 0..80 {
        let middle = 0.5 * (low + high);
        if stress(middle) > 0.0 { high = middle } else { low = middle }
    }
    low
}

/// Principal Kirchhoff stresses `λ_i ∂W/∂λ_i`, MPa, written from the principal stretches.
pub fn kirchhoff(material: Material, stretch: [f64; 3]) -> [f64; 3] {
    let (mu, kappa) = (material.shear_mpa(), material.bulk_mpa());
    let j: f64 = stretch.iter().product();
    let squares = stretch.map(|s| s * s);
    let i1: f64 = squares.iter().sum();
    let i2 = squares[0] * squares[1] + squares[1] * squares[2] + squares[2] * squares[0];
    let bulk = kappa * (j - 1.0) * j;
    let first = |c: f64| squares.map(|s| 2.0 * c * j.powf(-2.0 / 3.0) * (s - i1 / 3.0));
    match material {
        Material::NeoHookean { .. } => first(0.5 * mu).map(|t| t + bulk),
        Material::StVenantKirchhoff { .. } => {
            let green = squares.map(|s| 0.5 * (s - 1.0));
            let pressed = (kappa - mu * 2.0 / 3.0) * green.iter().sum::<f64>();
            [0, 1, 2].map(|i| (pressed + 2.0 * mu * green[i]) * squares[i])
        }
        Material::MooneyRivlin { c10_mpa, c01_mpa, .. } => {
            let one = first(c10_mpa.into());
            let two = 2.0 * f64::from(c01_mpa) * j.powf(-4.0 / 3.0);
            [0, 1, 2].map(|i| one[i] + two * (squares[i] * (i1 - squares[i]) - 2.0 * i2 / 3.0) + bulk)
        }
        Material::Ogden { shear_mpa, exponent, .. } => {
            let term = |p: usize, s: f64| (s / j.cbrt()).powf(f64::from(exponent[p]));
            let part = |p: usize, i: usize| {
                let mean = stretch.iter().map(|&s| term(p, s)).sum::<f64>() / 3.0;
                2.0 * f64::from(shear_mpa[p] / exponent[p]) * (term(p, stretch[i]) - mean)
            };
            [0, 1, 2].map(|i| (0..2).filter(|&p| shear_mpa[p] != 0.0).map(|p| part(p, i)).sum::<f64>() + bulk)
        }
        Material::Stiffening { share, bound, .. } => {
            let (share, bound) = (f64::from(share), f64::from(bound));
            let power = squares.map(|s| (j.powf(2.0 / 3.0) / s).powi(17));
            let sum: f64 = power.iter().sum();
            let v = 1.0 + bound * (sum - 3.0);
            let term = (1.0 - share) * mu / 34.0 * v.powf(1.0 / 16.0 - 1.0);
            let one = first(0.5 * share * mu);
            [0, 1, 2].map(|i| one[i] + term * (2.0 / 3.0 * sum - 2.0 * power[i]) + bulk)
        }
    }
}
