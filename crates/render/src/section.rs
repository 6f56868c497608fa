//! Cuts the deformed brain by the slices and gives each pixel its rest position, for sampling the
//! MRI.
//!
//! # Theory
//! A plane cuts a tetrahedron in a triangle or a quadrilateral. Deformation is linear in a
//! tetrahedron, so that the rest position is linear over the cut.

use crate::border::Border;
use crate::cut::height;
use glam::{Vec3, Vec4};

/// A corner of a cut, current and at rest, world mm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Corner {
    pub place: Vec3,
    pub rest: Vec3,
}

/// The cut of the whole brain by a plane (unit normal and offset) as triangles.
pub(crate) fn triangles(plane: Vec4, brain: &Border) -> impl Iterator<Item = [Corner; 3]> + '_ {
    brain.tets.iter().flat_map(move |tet| {
        let cut = cut(plane, tet.map(|n| brain.now[n as usize]), tet.map(|n| brain.rest[n as usize]));
        let [a, b, c, d] = cut.map_or([None; 4], |c| c);
        let triangle = |p: Option<Corner>, q: Option<Corner>, r: Option<Corner>| Some([p?, q?, r?]);
        [triangle(a, b, c), triangle(a, c, d)].into_iter().flatten()
    })
}

/// The corners of a tetrahedron's cut, in order around it: three, four or none.
fn cut(plane: Vec4, now: [Vec3; 4], rest: [Vec3; 4]) -> Option<[Option<Corner>; 4]> {
    let height = now.map(|p| height(plane, p));
    let over: Vec4 = height.map(|h| f32::from(u8::from(h >= 0.0))).into();
    let corner = |a: usize, b: usize| {
        let share = height[a] / (height[a] - height[b]);
        Some(Corner { place: now[a].lerp(now[b], share), rest: rest[a].lerp(rest[b], share) })
    };
    // Finds the single corner, or the pair, on one side of the plane.
    let pair = |a: usize, b: usize, c: usize, d: usize| Some([corner(a, c), corner(a, d), corner(b, d), corner(b, c)]);
    let one = |a: usize, b: usize, c: usize, d: usize| Some([corner(a, b), corner(a, c), corner(a, d), None]);
    let bits = (0..4).fold(0, |bits, n| bits | (over[n] as u32) << n);
    match bits.min(15 - bits) {
        0b0001 => one(0, 1, 2, 3),
        0b0010 => one(1, 0, 2, 3),
        0b0100 => one(2, 0, 1, 3),
        0b0111 => one(3, 0, 1, 2),
        0b0011 => pair(0, 1, 2, 3),
        0b0101 => pair(0, 2, 1, 3),
        0b0110 => pair(1, 2, 0, 3),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use trepan_mesh::TetMesh;

    fn plane(height: f32) -> Vec4 {
        Vec4::new(0.0, 0.0, 1.0, height)
    }

    proptest! {
        #[test]
        fn the_area_of_all_cuts_over_height_is_the_volume(p in prop::array::uniform12(-0.9f32..0.9)) {
            let mesh = TetMesh { positions: p.chunks(3).map(|c| Vec3::new(c[0], c[1], c[2])).collect(), tets: vec![[0, 1, 2, 3]] };
            let border = Border::of(&mesh, None);
            let steps = 400;
            let area = |k: usize| -> f32 {
                let plane = plane(-1.0 + (2 * k + 1) as f32 / steps as f32);
                triangles(plane, &border).map(|[a, b, c]| 0.5 * (b.place - a.place).cross(c.place - a.place).length()).sum()
            };
            let volume: f32 = (0..steps).map(area).sum::<f32>() * 2.0 / steps as f32;
            prop_assert!((volume - mesh.volume_mm3(0).abs() as f32).abs() < 0.02, "{volume} for {}", mesh.volume_mm3(0));
        }

        #[test]
        fn the_place_at_rest_follows_a_linear_motion(p in prop::array::uniform12(-0.9f32..0.9), height in -0.5f32..0.5) {
            let mesh = TetMesh { positions: p.chunks(3).map(|c| Vec3::new(c[0], c[1], c[2])).collect(), tets: vec![[0, 1, 2, 3]] };
            let mut border = Border::of(&mesh, None);
            let motion = |v: Vec3| Vec3::new(1.2 * v.x + 0.1 * v.z, v.y - 0.3 * v.x, v.z + 0.2 * v.y) + 0.05;
            let moved: Vec<Vec3> = mesh.positions.iter().map(|&v| motion(v)).collect();
            border.follow(Some(&moved), &[]).unwrap();
            for corner in triangles(plane(height), &border).flatten() {
                prop_assert!((motion(corner.rest) - corner.place).length() < 1e-3 && (corner.place.z - height).abs() < 1e-4);
            }
        }
    }
}
