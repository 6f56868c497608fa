//! Neighbouring triangles in chunks, with a ball around each: what a plane misses costs nothing.

use glam::{Vec3, Vec4};
use rayon::prelude::*;
use std::ops::Range;
use trepan_mesh::NONE;

/// Triangles of a chunk, numerical.
pub(crate) const MANY: usize = 64;
/// Edge of the cubes by which triangles are sorted, mm, numerical: that of a chunk.
const EDGE_MM: f32 = 8.0;

/// Some triangles that follow one another.
#[derive(Clone, Debug)]
pub(crate) struct Chunk {
    pub triangles: Range<usize>,
    /// Their corners, hardly any of them twice.
    pub vertices: Vec<u32>,
    /// The ball around them at rest, world mm.
    middle: Vec3,
    radius_mm: f32,
}

/// Sorts triangles by where they lie.
pub(crate) fn sort(triangles: &mut [[u32; 3]], places: &[Vec3]) {
    triangles.sort_by_cached_key(|corners| (places[corners[0] as usize] / EDGE_MM).floor().as_ivec3().to_array());
}

impl Chunk {
    /// Chunks of all triangles, over vertices at rest.
    pub fn all(triangles: &[[u32; 3]], at_rest: &[Vec3]) -> Vec<Self> {
        let chunk = |(n, some): (usize, &[[u32; 3]])| {
            let vertices = few(some);
            let places = || vertices.iter().map(|n| at_rest[*n as usize]);
            let middle = places().sum::<Vec3>() / vertices.len() as f32;
            let radius_mm = places().map(|place| place.distance(middle)).fold(0.0, f32::max);
            Self { triangles: MANY * n..MANY * n + some.len(), vertices, middle, radius_mm }
        };
        triangles.par_chunks(MANY).enumerate().map(chunk).collect()
    }

    /// The last triangles as a chunk that may lie anywhere.
    pub fn anywhere(triangles: &[[u32; 3]], first: usize) -> Self {
        let vertices = few(&triangles[first..]);
        Self { triangles: first..triangles.len(), vertices, middle: Vec3::ZERO, radius_mm: f32::INFINITY }
    }

    /// Whether it may cross a plane, moved by so much at most, mm.
    pub fn may_cross(&self, plane: Vec4, moved_mm: f32) -> bool {
        let far = (plane.truncate().dot(self.middle) - plane.w).abs();
        far.is_nan() || far <= self.radius_mm + moved_mm
    }
}

/// The corners of triangles, without most of those that were there shortly before.
fn few(triangles: &[[u32; 3]]) -> Vec<u32> {
    let mut before = [NONE; 2 * MANY];
    let is_new = |n: &u32| std::mem::replace(&mut before[*n as usize % (2 * MANY)], *n) != *n;
    triangles.iter().flatten().copied().filter(is_new).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_chunk_names_each_corner_of_its_triangles() {
        let mut random = fastrand::Rng::with_seed(5);
        let mut triangle = || [0; 3].map(|_| random.u32(0..400));
        let triangles: Vec<[u32; 3]> = (0..500).map(|_| triangle()).collect();
        let at_rest = vec![Vec3::ONE; 400];
        for chunk in Chunk::all(&triangles, &at_rest).into_iter().chain([Chunk::anywhere(&triangles, 450)]) {
            let mut corners = triangles[chunk.triangles.clone()].iter().flatten();
            assert!(corners.all(|n| chunk.vertices.contains(n)));
            assert!(chunk.vertices.len() <= 3 * chunk.triangles.len());
        }
    }

    #[test]
    fn no_triangle_is_cut_outside_what_its_chunk_says() {
        let mut random = fastrand::Rng::with_seed(7);
        let mut skipped = 0;
        for _ in 0..300 {
            let mut unit = || 2.0 * random.f32() - 1.0;
            let mut vector = |mm: f32| mm * Vec3::new(unit(), unit(), unit());
            let corner = vector(80.0);
            let rest = [corner, corner + vector(4.0), corner + vector(4.0)];
            let chunk = &Chunk::all(&[[0, 1, 2]], &rest)[0];
            let now = rest.map(|place| place + vector(1.0));
            let plane = vector(1.0).normalize().extend(vector(30.0).x);
            let over = now.map(|place| plane.truncate().dot(place) >= plane.w);
            skipped += usize::from(!chunk.may_cross(plane, 3f32.sqrt()));
            assert!(over == [over[0]; 3] || chunk.may_cross(plane, 3f32.sqrt()));
        }
        assert!((30..299).contains(&skipped), "{skipped} of 300");
    }
}
