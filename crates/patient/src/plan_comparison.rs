//! Comparison of the removed bone with the planned removal.
//!
//! # Theory
//! P: voxels of bone planned to be removed, T: voxels of bone removed.
//! ```text
//! Dice = 2 |P ∩ T| / (|P| + |T|)
//! s₉₅  = the 95th of 100 of { d(p, ∂T) : p ∈ ∂P } ∪ { d(t, ∂P) : t ∈ ∂T }
//! ```
//! ∂: voxels of a set with a neighbour outside it; d between centres, mm.
//!
//! # Practice
//! Run at the end of a session: one pass over the voxels, then over all pairs of border voxels.
//! It takes 0.1 s for a flap of 24 mm in voxels of 1 mm.
//!
//! # Sources
//! L. R. Dice, Ecology 26 (1945); 95 % Hausdorff distance: D. P. Huttenlocher et al., IEEE PAMI 15
//! (1993), as in A. A. Taha, A. Hanbury, BMC Medical Imaging 15 (2015).

use crate::Plan;
use glam::IVec3;
use serde::Serialize;
use trepan_bone::BoneVolume;
use trepan_geometry::Vec3;

/// Overlap and surface distance of the removed and the planned bone.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct PlanComparison {
    /// Bone planned to be removed, mm³.
    pub planned_mm3: f64,
    /// Bone removed, drilled or lifted, mm³.
    pub taken_mm3: f64,
    /// Bone removed outside the plan, mm³.
    pub outside_plan_mm3: f64,
    /// Dice coefficient of both, 1 when they are equal.
    pub dice: f64,
    /// 95 % Hausdorff distance of their surfaces, mm; `null` where nothing was removed.
    pub surface_95_mm: Option<f64>,
}

impl PlanComparison {
    /// Compares the bone as scanned and now with the plan; `None` if the plan contains no bone.
    pub fn of(plan: &Plan, bone: &BoneVolume) -> Option<Self> {
        let planned = plan.of(bone);
        let gone = bone.scanned_bone().filter(|(_, voxel)| !bone.is_bone(*voxel));
        let taken: Vec<usize> = gone.map(|(at, _)| at).collect();
        let both = planned.iter().filter(|at| taken.binary_search(at).is_ok()).count() as f64;
        let (of_plan, gone) = (planned.len() as f64, taken.len() as f64);
        let mm3 = f64::from(bone.voxel_mm3());
        (of_plan > 0.0).then(|| Self {
            planned_mm3: of_plan * mm3,
            taken_mm3: gone * mm3,
            outside_plan_mm3: (gone - both) * mm3,
            dice: 2.0 * both / (of_plan + gone),
            surface_95_mm: surface_95(&border(bone, &planned), &border(bone, &taken)),
        })
    }
}

/// Returns the centres of the voxels of a set that have a neighbour outside it, world mm. The set
/// is in the voxels' order.
fn border(of: &BoneVolume, set: &[usize]) -> Vec<Vec3> {
    let [nx, ny, nz] = of.dims();
    let inner = |[x, y, z]: [usize; 3]| x > 0 && y > 0 && z > 0 && x + 1 < nx && y + 1 < ny && z + 1 < nz;
    let strides = [1, nx, nx * ny];
    let on_border = |at: usize, place: [usize; 3]| {
        !inner(place)
            || strides
                .iter()
                .flat_map(|stride| [at - stride, at + stride])
                .any(|beside| set.binary_search(&beside).is_err())
    };
    let place = |at: usize| [at % nx, at / nx % ny, at / (nx * ny)];
    let at = set.iter().copied().filter(|&at| on_border(at, place(at)));
    at.map(|at| of.centre_of(IVec3::from(place(at).map(|n| n as i32)))).collect()
}

/// Returns the 95 % Hausdorff distance of two sets of points, mm.
fn surface_95(a: &[Vec3], b: &[Vec3]) -> Option<f64> {
    let nearest =
        |p: &Vec3, to: &[Vec3]| to.iter().map(|q| q.distance_squared(*p)).fold(f32::INFINITY, f32::min).sqrt();
    let mut all: Vec<f32> = a.iter().map(|p| nearest(p, b)).chain(b.iter().map(|p| nearest(p, a))).collect();
    all.sort_by(f32::total_cmp);
    let at = (0.95 * all.len() as f64).ceil() as usize;
    all.get(at.saturating_sub(1)).copied().filter(|mm| mm.is_finite()).map(f64::from)
}

#[cfg(test)]
mod tests {
    use super::*;
    use trepan_haptics::script::Site;
    use trepan_volume::{AIR_HU, VoxelVolume};

    #[test]
    fn a_hole_beside_the_plan_has_the_dice_and_the_distance_of_two_shifted_cylinders() {
        let n = 60;
        let mut ct = VoxelVolume::isotropic([n, n, 10], Vec3::ZERO, 0.5, AIR_HU);
        ct.data[n * n * 2..n * n * 8].fill(1200);
        let bone = BoneVolume::new(&ct, 400).unwrap();
        let before = bone.snapshot();
        let site = Site { entry: Vec3::new(14.75, 14.75, 3.75), inward: Vec3::NEG_Z, bone_mm: 3.0, brain_mm: 5.0 };
        let plan = Plan::new(Some(&bone), site, 6.0, 0.0).unwrap();
        assert_eq!(PlanComparison::of(&plan, &bone).unwrap().dice, 0.0);
        assert_eq!(PlanComparison::of(&plan, &bone).unwrap().surface_95_mm, None);
        let drill = |shift: i32| {
            for at in 0..n * n * 10 {
                let voxel = IVec3::new((at % n) as i32, (at / n % n) as i32, (at / (n * n)) as i32);
                let planned = plan.takes(bone.centre_of(voxel - IVec3::X * shift));
                bone.set_hu(voxel, if planned { AIR_HU } else { before.data[at] });
            }
            PlanComparison::of(&plan, &bone).unwrap()
        };
        let same = drill(0);
        assert_eq!((same.dice, same.surface_95_mm, same.outside_plan_mm3), (1.0, Some(0.0), 0.0));
        let mm3 = std::f64::consts::PI * 36.0 * 3.0;
        assert!((same.planned_mm3 / mm3 - 1.0).abs() < 0.02 && same.taken_mm3 == same.planned_mm3, "{same:?}");
        // Overlap of two discs of radius r, d apart: 2 r² acos(d/2r) - d/2 √(4r² - d²).
        let (r, d) = (6.0f64, 3.0f64);
        let lens = 2.0 * r * r * (d / (2.0 * r)).acos() - 0.5 * d * (4.0 * r * r - d * d).sqrt();
        let shifted = drill(6);
        assert!((shifted.dice - lens / (std::f64::consts::PI * r * r)).abs() < 0.01, "{shifted:?}");
        // The walls are 3 mm apart where they face the shift, less at the flanks.
        let apart = shifted.surface_95_mm.unwrap();
        assert!((2.5..=3.0).contains(&apart), "{apart}");
    }
}
