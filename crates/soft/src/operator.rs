//! The small-strain stiffness of a body as an operator: `K x` without a matrix, f64.
//!
//! # Theory
//! Per element with displacement gradient H: `σ = λ tr(H) I + μ (H + Hᵀ)`, nodal forces `V σ ∇N_a`.
//!
//! # Practice
//! Serves time-step bounds, vibration frequencies and the linear solver's checks. About 20 ns a
//! tetrahedron.

use crate::body::Element;
use crate::{Anchor, Body, Material};
use glam::{DMat3, DVec3};

/// `K x` at the rest state; rows and columns of fixed nodes are taken out.
pub struct Stiffness {
    elements: Vec<Element>,
    fixed: Vec<bool>,
    masses: Vec<f64>,
    hooke: Vec<Hooke>,
    anchors: Vec<Anchor>,
}

/// Small-strain elasticity.
#[derive(Clone, Copy, Debug)]
pub struct Hooke {
    /// First Lamé parameter, MPa.
    pub lambda: f64,
    /// Shear modulus, MPa.
    pub mu: f64,
}

impl Hooke {
    /// Parameters of a material.
    pub fn of(material: &Material) -> Self {
        let (mu, kappa) = (material.shear_mpa(), material.bulk_mpa());
        Self { lambda: kappa - mu * 2.0 / 3.0, mu }
    }

    /// Stress of the symmetric part of a displacement gradient.
    #[inline]
    pub fn stress(self, h: DMat3) -> DMat3 {
        let trace = self.lambda * (h.x_axis.x + h.y_axis.y + h.z_axis.z);
        (h + h.transpose()) * self.mu + DMat3::from_diagonal(DVec3::splat(trace))
    }
}

impl Stiffness {
    /// The operator of a body that passed its check.
    pub fn of(body: &Body) -> Self {
        let hooke = body.materials.iter().map(Hooke::of).collect();
        let (elements, fixed, anchors) = (body.elements(), body.fixed_mask(), body.anchors.clone());
        Self { elements, fixed, masses: body.lumped_masses_g(), hooke, anchors }
    }

    /// The same stiffness with other masses at the nodes, g.
    pub fn with_masses(self, masses: Vec<f64>) -> Self {
        Self { masses, ..self }
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
        for Element { corners, shape, material } in &self.elements {
            let Hooke { lambda, mu } = self.hooke[usize::from(*material)];
            for (&n, g) in corners.iter().zip(&shape.gradients) {
                diagonal[n as usize] += shape.volume_mm3 * g.length_squared() * (lambda + 4.0 * mu);
            }
        }
        for anchor in &self.anchors {
            diagonal[anchor.node as usize] += f64::from(anchor.along + 2.0 * anchor.across);
        }
        diagonal
    }

    /// `y = K x`, N for mm; zero at fixed nodes, whose x must be zero.
    pub fn apply(&self, x: &[DVec3], y: &mut [DVec3]) {
        y.fill(DVec3::ZERO);
        for Element { corners, shape, material } in &self.elements {
            let [a, b, c, d] = corners.map(|n| n as usize);
            let h = shape.gradient_of([x[a], x[b], x[c], x[d]]);
            let forces = shape.forces_of(self.hooke[usize::from(*material)].stress(h));
            y[a] += forces[0];
            y[b] += forces[1];
            y[c] += forces[2];
            y[d] += forces[3];
        }
        for &Anchor { node, normal, along, across, .. } in &self.anchors {
            let (u, n) = (x[node as usize], normal.as_dvec3());
            let (out, across) = (n * u.dot(n), f64::from(across));
            y[node as usize] += (u - out) * across + out * f64::from(along);
        }
        y.iter_mut().zip(&self.fixed).filter(|(_, fixed)| **fixed).for_each(|(y, _)| *y = DVec3::ZERO);
    }
}
