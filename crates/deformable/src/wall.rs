//! Tissue inside a hollow body, as the brain in the skull: sliding contact with a distance field.
//!
//! # Theory
//! Let φ be the signed distance to the wall, positive in the hollow, and g its unit gradient, away from the
//! wall. Each border node near the wall gets the wall's tangent plane as a spring of its own:
//!
//! ```text
//! n = -g     d = -φ - granted     offset = d - x·n     force on the node: -(k d + b ẋ·n) n, d > 0
//! ```
//! k and b are those of the node's share of the border, a third of the triangles around it, so that a finer
//! mesh meets the same wall. The force is along the normal only, so the tissue slides. Springs that nodes
//! share are no substitute: their weights change with every collision step, and a node's own force is then
//! explicit whatever the solver does; nodes of under 0.1 g ring without end.
//!
//! # Practice
//! The field comes as a function, so that the carved skull, an analytic shape or a cached grid all do. One
//! call for every border node and step. A plane is sent before its node touches ([`SlidingWall::ahead_mm`]),
//! so that the solver itself finds the moment of contact. A scanned brain may lie in scanned bone:
//! [`rest_in`](SlidingWall::rest_in) takes that depth for granted.
//!
//! # When not to use it
//! Where tissue is tied to the bone (dura at its attachments): fix those nodes.

use crate::{ConfigError, step::check_mesh};
use trepan_contact::{NodalContacts, PlaneContact};
use trepan_geometry::Vec3;
use trepan_mesh::{Surface, TetMesh};

/// The border nodes of a body, each with its share of the border.
pub struct SlidingWall {
    border: Vec<BorderNode>,
    /// Spring between tissue and wall, N/mm for each mm² of border. Higher lets less in.
    pub stiffness_per_mm2: f32,
    /// Damping along the normal, N ms/mm for each mm² of border.
    pub damping_per_mm2: f32,
    /// Distance from the wall within which a node's plane is sent, mm: more than a node moves between two
    /// collision results.
    pub ahead_mm: f32,
}

/// A node that may meet the wall.
#[derive(Clone, Copy, Debug)]
struct BorderNode {
    node: u32,
    /// Its share of the border at rest, mm².
    area_mm2: f32,
    /// How deep it may be in the wall without being pushed, mm.
    granted_mm: f32,
}

impl SlidingWall {
    /// For a body's border without the nodes that are held. Stiffness 0.05 N/mm and damping 0.1 N ms/mm for
    /// each mm², ahead by 0.5 mm.
    ///
    /// # Errors
    /// When the mesh is empty, names a node that is not there, or has one that is nowhere.
    pub fn around(body: &TetMesh, held: &[u32]) -> Result<Self, ConfigError> {
        check_mesh(body)?;
        let mut area_mm2 = vec![0.0f32; body.positions.len()];
        for triangle in Surface::of(body).triangles {
            let [a, b, c] = triangle.map(|n| body.positions[n as usize]);
            let third = (b - a).cross(c - a).length() / 6.0;
            triangle.iter().for_each(|&n| area_mm2[n as usize] += third);
        }
        held.iter().for_each(|&n| area_mm2[n as usize] = 0.0);
        let border = (0u32..).zip(area_mm2).filter(|(_, area_mm2)| *area_mm2 > 0.0);
        let border = border.map(|(node, area_mm2)| BorderNode { node, area_mm2, granted_mm: 0.0 }).collect();
        Ok(Self { border, stiffness_per_mm2: 0.05, damping_per_mm2: 0.1, ahead_mm: 0.5 })
    }

    /// Takes it for granted that nodes are as deep in the wall as here, so that a body at rest is not pushed.
    pub fn rest_in(&mut self, rest: &[Vec3], mut distance: impl FnMut(u32, Vec3) -> (f32, Vec3)) {
        for BorderNode { node, granted_mm, .. } in &mut self.border {
            *granted_mm = rest.get(*node as usize).map_or(0.0, |at| (-distance(*node, *at).0).max(0.0));
        }
    }

    /// Adds a plane for each border node in the wall or near it. `distance` gives φ (mm) and its gradient
    /// for a node at a world point; a node where either is not finite, or the gradient zero, is left out.
    pub fn step(
        &self,
        positions: &[Vec3],
        mut distance: impl FnMut(u32, Vec3) -> (f32, Vec3),
        out: &mut NodalContacts,
    ) {
        for &BorderNode { node, area_mm2, granted_mm } in &self.border {
            let Some(&at) = positions.get(node as usize) else { continue };
            let (phi, gradient) = distance(node, at);
            let depth_mm = -phi - granted_mm;
            let Some(normal) = (-gradient).try_normalize() else { continue };
            if depth_mm > -self.ahead_mm && depth_mm.is_finite() {
                out.push_plane(PlaneContact {
                    node,
                    normal,
                    offset_mm: depth_mm - at.dot(normal),
                    stiffness: self.stiffness_per_mm2 * area_mm2,
                    damping: self.damping_per_mm2 * area_mm2,
                });
            }
        }
    }
}
