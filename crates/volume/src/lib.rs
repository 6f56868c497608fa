//! Voxel volumes with patient orientation: file formats, resampling, masks, distance fields.
//!
//! # Theory
//! An image is a grid of samples and the affine from voxel indices to the patient's RAS+ mm
//! ([`VoxelVolume`]). Readers convert each format's axes, units and stored numbers to this one
//! form.
//!
//! ## Geometry
//! Where several fields place a volume, one policy holds for all formats; each departure from the
//! plain case is a [`Note`], and [`Import::facts`] say what was taken.
//!
//! - A NIfTI's sform counts before its qform. A sform to an atlas (code 3 and more) yields to the
//!   scanner's qform (code 1 or 2), as in ITK: the patient is operated in their own size. A sform
//!   that spans no volume, or has columns of length 1 where `pixdim` differs, yields to any qform;
//!   without one the first is an error and the second is scaled by `pixdim`, as in ITK. Code 2
//!   counts, as in nibabel: it is rigid and often leads to the CT's space. ITK takes the qform.
//! - Without codes a NIfTI lies left, front, head around the middle, as in nibabel; ITK has back
//!   for front, which mirrors it. A NRRD without a patient's space lies right, front, head, as in
//!   Slicer; a MetaImage without a matrix left, back, head, as in ITK.
//! - Transforms that place every corner within 0.1 mm agree. `pixdim` beside a sform is compared
//!   with 1 % of tolerance; its sign never counts. Without a sform a size of 0 is an error: nibabel
//!   and ITK take 1 mm, which builds a wrong head.
//! - NIfTI's m and µm and NRRD's m, cm, mm, µm, nm become mm; an unknown unit counts as mm.
//! - A NRRD without directions has `spacings`, or the range of `axis mins` and `axis maxs` over the
//!   size (cells, the default) or one less (nodes); its first centre lies half a cell after the
//!   minimum. `thicknesses` are no spacings.
//! - A slope of 0 or no number means unscaled, an intercept that is no number 0.
//! - Bytes between header and voxels, and after them, do not matter.
//!
//! Sources: the NIfTI-1 header (Cox et al. 2004) and the definition of NRRD (Kindlmann); the README
//! lists the field's readers one by one.
//!
//! # Practice
//! [`read`] detects the format by content. A CT becomes [`hounsfield`] values and, with
//! [`bone_isovalue`] and [`skull_only`], the skull that `trepan-bone` drills. An MRI becomes a
//! [`brain_mask`]; a mask becomes a [`DistanceField`].
//!
//! # When not to use it
//! For time series or colour images: only real-valued volumes are read.

mod atomic;
mod brain;
mod component;
pub mod dicom;
mod distance;
mod error;
mod format;
mod keys;
mod list;
mod memory;
pub mod metaimage;
pub mod mgh;
#[cfg(test)]
mod mutation;
pub mod nifti;
mod note;
pub mod nrrd;
mod overlap;
mod padding;
mod registration;
mod regular;
mod resample;
mod sample;
mod segmentation;
mod skull;
mod source;
mod spline;
mod volume;

pub use atomic::write_atomically;
pub use brain::{
    BrainConfidence, BrainConfig, BrainFit, FoundBrain, Hidden, MaskError, StrayBone, brain_by_mri, brain_fit,
    brain_mask, check_brain_mask, find_brain, grey_level, leans, stray_bone,
};
pub use component::{Components, largest_component};
pub use distance::{DistanceField, FAR_MM};
pub use error::{ReadError, WriteError};
pub use format::Format;
pub use list::{FORMATS, import, import_among, import_number, read, write_beside};
pub use memory::{Limit, MOST_VOXELS, TooLarge, room_for, room_for_voxels};
pub use note::{Import, Note};
pub use overlap::{LEAST_SHARE, OverlapError, overlap};
pub use registration::{Registration, RegistrationConfig, RegistrationError, register};
pub use regular::{open_regular, read_regular};
pub use resample::{Grid, Interpolation, corners, resample};
pub use sample::{ByteOrder, Number, Sample};
pub use segmentation::{Segment, Segmentation, flatness};
pub use skull::{
    AIR_HU, GREATEST_ISOVALUE, HounsfieldError, Islands, LEAST_ISOVALUE, bone_isovalue, hounsfield, is_ct, labels,
    skull_only,
};
pub use spline::Spline;
pub use volume::VoxelVolume;

/// The README's example, compiled.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct ReadmeExample;
