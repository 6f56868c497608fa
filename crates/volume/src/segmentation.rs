//! Label files: one or more label volumes, with the names of their segments.
//!
//! # Practice
//! [`Segmentation::read`] reads any image file of whole numbers as one layer without names. A
//! segmentation of 3D Slicer (`.seg.nrrd`) and a DICOM SEG also name their segments; segments that
//! overlap lie in layers of their own.

use crate::VoxelVolume;
use crate::padding::border_value;

/// Label volumes of one file, and the segments that it names.
#[derive(Clone, Debug)]
pub struct Segmentation {
    /// Label volumes of one grid, at least one; a segment lies in one of them.
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

/// Share of neighbours along i that have one value, and the ml that an image shows.
///
/// Neighbours that both have the commonest value of the faces do not count. A label volume has 0.6
/// to 0.98, an MRI under 0.3.
pub fn flatness(image: &VoxelVolume<f32>) -> (f64, f64) {
    let background = border_value(image).unwrap_or(f32::NAN);
    let (mut same, mut pairs, mut shown) = (0usize, 0usize, 0usize);
    for row in image.data.chunks_exact(image.dims[0].max(1)) {
        shown += row.iter().filter(|&&v| v != background).count();
        for pair in row.windows(2).filter(|pair| pair[0] != background || pair[1] != background) {
            pairs += 1;
            same += usize::from(pair[0] == pair[1]);
        }
    }
    (same as f64 / pairs.max(1) as f64, shown as f64 * image.voxel_mm3() * 1e-3)
}

impl Segmentation {
    /// A mask of the voxels whose layer and value pass; 1 where one does.
    pub fn mask(&self, holds: impl Fn(usize, u16) -> bool) -> VoxelVolume<u8> {
        let first = &self.layers[0];
        let any = |at: usize| self.layers.iter().enumerate().any(|(layer, voxels)| holds(layer, voxels.data[at]));
        let data = (0..first.data.len()).map(|at| u8::from(any(at))).collect();
        VoxelVolume { dims: first.dims, data, world_from_voxel: first.world_from_voxel }
    }
}
