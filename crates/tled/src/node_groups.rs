//! Where elements sit at a node: those of one material together, so that what is averaged over a
//! node never mixes two materials.
//!
//! # Theory
//! Average nodal pressure has the energy `Σ_s κ V_s/2 (J_s - 1)²` over node_groups s, the elements
//! of one material around one node, of which a quarter of the volume is theirs:
//! ```text
//! V_s = Σ_e V_e/4      J_s = Σ_e V_e/4 J_e / V_s      pressure in e = κ/4 Σ J_s - 1 over its four node_groups
//! ```
//! With one group a node for all materials no energy stands behind the forces, and the mesh bursts
//! where neighbours differ by 1:1000. With node_groups a bar of two materials is exact.

use crate::layout::Layout;
use trepan_soft::Body;

/// The node_groups of a body: one a node, more where materials meet and volume is averaged.
pub(crate) struct NodeGroups {
    /// Place of every group, ascending.
    pub place_of: Vec<u32>,
    /// Material of every group; 0 where they share.
    material_of: Vec<u8>,
    apart: bool,
}

impl NodeGroups {
    /// One group for each material at a node, or one for all of them.
    pub fn of(body: &Body, layout: &Layout, apart: bool) -> Self {
        let key = |t: usize| if apart { body.material_of_tet[t] } else { 0 };
        let of_tet = |(t, tet): (usize, &[u32; 4])| tet.map(|n| (layout.place_of[n as usize], key(t)));
        let mut node_groups: Vec<(u32, u8)> = body.mesh.tets.iter().enumerate().flat_map(of_tet).collect();
        node_groups.sort_unstable();
        node_groups.dedup();
        let (place_of, material_of) = node_groups.into_iter().unzip();
        Self { place_of, material_of, apart }
    }

    /// NodeGroups of a tetrahedron's corners.
    pub fn of_tet(&self, body: &Body, layout: &Layout, tet: u32) -> [u32; 4] {
        let material = if self.apart { body.material_of_tet[tet as usize] } else { 0 };
        body.mesh.tets[tet as usize].map(|n| {
            let place = layout.place_of[n as usize];
            let mut group = self.place_of.partition_point(|&p| p < place);
            while self.material_of[group] != material {
                group += 1;
            }
            group as u32
        })
    }

    /// One over the volume of every group, 1/mm³.
    pub fn inverse_volumes(&self, body: &Body, layout: &Layout) -> Vec<f32> {
        let mut volumes = vec![0.0; self.place_of.len()];
        for t in 0..body.mesh.tets.len() {
            let quarter = 0.25 * body.mesh.volume_mm3(t);
            self.of_tet(body, layout, t as u32).iter().for_each(|&group| volumes[group as usize] += quarter);
        }
        volumes.into_iter().map(|v| (1.0 / v) as f32).collect()
    }
}
