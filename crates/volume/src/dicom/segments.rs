//! Segmentations: a frame for each slice of each segment.
//!
//! # Theory
//! PS3.3 C.8.20: bits of binary frames follow each other without gaps, the lowest bit first;
//! fractional frames have a byte for each voxel. A frame names its segment and its place; slices
//! without a frame are empty.
//!
//! # Practice
//! Segments that do not overlap share a layer. A fractional voxel counts from a half.

use super::pixels;
use super::slice::Slice;
use crate::dicom::element::Pixels;
use crate::{ReadError, Segment, Segmentation, VoxelVolume, room_for_voxels};
use glam::{DAffine3, DMat3, DVec3};

/// Largest distance of a frame from its slice, as a share of the slices' distance.
const OFF: f64 = 0.1;

/// Reads the segments of a file.
pub(super) fn read(slice: &Slice, bytes: &[u8]) -> Result<Segmentation, ReadError> {
    let wrong = |field, found: String, remedy| ReadError::Field { file: slice.file.clone(), field, found, remedy };
    let (Some([row, column]), Some([rows_mm, columns_mm])) = (slice.orientation, slice.spacing) else {
        let remedy = "frames without it have no place; export the segmentation again";
        return Err(wrong("PlaneOrientation or PixelMeasures", "missing".into(), remedy));
    };
    let frames = slice.frames;
    if slice.positions.len() != frames || slice.segment_of_frame.len() != frames {
        let found = format!("given for {} of {frames} frames", slice.positions.len().min(slice.segment_of_frame.len()));
        return Err(wrong("ImagePositionPatient or ReferencedSegmentNumber", found, "each frame must have both"));
    }
    let normal = row.cross(column);
    let mut order: Vec<usize> = (0..frames).collect();
    order.sort_by(|a, b| normal.dot(slice.positions[*a]).total_cmp(&normal.dot(slice.positions[*b])));
    let first = slice.positions[order[0]];
    let heights: Vec<f64> = slice.positions.iter().map(|p| normal.dot(*p - first)).collect();
    let gaps = order.windows(2).map(|pair| heights[pair[1]] - heights[pair[0]]).filter(|gap| *gap > 1e-3);
    let step = gaps.fold(f64::INFINITY, f64::min);
    let step = if step.is_finite() { step } else { 1.0 };
    let places: Vec<usize> = heights.iter().map(|height| (height / step).round() as usize).collect();
    if heights.iter().zip(&places).any(|(height, &place)| (height - place as f64 * step).abs() > OFF * step) {
        let remedy = "slices must lie at multiples of one distance; export it on the image's slices";
        return Err(wrong("ImagePositionPatient", format!("uneven, the least distance is {step:.3} mm"), remedy));
    }
    let dims = [slice.columns, slice.rows, places.iter().max().map_or(0, |last| last + 1).max(2)];
    let file = slice.file.clone();
    let too_large = |source| ReadError::TooLarge { file, field: "Rows, Columns and frames", source };
    room_for_voxels(dims.iter().fold(1, |n: u64, &d| n.saturating_mul(d as u64)), 4).map_err(too_large)?;
    let matrix3 = DMat3::from_cols(row * columns_mm, column * rows_mm, normal * step);
    let lps = DAffine3 { matrix3, translation: first };
    let world_from_voxel = DAffine3::from_scale(DVec3::new(-1.0, -1.0, 1.0)) * lps;
    crate::source::check_affine(&slice.file, "ImagePositionPatient or PixelSpacing", world_from_voxel)?;
    let (pixels, mut layers, mut segments) = (dims[0] * dims[1], Vec::<VoxelVolume<u16>>::new(), Vec::new());
    for (number, name) in &slice.segments {
        let mut mask = VoxelVolume::filled(dims, world_from_voxel, 0u16);
        for frame in (0..frames).filter(|&frame| slice.segment_of_frame[frame] == *number) {
            let held = held(slice, bytes, frame, pixels)?;
            for (voxel, _) in mask.data[pixels * places[frame]..][..pixels].iter_mut().zip(held).filter(|v| v.1) {
                *voxel = *number;
            }
        }
        let free = |layer: &VoxelVolume<u16>| layer.data.iter().zip(&mask.data).all(|(&a, &b)| a == 0 || b == 0);
        let layer = layers.iter().position(free).unwrap_or(layers.len());
        match layers.get_mut(layer) {
            Some(known) => known.data.iter_mut().zip(&mask.data).for_each(|(to, &from)| *to |= from),
            None => layers.push(mask),
        }
        segments.push(Segment { name: name.clone(), layer, value: *number });
    }
    match layers.is_empty() {
        true => Err(wrong("SegmentSequence", "empty".into(), "a segmentation names at least one segment")),
        false => Ok(Segmentation { layers, segments }),
    }
}

/// Which pixels of a frame the segment holds.
fn held(slice: &Slice, bytes: &[u8], frame: usize, pixels: usize) -> Result<Vec<bool>, ReadError> {
    if slice.bits_allocated != 1 {
        let mut values = Vec::new();
        pixels::frame(slice, bytes, frame, &mut values)?;
        let half = 0.5 * f32::from(slice.fraction.max(1));
        return Ok(values.into_iter().map(|value| value >= half).collect());
    }
    let start = match &slice.pixels {
        Some(Pixels::Plain(range)) => range.start,
        _ => usize::MAX,
    };
    let bit = |pixel: usize| {
        let at = frame * pixels + pixel;
        bytes.get(start.saturating_add(at / 8)).map(|byte| byte >> (at % 8) & 1 == 1)
    };
    let truncated = || ReadError::Truncated {
        file: slice.file.clone(),
        what: "PixelData",
        expected: (slice.frames * pixels).div_ceil(8) as u64,
        found: bytes.len().saturating_sub(start) as u64,
    };
    (0..pixels).map(bit).collect::<Option<_>>().ok_or_else(truncated)
}
