//! The brain's surface at the opening, seen along the way in.

use super::{LOOK_RADIUS_MM, disc};
use trepan_geometry::Vec3;
use trepan_haptics::script::Site;

/// The brain's surface at one time.
pub struct Look {
    /// Where rays along the way in meet it first, mm.
    pub seen: Vec<Vec3>,
    /// Its triangles near there.
    pub triangles: Vec<[Vec3; 3]>,
}

/// Looks along the way in at the brain's surface.
pub struct Rays {
    /// Origin of each, over the entry.
    origins: Vec<Vec3>,
    inward: Vec3,
    /// Triangles near the way in.
    triangles: Vec<[u32; 3]>,
}

/// Where rays begin, mm over the entry.
const OVER_MM: f32 = 30.0;
/// A triangle is near the way in when a corner is within this, mm: more than an edge and what the
/// brain moves.
const NEAR_MM: f32 = 25.0;

impl Rays {
    /// Rays of a brain at rest.
    pub fn new(positions: &[Vec3], triangles: &[[u32; 3]], site: Site) -> Self {
        let near = |node: &u32| {
            let from = positions[*node as usize] - site.entry;
            let along = from.dot(site.inward);
            (from - along * site.inward).length() < NEAR_MM && (-OVER_MM..OVER_MM).contains(&along)
        };
        Self {
            origins: disc(&site, LOOK_RADIUS_MM).map(|aside| site.entry - OVER_MM * site.inward + aside).collect(),
            inward: site.inward,
            triangles: triangles.iter().filter(|corners| corners.iter().any(near)).copied().collect(),
        }
    }

    /// What is seen of moved nodes.
    pub fn look(&self, positions: &[Vec3]) -> Look {
        let triangles: Vec<[Vec3; 3]> = self.triangles.iter().map(|t| t.map(|node| positions[node as usize])).collect();
        let first = |origin: &Vec3| {
            let hits = triangles.iter().filter_map(|corners| hit(*origin, self.inward, corners));
            hits.reduce(f32::min).map(|along| *origin + along * self.inward)
        };
        let seen = self.origins.iter().filter_map(first).collect();
        Look { seen, triangles }
    }
}

/// Where a ray meets a triangle, mm along it (Möller and Trumbore 1997).
fn hit(origin: Vec3, along: Vec3, [a, b, c]: &[Vec3; 3]) -> Option<f32> {
    let (ab, ac) = (b - a, c - a);
    let p = along.cross(ac);
    let det = ab.dot(p);
    if det.abs() < 1e-9 {
        return None;
    }
    let from = origin - a;
    let (u, q) = (from.dot(p) / det, from.cross(ab));
    let v = along.dot(q) / det;
    (u >= 0.0 && v >= 0.0 && u + v <= 1.0).then_some(ac.dot(q) / det)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ray_meets_a_triangle_where_it_lies() {
        let triangle = [Vec3::new(0.0, 0.0, -2.0), Vec3::new(4.0, 0.0, -2.0), Vec3::new(0.0, 4.0, 2.0)];
        assert_eq!(hit(Vec3::new(1.0, 1.0, 10.0), Vec3::NEG_Z, &triangle), Some(11.0));
        assert_eq!(hit(Vec3::new(3.0, 3.0, 10.0), Vec3::NEG_Z, &triangle), None);
    }

    #[test]
    fn a_plane_is_seen_where_it_lies() {
        let site = Site { entry: Vec3::ZERO, inward: Vec3::NEG_Z, bone_mm: 6.0, brain_mm: 8.0 };
        let square = [(-15.0, -15.0), (15.0, -15.0), (15.0, 15.0), (-15.0, 15.0)].map(|(x, y)| Vec3::new(x, y, -8.5));
        let look = Rays::new(&square, &[[0, 1, 2], [0, 2, 3]], site).look(&square);
        assert!(look.seen.len() > 300 && look.seen.iter().all(|seen| (seen.z + 8.5).abs() < 1e-4));
        assert!(look.seen.iter().all(|seen| seen.truncate().length() < LOOK_RADIUS_MM + 1e-3));
    }
}
