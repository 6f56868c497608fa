//! Bytes of a file, plain or compressed, that are never trusted to be as many as a header says.
//!
//! # Practice
//! Compression is found by content. A file can honestly give at most its own length, or, compressed, that length times
//! deflate's limit of 1032; whatever asks for more is refused before memory is taken, and memory grows with what has
//! really arrived.

use crate::sample::{ByteOrder, Number, Scale};
use crate::{ReadError, VoxelVolume};
use flate2::read::{MultiGzDecoder, ZlibDecoder};
use glam::{DAffine3, DVec3};
use std::fs::File;
use std::io::{self, Cursor, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

/// No deflate stream unpacks to more than this many times its length.
const DEFLATE_LIMIT: u64 = 1032;

/// Bytes that are decoded at a time; a multiple of every number's size.
const CHUNK: usize = 1 << 16;

/// A file being read from front to back.
pub(crate) struct Source {
    file: PathBuf,
    stream: Box<dyn Read>,
    compressed: bool,
    /// Most bytes that can still come.
    left: u64,
    taken: u64,
}

impl Source {
    /// Opens a file and looks whether it is gzip.
    pub fn open(path: &Path) -> Result<Self, ReadError> {
        let io = |source| ReadError::Io { file: path.into(), source };
        let mut file = File::open(path).map_err(|source| match source.kind() {
            io::ErrorKind::NotFound => ReadError::Missing { file: path.into() },
            _ => io(source),
        })?;
        let kind = file.metadata().map_err(io)?;
        if !kind.is_file() {
            return Err(io(io::Error::other("it is not a regular file")));
        }
        let mut start = [0; 2];
        let got = read_up_to(&mut file, &mut start).map_err(io)?;
        file.seek(SeekFrom::Start(0)).map_err(io)?;
        let stream = Box::new(io::BufReader::with_capacity(CHUNK, file));
        Ok(Self::of_stream(path, stream, kind.len(), start[..got] == [0x1f, 0x8b]))
    }

    /// The same from bytes in memory; `name` stands in messages.
    pub fn of_bytes(name: &Path, bytes: Vec<u8>) -> Self {
        let (length, gzip) = (bytes.len() as u64, bytes.starts_with(&[0x1f, 0x8b]));
        Self::of_stream(name, Box::new(Cursor::new(bytes)), length, gzip)
    }

    fn of_stream(file: &Path, stream: Box<dyn Read>, length: u64, gzip: bool) -> Self {
        let plain = Self { file: file.into(), stream, compressed: false, left: length, taken: 0 };
        if gzip { plain.gunzipped() } else { plain }
    }

    /// What follows, unpacked as gzip.
    pub fn gunzipped(self) -> Self {
        self.unpacked(|stream| Box::new(MultiGzDecoder::new(stream)))
    }

    /// What follows, unpacked as zlib.
    pub fn inflated(self) -> Self {
        self.unpacked(|stream| Box::new(ZlibDecoder::new(stream)))
    }

    fn unpacked(self, unpack: impl FnOnce(Box<dyn Read>) -> Box<dyn Read>) -> Self {
        let left = self.left.saturating_mul(DEFLATE_LIMIT);
        Self { stream: unpack(self.stream), compressed: true, left, taken: 0, ..self }
    }

    /// The file's path.
    pub fn file(&self) -> &Path {
        &self.file
    }

    /// Bytes taken so far.
    pub fn taken(&self) -> u64 {
        self.taken
    }

    /// Most bytes that can still come.
    pub fn left(&self) -> u64 {
        self.left
    }

    /// Takes what is there, up to the whole of `buffer`; returns how much came.
    pub fn some(&mut self, buffer: &mut [u8]) -> Result<usize, ReadError> {
        let got = read_up_to(&mut self.stream, buffer).map_err(|source| match (self.compressed, source.kind()) {
            (true, io::ErrorKind::UnexpectedEof) => {
                let compressed = io::Error::other("they end in the middle");
                ReadError::Compression { file: self.file.clone(), source: compressed }
            }
            (true, _) => ReadError::Compression { file: self.file.clone(), source },
            (false, _) => ReadError::Io { file: self.file.clone(), source },
        })?;
        self.taken += got as u64;
        self.left = self.left.saturating_sub(got as u64);
        Ok(got)
    }

    /// Takes exactly `N` bytes of a header.
    pub fn header<const N: usize>(&mut self) -> Result<[u8; N], ReadError> {
        let mut bytes = [0; N];
        match self.some(&mut bytes)? {
            got if got == N => Ok(bytes),
            got => Err(self.truncated("header", N as u64, got as u64)),
        }
    }

    /// Passes over bytes.
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

    /// Decodes the next `count` numbers.
    pub fn samples(
        &mut self,
        count: u64,
        number: Number,
        order: ByteOrder,
        scale: Scale,
    ) -> Result<Vec<f32>, ReadError> {
        let needed = count.saturating_mul(number.bytes() as u64);
        if needed > self.left {
            return Err(self.truncated("voxels", needed, self.left));
        }
        let mut values = Vec::new();
        if !self.compressed {
            values.reserve_exact(count as usize);
        }
        let mut buffer = vec![0; CHUNK.min(needed as usize)];
        let mut left = needed;
        while left > 0 {
            let wanted = left.min(buffer.len() as u64) as usize;
            let got = self.some(&mut buffer[..wanted])?;
            if got < wanted {
                return Err(self.truncated("voxels", needed, needed - left + got as u64));
            }
            grow(&mut values, wanted / number.bytes(), count as usize);
            number.decode(&buffer[..wanted], order, scale, &mut values);
            left -= wanted as u64;
        }
        Ok(values)
    }

    /// Reads compressed data to their end, so that their checksum is compared. At most 16 MiB more.
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
        ReadError::Field { file: self.file.clone(), field, found: found.to_string(), remedy }
    }

    /// Checks sizes that a header gives: the number of voxels, or what is wrong with them.
    pub fn voxels(&self, field: &'static str, dims: [i64; 3]) -> Result<u64, ReadError> {
        let wrong = || ReadError::Dimensions { file: self.file.clone(), field, found: format!("{dims:?}") };
        match dims.iter().all(|&n| (2..=1 << 20).contains(&n)) {
            true => Ok(dims.iter().map(|&n| n as u64).product()),
            false => Err(wrong()),
        }
    }

    /// Checks an affine and puts the volume together.
    pub fn volume(
        &self,
        dims: [i64; 3],
        data: Vec<f32>,
        field: &'static str,
        world_from_voxel: DAffine3,
    ) -> Result<VoxelVolume<f32>, ReadError> {
        check_affine(&self.file, field, world_from_voxel)?;
        Ok(VoxelVolume { dims: dims.map(|n| n as usize), data, world_from_voxel })
    }
}

/// Makes room for `more` values: twice what is there, never more than the `limit` in all.
fn grow(values: &mut Vec<f32>, more: usize, limit: usize) {
    if values.capacity() - values.len() < more {
        let wanted = (2 * values.len()).max(values.len() + more).min(limit.max(values.len() + more));
        values.reserve_exact(wanted - values.len());
    }
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

/// Refuses axes that no scanner makes: not finite, flat, with edges outside 0.0001 to 1000 mm, or further than 10 m away.
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
