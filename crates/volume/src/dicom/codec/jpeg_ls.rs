//! JPEG-LS, lossless and near-lossless: context-corrected prediction, Golomb codes, runs.
//!
//! # Theory
//! ITU-T T.87. With a left, b above, c above left, d above right: where the gradients d - b, b - c,
//! c - a are all small, a run of a follows. Otherwise they select one of 365 contexts, which
//! corrects the median predictor and sets the Golomb parameter k, the least with `N · 2ᵏ ≥ A`.
//!
//! # Sources
//! M. Weinberger, G. Seroussi, G. Sapiro, "The LOCO-I lossless image compression algorithm", IEEE
//! TIP 9, 2000; ITU-T T.87.

use super::marker::{Segments, frame};
use super::{CodecError, Size};

/// Run lengths that one bit stands for, as powers of two.
const RUNS: [u32; 32] =
    [0, 0, 0, 0, 1, 1, 1, 1, 2, 2, 2, 2, 3, 3, 3, 3, 4, 4, 5, 5, 6, 6, 7, 7, 8, 9, 10, 11, 12, 13, 14, 15];

/// Decodes a frame of one component and the given size; returns the stored values.
pub(in crate::dicom) fn decode(bytes: &[u8], size: Size) -> Result<Vec<u16>, CodecError> {
    let mut segments = Segments::of(bytes)?;
    let mut known = None;
    let mut preset = [0i32; 5];
    loop {
        let segment = segments.next()?;
        match segment.marker {
            0xf7 => known = Some(frame(segment.body, size)?),
            0xf8 => {
                let [1, values @ ..] = segment.body else {
                    return Err(CodecError::Wrong("mapping tables are not read"));
                };
                for (preset, raw) in preset.iter_mut().zip(values.chunks_exact(2)) {
                    *preset = u16::from_be_bytes([raw[0], raw[1]]).into();
                }
            }
            0xdd => return Err(CodecError::Wrong("restart intervals are not read")),
            0xda => {
                let &[1, _, _, near, _, shift] = segment.body else {
                    return Err(CodecError::Wrong("only scans of one component are read"));
                };
                let (rows, columns) = size;
                let precision = known.ok_or(CodecError::Wrong("the frame header (SOF55) is missing"))?;
                let mut coder = Coder::new(precision, near.into(), preset)?;
                let pixels = coder.picture(&mut Bits::of(segments.rest()), rows, columns)?;
                let shift = u32::from(shift & 15);
                return Ok(pixels.into_iter().map(|p| p << shift).collect());
            }
            0xc0..=0xcf => return Err(CodecError::Wrong("it is JPEG, not JPEG-LS")),
            0xd9 => return Err(CodecError::Short(0)),
            _ => {}
        }
    }
}

/// The adaptive state of a context.
#[derive(Clone, Copy)]
struct Context {
    /// Sum of the absolute errors.
    a: i32,
    /// Sum of the errors; for the two run contexts the number of negative ones.
    b: i32,
    /// Correction of the prediction.
    c: i32,
    /// Count.
    n: i32,
}

impl Context {
    /// Least k with n · 2ᵏ ≥ a.
    fn k(&self, a: i32) -> u32 {
        (0..24).find(|&k| i64::from(self.n) << k >= i64::from(a)).unwrap_or(24)
    }
}

struct Coder {
    greatest: i32,
    near: i32,
    thresholds: [i32; 3],
    reset: i32,
    range: i32,
    /// Bits of an error in escape code.
    error_bits: u32,
    /// Longest code.
    limit: u32,
    contexts: [Context; 367],
    run: usize,
}

impl Coder {
    fn new(precision: u32, near: i32, preset: [i32; 5]) -> Result<Self, CodecError> {
        let or = |value: i32, default: i32| if value > 0 { value } else { default };
        let greatest = or(preset[0], (1 << precision) - 1);
        if greatest >= 1 << precision || near > 255.min(greatest / 2) {
            return Err(CodecError::Wrong("the greatest value or the allowed error is out of bounds"));
        }
        let [t1, t2, t3] = default_thresholds(greatest, near);
        let range = (greatest + 2 * near) / (2 * near + 1) + 1;
        let bits = |count: i32| 32 - (count - 1).leading_zeros();
        let depth = bits(greatest + 1).max(2);
        let start = Context { a: ((range + 32) / 64).max(2), b: 0, c: 0, n: 1 };
        Ok(Self {
            greatest,
            near,
            thresholds: [or(preset[1], t1), or(preset[2], t2), or(preset[3], t3)],
            reset: or(preset[4], 64).max(3),
            range,
            error_bits: bits(range),
            limit: 2 * (depth + depth.max(8)),
            contexts: [start; 367],
            run: 0,
        })
    }

    fn picture(&mut self, bits: &mut Bits, rows: usize, columns: usize) -> Result<Vec<u16>, CodecError> {
        // Rows are padded by a voxel on both sides.
        let (mut above, mut row) = (vec![0; columns + 2], vec![0; columns + 2]);
        let mut pixels = Vec::new();
        for n in 0..rows {
            above[columns + 1] = above[columns];
            row[0] = above[1];
            self.row(bits, &above, &mut row).ok_or(CodecError::Short(n * columns))?;
            pixels.extend(row[1..=columns].iter().map(|&v| v as u16));
            std::mem::swap(&mut above, &mut row);
        }
        Ok(pixels)
    }

    fn row(&mut self, bits: &mut Bits, above: &[i32], row: &mut [i32]) -> Option<()> {
        let mut at = 1;
        while at < row.len() - 1 {
            let (a, b, c, d) = (row[at - 1], above[at], above[at - 1], above[at + 1]);
            let q = [d - b, b - c, c - a].map(|gradient| self.quantized(gradient));
            if q == [0; 3] {
                at = self.run(bits, above, row, at)?;
            } else {
                row[at] = self.regular(bits, (a, b, c), q)?;
                at += 1;
            }
        }
        Some(())
    }

    fn quantized(&self, gradient: i32) -> i32 {
        let [t1, t2, t3] = self.thresholds;
        let size = match gradient.abs() {
            g if g <= self.near => 0,
            g if g < t1 => 1,
            g if g < t2 => 2,
            g if g < t3 => 3,
            _ => 4,
        };
        size * gradient.signum()
    }

    fn regular(&mut self, bits: &mut Bits, (a, b, c): (i32, i32, i32), q: [i32; 3]) -> Option<i32> {
        let number = (9 * q[0] + q[1]) * 9 + q[2];
        let sign = number.signum();
        let context = self.contexts[number.unsigned_abs() as usize];
        let median = if c >= a.max(b) {
            a.min(b)
        } else if c <= a.min(b) {
            a.max(b)
        } else {
            a + b - c
        };
        let predicted = (median + sign * context.c).clamp(0, self.greatest);
        let k = context.k(context.a);
        let mapped = bits.golomb(k, self.limit, self.error_bits)?;
        let turned = k == 0 && self.near == 0 && 2 * context.b <= -context.n;
        let error = match (mapped & 1 == 1, turned) {
            (false, false) => mapped >> 1,
            (true, false) => -((mapped + 1) >> 1),
            (true, true) => mapped >> 1,
            (false, true) => -(mapped >> 1) - 1,
        };
        self.learn(number.unsigned_abs() as usize, error);
        Some(self.rebuilt(predicted, sign * error))
    }

    fn learn(&mut self, number: usize, error: i32) {
        let step = 2 * self.near + 1;
        let c = &mut self.contexts[number];
        c.b = c.b.saturating_add(error.saturating_mul(step));
        c.a = c.a.saturating_add(error.saturating_abs());
        if c.n == self.reset {
            (c.a, c.b, c.n) = (c.a >> 1, c.b >> 1, c.n >> 1);
        }
        c.n += 1;
        if c.b <= -c.n {
            c.b = (c.b + c.n).max(1 - c.n);
            c.c = (c.c - 1).max(-128);
        } else if c.b > 0 {
            c.b = (c.b - c.n).min(0);
            c.c = (c.c + 1).min(127);
        }
    }

    /// Reconstructs the value from prediction and error, modulo the range.
    fn rebuilt(&self, predicted: i32, error: i32) -> i32 {
        let step = 2 * self.near + 1;
        let value = predicted.wrapping_add(error.wrapping_mul(step));
        let turn = self.range * step;
        let wrapped = if value < -self.near {
            value.wrapping_add(turn)
        } else if value > self.greatest + self.near {
            value - turn
        } else {
            value
        };
        wrapped.clamp(0, self.greatest)
    }

    /// Decodes a run of the left neighbour's value and the pixel after it; returns the next column.
    fn run(&mut self, bits: &mut Bits, above: &[i32], row: &mut [i32], start: usize) -> Option<usize> {
        let (value, end) = (row[start - 1], row.len() - 1);
        let mut at = start;
        loop {
            let whole = 1 << RUNS[self.run];
            if bits.bit()? == 1 {
                let count = whole.min(end - at);
                row[at..at + count].fill(value);
                at += count;
                if count == whole && self.run < 31 {
                    self.run += 1;
                }
                if at == end {
                    return Some(at);
                }
                continue;
            }
            let count = bits.take(RUNS[self.run])? as usize;
            if at + count >= end {
                return None;
            }
            row[at..at + count].fill(value);
            at += count;
            row[at] = self.run_end(bits, value, above[at])?;
            self.run = self.run.saturating_sub(1);
            return Some(at + 1);
        }
    }

    fn run_end(&mut self, bits: &mut Bits, a: i32, b: i32) -> Option<i32> {
        let alike = (a - b).abs() <= self.near;
        let kind = i32::from(alike);
        let number = 365 + usize::from(alike);
        let context = self.contexts[number];
        let k = context.k(if alike { context.a + (context.n >> 1) } else { context.a });
        let mapped = bits.golomb(k, self.limit - RUNS[self.run] - 1, self.error_bits)?;
        let whole = mapped + kind;
        let odd = whole & 1 == 1;
        let size = (whole + 1) >> 1;
        let error = if (k != 0 || 2 * context.b >= context.n) == odd { -size } else { size };
        let c = &mut self.contexts[number];
        c.b += i32::from(error < 0);
        c.a = c.a.saturating_add((mapped + 1 - kind) >> 1);
        if c.n == self.reset {
            (c.a, c.b, c.n) = (c.a >> 1, c.b >> 1, c.n >> 1);
        }
        c.n += 1;
        let (predicted, sign) = if alike { (a, 1) } else { (b, if a > b { -1 } else { 1 }) };
        Some(self.rebuilt(predicted, sign * error))
    }
}

fn default_thresholds(greatest: i32, near: i32) -> [i32; 3] {
    let within = |value: i32, least: i32| if value > greatest || value < least { least } else { value };
    let [t1, t2, t3] = if greatest >= 128 {
        let factor = (greatest.min(4095) + 128) / 256;
        [factor + 2 + 3 * near, 4 * factor + 3 + 5 * near, 17 * factor + 4 + 7 * near]
    } else {
        let factor = 256 / (greatest + 1);
        [(3 / factor + 3 * near).max(2), (7 / factor + 5 * near).max(3), (21 / factor + 7 * near).max(4)]
    };
    let t1 = within(t1, near + 1);
    let t2 = within(t2, t1);
    [t1, t2, within(t3, t2)]
}

/// Bits of a scan, highest first; after a byte of 255 the next one holds only seven.
struct Bits<'a> {
    bytes: &'a [u8],
    at: usize,
    /// Buffered bits, the next one on top, zeros below the last.
    held: u64,
    count: u32,
}

impl<'a> Bits<'a> {
    fn of(bytes: &'a [u8]) -> Self {
        Self { bytes, at: 0, held: 0, count: 0 }
    }

    /// Reads bytes until 57 bits are buffered or a marker comes.
    fn fill(&mut self) {
        while self.count <= 56 {
            let stuffed = self.at > 0 && self.bytes[self.at - 1] == 0xff;
            let Some(&byte) = self.bytes.get(self.at).filter(|&&byte| !stuffed || byte < 0x80) else { return };
            let bits = if stuffed { 7 } else { 8 };
            self.held |= u64::from(byte) << (64 - bits - self.count);
            self.count += bits;
            self.at += 1;
        }
    }

    fn bit(&mut self) -> Option<u32> {
        self.take(1)
    }

    /// Reads up to 32 bits as a number.
    fn take(&mut self, count: u32) -> Option<u32> {
        if count > self.count {
            self.fill();
        }
        let left = self.count.checked_sub(count)?;
        let value = if count == 0 { 0 } else { self.held >> (64 - count) };
        self.held <<= count;
        self.count = left;
        Some(value as u32)
    }

    /// Decodes a Golomb code; a unary part of `limit - bits - 1` is followed by the value less one
    /// in `bits`.
    fn golomb(&mut self, k: u32, limit: u32, bits: u32) -> Option<i32> {
        let longest = limit.checked_sub(bits + 1)?;
        let mut zeros = 0;
        loop {
            self.fill();
            let run = self.held.leading_zeros().min(self.count);
            zeros += run;
            if zeros > longest || self.count == 0 {
                return None;
            }
            let stopped = run < self.count;
            self.held = self.held.checked_shl(run + u32::from(stopped)).unwrap_or(0);
            self.count -= run + u32::from(stopped);
            if stopped {
                break;
            }
        }
        match zeros < longest {
            true => Some((zeros << k | self.take(k)?) as i32),
            false => Some(self.take(bits)? as i32 + 1),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A constant row of four with its markers: runs of 1, 1, 1, 1.
    #[test]
    fn a_flat_picture_is_a_row_of_ones() {
        let head = [0xff, 0xd8, 0xff, 0xf7, 0, 11, 8, 0, 2, 0, 4, 1, 1, 0x11, 0, 0xff, 0xda, 0, 8, 1, 1, 0, 0, 0, 0];
        // Eight pixels: runs of 1 four times, then 2 + 2, six ones and padding.
        let bytes = [&head[..], &[0b1111_1100, 0xff, 0xd9]].concat();
        assert_eq!(decode(&bytes, (2, 4)), Ok(vec![0; 8]));
        assert_eq!(decode(&bytes, (4, 2)), Err(CodecError::Size(2, 4)), "before anything is decoded");
        assert_eq!(decode(&head, (2, 4)), Err(CodecError::Short(0)));
        assert!(matches!(decode(&head[2..], (2, 4)), Err(CodecError::Wrong(_))));
    }
}
