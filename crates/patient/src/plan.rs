//! Plans the removal of bone: a burr hole, or a flap with a burr hole at its rim.
//!
//! # Theory
//! Rays parallel to the entry direction, on a circle around it or on a line that the surgeon drew,
//! intersect the outer and the inner table; these points are the flap's outline. A drawn line is
//! resampled to points of equal distance and smoothed by 1, 2, 1 once: hands tremble. The cut
//! follows the outline from the burr hole at its first point. The planned volume is all bone inside
//! the outline plus half a cut's width, and inside the hole, along the entry direction.
//!
//! # When not to use it
//! To plan a real operation: vessels, sinuses and eloquent cortex are ignored.

use glam::Vec2;
use trepan_bone::{BoneVolume, FlapSearch};
use trepan_geometry::{Quat, Vec3};
use trepan_haptics::script::{Rim, Site, Target};

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
/// Distance from the opening up to which a piece is lifted where no flap is planned, mm.
const PIECE_MM: f32 = 35.0;
/// Half the width of a craniotome's cut, mm.
const HALF_CUT_MM: f32 = 1.2;
const STEP_MM: f32 = 0.1;
/// Least area of a drawn flap, mm², and its least share of the line's squared length, numerical. A
/// circle's share is 0.08, an eight's is 0.
const LEAST: [f32; 2] = [150.0, 0.02];

/// A planned operation.
#[derive(Clone, Debug)]
pub struct Plan {
    /// Site of the opening: the hole, or the centre of the flap.
    pub site: Site,
    /// Radius of the hole, mm.
    pub hole_mm: f32,
    /// Radius around the site that holds the flap's outline, mm; 0 without a flap.
    pub flap_mm: f32,
    /// The flap's outline in its order, closed from the last to the first; empty without a flap.
    pub outline: Vec<Rim>,
    /// The tumour, as a ball; `None` without one.
    pub target: Option<Target>,
    /// Lines along which the dura is to be incised, world mm; none where it is open.
    pub incisions: Vec<Vec<Vec3>>,
    /// The outline across the entry direction, from the site, mm.
    flat: Vec<Vec2>,
}

impl Plan {
    /// Plans a hole of `hole_mm` radius at the site, or at the rim of a flap of `flap_mm` radius
    /// around it. `None` if the skull does not surround the flap.
    pub fn new(bone: Option<&BoneVolume>, site: Site, hole_mm: f32, flap_mm: f32) -> Option<Self> {
        let ring = |at: usize| Vec2::from_angle(at as f32 / RIMS as f32 * std::f32::consts::TAU) * flap_mm;
        match bone.filter(|_| flap_mm > 0.0) {
            Some(bone) => Self::around(bone, site, hole_mm, (0..RIMS).map(ring).collect()),
            None => Some(Self {
                site,
                hole_mm,
                flap_mm: 0.0,
                outline: Vec::new(),
                target: None,
                incisions: Vec::new(),
                flat: Vec::new(),
            }),
        }
    }

    /// Adds a tumour to resect.
    pub fn with_target(self, target: Option<Target>) -> Self {
        Self { target, ..self }
    }

    /// Plans a flap along a closed line drawn on the skull, with a hole of `hole_mm` radius where
    /// it begins. `None` if it does not lie on the vault around the site, crosses itself, or holds
    /// too little bone.
    pub fn drawn(bone: &BoneVolume, site: Site, hole_mm: f32, line: &[Vec3]) -> Option<Self> {
        let plane = across(&site).inverse();
        let even = even(&line.iter().map(|point| (plane * (*point - site.entry)).truncate()).collect::<Vec<_>>())?;
        let beside = |at: usize| even[at % RIMS];
        let smooth = (0..RIMS).map(|at| 0.25 * (beside(at + RIMS - 1) + 2.0 * beside(at) + beside(at + 1)));
        let plan = Self::around(bone, site, hole_mm, smooth.collect())?;
        (plan.beside_mm(site.entry) < 0.0).then_some(plan)
    }

    /// Plans a flap with an outline across the entry direction.
    fn around(bone: &BoneVolume, site: Site, hole_mm: f32, flat: Vec<Vec2>) -> Option<Self> {
        let place = |at: &Vec2| site.entry + across(&site) * at.extend(0.0);
        let outline = flat.iter().map(|at| rim(bone, place(at), site.inward)).collect::<Option<Vec<_>>>()?;
        let flap_mm = flat.iter().map(|at| at.length()).fold(0.0, f32::max);
        Some(Self { site, hole_mm, flap_mm, outline, target: None, incisions: Vec::new(), flat })
    }

    /// Distance of a place from the flap's outline across the entry direction, mm, negative inside;
    /// infinite without a flap.
    pub fn beside_mm(&self, place: Vec3) -> f32 {
        let at = (across(&self.site).inverse() * (place - self.site.entry)).truncate();
        let next = self.flat.iter().cycle().skip(1);
        let (mut nearest, mut inside) = (f32::INFINITY, false);
        for (a, b) in self.flat.iter().zip(next) {
            let (side, from) = (*b - *a, at - *a);
            let along = (from.dot(side) / side.length_squared().max(1e-9)).clamp(0.0, 1.0);
            nearest = nearest.min((from - along * side).length());
            let crosses = (a.y > at.y) != (b.y > at.y);
            inside ^= crosses && at.x < a.x + side.x * (at.y - a.y) / side.y;
        }
        if inside { -nearest } else { nearest }
    }

    /// Search for the free flap during drilling; without a flap, for any piece around the opening.
    pub fn search(&self, bone: &BoneVolume) -> FlapSearch {
        let Site { entry, inward, .. } = self.site;
        let (from, to) = (entry - OUTSIDE_MM * inward, entry + VAULT_MM * inward);
        let reach_mm = if self.outline.is_empty() { PIECE_MM } else { self.flap_mm };
        FlapSearch::new(bone, entry, reach_mm + AROUND_MM, from, to)
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
        let reach_mm = self.flap_mm + HALF_CUT_MM;
        within(self.hole(), self.hole_mm) || within(self.site.entry, reach_mm) && self.beside_mm(place) <= HALF_CUT_MM
    }

    /// Whether the plan bares a place of the brain's surface, whose normal points out of it.
    pub fn bares(&self, place: Vec3, normal: Vec3) -> bool {
        self.takes(place) && normal.dot(self.site.inward) < 0.0
    }

    /// The voxels of a skull as scanned that are planned to be removed, in their order.
    pub fn of(&self, skull: &BoneVolume) -> Vec<usize> {
        let bone = skull.scanned_bone().filter(|(_, voxel)| self.takes(skull.centre_of(*voxel)));
        bone.map(|(at, _)| at).collect()
    }
}

/// Rotation of the plane across the entry direction, from x and y.
fn across(site: &Site) -> Quat {
    Quat::from_rotation_arc(Vec3::Z, -site.inward.normalize())
}

/// Points of equal distance on a closed line; `None` if it holds too little or crosses itself.
fn even(line: &[Vec2]) -> Option<Vec<Vec2>> {
    let sides = || line.iter().zip(line.iter().cycle().skip(1));
    let long: f32 = sides().map(|(a, b)| a.distance(*b)).sum();
    let area = 0.5 * sides().map(|(a, b)| a.perp_dot(*b)).sum::<f32>().abs();
    if !long.is_finite() || area < LEAST[0].max(LEAST[1] * long * long) {
        return None;
    }
    let (mut even, mut gone) = (Vec::with_capacity(RIMS), 0.0);
    for (a, b) in sides() {
        let side = a.distance(*b);
        while even.len() < RIMS && even.len() as f32 * long / (RIMS as f32) < gone + side {
            even.push(a.lerp(*b, (even.len() as f32 * long / RIMS as f32 - gone) / side));
        }
        gone += side;
    }
    (even.len() == RIMS).then_some(even)
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
    use trepan_volume::VoxelVolume;

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
        let planned = plan.of(&bone).len() as f32;
        assert!((planned / (std::f32::consts::PI * 16.2f32.powi(2) * 6.1) - 1.0).abs() < 0.06, "{planned}");
        let hole = Plan::new(Some(&bone), site, 3.0, 0.0).unwrap();
        assert!(hole.takes(site.entry) && !hole.takes(site.entry + 4.0 * Vec3::Z));
        assert!(Plan::new(Some(&bone), site, 3.0, 90.0).is_none(), "wider than the skull");
    }

    #[test]
    fn a_drawn_line_becomes_the_outline_and_bad_lines_are_refused() {
        let bone = vault();
        let outward = Vec3::ONE.normalize();
        let site = Site { entry: 86.0 * outward, inward: -outward, bone_mm: 6.0, brain_mm: 8.0 };
        let (right, up) = outward.any_orthonormal_pair();
        let on_skull = |x: f32, y: f32| 86.0 * (86.0 * outward + x * right + y * up).normalize();
        // An ellipse of 20 by 12 mm, drawn with a few points and a tremor.
        let ellipse: Vec<Vec3> = (0..30)
            .map(|n| {
                let (sin, cos) = (n as f32 / 30.0 * std::f32::consts::TAU).sin_cos();
                let tremor = if n % 2 == 0 { 1.02 } else { 0.98 };
                on_skull(20.0 * tremor * cos, 12.0 * tremor * sin)
            })
            .collect();
        let plan = Plan::drawn(&bone, site, 3.0, &ellipse).unwrap();
        let off = |rim: &Rim| (rim.outer - site.entry).dot(right).hypot(20.0 / 12.0 * (rim.outer - site.entry).dot(up));
        assert!(plan.outline.iter().all(|rim| (off(rim) / 20.0 - 1.0).abs() < 0.08), "{:?}", plan.outline);
        assert!(plan.hole().distance(ellipse[0]) < 1.5, "the hole is where the line begins");
        let place = |x, y| on_skull(x, y) - 2.0 * outward;
        assert!(plan.takes(place(18.0, 0.0)) && !plan.takes(place(0.0, 18.0)) && plan.takes(place(0.0, 10.0)));
        assert!((plan.beside_mm(place(0.0, 18.0)) - 6.0).abs() < 0.5);
        let planned = plan.of(&bone).len() as f32;
        assert!((planned / (std::f32::consts::PI * 20.5 * 12.6 * 6.1) - 1.0).abs() < 0.1, "{planned}");
        let eight: Vec<Vec3> = (0..40)
            .map(|n| n as f32 / 40.0 * std::f32::consts::TAU)
            .map(|turn| on_skull(20.0 * turn.sin(), 15.0 * (2.0 * turn).sin()))
            .collect();
        let beside: Vec<Vec3> = ellipse.iter().map(|point| *point + 40.0 * right).collect();
        for line in [&eight, &beside, &ellipse[..2].to_vec(), &Vec::new()] {
            assert!(Plan::drawn(&bone, site, 3.0, line).is_none(), "{line:?}");
        }
    }
}
