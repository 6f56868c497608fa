//! Two moving meshes against each other, and one against itself: which border nodes lie in which
//! tetrahedra, and what pushes them apart.
//!
//! # Theory
//! A border node p of one body in a tetrahedron of the other has barycentric coordinates there;
//! with them it is carried back to the other body at rest, to X. The closest border point of the
//! body at rest, q(X), carried forward again with its triangle, is where p has to leave. Both ways
//! are continuous across tetrahedra, and X knows how deep it is however the body is bent: the
//! rest-state distance field of Fisher and Lin 2001, without a grid. The depth is `|q - p|`, the
//! normal points from p to q.
//!
//! ```text
//!   moving        at rest     A force f n on the node and -f wᵢ n on the triangle's nodes acts
//!   __q__         __q__       along the line through p and q: momentum is conserved to rounding.
//!     |p   ─────►    |X
//! ```
//!
//! # Practice
//! The candidates come from a [`BroadPhase`]. Every node is in at most one contact with the other
//! body. Nothing is allocated after `new`. Cost: one pass over all boxes, and 1 to 3 us for each
//! node inside.
//!
//! # When not to use it
//! For edges that cross without a node inside: meshes of like fineness. Through walls thinner than
//! a step's motion.

use crate::{
    bounded::push_bounded,
    config::ConfigError,
    narrow::{Hits, NONE},
    phase::{BroadPhase, Indexed},
    scene::Scene,
    search::HashedGrid,
    step::{check_mesh, usual_cell_mm},
    surface::{MovingSurface, distinct_rows},
};
use trepan_contact::NodalContact;
use trepan_geometry::{Aabb, Pose, ToolState, Vec3};
use trepan_mesh::{Surface, TetMesh};

/// One border node of a body inside another.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NodeContact {
    /// The node.
    pub node: u32,
    /// Nodes of the other body's border triangle that it has to leave through.
    pub triangle: [u32; 3],
    /// Weights of the place on that triangle; they sum to 1.
    pub weights: [f32; 3],
    /// Unit vector out of the other body, from the node to that place.
    pub normal: Vec3,
    /// How deep, mm.
    pub depth_mm: f32,
}

/// Border nodes of one body against the tetrahedra of another, or of the same.
pub struct MeshCollision {
    nodes: Vec<u32>,
    tets: Vec<[u32; 4]>,
    rest: Vec<Vec3>,
    rest_surface: MovingSurface,
    itself: bool,
    phase: Box<dyn BroadPhase>,
    points: Vec<Vec3>,
    pairs: Vec<[u32; 2]>,
    hits: Hits,
}

/// Room for this many candidate tetrahedra at each node.
const CANDIDATES: usize = 32;
/// Nodes in contact closer to the border than this are on it, mm.
const ON_BORDER_MM: f32 = 1e-6;

impl MeshCollision {
    /// Border nodes of `body` against `other`.
    ///
    /// # Errors
    /// When a mesh is empty, names a node that is not there, or has one that is nowhere.
    pub fn between(body: &TetMesh, other: &TetMesh) -> Result<Self, ConfigError> {
        check_mesh(body)?;
        check_mesh(other)?;
        let nodes = distinct_rows([Surface::of(body).triangles.into_flattened().into_iter()].into_iter()).items;
        let (count, cell_mm) = (nodes.len(), usual_cell_mm(other));
        let mut rest_surface = MovingSurface::of(other);
        rest_surface.refit(&other.positions, crate::extent::Extent::EMPTY);
        Ok(Self {
            phase: Box::new(Indexed::new(HashedGrid::new(cell_mm, count), other.tets.len())),
            points: vec![Vec3::ZERO; count],
            pairs: Vec::with_capacity(count * CANDIDATES),
            hits: Hits::with_points(count),
            tets: other.tets.clone(),
            rest: other.positions.clone(),
            rest_surface,
            itself: false,
            nodes,
        })
    }

    /// Border nodes of a body against the rest of it: folds and sulci.
    ///
    /// # Errors
    /// As [`between`](Self::between).
    pub fn itself(body: &TetMesh) -> Result<Self, ConfigError> {
        Ok(Self { itself: true, ..Self::between(body, body)? })
    }

    /// Nodes of the other body, of which a step takes as many.
    pub fn nodes(&self) -> usize {
        self.rest.len()
    }

    /// Finds the nodes inside, given both bodies' moved nodes (mm; the same twice for one body);
    /// `out` is cleared and filled up to its capacity. Returns how many candidates or contacts did
    /// not fit. Arrays of another length than the meshes give no contact and count all nodes.
    pub fn step(&mut self, body: &[Vec3], other: &[Vec3], out: &mut Vec<NodeContact>) -> u32 {
        out.clear();
        if other.len() != self.rest.len() || self.nodes.iter().any(|&n| n as usize >= body.len()) {
            return self.nodes.len() as u32;
        }
        for (point, &node) in self.points.iter_mut().zip(&self.nodes) {
            *point = body[node as usize];
        }
        self.hits.clear();
        let region = Aabb::of_points(self.points.iter().filter(|p| p.is_finite()));
        self.phase.update(other, &self.tets, &region);
        let mut overflow = self.phase.pairs(&self.points, &mut self.pairs);
        self.test_pairs(other);
        for i in 0..self.nodes.len() {
            overflow += self.contact(i, other).map_or(0, |contact| push_bounded(out, contact));
        }
        overflow
    }

    fn test_pairs(&mut self, other: &[Vec3]) {
        let still = ToolState::at(Pose::IDENTITY);
        let (tets, points) = (&self.tets[..], &self.points[..]);
        let scene = Scene {
            positions: other,
            velocities: &[],
            tets,
            neighbours: &[],
            points,
            tool: &still,
            radius_mm: 0.0,
            live: &[],
        };
        for &[point, tet] in &self.pairs {
            let i = point as usize;
            let own = self.itself && tets[tet as usize].contains(&self.nodes[i]);
            if !own && self.hits.tet[i] == NONE {
                self.hits.test(&scene, i, tet);
            }
        }
    }

    fn contact(&mut self, i: usize, other: &[Vec3]) -> Option<NodeContact> {
        let corners = *self.tets.get(self.hits.tet[i] as usize)?;
        let weights = self.hits.weights[i];
        let at_rest = (0..4).map(|c| self.rest[corners[c] as usize] * weights[c]).sum();
        let foot = self.rest_surface.closest(&self.rest, at_rest)?;
        let triangle = self.rest_surface.triangles[foot.triangle as usize];
        let weights = self.rest_surface.weights_at(&foot).map(|(_, weight)| weight);
        let place: Vec3 = (0..3).map(|c| other[triangle[c] as usize] * weights[c]).sum();
        let way = place - self.points[i];
        let depth_mm = way.length();
        let is_sound = depth_mm > ON_BORDER_MM && depth_mm.is_finite();
        is_sound.then(|| NodeContact { node: self.nodes[i], triangle, weights, normal: way / depth_mm, depth_mm })
    }
}

impl NodeContact {
    /// Spring of a contact of a body with itself, N/mm and N ms/mm, for a solver. It acts between
    /// the node and the triangle that it leaves through.
    pub fn spring(&self, stiffness: f32, damping: f32) -> NodalContact {
        let mut spring = NodalContact::none();
        spring.add(self.node, 1.0);
        self.left_through().for_each(|(node, weight)| spring.add(node, -weight));
        (spring.normal, spring.stiffness, spring.damping) = (-self.normal, stiffness, damping);
        spring
    }

    /// Nodes of the triangle that it leaves through, with their weights.
    fn left_through(&self) -> impl Iterator<Item = (u32, f32)> {
        self.triangle.into_iter().zip(self.weights)
    }

    /// Force of a spring on the node, N.
    fn force(&self, stiffness: f32) -> Vec3 {
        self.normal * (stiffness * self.depth_mm)
    }
}

/// Adds the springs of contacts to nodal forces, N. Each is `stiffness` (N/mm) times depth on the
/// node, and the opposite on the triangle that it leaves through.
pub fn push_apart(contacts: &[NodeContact], stiffness: f32, on_body: &mut [Vec3], on_other: &mut [Vec3]) {
    for contact in contacts {
        let force = contact.force(stiffness);
        on_body[contact.node as usize] += force;
        contact.left_through().for_each(|(node, weight)| on_other[node as usize] -= force * weight);
    }
}

/// [`push_apart`] for a body against itself.
pub fn push_itself_apart(contacts: &[NodeContact], stiffness: f32, forces: &mut [Vec3]) {
    for contact in contacts {
        let force = contact.force(stiffness);
        forces[contact.node as usize] += force;
        contact.left_through().for_each(|(node, weight)| forces[node as usize] -= force * weight);
    }
}
