//! Checks that an MRI lies in the CT's space: its brain must lie inside the CT's skull.
//!
//! # Theory
//! The brain is segmented from the MRI alone and compared with the intracranial space of the CT
//! ([`BrainFit`]): the share of the brain outside, the share of the space filled, and the distance
//! between the centres. The boxes of the images are no criterion: a scanner's field of view does
//! not depend on where the head lies in it.
//!
//! # When not to use it
//! To judge a registration: an error of some millimetres passes. Look at the slices for that.

use crate::error::SessionError;
use trepan_volume::{BrainFit, TooLarge, VoxelVolume, brain_by_mri, brain_fit};

/// CT that an MRI is compared with.
pub(crate) struct Space<'a> {
    /// The CT.
    pub ct: &'a VoxelVolume<i16>,
    /// Its threshold of bone, HU.
    pub isovalue_hu: i16,
    /// Whether the MRI was registered to the CT.
    pub registered: bool,
}

/// Limits beyond which the user is warned.
///
/// | images | share outside | share filled | centres, mm |
/// |---|---|---|---|
/// | two heads, aligned | 0.00 | 0.75 | 2 |
/// | off by 10 degrees and 10 mm | 0.01 to 0.05 | 0.68 | 9 to 16 |
/// | off by 20 degrees and 30 mm | 0.15 to 0.29 | 0.5 | 26 to 39 |
/// | of two patients | 0.27 | 0.44 | 37 |
///
/// These are numerical parameters.
const DOUBTFUL: BrainFit = BrainFit { outside_share: 0.03, filled_share: 0.5, middles_mm: 8.0 };

/// Numerical limits beyond which the images are refused; measured values are at [`DOUBTFUL`].
/// The limit of the filled share is low, because an old brain, or a mask without the fluid around
/// the brain, fills little.
const APART: BrainFit = BrainFit { outside_share: 0.1, filled_share: 0.3, middles_mm: 20.0 };

/// Whether a fit lies beyond a limit.
fn is_beyond(fit: &BrainFit, limits: &BrainFit) -> bool {
    fit.outside_share > limits.outside_share
        || fit.filled_share < limits.filled_share
        || fit.middles_mm > limits.middles_mm
}

impl Space<'_> {
    /// Compares an MRI's brain with the skull; returns a remark if it fits badly.
    pub fn check_mri(&self, mri: &VoxelVolume<f32>) -> Result<Option<String>, SessionError> {
        match brain_by_mri(mri).map_err(large)? {
            Some(brain) => self.check("the MRI's brain", &brain),
            None => Ok(Some("no brain was found in the MRI alone: whether it lies in the CT's space is not checked; check the overlay of both in the report".into())),
        }
    }

    /// Compares a brain mask with the skull; returns a remark if it fits badly.
    pub fn check(&self, what: &str, brain: &VoxelVolume<u8>) -> Result<Option<String>, SessionError> {
        let Some(fit) = brain_fit(brain, self.ct, self.isovalue_hu).map_err(large)? else {
            return Ok(Some(
                "the CT's bone encloses no space: whether the MRI lies in its space is not checked".into(),
            ));
        };
        let found = format!(
            "{:.0} % of {what} lies outside the CT's skull, {:.0} % of the space inside is filled, the centres lie {:.0} mm apart",
            100.0 * fit.outside_share,
            100.0 * fit.filled_share,
            fit.middles_mm
        );
        tracing::debug!("{found}");
        let remedy = match self.registered {
            false => "give --register to move the MRI to the CT, or images in one space",
            true => {
                "--register found no good fit: give images of one patient, or register them elsewhere and leave --register out"
            }
        };
        if is_beyond(&fit, &APART) {
            return Err(SessionError::Case(format!("the MRI does not lie in the CT's space: {found}; {remedy}")));
        }
        let doubt = || format!("the MRI may not lie in the CT's space: {found}; {remedy}");
        Ok(is_beyond(&fit, &DOUBTFUL).then(doubt))
    }
}

fn large(fault: TooLarge) -> SessionError {
    SessionError::Case(format!("{fault}; crop the images, or correct their voxel edges"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{DAffine3, DQuat, DVec3};
    use std::path::Path;
    use trepan_volume::{bone_isovalue, hounsfield, nifti};

    /// Checks a head's MRI after a rotation and a shift; an error is a refusal.
    fn checked(folder: &Path, [ct, mri]: [&str; 2], degrees: f64, shift_mm: f64) -> Result<Option<String>, String> {
        let ct = hounsfield(&nifti::read(&folder.join(ct)).unwrap()).unwrap();
        let mut mri = nifti::read(&folder.join(mri)).unwrap();
        let (low, high) = mri.world_corners();
        let middle = DAffine3::from_translation(0.5 * (low + high));
        let turn = DAffine3::from_quat(DQuat::from_axis_angle(DVec3::ONE.normalize(), degrees.to_radians()));
        let shift = DAffine3::from_translation(shift_mm * DVec3::NEG_Z);
        mri.world_from_voxel = shift * middle * turn * middle.inverse() * mri.world_from_voxel;
        let space = Space { ct: &ct, isovalue_hu: bone_isovalue(&ct), registered: false };
        space.check_mri(&mri).map_err(|fault| fault.to_string())
    }

    fn check_head(folder: &Path, files: [&str; 2]) {
        assert_eq!(checked(folder, files, 0.0, 0.0), Ok(None));
        assert_eq!(checked(folder, files, 2.0, 2.0), Ok(None));
        let doubt = checked(folder, files, 10.0, 10.0).unwrap().unwrap();
        assert!(doubt.contains("may not lie") && doubt.contains("--register"), "{doubt}");
        let fault = checked(folder, files, 20.0, 30.0).unwrap_err();
        assert!(fault.contains("does not lie") && fault.contains("--register"), "{fault}");
    }

    #[test]
    fn a_head_passes_where_it_lies_and_is_refused_turned_and_shifted() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
        check_head(&root.join("fixtures/case-head"), ["ct_hu.nii.gz", "mri_t1.nii.gz"]);
        let second = root.join("../shared/data/head-second");
        match second.exists() {
            true => check_head(&second, ["ct/ct_head_hu.nii.gz", "mri/mri_t1_in_ct_grid.nii.gz"]),
            false => println!("{} is not there: only one head was tried", second.display()),
        }
    }
}
