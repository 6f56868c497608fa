//! Shows skull and brain around the opening before a case is built, to measure models there.

use crate::Case;
use crate::PatientError;
use crate::opening::{Inside, Opening, bone_of};
use trepan_bone::BoneVolume;
use trepan_volume::{DistanceField, VoxelVolume};

/// A patient's skull and brain, and where the skull is to be opened.
#[derive(Debug)]
pub struct Preview {
    /// The opening.
    pub opening: Opening,
    /// The skull as scanned, HU, and as it is drawn; `None` without a CT.
    pub skull: Option<(VoxelVolume<i16>, BoneVolume)>,
    /// Threshold of bone, HU.
    pub isovalue_hu: i16,
    /// Mask of the brain, and the signed distance to its surface, mm; `None` without an MRI.
    pub brain: Option<(VoxelVolume<u8>, DistanceField)>,
}

impl Preview {
    /// Preview of a case that is built: its skull stands in for the CT, so that what resampling
    /// lost is not counted. `None` without an opening.
    pub fn of(case: &Case) -> Result<Option<Self>, PatientError> {
        let Some(opening) = case.opening else { return Ok(None) };
        let of_bone =
            |ct: &VoxelVolume<i16>| Ok::<_, PatientError>((ct.clone(), bone_of(ct.clone(), case.isovalue_hu)?));
        let skull = case.skull.as_ref().map(of_bone).transpose()?;
        let brain = case.brain.as_ref().map(|brain| (brain.classes.clone(), Inside::of(&brain.classes).field));
        Ok(Some(Self { opening, skull, isovalue_hu: case.isovalue_hu, brain }))
    }
}
