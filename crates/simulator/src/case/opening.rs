//! Where the skull is opened: bone of moderate thickness with the brain close below, met straight
//! on; or where the user says.
//!
//! # Theory
//! The place is the patient's alone: it is looked for on a skull of 1 mm voxels ([`REFERENCE_MM`]),
//! whatever the session's are. Rays run from outside towards the brain's middle, spread evenly over
//! the upper right front of the head, else over the whole vault. Around each, parallel lines within
//! the hole and at a flap's rim pass outer table, inner table and brain; see [`search`]. What the
//! session drills is then measured along the chosen line on its own skull.
//!
//! # When not to use it
//! To plan a real operation: nothing here knows vessels, venous sinuses or eloquent cortex.

mod search;

use crate::case::Recipe;
use crate::case::anatomy::make_skull;
use crate::error::SessionError;
use search::Surroundings;
use serde::{Deserialize, Serialize};
use trepan_geometry::Vec3;
use trepan_haptics::script::Site;
use trepan_volume::{BoneVolume, DistanceField, VoxelVolume};

/// Edge of the skull's voxels that an opening is looked for in, mm.
pub const REFERENCE_MM: f32 = 1.0;

/// Room below bone where no MRI says where the brain is, mm.
const BELOW_BONE_MM: f32 = 5.0;

/// How far a session's bone may begin before the reference's, mm, and in its own voxels.
const BEFORE: [f32; 2] = [1.0, 2.0];

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

/// What a burr drills, as voxels of bone.
pub fn bone_of(skull: &VoxelVolume<i16>, isovalue_hu: i16) -> Result<BoneVolume, SessionError> {
    BoneVolume::new(skull, isovalue_hu).map_err(|fault| SessionError::Case(format!("the CT: {fault}")))
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
    /// Where to open by a CT, measured on the skull that is drilled: the place does not depend on
    /// that skull's voxels.
    pub fn planned(
        ct: &VoxelVolume<i16>,
        skull: &VoxelVolume<i16>,
        isovalue_hu: i16,
        brain: Option<&VoxelVolume<u8>>,
        recipe: &Recipe,
    ) -> Result<Self, SessionError> {
        let reference = make_skull(ct, &Recipe { spacing_mm: REFERENCE_MM, ..*recipe }, isovalue_hu)?;
        let opening = Self::of_patient(&bone_of(&reference, isovalue_hu)?, brain, recipe.opening)?;
        opening.on(&bone_of(skull, isovalue_hu)?, brain.is_some())
    }

    /// Where to open a patient's skull, by the skull on voxels of 1 mm (`REFERENCE_MM`): on the way
    /// from `wanted` (a point outside, RAS mm) to the middle of the head, else at the best place.
    pub fn of_patient(
        reference: &BoneVolume,
        brain: Option<&VoxelVolume<u8>>,
        wanted: Option<[f32; 3]>,
    ) -> Result<Self, SessionError> {
        let brain = brain.map(|classes| (DistanceField::of_mask(classes), middle(classes)));
        let centre = brain.as_ref().map_or(reference.bounds().centre(), |brain| brain.1);
        let head = Surroundings { bone: reference, brain: brain.as_ref().map(|brain| &brain.0), centre };
        let site = match wanted {
            Some(wanted) => head.towards((Vec3::from(wanted) - centre).normalize_or_zero()).ok_or_else(|| {
                let what = if brain.is_some() { "bone and then brain" } else { "a wall of bone up to 30 mm thick" };
                format!(
                    "--opening: the way from {wanted:?} to the middle of the head at {centre:.0} (RAS mm) does not meet {what}: give a point outside the skull, over the place to open"
                )
            }),
            None => head.best(),
        };
        let site = site.map_err(SessionError::Case)?;
        if let Some(wanted) = wanted {
            near(wanted, centre, site.entry).map_err(SessionError::Case)?;
        }
        Ok(site.into())
    }

    /// The same line on the skull that is drilled: where its bone begins, how thick it is, how deep
    /// the brain lies below. `with_brain`: whether there is one.
    pub fn on(self, skull: &BoneVolume, with_brain: bool) -> Result<Self, SessionError> {
        let (entry, inward) = (Vec3::from(self.entry_mm), Vec3::from(self.inward));
        let start = -(BEFORE[0] + BEFORE[1] * skull.spacing_mm());
        let end = if with_brain { self.brain_mm } else { self.bone_mm - start };
        let [outer, inner] = search::bone_along(skull, entry, inward, [start, end]).ok_or_else(|| {
            SessionError::Case(format!(
                "voxels of {} mm hold no bone at the opening {entry:.0} (RAS mm), where it is {:.1} mm thick: give a smaller --spacing-mm, or another place with --opening X,Y,Z",
                skull.spacing_mm(),
                self.bone_mm
            ))
        })?;
        let bone_mm = inner - outer;
        let brain_mm = if with_brain { self.brain_mm - outer } else { bone_mm + BELOW_BONE_MM };
        Ok(Self { entry_mm: (entry + outer * inward).into(), bone_mm, brain_mm, ..self })
    }

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

/// Middle of the box around what is not 0.
fn middle(classes: &VoxelVolume<u8>) -> Vec3 {
    let [nx, ny, _] = classes.dims;
    let place = |at: usize| classes.centre_of([at % nx, at / nx % ny, at / (nx * ny)]).as_vec3();
    let filled = (0..classes.data.len()).filter(|at| classes.data[*at] != 0).map(place).map(|p| [p, p]);
    let within = filled.reduce(|[low, high], [p, _]| [low.min(p), high.max(p)]);
    within.map_or(Vec3::ZERO, |[low, high]| 0.5 * (low + high))
}

/// A place to probe a brain without a skull: straight down from above, a third of the way to the
/// right and front.
pub fn bare_brain(brain: &DistanceField, centre: Vec3) -> Option<Site> {
    let outward = Vec3::new(0.45, 0.35, 0.82).normalize();
    let from = centre + search::FAR_MM * outward;
    let depth = search::first(0.0, search::FAR_MM, |t| -brain.sample(from - t * outward))?;
    Some(Site { entry: from - depth * outward, inward: -outward, bone_mm: 0.0, brain_mm: 0.0 })
}

/// Direction from the site to the eye: a little from behind and from the side, so that hole and
/// tool are both seen.
pub fn eye(site: &Site) -> Vec3 {
    let outward = -site.inward;
    let side = outward.cross(Vec3::Z).normalize_or(Vec3::X);
    outward + 0.45 * side + 0.25 * Vec3::Z
}

#[cfg(test)]
mod tests;
