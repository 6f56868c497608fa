//! Label files: one or more label volumes, with the names of their segments.
//!
//! # Practice
//! [`Segmentation::read`] reads any image file of whole numbers as one layer without names. A
//! segmentation of 3D Slicer (`.seg.nrrd`) and a DICOM SEG also name their segments; segments that
//! overlap lie in layers of their own.

use crate::{ReadError, VoxelVolume, import_number, labels, nrrd, read};
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
    /// Reads a label file of any format, without trusting its sizes. Labels that are no whole numbers
    /// from 0 to 65535 are an error.
    pub fn read(path: &Path) -> Result<Self, ReadError> {
        let (count, segments) = nrrd::segments(path)?;
        let layers: Result<_, ReadError> = match count {
            1 => labels(path, &read(path)?).map(|layer| vec![layer]),
            _ => (0..count).map(|layer| labels(path, &import_number(path, layer)?.volume)).collect(),
        };
        Ok(Self { layers: layers?, segments })
    }
}
