//! Lossy JPEG, 8 bits a pixel, decoded by the crate zune-jpeg.
//!
//! # Practice
//! Size, components and precision are checked before decoding. A panic of the decoder on a damaged
//! stream becomes an error.
//!
//! # When not to use it
//! For extended JPEG with 12 bits a pixel, which is rejected: no maintained crate decodes it.

use super::marker::{Segments, frame};
use super::{CodecError, Size};
use std::panic::{AssertUnwindSafe, catch_unwind};
use zune_jpeg::JpegDecoder;
use zune_jpeg::zune_core::bytestream::ZCursor;
use zune_jpeg::zune_core::colorspace::ColorSpace;
use zune_jpeg::zune_core::options::DecoderOptions;

/// Decodes a frame of one component and the given size; returns the stored values.
pub(in crate::dicom) fn decode(bytes: &[u8], size: Size) -> Result<Vec<u16>, CodecError> {
    check(bytes, size)?;
    let (rows, columns) = size;
    let damaged = CodecError::Wrong("its JPEG stream is damaged");
    let options = DecoderOptions::default()
        .set_strict_mode(true)
        .set_max_width(columns)
        .set_max_height(rows)
        .jpeg_set_out_colorspace(ColorSpace::Luma);
    let decode = || JpegDecoder::new_with_options(ZCursor::new(bytes), options).decode();
    let pixels = catch_unwind(AssertUnwindSafe(decode)).map_err(|_| damaged)?.map_err(|_| damaged)?;
    match pixels.len() == rows * columns {
        true => Ok(pixels.into_iter().map(u16::from).collect()),
        false => Err(CodecError::Short(pixels.len())),
    }
}

/// Rejects a frame header of another size or an unsupported kind.
fn check(bytes: &[u8], size: Size) -> Result<(), CodecError> {
    let mut segments = Segments::of(bytes)?;
    loop {
        let segment = segments.next()?;
        match segment.marker {
            0xc0..=0xc2 => {
                return match frame(segment.body, size)? {
                    8 => Ok(()),
                    _ => Err(CodecError::Wrong("a JPEG with losses of more than 8 bits a pixel, which is not read")),
                };
            }
            0xc3 | 0xc5..=0xc7 | 0xc9..=0xcf | 0xda => {
                return Err(CodecError::Wrong("a kind of JPEG that its transfer syntax does not announce"));
            }
            _ => {}
        }
    }
}
