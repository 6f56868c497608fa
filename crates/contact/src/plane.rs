//! One node of tissue against a plane: how a wall holds back what slides along it.
//!
//! # Theory
//! With x the node's position and n the unit vector out of the tissue, into the wall, the depth is
//! `d = offset + x·n` and the force on the node `-(k d + b ẋ·n) n`, for d > 0 and never a pull. The
//! plane is the wall's tangent near the node. Each node has a spring of its own, whose weight never
//! changes: a spring that several nodes share, with weights found anew in each collision step,
//! passes force from node to node as the weights move, and light nodes ring.
//!
//! Sliding is damped by `-b min(d / 0.2 mm, 1)`, as in a film of fluid that is pressed out. A brake
//! that is whole from the first contact holds back nodes that barely touch; where they lift off,
//! the tissue that lagged behind jumps.
//!
//! # Practice
//! A plane may be sent before its node touches: a negative depth exerts nothing, and the solver
//! finds the moment of contact with its own positions, however late the next collision result is.

use crate::NodalContact;
use trepan_geometry::Vec3;

/// Depth from which sliding is damped as strongly as the normal velocity, mm.
pub const SLIDING_FULL_MM: f32 = 0.2;

/// A unilateral spring between one node and a plane. Plain data, 28 bytes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PlaneContact {
    /// The node.
    pub node: u32,
    /// Unit vector out of the tissue, into the wall.
    pub normal: Vec3,
    /// `d = offset_mm + x·normal` is the depth, mm.
    pub offset_mm: f32,
    /// Spring stiffness k, N/mm.
    pub stiffness: f32,
    /// Damping b, N ms/mm, of the normal velocity while the node presses.
    pub damping: f32,
}

impl PlaneContact {
    /// Depth of a node at `position`, mm; negative where it does not touch.
    pub fn depth_mm(&self, position: Vec3) -> f32 {
        self.offset_mm + position.dot(self.normal)
    }

    /// Damping of sliding at a depth in mm, N ms/mm: 0 without contact, continuous.
    pub fn sliding_damping(&self, depth_mm: f32) -> f32 {
        self.damping * (depth_mm / SLIDING_FULL_MM).clamp(0.0, 1.0)
    }
}

/// The same contact in the form of a spring on several nodes, without its damping of sliding.
impl From<PlaneContact> for NodalContact {
    fn from(plane: PlaneContact) -> Self {
        let PlaneContact { node, normal, offset_mm, stiffness, damping } = plane;
        let mut spring = Self::none();
        (spring.normal, spring.offset_mm) = (normal, offset_mm);
        (spring.stiffness, spring.damping) = (stiffness, damping);
        spring.add(node, 1.0);
        spring
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_presses_as_the_spring_of_one_node_does() {
        let plane = PlaneContact { node: 3, normal: Vec3::Z, offset_mm: -1.0, stiffness: 2.0, damping: 0.5 };
        let spring = NodalContact::from(plane);
        for z in [0.5f32, 1.5, 4.0] {
            let at = Vec3::new(9.0, 9.0, z);
            let exact = (2.0 * (z - 1.0)).max(0.0);
            assert!((spring.pressure_n(spring.mean(|_| at), Vec3::ZERO) - exact).abs() < 1e-6);
            assert!((plane.depth_mm(at) - (z - 1.0)).abs() < 1e-6);
        }
        assert_eq!(spring.nodes().collect::<Vec<_>>(), [(3, 1.0)]);
    }

    #[test]
    fn it_damps_sliding_by_how_deep_the_node_is() {
        let plane = PlaneContact { damping: 0.5, ..PlaneContact::default() };
        let damping = [-1.0, 0.0, 0.05, 0.1, 0.2, 3.0].map(|depth_mm| plane.sliding_damping(depth_mm));
        assert_eq!(damping, [0.0, 0.0, 0.125, 0.25, 0.5, 0.5]);
    }
}
