//! Abaqus input files (`.inp`): nodes and tetrahedra only.
//!
//! # Theory
//! Keyword lines start with `*`, comments with `**`; data rows with commas follow. `*NODE` has
//! "number, x, y, z", `*ELEMENT, TYPE=C3D4` has "number, a, b, c, d"; a row that ends in a comma
//! continues on the next line. Numbers are those of a part, of an instance or of the assembly.
//! `*INSTANCE` places a part: a row with a translation, then one with two points of an axis and the
//! degrees to turn about it.
//!
//! # Practice
//! Reads C3D4 and the corners of C3D10 (with their variants: C3D10M, C3D4H …), each part once for
//! every instance, or as it is in a file without instances; other elements, sets, materials and
//! steps are skipped. Writes nodes and elements only. Positions are mm; the corner order is that of
//! [`TetMesh`].
//!
//! # Sources
//! Abaqus Keywords Reference Guide: *NODE, *ELEMENT, *INSTANCE.

use crate::TetMesh;
use crate::file::numbered::Numbered;
use crate::file::{Elements, FileError, Format, Import, Reader, write_atomically};
use glam::{DAffine3, DVec3};
use std::path::Path;

/// The format.
pub const FORMAT: Format<TetMesh> = Format { name: "Abaqus (.inp)", endings: &["inp"], starts: &["*"], import, write };

/// Reads the tetrahedra of an Abaqus file. Only indices are checked; call [`TetMesh::check`] for
/// the rest.
pub fn import(path: &Path) -> Result<Import<TetMesh>, FileError> {
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
    /// Elements, and how many nodes they have if they are tetrahedra.
    Elements(Option<usize>),
    Placement,
    Other,
}

/// Nodes and elements with numbers of their own: the model, a part, the assembly or an instance.
#[derive(Default)]
struct Scope {
    /// Its name, if it is a part.
    part: Option<String>,
    /// The part that is placed, if it is an instance.
    instance_of: Option<String>,
    place: DAffine3,
    nodes: Numbered,
    tets: Vec<[u64; 4]>,
}

pub(crate) fn parse(mut reader: Reader) -> Result<Import<TetMesh>, FileError> {
    let (mut scopes, mut at, mut assembly) = (vec![Scope::default()], 0, 0);
    let mut elements = Elements::default();
    let mut rows = Rows::Other;
    while let Some(line) = reader.line() {
        let line = line.trim();
        if line.is_empty() || line.starts_with("**") {
            continue;
        }
        if let Some(keyword) = line.strip_prefix('*') {
            let keyword = whole_keyword(&mut reader, keyword);
            rows = rows_of(&keyword);
            match keyword.split(',').next().unwrap_or_default() {
                kind @ ("PART" | "ASSEMBLY" | "INSTANCE") => {
                    at = scopes.len();
                    assembly = if kind == "ASSEMBLY" { at } else { assembly };
                    let part = (kind == "PART").then(|| option(&keyword, "NAME="));
                    let instance_of = (kind == "INSTANCE").then(|| option(&keyword, "PART="));
                    scopes.push(Scope { part, instance_of, ..Scope::default() });
                }
                "ENDINSTANCE" => at = assembly,
                "ENDPART" | "ENDASSEMBLY" => at = 0,
                _ => {}
            }
            continue;
        }
        let scope = &mut scopes[at];
        match rows {
            Rows::Nodes => {
                let field = format!("node row {}", scope.nodes.positions.len() + 1);
                let values = numbers(&reader, &field, line, 4)?;
                let position = reader.position(values[0] as usize, [values[1], values[2], values[3]])?;
                scope.nodes.push(values[0] as u64, position);
            }
            Rows::Elements(nodes) => {
                if let Some(nodes) = nodes {
                    let field = format!("element row {}", scope.tets.len() + 1);
                    let values = numbers(&reader, &field, line, 5)?;
                    scope.tets.push([1, 2, 3, 4].map(|n| values[n] as u64));
                    elements.of_more_nodes += usize::from(nodes > 4);
                } else {
                    elements.others += 1;
                }
                skip_continuation(&mut reader, line);
            }
            Rows::Placement => scope.place = placement(&reader, line)? * scope.place,
            Rows::Other => {}
        }
    }
    scopes.iter_mut().try_for_each(|scope| scope.nodes.sort(&reader))?;
    assembled(&reader, &scopes, elements)
}

/// Puts every scope at its place: a part at those of its instances, or as it is if there are none.
fn assembled(reader: &Reader, scopes: &[Scope], mut elements: Elements) -> Result<Import<TetMesh>, FileError> {
    let is_assembly = scopes.iter().any(|scope| scope.instance_of.is_some());
    let mut positions = Vec::new();
    for placed in scopes.iter().filter(|scope| !is_assembly || scope.part.is_none()) {
        let part = scopes.iter().find(|scope| scope.part.is_some() && scope.part == placed.instance_of);
        if let (None, Some(name), []) = (part, &placed.instance_of, &placed.tets[..]) {
            return Err(reader.error("an instance", format!("of part {name:?}"), "of a part that is in the file"));
        }
        for scope in part.into_iter().chain([placed]) {
            let first = positions.len();
            // Instances multiply what the file holds.
            if first + scope.nodes.positions.len() + elements.tets.len() + scope.tets.len() > 16 * reader.size() {
                return Err(reader.error("the instances", "more than 16 times the file", "fewer; give a flat file"));
            }
            for (node, position) in scope.nodes.positions.iter().enumerate() {
                let at = placed.place.transform_point3(position.as_dvec3());
                positions.push(reader.position(node, at.to_array())?);
            }
            for (tet, &numbers) in scope.tets.iter().enumerate() {
                let corners = scope.nodes.corners(reader, tet, numbers)?;
                elements.tets.push(corners.map(|n| n.saturating_add(first as u32)));
            }
        }
    }
    reader.mesh(positions, elements)
}

/// A keyword with its options in upper case and without blanks; a comma at the end continues it.
fn whole_keyword(reader: &mut Reader, line: &str) -> String {
    let mut keyword = line.to_owned();
    while keyword.trim_end().ends_with(',') {
        let Some(next) = reader.line() else { break };
        keyword += &next;
    }
    keyword.split_whitespace().collect::<String>().to_ascii_uppercase()
}

/// The value of an option, such as `NAME=`; empty without it.
fn option(keyword: &str, name: &str) -> String {
    let value = keyword.split(',').find_map(|option| option.strip_prefix(name));
    value.unwrap_or_default().trim_matches('"').to_owned()
}

fn rows_of(keyword: &str) -> Rows {
    match keyword.split(',').next() {
        Some("NODE") => Rows::Nodes,
        Some("ELEMENT") => {
            let kind = option(keyword, "TYPE=");
            Rows::Elements([(4, "C3D4"), (10, "C3D10")].iter().find(|(_, tet)| kind.contains(tet)).map(|(n, _)| *n))
        }
        Some("INSTANCE") => Rows::Placement,
        _ => Rows::Other,
    }
}

/// The motion of a row under `*INSTANCE`.
fn placement(reader: &Reader, line: &str) -> Result<DAffine3, FileError> {
    let number = |word: &str| if word.trim().is_empty() { Some(0.0) } else { word.trim().parse().ok() };
    let values: Option<Vec<f64>> = line.trim_end_matches(',').split(',').map(number).collect();
    let motion = match values.as_deref() {
        Some(&[x]) => Some(DAffine3::from_translation(DVec3::new(x, 0.0, 0.0))),
        Some(&[x, y]) => Some(DAffine3::from_translation(DVec3::new(x, y, 0.0))),
        Some(&[x, y, z]) => Some(DAffine3::from_translation(DVec3::new(x, y, z))),
        Some(&[ax, ay, az, bx, by, bz, degrees]) => {
            let from = DVec3::new(ax, ay, az);
            (DVec3::new(bx, by, bz) - from).try_normalize().map(|axis| {
                let turn = DAffine3::from_axis_angle(axis, degrees.to_radians());
                DAffine3::from_translation(from) * turn * DAffine3::from_translation(-from)
            })
        }
        _ => None,
    };
    motion.ok_or_else(|| {
        reader.error("a row of an instance", line, "a translation, or two points of an axis and an angle in degrees")
    })
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
    use crate::Note;
    use crate::file::tests::{octahedron, of_bytes, of_text, survive_mutations};
    use trepan_geometry::Vec3;

    const TEXT: &str = "*Heading\nx\n** note\n*Node, nset=all\n 10, 0, 0, 0\n20, 1., 0, 0\n30, 0, 1e0, 0\n40, 0, 0, 1\n\
                        *Element, type=S3\n1, 10, 20, 30\n*Element, type=C3D10M, elset=brain\n2, 10, 20, 30, 40, 1, 2, 3,\n4, 5, 6\n*Material\n1, 2\n";

    #[test]
    fn written_files_are_read_back() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("mesh.inp");
        write(&path, &octahedron()).unwrap();
        assert_eq!(import(&path).unwrap().mesh, octahedron());
    }

    #[test]
    fn other_elements_are_left_out_and_faults_named() {
        let import = of_bytes(TEXT.as_bytes(), parse).unwrap();
        assert_eq!((import.mesh.tets, import.notes), (vec![[0, 1, 2, 3]], vec![Note::Corners(1), Note::Others(1)]));
        let fault = |from: &str, to: &str| of_text(&TEXT.replace(from, to), parse).unwrap_err().to_string();
        assert!(fault("40, 0, 0, 1", "30, 0, 0, 1").contains("node 30 is there twice"));
        assert!(fault("40, 0, 0, 1", "40, 0, 0").contains("node row 4"));
        assert!(fault("2, 10, 20, 30, 40", "2, 10, 20, 30, 41").contains("tetrahedron 0"));
        assert!(fault("C3D10M", "C3D8").contains("no tetrahedra"));
    }

    const PARTS: &str = "*Part, name=\"The Brain\"\n*Node\n1, 0, 0, 0\n2, 1, 0, 0\n3, 0, 1, 0\n4, 0, 0, 1\n*Element,\ntype=C3D4\n1, 1, 2, 3, 4\n*End Part\n\
                         *Part, name=Tumour\n*Node\n1, 5, 5, 5\n2, 6, 5, 5\n3, 5, 6, 5\n4, 5, 5, 6\n*Element, type=C3D4\n1, 1, 2, 3, 4\n*End Part\n\
                         *Assembly, name=A\n*Instance, name=B-1, part=\"The Brain\"\n10, 0., 0.\n10, 0, 0, 10, 0, 5, 90.\n*End Instance\n\
                         *Instance, name=B-2, part=\"the brain\"\n*End Instance\n*Instance, name=C, part=none\n0, 0,\n*Node\n1, 7, 7, 7\n2, 8, 7, 7\n\
                         3, 7, 8, 7\n4, 7, 7, 8\n*Element, type=C3D4\n1, 1, 2, 3, 4\n*End Instance\n*Node\n1, 99, 99, 99\n*Element, type=MASS\n1, 1\n*End Assembly\n";

    #[test]
    fn parts_have_numbers_of_their_own_and_instances_move_them() {
        let import = of_bytes(PARTS.as_bytes(), parse).unwrap();
        assert_eq!(import.notes, [Note::Others(1), Note::Orphans(1)]);
        assert_eq!((import.mesh.check(), import.mesh.tets.len()), (Ok(()), 3));
        let at = |node: usize| import.mesh.positions[node].to_array();
        // The second node lies at x = 1, comes to 11 and turns about the axis at 10.
        let turned = import.mesh.positions[1] - Vec3::new(10.0, 1.0, 0.0);
        assert!(turned.length() < 1e-5, "{turned}");
        assert_eq!([at(4), at(5), at(8)], [[0.0; 3], [1.0, 0.0, 0.0], [7.0; 3]]);
        let (parts, _) = PARTS.split_once("*Assembly").unwrap();
        let apart = of_text(parts, parse).unwrap();
        assert_eq!((apart.tets.len(), apart.positions[4].to_array()), (2, [5.0; 3]));
        let fault = |from: &str, to: &str| of_text(&PARTS.replace(from, to), parse).unwrap_err().to_string();
        assert!(fault("\"the brain\"", "skull").contains("an instance is of part \"SKULL\""));
        assert!(fault("10, 0, 0, 10, 0, 5, 90.", "10, 0, 0, 10, 0, 0, 90.").contains("a row of an instance"));
        let (large, _) = parts.split_once("*End").unwrap();
        let large = large.replace("4, 0, 0, 1\n", &(4..4000).map(|n| format!("{n}, 0, 0, 1\n")).collect::<String>());
        let many = "*Instance, part=The Brain\n".repeat(large.len() / 10);
        assert!(of_text(&format!("{large}*End Part\n{many}"), parse).unwrap_err().to_string().contains("16 times"));
    }

    #[test]
    fn damage_is_survived() {
        survive_mutations(TEXT.as_bytes(), parse);
        survive_mutations(PARTS.as_bytes(), parse);
    }
}
