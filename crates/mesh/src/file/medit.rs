//! Medit text files (`.mesh`) of tetrahedra.
//!
//! # Theory
//! A list of sections, each a keyword, a count and that many rows: `Vertices` (x y z reference) and
//! `Tetrahedra` (four nodes from 1, reference), or `TetrahedraP2` (ten) and so on. Other sections
//! (triangles, corners, ridges) are skipped up to the next keyword.
//!
//! # Practice
//! Reads the text form, dimension 3; references and nodes on edges are skipped. Writes version 2
//! with enough digits to restore each f32. Positions are mm; the corner order is that of
//! [`TetMesh`].
//!
//! # Sources
//! P. Frey: MEDIT, an interactive mesh visualization software, INRIA RT-0253, 2001.

use crate::TetMesh;
use crate::file::{Elements, FileError, Format, Import, Reader, write_atomically};
use std::path::Path;
use trepan_geometry::Vec3;

/// The format.
pub const FORMAT: Format<TetMesh> =
    Format { name: "Medit (.mesh)", endings: &["mesh"], starts: &["MeshVersionFormatted"], import, write };

/// Reads the tetrahedra of a Medit file. Only indices are checked; call [`TetMesh::check`] for the
/// rest.
pub fn import(path: &Path) -> Result<Import<TetMesh>, FileError> {
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

/// The order of the elements of a section of tetrahedra: `Tetrahedra` has 1, `TetrahedraP3` 3.
fn order(keyword: &str) -> Option<usize> {
    match keyword.strip_prefix("Tetrahedra")? {
        "" => Some(1),
        order => order.strip_prefix('P')?.parse().ok().filter(|order| (1..10).contains(order)),
    }
}

/// Sections of elements that are no tetrahedra.
const OTHERS: [&str; 6] = ["Edges", "Triangles", "Quadrilaterals", "Hexahedra", "Prisms", "Pyramids"];

pub(crate) fn parse(mut reader: Reader) -> Result<Import<TetMesh>, FileError> {
    reader.comment = Some(b'#');
    let first = reader.word().unwrap_or_default().to_owned();
    if first != "MeshVersionFormatted" {
        return Err(reader.error("the first word", first, "MeshVersionFormatted (the text form of Medit)"));
    }
    let _version: u32 = reader.number("MeshVersionFormatted", "1 to 4")?;
    let (mut positions, mut elements) = (Vec::new(), Elements::default());
    loop {
        match reader.word().unwrap_or("End").to_owned().as_str() {
            "End" => return reader.mesh(positions, elements),
            "Dimension" => dimension(&mut reader)?,
            "Vertices" => positions = vertices(&mut reader)?,
            keyword if order(keyword).is_some() => {
                let order = order(keyword).unwrap_or(1);
                let tets = tetrahedra(&mut reader, (order + 1) * (order + 2) * (order + 3) / 6)?;
                elements.of_more_nodes += if order > 1 { tets.len() } else { 0 };
                elements.tets.extend(tets);
            }
            other if other.parse::<f64>().is_err() => {
                let count = reader.skip_numbers().unwrap_or_default() as usize;
                let kind = other.trim_end_matches(char::is_numeric).trim_end_matches('P');
                elements.others = elements.others.saturating_add(if OTHERS.contains(&kind) { count } else { 0 });
            }
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

/// The corners of elements of `nodes` nodes.
fn tetrahedra(reader: &mut Reader, nodes: usize) -> Result<Vec<[u32; 4]>, FileError> {
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
        reader.skip_words(nodes - 4 + 1);
    }
    Ok(tets)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Note;
    use crate::file::tests::{octahedron, of_bytes, of_text, survive_mutations};

    const TEXT: &str = "MeshVersionFormatted 1 # old\nDimension\n3\nVertices 4\n0 0 0 1\n1 0 0 1\n0 1 0 1\n0 0 1 1\nTriangles\n1\n1 2 3 7\n\
                        Tetrahedra\n1\n1 2 3 4 9\nEnd\n";

    #[test]
    fn written_files_are_read_back() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("mesh.mesh");
        write(&path, &octahedron()).unwrap();
        assert_eq!(import(&path).unwrap().mesh, octahedron());
    }

    #[test]
    fn other_sections_are_left_out_and_faults_named() {
        let import = of_bytes(TEXT.as_bytes(), parse).unwrap();
        assert_eq!((import.mesh.tets, import.notes), (vec![[0, 1, 2, 3]], vec![Note::Others(1)]));
        let quadratic = TEXT
            .replace("Vertices 4\n", "Vertices 5\n9 9 9 0\n")
            .replace("Tetrahedra\n1\n1 2 3 4", "TetrahedraP2\n1\n2 3 4 5 1 1 1 1 1 1");
        let quadratic = of_bytes(quadratic.as_bytes(), parse).unwrap();
        assert_eq!(quadratic.notes, [Note::Corners(1), Note::Others(1), Note::Orphans(1)]);
        assert_eq!(quadratic.mesh, of_text(TEXT, parse).unwrap());
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
