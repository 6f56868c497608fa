//! Common parts of the mesh file formats: errors, a bounds-checked reader and atomic writing.
//!
//! # Practice
//! A file is read as a whole. A count in a header is compared with the remaining bytes before
//! allocation, so that a header cannot request more than a few times the file's size. A new file is
//! written under a temporary name and then renamed.
//!
//! Every reader of tetrahedra ends in the same step: of elements with more nodes the corners stay,
//! a tetrahedron that is listed again counts once, and nodes without a tetrahedron go. [`Note`]
//! says so. STL, PLY, OBJ, VTK and VTU are written with `SPACE=RAS`, as 3D Slicer reads it;
//! `SPACE=LPS` turns x and y. A file that says neither is taken as RAS, but by 3D Slicer as LPS.

pub mod abaqus;
mod format;
pub mod gmsh;
mod list;
pub mod medit;
mod note;
mod numbered;
pub mod obj;
pub mod ply;
pub mod stl;
pub mod tetgen;
pub mod vtk;
pub mod vtu;

pub use format::Format;
pub use list::{
    SURFACE_FORMATS, VOLUME_FORMATS, import, import_among, import_surface, read, read_among, read_surface, write,
    write_among, write_surface,
};
pub use note::{Import, Note};

use crate::{MeshError, TetMesh, TriMesh};
use std::fmt::Display;
use std::io::Write;
use std::path::{Path, PathBuf};
use trepan_geometry::Vec3;
use trepan_volume::read_regular;

/// Why a mesh file could not be read or written.
#[derive(Debug, thiserror::Error)]
pub enum FileError {
    /// The operating system cannot access the file.
    #[error("{}: {source}; check that the path exists and may be used", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// The system's error.
        source: std::io::Error,
    },
    /// A field of the file is invalid.
    #[error("{}: {field} is {got}; it should be {wanted}", path.display())]
    Field {
        /// The file.
        path: PathBuf,
        /// The field.
        field: String,
        /// Its value.
        got: String,
        /// The expected value.
        wanted: String,
    },
    /// The file was read, but its mesh is not valid.
    #[error("{}: {source}", path.display())]
    Mesh {
        /// The file.
        path: PathBuf,
        /// The error.
        source: MeshError,
    },
}

/// A read position in a file's bytes, text or binary.
pub(crate) struct Reader {
    path: PathBuf,
    bytes: Vec<u8>,
    at: usize,
    /// Character that starts a comment up to the end of the line.
    pub(crate) comment: Option<u8>,
    /// Whether x and y point to the patient's left and back.
    pub(crate) lps: bool,
}

/// The tetrahedra of a file, and how many of its elements are others.
#[derive(Default)]
pub(crate) struct Elements {
    pub(crate) tets: Vec<[u32; 4]>,
    /// Tetrahedra with more than four nodes.
    pub(crate) of_more_nodes: usize,
    /// Elements that are no tetrahedra.
    pub(crate) others: usize,
}

impl Reader {
    pub(crate) fn open(path: &Path) -> Result<Self, FileError> {
        let bytes = read_regular(path).map_err(|source| FileError::Io { path: path.into(), source })?;
        Ok(Self::of(path, bytes))
    }

    /// A reader of bytes in memory.
    pub(crate) fn of(path: &Path, bytes: Vec<u8>) -> Self {
        Self { path: path.into(), bytes, at: 0, comment: None, lps: false }
    }

    pub(crate) fn error(&self, field: impl Into<String>, got: impl Display, wanted: impl Into<String>) -> FileError {
        let got: String = got.to_string().chars().take(80).collect();
        FileError::Field { path: self.path.clone(), field: field.into(), got, wanted: wanted.into() }
    }

    pub(crate) fn left(&self) -> usize {
        self.bytes.len() - self.at
    }

    /// The rest of the current line without its end; `None` at the end of the file.
    pub(crate) fn line(&mut self) -> Option<String> {
        if self.left() == 0 {
            return None;
        }
        let rest = &self.bytes[self.at..];
        let end = rest.iter().position(|&b| b == b'\n');
        let line = &rest[..end.unwrap_or(rest.len())];
        self.at += end.map_or(rest.len(), |e| e + 1);
        Some(String::from_utf8_lossy(line.strip_suffix(b"\r").unwrap_or(line)).into_owned())
    }

    /// The next word, separated by white space.
    pub(crate) fn word(&mut self) -> Option<&str> {
        self.skip_blanks();
        let rest = &self.bytes[self.at..];
        let ends = |b: &u8| b.is_ascii_whitespace() || Some(*b) == self.comment;
        let length = rest.iter().position(ends).unwrap_or(rest.len());
        let from = self.at;
        self.at += length;
        if length == 0 { None } else { Some(std::str::from_utf8(&self.bytes[from..self.at]).unwrap_or("?")) }
    }

    fn skip_blanks(&mut self) {
        let mut in_comment = false;
        while let Some(&byte) = self.bytes.get(self.at) {
            in_comment = (in_comment || Some(byte) == self.comment) && byte != b'\n';
            if !in_comment && !byte.is_ascii_whitespace() {
                return;
            }
            self.at += 1;
        }
    }

    /// Skips words that are numbers; returns the first of them.
    pub(crate) fn skip_numbers(&mut self) -> Option<f64> {
        let mut first = None;
        loop {
            let at = self.at;
            let Some(number) = self.word().and_then(|word| word.parse().ok()) else {
                self.at = at;
                return first;
            };
            first = first.or(Some(number));
        }
    }

    /// Heeds `SPACE=LPS` in a comment.
    pub(crate) fn heed_space(&mut self, comment: &str) {
        self.lps |= comment.to_ascii_uppercase().contains("SPACE=LPS");
    }

    /// Skips up to `count` words.
    pub(crate) fn skip_words(&mut self, count: usize) {
        for _ in 0..count {
            if self.word().is_none() {
                return;
            }
        }
    }

    /// Parses the next words as a position.
    pub(crate) fn xyz(&mut self, node: usize) -> Result<Vec3, FileError> {
        let field = format!("node {node}");
        let mut coordinate = || self.number(&field, "three numbers");
        let xyz = [coordinate()?, coordinate()?, coordinate()?];
        self.position(node, xyz)
    }

    /// Skips past the next line that starts with `start`; an error at the end of the file.
    pub(crate) fn skip_past_line(&mut self, start: &str) -> Result<(), FileError> {
        while let Some(line) = self.line() {
            if line.starts_with(start) {
                return Ok(());
            }
        }
        Err(self.error(start, "missing", "at the end of its section; is the file cut off?"))
    }

    /// Parses the next word.
    pub(crate) fn number<T: std::str::FromStr>(&mut self, field: &str, wanted: &str) -> Result<T, FileError> {
        let word = self.word().unwrap_or("the end of the file").to_owned();
        word.parse().map_err(|_| self.error(field, &word, wanted))
    }

    /// Parses the next word as a count of items that each take at least `bytes_each` of the rest of
    /// the file.
    pub(crate) fn count(&mut self, field: &str, bytes_each: usize) -> Result<usize, FileError> {
        let count: u64 = self.number(field, "a count")?;
        self.checked_count(field, count, bytes_each)
    }

    /// Checks a count in the same way.
    pub(crate) fn checked_count(&self, field: &str, count: u64, bytes_each: usize) -> Result<usize, FileError> {
        let fits = usize::try_from(count)
            .ok()
            .filter(|n| n.checked_mul(bytes_each.max(1)).is_some_and(|b| b <= self.left() + bytes_each));
        fits.ok_or_else(|| {
            self.error(
                field,
                count,
                format!("at most what the remaining {} bytes hold; is the file cut off?", self.left()),
            )
        })
    }

    /// The next `count` bytes.
    pub(crate) fn take(&mut self, field: &str, count: usize) -> Result<&[u8], FileError> {
        if count > self.left() {
            return Err(self.error(
                field,
                format!("cut off after {} of {count} bytes", self.left()),
                "complete; copy the file again",
            ));
        }
        self.at += count;
        Ok(&self.bytes[self.at - count..self.at])
    }

    /// The next N bytes as an array.
    pub(crate) fn array<const N: usize>(&mut self, field: &str) -> Result<[u8; N], FileError> {
        let mut bytes = [0; N];
        bytes.copy_from_slice(self.take(field, N)?);
        Ok(bytes)
    }

    /// Returns to the start.
    pub(crate) fn rewind(&mut self) {
        self.at = 0;
    }

    /// Size of the file, bytes.
    pub(crate) fn size(&self) -> usize {
        self.bytes.len()
    }

    /// Converts a position to f32, if it is finite.
    pub(crate) fn position(&self, node: usize, xyz: [f64; 3]) -> Result<Vec3, FileError> {
        let position = Vec3::from_array(xyz.map(|c| c as f32));
        if position.is_finite() {
            Ok(position)
        } else {
            Err(self.error(format!("node {node}"), format!("{xyz:?}"), "three finite numbers"))
        }
    }

    /// Builds the mesh, if it has tetrahedra and their indices are in range.
    pub(crate) fn mesh(&self, positions: Vec<Vec3>, elements: Elements) -> Result<Import<TetMesh>, FileError> {
        let (nodes, listed) = (positions.len(), elements.tets.len());
        let mesh = TetMesh { positions: self.in_ras(positions), tets: elements.tets };
        mesh.check_indices().map_err(|source| FileError::Mesh { path: self.path.clone(), source })?;
        let mesh = mesh.without_repeats().without_orphans();
        let counts = [
            (elements.of_more_nodes, Note::Corners as fn(usize) -> Note),
            (elements.others, Note::Others),
            (listed - mesh.tets.len(), Note::Repeated),
            (nodes - mesh.positions.len(), Note::Orphans),
        ];
        let notes = counts.into_iter().filter(|(count, _)| *count > 0).map(|(count, note)| note(count));
        Ok(Import { notes: notes.chain(self.lps.then_some(Note::Lps)).collect(), mesh })
    }

    /// Builds the surface, if it has triangles and their indices are in range.
    pub(crate) fn surface(&self, positions: Vec<Vec3>, triangles: Vec<[u32; 3]>) -> Result<Import<TriMesh>, FileError> {
        if triangles.is_empty() {
            return Err(self.error("the file", "without a triangle", "a surface"));
        }
        let out_of_range = |t: &[u32; 3]| t.iter().any(|&n| n as usize >= positions.len());
        if let Some(t) = triangles.iter().position(out_of_range) {
            return Err(self.error(
                format!("triangle {t}"),
                format!("{:?}", triangles[t]),
                format!("of nodes 0 to {}", positions.len().saturating_sub(1)),
            ));
        }
        let mesh = TriMesh { positions: self.in_ras(positions), triangles };
        Ok(Import { mesh, notes: self.lps.then_some(Note::Lps).into_iter().collect() })
    }

    /// Turns LPS by half a turn about z, which keeps the order of corners right.
    fn in_ras(&self, mut positions: Vec<Vec3>) -> Vec<Vec3> {
        if self.lps {
            positions.iter_mut().for_each(|p| *p *= Vec3::new(-1.0, -1.0, 1.0));
        }
        positions
    }
}

/// Writes a temporary file in the same folder, then renames it, so that a crash keeps the old file.
pub(crate) fn write_atomically(
    path: &Path,
    fill: impl FnOnce(&mut dyn Write) -> std::io::Result<()>,
) -> Result<(), FileError> {
    trepan_volume::write_atomically(path, |out| fill(out)).map_err(|source| FileError::Io { path: path.into(), source })
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// A small valid mesh: an octahedron of four tetrahedra around its axis, off the origin.
    pub(crate) fn octahedron() -> TetMesh {
        let ring = [Vec3::X, Vec3::Y, Vec3::NEG_X, Vec3::NEG_Y];
        let nodes = [Vec3::NEG_Z, Vec3::Z].into_iter().chain(ring);
        let tets = [0, 1, 2, 3].map(|n| [0, 1, 2 + n, 2 + (n + 1) % 4]).to_vec();
        let mesh = TetMesh { positions: nodes.map(|p| p * 1.25 + Vec3::new(-40.0, 12.5, 1e-3)).collect(), tets };
        assert_eq!(mesh.check(), Ok(()));
        mesh
    }

    /// Feeds a parser thousands of damaged copies of a valid file: truncated, with bytes changed or
    /// removed, and with numbers replaced. It may reject or read them, but must not panic, and an
    /// error must name the file.
    pub(crate) fn survive_mutations<T>(good: &[u8], parse: impl Fn(Reader) -> Result<T, FileError>) {
        let mut random = 0x2545_F491_4F6C_DD1Du64;
        let mut next = |n: usize| {
            random ^= random << 13;
            random ^= random >> 7;
            random ^= random << 17;
            (random >> 11) as usize % n.max(1)
        };
        let numbers: [&[u8]; 8] = [b"-1", b"0", b"4294967295", b"18446744073709551615", b"nan", b"1e400", b"", b"x"];
        for round in 0..rounds() {
            let mut bad = good.to_vec();
            match round % 4 {
                0 => bad.truncate(next(good.len())),
                1 => (0..=next(4)).for_each(|_| bad[next(good.len())] = next(256) as u8),
                2 => {
                    let from = next(good.len());
                    bad.drain(from..good.len().min(from + 1 + next(9)));
                }
                _ => replace_number(&mut bad, next(200), numbers[next(numbers.len())]),
            }
            if let Err(error) = parse(Reader::of(Path::new("damaged.file"), bad)) {
                assert!(error.to_string().contains("damaged.file"), "{error}");
            }
        }
    }

    /// Parses a text; leaves the notes out.
    pub(crate) fn of_text<M>(
        text: &str,
        parse: impl Fn(Reader) -> Result<Import<M>, FileError>,
    ) -> Result<M, FileError> {
        of_bytes(text.as_bytes(), parse).map(|import| import.mesh)
    }

    /// Parses bytes.
    pub(crate) fn of_bytes<T>(bytes: &[u8], parse: impl Fn(Reader) -> Result<T, FileError>) -> Result<T, FileError> {
        parse(Reader::of(Path::new("some.file"), bytes.to_vec()))
    }

    /// Number of damaged copies; more with TREPAN_MUTATIONS=1000000.
    fn rounds() -> usize {
        std::env::var("TREPAN_MUTATIONS").ok().and_then(|n| n.parse().ok()).unwrap_or(5_000)
    }

    /// Replaces the nth run of digits.
    fn replace_number(bytes: &mut Vec<u8>, nth: usize, with: &[u8]) {
        let starts: Vec<usize> = (0..bytes.len())
            .filter(|&i| bytes[i].is_ascii_digit() && (i == 0 || !bytes[i - 1].is_ascii_digit()))
            .collect();
        if let Some(&start) = starts.get(nth % starts.len().max(1)) {
            let length = bytes[start..].iter().take_while(|b| b.is_ascii_digit()).count();
            bytes.splice(start..start + length, with.iter().copied());
        }
    }

    #[test]
    fn a_missing_file_and_folder_are_named() {
        let missing = Path::new("no-such-folder/no-such-file.vtk");
        assert!(Reader::open(missing).is_err_and(|e| e.to_string().contains("no-such-file.vtk")));
        let error = write_atomically(missing, |_| Ok(())).unwrap_err();
        assert!(error.to_string().contains("no-such-file.vtk"));
    }

    #[test]
    fn a_failed_write_leaves_the_old_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("mesh.vtk");
        std::fs::write(&path, b"old").unwrap();
        assert!(write_atomically(&path, |out| out.write_all(b"new").and(Err(std::io::Error::other("full")))).is_err());
        assert_eq!(std::fs::read(&path).unwrap(), b"old");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }
}
