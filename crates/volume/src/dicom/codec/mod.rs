//! Compressed pictures, one file per compression. Each decoder gives the stored numbers of one
//! frame, row after row.

pub(super) mod jpeg;
pub(super) mod jpeg_2000;
pub(super) mod jpeg_lossless;
pub(super) mod jpeg_ls;
mod marker;
pub(super) mod rle;

/// Rows and columns that a file announces, and its stream must have: looked at before anything is
/// decoded.
pub(in crate::dicom) type Size = (usize, usize);

/// Most pixels that a compressed frame may claim.
pub(in crate::dicom) const MOST_PIXELS: usize = 1 << 26;

/// Why a frame was not decoded.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::dicom) enum CodecError {
    /// The stream ends after so many pixels.
    Short(usize),
    /// The stream's rows and columns are others than the file announces.
    Size(usize, usize),
    /// Something in the stream is wrong or not supported.
    Wrong(&'static str),
}
