//! Memory order of nodes and elements: neighbours in space are neighbours in memory.
//!
//! # Theory
//! Nodes are sorted along a Morton curve, elements by law and then by their lowest node. The
//! elements of one law run through one kernel, and the nodes of consecutive elements are in cache.

use crate::{Body, Law};
use trepan_geometry::Vec3;

/// Solver order of nodes and elements.
pub struct Layout {
    /// Mesh node at each place of the solver's order.
    pub node_at: Vec<u32>,
    /// Place of each mesh node.
    pub place_of: Vec<u32>,
    /// Mesh tetrahedron at each place of the solver's order.
    pub tet_at: Vec<u32>,
}

impl Layout {
    /// The order for a body.
    pub fn of(body: &Body) -> Self {
        let mesh = &body.mesh;
        let bounds = mesh.bounds();
        let scale = Vec3::splat(1023.0) / (bounds.max - bounds.min).max(Vec3::splat(f32::MIN_POSITIVE));
        let code = |n: &u32| morton((mesh.positions[*n as usize] - bounds.min) * scale);
        let mut node_at: Vec<u32> = (0..mesh.positions.len() as u32).collect();
        node_at.sort_by_cached_key(|n| (code(n), *n));
        let mut place_of = vec![0; node_at.len()];
        node_at.iter().enumerate().for_each(|(place, &n)| place_of[n as usize] = place as u32);
        let mut tet_at: Vec<u32> = (0..mesh.tets.len() as u32).collect();
        tet_at.sort_by_cached_key(|&t| {
            let mut places = mesh.tets[t as usize].map(|n| place_of[n as usize]);
            places.sort_unstable();
            (kind(body, t), places, t)
        });
        Self { node_at, place_of, tet_at }
    }
}

/// Number of the constitutive law of a tetrahedron.
pub fn kind(body: &Body, tet: u32) -> u8 {
    match body.material(tet as usize).law() {
        Law::NeoHookean(_) => 0,
        Law::StVenantKirchhoff { .. } => 1,
        Law::MooneyRivlin { .. } => 2,
        Law::Ogden { .. } => 3,
        Law::Stiffening(_) => 4,
    }
}

/// Morton code: interleaves ten bits of each coordinate.
fn morton(p: Vec3) -> u32 {
    let spread = |x: f32| (0..10).fold(0u32, |code, bit| code | ((x as u32 >> bit & 1) << (3 * bit)));
    spread(p.x) | spread(p.y) << 1 | spread(p.z) << 2
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Material, boxes};

    #[test]
    fn every_node_and_element_has_one_place() {
        let mut body =
            Body::uniform(boxes::split_box([3, 2, 4], Vec3::new(3.0, 5.0, 7.0)), vec![], Material::BRAIN_OGDEN);
        body.materials.push(Material::BRAIN);
        body.material_of_tet.iter_mut().step_by(3).for_each(|m| *m = 1);
        let layout = Layout::of(&body);
        assert!(layout.tet_at.is_sorted_by_key(|&t| kind(&body, t)));
        assert!(layout.node_at.iter().enumerate().all(|(place, &n)| layout.place_of[n as usize] == place as u32));
        let mut tets = layout.tet_at.clone();
        tets.sort_unstable();
        assert!(tets.iter().enumerate().all(|(i, &t)| i == t as usize));
    }
}
