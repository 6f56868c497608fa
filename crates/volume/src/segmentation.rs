//! Label files: one or more label volumes, with the names of their segments.
//!
//! # Practice
//! [`Segmentation::read`] reads any image file of whole numbers as one layer without names. A
//! segmentation of 3D Slicer (`.seg.nrrd`) and a DICOM SEG also name their segments; segments that
//! overlap lie in layers of their own.

use crate::{ReadError, VoxelVolume, labels, read};
use std::path::Path;

/// Label volumes of one file, and the segments that it names.
#[derive(Clone, Debug)]
pub struct Segmentation {
    /// Label volumes; a segment lies in one of them.
    pub layers: Vec<VoxelVolume<u16>>,
    /// Named segments; empty if the file names none.
    pub segments: Vec<Segment>,
}

/// Named part of a label file.
#[derive(Clone, Debug, PartialEq)]
pub struct Segment {
    /// Name that the file gives.
    pub name: String,
    /// Index of its layer.
    pub layer: usize,
    /// Value of its voxels.
    pub value: u16,
}

impl Segmentation {
    /// Reads a label file of any format, without trusting its sizes.
    pub fn read(path: &Path) -> Result<Self, ReadError> {
        Ok(Self { layers: vec![labels(path, &read(path)?)?], segments: Vec::new() })
    }
}
