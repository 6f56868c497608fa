//! Lossless JPEG: pixels predicted from their neighbours, with Huffman-coded differences.
//!
//! # Theory
//! ITU-T T.81 annex H. With a left, b above, c above left, the predictors 1 to 7 are a, b, c, a +
//! b - c, a + (b - c)/2, b + (a - c)/2, (a + b)/2; the first row takes a, the first column b, the
//! first pixel half the range. A code gives the number of bits of the difference, which follow it.

use super::marker::{Segments, frame};
use super::{CodecError, Size};

/// Decodes a frame of one component and the given size; returns the stored values.
pub(in crate::dicom) fn decode(bytes: &[u8], size: Size) -> Result<Vec<u16>, CodecError> {
    let mut segments = Segments::of(bytes)?;
    let mut tables: [Option<Table>; 4] = [const { None }; 4];
    let (mut known, mut restart) = (None, 0);
    loop {
        let segment = segments.next()?;
        match segment.marker {
            0xc3 => known = Some(frame(segment.body, size)?),
            0xc4 => read_tables(segment.body, &mut tables)?,
            0xdd => restart = segment.body.iter().fold(0, |n, &b| n << 8 | usize::from(b)),
            0xda => {
                let &[1, _, table, predictor, _, shift] = segment.body else {
                    return Err(CodecError::Wrong("only scans of one component are read"));
                };
                let (rows, columns) = size;
                let precision = known.ok_or(CodecError::Wrong("the frame header (SOF3) is missing"))?;
                let table = tables.get(usize::from(table >> 4)).and_then(Option::as_ref);
                let table = table.ok_or(CodecError::Wrong("a Huffman table is missing"))?;
                let shift = u32::from(shift & 15);
                if !(1..=7).contains(&predictor) || shift >= precision {
                    return Err(CodecError::Wrong("the predictor must be 1 to 7"));
                }
                let scan = Scan { columns, predictor, half: 1 << (precision - shift - 1), restart, table };
                let mut pixels = scan.pixels(&mut Bits::of(segments.rest()), rows * columns)?;
                pixels.iter_mut().for_each(|p| *p <<= shift);
                return Ok(pixels);
            }
            0xc0..=0xcf => return Err(CodecError::Wrong("it is another kind of JPEG")),
            0xd9 => return Err(CodecError::Short(0)),
            _ => {}
        }
    }
}

struct Scan<'a> {
    columns: usize,
    predictor: u8,
    /// Prediction of the first pixel: half the range.
    half: u16,
    /// Pixels between restarts; 0 for none.
    restart: usize,
    table: &'a Table,
}

impl Scan<'_> {
    fn pixels(&self, bits: &mut Bits, count: usize) -> Result<Vec<u16>, CodecError> {
        let mut pixels: Vec<u16> = Vec::new();
        let mut first = 0;
        for at in 0..count {
            if self.restart > 0 && at > 0 && at % self.restart == 0 {
                bits.next_restart().ok_or(CodecError::Short(at))?;
                first = at;
            }
            let difference = self.table.difference(bits).ok_or(CodecError::Short(at))?;
            pixels.push(self.predicted(&pixels, at, first).wrapping_add(difference));
        }
        Ok(pixels)
    }

    /// `first` is where the scan started or restarted: the row from there has no row above.
    fn predicted(&self, pixels: &[u16], at: usize, first: usize) -> u16 {
        if at == first {
            return self.half;
        }
        let left_border = at.is_multiple_of(self.columns);
        if at < first + self.columns && !left_border {
            return pixels[at - 1];
        }
        let above = pixels[at - self.columns];
        if left_border {
            return above;
        }
        let (a, b, c) = (i32::from(pixels[at - 1]), i32::from(above), i32::from(pixels[at - self.columns - 1]));
        let predicted = match self.predictor {
            1 => a,
            2 => b,
            3 => c,
            4 => a + b - c,
            5 => a + ((b - c) >> 1),
            6 => b + ((a - c) >> 1),
            _ => (a + b) >> 1,
        };
        predicted as u16
    }
}

/// A Huffman table: for each length the first code, and where its symbols start.
struct Table {
    /// First code of each length, and one past the last.
    first: [u32; 17],
    end: [u32; 17],
    start: [usize; 17],
    symbols: Vec<u8>,
}

fn read_tables(mut body: &[u8], tables: &mut [Option<Table>; 4]) -> Result<(), CodecError> {
    while let Some((&head, rest)) = body.split_first() {
        let (counts, rest) = rest.split_at_checked(16).ok_or(CodecError::Short(0))?;
        let count = counts.iter().map(|&n| usize::from(n)).sum();
        let (symbols, rest) = rest.split_at_checked(count).ok_or(CodecError::Short(0))?;
        let place = tables.get_mut(usize::from(head)).ok_or(CodecError::Wrong("a Huffman table has a wrong number"))?;
        *place = Some(Table::of(counts, symbols));
        body = rest;
    }
    Ok(())
}

impl Table {
    fn of(counts: &[u8], symbols: &[u8]) -> Self {
        let mut table = Self { first: [0; 17], end: [0; 17], start: [0; 17], symbols: symbols.into() };
        let (mut code, mut start) = (0, 0);
        for length in 1..=16 {
            let count = counts[length - 1];
            (table.first[length], table.start[length]) = (code, start);
            code += u32::from(count);
            start += usize::from(count);
            table.end[length] = code;
            code <<= 1;
        }
        table
    }

    /// Decodes the next difference: a code for its number of bits, then the bits.
    fn difference(&self, bits: &mut Bits) -> Option<u16> {
        let mut code = 0;
        for length in 1..=16 {
            code = code << 1 | bits.bit()?;
            if code < self.end[length] && code >= self.first[length] {
                let symbol = *self.symbols.get(self.start[length] + (code - self.first[length]) as usize)?;
                return match symbol {
                    0 => Some(0),
                    16 => Some(1 << 15),
                    1..16 => {
                        let value = bits.take(symbol.into())?;
                        let negative = value >> (symbol - 1) == 0;
                        Some(if negative { (value as u16).wrapping_sub((1 << symbol) - 1) } else { value as u16 })
                    }
                    _ => None,
                };
            }
        }
        None
    }
}

/// Bits of a scan, highest first; after a byte of 255, a 0 is stuffing and anything else a marker.
struct Bits<'a> {
    bytes: &'a [u8],
    at: usize,
    held: u32,
    count: u32,
}

impl<'a> Bits<'a> {
    fn of(bytes: &'a [u8]) -> Self {
        Self { bytes, at: 0, held: 0, count: 0 }
    }

    fn bit(&mut self) -> Option<u32> {
        if self.count == 0 {
            let byte = *self.bytes.get(self.at)?;
            self.at += 1;
            if byte == 0xff {
                if self.bytes.get(self.at) != Some(&0) {
                    return None;
                }
                self.at += 1;
            }
            (self.held, self.count) = (byte.into(), 8);
        }
        self.count -= 1;
        Some(self.held >> self.count & 1)
    }

    fn take(&mut self, count: u32) -> Option<u32> {
        (0..count).try_fold(0, |value, _| Some(value << 1 | self.bit()?))
    }

    /// Skips the rest of a byte and the restart marker.
    fn next_restart(&mut self) -> Option<()> {
        self.count = 0;
        let marker = self.bytes.get(self.at..self.at + 2)?;
        self.at += 2;
        (marker[0] == 0xff && (0xd0..=0xd7).contains(&marker[1])).then_some(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[derive(Default)]
    struct Writer {
        held: u32,
        count: u32,
    }

    impl Writer {
        fn push(&mut self, out: &mut Vec<u8>, value: u32, bits: u32) {
            for n in (0..bits).rev() {
                (self.held, self.count) = (self.held << 1 | (value >> n & 1), self.count + 1);
                if self.count == 8 {
                    out.push(self.held as u8);
                    out.extend((self.held as u8 == 0xff).then_some(0));
                    (self.held, self.count) = (0, 0);
                }
            }
        }

        /// Pads a started byte with ones.
        fn fill(&mut self, out: &mut Vec<u8>) {
            while self.count > 0 {
                self.push(out, 1, 1);
            }
        }
    }

    /// Encodes with a table whose codes are the 5-bit lengths, any predictor, and optional restarts
    /// every row.
    fn encoded(pixels: &[u16], columns: usize, predictor: u8, restart: bool) -> Vec<u8> {
        let rows = pixels.len() / columns;
        let mut out = vec![0xff, 0xd8, 0xff, 0xc4, 0, 19 + 17, 0];
        out.extend([0, 0, 0, 0, 17, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0]);
        out.extend(0..=16);
        out.extend([0xff, 0xc3, 0, 11, 16, 0, rows as u8, 0, columns as u8, 1, 1, 0x11, 0]);
        if restart {
            out.extend([0xff, 0xdd, 0, 4, 0, columns as u8]);
        }
        out.extend([0xff, 0xda, 0, 8, 1, 1, 0, predictor, 0, 0]);
        let table = Table::of(&[0; 16], &[]);
        let scan = Scan { columns, predictor, half: 1 << 15, restart: 0, table: &table };
        let mut writer = Writer::default();
        let mut first = 0;
        for at in 0..pixels.len() {
            if restart && at > 0 && at % columns == 0 {
                writer.fill(&mut out);
                out.extend([0xff, 0xd0 + ((at / columns - 1) % 8) as u8]);
                first = at;
            }
            let difference = pixels[at].wrapping_sub(scan.predicted(pixels, at, first)) as i16;
            let size = if difference == i16::MIN { 16 } else { 16 - difference.unsigned_abs().leading_zeros() };
            writer.push(&mut out, size, 5);
            let low = if difference < 0 { difference.wrapping_sub(1) } else { difference };
            if size < 16 {
                writer.push(&mut out, low as u16 as u32 & ((1 << size) - 1), size);
            }
        }
        writer.fill(&mut out);
        out.extend([0xff, 0xd9]);
        out
    }

    proptest! {
        #[test]
        fn encoding_round_trips(pixels in prop::collection::vec(any::<u16>(), 42), predictor in 1u8..8, restart in any::<bool>()) {
            let bytes = encoded(&pixels, 7, predictor, restart);
            prop_assert_eq!(decode(&bytes, (6, 7)), Ok(pixels));
            for length in 0..bytes.len() - 3 {
                prop_assert!(decode(&bytes[..length], (6, 7)).is_err());
            }
        }
    }
}
