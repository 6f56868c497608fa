//! Where the skull is opened: bone of moderate thickness with the brain close below, met straight on; or where the user says.
//!
//! # Theory
//! Rays run from outside towards the brain's middle, spread evenly over the upper right front of the head. Along each: the first
//! bone is the entry, the last bone before the brain the inner table, the first place with negative distance the brain.
//! The best ray minimises `|thickness - 6| + 2 |gap - 2| + 40 (1 - cos)`, in mm, cos between the ray and the bone's surface normal.
//!
//! # When not to use it
//! To plan a real operation: nothing here knows vessels, sinuses or eloquent cortex.

use crate::error::SessionError;
use serde::{Deserialize, Serialize};
use trepan_geometry::Vec3;
use trepan_haptics::script::Site;
use trepan_volume::{BoneVolume, DistanceField, VoxelVolume};

/// A planned opening, as a case keeps it; the fields are those of a [`Site`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Opening {
    /// Point on the outer surface of the bone, RAS mm.
    pub entry_mm: [f32; 3],
    /// Unit direction into the head.
    pub inward: [f32; 3],
    /// Thickness of the bone along `inward`, mm.
    pub bone_mm: f32,
    /// Depth of the brain's surface below the entry, mm.
    pub brain_mm: f32,
}

impl Opening {
    /// Where to open a skull: on the way from `wanted` (a point outside, RAS mm) to the middle of the head, else at the best place
    /// that is found; `None` when there is none.
    pub fn on(
        skull: &VoxelVolume<i16>,
        isovalue_hu: i16,
        brain: Option<&VoxelVolume<u8>>,
        wanted: Option<[f32; 3]>,
    ) -> Result<Option<Self>, SessionError> {
        let bone = BoneVolume::new(skull, isovalue_hu);
        let bone = bone.map_err(|fault| SessionError::Case(format!("the CT: {fault}")))?;
        let below = brain.map(|classes| (DistanceField::of_mask(classes), middle(classes)));
        let Some(wanted) = wanted else {
            let found = below.map_or_else(|| bare_skull(&bone), |(field, centre)| burr_hole(&bone, &field, centre));
            return Ok(found.map(Self::from));
        };
        let centre = below.as_ref().map_or(bone.bounds().centre(), |below| below.1);
        let outward = (Vec3::from(wanted) - centre).normalize_or_zero();
        let site = match &below {
            Some((field, _)) => site(&bone, field, centre, outward).map(|(_, site)| site),
            None => wall(&bone, centre, outward),
        };
        let nothing = || {
            let what = if below.is_some() { "bone and then brain" } else { "a wall of bone up to 30 mm thick" };
            SessionError::Case(format!(
                "--opening: the way from {wanted:?} to the middle of the head at {centre:.0} (RAS mm) does not meet {what}: give a point outside the skull, over the place to open"
            ))
        };
        let site = site.ok_or_else(nothing)?;
        near(wanted, centre, site.entry).map_err(SessionError::Case)?;
        Ok(Some(site.into()))
    }
}

/// A point may lie this far below the bone's surface and still be meant on it, mm: two voxels.
const ON_BONE_MM: f32 = 3.0;
/// A point farther from the bone than this is a slip, mm: no scalp is so thick.
const FARTHEST_MM: f32 = 150.0;

/// Refuses a point that lies inside the skull or far from it; the bone's surface is at `entry`.
fn near(wanted: [f32; 3], centre: Vec3, entry: Vec3) -> Result<(), String> {
    let away_mm = Vec3::from(wanted).distance(centre) - entry.distance(centre);
    let what = if away_mm < -ON_BONE_MM {
        format!("lies {:.0} mm inside the skull", -away_mm)
    } else if away_mm > FARTHEST_MM {
        format!("lies {away_mm:.0} mm away from the skull, over the {FARTHEST_MM} mm that are taken")
    } else {
        return Ok(());
    };
    let [x, y, z] = entry.to_array();
    Err(format!(
        "--opening: {wanted:?} {what}: give a point outside the skull, over the place to open; on the same line the bone begins at {x:.0},{y:.0},{z:.0} (RAS mm)"
    ))
}

impl Opening {
    /// A place to probe a brain without a skull.
    pub fn on_bare_brain(classes: &VoxelVolume<u8>) -> Option<Self> {
        bare_brain(&DistanceField::of_mask(classes), middle(classes)).map(Self::from)
    }

    /// Point on the brain's surface below it.
    pub fn brain(&self) -> Vec3 {
        Vec3::from(self.entry_mm) + self.brain_mm * Vec3::from(self.inward)
    }
}

impl From<Site> for Opening {
    fn from(Site { entry, inward, bone_mm, brain_mm }: Site) -> Self {
        Self { entry_mm: entry.into(), inward: inward.into(), bone_mm, brain_mm }
    }
}

impl From<Opening> for Site {
    fn from(Opening { entry_mm, inward, bone_mm, brain_mm }: Opening) -> Self {
        Self { entry: entry_mm.into(), inward: inward.into(), bone_mm, brain_mm }
    }
}

/// Rays tried.
const RAYS: usize = 800;
/// Where rays start, mm from the brain's middle.
const FAR_MM: f32 = 160.0;
/// Step along a ray, mm.
const STEP_MM: f32 = 0.1;

/// The best place for a burr hole above a brain with its middle at `centre`; `None` when no ray meets bone and then brain.
fn burr_hole(bone: &BoneVolume, brain: &DistanceField, centre: Vec3) -> Option<Site> {
    let sites = outward_rays().filter_map(|outward| site(bone, brain, centre, outward));
    sites.min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, site)| site)
}

/// Middle of the box around what is not 0.
fn middle(classes: &VoxelVolume<u8>) -> Vec3 {
    let [nx, ny, _] = classes.dims;
    let place = |at: usize| classes.centre_of([at % nx, at / nx % ny, at / (nx * ny)]).as_vec3();
    let filled = (0..classes.data.len()).filter(|at| classes.data[*at] != 0).map(place).map(|p| [p, p]);
    let within = filled.reduce(|[low, high], [p, _]| [low.min(p), high.max(p)]);
    within.map_or(Vec3::ZERO, |[low, high]| 0.5 * (low + high))
}

/// A place to probe a brain without a skull: straight down from above, a third of the way to the right and front.
pub fn bare_brain(brain: &DistanceField, centre: Vec3) -> Option<Site> {
    let outward = Vec3::new(0.45, 0.35, 0.82).normalize();
    let depth = march(0.0, |t| brain.sample(centre + outward * (FAR_MM - t)) < 0.0)?;
    Some(Site { entry: centre + outward * (FAR_MM - depth), inward: -outward, bone_mm: 0.0, brain_mm: 0.0 })
}

/// A place to drill when there is no brain to look for: where a ray towards the middle of the bone meets a wall nearest to 6 mm thick,
/// on the upper right front if there is one, else anywhere.
fn bare_skull(bone: &BoneVolume) -> Option<Site> {
    let centre = bone.bounds().centre();
    let best = |sites: &mut dyn Iterator<Item = Site>| {
        sites.min_by(|a, b| (a.bone_mm - 6.0).abs().total_cmp(&(b.bone_mm - 6.0).abs()))
    };
    best(&mut outward_rays().filter_map(|outward| wall(bone, centre, outward)))
        .or_else(|| best(&mut all_rays().filter_map(|outward| wall(bone, centre, outward))))
}

/// The first wall of bone on the way in, if it is at most 30 mm thick.
fn wall(bone: &BoneVolume, centre: Vec3, outward: Vec3) -> Option<Site> {
    let at = |t: f32| bone.is_bone(bone.voxel_of(centre + outward * (FAR_MM - t)));
    let entry = march(0.0, at)?;
    let bone_mm = march(entry, |t| !at(t))? - entry;
    let entry = centre + outward * (FAR_MM - entry);
    (bone_mm <= 30.0).then_some(Site { entry, inward: -outward, bone_mm, brain_mm: bone_mm + 5.0 })
}

/// Even directions over the upper right front.
fn outward_rays() -> impl Iterator<Item = Vec3> {
    all_rays().filter(|d| d.x > 0.25 && d.y > -0.2 && d.z > 0.45)
}

/// Even directions over the sphere.
fn all_rays() -> impl Iterator<Item = Vec3> {
    let golden = std::f32::consts::PI * (3.0 - 5.0f32.sqrt());
    let of = move |i: usize| {
        let z = 1.0 - 2.0 * (i as f32 + 0.5) / RAYS as f32;
        let (sin, cos) = (golden * i as f32).sin_cos();
        Vec3::new((1.0 - z * z).sqrt() * cos, (1.0 - z * z).sqrt() * sin, z)
    };
    (0..RAYS).map(of)
}

fn site(bone: &BoneVolume, brain: &DistanceField, centre: Vec3, outward: Vec3) -> Option<(f32, Site)> {
    let point = |t: f32| centre + outward * (FAR_MM - t);
    let is_bone = |t: f32| bone.is_bone(bone.voxel_of(point(t)));
    let entry = march(0.0, is_bone)?;
    let surface = march(entry, |t| brain.sample(point(t)) < 0.0)?;
    let mut inner = surface;
    while inner > entry && !is_bone(inner) {
        inner -= STEP_MM;
    }
    let (bone_mm, brain_mm) = (inner - entry, surface - entry);
    let cos = normal(bone, point(entry)).dot(outward);
    let cost = (bone_mm - 6.0).abs() + 2.0 * (brain_mm - bone_mm - 2.0).abs() + 40.0 * (1.0 - cos);
    Some((cost, Site { entry: point(entry), inward: -outward, bone_mm, brain_mm }))
}

/// The first place from `start` on where `found` holds, mm along the ray.
fn march(start: f32, found: impl Fn(f32) -> bool) -> Option<f32> {
    let steps = ((FAR_MM - start) / STEP_MM) as usize;
    (0..steps).map(|i| start + i as f32 * STEP_MM).find(|&t| found(t))
}

/// Outward normal of the bone around a surface point: away from the mean of the bone within 4 voxels.
fn normal(bone: &BoneVolume, point: Vec3) -> Vec3 {
    const REACH: i32 = 4;
    let centre = bone.voxel_of(point);
    let mut towards_bone = Vec3::ZERO;
    for k in -REACH..=REACH {
        for j in -REACH..=REACH {
            for i in -REACH..=REACH {
                let offset = glam::IVec3::new(i, j, k);
                if offset.length_squared() <= REACH * REACH && bone.is_bone(centre + offset) {
                    towards_bone += offset.as_vec3();
                }
            }
        }
    }
    (-towards_bone).normalize_or_zero()
}

/// Direction from the site to the eye: a little from behind and from the side, so that hole and tool are both seen.
pub fn eye(site: &Site) -> Vec3 {
    let outward = -site.inward;
    let side = outward.cross(Vec3::Z).normalize_or(Vec3::X);
    outward + 0.45 * side + 0.25 * Vec3::Z
}

#[cfg(test)]
mod tests {
    use super::*;
    use trepan_volume::VoxelVolume;

    /// A round head: bone from 80 to 86 mm, brain within 78 mm.
    fn head() -> (BoneVolume, DistanceField) {
        let mut ct = VoxelVolume::isotropic([96, 96, 96], Vec3::splat(-95.0), 2.0, -1000i16);
        let mut mask = ct.map(|_| 0u8);
        for at in 0..ct.data.len() {
            let voxel = [at % 96, at / 96 % 96, at / (96 * 96)];
            let r = ct.centre_of(voxel).length();
            ct.data[at] = if (80.0..=86.0).contains(&r) { 900 } else { -1000 };
            mask.data[at] = u8::from(r < 78.0);
        }
        (BoneVolume::new(&ct, 400).unwrap(), DistanceField::of_mask(&mask))
    }

    #[test]
    fn a_round_head_is_entered_along_its_radius() {
        let (bone, brain) = head();
        let site = burr_hole(&bone, &brain, Vec3::ZERO).unwrap();
        assert!((site.entry.length() - 86.0).abs() < 2.0, "{site:?}");
        assert!((site.bone_mm - 6.0).abs() < 2.5 && (site.brain_mm - 8.0).abs() < 2.5, "{site:?}");
        assert!(site.inward.dot(-site.entry.normalize()) > 0.999);
        assert!(site.entry.x > 0.0 && site.entry.z > 0.0);
    }

    #[test]
    fn an_opening_is_found_or_made_where_it_is_wanted_or_refused() {
        let (bone, _) = head();
        let skull = bone.snapshot();
        let found = Opening::on(&skull, 400, None, None).unwrap().unwrap();
        assert!((found.bone_mm - 6.0).abs() < 2.5, "{found:?}");
        let wanted = Opening::on(&skull, 400, None, Some([-120.0, 0.0, 0.0])).unwrap().unwrap();
        assert!(
            Vec3::from(wanted.inward).dot(Vec3::X) > 0.999 && (wanted.entry_mm[0] + 86.0).abs() < 2.0,
            "{wanted:?}"
        );
        let refused = |wanted| Opening::on(&skull, 400, None, Some(wanted)).unwrap_err().to_string();
        let inside = refused([-40.0, 0.0, 0.0]);
        assert!(inside.contains("46 mm inside") && inside.contains("-86,0,0"), "{inside}");
        let far = refused([0.0, 0.0, 1000.0]);
        assert!(far.contains("914 mm away") && far.contains("outside the skull"), "{far}");
        let mut bowl = skull.clone();
        bowl.data[96 * 96 * 40..].fill(-1000);
        let fault = Opening::on(&bowl, 400, None, Some([0.0, 0.0, 120.0])).unwrap_err().to_string();
        assert!(fault.contains("--opening") && fault.contains("outside the skull"), "{fault}");
    }

    #[test]
    fn a_brain_without_skull_is_touched_at_its_surface() {
        let (bone, brain) = head();
        let site = bare_brain(&brain, Vec3::ZERO).unwrap();
        assert!((site.entry.length() - 78.0).abs() < 1.5, "{site:?}");
        assert!((bare_skull(&bone).unwrap().bone_mm - 6.0).abs() < 2.5);
    }
}
