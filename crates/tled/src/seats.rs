//! Where elements sit at a node: those of one material together, so that what is averaged over a node never mixes two materials.
//!
//! # Theory
//! Average nodal pressure has the energy `Σ_s κ V_s/2 (J_s - 1)²` over seats s, the elements of one material around one node, of which a quarter of the volume is theirs:
//! ```text
//! V_s = Σ_e V_e/4      J_s = Σ_e V_e/4 J_e / V_s      pressure in e = κ/4 Σ J_s - 1 over its four seats
//! ```
//! With one seat a node for all materials no energy stands behind the forces, and the mesh bursts where neighbours differ by 1:1000. With seats a bar of two
//! materials is exact.

use crate::layout::Layout;
use trepan_soft::Body;

/// The seats of a body: one a node, more where materials meet and volume is averaged.
pub(crate) struct Seats {
    /// Place of every seat, ascending.
    pub place_of: Vec<u32>,
    /// Material of every seat; 0 where they share.
    material_of: Vec<u8>,
    apart: bool,
}

impl Seats {
    /// One seat for each material at a node, or one for all of them.
    pub fn of(body: &Body, layout: &Layout, apart: bool) -> Self {
        let key = |t: usize| if apart { body.material_of_tet[t] } else { 0 };
        let of_tet = |(t, tet): (usize, &[u32; 4])| tet.map(|n| (layout.place_of[n as usize], key(t)));
        let mut seats: Vec<(u32, u8)> = body.mesh.tets.iter().enumerate().flat_map(of_tet).collect();
        seats.sort_unstable();
        seats.dedup();
        let (place_of, material_of) = seats.into_iter().unzip();
        Self { place_of, material_of, apart }
    }

    /// Seats of a tetrahedron's corners.
    pub fn of_tet(&self, body: &Body, layout: &Layout, tet: u32) -> [u32; 4] {
        let material = if self.apart { body.material_of_tet[tet as usize] } else { 0 };
        body.mesh.tets[tet as usize].map(|n| {
            let place = layout.place_of[n as usize];
            let mut seat = self.place_of.partition_point(|&p| p < place);
            while self.material_of[seat] != material {
                seat += 1;
            }
            seat as u32
        })
    }

    /// One over the volume of every seat, 1/mm³.
    pub fn inverse_volumes(&self, body: &Body, layout: &Layout) -> Vec<f32> {
        let mut volumes = vec![0.0; self.place_of.len()];
        for t in 0..body.mesh.tets.len() {
            let quarter = 0.25 * body.mesh.volume_mm3(t);
            self.of_tet(body, layout, t as u32).iter().for_each(|&seat| volumes[seat as usize] += quarter);
        }
        volumes.into_iter().map(|v| (1.0 / v) as f32).collect()
    }
}
