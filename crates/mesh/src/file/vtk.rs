//! Legacy VTK files (`.vtk`) of tetrahedra.
//!
//! # Theory
//! Four header lines, then `POINTS`, `CELLS` and `CELL_TYPES` of an unstructured grid, as text or
//! as big-endian binary. Up to version 4 a cell is a count and its nodes in one list; version 5
//! splits that into `OFFSETS` and `CONNECTIVITY`. Cell type 10 is the 4-node tetrahedron.
//!
//! # Practice
//! Reads both encodings and both layouts; skips cells of other types, point and cell data. Writes
//! version 3.0, binary, f32, which every version of VTK reads. Positions are mm; VTK has no unit.
//! The corner order is the same as in [`TetMesh`].
//!
//! # Sources
//! VTK File Formats, in The VTK User's Guide, 11th edition.

use crate::TetMesh;
use crate::file::{FileError, Format, Reader, write_atomically};
use crate::lattice::LabelledMesh;
use std::io::Write;
use std::path::Path;
use trepan_geometry::Vec3;

const TETRAHEDRON: u8 = 10;

/// The format.
pub const FORMAT: Format<TetMesh> =
    Format { name: "legacy VTK (.vtk)", endings: &["vtk"], starts: &["# vtk DataFile"], read, write };

/// Reads the tetrahedra of a legacy VTK file. Only indices are checked; call [`TetMesh::check`] for
/// the rest.
pub fn read(path: &Path) -> Result<TetMesh, FileError> {
    parse(Reader::open(path)?)
}

/// Reads a file written by [`write_labelled`]: tetrahedra only, with their labels as the first cell
/// data, `label`.
pub fn read_labelled(path: &Path) -> Result<LabelledMesh, FileError> {
    let mut file = Legacy { reader: Reader::open(path)?, binary: false, offsets: false };
    file.header()?;
    let mesh = file.body()?;
    let label_of_tet = file.labels(mesh.tets.len())?;
    Ok(LabelledMesh { mesh, label_of_tet, ..LabelledMesh::default() })
}

pub(crate) fn parse(reader: Reader) -> Result<TetMesh, FileError> {
    let mut file = Legacy { reader, binary: false, offsets: false };
    file.header()?;
    file.body()
}

/// Writes a mesh as binary legacy VTK, atomically.
pub fn write(path: &Path, mesh: &TetMesh) -> Result<(), FileError> {
    write_atomically(path, |out| write_grid(out, mesh))
}

/// Writes a mesh with each tetrahedron's label as the cell data `label`.
pub fn write_labelled(path: &Path, labelled: &LabelledMesh) -> Result<(), FileError> {
    write_atomically(path, |out| {
        write_grid(out, &labelled.mesh)?;
        let labels = &labelled.label_of_tet;
        write!(out, "CELL_DATA {}\nSCALARS label unsigned_short 1\nLOOKUP_TABLE default\n", labels.len())?;
        labels.iter().try_for_each(|label| out.write_all(&label.to_be_bytes()))?;
        writeln!(out)
    })
}

fn write_grid(out: &mut dyn Write, mesh: &TetMesh) -> std::io::Result<()> {
    let count = mesh.tets.len();
    write!(out, "# vtk DataFile Version 3.0\ntetrahedra, mm\nBINARY\nDATASET UNSTRUCTURED_GRID\n")?;
    writeln!(out, "POINTS {} float", mesh.positions.len())?;
    mesh.positions.iter().flat_map(Vec3::to_array).try_for_each(|c| out.write_all(&c.to_be_bytes()))?;
    writeln!(out, "\nCELLS {count} {}", 5 * count)?;
    for tet in &mesh.tets {
        [4, tet[0], tet[1], tet[2], tet[3]].iter().try_for_each(|n| out.write_all(&n.to_be_bytes()))?;
    }
    writeln!(out, "\nCELL_TYPES {count}")?;
    (0..count).try_for_each(|_| out.write_all(&u32::from(TETRAHEDRON).to_be_bytes()))?;
    writeln!(out)
}

struct Legacy {
    reader: Reader,
    binary: bool,
    /// Version 5: cells are stored as offsets and connectivity.
    offsets: bool,
}

/// All cells one after another: the start of each, and their nodes.
#[derive(Default)]
struct Cells {
    starts: Vec<usize>,
    nodes: Vec<i64>,
}

impl Legacy {
    fn header(&mut self) -> Result<(), FileError> {
        let first = self.reader.line().unwrap_or_default();
        let Some(version) = first.strip_prefix("# vtk DataFile Version ") else {
            return Err(self.reader.error("line 1", first, "\"# vtk DataFile Version 3.0\" or another version"));
        };
        let major: f32 = version.trim().parse().map_err(|_| self.reader.error("the version", version, "a number"))?;
        self.offsets = major >= 5.0;
        self.reader.line();
        let encoding = self.reader.line().unwrap_or_default();
        self.binary = match encoding.trim() {
            "BINARY" => true,
            "ASCII" => false,
            other => return Err(self.reader.error("the encoding", other, "ASCII or BINARY")),
        };
        let dataset = self.reader.line().unwrap_or_default();
        let is_grid = dataset.split_ascii_whitespace().eq(["DATASET", "UNSTRUCTURED_GRID"]);
        if is_grid {
            Ok(())
        } else {
            Err(self.reader.error("the data set", dataset, "DATASET UNSTRUCTURED_GRID; convert it to tetrahedra"))
        }
    }

    fn body(&mut self) -> Result<TetMesh, FileError> {
        let (mut positions, mut cells, mut types) = (None, None, None);
        while positions.is_none() || cells.is_none() || types.is_none() {
            match self.reader.word().unwrap_or_default().to_owned().as_str() {
                "POINTS" => positions = Some(self.points()?),
                "CELLS" if self.offsets => cells = Some(self.split_cells()?),
                "CELLS" => cells = Some(self.mixed_cells()?),
                "CELL_TYPES" => types = Some(self.types()?),
                "METADATA" => self.skip_metadata(),
                other => {
                    return Err(self.reader.error(
                        "the next section",
                        format!("{other:?}"),
                        "POINTS, CELLS or CELL_TYPES, each once",
                    ));
                }
            }
        }
        let tets = self.tets(&cells.unwrap_or_default(), &types.unwrap_or_default())?;
        self.reader.mesh(positions.unwrap_or_default(), tets)
    }

    /// One label for each cell.
    fn labels(&mut self, count: usize) -> Result<Vec<u16>, FileError> {
        let head = format!("CELL_DATA {count} SCALARS label unsigned_short 1 LOOKUP_TABLE default");
        for wanted in head.split(' ') {
            let word = self.reader.word().unwrap_or_default().to_owned();
            if word != wanted {
                return Err(self.reader.error("the cell data", word, format!("{wanted:?}, as in {head:?}")));
            }
        }
        Ok(self.numbers("label", count, "unsigned_short")?.into_iter().map(|label| label as u16).collect())
    }

    /// Skips to the next blank line.
    fn skip_metadata(&mut self) {
        self.reader.line();
        while self.reader.line().is_some_and(|line| !line.trim().is_empty()) {}
    }

    fn points(&mut self) -> Result<Vec<Vec3>, FileError> {
        let count = self.reader.count("the count of POINTS", 6)?;
        let kind = self.reader.word().unwrap_or_default().to_owned();
        let values = self.numbers("POINTS", 3 * count, &kind)?;
        values.as_chunks::<3>().0.iter().enumerate().map(|(n, &xyz)| self.reader.position(n, xyz)).collect()
    }

    /// Reads numbers of a VTK type in the file's encoding.
    fn numbers(&mut self, field: &str, count: usize, kind: &str) -> Result<Vec<f64>, FileError> {
        let (size, of): (usize, fn(&[u8]) -> f64) = match kind {
            "unsigned_short" => (2, |b| u16::from_be_bytes(b.try_into().unwrap_or_default()).into()),
            "float" => (4, |b| f32::from_be_bytes(b.try_into().unwrap_or_default()).into()),
            "double" => (8, |b| f64::from_be_bytes(b.try_into().unwrap_or_default())),
            "int" => (4, |b| i32::from_be_bytes(b.try_into().unwrap_or_default()).into()),
            "vtktypeint32" | "unsigned_int" => (4, |b| u32::from_be_bytes(b.try_into().unwrap_or_default()).into()),
            "vtktypeint64" | "long" => (8, |b| i64::from_be_bytes(b.try_into().unwrap_or_default()) as f64),
            other => {
                return Err(self.reader.error(
                    format!("the type of {field}"),
                    other,
                    "float, double, int, vtktypeint32 or vtktypeint64",
                ));
            }
        };
        if self.binary {
            self.reader.line();
            let bytes = self.reader.take(field, count.saturating_mul(size))?;
            return Ok(bytes.chunks_exact(size).map(of).collect());
        }
        (0..count).map(|_| self.reader.number(field, "a number")).collect()
    }

    fn mixed_cells(&mut self) -> Result<Cells, FileError> {
        let count = self.reader.count("the count of CELLS", 4)?;
        let size = self.reader.count("the size of CELLS", 2)?;
        let list = self.numbers("CELLS", size, "int")?;
        let mut cells = Cells::default();
        let mut at = 0;
        for cell in 0..count {
            let nodes = list.get(at).map_or(-1.0, |n| *n);
            if !(nodes >= 0.0 && nodes < list.len().saturating_sub(at) as f64) {
                return Err(self.reader.error(format!("the length of cell {cell}"), nodes, "the number of its nodes"));
            }
            cells.starts.push(cells.nodes.len());
            cells.nodes.extend(list[at + 1..=at + nodes as usize].iter().map(|&n| n as i64));
            at += 1 + nodes as usize;
        }
        cells.starts.push(cells.nodes.len());
        Ok(cells)
    }

    fn split_cells(&mut self) -> Result<Cells, FileError> {
        let count = self.reader.count("the count of CELLS", 2)?;
        let size = self.reader.count("the size of CELLS", 2)?;
        let offsets = self.named("OFFSETS", count)?;
        let nodes = self.named("CONNECTIVITY", size)?;
        let starts: Vec<usize> = offsets.iter().map(|&n| n as usize).collect();
        let ascending = starts.windows(2).all(|w| w[0] <= w[1]) && starts.last().is_none_or(|&end| end <= nodes.len());
        if !ascending {
            return Err(self.reader.error("OFFSETS", "not ascending up to the size of CONNECTIVITY", "ascending"));
        }
        Ok(Cells { starts, nodes: nodes.into_iter().map(|n| n as i64).collect() })
    }

    fn named(&mut self, name: &str, count: usize) -> Result<Vec<f64>, FileError> {
        let word = self.reader.word().unwrap_or_default().to_owned();
        if word != name {
            return Err(self.reader.error("a part of CELLS", word, name));
        }
        let kind = self.reader.word().unwrap_or_default().to_owned();
        self.numbers(name, count, &kind)
    }

    fn types(&mut self) -> Result<Vec<u8>, FileError> {
        let count = self.reader.count("the count of CELL_TYPES", 2)?;
        Ok(self.numbers("CELL_TYPES", count, "int")?.into_iter().map(|t| t as u8).collect())
    }

    fn tets(&self, cells: &Cells, types: &[u8]) -> Result<Vec<[u32; 4]>, FileError> {
        if cells.starts.len() != types.len() + 1 {
            let got = format!("{} for {} cells", types.len(), cells.starts.len().saturating_sub(1));
            return Err(self.reader.error("the count of CELL_TYPES", got, "one for each cell"));
        }
        let mut tets = Vec::new();
        for (cell, _) in types.iter().enumerate().filter(|(_, t)| **t == TETRAHEDRON) {
            let nodes = &cells.nodes[cells.starts[cell]..cells.starts[cell + 1]];
            let corners = <[i64; 4]>::try_from(nodes).ok().map(|n| n.map(|n| u32::try_from(n).unwrap_or(u32::MAX)));
            tets.push(corners.ok_or_else(|| {
                self.reader.error(format!("tetrahedron {cell}"), format!("{} nodes", nodes.len()), "4 nodes")
            })?);
        }
        Ok(tets)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::file::tests::{octahedron, of_text, survive_mutations};

    fn text(cells: &str) -> String {
        let points = "0 0 0 1 0 0 0 1 0 0 0 1 0.5 0.5 0.5";
        format!("# vtk DataFile Version 4.2\nx\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 5 double\n{points}\n{cells}")
    }

    #[test]
    fn labels_come_back_and_a_file_without_them_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("labelled.vtk");
        let mesh = octahedron();
        let label_of_tet = (0..mesh.tets.len()).map(|tet| 1 + 300 * tet as u16).collect();
        let labelled = LabelledMesh { mesh, label_of_tet, ..LabelledMesh::default() };
        write_labelled(&path, &labelled).unwrap();
        let back = read_labelled(&path).unwrap();
        assert_eq!((&back.mesh, &back.label_of_tet), (&labelled.mesh, &labelled.label_of_tet));
        assert_eq!(read(&path).unwrap(), labelled.mesh);
        write(&path, &labelled.mesh).unwrap();
        assert!(read_labelled(&path).unwrap_err().to_string().contains("CELL_DATA"));
    }

    fn read_text(text: &str) -> Result<TetMesh, FileError> {
        of_text(text, parse)
    }

    #[test]
    fn written_files_are_read_back() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("mesh.vtk");
        write(&path, &octahedron()).unwrap();
        assert_eq!(read(&path).unwrap(), octahedron());
    }

    #[test]
    fn labels_follow_the_grid_as_cell_data() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("labelled.vtk");
        let labelled = LabelledMesh { mesh: octahedron(), label_of_tet: vec![7, 258, 7, 7], ..LabelledMesh::default() };
        write_labelled(&path, &labelled).unwrap();
        assert_eq!(read(&path).unwrap(), labelled.mesh);
        let tail = b"LOOKUP_TABLE default\n\x00\x07\x01\x02\x00\x07\x00\x07\n";
        assert!(std::fs::read(&path).unwrap().ends_with(tail));
    }

    #[test]
    fn both_layouts_are_read_and_other_cells_left_out() {
        let mixed = read_text(&text("CELLS 2 9\n3 0 1 2\n4 0 1 2 3\nCELL_TYPES 2\n5\n10\n")).unwrap();
        assert_eq!(mixed.tets, [[0, 1, 2, 3]]);
        let split =
            "CELLS 3 7\nOFFSETS vtktypeint64\n0 3 7\nCONNECTIVITY vtktypeint64\n0 1 2 0 1 2 3\nCELL_TYPES 2\n5\n10\n";
        let split = read_text(
            &text(split).replace("4.2", "5.1").replace("0.5 0.5 0.5", "0.5 0.5 0.5\nMETADATA\nINFORMATION 0\n\n"),
        )
        .unwrap();
        assert_eq!(split, mixed);
    }

    #[test]
    fn each_fault_is_named() {
        let fault = |text: &str| read_text(text).unwrap_err().to_string();
        assert!(fault("solid").contains("line 1"));
        assert!(fault(&text("CELLS 1 5\n4 0 1 2 9\nCELL_TYPES 1\n10\n")).contains("names node 9"));
        assert!(fault(&text("CELLS 1 5\n4 0 1 2 -3\nCELL_TYPES 1\n10\n")).contains("names node"));
        assert!(fault(&text("CELLS 99999999999 5\n")).contains("count of CELLS"));
        assert!(fault(&text("CELLS 1 5\n4 0 1 2 3\nCELL_TYPES 2\n10 10\n")).contains("one for each cell"));
        assert!(fault(&text("CELLS 1 4\n3 0 1 2\nCELL_TYPES 1\n5\n")).contains("no tetrahedra"));
        assert!(fault(&text("").replace("POINTS 5", "POINTS 18446744073709551615")).contains("count of POINTS"));
        assert!(fault(&text("").replace("0 0 0", "0 0 nan")).contains("finite"));
    }

    #[test]
    fn damage_is_survived() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("good.vtk");
        write(&path, &octahedron()).unwrap();
        survive_mutations(&std::fs::read(&path).unwrap(), parse);
        survive_mutations(text("CELLS 2 9\n3 0 1 2\n4 0 1 2 3\nCELL_TYPES 2\n5\n10\n").as_bytes(), parse);
    }
}
