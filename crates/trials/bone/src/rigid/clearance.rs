//! How far a held ball is from the bone's isosurface: a truth for bone that has no closed form.
//!
//! # Theory
//! Where a ball is held, it touches: the nearest point of the surface is at its radius. The surface
//! of the trilinear density crosses the edges between voxel centres exactly where linear
//! interpolation says; the nearest of these crossings is at most some hundredths of a voxel further
//! than the nearest point, for points are half a voxel apart at most and the ball is several voxels
//! large.

use super::solid::RADIUS_MM;
use glam::{DVec3, IVec3};
use trepan_bone::BoneVolume;
use trepan_contact::ContactManifold;
use trepan_geometry::Vec3;

/// How far beyond the ball a surface is looked for, voxels: what is further counts as that far.
const REACH: f64 = 3.0;

/// Gap or overlap, voxels, of the ball that a method holds where the manifold says; overlap only,
/// where it feels nothing. `None` in the open.
pub fn error_voxel(bone: &BoneVolume, tip: Vec3, manifold: &ContactManifold) -> Option<f64> {
    let held = tip + manifold.depth_mm * manifold.normal;
    let gap = gap_voxel(bone, held);
    match (manifold.touches(), gap) {
        (true, gap) => Some(gap.map_or(REACH, f64::abs)),
        (false, Some(gap)) if gap < 0.0 => Some(-gap),
        (false, _) => None,
    }
}

/// Distance from the ball's surface to the bone's, voxels, negative for an overlap; `None` where
/// none is near.
fn gap_voxel(bone: &BoneVolume, centre: Vec3) -> Option<f64> {
    let (spacing, iso) = (f64::from(bone.spacing_mm()), f64::from(bone.isovalue()));
    let at = (centre.as_dvec3() - bone.origin().as_dvec3()) / spacing;
    let radius = f64::from(RADIUS_MM) / spacing;
    let (low, high) = ((at - radius - REACH).floor().as_ivec3(), (at + radius + REACH).ceil().as_ivec3());
    let hu = |voxel: IVec3| f64::from(bone.hu(voxel)) - iso;
    let mut nearest = f64::MAX;
    for k in low.z..=high.z {
        for j in low.y..=high.y {
            for i in low.x..=high.x {
                let from = IVec3::new(i, j, k);
                let a = hu(from);
                for step in IVec3::AXES {
                    let b = hu(from + step);
                    if (a >= 0.0) != (b >= 0.0) {
                        let crossing: DVec3 = from.as_dvec3() + step.as_dvec3() * (a / (a - b));
                        nearest = nearest.min(crossing.distance(at));
                    }
                }
            }
        }
    }
    let inside = bone.is_bone(bone.voxel_of(centre));
    let distance = if inside { -nearest } else { nearest };
    (nearest <= radius + REACH).then_some(distance - radius)
}

#[cfg(test)]
mod tests {
    use super::super::solid::voxels;
    use super::*;

    #[test]
    fn a_ball_on_a_plane_and_one_in_it_are_measured() {
        let normal = DVec3::new(0.36, 0.48, 0.8);
        let bone = voxels(40, 0.5, |p| p.dot(normal));
        for gap in [-1.0, 0.0, 0.7] {
            let centre = (normal * (f64::from(RADIUS_MM) + 0.5 * gap)).as_vec3();
            let found = gap_voxel(&bone, centre).unwrap();
            assert!((found - gap).abs() < 0.06, "{found} instead of {gap}");
        }
        assert_eq!(gap_voxel(&bone, (normal * 8.0).as_vec3()), None);
    }
}
