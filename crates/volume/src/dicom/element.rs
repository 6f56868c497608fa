//! Traverses the data elements of a DICOM file.
//!
//! # Theory
//! PS3.5 of the standard: an element is a tag (group, element), in explicit syntaxes a value
//! representation (VR) of two letters, a length, and the value. Sequences contain items that
//! contain elements; a length of 0xFFFFFFFF means "until the delimiter".

use crate::sample::ByteOrder;

/// A tag as one number: group · 65536 + element.
pub(super) type Tag = u32;

/// The voxels.
pub(super) const PIXEL_DATA: Tag = 0x7fe0_0010;

const ITEM: Tag = 0xfffe_e000;
const ITEM_END: Tag = 0xfffe_e00d;
const SEQUENCE_END: Tag = 0xfffe_e0dd;
const UNDEFINED: u32 = u32::MAX;

/// Deepest nesting of sequences that is read.
const DEEPEST: usize = 12;

/// VRs with a four-byte length after two reserved bytes.
const LONG: [&[u8; 2]; 12] = [b"OB", b"OD", b"OF", b"OL", b"OV", b"OW", b"SQ", b"SV", b"UC", b"UN", b"UR", b"UT"];

/// Sequences also parsed in implicit syntax with a given length: functional groups, segments and
/// their parts.
const SEQUENCES: [Tag; 8] =
    [0x5200_9229, 0x5200_9230, 0x0020_9113, 0x0020_9116, 0x0028_9110, 0x0028_9145, 0x0062_0002, 0x0062_000a];

/// Encoding of the elements.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Syntax {
    pub explicit: bool,
    pub order: ByteOrder,
}

/// A value found during traversal.
pub(super) struct Element<'a> {
    pub tag: Tag,
    pub value: &'a [u8],
    pub order: ByteOrder,
    /// Its outermost sequence and item number there.
    pub within: Option<(Tag, usize)>,
}

/// The voxels as they are stored.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Pixels {
    /// A byte range.
    Plain(std::ops::Range<usize>),
    /// Fragments of a compressed stream; the first is the offset table.
    Fragments(Vec<std::ops::Range<usize>>),
}

/// Why a traversal ended early.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Broken {
    pub at: usize,
}

/// A traversal of a file's bytes.
pub(super) struct Walk<'a> {
    pub bytes: &'a [u8],
    pub at: usize,
    pub syntax: Syntax,
    pub pixels: Option<Pixels>,
}

impl<'a> Walk<'a> {
    /// Calls `visit` for every value outside private groups.
    pub fn run(&mut self, visit: &mut dyn FnMut(Element<'a>)) -> Result<(), Broken> {
        self.elements(self.bytes.len(), 0, None, visit)
    }

    /// The next element, which must not be a sequence.
    pub fn plain_element(&mut self) -> Result<Element<'a>, Broken> {
        let (tag, _, length) = self.head()?;
        Ok(Element { tag, value: self.take(length)?, order: self.syntax.order, within: None })
    }

    fn elements(
        &mut self,
        end: usize,
        depth: usize,
        within: Option<(Tag, usize)>,
        visit: &mut dyn FnMut(Element<'a>),
    ) -> Result<(), Broken> {
        while self.at < end.min(self.bytes.len()) {
            let start = self.at;
            let (tag, vr, length) = self.head()?;
            if tag == ITEM_END || tag == SEQUENCE_END {
                return Ok(());
            }
            if tag == PIXEL_DATA && depth == 0 {
                self.pixels = Some(self.pixels(length)?);
                continue;
            }
            let sequence = length == UNDEFINED || vr == Some(*b"SQ") || (vr.is_none() && SEQUENCES.contains(&tag));
            if sequence {
                if depth >= DEEPEST {
                    return Err(Broken { at: start });
                }
                let unknown = vr == Some(*b"UN");
                let known = self.syntax;
                if unknown {
                    self.syntax = Syntax { explicit: false, order: ByteOrder::Little };
                }
                self.items(tag, length, depth, within, visit)?;
                self.syntax = known;
                continue;
            }
            let value = self.take(length)?;
            if tag >> 16 & 1 == 0 {
                visit(Element { tag, value, order: self.syntax.order, within });
            }
        }
        Ok(())
    }

    fn items(
        &mut self,
        sequence: Tag,
        length: u32,
        depth: usize,
        within: Option<(Tag, usize)>,
        visit: &mut dyn FnMut(Element<'a>),
    ) -> Result<(), Broken> {
        let end = self.end_of(length)?;
        let mut number = 0;
        while self.at < end {
            let (tag, _, length) = self.head()?;
            match tag {
                SEQUENCE_END => break,
                ITEM => {
                    let end = self.end_of(length)?;
                    self.elements(end, depth + 1, within.or(Some((sequence, number))), visit)?;
                    number += 1;
                }
                _ => return Err(Broken { at: self.at }),
            }
        }
        Ok(())
    }

    fn pixels(&mut self, length: u32) -> Result<Pixels, Broken> {
        if length != UNDEFINED {
            let start = self.at;
            let end = start.saturating_add(length as usize);
            self.at = end.min(self.bytes.len());
            return Ok(Pixels::Plain(start..end));
        }
        let mut fragments = Vec::new();
        while self.at < self.bytes.len() {
            let (tag, _, length) = self.head()?;
            if tag == SEQUENCE_END {
                break;
            }
            let start = self.at;
            self.take(length).ok().filter(|_| tag == ITEM).ok_or(Broken { at: start })?;
            fragments.push(start..self.at);
        }
        Ok(Pixels::Fragments(fragments))
    }

    /// Tag, VR and length; in explicit syntaxes items and delimiters have no VR.
    fn head(&mut self) -> Result<(Tag, Option<[u8; 2]>, u32), Broken> {
        let (group, element) = (self.u16()?, self.u16()?);
        let tag = u32::from(group) << 16 | u32::from(element);
        if group == 0xfffe || !self.syntax.explicit {
            return Ok((tag, None, self.u32()?));
        }
        let vr = self.array::<2>()?;
        let length = if LONG.contains(&&vr) || vr == *b"UV" {
            self.u16()?;
            self.u32()?
        } else {
            self.u16()?.into()
        };
        Ok((tag, Some(vr), length))
    }

    fn end_of(&self, length: u32) -> Result<usize, Broken> {
        match length {
            UNDEFINED => Ok(self.bytes.len()),
            n => self.at.checked_add(n as usize).filter(|&end| end <= self.bytes.len()).ok_or(Broken { at: self.at }),
        }
    }

    fn take(&mut self, length: u32) -> Result<&'a [u8], Broken> {
        let end = self.at.saturating_add(length as usize);
        let value = self.bytes.get(self.at..end).ok_or(Broken { at: self.at })?;
        self.at = end;
        Ok(value)
    }

    fn array<const N: usize>(&mut self) -> Result<[u8; N], Broken> {
        let value = self.take(N as u32)?;
        value.try_into().map_err(|_| Broken { at: self.at })
    }

    fn u16(&mut self) -> Result<u16, Broken> {
        let raw = self.array()?;
        Ok(if self.syntax.order == ByteOrder::Big { u16::from_be_bytes(raw) } else { u16::from_le_bytes(raw) })
    }

    fn u32(&mut self) -> Result<u32, Broken> {
        let raw = self.array()?;
        Ok(if self.syntax.order == ByteOrder::Big { u32::from_be_bytes(raw) } else { u32::from_le_bytes(raw) })
    }
}

impl Element<'_> {
    /// The first number of a value of VR US.
    pub fn u16(&self) -> Option<u16> {
        let raw = self.value.get(..2)?.try_into().ok()?;
        Some(if self.order == ByteOrder::Big { u16::from_be_bytes(raw) } else { u16::from_le_bytes(raw) })
    }

    /// The numbers of a value of VR DS or IS, also with decimal commas; empty where one cannot be
    /// read.
    pub fn numbers(&self) -> Vec<f64> {
        let text = self.text().replace(',', ".");
        let numbers: Option<Vec<f64>> = text.split('\\').take(64).map(|part| part.trim().parse().ok()).collect();
        numbers.unwrap_or_default()
    }

    /// Most decimals that a number of a DS value is written with; many for an exponent.
    pub fn decimals(&self) -> usize {
        let of = |part: &str| match part.contains(['e', 'E']) {
            true => 16,
            false => part.trim().split_once(['.', ',']).map_or(0, |(_, decimals)| decimals.len()),
        };
        self.text().split('\\').map(of).max().unwrap_or(0)
    }

    /// What numbers are written with of the value, for messages; nothing of a patient passes.
    pub fn written(&self) -> String {
        self.text().chars().filter(|c| c.is_ascii_digit() || "+-.,eE\\".contains(*c)).take(80).collect()
    }

    /// The value as text without its padding.
    pub fn text(&self) -> String {
        let end = self.value.len().min(1024);
        String::from_utf8_lossy(&self.value[..end]).trim_matches(|c: char| c == '\0' || c.is_whitespace()).to_owned()
    }
}
