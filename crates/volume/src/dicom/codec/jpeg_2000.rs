//! JPEG 2000, decoded by the crate hayro-jpeg2000.
//!
//! # Practice
//! The size is checked before decoding. A panic of the decoder on a damaged stream becomes an
//! error.

use super::{CodecError, Size};
use hayro_jpeg2000::{DecodeSettings, DecoderContext, Image};
use std::panic::{AssertUnwindSafe, catch_unwind};

/// Decodes a frame of one component and the given size; returns the stored values (two's
/// complement).
pub(in crate::dicom) fn decode(bytes: &[u8], size: Size) -> Result<Vec<u16>, CodecError> {
    let unsafe_to_go_on = |_| CodecError::Wrong("its JPEG 2000 stream is damaged");
    catch_unwind(AssertUnwindSafe(|| decode_trusting(bytes, size))).map_err(unsafe_to_go_on)?
}

fn decode_trusting(bytes: &[u8], size: Size) -> Result<Vec<u16>, CodecError> {
    let damaged = |_| CodecError::Wrong("its JPEG 2000 stream is damaged");
    let settings = DecodeSettings { resolve_palette_indices: false, strict: true, target_resolution: None };
    let image = Image::new(bytes, &settings).map_err(damaged)?;
    let (rows, columns) = (image.height() as usize, image.width() as usize);
    if (rows, columns) != size {
        return Err(CodecError::Size(rows, columns));
    }
    let mut context = DecoderContext::default();
    let decoded = image.decode(&mut context).map_err(damaged)?;
    match decoded.components() {
        [one] if one.samples().len() == rows * columns => {
            let (greatest, shift) = range(bytes);
            // Lossy streams overshoot the range, and the decoder does not clamp.
            Ok(one.samples().iter().map(|v| ((v.round() as i32).clamp(0, greatest) - shift) as u16).collect())
        }
        _ => Err(CodecError::Wrong("only one component is read")),
    }
}

/// Greatest value of the stream, and the offset that the decoder adds to signed values.
///
/// Both follow from the size segment (SIZ); the offset is half the range, 0 for unsigned values.
fn range(bytes: &[u8]) -> (i32, i32) {
    const START: [u8; 4] = [0xff, 0x4f, 0xff, 0x51];
    let start = bytes.windows(4).position(|window| window == START);
    let depth = start.and_then(|at| bytes.get(at + 42)).copied().unwrap_or(15);
    let half = 1 << (depth & 15);
    (2 * half - 1, if depth & 0x80 == 0 { 0 } else { half })
}
