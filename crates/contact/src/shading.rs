//! Force shading: a force that turns smoothly where the surface under the tool is faceted.
//!
//! # Theory
//! As Phong's shading lends a facet the normals of its vertices, the force is made to point along a
//! normal n* that changes continuously, at the same size (Ruspini, Kolarov and Khatib 1997). They
//! interpolate over the triangle that the proxy is on. A contact found in voxels has no triangle;
//! it has the places where the proxy was, so the normals met there are averaged over the way of the
//! contact point:
//! ```text
//! n* ← n* + (1 - e^(-w/l)) (n - n*) , normalised
//! w: way of the contact point since the last tick,  l: length of a facet
//! ```
//! At rest nothing changes, so that no force turns in a hand that holds still; over a facet's
//! length the force has turned.
//!
//! ```text
//!  n ↑  ↑   ↗  ↗      n* ↑  ↑ ⇗  ↗
//!  ──────╲___         the edge is felt as round, l wide
//! ```
//!
//! # Practice
//! Put it round another model: `ForceShading::new(Viscoelastic::BONE, 1.0)`. l about a voxel's
//! edge, mm. Its price is a normal that is late by l. The first normal of a contact is taken as it
//! is.
//!
//! # Sources
//! D. Ruspini, K. Kolarov, O. Khatib, *The haptic display of complex graphical environments*,
//! SIGGRAPH 1997; H. Morgenbesser, M. Srinivasan, *Force shading for haptic shape perception*, ASME
//! DSC 58 (1996).
//!
//! # When not to use it
//! On methods whose normal is smooth by itself (`god-object-sphere`): it only makes them late. At
//! real edges: it rounds them.

use crate::{ContactManifold, ForceModel};
use trepan_geometry::{ToolState, Vec3, Wrench};

/// A force model under a normal that turns smoothly.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ForceShading<M> {
    /// What makes the force.
    pub model: M,
    /// Way of the contact over which a normal is taken over, mm: the length of a facet. 0 shades
    /// nothing.
    pub length_mm: f32,
    /// The shaded normal and the contact point of the last tick.
    last: Option<(Vec3, Vec3)>,
}

impl<M: ForceModel> ForceShading<M> {
    /// Shading over facets of `length_mm` under `model`.
    pub fn new(model: M, length_mm: f32) -> Self {
        Self { model, length_mm, last: None }
    }

    /// The shaded normal at a contact.
    fn shaded(&mut self, manifold: &ContactManifold) -> Vec3 {
        let Some((before, point)) = self.last else { return manifold.normal };
        let way = manifold.point.distance(point);
        let share = 1.0 - (-way / self.length_mm).exp();
        // Opposed normals have no mean: the new one is the truth.
        before.lerp(manifold.normal, share).try_normalize().unwrap_or(manifold.normal)
    }
}

impl<M: ForceModel> ForceModel for ForceShading<M> {
    fn wrench(&mut self, tool: &ToolState, manifold: &ContactManifold, dt_ms: f32) -> Wrench {
        if !(self.length_mm > 0.0 && manifold.touches() && manifold.is_finite()) {
            self.last = None;
            return self.model.wrench(tool, manifold, dt_ms);
        }
        let normal = self.shaded(manifold);
        self.last = Some((normal, manifold.point));
        let mut shaded = *manifold;
        shaded.normal = normal;
        self.model.wrench(tool, &shaded, dt_ms)
    }

    fn reset(&mut self) {
        self.last = None;
        self.model.reset();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Contact, Hooke};
    use proptest::prelude::*;
    use trepan_geometry::Pose;

    fn touch(normal: Vec3, x: f32) -> ContactManifold {
        ContactManifold::single(Contact { normal, depth_mm: 0.5, point: Vec3::X * x })
    }

    #[test]
    fn over_an_edge_the_force_turns_with_the_way_and_keeps_its_size() {
        let slope = Vec3::new(0.6, 0.0, 0.8);
        let mut model = ForceShading::new(Hooke { stiffness: 2.0 }, 1.0);
        let tool = ToolState::at(Pose::IDENTITY);
        let forces: Vec<Vec3> = (0..200)
            .map(|t| {
                let x = 0.05 * t as f32 - 5.0;
                model.wrench(&tool, &touch(if x < 0.0 { Vec3::Z } else { slope }, x), 1.0).force
            })
            .collect();
        let turn = |pair: &[Vec3]| pair[0].angle_between(pair[1]).to_degrees();
        let worst = forces.windows(2).map(turn).fold(0.0, f32::max);
        assert!(worst < 2.5, "{worst} of 37 degrees at once");
        assert!(forces.iter().all(|f| (f.length() - 1.0).abs() < 1e-5));
        assert!(forces[199].angle_between(slope).to_degrees() < 0.5, "it has turned a few lengths on");
        let still = model.wrench(&tool, &touch(Vec3::Z, 4.95), 1.0).force;
        assert!((still - forces[199]).length() < 1e-6, "at rest nothing turns");
    }

    #[test]
    fn without_a_length_the_force_is_that_of_the_model_bit_for_bit() {
        let (mut plain, tool) = (Hooke { stiffness: 2.0 }, ToolState::at(Pose::IDENTITY));
        let mut model = ForceShading::new(plain, 0.0);
        for normal in [Vec3::Z, Vec3::new(0.6, -0.0, 0.8), Vec3::new(0.36, 0.48, 0.8)] {
            assert_eq!(model.wrench(&tool, &touch(normal, 0.1), 1.0), plain.wrench(&tool, &touch(normal, 0.1), 1.0));
        }
    }

    #[test]
    fn a_new_contact_starts_at_its_own_normal() {
        let mut model = ForceShading::new(Hooke { stiffness: 2.0 }, 1.0);
        let tool = ToolState::at(Pose::IDENTITY);
        model.wrench(&tool, &touch(Vec3::Z, 0.0), 1.0);
        assert_eq!(model.wrench(&tool, &ContactManifold::default(), 1.0), Wrench::ZERO);
        assert_eq!(model.wrench(&tool, &touch(Vec3::X, 0.0), 1.0).force, Vec3::X);
    }

    proptest! {
        #[test]
        fn any_contacts_give_a_finite_force(all in prop::collection::vec((prop::array::uniform3(any::<f32>()), any::<f32>(), prop::array::uniform3(any::<f32>())), 1..9), l in any::<f32>()) {
            let mut model = ForceShading::new(Hooke::default(), l);
            for (n, depth_mm, p) in all {
                let manifold = ContactManifold::single(Contact { normal: n.into(), depth_mm, point: p.into() });
                prop_assert!(model.wrench(&ToolState::at(Pose::IDENTITY), &manifold, 1.0).is_finite());
            }
        }
    }
}
