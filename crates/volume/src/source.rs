//! Reads a plain or compressed file without trusting the sizes in its header.
//!
//! # Practice
//! Compression is detected by content. A file can hold at most its own length or, compressed, that
//! length times deflate's limit of 1032. Larger requests are rejected before allocation, and memory
//! grows only with the data received.

use crate::sample::{ByteOrder, Number, Sample, Scale};
use crate::{Note, ReadError, VoxelVolume, open_regular, room_for_voxels};
use flate2::bufread::GzDecoder;
use flate2::read::ZlibDecoder;
use glam::{DAffine3, DVec3};
use std::io::{self, BufRead, BufReader, Cursor, Read};
use std::path::{Path, PathBuf};

/// First bytes of a gzip file.
const GZIP: [u8; 2] = [0x1f, 0x8b];

/// Largest compression ratio of a deflate stream.
const DEFLATE_LIMIT: u64 = 1032;

/// Longest line of a header, bytes.
const LONGEST_LINE: usize = 1 << 16;

/// Memory needed while reading, bytes per voxel: its values and data derived from them.
pub(crate) const BYTES_PER_VOXEL: u64 = 8;

/// Bytes decoded at a time; a multiple of every number's size.
const CHUNK: usize = 1 << 16;

/// A file read from front to back.
pub(crate) struct Source {
    file: PathBuf,
    stream: Box<dyn Read>,
    /// Bytes peeked but not consumed.
    ahead: Vec<u8>,
    compressed: bool,
    /// Most bytes that can still be read.
    left: u64,
    taken: u64,
}

impl Source {
    /// Opens a file and detects gzip.
    pub fn open(path: &Path) -> Result<Self, ReadError> {
        let mut plain = Self::open_plain(path)?;
        let gzip = plain.peek(2)? == GZIP;
        Ok(if gzip { plain.gunzipped() } else { plain })
    }

    /// Opens a file without decompression.
    pub fn open_plain(path: &Path) -> Result<Self, ReadError> {
        let io = |source| ReadError::Io { file: path.into(), source };
        let file = open_regular(path).map_err(|source| match source.kind() {
            io::ErrorKind::NotFound => ReadError::Missing { file: path.into() },
            _ => io(source),
        })?;
        let length = file.metadata().map_err(io)?.len();
        Ok(Self::of_stream(path, Box::new(BufReader::with_capacity(CHUNK, file)), length))
    }

    /// A source from bytes in memory; `name` appears in messages.
    #[cfg(test)]
    pub fn of_bytes(name: &Path, bytes: Vec<u8>) -> Self {
        let (length, gzip) = (bytes.len() as u64, bytes.starts_with(&GZIP));
        let plain = Self::of_stream(name, Box::new(Cursor::new(bytes)), length);
        if gzip { plain.gunzipped() } else { plain }
    }

    fn of_stream(file: &Path, stream: Box<dyn Read>, length: u64) -> Self {
        Self { file: file.into(), stream, ahead: Vec::new(), compressed: false, left: length, taken: 0 }
    }

    /// Splits off the remaining bytes as a separate source.
    pub fn take_rest(&mut self) -> Self {
        let rest = Self::of_stream(&self.file, Box::new(io::empty()), 0);
        std::mem::replace(self, rest)
    }

    /// The remaining bytes, decompressed as gzip.
    pub fn gunzipped(self) -> Self {
        self.unpacked(|stream| Box::new(Gunzip(Some(GzDecoder::new(BufReader::with_capacity(CHUNK, stream))))))
    }

    /// The remaining bytes, decompressed as gzip or zlib by content.
    pub fn unpacked_by_content(mut self) -> Result<Self, ReadError> {
        let gzip = self.peek(2)? == GZIP;
        Ok(if gzip { self.gunzipped() } else { self.unpacked(|stream| Box::new(ZlibDecoder::new(stream))) })
    }

    fn unpacked(self, unpack: impl FnOnce(Box<dyn Read>) -> Box<dyn Read>) -> Self {
        let left = self.left.saturating_mul(DEFLATE_LIMIT);
        let packed: Box<dyn Read> = Box::new(Cursor::new(self.ahead).chain(self.stream));
        Self { file: self.file, stream: unpack(packed), ahead: Vec::new(), compressed: true, left, taken: 0 }
    }

    /// The file's path.
    pub fn file(&self) -> &Path {
        &self.file
    }

    /// How the bytes are packed, for the facts of an import.
    pub fn packing(&self) -> String {
        if self.compressed { "gzip" } else { "none" }.into()
    }

    /// Bytes consumed so far.
    pub fn taken(&self) -> u64 {
        self.taken
    }

    /// Most bytes that can still be read.
    pub fn left(&self) -> u64 {
        self.left
    }

    /// Peeks at up to `count` bytes without consuming them.
    pub fn peek(&mut self, count: usize) -> Result<&[u8], ReadError> {
        let mut more = vec![0; count.saturating_sub(self.ahead.len())];
        let got = self.pull(&mut more)?;
        self.ahead.extend_from_slice(&more[..got]);
        Ok(&self.ahead[..count.min(self.ahead.len())])
    }

    /// Reads up to the whole of `buffer`; returns the number of bytes read.
    pub fn some(&mut self, buffer: &mut [u8]) -> Result<usize, ReadError> {
        let known = self.ahead.len().min(buffer.len());
        buffer[..known].copy_from_slice(&self.ahead[..known]);
        self.ahead.drain(..known);
        let got = known + self.pull(&mut buffer[known..])?;
        self.taken += got as u64;
        self.left = self.left.saturating_sub(got as u64);
        Ok(got)
    }

    fn pull(&mut self, buffer: &mut [u8]) -> Result<usize, ReadError> {
        read_up_to(&mut self.stream, buffer).map_err(|source| match (self.compressed, source.kind()) {
            (true, io::ErrorKind::UnexpectedEof) => {
                let compressed = io::Error::other("they end in the middle");
                ReadError::Compression { file: self.file.clone(), source: compressed }
            }
            (true, _) => ReadError::Compression { file: self.file.clone(), source },
            (false, _) => ReadError::Io { file: self.file.clone(), source },
        })
    }

    /// Reads a line of text without its end; `None` at the end of the file.
    pub fn line(&mut self) -> Result<Option<String>, ReadError> {
        let mut line = Vec::new();
        let mut byte = [0];
        while self.some(&mut byte)? == 1 {
            match byte[0] {
                b'\n' => return Ok(Some(text_of(line))),
                _ if line.len() >= LONGEST_LINE => {
                    return Err(self.field("the header", "a line of more than 64 KiB", "fetch the file again"));
                }
                other => line.push(other),
            }
        }
        Ok((!line.is_empty()).then(|| text_of(line)))
    }

    /// Parses numbers in text, separated by white space or commas.
    pub fn written_samples(&mut self, count: u64) -> Result<Vec<f32>, ReadError> {
        let mut values = Vec::new();
        while (values.len() as u64) < count {
            let Some(line) = self.line()? else { break };
            let words = line.split(|c: char| c.is_whitespace() || c == ',').filter(|w| !w.is_empty());
            for word in words.take(count as usize - values.len()) {
                let wrong = || self.field("the voxels", format!("{word:?}"), "only numbers may stand there");
                values.push(word.parse().map_err(|_| wrong())?);
            }
        }
        match values.len() as u64 == count {
            true => Ok(values),
            false => Err(self.truncated("voxels", count, values.len() as u64)),
        }
    }

    /// Skips all but the last `count` bytes.
    pub fn skip_to_last(&mut self, count: u64) -> Result<(), ReadError> {
        if !self.compressed {
            return match self.left.checked_sub(count) {
                Some(before) => self.skip(before, "bytes before the voxels"),
                None => Err(self.truncated("voxels", count, self.left)),
            };
        }
        let mut all = Vec::new();
        let mut buffer = vec![0; CHUNK];
        loop {
            let got = self.some(&mut buffer)?;
            all.extend_from_slice(&buffer[..got]);
            if got < buffer.len() {
                break;
            }
            // Only the last bytes matter; earlier ones are discarded.
            if all.len() as u64 > count.saturating_mul(2) + CHUNK as u64 {
                all.drain(..all.len() - count as usize);
            }
        }
        let found = all.len() as u64;
        let Some(before) = found.checked_sub(count) else { return Err(self.truncated("voxels", count, found)) };
        self.ahead = all.split_off(before as usize);
        self.left = count;
        Ok(())
    }

    /// Reads exactly `N` bytes of a header.
    pub fn header<const N: usize>(&mut self) -> Result<[u8; N], ReadError> {
        let mut bytes = [0; N];
        match self.some(&mut bytes)? {
            got if got == N => Ok(bytes),
            got => Err(self.truncated("header", N as u64, got as u64)),
        }
    }

    /// Skips bytes.
    pub fn skip(&mut self, count: u64, what: &'static str) -> Result<(), ReadError> {
        let mut buffer = [0; 4096];
        let mut left = count;
        while left > 0 {
            let wanted = left.min(buffer.len() as u64) as usize;
            match self.some(&mut buffer[..wanted])? {
                0 => return Err(self.truncated(what, count, count - left)),
                got => left -= got as u64,
            }
        }
        Ok(())
    }

    /// Decodes the `count` numbers of one volume of several, a part at a time.
    pub fn samples<T: Sample>(
        &mut self,
        part: Part,
        count: u64,
        number: Number,
        order: ByteOrder,
        scale: Scale,
    ) -> Result<Vec<T>, ReadError> {
        let needed = count.saturating_mul(part.of).saturating_mul(number.bytes() as u64);
        if needed > self.left {
            return Err(self.truncated("voxels", needed, self.left));
        }
        if part.of > 1 && part.run == count {
            self.skip(needed / part.of * part.chosen, "voxels")?;
            return self.samples(Part::WHOLE, count, number, order, scale);
        }
        let mut values = Vec::new();
        if !self.compressed {
            values.reserve_exact(count as usize);
        }
        let mut buffer = vec![0; CHUNK.min(needed as usize)];
        let mut decoded = Vec::with_capacity(buffer.len() / number.bytes());
        let mut left = needed;
        let mut first = 0;
        while left > 0 {
            let wanted = left.min(buffer.len() as u64) as usize;
            let got = self.some(&mut buffer[..wanted])?;
            if got < wanted {
                return Err(self.truncated("voxels", needed, needed - left + got as u64));
            }
            grow(&mut values, wanted / number.bytes(), count as usize);
            decoded.clear();
            number.decode(&buffer[..wanted], order, scale, &mut decoded);
            part.keep(&mut decoded, first);
            values.extend(decoded.iter().map(|&value| T::from_f32(value)));
            first += (wanted / number.bytes()) as u64;
            left -= wanted as u64;
        }
        Ok(values)
    }

    /// Reads compressed data to the end, at most 16 MiB more, so that the checksum is verified.
    pub fn check_end(&mut self) -> Result<(), ReadError> {
        if self.compressed {
            let mut buffer = vec![0; CHUNK];
            for _ in 0..256 {
                if self.some(&mut buffer)? < buffer.len() {
                    break;
                }
            }
        }
        Ok(())
    }

    /// The error for a part that ends early.
    pub fn truncated(&self, what: &'static str, expected: u64, found: u64) -> ReadError {
        ReadError::Truncated { file: self.file.clone(), what, expected, found }
    }

    /// The error for a field.
    pub fn field(&self, field: &'static str, found: impl ToString, remedy: &'static str) -> ReadError {
        ReadError::Field { file: self.file.clone(), field, found: shown(&found.to_string()), remedy }
    }

    /// Checks the sizes in a header; returns the number of voxels or an error.
    pub fn voxels(&self, field: &'static str, dims: [i64; 3]) -> Result<u64, ReadError> {
        let wrong = || ReadError::Dimensions { file: self.file.clone(), field, found: format!("{dims:?}") };
        if !dims.iter().all(|&n| (2..=1 << 20).contains(&n)) {
            return Err(wrong());
        }
        let count = dims.iter().map(|&n| n as u64).product();
        let file = self.file.clone();
        room_for_voxels(count, BYTES_PER_VOXEL).map_err(|source| ReadError::TooLarge { file, field, source })?;
        Ok(count)
    }

    /// Checks an affine and assembles the volume.
    pub fn volume<T>(
        &self,
        dims: [i64; 3],
        data: Vec<T>,
        field: &'static str,
        world_from_voxel: DAffine3,
    ) -> Result<VoxelVolume<T>, ReadError> {
        check_affine(&self.file, field, world_from_voxel)?;
        Ok(VoxelVolume { dims: dims.map(|n| n as usize), data, world_from_voxel })
    }
}

/// One volume of several in a file: runs of `run` numbers belong to volumes 0, 1, … `of - 1`, 0, ….
#[derive(Clone, Copy)]
pub(crate) struct Part {
    pub run: u64,
    pub of: u64,
    pub chosen: u64,
}

impl Part {
    pub const WHOLE: Self = Self { run: u64::MAX, of: 1, chosen: 0 };

    /// The volume of a number among `of`, which `field` announces; without a number there is only
    /// one.
    pub fn numbered(
        file: &Path,
        field: &'static str,
        (run, of): (u64, u64),
        number: Option<usize>,
    ) -> Result<(Self, Option<Note>), ReadError> {
        let wrong = |remedy| ReadError::Volumes { file: file.into(), field, found: of, remedy };
        let chosen = match number {
            None if of == 1 => 0,
            None => return Err(wrong("one must be chosen: give --ct-series N or --mri-series N, from 0")),
            Some(n) if (n as u64) < of => n as u64,
            Some(n) if of == 1 => {
                let found = format!("there is no volume {n}: it holds one, number 0");
                return Err(ReadError::Series { folder: file.into(), found, remedy: "leave the number out" });
            }
            Some(_) => return Err(wrong("numbers go from 0 to one less")),
        };
        let note = Note::OneOf { what: "volumes", count: of as usize, chosen: chosen as usize };
        Ok((Self { run, of, chosen }, (of > 1).then_some(note)))
    }

    /// Drops what belongs to other volumes from values, the first being number `first`.
    pub fn keep(self, values: &mut Vec<f32>, first: u64) {
        if self.of > 1 {
            let mut numbers = first..;
            values.retain(|_| numbers.next().is_some_and(|n| n / self.run % self.of == self.chosen));
        }
    }
}

/// Gunzips members one after another and ignores what follows them, as gzip(1) does.
struct Gunzip(Option<GzDecoder<BufReader<Box<dyn Read>>>>);

impl Read for Gunzip {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        while let Some(mut member) = self.0.take() {
            let got = member.read(buffer)?;
            if got > 0 || buffer.is_empty() {
                self.0 = Some(member);
                return Ok(got);
            }
            let mut rest = member.into_inner();
            if rest.fill_buf()?.first() == Some(&GZIP[0]) {
                self.0 = Some(GzDecoder::new(rest));
            }
        }
        Ok(0)
    }
}

/// Truncates a value for a message to one short line, since the rest of a damaged header may hold
/// patient data.
pub(crate) fn shown(found: &str) -> String {
    found.chars().take_while(|c| !c.is_control() && *c != '\\').take(64).collect()
}

/// Reserves room for `more` values: doubles the capacity, up to `limit` in all.
fn grow<T>(values: &mut Vec<T>, more: usize, limit: usize) {
    if values.capacity() - values.len() < more {
        let wanted = (2 * values.len()).max(values.len() + more).min(limit.max(values.len() + more));
        values.reserve_exact(wanted - values.len());
    }
}

fn text_of(mut line: Vec<u8>) -> String {
    if line.last() == Some(&b'\r') {
        line.pop();
    }
    String::from_utf8_lossy(&line).into_owned()
}

fn read_up_to(stream: &mut impl Read, buffer: &mut [u8]) -> io::Result<usize> {
    let mut got = 0;
    while got < buffer.len() {
        match stream.read(&mut buffer[got..]) {
            Ok(0) => break,
            Ok(n) => got += n,
            Err(e) if e.kind() == io::ErrorKind::Interrupted => {}
            Err(e) => return Err(e),
        }
    }
    Ok(got)
}

/// Rejects implausible axes: not finite, degenerate, edges outside 0.0001 to 1000 mm, or over 10 m
/// away.
pub(crate) fn check_affine(file: &Path, field: &'static str, affine: DAffine3) -> Result<(), ReadError> {
    let m = affine.matrix3;
    let edges = DVec3::new(m.x_axis.length(), m.y_axis.length(), m.z_axis.length());
    if !(edges.cmpge(DVec3::splat(1e-4)).all() && edges.cmple(DVec3::splat(1e3)).all()) {
        return Err(ReadError::Spacing { file: file.into(), field, found: edges.to_string() });
    }
    let upright = m.determinant().abs() / edges.element_product();
    let near = affine.translation.abs().cmple(DVec3::splat(1e4)).all();
    match upright > 1e-3 && near {
        true => Ok(()),
        false => Err(ReadError::Orientation { file: file.into(), field, found: format!("{affine}") }),
    }
}
