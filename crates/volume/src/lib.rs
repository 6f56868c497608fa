//! Voxel volumes with patient orientation: file formats, resampling, masks, distance fields,
//! drilling.
//!
//! # Theory
//! An image is a grid of samples and the affine from voxel indices to the patient's RAS+ mm
//! ([`VoxelVolume`]). Readers convert each format's axes, units and stored numbers to this one
//! form.
//!
//! # Practice
//! [`read`] detects the format by content. A CT becomes [`hounsfield`] values and, with
//! [`bone_isovalue`] and [`skull_only`], the [`BoneVolume`] that a burr drills. An MRI becomes a
//! [`brain_mask`]; a mask becomes a [`DistanceField`].
//!
//! # When not to use it
//! For time series or colour images: only real-valued volumes are read.

mod atomic;
mod bone;
mod brain;
mod component;
pub mod dicom;
mod distance;
mod error;
mod flap;
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
mod pictures;
mod piece;
mod registration;
mod regular;
mod resample;
mod sample;
mod segmentation;
mod skull;
mod source;
mod spline;
mod stroke;
mod volume;

pub use atomic::write_atomically;
pub use bone::{AIR_HU, BetweenScratch, BoneError, BoneVolume, CUT_STEPS, CUT_SURFACE, CutWriter, cut_depth};
pub use brain::{
    BrainConfidence, BrainConfig, BrainFit, FoundBrain, MaskError, brain_by_mri, brain_fit, brain_mask,
    check_brain_mask, find_brain,
};
pub use component::largest_component;
pub use distance::{DistanceField, FAR_MM};
pub use error::{ReadError, WriteError};
pub use flap::{FlapSearch, FlapState};
pub use format::Format;
pub use list::{FORMATS, import, import_among, import_number, read, write_beside};
pub use memory::{Limit, MOST_VOXELS, TooLarge, room_for, room_for_voxels};
pub use note::{Import, Note};
pub use overlap::{LEAST_SHARE, OverlapError, overlap};
pub use pictures::{Picture, overlap_pictures};
pub use piece::Piece;
pub use registration::{Registration, RegistrationConfig, RegistrationError, register};
pub use regular::{open_regular, read_regular};
pub use resample::{Grid, Interpolation, resample};
pub use sample::{ByteOrder, Number, Sample};
pub use segmentation::{Segment, Segmentation};
pub use skull::{
    GREATEST_ISOVALUE, HounsfieldError, Islands, LEAST_ISOVALUE, bone_isovalue, hounsfield, is_ct, labels, skull_only,
};
pub use spline::Spline;
pub use stroke::{BRICK, MAX_STROKE_BRICKS, MAX_STROKES, Undone};
pub use volume::VoxelVolume;

/// The README's example, compiled.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct ReadmeExample;
