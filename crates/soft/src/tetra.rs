//! One 4-node tetrahedron in f64: volume and the constant gradients of its shape functions.
//!
//! # Theory
//! With edge vectors `e_a = X_a - X_0` the gradients are the dual basis, `∇N_a · e_b = δ_ab` for a,
//! b in 1..3, and `∇N_0 = -(∇N_1 + ∇N_2 + ∇N_3)`. The deformation gradient of nodal displacements u
//! is `F = I + Σ u_a ⊗ ∇N_a`.

use glam::{DMat3, DVec3};

/// Volume and shape-function gradients of a tetrahedron in its rest state.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shape {
    /// Rest volume, mm³; positive for a well oriented tetrahedron.
    pub volume_mm3: f64,
    /// Gradients of the four shape functions, 1/mm.
    pub gradients: [DVec3; 4],
}

impl Shape {
    /// The shape of a tetrahedron with these rest corners, mm. Gradients are not finite for a flat
    /// one.
    pub fn of(corners: [DVec3; 4]) -> Self {
        let [a, b, c] = [1, 2, 3].map(|i| corners[i] - corners[0]);
        let six_volumes = a.cross(b).dot(c);
        let [g1, g2, g3] = [b.cross(c), c.cross(a), a.cross(b)].map(|v| v / six_volumes);
        Self { volume_mm3: six_volumes / 6.0, gradients: [-(g1 + g2 + g3), g1, g2, g3] }
    }

    /// Gradient of a nodal field, `Σ u_a ⊗ ∇N_a`.
    #[inline]
    pub fn gradient_of(&self, [o, a, b, c]: [DVec3; 4]) -> DMat3 {
        let [_, f, g, h] = self.gradients;
        let (a, b, c) = (a - o, b - o, c - o);
        DMat3::from_cols(a * f.x + b * g.x + c * h.x, a * f.y + b * g.y + c * h.y, a * f.z + b * g.z + c * h.z)
    }

    /// Nodal forces `V P ∇N_a` that balance a first Piola-Kirchhoff stress P, N.
    #[inline]
    pub fn forces_of(&self, stress: DMat3) -> [DVec3; 4] {
        let [_, f, g, h] = self.gradients;
        let scaled = stress * self.volume_mm3;
        let (a, b, c) = (scaled * f, scaled * g, scaled * h);
        [-(a + b + c), a, b, c]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_linear_field_is_reproduced(entries in proptest::array::uniform9(-2.0f64..2.0), x in proptest::array::uniform12(-5.0f64..5.0)) {
            let corners = [0, 3, 6, 9].map(|i| DVec3::new(x[i], x[i + 1], x[i + 2]));
            let shape = Shape::of(corners);
            prop_assume!(shape.volume_mm3.abs() > 1e-2);
            let field = DMat3::from_cols_array(&entries);
            let found = shape.gradient_of(corners.map(|p| field * p + DVec3::ONE));
            prop_assert!((found - field).to_cols_array().iter().all(|e| e.abs() < 1e-8));
            let total: DVec3 = shape.forces_of(field).iter().sum();
            prop_assert!(total.length() < 1e-8);
        }
    }
}
