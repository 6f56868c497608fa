//! The small-strain stiffness of a body as an operator: `K x` without a matrix, f64.
//!
//! # Theory
//! Per element with displacement gradient H: `σ = λ tr(H) I + μ (H + Hᵀ)`, nodal forces `V σ ∇N_a`.
//!
//! # Practice
//! Serves time-step bounds, vibration frequencies and the linear solver's checks. About 20 ns a tetrahedron.

use crate::{Body, Shape};
use glam::DVec3;

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

    /// Trace of the 3×3 block on K's diagonal at every node, N/mm.
    pub fn diagonal(&self) -> Vec<f64> {
        let mut diagonal = vec![0.0; self.masses.len()];
        for (corners, shape) in &self.tets {
            for (&n, g) in corners.iter().zip(&shape.gradients) {
                diagonal[n as usize] += shape.volume_mm3 * g.length_squared() * (self.lambda + 4.0 * self.mu);
            }
        }
        diagonal
    }

    /// `y = K x`, N for mm; zero at fixed nodes, whose x must be zero.
    pub fn apply(&self, x: &[DVec3], y: &mut [DVec3]) {
        y.fill(DVec3::ZERO);
        for ([a, b, c, d], shape) in &self.tets {
            let [a, b, c, d] = [*a as usize, *b as usize, *c as usize, *d as usize];
            let h = shape.gradient_of([x[a], x[b], x[c], x[d]]);
            let trace = self.lambda * (h.x_axis.x + h.y_axis.y + h.z_axis.z);
            let mut stress = (h + h.transpose()) * self.mu;
            stress.x_axis.x += trace;
            stress.y_axis.y += trace;
            stress.z_axis.z += trace;
            let forces = shape.forces_of(stress);
            y[a] += forces[0];
            y[b] += forces[1];
            y[c] += forces[2];
            y[d] += forces[3];
        }
        y.iter_mut().zip(&self.fixed).filter(|(_, fixed)| **fixed).for_each(|(y, _)| *y = DVec3::ZERO);
    }
}
