//! The small-strain stiffness of a body as an operator: `K x` without a matrix, f64.
//!
//! # Theory
//! Per element with displacement gradient H: `σ = λ tr(H) I + μ (H + Hᵀ)`, nodal forces `V σ ∇N_a`.
//!
//! # Practice
//! Serves time-step bounds, vibration frequencies and the linear solver's checks. About 60 ns a tetrahedron.

use crate::{Body, Shape};
use glam::{DMat3, DVec3};

/// `K x` at the rest state; rows and columns of fixed nodes are taken out.
pub struct Stiffness {
    tets: Vec<([u32; 4], Shape)>,
    fixed: Vec<bool>,
    masses: Vec<f64>,
    lambda: f64,
    mu: f64,
}

impl Stiffness {
    /// The operator of a body that passed its check.
    pub fn of(body: &Body) -> Self {
        let tets = body.mesh.tets.iter().enumerate().map(|(t, &corners)| (corners, body.shape(t))).collect();
        let (mu, kappa) = (body.material.shear_mpa(), body.material.bulk_mpa());
        Self { tets, fixed: body.fixed_mask(), masses: body.lumped_masses_g(), lambda: kappa - mu * 2.0 / 3.0, mu }
    }

    /// Lumped mass of every node, g.
    pub fn masses_g(&self) -> &[f64] {
        &self.masses
    }

    /// Whether each node is fixed.
    pub fn fixed(&self) -> &[bool] {
        &self.fixed
    }

    /// `y = K x`, N for mm; zero at fixed nodes, whose x must be zero.
    pub fn apply(&self, x: &[DVec3], y: &mut [DVec3]) {
        y.fill(DVec3::ZERO);
        for (corners, shape) in &self.tets {
            let h = shape.gradient_of(corners.map(|n| x[n as usize]));
            let trace = h.x_axis.x + h.y_axis.y + h.z_axis.z;
            let stress = DMat3::from_diagonal(DVec3::splat(self.lambda * trace)) + (h + h.transpose()) * self.mu;
            for (&n, force) in corners.iter().zip(shape.forces_of(stress)) {
                y[n as usize] += force;
            }
        }
        y.iter_mut().zip(&self.fixed).filter(|(_, fixed)| **fixed).for_each(|(y, _)| *y = DVec3::ZERO);
    }
}
