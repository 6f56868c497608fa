//! Decoders of compressed frames, one file per compression; each returns the stored values row by
//! row.

pub(super) mod jpeg;
pub(super) mod jpeg_2000;
pub(super) mod jpeg_lossless;
pub(super) mod jpeg_ls;
mod marker;
pub(super) mod rle;

/// Rows and columns in the DICOM header, compared with the stream before decoding.
pub(in crate::dicom) type Size = (usize, usize);

/// Most pixels that a compressed frame may claim.
pub(in crate::dicom) const MOST_PIXELS: usize = 1 << 26;

/// Why a frame cannot be decoded.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::dicom) enum CodecError {
    /// The stream ends after this many pixels.
    Short(usize),
    /// The stream's rows and columns differ from the DICOM header's.
    Size(usize, usize),
    /// The stream is invalid or unsupported.
    Wrong(&'static str),
}
