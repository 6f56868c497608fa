//! Tissue inside a hollow body, as the brain in the skull: sliding contact with a distance field.
//!
//! # Theory
//! Let φ be the signed distance to the wall, positive in the hollow, and g its unit gradient, away
//! from the wall. Each border node near the wall gets the wall's tangent plane as a spring of its
//! own:
//!
//! ```text
//! n = -g     d = -φ     offset = d - x·n     force on the node: -(k d + b ẋ·n) n, d > 0
//! ```
//! k and b are those of the node's share of the border, a third of the triangles around it, so that
//! a finer mesh meets the same wall. The spring is along the normal only, so the tissue slides; its
//! damping ([`PlaneContact::sliding_damping`]) keeps nodes from chattering on curved walls, where
//! the normal turns a step after the node slid.
//! Springs that nodes share are no substitute: their weights change with every collision step, and
//! a node's own force is then explicit whatever the solver does; nodes of under 0.1 g ring without
//! end.
//!
//! A node that rests in the wall or at it keeps one plane for good: the tangent of the tissue's own
//! border there, through its place at rest. Inside thin bone the field's gradient flips from one
//! side to the other, and a body that rests in the wall must not be pushed at all.
//!
//! # Practice
//! The field comes as a [`Hollow`], so that the carved skull, an analytic shape or a cached grid
//! all do. One call for every border node and step. A plane is sent before its node touches
//! ([`SlidingWall::ahead_mm`]), so that the solver itself finds the moment of contact.
//!
//! # When not to use it
//! Where tissue is tied to the bone (dura at its attachments): fix those nodes.

use crate::{ConfigError, step::check_mesh};
use trepan_contact::{NodalContacts, PlaneContact};
use trepan_geometry::Vec3;
use trepan_mesh::{Surface, TetMesh};

/// What holds tissue back.
pub trait Hollow {
    /// Distance to the wall, positive in the hollow, mm, and its unit gradient, away from the wall.
    fn distance(&mut self, place: Vec3) -> (f32, Vec3);

    /// Distance by which the wall has receded from a node, mm; `None` where it is gone. Given are
    /// the node's depth, mm, a place of the wall and the way out.
    fn recession_mm(&mut self, node: u32, depth_mm: f32, place: Vec3, outward: Vec3) -> Option<f32> {
        let _ = (node, depth_mm, place, outward);
        Some(0.0)
    }
}

/// A wall without openings.
impl<F: FnMut(Vec3) -> (f32, Vec3)> Hollow for F {
    fn distance(&mut self, place: Vec3) -> (f32, Vec3) {
        self(place)
    }
}

/// The border nodes of a body, each with its share of the border.
pub struct SlidingWall {
    border: Vec<BorderNode>,
    /// Spring between tissue and wall, N/mm for each mm² of border. Higher lets less in.
    pub stiffness_per_mm2: f32,
    /// Damping along the normal, N ms/mm for each mm² of border.
    pub damping_per_mm2: f32,
    /// Distance from the wall within which a node's plane is sent, mm: more than a node moves
    /// between two collision results.
    pub ahead_mm: f32,
}

/// A node that may meet the wall.
#[derive(Clone, Copy, Debug)]
pub struct BorderNode {
    /// The node.
    pub node: u32,
    /// Its share of the border at rest, mm².
    pub area_mm2: f32,
    /// Unit normal of the border at rest, out of the tissue.
    pub normal: Vec3,
    /// The plane of a node that rests in the wall or at it, along that normal: depth is `x·n` plus
    /// this, mm.
    fixed_mm: Option<f32>,
}

impl SlidingWall {
    /// For a body's border without the nodes that are held. Stiffness 0.05 N/mm and damping 0.1 N
    /// ms/mm for each mm², ahead by 0.5 mm.
    ///
    /// # Errors
    /// When the mesh is empty, names a node that is not there, or has one that is nowhere.
    pub fn around(body: &TetMesh, held: &[u32]) -> Result<Self, ConfigError> {
        check_mesh(body)?;
        let mut shares = vec![(0.0f32, Vec3::ZERO); body.positions.len()];
        for triangle in Surface::of(body).triangles {
            let [a, b, c] = triangle.map(|n| body.positions[n as usize]);
            let third = (b - a).cross(c - a) / 6.0;
            for n in triangle {
                let (area_mm2, normal) = &mut shares[n as usize];
                (*area_mm2, *normal) = (*area_mm2 + third.length(), *normal + third);
            }
        }
        held.iter().for_each(|&n| shares[n as usize].0 = 0.0);
        let border = (0u32..).zip(shares).filter(|(_, (area_mm2, _))| *area_mm2 > 0.0);
        let border = border.map(|(node, (area_mm2, normal))| BorderNode {
            node,
            area_mm2,
            normal: normal.normalize_or_zero(),
            fixed_mm: None,
        });
        Ok(Self { border: border.collect(), stiffness_per_mm2: 0.05, damping_per_mm2: 0.1, ahead_mm: 0.5 })
    }

    /// The nodes that may meet the wall.
    pub fn border(&self) -> &[BorderNode] {
        &self.border
    }

    /// Takes these positions as the rest shape. Nodes in the wall, or nearer to it than planes are
    /// sent, keep the plane of their place here, so that a body at rest is not pushed.
    pub fn rest_in(&mut self, rest: &[Vec3], mut wall: impl Hollow) {
        for border in &mut self.border {
            let Some(&at) = rest.get(border.node as usize) else { continue };
            let gap_mm = wall.distance(at).0;
            let near = gap_mm < self.ahead_mm && border.normal != Vec3::ZERO;
            border.fixed_mm = near.then(|| -at.dot(border.normal) - gap_mm.max(0.0));
        }
    }

    /// Adds a plane for each border node in the wall or near it. A node where the distance or its
    /// gradient is not finite, or the gradient zero, is left out.
    pub fn step(&self, positions: &[Vec3], mut wall: impl Hollow, out: &mut NodalContacts) {
        for &BorderNode { node, area_mm2, normal, fixed_mm } in &self.border {
            let Some(&at) = positions.get(node as usize) else { continue };
            let (depth_mm, normal) = match fixed_mm {
                Some(offset_mm) => (offset_mm + at.dot(normal), normal),
                None => {
                    let (phi, gradient) = wall.distance(at);
                    (-phi, (-gradient).normalize_or_zero())
                }
            };
            if !(depth_mm > -self.ahead_mm && depth_mm.is_finite() && normal != Vec3::ZERO) {
                continue;
            }
            if let Some(back_mm) = wall.recession_mm(node, depth_mm, at - depth_mm * normal, normal) {
                out.push_plane(PlaneContact {
                    node,
                    normal,
                    offset_mm: depth_mm - back_mm - at.dot(normal),
                    stiffness: self.stiffness_per_mm2 * area_mm2,
                    damping: self.damping_per_mm2 * area_mm2,
                });
            }
        }
    }
}
