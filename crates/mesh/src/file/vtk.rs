//! Legacy VTK files (`.vtk`) of tetrahedra.
//!
//! # Theory
//! A version, a title and an encoding, then `POINTS`, `CELLS` and `CELL_TYPES` of an unstructured
//! grid, as text or as big-endian binary. Up to version 4 a cell is a count and its nodes in one
//! list; version 5 splits that into `OFFSETS` and `CONNECTIVITY`. Cell type 10 is the 4-node
//! tetrahedron, 24 the 10-node one, 71 and 78 those of any order.
//!
//! # Practice
//! Reads both encodings and both layouts, keywords in any case; skips cells of other types, point
//! and cell data, and `FIELD` and `METADATA` wherever they stand. Of tetrahedra with more nodes the
//! corners are read. Writes version 3.0, binary, f32, which every version of VTK reads. Positions
//! are mm; VTK has no unit. The corner order is the same as in [`TetMesh`].
//!
//! # Sources
//! VTK File Formats, in The VTK User's Guide, 11th edition.

use crate::TetMesh;
use crate::file::{FileError, Format, Import, Reader, vtu, write_atomically};
use crate::lattice::LabelledMesh;
use std::io::Write;
use std::path::Path;
use trepan_geometry::Vec3;

/// The format.
pub const FORMAT: Format<TetMesh> =
    Format { name: "legacy VTK (.vtk)", endings: &["vtk"], starts: &["# vtk DataFile"], import, write };

/// Reads the tetrahedra of a legacy VTK file. Only indices are checked; call [`TetMesh::check`] for
/// the rest.
pub fn import(path: &Path) -> Result<Import<TetMesh>, FileError> {
    parse(Reader::open(path)?)
}

/// Reads a file written by [`write_labelled`]: tetrahedra only, with their labels as the first cell
/// data, `label`.
pub fn read_labelled(path: &Path) -> Result<LabelledMesh, FileError> {
    let mut file = Legacy { reader: Reader::open(path)?, binary: false, offsets: false };
    file.header()?;
    let mesh = file.body()?.mesh;
    let label_of_tet = file.labels(mesh.tets.len())?;
    Ok(LabelledMesh { mesh, label_of_tet, ..LabelledMesh::default() })
}

pub(crate) fn parse(reader: Reader) -> Result<Import<TetMesh>, FileError> {
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
    write!(out, "# vtk DataFile Version 3.0\ntetrahedra, mm, SPACE=RAS\nBINARY\nDATASET UNSTRUCTURED_GRID\n")?;
    writeln!(out, "POINTS {} float", mesh.positions.len())?;
    mesh.positions.iter().flat_map(Vec3::to_array).try_for_each(|c| out.write_all(&c.to_be_bytes()))?;
    writeln!(out, "\nCELLS {count} {}", 5 * count)?;
    for tet in &mesh.tets {
        [4, tet[0], tet[1], tet[2], tet[3]].iter().try_for_each(|n| out.write_all(&n.to_be_bytes()))?;
    }
    writeln!(out, "\nCELL_TYPES {count}")?;
    (0..count).try_for_each(|_| out.write_all(&u32::from(vtu::TETRAHEDRON).to_be_bytes()))?;
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
        let title = self.reader.line().unwrap_or_default();
        self.reader.heed_space(&title);
        self.binary = match self.keyword().as_str() {
            "binary" => true,
            "ascii" => false,
            other => return Err(self.reader.error("the encoding", other, "ASCII or BINARY")),
        };
        Ok(())
    }

    /// The next word in lower case.
    fn keyword(&mut self) -> String {
        self.reader.word().unwrap_or_default().to_ascii_lowercase()
    }

    fn body(&mut self) -> Result<Import<TetMesh>, FileError> {
        let (mut positions, mut cells, mut types) = (None, None, None);
        while positions.is_none() || cells.is_none() || types.is_none() {
            match self.keyword().as_str() {
                "dataset" => self.data_set()?,
                "points" => positions = Some(self.points()?),
                "cells" if self.offsets => cells = Some(self.split_cells()?),
                "cells" => cells = Some(self.mixed_cells()?),
                "cell_types" => types = Some(self.types()?),
                "metadata" => self.skip_metadata(),
                "field" => self.skip_field()?,
                other => {
                    return Err(self.reader.error(
                        "the next section",
                        format!("{other:?}"),
                        "POINTS, CELLS or CELL_TYPES, each once",
                    ));
                }
            }
        }
        let cells = cells.unwrap_or_default();
        let elements = vtu::elements(&self.reader, &cells.starts, &cells.nodes, &types.unwrap_or_default())?;
        self.reader.mesh(positions.unwrap_or_default(), elements)
    }

    fn data_set(&mut self) -> Result<(), FileError> {
        match self.keyword().as_str() {
            "unstructured_grid" => Ok(()),
            other => Err(self.reader.error("the data set", other, "UNSTRUCTURED_GRID; convert it to tetrahedra")),
        }
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

    /// Skips named arrays. Strings are a line each in text, and a length and bytes in binary.
    fn skip_field(&mut self) -> Result<(), FileError> {
        let field = "an array of FIELD";
        self.reader.word();
        let arrays: usize = self.reader.number("the count of FIELD", "a count")?;
        for _ in 0..arrays {
            let mut name = self.keyword();
            while name == "metadata" {
                self.skip_metadata();
                name = self.keyword();
            }
            if name == "null_array" {
                continue;
            }
            let components: usize = self.reader.number(field, "a count of components")?;
            let tuples: usize = self.reader.number(field, "a count of tuples")?;
            let count = components.saturating_mul(tuples);
            match self.keyword().as_str() {
                "string" if self.binary => {
                    self.reader.line();
                    (0..count).try_for_each(|_| self.skip_string())?;
                }
                "string" | "variant" => {
                    (0..=count).try_for_each(|_| self.reader.line().map(drop));
                }
                kind if self.binary => {
                    let each = if kind == "bit" { 1 } else { 8 * self.number_type(field, kind)?.0 };
                    self.reader.line();
                    self.reader.take(field, count.saturating_mul(each).div_ceil(8))?;
                }
                _ => self.reader.skip_words(count),
            }
        }
        Ok(())
    }

    /// Skips a string, whose length has a size in the two highest bits of its first byte.
    fn skip_string(&mut self) -> Result<(), FileError> {
        let field = "a string of FIELD";
        let first = self.reader.array::<1>(field)?[0];
        let more = [7, 3, 1, 0][usize::from(first >> 6)];
        let more = self.reader.take(field, more)?;
        let length = more.iter().fold(u64::from(first & 63), |length, &byte| length << 8 | u64::from(byte));
        self.reader.take(field, usize::try_from(length).unwrap_or(usize::MAX)).map(drop)
    }

    fn points(&mut self) -> Result<Vec<Vec3>, FileError> {
        let count = self.reader.count("the count of POINTS", 3)?;
        let kind = self.keyword();
        let values = self.numbers("POINTS", 3 * count, &kind)?;
        values.as_chunks::<3>().0.iter().enumerate().map(|(n, &xyz)| self.reader.position(n, xyz)).collect()
    }

    /// Size of a VTK type and its conversion. `vtkIdType` is written as int.
    fn number_type(&self, field: &str, kind: &str) -> Result<(usize, vtu::Meaning), FileError> {
        let name = match kind {
            "char" | "signed_char" | "vtktypeint8" => "Int8",
            "unsigned_char" | "vtktypeuint8" => "UInt8",
            "short" | "vtktypeint16" => "Int16",
            "unsigned_short" | "vtktypeuint16" => "UInt16",
            "int" | "vtkidtype" | "vtktypeint32" => "Int32",
            "unsigned_int" | "vtktypeuint32" => "UInt32",
            "long" | "long_long" | "vtktypeint64" => "Int64",
            "unsigned_long" | "unsigned_long_long" | "vtktypeuint64" => "UInt64",
            "float" => "Float32",
            "double" => "Float64",
            other => other,
        };
        let wanted = "float, double, int or another of VTK";
        vtu::number_type(name).ok_or_else(|| self.reader.error(format!("the type of {field}"), kind, wanted))
    }

    /// Reads numbers of a VTK type in the file's encoding.
    fn numbers(&mut self, field: &str, count: usize, kind: &str) -> Result<Vec<f64>, FileError> {
        let (size, of) = self.number_type(field, kind)?;
        if self.binary {
            self.reader.line();
            return Ok(vtu::numbers(self.reader.take(field, count.saturating_mul(size))?, (size, of), true));
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
        let word = self.keyword();
        if !word.eq_ignore_ascii_case(name) {
            return Err(self.reader.error("a part of CELLS", word, name));
        }
        let kind = self.keyword();
        self.numbers(name, count, &kind)
    }

    fn types(&mut self) -> Result<Vec<u8>, FileError> {
        let count = self.reader.count("the count of CELL_TYPES", 2)?;
        Ok(self.numbers("CELL_TYPES", count, "int")?.into_iter().map(|t| t as u8).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Note;
    use crate::file::tests::{octahedron, of_bytes, of_text, survive_mutations};

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
        assert_eq!(import(&path).unwrap().mesh, labelled.mesh);
        write(&path, &labelled.mesh).unwrap();
        assert!(read_labelled(&path).unwrap_err().to_string().contains("CELL_DATA"));
    }

    /// Fields with every kind of array that is stored in its own way, and the blocks around them.
    fn fields(binary: bool) -> Vec<u8> {
        let mut bytes = b"FIELD FieldData 6\n".to_vec();
        let arrays: [(&str, &str, &[u8]); 5] = [
            ("TIME 1 1 double", "1.5", &[0; 8]),
            ("two%20words 2 3 vtkIdType", "1 2 3\n4 5 6 ", b"POINTS 9 float\n12345678"),
            ("flags 1 9 bit", "1 0 1 0 1 0 1 0 1 ", b"\n\n"),
            ("text 1 2 string", "POINTS 5 float\n", b"\xc5abcde\x80\x01x"),
            ("none 3 0 float", "", b""),
        ];
        for (at, (head, text, raw)) in arrays.into_iter().enumerate() {
            bytes.extend([head.as_bytes(), b"\n", if binary { raw } else { text.as_bytes() }, b"\n"].concat());
            bytes.extend(if at == 1 { &b"METADATA\nINFORMATION 1\nNAME x LOCATION y\nPOINTS\n\n"[..] } else { b"" });
        }
        bytes.extend(b"NULL_ARRAY\nMETADATA\nCOMPONENT_NAMES\nPOINTS\n\n");
        bytes
    }

    #[test]
    fn fields_are_skipped_wherever_they_stand() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("mesh.vtk");
        write(&path, &octahedron()).unwrap();
        let binary = std::fs::read(&path).unwrap();
        let cells = "CELLS 2 9\n3 0 1 2\n4 0 1 2 3\nCELL_TYPES 2\n5\n10\n";
        let plain = read_text(&text(cells)).unwrap();
        for (good, mesh) in [(text(cells).into_bytes(), plain), (binary, octahedron())] {
            let fields = fields(good != text(cells).into_bytes());
            for before in ["DATASET", "POINTS", "CELLS", "CELL_TYPES"] {
                let at = good.windows(before.len()).position(|w| w == before.as_bytes()).unwrap();
                let bytes = [&good[..at], &fields, &good[at..]].concat();
                assert_eq!(of_bytes(&bytes, parse).unwrap().mesh, mesh, "before {before}");
                survive_mutations(&bytes, parse);
            }
            let data = [&good[..], b"POINT_DATA 6\n", &fields, b"CELL_DATA 4\n", &fields].concat();
            assert_eq!(of_bytes(&data, parse).unwrap().mesh, mesh);
        }
        let cut = text("FIELD f 1\nx 1 5 double\n0 0 0");
        assert!(read_text(&cut).is_err() && read_text(&cut.replace("ASCII", "BINARY")).is_err());
    }

    #[test]
    fn keywords_may_have_any_case_and_blank_lines_around_them() {
        let mixed = text("CELLS 1 5\n4 0 1 2 3\nCELL_TYPES 1\n10\n");
        let split = "CELLS 2 4\nOFFSETS vtktypeint64\n0 4\nCONNECTIVITY vtktypeint64\n0 1 2 3\nCELL_TYPES 1\n10\n";
        for text in [&mixed, &text(split).replace("4.2", "5.1")] {
            let (version, rest) = text.split_once('\n').unwrap();
            let loose = rest.to_ascii_lowercase().replace("ascii", "\nascii\n\n").replace("points", "\n\npoints");
            assert_eq!(read_text(&format!("{version}\n{loose}")).unwrap(), read_text(text).unwrap());
        }
    }

    #[test]
    fn of_tetrahedra_with_more_nodes_the_corners_are_read() {
        let points = text("").replace("POINTS 5", "POINTS 10").replace("0.5 0.5 0.5", &"2 ".repeat(18));
        for kind in [24, 71, 78] {
            let cells = format!("CELLS 2 16\n10 0 1 2 3 4 5 6 7 8 9\n4 0 1 2 4\nCELL_TYPES 2\n{kind} 10\n");
            let import = of_bytes((points.clone() + &cells).as_bytes(), parse).unwrap();
            assert_eq!(import.mesh.tets, [[0, 1, 2, 3], [0, 1, 2, 4]]);
            assert_eq!(import.notes, [Note::Corners(1), Note::Orphans(5)]);
        }
    }

    fn read_text(text: &str) -> Result<TetMesh, FileError> {
        of_text(text, parse)
    }

    #[test]
    fn written_files_are_read_back() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("mesh.vtk");
        write(&path, &octahedron()).unwrap();
        assert_eq!(import(&path).unwrap().mesh, octahedron());
    }

    #[test]
    fn labels_follow_the_grid_as_cell_data() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("labelled.vtk");
        let labelled = LabelledMesh { mesh: octahedron(), label_of_tet: vec![7, 258, 7, 7], ..LabelledMesh::default() };
        write_labelled(&path, &labelled).unwrap();
        assert_eq!(import(&path).unwrap().mesh, labelled.mesh);
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
