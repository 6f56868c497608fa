//! Stored pixels into values.

use super::element::Pixels;
use super::rle;
use super::slice::Slice;
use crate::ReadError;
use crate::sample::ByteOrder;

/// Adds the values of one frame of a picture to `out`.
pub(super) fn frame(slice: &Slice, bytes: &[u8], frame: usize, out: &mut Vec<f32>) -> Result<(), ReadError> {
    let layout = Layout::of(slice)?;
    let field =
        |field, found: &str, remedy| ReadError::Field { file: slice.file.clone(), field, found: found.into(), remedy };
    let missing = || field("PixelData", "missing", "the file holds no picture; fetch it again");
    let [slope, intercept] = slice.rescale.get(frame).or(slice.rescale.first()).copied().unwrap_or([1.0, 0.0]);
    let mut add = |stored: i64| out.push((slope * stored as f64 + intercept) as f32);
    match (slice.pixels.as_ref().ok_or_else(missing)?, slice.syntax.as_str()) {
        (Pixels::Plain(range), _) => {
            let needed = layout.frame_bytes();
            let start = range.start.saturating_add(frame.saturating_mul(needed));
            let found = bytes.len().min(range.end).saturating_sub(start);
            let stored = bytes.get(start..start.saturating_add(needed)).filter(|_| found >= needed);
            let stored = stored.ok_or_else(|| truncated(slice, needed, found))?;
            layout.decode(stored, &mut add);
            Ok(())
        }
        (Pixels::Fragments(fragments), "1.2.840.10008.1.2.5") => {
            let one = fragments.get(1 + frame).and_then(|r| bytes.get(r.clone())).ok_or_else(missing)?;
            let stored = rle::decode(one, layout.pixels, layout.bytes);
            let stored = stored.map_err(|found| truncated(slice, layout.frame_bytes(), found))?;
            Layout { order: ByteOrder::Little, ..layout }.decode(&stored, &mut add);
            Ok(())
        }
        (Pixels::Fragments(_), syntax) => Err(field(
            "TransferSyntaxUID",
            &format!("{syntax} ({})", name(syntax)),
            "that compression is not read; convert the series to Explicit VR Little Endian (gdcmconv --raw, dcmdjpeg)",
        )),
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
        Ok(Self {
            pixels: slice.rows * slice.columns,
            bytes: usize::from(allocated / 8),
            order: if slice.syntax == "1.2.840.10008.1.2.2" { ByteOrder::Big } else { ByteOrder::Little },
            stored: stored.into(),
            shift: u32::from(slice.high_bit + 1 - stored),
            signed: slice.signed,
        })
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
            let up = 64 - self.stored;
            let top = value >> self.shift << up;
            add(if self.signed { top as i64 >> up } else { (top >> up) as i64 });
        }
    }
}

/// What a transfer syntax is called.
fn name(syntax: &str) -> &'static str {
    match syntax {
        "1.2.840.10008.1.2.4.50" => "JPEG baseline",
        "1.2.840.10008.1.2.4.51" => "JPEG extended",
        "1.2.840.10008.1.2.4.57" | "1.2.840.10008.1.2.4.70" => "JPEG lossless",
        "1.2.840.10008.1.2.4.80" => "JPEG-LS lossless",
        "1.2.840.10008.1.2.4.81" => "JPEG-LS near-lossless",
        "1.2.840.10008.1.2.4.90" => "JPEG 2000 lossless",
        "1.2.840.10008.1.2.4.91" => "JPEG 2000",
        _ => "unknown here",
    }
}
