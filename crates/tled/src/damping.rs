//! Rigid motion of a body without supports, which must not be damped.
//!
//! # Theory
//! The rigid motion with the same momentum and angular momentum: `V = Σ m v / Σ m`, `ω = Θ⁻¹ L`
//! about the mass centre, with `L = Σ m r × v`, `Θ = Σ m (r² I - r rᵀ)`. What is left,
//! `v - V - ω × r`, carries neither, so damping it conserves both.

use glam::{DMat3, DVec3};
use trepan_geometry::Vec3;

/// Velocity of a rigid body, mm/ms and rad/ms.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct RigidMotion {
    pub centre: Vec3,
    pub velocity: Vec3,
    pub spin: Vec3,
}

impl RigidMotion {
    /// Best-fitting rigid motion of nodes with mass (g), position (mm) and velocity (mm/ms).
    pub fn of(nodes: impl Iterator<Item = (f32, Vec3, Vec3)> + Clone) -> Self {
        let (mut mass, mut first, mut momentum) = (0.0, DVec3::ZERO, DVec3::ZERO);
        for (m, x, v) in nodes.clone() {
            let m = f64::from(m);
            mass += m;
            first += m * x.as_dvec3();
            momentum += m * v.as_dvec3();
        }
        let (centre, velocity) = (first / mass, momentum / mass);
        let (mut turning, mut inertia) = (DVec3::ZERO, DMat3::ZERO);
        for (m, x, v) in nodes {
            let (m, r) = (f64::from(m), x.as_dvec3() - centre);
            turning += m * r.cross(v.as_dvec3());
            inertia += (DMat3::from_diagonal(DVec3::splat(r.length_squared())) - outer(r)) * m;
        }
        let spin = if inertia.determinant() > 0.0 { inertia.inverse() * turning } else { DVec3::ZERO };
        Self { centre: centre.as_vec3(), velocity: velocity.as_vec3(), spin: spin.as_vec3() }
    }

    /// Velocity at a point, mm/ms.
    pub fn at(&self, x: Vec3) -> Vec3 {
        self.velocity + self.spin.cross(x - self.centre)
    }
}

fn outer(r: DVec3) -> DMat3 {
    DMat3::from_cols(r * r.x, r * r.y, r * r.z)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rigid_motion_is_recovered() {
        let motion =
            RigidMotion { centre: Vec3::ZERO, velocity: Vec3::new(0.1, -0.2, 0.3), spin: Vec3::new(0.01, 0.02, -0.03) };
        let points = [Vec3::X * 20.0, Vec3::Y * 30.0, Vec3::new(-5.0, 3.0, 40.0), Vec3::new(7.0, -9.0, 2.0)];
        let nodes = points.iter().enumerate().map(|(i, &x)| (1.0 + i as f32, x, motion.at(x)));
        let fitted = RigidMotion::of(nodes);
        assert!((fitted.spin - motion.spin).length() < 1e-6);
        assert!(points.iter().all(|&x| (fitted.at(x) - motion.at(x)).length() < 1e-5));
    }
}
