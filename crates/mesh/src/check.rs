//! Validity check of tetrahedral meshes, and its errors.
//!
//! # Theory
//! A valid mesh: every index is in range, every node is finite and belongs to a tetrahedron, every
//! volume (b − a) × (c − a) · (d − a) / 6 is positive, and no face has more than two tetrahedra.
//! The volume is computed in f64 from f32 corners, so that its sign is right unless the element is
//! degenerate to rounding.

use crate::{TetMesh, Topology};
use std::collections::HashSet;

/// Why a mesh cannot be made or used.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum MeshError {
    /// No tetrahedra.
    #[error("the mesh has no tetrahedra; give one with at least one")]
    Empty,
    /// Too many nodes for u32 indices.
    #[error("the mesh has {0} nodes, but at most 4294967294 can be numbered; give a smaller one")]
    TooLarge(usize),
    /// A corner index out of range.
    #[error("tetrahedron {tet} names node {node}, but there are {nodes} nodes; indices start at 0")]
    Index {
        /// The tetrahedron.
        tet: usize,
        /// The invalid index.
        node: u32,
        /// Number of nodes.
        nodes: usize,
    },
    /// A coordinate that is NaN or infinite.
    #[error("node {0} has a coordinate that is not a finite number")]
    NotFinite(usize),
    /// A degenerate or inverted tetrahedron.
    #[error("tetrahedron {tet} has volume {mm3} mm³, which must be positive; swap two of its corners or drop it")]
    Volume {
        /// The tetrahedron.
        tet: usize,
        /// Its signed volume, mm³.
        mm3: f64,
    },
    /// A node that no tetrahedron uses.
    #[error("node {0} belongs to no tetrahedron; drop it (TetMesh::without_orphans)")]
    Orphan(usize),
    /// A face shared by three or more tetrahedra.
    #[error("tetrahedron {0} has a face with more than two tetrahedra, so the mesh overlaps itself; mesh it anew")]
    Face(usize),
    /// An empty mask.
    #[error("the mask has no voxel that is not 0, so there is nothing to fill; give a mask of the organ")]
    EmptyMask,
    /// A mask with a singular affine, or with samples that do not match its dimensions.
    #[error("the mask's {field} is {got}; it must be {wanted}")]
    Mask {
        /// The invalid field.
        field: &'static str,
        /// Its value.
        got: String,
        /// The valid range.
        wanted: &'static str,
    },
    /// A configuration value out of range.
    #[error("config field {field} is {got}; it must be {wanted}")]
    Config {
        /// The field.
        field: &'static str,
        /// Its value.
        got: f64,
        /// The valid range.
        wanted: &'static str,
    },
    /// The requested count cannot be met.
    #[error(
        "target_tets {wanted} cannot be met within 10 % (nearest: {nearest}); ask for more, at least some hundreds"
    )]
    Target {
        /// The requested count.
        wanted: usize,
        /// The nearest count that the search found.
        nearest: usize,
    },
}

impl TetMesh {
    /// Checks that the mesh is valid; returns the first fault. Linear in the size of the mesh.
    pub fn check(&self) -> Result<(), MeshError> {
        self.check_indices()?;
        if let Some(node) = self.positions.iter().position(|p| !p.is_finite()) {
            return Err(MeshError::NotFinite(node));
        }
        if let Some((tet, mm3)) = (0..self.tets.len()).map(|t| (t, self.volume_mm3(t))).find(|(_, v)| *v <= 0.0) {
            return Err(MeshError::Volume { tet, mm3 });
        }
        if let Some(node) = self.used_nodes().iter().position(|used| !used) {
            return Err(MeshError::Orphan(node));
        }
        Topology::of(self).crowded_face.map_or(Ok(()), |tet| Err(MeshError::Face(tet as usize)))
    }

    /// Checks only the indices, as later index arithmetic requires.
    pub fn check_indices(&self) -> Result<(), MeshError> {
        let nodes = self.positions.len();
        if nodes >= u32::MAX as usize {
            return Err(MeshError::TooLarge(nodes));
        }
        if self.tets.is_empty() {
            return Err(MeshError::Empty);
        }
        for (tet, corners) in self.tets.iter().enumerate() {
            if let Some(&node) = corners.iter().find(|&&n| n as usize >= nodes) {
                return Err(MeshError::Index { tet, node, nodes });
            }
        }
        Ok(())
    }

    fn used_nodes(&self) -> Vec<bool> {
        let mut used = vec![false; self.positions.len()];
        self.tets.iter().flatten().for_each(|&n| used[n as usize] = true);
        used
    }

    /// Removes tetrahedra with the same four nodes as an earlier one, in whatever order.
    pub(crate) fn without_repeats(mut self) -> Self {
        let mut seen = HashSet::with_capacity(self.tets.len());
        self.tets.retain(|&(mut nodes)| {
            nodes.sort_unstable();
            seen.insert(nodes)
        });
        self
    }

    /// Removes nodes that no tetrahedron uses, keeping the order of the others.
    pub fn without_orphans(&self) -> Self {
        let used = self.used_nodes();
        let mut new_index = vec![0u32; used.len()];
        let mut positions = Vec::with_capacity(used.len());
        for (node, _) in used.iter().enumerate().filter(|(_, used)| **used) {
            new_index[node] = positions.len() as u32;
            positions.push(self.positions[node]);
        }
        Self { positions, tets: self.tets.iter().map(|t| t.map(|n| new_index[n as usize])).collect() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use trepan_geometry::Vec3;

    fn one() -> TetMesh {
        TetMesh { positions: vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z], tets: vec![[0, 1, 2, 3]] }
    }

    #[test]
    fn each_fault_has_its_own_error() {
        assert_eq!(one().check(), Ok(()));
        assert_eq!(TetMesh::default().check(), Err(MeshError::Empty));
        let mut mesh = one();
        mesh.tets[0][2] = 4;
        assert_eq!(mesh.check(), Err(MeshError::Index { tet: 0, node: 4, nodes: 4 }));
        let mut mesh = one();
        mesh.positions[3].y = f32::NAN;
        assert_eq!(mesh.check(), Err(MeshError::NotFinite(3)));
        let mut mesh = one();
        mesh.tets[0] = [0, 2, 1, 3];
        assert!(matches!(mesh.check(), Err(MeshError::Volume { tet: 0, mm3 }) if mm3 < -0.16));
        let mut mesh = one();
        mesh.positions[3].z = 0.0;
        assert!(matches!(mesh.check(), Err(MeshError::Volume { .. })));
    }

    #[test]
    fn orphans_are_found_and_dropped() {
        let mut mesh = one();
        mesh.positions.insert(1, Vec3::splat(9.0));
        mesh.tets[0] = [0, 2, 3, 4];
        assert_eq!(mesh.check(), Err(MeshError::Orphan(1)));
        assert_eq!(mesh.without_orphans(), one());
    }

    #[test]
    fn a_third_tetrahedron_on_a_face_is_found() {
        let mut mesh = one();
        mesh.positions.extend([Vec3::NEG_Z, Vec3::new(0.1, 0.1, 2.0)]);
        mesh.tets.extend([[0, 2, 1, 4], [0, 1, 2, 5]]);
        assert!(matches!(mesh.check(), Err(MeshError::Face(_))));
    }
}
