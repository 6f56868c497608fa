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

use crate::PatientError;
use trepan_volume::{BrainFit, Hidden, StrayBone, TooLarge, VoxelVolume, brain_by_mri, brain_fit, stray_bone};

/// CT that an MRI is compared with.
pub struct Space<'a> {
    /// The CT.
    pub ct: &'a VoxelVolume<i16>,
    /// Its threshold of bone, HU.
    pub isovalue_hu: i16,
    /// Whether the MRI was registered to the CT.
    pub registered: bool,
}

/// What is hidden has limits of its own.
const NONE_HIDDEN: Hidden =
    Hidden { space_ml: 0.0, space_share: 0.0, brain_ml: 0.0, brain_share: 0.0, cut_bone_cm2: 0.0 };

/// Limits beyond which the user is warned.
///
/// | images | share outside | share filled | centres, mm |
/// |---|---|---|---|
/// | two heads, aligned | 0.00 | 0.75 | 2 |
/// | turned by 25 degrees about its middle | 0.01 to 0.04 | 0.85 | 2 |
/// | off by 10 degrees and 10 mm | 0.01 to 0.05 | 0.68 | 9 to 16 |
/// | off by 20 degrees and 30 mm | 0.15 to 0.29 | 0.5 | 26 to 39 |
/// | of two patients | 0.27 | 0.44 | 37 |
///
/// The longest axes are 0 to 5 degrees apart if aligned, 12 to 28 turned by 25 degrees. These are
/// numerical parameters.
const DOUBTFUL: BrainFit =
    BrainFit { outside_share: 0.03, filled_share: 0.5, middles_mm: 8.0, axes_degrees: 12.0, hidden: NONE_HIDDEN };

/// Numerical limits beyond which the images are refused; measured values are at [`DOUBTFUL`].
/// The limit of the filled share is low, because an old brain, or a mask without the fluid around
/// the brain, fills little.
const APART: BrainFit =
    BrainFit { outside_share: 0.1, filled_share: 0.3, middles_mm: 20.0, axes_degrees: 20.0, hidden: NONE_HIDDEN };

/// Whether a fit lies beyond a limit.
fn is_beyond(fit: &BrainFit, limits: &BrainFit) -> bool {
    fit.outside_share > limits.outside_share
        || fit.filled_share < limits.filled_share
        || fit.middles_mm > limits.middles_mm
        || (fit.axes_degrees > limits.axes_degrees && fit.hidden.space_share.max(fit.hidden.brain_share) < HIDDEN)
}

impl Space<'_> {
    /// Compares an MRI's brain with the skull; adds remarks if it fits badly or is cut. False if
    /// no brain is found in the MRI alone.
    pub fn check_mri(&self, mri: &VoxelVolume<f32>, notes: &mut Vec<String>) -> Result<bool, PatientError> {
        let brain = brain_by_mri(mri).map_err(large)?;
        match &brain {
            Some(brain) => self.check("the MRI's brain", brain, mri, notes)?,
            None => notes.push("DOUBTFUL: no brain was found in the MRI alone: whether it lies in the CT's space is not checked; check the overlay of both in the report".into()),
        }
        Ok(brain.is_some())
    }

    /// Compares a brain mask with the skull; adds remarks if it fits badly or is cut.
    pub fn check(
        &self,
        what: &str,
        brain: &VoxelVolume<u8>,
        mri: &VoxelVolume<f32>,
        notes: &mut Vec<String>,
    ) -> Result<(), PatientError> {
        let Some(fit) = brain_fit(brain, mri, self.ct, self.isovalue_hu).map_err(large)? else {
            notes.push(
                "DOUBTFUL: the CT's bone encloses no space: whether the MRI lies in its space is not checked".into(),
            );
            return Ok(());
        };
        let Hidden { space_ml, space_share, brain_ml, brain_share, cut_bone_cm2 } = fit.hidden;
        let cut = fit.hidden.cuts_skull().then(|| {
            format!("the CT cuts the skull: {cut_bone_cm2:.0} cm² of its bone lie on the edge of what it shows")
        });
        let found = format!(
            "{:.0} % of {what} lies outside the CT's skull, {:.0} % of the space inside is filled, the centres lie {:.0} mm and the longest axes {:.0} degrees apart",
            100.0 * fit.outside_share,
            100.0 * fit.filled_share,
            fit.middles_mm,
            fit.axes_degrees
        );
        tracing::debug!("{found}; {:?}", fit.hidden);
        let remedy = match (&cut, self.registered) {
            (Some(_), _) => "give a CT of the whole vault in the MRI's space",
            (None, false) => "give --register to move the MRI to the CT, or images in one space",
            (None, true) => {
                "--register found no good fit: give images of one patient, or register them elsewhere and leave --register out"
            }
        };
        let because = cut.as_ref().map_or_else(String::new, |cut| format!("{cut}, so "));
        if is_beyond(&fit, &APART) {
            let fault = format!("{because}the MRI does not lie in the CT's space: {found}; {remedy}");
            return Err(PatientError::Case(fault));
        }
        if is_beyond(&fit, &DOUBTFUL) {
            notes.push(format!("{because}the MRI may not lie in the CT's space: {found}; {remedy}"));
        }
        let doubt = |share: f64| if share > DOUBTFUL_HIDDEN { "; DOUBTFUL: the brain is not whole" } else { "" };
        if space_share > HIDDEN {
            notes.push(format!(
                "the MRI ends inside the skull: {space_ml:.0} ml ({:.0} %) of the space inside it are not shown{}",
                100.0 * space_share,
                doubt(space_share)
            ));
        }
        if brain_share > HIDDEN {
            notes.push(format!(
                "{brain_ml:.0} ml ({:.0} %) of {what} lie outside of what the CT shows{}",
                100.0 * brain_share,
                doubt(brain_share)
            ));
        }
        notes.extend(cut.filter(|_| brain_share > HIDDEN || is_beyond(&fit, &DOUBTFUL)));
        Ok(())
    }

    /// Remarks on bone inside a brain and on metal around it.
    pub fn stray(&self, brain: &VoxelVolume<u8>) -> Result<Vec<String>, PatientError> {
        let StrayBone { inside_ml, metal_ml, frame_ml } =
            stray_bone(brain, self.ct, self.isovalue_hu).map_err(large)?;
        let inside = (inside_ml > STRAY_ML || metal_ml > METAL_ML).then(|| {
            format!(
                "{inside_ml:.2} ml of what the drill takes for bone lie over 10 mm inside the brain, {metal_ml:.2} ml of it as dense as metal: electrodes, clips, contrast agent or calcified tissue; a higher --isovalue-hu leaves out contrast agent"
            )
        });
        let frame = (frame_ml > FRAME_ML).then(|| {
            format!("{frame_ml:.1} ml as dense as metal lie outside the head at the height of the brain: a frame or its pins count as bone where they touch the skull")
        });
        Ok(inside.into_iter().chain(frame).collect())
    }
}

/// Share of a head that an image may leave out without a remark.
const HIDDEN: f64 = 0.02;
/// Share of a head from which what an image leaves out makes a case doubtful.
const DOUBTFUL_HIDDEN: f64 = 0.1;
/// Bone inside a brain without a remark, ml: more than a calcified pineal gland.
const STRAY_ML: f64 = 0.5;
/// Metal inside a brain without a remark, ml.
const METAL_ML: f64 = 0.02;
/// Metal around a head without a remark, ml.
const FRAME_ML: f64 = 1.0;

fn large(fault: TooLarge) -> PatientError {
    PatientError::Case(format!("{fault}; crop the images, or correct their voxel edges"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{DAffine3, DQuat, DVec3};
    use std::path::Path;
    use trepan_volume::{bone_isovalue, hounsfield, nifti};

    /// Checks a head's MRI after a rotation and a shift; an error is a refusal.
    fn checked(folder: &Path, [ct, mri]: [&str; 2], degrees: f64, shift_mm: f64) -> Result<Vec<String>, String> {
        let ct = hounsfield(&nifti::read(&folder.join(ct)).unwrap()).unwrap();
        let mut mri = nifti::read(&folder.join(mri)).unwrap();
        let (low, high) = mri.world_corners();
        let middle = DAffine3::from_translation(0.5 * (low + high));
        let turn = DAffine3::from_quat(DQuat::from_axis_angle(DVec3::ONE.normalize(), degrees.to_radians()));
        let shift = DAffine3::from_translation(shift_mm * DVec3::NEG_Z);
        mri.world_from_voxel = shift * middle * turn * middle.inverse() * mri.world_from_voxel;
        let space = Space { ct: &ct, isovalue_hu: bone_isovalue(&ct), registered: false };
        let mut notes = Vec::new();
        space.check_mri(&mri, &mut notes).map_err(|fault| fault.to_string())?;
        Ok(notes)
    }

    fn check_head(folder: &Path, files: [&str; 2]) {
        assert_eq!(checked(folder, files, 0.0, 0.0), Ok(vec![]));
        assert_eq!(checked(folder, files, 2.0, 2.0), Ok(vec![]));
        let doubt = checked(folder, files, 10.0, 10.0).unwrap().concat();
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
