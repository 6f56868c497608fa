//! Distances between the brain's surfaces of two runs.

use super::{LOOK_MS, Ride};
use trepan_geometry::Vec3;

/// Distances of the surfaces in the first look, and in every look while the brain is probed.
pub fn surfaces(ride: &Ride, truth: &Ride) -> (Vec<f64>, Vec<f64>) {
    let probing = |look: usize| truth.probing[(look + 1) * LOOK_MS as usize - 1];
    let apart = |look: usize| {
        let (is, was) = (&ride.looks[look].triangles, &truth.looks[look].seen);
        was.iter().map(|seen| is.iter().map(|corners| distance_mm(*seen, corners)).fold(f64::INFINITY, f64::min))
    };
    (apart(0).collect(), (0..truth.looks.len()).filter(|&look| probing(look)).flat_map(apart).collect())
}

/// From a point to a triangle, mm: to its plane where the foot lies inside, else to the nearest
/// edge.
fn distance_mm(point: Vec3, &[a, b, c]: &[Vec3; 3]) -> f64 {
    let to_edge = |(from, to): (Vec3, Vec3)| {
        let share = (point - from).dot(to - from) / (to - from).length_squared().max(f32::MIN_POSITIVE);
        point.distance(from + share.clamp(0.0, 1.0) * (to - from))
    };
    let edges = [(a, b), (b, c), (c, a)];
    let normal = (b - a).cross(c - a).normalize_or_zero();
    let inside = |(from, to): &(Vec3, Vec3)| (to - from).cross(point - from).dot(normal) >= 0.0;
    let mm = match normal != Vec3::ZERO && edges.iter().all(inside) {
        true => (point - a).dot(normal).abs(),
        false => edges.map(to_edge).into_iter().fold(f32::INFINITY, f32::min),
    };
    f64::from(mm)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_to_a_triangle_are_to_its_face_edges_and_corners() {
        let triangle = [Vec3::ZERO, 4.0 * Vec3::X, 4.0 * Vec3::Y];
        let at = |x: f32, y: f32, z: f32| distance_mm(Vec3::new(x, y, z), &triangle);
        assert_eq!((at(1.0, 1.0, 2.0), at(1.0, -3.0, 0.0), at(-3.0, -4.0, 0.0)), (2.0, 3.0, 5.0));
        assert!((at(4.0, 4.0, 0.0) - 8.0f64.sqrt()).abs() < 1e-6);
    }
}
