//! Plans the removal of bone: a burr hole, or a flap with a burr hole at its rim.
//!
//! # Theory
//! The flap is round: rays parallel to the entry direction, on a circle around it, intersect the
//! outer and the inner table; these points are its outline. The cut follows the outline from the
//! burr hole at its first point. The planned volume is all bone inside the outline plus half a
//! cut's width, and inside the hole, along the entry direction.
//!
//! # When not to use it
//! To plan a real operation: vessels, sinuses and eloquent cortex are ignored.

use trepan_geometry::{Quat, Vec3};
use trepan_haptics::script::{Rim, Site};
use trepan_volume::{BoneVolume, FlapSearch, VoxelVolume};

/// Points of an outline.
const RIMS: usize = 48;
/// Search range for bone outside the entry, mm.
const OUTSIDE_MM: f32 = 25.0;
/// Search range for bone inside the entry, mm.
const INSIDE_MM: f32 = 35.0;
/// Depth below the outer table beyond which bone is not the vault's, mm.
const VAULT_MM: f32 = 15.0;
/// Margin around a flap in which bone counts as the skull, mm.
const AROUND_MM: f32 = 15.0;
/// Half the width of a craniotome's cut, mm.
const HALF_CUT_MM: f32 = 1.2;
const STEP_MM: f32 = 0.1;

/// A planned operation.
#[derive(Clone, Debug)]
pub struct Plan {
    /// Site of the opening: the hole, or the centre of the flap.
    pub site: Site,
    /// Radius of the hole, mm.
    pub hole_mm: f32,
    /// Radius of the flap's outline, mm; 0 without a flap.
    pub flap_mm: f32,
    /// The flap's outline in its order, closed from the last to the first; empty without a flap.
    pub outline: Vec<Rim>,
}

impl Plan {
    /// Plans a hole of `hole_mm` radius at the site, or at the rim of a flap of `flap_mm` radius
    /// around it. `None` if the skull does not surround the flap.
    pub fn new(bone: Option<&BoneVolume>, site: Site, hole_mm: f32, flap_mm: f32) -> Option<Self> {
        let outline = match bone.filter(|_| flap_mm > 0.0) {
            Some(bone) => outline(bone, &site, flap_mm)?,
            None => Vec::new(),
        };
        Some(Self { site, hole_mm, flap_mm: if outline.is_empty() { 0.0 } else { flap_mm }, outline })
    }

    /// Search for the free flap during drilling; `None` without a flap.
    pub fn search(&self, bone: &BoneVolume) -> Option<FlapSearch> {
        let Site { entry, inward, .. } = self.site;
        let (from, to) = (entry - OUTSIDE_MM * inward, entry + VAULT_MM * inward);
        (!self.outline.is_empty()).then(|| FlapSearch::new(bone, entry, self.flap_mm + AROUND_MM, from, to))
    }

    /// Centre of the burr hole on the outer table.
    pub fn hole(&self) -> Vec3 {
        self.outline.first().map_or(self.site.entry, |rim| rim.outer)
    }

    /// Whether the plan removes bone at a place.
    pub fn takes(&self, place: Vec3) -> bool {
        let within = |middle: Vec3, radius_mm: f32| {
            let from = place - middle;
            let along = from.dot(self.site.inward);
            let aside = (from - along * self.site.inward).length_squared();
            (-OUTSIDE_MM..=INSIDE_MM).contains(&along) && aside <= radius_mm * radius_mm
        };
        within(self.hole(), self.hole_mm) || self.flap_mm > 0.0 && within(self.site.entry, self.flap_mm + HALF_CUT_MM)
    }

    /// Whether the plan bares a place of the brain's surface, whose normal points out of it.
    pub fn bares(&self, place: Vec3, normal: Vec3) -> bool {
        self.takes(place) && normal.dot(self.site.inward) < 0.0
    }

    /// The voxels of a skull that are planned to be removed, in their order.
    pub fn of(&self, skull: &VoxelVolume<i16>, isovalue: i16) -> Vec<usize> {
        let [nx, ny, _] = skull.dims;
        let place = |at: usize| skull.centre_of([at % nx, at / nx % ny, at / (nx * ny)]).as_vec3();
        let bone = skull.data.iter().enumerate().filter(|(_, hu)| **hu >= isovalue);
        bone.map(|(at, _)| at).filter(|at| self.takes(place(*at))).collect()
    }
}

/// Outline of the flap: rays on a circle around the site, intersected with the bone.
fn outline(bone: &BoneVolume, site: &Site, radius_mm: f32) -> Option<Vec<Rim>> {
    let turn = Quat::from_rotation_arc(Vec3::Z, -site.inward.normalize());
    (0..RIMS)
        .map(|at| {
            let (sin, cos) = (at as f32 / RIMS as f32 * std::f32::consts::TAU).sin_cos();
            rim(bone, site.entry + turn * (radius_mm * Vec3::new(cos, sin, 0.0)), site.inward)
        })
        .collect()
}

/// Outer table and thickness of the vault on the line through `place`.
fn rim(bone: &BoneVolume, place: Vec3, inward: Vec3) -> Option<Rim> {
    let is_bone = |mm: f32| bone.is_bone(bone.voxel_of(place + mm * inward));
    let steps =
        |from: f32, to: f32| (0..((to - from) / STEP_MM) as usize).map(move |step| from + step as f32 * STEP_MM);
    let outer = steps(-OUTSIDE_MM, INSIDE_MM).find(|mm| is_bone(*mm))?;
    let inner = steps(outer, outer + VAULT_MM).rfind(|mm| is_bone(*mm))?;
    Some(Rim { outer: place + outer * inward, bone_mm: inner - outer })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A round vault: bone from 80 to 86 mm.
    fn vault() -> BoneVolume {
        let n = 120;
        let mut ct = VoxelVolume::isotropic([n; 3], Vec3::splat(-10.0), 1.0, -1000i16);
        for at in 0..ct.data.len() {
            let r = ct.centre_of([at % n, at / n % n, at / (n * n)]).length() as f32;
            ct.data[at] = (400.0 + 500.0 * (3.0 - (r - 83.0).abs())).clamp(-1000.0, 1400.0) as i16;
        }
        BoneVolume::new(&ct, 400).unwrap()
    }

    #[test]
    fn an_outline_lies_on_the_skull_and_holds_the_flap() {
        let bone = vault();
        let outward = Vec3::ONE.normalize();
        let site = Site { entry: 86.0 * outward, inward: -outward, bone_mm: 6.0, brain_mm: 8.0 };
        let plan = Plan::new(Some(&bone), site, 3.0, 15.0).unwrap();
        assert_eq!(plan.outline.len(), RIMS);
        for rim in &plan.outline {
            assert!((rim.outer.length() - 86.0).abs() < 1.0, "{rim:?}");
            assert!((rim.bone_mm - 6.1).abs() < 1.2, "{rim:?}");
            assert!(((rim.outer - site.entry).reject_from(outward).length() - 15.0).abs() < 1e-3);
        }
        let planned = plan.of(&bone.snapshot(), 400).len() as f32;
        assert!((planned / (std::f32::consts::PI * 16.2f32.powi(2) * 6.1) - 1.0).abs() < 0.06, "{planned}");
        assert!(plan.search(&bone).is_some());
        let hole = Plan::new(Some(&bone), site, 3.0, 0.0).unwrap();
        assert!(hole.search(&bone).is_none() && hole.takes(site.entry) && !hole.takes(site.entry + 4.0 * Vec3::Z));
        assert!(Plan::new(Some(&bone), site, 3.0, 90.0).is_none(), "wider than the skull");
    }
}
