//! Chooses where the skull is opened: moderately thick bone, met perpendicularly, with the brain
//! close below; or the user's place.
//!
//! # Theory
//! The place depends on the patient only: the search runs on a skull of 1 mm voxels
//! ([`REFERENCE_MM`]), whatever the voxel size of the session. Rays run from outside towards the
//! brain's centre, evenly spread over the upper right front of the head, else over the whole vault.
//! Around each ray, parallel lines within the hole and at a flap's rim intersect outer table, inner
//! table and brain; see `search.rs`. Entry, bone thickness and brain depth are then measured along
//! the chosen line on the session's skull.
//!
//! # When not to use it
//! To plan a real operation: vessels, venous sinuses and eloquent cortex are ignored.

mod search;

use crate::PatientError;
use crate::Recipe;
use crate::anatomy::make_skull;
use search::Surroundings;
use serde::{Deserialize, Serialize};
use trepan_bone::BoneVolume;
use trepan_geometry::Vec3;
use trepan_haptics::script::Site;
use trepan_volume::{DistanceField, VoxelVolume};

/// Voxel edge of the skull in which an opening is searched, mm.
pub const REFERENCE_MM: f32 = 1.0;

/// Assumed depth of the brain below bone without an MRI, mm.
const BELOW_BONE_MM: f32 = 5.0;

/// How far a session's bone may begin before the reference's: mm, plus voxels of the session.
const BEFORE: [f32; 2] = [1.0, 2.0];

/// A planned opening, as stored in a case; the fields are those of a [`Site`].
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

/// Bone volume of a skull, for drilling.
pub fn bone_of(skull: VoxelVolume<i16>, isovalue_hu: i16) -> Result<BoneVolume, PatientError> {
    BoneVolume::of(skull, isovalue_hu).map_err(|fault| PatientError::Case(format!("the CT: {fault}")))
}

/// Depth below the bone's surface at which a point still counts as on it, mm: two voxels.
const ON_BONE_MM: f32 = 3.0;
/// Largest accepted distance of a point from the bone, mm; no scalp is so thick.
const FARTHEST_MM: f32 = 150.0;

/// Refuses a point that lies inside the skull or far from it; the bone's surface is at `entry`.
fn check_point(requested: [f32; 3], centre: Vec3, entry: Vec3) -> Result<(), PatientError> {
    let away_mm = Vec3::from(requested).distance(centre) - entry.distance(centre);
    let what = if away_mm < -ON_BONE_MM {
        format!("lies {:.0} mm inside the skull", -away_mm)
    } else if away_mm > FARTHEST_MM {
        format!("lies {away_mm:.0} mm away from the skull, over the limit of {FARTHEST_MM} mm")
    } else {
        return Ok(());
    };
    let [x, y, z] = entry.to_array();
    Err(PatientError::Case(format!(
        "--opening: {requested:?} {what}: give a point outside the skull, over the place to open; on the same line the bone begins at {x:.0},{y:.0},{z:.0} (RAS mm)"
    )))
}

/// The inside of a brain.
pub struct Inside {
    /// Distance to its surface, mm, negative inside.
    pub field: DistanceField,
    /// Centre of its bounding box.
    pub middle: Vec3,
}

impl Inside {
    /// Of the nonzero voxels.
    pub fn of(classes: &VoxelVolume<u8>) -> Self {
        Self { field: DistanceField::of_mask(classes), middle: middle(classes) }
    }
}

impl Opening {
    /// Plans the opening from a CT and measures it on the session's skull. The place does not
    /// depend on that skull's voxels.
    pub fn planned(
        ct: &VoxelVolume<i16>,
        skull: &BoneVolume,
        isovalue_hu: i16,
        brain: Option<&VoxelVolume<u8>>,
        recipe: &Recipe,
    ) -> Result<Self, PatientError> {
        let reference = || {
            let (reference, _) = make_skull(ct, &Recipe { spacing_mm: REFERENCE_MM, ..*recipe }, isovalue_hu)?;
            bone_of(reference, isovalue_hu)
        };
        let (reference, inside) = rayon::join(reference, || brain.map(Inside::of));
        let opening = Self::of_patient(&reference?, inside.as_ref(), recipe.opening)?;
        opening.on(skull, brain.is_some())
    }

    /// Chooses where to open a patient's skull, on voxels of 1 mm (`REFERENCE_MM`). The place lies
    /// on the line from `requested` (a point outside, RAS mm) to the centre of the head, else it is
    /// the best one.
    pub fn of_patient(
        reference: &BoneVolume,
        brain: Option<&Inside>,
        requested: Option<[f32; 3]>,
    ) -> Result<Self, PatientError> {
        let centre = brain.map_or(reference.bounds().centre(), |brain| brain.middle);
        let head = Surroundings { bone: reference, brain: brain.map(|brain| &brain.field), centre };
        let site = match requested {
            Some(requested) => head.towards((Vec3::from(requested) - centre).normalize_or_zero()).ok_or_else(|| {
                let what = if brain.is_some() { "bone and then brain" } else { "a wall of bone up to 30 mm thick" };
                PatientError::Case(format!(
                    "--opening: the line from {requested:?} to the centre of the head at {centre:.0} (RAS mm) does not meet {what}: give a point outside the skull, over the place to open"
                ))
            })?,
            None => head.best()?,
        };
        if let Some(requested) = requested {
            check_point(requested, centre, site.entry)?;
        }
        Ok(site.into())
    }

    /// Measures entry, bone thickness and brain depth along the same line on the session's skull.
    /// `with_brain`: whether the case has a brain.
    pub fn on(self, skull: &BoneVolume, with_brain: bool) -> Result<Self, PatientError> {
        let (entry, inward) = (Vec3::from(self.entry_mm), Vec3::from(self.inward));
        let start = -(BEFORE[0] + BEFORE[1] * skull.spacing_mm());
        let end = if with_brain { self.brain_mm } else { self.bone_mm - start };
        let [outer, inner] = search::bone_along(skull, entry, inward, [start, end]).ok_or_else(|| {
            PatientError::Case(format!(
                "voxels of {} mm contain no bone at the opening {entry:.0} (RAS mm), where it is {:.1} mm thick: give a smaller --spacing-mm, or another place with --opening X,Y,Z",
                skull.spacing_mm(),
                self.bone_mm
            ))
        })?;
        let bone_mm = inner - outer;
        let brain_mm = if with_brain { self.brain_mm - outer } else { bone_mm + BELOW_BONE_MM };
        Ok(Self { entry_mm: (entry + outer * inward).into(), bone_mm, brain_mm, ..self })
    }

    /// Finds a place to probe a brain without a skull.
    pub fn on_bare_brain(brain: &Inside) -> Option<Self> {
        bare_brain(&brain.field, brain.middle, None).map(Self::from)
    }

    /// Point on the brain's surface below the entry.
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

/// Centre of the bounding box of the nonzero voxels.
pub(crate) fn middle(classes: &VoxelVolume<u8>) -> Vec3 {
    let [nx, ny, _] = classes.dims;
    let place = |at: usize| classes.centre_of([at % nx, at / nx % ny, at / (nx * ny)]).as_vec3();
    let filled = (0..classes.data.len()).filter(|at| classes.data[*at] != 0).map(place).map(|p| [p, p]);
    let within = filled.reduce(|[low, high], [p, _]| [low.min(p), high.max(p)]);
    within.map_or(Vec3::ZERO, |[low, high]| 0.5 * (low + high))
}

/// A point outside the skull, RAS mm, over a tumour, as seen from the middle of the head.
pub(crate) fn over(tumour: [f32; 3], middle: Vec3) -> [f32; 3] {
    (middle + OVER_MM * (Vec3::from(tumour) - middle).normalize_or(Vec3::Z)).into()
}

/// Distance of that point from the middle of the head, mm: outside of every skull.
const OVER_MM: f32 = 150.0;

/// Finds a place to probe a brain without a skull, on a ray to its centre. The ray comes from
/// outside a tumour or, without one, from above, right and front.
pub fn bare_brain(brain: &DistanceField, centre: Vec3, tumour: Option<Vec3>) -> Option<Site> {
    let usual = Vec3::new(0.45, 0.35, 0.82).normalize();
    let outward = tumour.map_or(usual, |tumour| (tumour - centre).normalize_or(usual));
    let from = centre + search::FAR_MM * outward;
    let depth = search::first(0.0, search::FAR_MM, |t| -brain.sample(from - t * outward))?;
    Some(Site { entry: from - depth * outward, inward: -outward, bone_mm: 0.0, brain_mm: 0.0 })
}

/// Direction from the site to the camera: slightly from behind and the side, so that hole and tool
/// are visible.
pub fn eye(site: &Site) -> Vec3 {
    let outward = -site.inward;
    let side = outward.cross(Vec3::Z).normalize_or(Vec3::X);
    outward + 0.45 * side + 0.25 * Vec3::Z
}

#[cfg(test)]
mod tests;
