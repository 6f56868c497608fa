//! Medit text files (`.mesh`) of tetrahedra.
//!
//! # Theory
//! A list of sections, each a keyword, a count and that many rows: `Vertices` (x y z reference) and
//! `Tetrahedra` (four nodes from 1, reference). Other sections (triangles, corners, ridges) are
//! skipped up to the next keyword.
//!
//! # Practice
//! Reads the text form, dimension 3; references are skipped. Writes version 2 with enough digits to
//! restore each f32. Positions are mm; the corner order is that of [`TetMesh`].
//!
//! # Sources
//! P. Frey: MEDIT, an interactive mesh visualization software, INRIA RT-0253, 2001.

use crate::TetMesh;
use crate::file::{FileError, Format, Reader, write_atomically};
use std::path::Path;
use trepan_geometry::Vec3;

/// The format.
pub const FORMAT: Format<TetMesh> =
    Format { name: "Medit (.mesh)", endings: &["mesh"], starts: &["MeshVersionFormatted"], read, write };

/// Reads the tetrahedra of a Medit file. Only indices are checked; call [`TetMesh::check`] for the
/// rest.
pub fn read(path: &Path) -> Result<TetMesh, FileError> {
    parse(Reader::open(path)?)
}

/// Writes a mesh as Medit text, atomically.
pub fn write(path: &Path, mesh: &TetMesh) -> Result<(), FileError> {
    write_atomically(path, |out| {
        writeln!(out, "MeshVersionFormatted 2\nDimension 3\n\nVertices\n{}", mesh.positions.len())?;
        mesh.positions.iter().try_for_each(|p| writeln!(out, "{} {} {} 0", p.x, p.y, p.z))?;
        writeln!(out, "\nTetrahedra\n{}", mesh.tets.len())?;
        mesh.tets.iter().map(|t| t.map(|n| n + 1)).try_for_each(|[a, b, c, d]| writeln!(out, "{a} {b} {c} {d} 0"))?;
        writeln!(out, "\nEnd")
    })
}

pub(crate) fn parse(mut reader: Reader) -> Result<TetMesh, FileError> {
    reader.comment = Some(b'#');
    let first = reader.word().unwrap_or_default().to_owned();
    if first != "MeshVersionFormatted" {
        return Err(reader.error("the first word", first, "MeshVersionFormatted (the text form of Medit)"));
    }
    let _version: u32 = reader.number("MeshVersionFormatted", "1 to 4")?;
    let (mut positions, mut tets) = (Vec::new(), Vec::new());
    loop {
        match reader.word().unwrap_or("End").to_owned().as_str() {
            "End" => return reader.mesh(positions, tets),
            "Dimension" => dimension(&mut reader)?,
            "Vertices" => positions = vertices(&mut reader)?,
            "Tetrahedra" => tets = tetrahedra(&mut reader)?,
            other if other.parse::<f64>().is_err() => reader.skip_numbers(),
            number => return Err(reader.error("a keyword", number, "a word; is a count before it too small?")),
        }
    }
}

fn dimension(reader: &mut Reader) -> Result<(), FileError> {
    let dimension: u32 = reader.number("Dimension", "3")?;
    if dimension == 3 { Ok(()) } else { Err(reader.error("Dimension", dimension, "3")) }
}

fn vertices(reader: &mut Reader) -> Result<Vec<Vec3>, FileError> {
    let count = reader.count("the count of Vertices", 8)?;
    let mut positions = Vec::with_capacity(count);
    for node in 0..count {
        positions.push(reader.xyz(node + 1)?);
        reader.word();
    }
    Ok(positions)
}

fn tetrahedra(reader: &mut Reader) -> Result<Vec<[u32; 4]>, FileError> {
    let count = reader.count("the count of Tetrahedra", 10)?;
    let mut tets = Vec::with_capacity(count);
    for tet in 0..count {
        let field = format!("tetrahedron {}", tet + 1);
        let mut corners = [0u32; 4];
        for corner in &mut corners {
            let number: u32 = reader.number(&field, "four node numbers from 1")?;
            *corner = number.checked_sub(1).ok_or_else(|| reader.error(&field, number, "of nodes from 1"))?;
        }
        tets.push(corners);
        reader.word();
    }
    Ok(tets)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::file::tests::{octahedron, of_text, survive_mutations};

    const TEXT: &str = "MeshVersionFormatted 1 # old\nDimension\n3\nVertices 4\n0 0 0 1\n1 0 0 1\n0 1 0 1\n0 0 1 1\nTriangles\n1\n1 2 3 7\n\
                        Tetrahedra\n1\n1 2 3 4 9\nEnd\n";

    #[test]
    fn written_files_are_read_back() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("mesh.mesh");
        write(&path, &octahedron()).unwrap();
        assert_eq!(read(&path).unwrap(), octahedron());
    }

    #[test]
    fn other_sections_are_left_out_and_faults_named() {
        assert_eq!(of_text(TEXT, parse).unwrap().tets, [[0, 1, 2, 3]]);
        let fault = |from: &str, to: &str| of_text(&TEXT.replace(from, to), parse).unwrap_err().to_string();
        assert!(fault("\n3\n", "\n2\n").contains("Dimension is 2"));
        assert!(fault("Vertices 4", "Vertices 400000000").contains("count of Vertices"));
        assert!(fault("1 2 3 4 9", "0 2 3 4 9").contains("nodes from 1"));
        assert!(fault("1 2 3 4 9", "1 2 3 8 9").contains("names node 7"));
        assert!(fault("MeshVersion", "x").contains("MeshVersionFormatted"));
        assert!(fault("0 0 1 1", "0 0 inf 1").contains("finite"));
    }

    #[test]
    fn damage_is_survived() {
        survive_mutations(TEXT.as_bytes(), parse);
    }
}
