//! The oracle: which points lie in which tetrahedra and how deep the ball is, in f64 and with
//! nothing clever.

use super::scene::{RADIUS_MM, Scene};
use glam::DVec3;
use trepan_geometry::{Aabb, Pointshell, Spread, Vec3};
use trepan_mesh::TetMesh;

/// What is true at one step.
#[derive(Clone, Copy, Debug)]
pub struct Truth {
    /// Points further inside than rounding.
    pub surely_inside: u64,
    /// These, and points on a border.
    pub perhaps_inside: u64,
    /// Radius minus the signed distance of the centre, mm; 0 or less when nothing touches.
    pub depth_mm: f64,
}

/// What rounding may decide, as a share of a tetrahedron's height.
const ROUNDING: f64 = 1e-7;

impl Truth {
    /// Nothing is known: no point is missed, none invented.
    pub const UNKNOWN: Self = Self { surely_inside: 0, perhaps_inside: u64::MAX, depth_mm: 0.0 };

    /// At every step along a path.
    pub fn along(scene: &Scene, tips: &[Vec3]) -> Vec<Self> {
        let mut positions = scene.mesh.positions.clone();
        let shell = Pointshell::sphere(RADIUS_MM, Pointshell::DEFORMABLE_COUNT, Spread::Fibonacci).points;
        let at = |(step, tip): (usize, &Vec3)| {
            scene.move_to(step, &mut positions);
            let points: Vec<Vec3> = shell.iter().map(|p| *tip + *p).collect();
            let centre = inside(&scene.mesh, &positions, &[*tip]);
            let distance = distance_mm(scene.triangles(), &positions, *tip);
            let depth_mm = f64::from(RADIUS_MM) + if centre.0 > 0 { distance } else { -distance };
            let (surely_inside, perhaps_inside) = inside(&scene.mesh, &positions, &points);
            Self { surely_inside, perhaps_inside, depth_mm }
        };
        tips.iter().enumerate().map(at).collect()
    }
}

/// How many points lie surely, and how many perhaps, in a tetrahedron of positive and finite
/// volume.
pub fn inside(mesh: &TetMesh, positions: &[Vec3], points: &[Vec3]) -> (u64, u64) {
    let mut best = vec![f64::NEG_INFINITY; points.len()];
    let region = Aabb::of_points(points);
    for tet in &mesh.tets {
        let corners = tet.map(|n| positions[n as usize]);
        if !corners.iter().all(|c| c.is_finite()) || !Aabb::of_points(&corners).overlaps(region) {
            continue;
        }
        for (best, p) in best.iter_mut().zip(points) {
            *best = best.max(least_share(corners, *p));
        }
    }
    let over = |limit: f64| best.iter().filter(|b| **b > limit).count() as u64;
    (over(ROUNDING), over(-ROUNDING))
}

/// The smallest of the four sub-volumes that a point makes with a tetrahedron's faces, over its
/// volume.
fn least_share(corners: [Vec3; 4], p: Vec3) -> f64 {
    let volume = |c: [DVec3; 4]| (c[1] - c[0]).cross(c[2] - c[0]).dot(c[3] - c[0]);
    let corners = corners.map(Vec3::as_dvec3);
    let whole = volume(corners);
    if !(whole > 0.0 && whole.is_finite()) {
        return f64::NEG_INFINITY;
    }
    let part = |k: usize| volume(core::array::from_fn(|c| if c == k { p.as_dvec3() } else { corners[c] })) / whole;
    (0..4).map(part).fold(f64::INFINITY, f64::min)
}

/// Distance of a point from the nearest of the triangles, mm.
fn distance_mm(triangles: &[[u32; 3]], positions: &[Vec3], p: Vec3) -> f64 {
    let distance = |t: &[u32; 3]| to_triangle(t.map(|n| positions[n as usize].as_dvec3()), p.as_dvec3());
    triangles.iter().map(distance).fold(f64::INFINITY, f64::min)
}

/// To the plane when the foot lies in the triangle, else to the nearest edge.
fn to_triangle([a, b, c]: [DVec3; 3], p: DVec3) -> f64 {
    let normal = (b - a).cross(c - a);
    let left_of = |u: DVec3, v: DVec3| (v - u).cross(p - u).dot(normal) >= 0.0;
    if normal != DVec3::ZERO && left_of(a, b) && left_of(b, c) && left_of(c, a) {
        return ((p - a).dot(normal) / normal.length()).abs();
    }
    [(a, b), (b, c), (c, a)].map(|(u, v)| to_edge(u, v, p)).into_iter().fold(f64::INFINITY, f64::min)
}

fn to_edge(u: DVec3, v: DVec3, p: DVec3) -> f64 {
    let along = v - u;
    let share = ((p - u).dot(along) / along.length_squared().max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
    p.distance(u + share * along)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_unit_cube_knows_inside_from_outside_and_how_far() {
        let scene = Scene::cube_at_rest(2);
        let size = scene.mesh.bounds().max.x;
        let points = [Vec3::splat(0.3 * size), Vec3::splat(1.01 * size), Vec3::new(0.0, 0.3, 0.2) * size];
        assert_eq!(inside(&scene.mesh, &scene.mesh.positions, &points), (1, 2));
        let distance = distance_mm(scene.triangles(), &scene.mesh.positions, Vec3::new(0.4 * size, 0.3 * size, -3.0));
        assert!((distance - 3.0).abs() < 1e-6);
        let corner = distance_mm(scene.triangles(), &scene.mesh.positions, Vec3::new(-3.0, -4.0, 0.5 * size));
        assert!((corner - 5.0).abs() < 1e-5);
    }
}
