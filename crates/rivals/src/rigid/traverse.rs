//! Walks over every voxel that a segment touches, and stops a tool at the first one that is bone.
//!
//! # Theory
//! Amanatides and Woo 1987: keep for each axis the parameter at which the segment crosses into the
//! next voxel, and always take the nearest. No voxel is skipped, which fixed steps of a voxel's
//! edge (the thesis's sweep) do at corners.
//!
//! ```text
//! a ──●─┐        visited in order of entry
//!       └─●─ b
//! ```
//!
//! # Practice
//! f64 inside, so that long segments end in the right voxel. The number of visits is bounded by the
//! caller's segment.
//!
//! # Sources
//! J. Amanatides, A. Woo, *A fast voxel traversal algorithm for ray tracing*, Eurographics 1987.

use glam::{DVec3, IVec3};
use trepan_bone::BoneVolume;
use trepan_geometry::{Aabb, Vec3};

/// Calls `visit` with each voxel on the line from `from` to `to`, in grid coordinates with voxel
/// centres at whole numbers. It gets the share of the way at which the voxel is entered, and
/// returns true to stop. Returns the share at which it was stopped.
pub(crate) fn traverse(from: Vec3, to: Vec3, mut visit: impl FnMut(IVec3, f32) -> bool) -> Option<f32> {
    let (a, b) = (from.as_dvec3() + 0.5, to.as_dvec3() + 0.5);
    let way = b - a;
    let (mut voxel, last) = (a.floor().as_ivec3(), b.floor().as_ivec3());
    let step = IVec3::new(sign(way.x), sign(way.y), sign(way.z));
    let per_voxel = DVec3::new(inverse(way.x), inverse(way.y), inverse(way.z));
    let border = voxel.as_dvec3() + step.max(IVec3::ZERO).as_dvec3();
    let mut next = ((border - a) / way).abs();
    next = DVec3::select(step.cmpeq(IVec3::ZERO), DVec3::INFINITY, next);
    let mut share = 0.0f64;
    let most = (last - voxel).abs().element_sum();
    for _ in 0..=most {
        if visit(voxel, share as f32) {
            return Some(share as f32);
        }
        let axis = if next.x <= next.y && next.x <= next.z { 0 } else { 1 + usize::from(next.z < next.y) };
        share = next[axis].min(1.0);
        voxel[axis] += step[axis];
        next[axis] += per_voxel[axis];
    }
    None
}

fn sign(x: f64) -> i32 {
    i32::from(x > 0.0) - i32::from(x < 0.0)
}

fn inverse(x: f64) -> f64 {
    if x == 0.0 { f64::INFINITY } else { 1.0 / x.abs() }
}

/// The part of the segment inside `bounds`, as shares of the way; `None` when it stays outside.
#[inline]
pub(crate) fn clipped(from: Vec3, to: Vec3, bounds: Aabb) -> Option<(f32, f32)> {
    let way = to - from;
    let (mut enter, mut leave) = (0.0f32, 1.0f32);
    for axis in 0..3 {
        if way[axis] == 0.0 {
            if from[axis] < bounds.min[axis] || from[axis] > bounds.max[axis] {
                return None;
            }
            continue;
        }
        let (a, b) = ((bounds.min[axis] - from[axis]) / way[axis], (bounds.max[axis] - from[axis]) / way[axis]);
        (enter, leave) = (enter.max(a.min(b)), leave.min(a.max(b)));
    }
    (enter <= leave).then_some((enter, leave))
}

/// Share of the way from `from` to `to`, world mm, at which a point enters the first bone voxel.
/// Adds the voxels visited to `visited`.
#[inline]
pub(crate) fn first_bone(bone: &BoneVolume, from: Vec3, to: Vec3, visited: &mut u32) -> Option<f32> {
    let (enter, leave) = clipped(from, to, bone.bounds().inflated(bone.spacing_mm()))?;
    let (a, b) = (bone.grid_of(from.lerp(to, enter)), bone.grid_of(from.lerp(to, leave)));
    let share = traverse(a, b, |voxel, _| {
        *visited += 1;
        bone.is_bone(voxel)
    })?;
    Some(enter + share * (leave - enter))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn every_voxel_touched_is_visited_and_neighbours_follow(a in prop::array::uniform3(-6.0f32..6.0), b in prop::array::uniform3(-6.0f32..6.0)) {
            let (a, b) = (Vec3::from(a), Vec3::from(b));
            let mut seen = vec![];
            traverse(a, b, |voxel, share| { seen.push((voxel, share)); false });
            prop_assert_eq!(seen.first().map(|s| s.0), Some((a + 0.5).floor().as_ivec3()));
            prop_assert_eq!(seen.last().map(|s| s.0), Some((b + 0.5).floor().as_ivec3()));
            for pair in seen.windows(2) {
                prop_assert_eq!((pair[1].0 - pair[0].0).abs().element_sum(), 1);
                prop_assert!(pair[1].1 >= pair[0].1);
            }
            for i in 0..=2000 {
                let p = a.as_dvec3().lerp(b.as_dvec3(), f64::from(i) / 2000.0) + 0.5;
                let off_border = (p - p.round()).abs().min_element() > 1e-3;
                prop_assert!(!off_border || seen.iter().any(|s| s.0 == p.floor().as_ivec3()));
            }
        }
    }

    #[test]
    fn a_point_and_a_far_segment_are_bounded() {
        let mut count = 0;
        traverse(Vec3::ONE, Vec3::ONE, |_, _| {
            count += 1;
            false
        });
        assert_eq!(count, 1);
        let bounds = Aabb { min: Vec3::ZERO, max: Vec3::ONE };
        assert_eq!(clipped(Vec3::new(-1e6, 0.5, 0.5), Vec3::new(-5.0, 0.5, 0.5), bounds), None);
        assert_eq!(clipped(Vec3::new(-1.0, 0.5, 0.5), Vec3::new(1.0, 0.5, 0.5), bounds), Some((0.5, 1.0)));
    }
}
