//! The thesis's response: mean face normal, and Algorithm 2 for the depth.
//!
//! # Theory
//! Normal: mean of the unit normals of the surface faces of the tetrahedra hit. Depth: over all
//! points inside and all surface faces of their tetrahedra, the greatest distance from point to
//! face plane (thesis 4.3). A corner tetrahedron's far face counts too, as printed; the other form
//! measures each point against the nearest surface face of its tetrahedron.
//!
//! # When not to use it
//! Wherever the tool goes deeper than one layer of tetrahedra: a point in an inner tetrahedron adds
//! no depth, so deeper can read shallower, and the depth jumps at every border. Kept for
//! comparison.

use crate::narrow::{Hits, NONE};
use crate::outcome::TissueStep;
use crate::response::{Answer, Respond};
use crate::scene::Scene;
use crate::surface::MovingSurface;
use trepan_contact::Contact;
use trepan_geometry::Vec3;
use trepan_mesh::FACES;

/// Algorithm 2 in one of its two forms.
pub(crate) struct Faces {
    pub nearest: bool,
}

impl Respond for Faces {
    fn respond(&mut self, scene: &Scene, hits: &Hits, _: &mut MovingSurface, out: &mut TissueStep) -> Option<Answer> {
        let (mut normals, mut depth_mm) = (Vec3::ZERO, 0.0f32);
        for i in (0..hits.tet.len() - 1).filter(|&i| hits.tet[i] != NONE) {
            let tet = hits.tet[i];
            let is_first = hits.tet[..i].iter().all(|&t| t != tet);
            let mut of_point: Option<(f32, Vec3)> = None;
            for (normal, distance) in surface_faces(scene, tet, scene.points[i]) {
                normals += if is_first { normal } else { Vec3::ZERO };
                let better = of_point.is_none_or(|(d, _)| (distance < d) == self.nearest);
                of_point = if better { Some((distance, normal)) } else { of_point };
            }
            if let Some((distance, normal)) = of_point {
                depth_mm = depth_mm.max(distance);
                out.manifold.push(Contact { point: scene.points[i], normal, depth_mm: distance });
            }
            for (&node, &weight) in scene.tets[tet as usize].iter().zip(&hits.weights[i]) {
                out.nodal.add(node, weight.max(0.0));
            }
        }
        Some(Answer { normal: normals.try_normalize()?, depth_mm })
    }
}

/// Unit normal of each surface face of a tetrahedron, and the point's distance from its plane.
fn surface_faces(scene: &Scene, tet: u32, point: Vec3) -> impl Iterator<Item = (Vec3, f32)> {
    let corners = scene.corners(tet);
    let neighbours = scene.neighbours[tet as usize];
    (0..4).filter(move |&f| neighbours[f] == NONE).filter_map(move |f| {
        let [a, b, c] = FACES[f].map(|corner| corners[corner]);
        let normal = (b - a).cross(c - a).try_normalize()?;
        Some((normal, (point - a).dot(normal).abs()))
    })
}
