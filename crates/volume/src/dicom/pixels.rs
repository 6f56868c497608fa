//! Converts stored pixels to values.

use super::codec::{CodecError, MOST_PIXELS, jpeg, jpeg_2000, jpeg_lossless, jpeg_ls, rle};
use super::element::Pixels;
use super::slice::Slice;
use crate::ReadError;
use crate::sample::ByteOrder;
use std::borrow::Cow;
use std::ops::{Range, RangeInclusive};

/// A numerical parameter: what padding becomes in a CT, HU.
const PADDING_HU: f32 = -1024.0;
/// A numerical parameter: HU between which padding cannot lie; it would take tissue away.
const TISSUE_HU: Range<f64> = -900.0..2500.0;

/// Appends the values of one frame to `out`; returns how many were padding, which becomes air in a
/// CT and 0 in other images.
pub(super) fn frame(slice: &Slice, bytes: &[u8], frame: usize, out: &mut Vec<f32>) -> Result<usize, ReadError> {
    let layout = Layout::of(slice)?;
    let field =
        |field, found: &str, remedy| ReadError::Field { file: slice.file.clone(), field, found: found.into(), remedy };
    let missing = || field("PixelData", "missing", "the file holds no picture; fetch it again");
    let mut values = Values::of(slice, frame, &layout, out);
    let mut add = |stored: i64| values.add(stored);
    let read = match (slice.pixels.as_ref().ok_or_else(missing)?, slice.syntax.as_str()) {
        (Pixels::Plain(range), _) => {
            let needed = layout.frame_bytes();
            let start = range.start.saturating_add(frame.saturating_mul(needed));
            let found = bytes.len().min(range.end).saturating_sub(start);
            let stored = bytes.get(start..start.saturating_add(needed)).filter(|_| found >= needed);
            let stored = stored.ok_or_else(|| truncated(slice, needed, found))?;
            layout.decode(stored, &mut add);
            Ok(())
        }
        (Pixels::Fragments(fragments), syntax) => {
            let one = joined(slice, fragments, bytes, frame)?;
            let wrong = |error| match error {
                CodecError::Short(pixels) => truncated(slice, layout.frame_bytes(), pixels * layout.bytes),
                CodecError::Size(rows, columns) => {
                    let found = format!(
                        "{} by {}, but {rows} by {columns} in the compressed picture",
                        slice.rows, slice.columns
                    );
                    field("Rows or Columns", &found, "both must agree; fetch the file again")
                }
                CodecError::Wrong(why) => {
                    field("PixelData", why, "the picture cannot be decoded; fetch the file again")
                }
            };
            let size = (slice.rows, slice.columns);
            if layout.pixels > MOST_PIXELS {
                let found = format!("{} by {}", slice.rows, slice.columns);
                return Err(field("Rows or Columns", &found, "a compressed picture has at most 64 million pixels"));
            }
            let mut add_all = |stored: Vec<u16>| stored.into_iter().for_each(|v| add(layout.value(v.into())));
            match syntax {
                "1.2.840.10008.1.2.5" => {
                    let stored = rle::decode(&one, layout.pixels, layout.bytes).map_err(wrong)?;
                    Layout { order: ByteOrder::Little, ..layout }.decode(&stored, &mut add);
                }
                "1.2.840.10008.1.2.4.50" | "1.2.840.10008.1.2.4.51" => {
                    add_all(jpeg::decode(&one, size).map_err(wrong)?);
                }
                "1.2.840.10008.1.2.4.57" | "1.2.840.10008.1.2.4.70" => {
                    add_all(jpeg_lossless::decode(&one, size).map_err(wrong)?);
                }
                "1.2.840.10008.1.2.4.80" | "1.2.840.10008.1.2.4.81" => {
                    add_all(jpeg_ls::decode(&one, size).map_err(wrong)?);
                }
                "1.2.840.10008.1.2.4.90" | "1.2.840.10008.1.2.4.91" => {
                    add_all(jpeg_2000::decode(&one, size).map_err(wrong)?);
                }
                other => {
                    let found = format!("{other} ({})", name(other));
                    let remedy = "that compression is not read; convert the series to Explicit VR Little Endian (gdcmconv --raw)";
                    return Err(field("TransferSyntaxUID", &found, remedy));
                }
            }
            Ok(())
        }
    };
    read.map(|()| values.padded)
}

/// Values of a frame, and how many of them were padding.
struct Values<'a> {
    out: &'a mut Vec<f32>,
    rescale: [f64; 2],
    padding: RangeInclusive<i64>,
    is_ct: bool,
    padded: usize,
}

impl<'a> Values<'a> {
    fn of(slice: &Slice, frame: usize, layout: &Layout, out: &'a mut Vec<f32>) -> Self {
        let rescale = slice.rescale.get(frame).or(slice.rescale.first()).copied().unwrap_or([1.0, 0.0]);
        Self { out, rescale, padding: layout.padding(slice.padding), is_ct: slice.modality == "CT", padded: 0 }
    }

    fn add(&mut self, stored: i64) {
        let value = self.rescale[0] * stored as f64 + self.rescale[1];
        let fill = if self.is_ct { PADDING_HU } else { 0.0 };
        if self.padding.contains(&stored) && !(self.is_ct && TISSUE_HU.contains(&value)) {
            self.padded += usize::from(value as f32 != fill);
            self.out.push(fill);
        } else {
            self.out.push(value as f32);
        }
    }
}

/// The compressed stream of a frame: one fragment each, or all of them for a single frame.
fn joined<'a>(
    slice: &Slice,
    fragments: &[Range<usize>],
    bytes: &'a [u8],
    frame: usize,
) -> Result<Cow<'a, [u8]>, ReadError> {
    let streams = fragments.get(1..).unwrap_or_default();
    let part = |range: &Range<usize>| bytes.get(range.clone()).unwrap_or_default();
    match (slice.frames, streams) {
        (_, []) => Err(truncated(slice, 1, 0)),
        (1, [one]) => Ok(part(one).into()),
        (1, several) => Ok(several.iter().flat_map(part).copied().collect::<Vec<u8>>().into()),
        (frames, several) if several.len() == frames => Ok(several.get(frame).map(part).unwrap_or_default().into()),
        (frames, several) => Err(ReadError::Field {
            file: slice.file.clone(),
            field: "PixelData",
            found: format!("in {} pieces for {frames} frames", several.len()),
            remedy: "frames must be compressed one by one; convert the file to Explicit VR Little Endian",
        }),
    }
}

fn truncated(slice: &Slice, expected: usize, found: usize) -> ReadError {
    ReadError::Truncated { file: slice.file.clone(), what: "PixelData", expected: expected as u64, found: found as u64 }
}

/// How a pixel is stored.
#[derive(Clone, Copy)]
struct Layout {
    pixels: usize,
    bytes: usize,
    order: ByteOrder,
    stored: u32,
    shift: u32,
    signed: bool,
}

impl Layout {
    fn of(slice: &Slice) -> Result<Self, ReadError> {
        let field =
            |field, found: String, remedy| Err(ReadError::Field { file: slice.file.clone(), field, found, remedy });
        if slice.samples != 1 {
            return field(
                "SamplesPerPixel",
                slice.samples.to_string(),
                "only grey pictures are read, with 1 sample per pixel",
            );
        }
        let (allocated, stored) = (slice.bits_allocated, slice.bits_stored);
        if !matches!(allocated, 8 | 16 | 32) {
            return field("BitsAllocated", allocated.to_string(), "8, 16 or 32 is right");
        }
        if stored == 0 || stored > allocated || slice.high_bit >= allocated || slice.high_bit + 1 < stored {
            let found = format!("{stored} of {allocated} bits, the highest {}", slice.high_bit);
            return field("BitsStored", found, "the stored bits must lie in the allocated ones");
        }
        // Padding beyond the stored bits takes the others too.
        let beyond = !slice.signed && slice.padding.iter().flatten().any(|&pad| u64::from(pad) >> stored > 0);
        let (stored, high_bit) = if beyond { (allocated, allocated - 1) } else { (stored, slice.high_bit) };
        Ok(Self {
            pixels: slice.rows * slice.columns,
            bytes: usize::from(allocated / 8),
            order: if slice.syntax == "1.2.840.10008.1.2.2" { ByteOrder::Big } else { ByteOrder::Little },
            stored: stored.into(),
            shift: u32::from(high_bit + 1 - stored),
            signed: slice.signed,
        })
    }

    /// The stored values that are padding, of what is written; an empty range for none.
    fn padding(&self, written: [Option<u16>; 2]) -> RangeInclusive<i64> {
        let [first, last] = written.map(|value| value.map(|value| self.value(value.into())));
        match (first, last) {
            (Some(first), Some(last)) => first.min(last)..=first.max(last),
            (Some(first), None) => first..=first,
            (None, _) => i64::MAX..=i64::MAX,
        }
    }

    fn frame_bytes(&self) -> usize {
        self.pixels * self.bytes
    }

    fn decode(&self, stored: &[u8], add: &mut impl FnMut(i64)) {
        for raw in stored.chunks_exact(self.bytes) {
            let join = |value: u64, byte: &u8| value << 8 | u64::from(*byte);
            let value = match self.order {
                ByteOrder::Big => raw.iter().fold(0, join),
                ByteOrder::Little => raw.iter().rev().fold(0, join),
            };
            add(self.value(value));
        }
    }

    /// Extracts the stored bits from the allocated ones, with sign.
    fn value(&self, allocated: u64) -> i64 {
        let up = 64 - self.stored;
        let top = allocated >> self.shift << up;
        if self.signed { top as i64 >> up } else { (top >> up) as i64 }
    }
}

/// Name of a transfer syntax.
fn name(syntax: &str) -> &'static str {
    match syntax {
        "1.2.840.10008.1.2.4.53" => "JPEG spectral selection, retired",
        "1.2.840.10008.1.2.4.55" => "JPEG progressive, retired",
        s if s.starts_with("1.2.840.10008.1.2.4.10") => "video",
        s if s.starts_with("1.2.840.10008.1.2.4.20") => "high-throughput JPEG 2000",
        _ => "unknown here",
    }
}
