//! Wavefront OBJ surfaces (`.obj`).
//!
//! # Theory
//! `v x y z` is a vertex, `f a b c …` a polygon of vertex numbers from 1, negative numbers counting
//! from the last vertex; `a/t/n` adds texture and normal.
//!
//! # Practice
//! Polygons are split into triangle fans; texture, normals, groups and materials are skipped.
//! Writes vertices and triangles with enough digits to restore each f32.

use crate::TriMesh;
use crate::file::{FileError, Format, Import, Reader, write_atomically};
use std::path::Path;
use trepan_geometry::Vec3;

/// The format.
pub const FORMAT: Format<TriMesh> = Format { name: "OBJ (.obj)", endings: &["obj"], starts: &[], import, write };

/// Reads a surface, with notes about the file.
pub fn import(path: &Path) -> Result<Import<TriMesh>, FileError> {
    parse(Reader::open(path)?)
}

/// Writes a surface as OBJ, atomically.
pub fn write(path: &Path, mesh: &TriMesh) -> Result<(), FileError> {
    write_atomically(path, |out| {
        writeln!(out, "# SPACE=RAS")?;
        mesh.positions.iter().try_for_each(|p| writeln!(out, "v {} {} {}", p.x, p.y, p.z))?;
        mesh.triangles.iter().map(|t| t.map(|n| n + 1)).try_for_each(|[a, b, c]| writeln!(out, "f {a} {b} {c}"))
    })
}

pub(crate) fn parse(mut reader: Reader) -> Result<Import<TriMesh>, FileError> {
    let (mut positions, mut triangles) = (Vec::new(), Vec::new());
    while let Some(line) = reader.line() {
        let (line, comment) = line.split_once('#').unwrap_or((&line, ""));
        reader.heed_space(comment);
        let mut words = line.split_ascii_whitespace();
        match words.next() {
            Some("v") => positions.push(vertex(&reader, positions.len(), words)?),
            Some("f") => {
                let corners =
                    words.map(|w| corner(&reader, line, w, positions.len())).collect::<Result<Vec<u32>, _>>()?;
                if corners.len() < 3 {
                    return Err(reader.error("a face", line, "at least three vertices"));
                }
                triangles.extend(corners[1..].windows(2).map(|pair| [corners[0], pair[0], pair[1]]));
            }
            _ => {}
        }
    }
    reader.surface(positions, triangles)
}

fn vertex<'a>(reader: &Reader, node: usize, mut words: impl Iterator<Item = &'a str>) -> Result<Vec3, FileError> {
    let mut coordinate = || words.next().and_then(|w| w.parse().ok()).unwrap_or(f64::NAN);
    reader.position(node + 1, [coordinate(), coordinate(), coordinate()])
}

/// Converts a vertex number to an index from 0.
fn corner(reader: &Reader, line: &str, word: &str, vertices: usize) -> Result<u32, FileError> {
    let number: Option<i64> = word.split('/').next().and_then(|n| n.parse().ok());
    let index = match number {
        Some(n) if n > 0 => Some(n - 1),
        Some(n) if n < 0 => n.checked_add(vertices as i64),
        _ => None,
    };
    let index = index.and_then(|n| u32::try_from(n).ok());
    index.ok_or_else(|| reader.error("a face", line, "vertex numbers from 1, or backwards from -1"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Surface;
    use crate::file::tests::{octahedron, of_text, survive_mutations};

    const TEXT: &str = "# a square\nv 0 0 0\nv 1 0 0\nv 1 1 0\nvn 0 0 1\nv 0 1 0\ng x\nf 1//1 2//1 3//1 -1//1\n";

    #[test]
    fn written_files_are_read_back() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("surface.obj");
        let mesh = octahedron();
        let surface = Surface::of(&mesh).to_tri_mesh(&mesh.positions);
        write(&path, &surface).unwrap();
        assert_eq!(import(&path).unwrap().mesh, surface);
    }

    #[test]
    fn polygons_become_fans_and_faults_are_named() {
        assert_eq!(of_text(TEXT, parse).unwrap().triangles, [[0, 1, 2], [0, 2, 3]]);
        let fault = |from: &str, to: &str| of_text(&TEXT.replace(from, to), parse).unwrap_err().to_string();
        assert!(fault("2//1", "9//1").contains("triangle 0"));
        assert!(fault("2//1", "0").contains("numbers from 1"));
        assert!(fault("-1//1", "-9").contains("backwards"));
        assert!(fault("2//1 3//1 -1//1", "2").contains("at least three"));
        assert!(fault("v 1 0 0", "v 1 0").contains("node 2"));
        assert!(fault("f 1", "g 1").contains("without a triangle"));
    }

    #[test]
    fn damage_is_survived() {
        survive_mutations(TEXT.as_bytes(), parse);
    }
}
