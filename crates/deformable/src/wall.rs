//! Tissue inside a hollow body, as the brain in the skull: sliding contact with a distance field.
//!
//! # Theory
//! Let φ be the signed distance to the wall, positive in the hollow, and g its unit gradient, away from the wall. A border node with φ < 0 lies -φ deep in the wall. The border is cut
//! into patches; the nodes of a patch that are too deep share one spring with weights by their depths, along the mean of their `-g`:
//!
//! ```text
//! n = -Σ dᵢ gᵢ / |Σ dᵢ gᵢ|     d = Σ wᵢ dᵢ     offset = d - x̄·n     force on node i: -wᵢ k d n
//! ```
//! The force is along the normal only, so the tissue slides; it is a [`NodalContact`], so the solver evaluates it with its own positions.
//!
//! # Practice
//! The field comes as a function, so that the carved skull, an analytic shape or a cached grid all do. One call for every border node and step. A scanned brain may
//! lie in scanned bone: [`rest_in`](SlidingWall::rest_in) takes that depth for granted.
//!
//! # When not to use it
//! Where tissue is tied to the bone (dura at its attachments): fix those nodes.

use crate::{ConfigError, step::check_mesh, surface::MovingSurface};
use trepan_contact::{MAX_NODES, NodalContact, NodalContacts};
use trepan_geometry::Vec3;
use trepan_mesh::TetMesh;

/// The border nodes of a body, in patches.
pub struct SlidingWall {
    patches: Vec<Vec<u32>>,
    /// How deep each node may be in the wall without being pushed, mm.
    granted_mm: Vec<f32>,
    /// Spring between tissue and wall, N/mm for each patch. Higher lets less in.
    pub stiffness: f32,
    /// Damping along the normal, N ms/mm.
    pub damping: f32,
}

impl SlidingWall {
    /// For a body's border without the nodes that are held. Stiffness 1 N/mm, damping 1 N ms/mm.
    ///
    /// # Errors
    /// When the mesh is empty, names a node that is not there, or has one that is nowhere.
    pub fn around(body: &TetMesh, held: &[u32]) -> Result<Self, ConfigError> {
        check_mesh(body)?;
        let surface = MovingSurface::of(body);
        let mut is_taken = vec![false; body.positions.len()];
        held.iter().for_each(|&n| is_taken[n as usize] = true);
        let mut patches: Vec<Vec<u32>> = Vec::new();
        for cluster in 0..surface.clusters() {
            let nodes = surface.nodes_of(cluster).iter().copied();
            let own: Vec<u32> = nodes.filter(|&n| !core::mem::replace(&mut is_taken[n as usize], true)).collect();
            patches.extend(own.chunks(MAX_NODES).map(<[u32]>::to_vec));
        }
        Ok(Self { patches, granted_mm: vec![0.0; body.positions.len()], stiffness: 1.0, damping: 1.0 })
    }

    /// Takes it for granted that nodes are as deep in the wall as here, so that a body at rest is not pushed.
    pub fn rest_in(&mut self, rest: &[Vec3], distance: impl Fn(Vec3) -> (f32, Vec3)) {
        for (granted, at) in self.granted_mm.iter_mut().zip(rest) {
            *granted = (-distance(*at).0).max(0.0);
        }
    }

    /// Adds one spring for each patch that presses on the wall. `distance` gives φ (mm) and its gradient at a world point; a node where either is not finite is left out.
    pub fn step(&self, positions: &[Vec3], distance: impl Fn(Vec3) -> (f32, Vec3), out: &mut NodalContacts) {
        for patch in &self.patches {
            if let Some(contact) = self.press(patch, positions, &distance) {
                out.push(contact);
            }
        }
    }

    fn press(
        &self,
        patch: &[u32],
        positions: &[Vec3],
        distance: &impl Fn(Vec3) -> (f32, Vec3),
    ) -> Option<NodalContact> {
        let (mut contact, mut out_of_tissue, mut sum, mut sum2) = (NodalContact::none(), Vec3::ZERO, 0.0f32, 0.0f32);
        for &node in patch {
            let (phi, gradient) = distance(*positions.get(node as usize)?);
            let depth_mm = -phi - self.granted_mm[node as usize];
            if depth_mm > 0.0 && depth_mm.is_finite() && gradient.is_finite() {
                contact.add(node, depth_mm);
                out_of_tissue -= gradient * depth_mm;
                (sum, sum2) = (sum + depth_mm, sum2 + depth_mm * depth_mm);
            }
        }
        contact.normalise();
        contact.normal = out_of_tissue.try_normalize()?;
        let depth_mm = sum2 / sum;
        contact.offset_mm = depth_mm - contact.mean(|n| positions[n as usize]).dot(contact.normal);
        (contact.stiffness, contact.damping) = (self.stiffness, self.damping);
        Some(contact)
    }
}
