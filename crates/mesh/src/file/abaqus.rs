//! Abaqus input files (`.inp`): nodes and tetrahedra only.
//!
//! # Theory
//! Keyword lines start with `*`, comments with `**`; data rows with commas follow. `*NODE` has
//! "number, x, y, z", `*ELEMENT, TYPE=C3D4` has "number, a, b, c, d"; a row that ends in a comma
//! continues on the next line.
//!
//! # Practice
//! Reads C3D4 and the corners of C3D10 (with their variants: C3D10M, C3D4H …); other elements,
//! sets, materials and steps are skipped, and a single part is assumed. Writes nodes and elements
//! only. Positions are mm; the corner order is that of [`TetMesh`].
//!
//! # Sources
//! Abaqus Keywords Reference Guide: *NODE, *ELEMENT.

use crate::TetMesh;
use crate::file::numbered::Numbered;
use crate::file::{FileError, Format, Reader, write_atomically};
use std::path::Path;

/// The format.
pub const FORMAT: Format<TetMesh> = Format { name: "Abaqus (.inp)", endings: &["inp"], starts: &["*"], read, write };

/// Reads the tetrahedra of an Abaqus file. Only indices are checked; call [`TetMesh::check`] for
/// the rest.
pub fn read(path: &Path) -> Result<TetMesh, FileError> {
    parse(Reader::open(path)?)
}

/// Writes a mesh as an Abaqus file, atomically.
pub fn write(path: &Path, mesh: &TetMesh) -> Result<(), FileError> {
    write_atomically(path, |out| {
        writeln!(out, "*HEADING\ntetrahedra, mm\n*NODE")?;
        mesh.positions.iter().zip(1..).try_for_each(|(p, n)| writeln!(out, "{n}, {}, {}, {}", p.x, p.y, p.z))?;
        writeln!(out, "*ELEMENT, TYPE=C3D4")?;
        let mut from_one = mesh.tets.iter().map(|t| t.map(|n| n + 1)).zip(1..);
        from_one.try_for_each(|([a, b, c, d], n)| writeln!(out, "{n}, {a}, {b}, {c}, {d}"))
    })
}

/// The kind of data rows under the last keyword.
#[derive(Clone, Copy, PartialEq)]
enum Rows {
    Nodes,
    Tetrahedra,
    Other,
}

pub(crate) fn parse(mut reader: Reader) -> Result<TetMesh, FileError> {
    let mut nodes = Numbered::default();
    let mut elements: Vec<[u64; 4]> = Vec::new();
    let mut rows = Rows::Other;
    while let Some(line) = reader.line() {
        let line = line.trim();
        if line.is_empty() || line.starts_with("**") {
            continue;
        }
        if let Some(keyword) = line.strip_prefix('*') {
            rows = rows_of(keyword);
            continue;
        }
        match rows {
            Rows::Nodes => {
                let field = format!("node row {}", nodes.positions.len() + 1);
                let values = numbers(&reader, &field, line, 4)?;
                let position = reader.position(values[0] as usize, [values[1], values[2], values[3]])?;
                nodes.push(values[0] as u64, position);
            }
            Rows::Tetrahedra => {
                let field = format!("element row {}", elements.len() + 1);
                let values = numbers(&reader, &field, line, 5)?;
                elements.push([1, 2, 3, 4].map(|n| values[n] as u64));
                skip_continuation(&mut reader, line);
            }
            Rows::Other => {}
        }
    }
    nodes.sort(&reader)?;
    let tets = elements
        .iter()
        .enumerate()
        .map(|(t, &numbers)| nodes.corners(&reader, t, numbers))
        .collect::<Result<_, _>>()?;
    reader.mesh(nodes.positions, tets)
}

fn rows_of(keyword: &str) -> Rows {
    let keyword = keyword.to_ascii_uppercase().replace(' ', "");
    let mut parts = keyword.split(',');
    match parts.next() {
        Some("NODE") => Rows::Nodes,
        Some("ELEMENT") if parts.any(|p| p.starts_with("TYPE=C3D4") || p.starts_with("TYPE=C3D10")) => Rows::Tetrahedra,
        _ => Rows::Other,
    }
}

/// The first `count` numbers of a row.
fn numbers(reader: &Reader, field: &str, line: &str, count: usize) -> Result<Vec<f64>, FileError> {
    let values: Vec<f64> = line.split(',').map_while(|v| v.trim().parse().ok()).take(count).collect();
    let good = values.len() == count && values[0] >= 0.0;
    if good {
        Ok(values)
    } else {
        Err(reader.error(field, line, format!("{count} numbers with commas, the first not negative")))
    }
}

/// Skips continuation rows; the corners are all in the first row.
fn skip_continuation(reader: &mut Reader, line: &str) {
    let mut open = line.ends_with(',');
    while open {
        open = reader.line().is_some_and(|next| next.trim_end().ends_with(','));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::file::tests::{octahedron, of_text, survive_mutations};

    const TEXT: &str = "*Heading\nx\n** note\n*Node, nset=all\n 10, 0, 0, 0\n20, 1., 0, 0\n30, 0, 1e0, 0\n40, 0, 0, 1\n\
                        *Element, type=S3\n1, 10, 20, 30\n*Element, type=C3D10M, elset=brain\n2, 10, 20, 30, 40, 1, 2, 3,\n4, 5, 6\n*Material\n1, 2\n";

    #[test]
    fn written_files_are_read_back() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("mesh.inp");
        write(&path, &octahedron()).unwrap();
        assert_eq!(read(&path).unwrap(), octahedron());
    }

    #[test]
    fn other_elements_are_left_out_and_faults_named() {
        assert_eq!(of_text(TEXT, parse).unwrap().tets, [[0, 1, 2, 3]]);
        let fault = |from: &str, to: &str| of_text(&TEXT.replace(from, to), parse).unwrap_err().to_string();
        assert!(fault("40, 0, 0, 1", "30, 0, 0, 1").contains("node 30 is there twice"));
        assert!(fault("40, 0, 0, 1", "40, 0, 0").contains("node row 4"));
        assert!(fault("2, 10, 20, 30, 40", "2, 10, 20, 30, 41").contains("tetrahedron 0"));
        assert!(fault("C3D10M", "C3D8").contains("no tetrahedra"));
    }

    #[test]
    fn damage_is_survived() {
        survive_mutations(TEXT.as_bytes(), parse);
    }
}
