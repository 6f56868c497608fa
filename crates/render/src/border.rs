//! The boundary of the deformed tetrahedra with smooth normals.

use crate::{Leaves, RenderError};
use glam::Vec3;
use trepan_mesh::{Surface, TetMesh};

/// The tetrahedra and their boundary, current and at rest.
#[derive(Clone, Debug)]
pub(crate) struct Border {
    /// Boundary nodes, as indices of the mesh.
    nodes: Vec<u32>,
    /// Triangles over `nodes`.
    pub triangles: Vec<[u32; 3]>,
    /// The tetrahedra inside the boundary, over all nodes.
    pub tets: Vec<[u32; 4]>,
    /// The mesh's tetrahedra, and which of them are gone; empty where none is.
    all: Vec<[u32; 4]>,
    gone: Vec<bool>,
    /// All nodes at rest, world mm.
    pub rest: Vec<Vec3>,
    /// All current nodes, world mm.
    pub now: Vec<Vec3>,
    /// Current boundary nodes, world mm.
    pub places: Vec<Vec3>,
    /// Current unit normals of boundary nodes.
    pub normals: Vec<Vec3>,
    /// Blood on boundary nodes, mm; -1 for a burn, [`DURA`] on the dura.
    pub stains: Vec<f32>,
    /// The brain's own triangles, before those of the dura.
    own: usize,
    /// The dura's nodes at rest, world mm.
    leaves: Vec<Vec3>,
}

/// Stain of the dura.
pub(crate) const DURA: f32 = -2.0;

impl Border {
    pub fn of(mesh: &TetMesh) -> Self {
        let surface = Surface::of(mesh);
        let nodes = surface.nodes();
        // Every corner is in the sorted node list, which was made from the corners.
        let local = |n: u32| nodes.partition_point(|&m| m < n) as u32;
        let triangles: Vec<[u32; 3]> = surface.triangles.iter().map(|t| t.map(local)).collect();
        let places: Vec<Vec3> = nodes.iter().map(|&n| mesh.positions[n as usize]).collect();
        let (normals, stains) = (vec![Vec3::ZERO; nodes.len()], vec![0.0; nodes.len()]);
        let (rest, now) = (mesh.positions.clone(), mesh.positions.clone());
        let (tets, all) = (mesh.tets.clone(), mesh.tets.clone());
        let (own, gone, leaves) = (triangles.len(), Vec::new(), Vec::new());
        Self { nodes, triangles, tets, all, gone, rest, now, places, normals, stains, own, leaves }
    }

    /// Shows the mesh without the tetrahedra that are `gone`, or all of it; returns whether that
    /// differs from before. Then it costs 0.3 us a tetrahedron.
    pub fn leave_out(&mut self, gone: Option<&[bool]>) -> bool {
        let gone = gone.filter(|gone| gone.contains(&true)).unwrap_or_default();
        if gone == self.gone {
            return false;
        }
        let is_left = |(t, _): &(usize, &[u32; 4])| !gone.get(*t).is_some_and(|gone| *gone);
        let tets = self.all.iter().enumerate().filter(is_left).map(|(_, tet)| *tet).collect();
        let (all, mesh) = (std::mem::take(&mut self.all), TetMesh { positions: std::mem::take(&mut self.rest), tets });
        *self = Self { all, gone: gone.to_vec(), ..Self::of(&mesh) };
        true
    }

    /// Covers the brain by the dura; returns whether other triangles are there than before.
    pub fn cover(&mut self, dura: Option<&Leaves>) -> Result<bool, RenderError> {
        let none = Leaves { rest: &[], places: &[], triangles: &[] };
        let Leaves { rest, places, triangles } = dura.unwrap_or(&none);
        let (wanted, given) = (rest.len(), places.len());
        if given != wanted || triangles.iter().flatten().any(|&n| n as usize >= wanted) {
            return Err(RenderError::Nodes { wanted, given });
        }
        let first = self.nodes.len() as u32;
        let moved = triangles.iter().map(|corners| corners.map(|n| n + first));
        let is_other = wanted != self.leaves.len() || !self.triangles[self.own..].iter().copied().eq(moved.clone());
        if is_other {
            self.triangles.truncate(self.own);
            self.triangles.extend(moved);
            self.places.resize(self.nodes.len() + wanted, Vec3::ZERO);
            self.normals.resize(self.places.len(), Vec3::ZERO);
            self.stains.resize(self.places.len(), DURA);
        }
        self.leaves.clear();
        self.leaves.extend_from_slice(rest);
        self.places[self.nodes.len()..].copy_from_slice(places);
        Ok(is_other)
    }

    /// Updates the boundary from the mesh's nodes, or resets it to rest.
    pub fn follow(&mut self, positions: Option<&[Vec3]>) -> Result<(), RenderError> {
        let positions = positions.unwrap_or(&self.rest);
        let (given, wanted) = (positions.len(), self.rest.len());
        if given != wanted {
            return Err(RenderError::Nodes { wanted, given });
        }
        self.now.copy_from_slice(positions);
        self.places.iter_mut().zip(&self.nodes).for_each(|(place, &n)| *place = positions[n as usize]);
        smooth_normals(&self.places, &self.triangles, &mut self.normals);
        Ok(())
    }

    /// Takes the stain of each node, as in a frame.
    pub fn stain(&mut self, stains: Option<&[u8]>) {
        let mm = |stain: u8| if stain == u8::MAX { -1.0 } else { 0.01 * f32::from(stain) };
        let of = |node: u32| stains.and_then(|all| all.get(node as usize)).map_or(0.0, |stain| mm(*stain));
        self.stains.iter_mut().zip(&self.nodes).for_each(|(stain, &node)| *stain = of(node));
    }

    /// Rest position of a boundary node, world mm.
    pub fn at_rest(&self, node: u32) -> Vec3 {
        match self.nodes.get(node as usize) {
            Some(&own) => self.rest[own as usize],
            None => self.leaves[node as usize - self.nodes.len()],
        }
    }

    /// The brain's current boundary triangles, without the dura.
    pub fn corners(&self) -> impl Iterator<Item = [Vec3; 3]> + Clone + '_ {
        self.triangles[..self.own].iter().map(|t| t.map(|n| self.places[n as usize]))
    }
}

/// Area-weighted mean of the triangle normals at every node; zero where they cancel.
fn smooth_normals(places: &[Vec3], triangles: &[[u32; 3]], normals: &mut [Vec3]) {
    normals.fill(Vec3::ZERO);
    for corners in triangles {
        let [a, b, c] = corners.map(|n| places[n as usize]);
        let twice_area = (b - a).cross(c - a);
        corners.iter().for_each(|&n| normals[n as usize] += twice_area);
    }
    normals.iter_mut().for_each(|n| *n = n.normalize_or_zero());
}
