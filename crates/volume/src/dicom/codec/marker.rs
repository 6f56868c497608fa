//! Parses the marker segments of JPEG and JPEG-LS streams (ITU-T T.81 annex B).

use super::{CodecError, Size};

/// A segment: its marker's second byte and its body.
pub(super) struct Segment<'a> {
    pub marker: u8,
    pub body: &'a [u8],
}

/// Iterates over segments up to the scan data.
pub(super) struct Segments<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Segments<'a> {
    /// Starts at the start-of-image marker.
    pub fn of(bytes: &'a [u8]) -> Result<Self, CodecError> {
        match bytes.starts_with(&[0xff, 0xd8]) {
            true => Ok(Self { bytes, at: 2 }),
            false => Err(CodecError::Wrong("it does not start with the marker SOI")),
        }
    }

    /// The next segment.
    pub fn next(&mut self) -> Result<Segment<'a>, CodecError> {
        let cut = CodecError::Short(0);
        while self.bytes.get(self.at) == Some(&0xff) && self.bytes.get(self.at + 1) == Some(&0xff) {
            self.at += 1;
        }
        let &[0xff, marker, high, low] = self.bytes.get(self.at..self.at + 4).ok_or(cut)? else {
            return Err(CodecError::Wrong("a marker is missing"));
        };
        let end = self.at + 2 + usize::from(u16::from_be_bytes([high, low]));
        let body = self.bytes.get(self.at + 4..end).ok_or(cut)?;
        self.at = end;
        Ok(Segment { marker, body })
    }

    /// The bytes after the segments read so far.
    pub fn rest(&self) -> &'a [u8] {
        &self.bytes[self.at.min(self.bytes.len())..]
    }
}

/// Precision in a frame header with one component and the expected size.
pub(super) fn frame(body: &[u8], size: Size) -> Result<u32, CodecError> {
    let &[precision, y1, y0, x1, x0, components, ..] = body else { return Err(CodecError::Short(0)) };
    if components != 1 || !(2..=16).contains(&precision) {
        return Err(CodecError::Wrong("only one component of 2 to 16 bits is read"));
    }
    let (rows, columns) = (usize::from(u16::from_be_bytes([y1, y0])), usize::from(u16::from_be_bytes([x1, x0])));
    match (rows, columns) == size {
        true => Ok(precision.into()),
        false => Err(CodecError::Size(rows, columns)),
    }
}
