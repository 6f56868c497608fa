//! Draws what is seen onto the surface that a tool meets.
//!
//! # Practice
//! Contact is with the boundary of the tetrahedra, which closes the sulci, as does the arachnoid.
//! Where a tool touches it, the cortex beside the tool is drawn onto it, and less so further away:
//! no tool floats over a sulcus or sinks in. Costs at most a closest point for each face and vertex
//! near the tool.

use glam::Vec3;
use trepan_geometry::{Aabb, closest_weights};

/// Distances from a tip up to which vertices lie on what it meets, and from which on none does, mm,
/// numerical.
const NEAR_MM: [f32; 2] = [3.0, 9.0];
/// Gaps between a tip and what it meets from which on it touches, and none of it, mm, numerical.
const GAP_MM: [f32; 2] = [0.5, 2.0];

/// A face and the ball around it, mm.
struct Face {
    corners: [Vec3; 3],
    middle: Vec3,
    radius_mm: f32,
}

impl Face {
    fn of(corners: [Vec3; 3]) -> Self {
        let middle = corners.iter().sum::<Vec3>() / 3.0;
        let radius_mm = corners.map(|corner| corner.distance(middle)).into_iter().fold(0.0, f32::max);
        Self { corners, middle, radius_mm }
    }
}

/// Moves the places near balls, with their radii, mm, onto the faces that these touch; returns
/// which.
pub(crate) fn touch(places: &mut [Vec3], faces: &[[u32; 3]], nodes: &[Vec3], balls: &[(Vec3, f32)]) -> Vec<u32> {
    let mut moved = Vec::new();
    for &(middle, radius_mm) in balls {
        let reach_mm = radius_mm + NEAR_MM[1];
        let around = Aabb { min: middle - reach_mm, max: middle + reach_mm };
        let corners = |face: &[u32; 3]| face.map(|n| nodes[n as usize]);
        let meets = |corners: &[Vec3; 3]| {
            let of = Aabb::of_points(corners);
            of.min.cmple(around.max).all() && of.max.cmpge(around.min).all()
        };
        let near: Vec<Face> = faces.iter().map(corners).filter(meets).map(Face::of).collect();
        let onto = |place: Vec3| {
            let mut nearest = (f32::INFINITY, None);
            for face in &near {
                if face.middle.distance(place) - face.radius_mm > nearest.0 {
                    continue;
                }
                let weights = closest_weights(face.corners, place);
                let on = (0..3).map(|k| weights[k] * face.corners[k]).sum::<Vec3>();
                let away_mm = on.distance(place);
                if away_mm < nearest.0 {
                    nearest = (away_mm, Some(on));
                }
            }
            nearest.1
        };
        let Some(met) = onto(middle) else { continue };
        let touches = 1.0 - step(GAP_MM, met.distance(middle) - radius_mm);
        if touches <= 0.0 {
            continue;
        }
        let is_near = |(_, place): &(u32, &mut Vec3)| place.distance_squared(middle) < reach_mm * reach_mm;
        for (n, place) in (0..).zip(places.iter_mut()).filter(is_near) {
            let share = touches * (1.0 - step(NEAR_MM, place.distance(middle) - radius_mm));
            if let Some(on) = onto(*place).filter(|_| share > 0.0) {
                *place = place.lerp(on, share);
                moved.push(n);
            }
        }
    }
    moved
}

/// A smooth step between two values.
fn step([low, high]: [f32; 2], x: f32) -> f32 {
    let s = ((x - low) / (high - low)).clamp(0.0, 1.0);
    s * s * (3.0 - 2.0 * s)
}
