//! The isosurface in one cell of eight voxel centres, as triangles.
//!
//! # Theory
//! The density is linear along the twelve edges of the cell; those with an end in bone and one in
//! air carry a vertex. On each face the vertices are joined in pairs; where all four edges of a
//! face cross, the face's bilinear density decides which pairs: its saddle is bone or air. The
//! pairs close to loops around the cell, and a loop is a fan of triangles about its mean. Neighbour
//! cells decide alike on the face that they share, so that the surface has no holes.
//!
//! On a plane all vertices of a loop are on it: densities more than a cell's edge away from the
//! surface, clipped as a scanner clips them, do not bend it.
//!
//! # Sources
//! W. E. Lorensen, H. E. Cline, *Marching cubes*, SIGGRAPH 1987; G. M. Nielson, B. Hamann, *The
//! asymptotic decider*, IEEE Visualization 1991.

use glam::DVec3;

/// Places for edges: `8 axis + lower corner`.
const EDGES: usize = 24;

/// Calls `triangle` with each triangle of the isosurface, in units of the cell's edge from
/// corner 0. `density[c]` is that over the isovalue at the corner whose bits are x, y, z.
pub(crate) fn triangles(density: &[f64; 8], mut triangle: impl FnMut([DVec3; 3])) {
    if density.iter().all(|&d| d >= 0.0) || density.iter().all(|&d| d < 0.0) {
        return;
    }
    let mut links: [[Option<usize>; 2]; EDGES] = [[None; 2]; EDGES];
    for face in 0..6 {
        join(density, face / 2, face % 2, &mut links);
    }
    for start in 0..EDGES {
        let (mut ring, mut count, mut at) = ([DVec3::ZERO; 12], 0, start);
        while let Some(next) = links[at].iter_mut().find_map(Option::take) {
            if let Some(back) = links[next].iter_mut().find(|link| **link == Some(at)) {
                *back = None;
            }
            ring[count] = vertex(density, at);
            (count, at) = (count + 1, next);
        }
        fan(&ring[..count], &mut triangle);
    }
}

/// Joins the vertices on the face of `axis` and `side`.
fn join(density: &[f64; 8], axis: usize, side: usize, links: &mut [[Option<usize>; 2]; EDGES]) {
    let (u, v) = (1 << ((axis + 1) % 3), 1 << ((axis + 2) % 3));
    let ring = [0, u, u | v, v].map(|corner| corner | side << axis);
    let bone = ring.map(|corner| density[corner] >= 0.0);
    let edge = |i: usize| edge_of(ring[i % 4], ring[(i + 1) % 4]);
    let mut connect = |a: usize, b: usize| {
        for (from, to) in [(a, b), (b, a)] {
            if let Some(free) = links[from].iter_mut().find(|link| link.is_none()) {
                *free = Some(to);
            }
        }
    };
    let crossing: [bool; 4] = core::array::from_fn(|i| bone[i] != bone[(i + 1) % 4]);
    if crossing == [true; 4] {
        let [a, b, c, d] = ring.map(|corner| density[corner]);
        // Air between two corners of bone parts them: each corner of bone is cut off by itself.
        let through = (a * c - b * d) / (a + c - b - d) >= 0.0;
        let first = usize::from(bone[0] == through);
        connect(edge(first), edge(first + 3));
        connect(edge(first + 1), edge(first + 2));
        return;
    }
    let mut cut = (0..4).filter(|&i| crossing[i]);
    if let (Some(a), Some(b)) = (cut.next(), cut.next()) {
        connect(edge(a), edge(b));
    }
}

fn edge_of(a: usize, b: usize) -> usize {
    8 * (a ^ b).trailing_zeros() as usize + (a & b)
}

/// Where the density crosses on an edge.
fn vertex(density: &[f64; 8], edge: usize) -> DVec3 {
    let (axis, low) = (edge / 8, edge % 8);
    let (from, to) = (density[low], density[low | 1 << axis]);
    let mut at = DVec3::from_array([0, 1, 2].map(|i| (low >> i & 1) as f64));
    at[axis] = from / (from - to);
    at
}

fn fan(ring: &[DVec3], triangle: &mut impl FnMut([DVec3; 3])) {
    match *ring {
        [a, b, c] => triangle([a, b, c]),
        [_, _, _, _, ..] => {
            let mean = ring.iter().sum::<DVec3>() / ring.len() as f64;
            for i in 0..ring.len() {
                triangle([mean, ring[i], ring[(i + 1) % ring.len()]]);
            }
        }
        _ => {}
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashMap;

    /// Corners by a pattern of bits, bone 1 and air -1.
    fn pattern(bits: usize) -> [f64; 8] {
        core::array::from_fn(|c| if bits >> c & 1 == 1 { 1.0 } else { -1.0 - 0.01 * c as f64 })
    }

    /// An edge of a triangle, rounded so that neighbours have the same.
    fn key(a: DVec3, b: DVec3) -> [[i64; 3]; 2] {
        let mut ends = [a, b].map(|p| (p * 1e6).round().as_i64vec3().to_array());
        ends.sort_unstable();
        ends
    }

    #[test]
    fn every_pattern_closes_but_for_the_faces_of_the_cell() {
        for bits in 0..256 {
            let mut edges = HashMap::new();
            triangles(&pattern(bits), |[a, b, c]| {
                for (from, to) in [(a, b), (b, c), (c, a)] {
                    *edges.entry(key(from, to)).or_insert(0) += 1;
                }
            });
            for (ends, count) in edges {
                let on_face = (0..3).any(|i| ends[0][i] == ends[1][i] && [0, 1_000_000].contains(&ends[0][i]));
                assert_eq!(count, if on_face { 1 } else { 2 }, "{bits:08b}: {ends:?}");
            }
        }
    }

    #[test]
    fn a_clipped_plane_stays_a_plane() {
        let normal = DVec3::new(0.48, 0.6, 0.64);
        for offset in [0.2, 0.5, 0.9, 1.3] {
            let corner = |c: usize| DVec3::from_array([0, 1, 2].map(|i| (c >> i & 1) as f64));
            let density = core::array::from_fn(|c| (offset - normal.dot(corner(c))).clamp(-1.0, 1.0));
            let mut seen = 0;
            triangles(&density, |triangle| {
                seen += 1;
                assert!(triangle.iter().all(|p| (normal.dot(*p) - offset).abs() < 1e-12), "{triangle:?}");
            });
            assert!(seen > 0);
        }
    }
}
