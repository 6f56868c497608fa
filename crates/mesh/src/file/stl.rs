//! STL surfaces (`.stl`).
//!
//! # Theory
//! Triangles without shared vertices: as text (`solid … facet normal … vertex …`), or as an
//! arbitrary 80-byte header, a little-endian count and 50 bytes per triangle.
//!
//! # Practice
//! Reads both, distinguished by size and not by the word `solid`, with which binary files may start
//! too. Corners at the same position become one vertex; normals are skipped, since the corner order
//! defines them. Writes binary. Positions are mm; STL has no unit.

use crate::TriMesh;
use crate::file::{FileError, Format, Import, Reader, write_atomically};
use std::path::Path;
use trepan_geometry::Vec3;

/// The format.
pub const FORMAT: Format<TriMesh> = Format { name: "STL (.stl)", endings: &["stl"], starts: &[], import, write };

/// Reads a surface, with notes about the file.
pub fn import(path: &Path) -> Result<Import<TriMesh>, FileError> {
    parse(Reader::open(path)?)
}

/// Writes a surface as binary STL, atomically.
pub fn write(path: &Path, mesh: &TriMesh) -> Result<(), FileError> {
    write_atomically(path, |out| {
        write!(out, "{:80}", "SPACE=RAS")?;
        out.write_all(&(mesh.triangles.len() as u32).to_le_bytes())?;
        for triangle in 0..mesh.triangles.len() {
            let [a, b, c] = mesh.corners(triangle);
            let normal = (b - a).cross(c - a).normalize_or_zero();
            [normal, a, b, c].iter().flat_map(Vec3::to_array).try_for_each(|x| out.write_all(&x.to_le_bytes()))?;
            out.write_all(&[0; 2])?;
        }
        Ok(())
    })
}

pub(crate) fn parse(mut reader: Reader) -> Result<Import<TriMesh>, FileError> {
    let size = reader.size();
    let header: [u8; 84] = if size >= 84 { reader.array("the header")? } else { [0; 84] };
    let count = u32::from_le_bytes([header[80], header[81], header[82], header[83]]) as usize;
    let corners = if size >= 84 && count.checked_mul(50) == Some(size - 84) {
        reader.heed_space(&String::from_utf8_lossy(&header));
        binary(&mut reader, count)?
    } else {
        reader.rewind();
        let title = reader.line().unwrap_or_default();
        reader.heed_space(&title);
        reader.rewind();
        text(&mut reader)?
    };
    let triangles = (0..corners.len() as u32 / 3).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
    reader.surface(corners, triangles).map(|soup| Import { mesh: soup.mesh.welded(), ..soup })
}

fn binary(reader: &mut Reader, count: usize) -> Result<Vec<Vec3>, FileError> {
    let mut corners = Vec::with_capacity(3 * count);
    for triangle in 0..count {
        let bytes: [u8; 50] = reader.array("a triangle")?;
        for corner in 1..4 {
            let coordinate = |d: usize| {
                let at = 12 * corner + 4 * d;
                f32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]]).into()
            };
            corners.push(reader.position(3 * triangle + corner - 1, [coordinate(0), coordinate(1), coordinate(2)])?);
        }
    }
    Ok(corners)
}

fn text(reader: &mut Reader) -> Result<Vec<Vec3>, FileError> {
    let first = reader.word().unwrap_or_default().to_owned();
    if !first.eq_ignore_ascii_case("solid") {
        return Err(reader.error(
            "the file",
            format!("{} bytes that start with {first:?}", reader.size()),
            "84 + 50 × count bytes, or text that starts with solid",
        ));
    }
    let mut corners = Vec::new();
    while let Some(word) = reader.word() {
        if word.eq_ignore_ascii_case("vertex") {
            corners.push(reader.xyz(corners.len())?);
        }
    }
    if corners.len() % 3 != 0 {
        return Err(reader.error(
            "the number of vertices",
            corners.len(),
            "three for each facet; is the file cut off?",
        ));
    }
    Ok(corners)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Surface;
    use crate::file::tests::{octahedron, of_text, survive_mutations};

    const TEXT: &str = "solid a b\n facet normal 0 0 1\n  outer loop\n   vertex 0 0 0\n   vertex 1 0 0\n   vertex 0 1e0 0\n  endloop\n endfacet\nendsolid a b\n";

    #[test]
    fn written_surfaces_are_read_back_and_closed() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("surface.stl");
        let mesh = octahedron();
        let surface = Surface::of(&mesh).to_tri_mesh(&mesh.positions);
        write(&path, &surface).unwrap();
        let back = import(&path).unwrap().mesh;
        assert!(back.is_closed());
        assert!((back.volume_mm3() - mesh.total_mm3()).abs() < 1e-6);
        survive_mutations(&std::fs::read(&path).unwrap(), parse);
    }

    #[test]
    fn text_is_read_and_faults_named() {
        let mesh = of_text(TEXT, parse).unwrap();
        assert_eq!((mesh.positions.len(), mesh.triangles), (3, vec![[0, 1, 2]]));
        let fault = |from: &str, to: &str| of_text(&TEXT.replace(from, to), parse).unwrap_err().to_string();
        assert!(fault("vertex 1 0 0\n", "").contains("three for each facet"));
        assert!(fault("vertex 1 0 0", "vertex 1 0 nan").contains("finite"));
        assert!(fault("vertex 1 0 0", "vertex 1 x 0").contains("three numbers"));
        assert!(fault("solid", "liquid").contains("84 + 50"));
    }

    #[test]
    fn damage_is_survived() {
        survive_mutations(TEXT.as_bytes(), parse);
    }
}
