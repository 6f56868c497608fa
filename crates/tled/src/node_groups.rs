//! Node groups: the elements of one bulk modulus around a node, over which volumes are averaged.
//!
//! # Theory
//! Averaged nodal pressure has the energy `Σ_s κ V_s/2 (J_s - 1)²` over node groups s. Each element
//! contributes a quarter of its volume to each of its four node groups:
//! ```text
//! V_s = Σ_e V_e/4    J_s = Σ_e V_e/4 J_e / V_s    pressure in e = κ/4 Σ (J_s - 1), its four groups
//! ```
//! With a single group per node for all materials the forces would not derive from an energy, and
//! the simulation would diverge where neighbours differ in stiffness by 1:1000. With one group per
//! bulk modulus a bar of two materials is exact.

use trepan_soft::Body;
use trepan_soft::simd::Layout;

/// The node groups of a body: one per node, more where bulk moduli meet and volumes are averaged.
pub(crate) struct NodeGroups {
    /// Place of every group's node, ascending.
    pub place_of: Vec<u32>,
    /// First material with the group's bulk modulus; 0 where all share one.
    bulk_of: Vec<u8>,
    /// The same of each material.
    bulk_groups: Vec<u8>,
}

/// Slots sorted by node group: one run of them belongs to a group, a longer one to a place.
pub(crate) struct Runs {
    /// First slot of each group, and of each place; one more entry than there are.
    pub of_groups: Vec<u32>,
    pub of_places: Vec<u32>,
    /// Slot of each owner.
    pub slots: Vec<u32>,
}

impl NodeGroups {
    /// Creates one group per bulk modulus at a node if `apart`, else one per node.
    pub fn of(body: &Body, layout: &Layout, apart: bool) -> Self {
        let bulk_groups = if apart { body.bulk_groups() } else { vec![0; body.materials.len()] };
        let key = |t: usize| bulk_groups[usize::from(body.material_of_tet[t])];
        let of_tet = |(t, tet): (usize, &[u32; 4])| tet.map(|n| (layout.place_of[n as usize], key(t)));
        let mut node_groups: Vec<(u32, u8)> = body.mesh.tets.iter().enumerate().flat_map(of_tet).collect();
        node_groups.sort_unstable();
        node_groups.dedup();
        let (place_of, bulk_of) = node_groups.into_iter().unzip();
        Self { place_of, bulk_of, bulk_groups }
    }

    /// Node groups of a tetrahedron's corners.
    pub fn of_tet(&self, body: &Body, layout: &Layout, tet: u32) -> [u32; 4] {
        let bulk = self.bulk_groups[usize::from(body.material_of_tet[tet as usize])];
        body.mesh.tets[tet as usize].map(|n| {
            let place = layout.place_of[n as usize];
            let mut group = self.place_of.partition_point(|&p| p < place);
            while self.bulk_of[group] != bulk {
                group += 1;
            }
            group as u32
        })
    }

    /// The node groups at a place.
    pub fn all_at(&self, place: u32) -> std::ops::Range<usize> {
        self.place_of.partition_point(|&p| p < place)..self.place_of.partition_point(|&p| p <= place)
    }

    /// Whether a tetrahedron at a group's node belongs to it.
    pub fn has(&self, group: usize, body: &Body, tet: u32) -> bool {
        self.bulk_of[group] == self.bulk_groups[usize::from(body.material_of_tet[tet as usize])]
    }

    /// One of the node groups at a place.
    pub fn any_at(&self, place: u32) -> u32 {
        self.place_of.partition_point(|&p| p < place) as u32
    }

    /// Inverse volume of every group, 1/mm³.
    pub fn inverse_volumes(&self, body: &Body, layout: &Layout) -> Vec<f32> {
        let mut volumes = vec![0.0; self.place_of.len()];
        for t in 0..body.mesh.tets.len() {
            let quarter = 0.25 * body.mesh.volume_mm3(t);
            self.of_tet(body, layout, t as u32).iter().for_each(|&group| volumes[group as usize] += quarter);
        }
        volumes.into_iter().map(|v| (1.0 / v) as f32).collect()
    }

    /// Gives a slot to each owner of a node group, by group and then in the order of the owners.
    pub fn runs(&self, owned: impl Iterator<Item = u32> + Clone, places: usize) -> Runs {
        let mut of_groups = vec![0u32; self.place_of.len() + 1];
        owned.clone().for_each(|group| of_groups[group as usize + 1] += 1);
        (1..of_groups.len()).for_each(|i| of_groups[i] += of_groups[i - 1]);
        let mut next = of_groups.clone();
        let take = |group: u32| {
            next[group as usize] += 1;
            next[group as usize] - 1
        };
        let slots = owned.map(take).collect();
        let first_of = |place: usize| of_groups[self.place_of.partition_point(|&p| (p as usize) < place)];
        Runs { of_places: (0..=places).map(first_of).collect(), of_groups, slots }
    }
}
