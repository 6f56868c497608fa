//! A triangle mesh as plain data.

use trepan_geometry::{Aabb, Vec3};

/// Vertices and triangles; a closed mesh is counterclockwise seen from outside.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TriMesh {
    /// Vertices, world mm.
    pub positions: Vec<Vec3>,
    /// Three vertex indices each.
    pub triangles: Vec<[u32; 3]>,
}

impl TriMesh {
    /// The corners of a triangle, mm.
    pub fn corners(&self, triangle: usize) -> [Vec3; 3] {
        self.triangles[triangle].map(|n| self.positions[n as usize])
    }

    /// The volume enclosed by a closed mesh, mm³ (divergence theorem: Σ a · (b × c) / 6); negative
    /// if inside out.
    pub fn volume_mm3(&self) -> f64 {
        let origin = self.positions.first().map_or(glam::DVec3::ZERO, |p| p.as_dvec3());
        let six = |t: usize| {
            let [a, b, c] = self.corners(t).map(|p| p.as_dvec3() - origin);
            a.dot(b.cross(c))
        };
        (0..self.triangles.len()).map(six).sum::<f64>() / 6.0
    }

    /// Whether every edge has exactly two triangles, in opposite directions; false for an empty
    /// mesh.
    pub fn is_closed(&self) -> bool {
        is_closed(&self.triangles)
    }

    /// Box of all vertices, mm.
    pub fn bounds(&self) -> Aabb {
        Aabb::of_points(&self.positions)
    }

    /// Merges vertices at exactly the same position and removes triangles that become degenerate.
    /// For formats without shared vertices (STL).
    pub fn welded(&self) -> Self {
        let key = |p: Vec3| (p + Vec3::ZERO).to_array().map(f32::to_bits);
        let mut order: Vec<u32> = (0..self.positions.len() as u32).collect();
        order.sort_by_key(|&n| (key(self.positions[n as usize]), n));
        let mut first_at = vec![0; order.len()];
        for same in order.chunk_by(|&a, &b| key(self.positions[a as usize]) == key(self.positions[b as usize])) {
            same.iter().for_each(|&n| first_at[n as usize] = same[0]);
        }
        let mut new_index = vec![u32::MAX; order.len()];
        let mut welded = Self::default();
        for triangle in &self.triangles {
            let [a, b, c] = triangle.map(|n| first_at[n as usize]);
            if a != b && b != c && c != a {
                let corners = [a, b, c].map(|n| welded.numbered(n, self.positions[n as usize], &mut new_index));
                welded.triangles.push(corners);
            }
        }
        welded
    }

    pub(crate) fn numbered(&mut self, old: u32, position: Vec3, new_index: &mut [u32]) -> u32 {
        let slot = &mut new_index[old as usize];
        if *slot == u32::MAX {
            *slot = self.positions.len() as u32;
            self.positions.push(position);
        }
        *slot
    }
}

/// Whether each directed edge occurs once and its reverse once.
pub(crate) fn is_closed(triangles: &[[u32; 3]]) -> bool {
    let mut edges: Vec<[u32; 2]> = triangles.iter().flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]).collect();
    edges.sort_unstable();
    let twice = edges.windows(2).any(|w| w[0] == w[1]);
    !twice && !edges.is_empty() && edges.iter().all(|&[a, b]| a != b && edges.binary_search(&[b, a]).is_ok())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A unit cube of 12 triangles that share no vertex.
    fn soup_cube() -> TriMesh {
        let corner = |n: usize| Vec3::new((n & 1) as f32, (n >> 1 & 1) as f32, (n >> 2) as f32);
        let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        let corners = quads.iter().flat_map(|&[a, b, c, d]| [a, b, c, a, c, d]).map(corner).collect::<Vec<_>>();
        TriMesh { positions: corners, triangles: (0..12).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect() }
    }

    #[test]
    fn welding_closes_a_soup_and_keeps_its_volume() {
        let soup = soup_cube();
        assert!(!soup.is_closed());
        let cube = soup.welded();
        assert!(cube.is_closed());
        assert_eq!((cube.positions.len(), cube.triangles.len()), (8, 12));
        assert!((cube.volume_mm3() - 1.0).abs() < 1e-12 && (soup.volume_mm3() - 1.0).abs() < 1e-12);
    }

    #[test]
    fn a_hole_and_a_flipped_triangle_open_a_surface() {
        let mut cube = soup_cube().welded();
        cube.triangles[3].swap(0, 1);
        assert!(!cube.is_closed());
        cube.triangles.remove(3);
        assert!(!cube.is_closed());
    }
}
