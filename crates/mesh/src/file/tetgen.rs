//! TetGen files: nodes in `.node`, tetrahedra in `.ele`.
//!
//! # Theory
//! `.node`: a row "count 3 attributes markers", then "number x y z …" for each node. `.ele`: "count
//! corners attributes", then "number a b c d …". Numbers start at 0 or 1, whichever the first node
//! has. `#` starts a comment.
//!
//! # Practice
//! Give either file; the other must be next to it. Attributes and markers are skipped; of 10-node
//! elements only the corners are read. The corner order is that of [`TetMesh`]; a file whose
//! elements are all negative uses the other order and is converted. Writes numbers from 1, with
//! enough digits to restore each f32.
//!
//! # Sources
//! H. Si: TetGen 1.5 manual, section 5.2.

use crate::TetMesh;
use crate::file::numbered::Numbered;
use crate::file::{Elements, FileError, Format, Import, Reader, write_atomically};
use std::path::Path;

/// The format.
pub const FORMAT: Format<TetMesh> =
    Format { name: "TetGen (.node, .ele)", endings: &["node", "ele"], starts: &[], import, write };

/// Reads a pair of TetGen files. Only indices are checked; call [`TetMesh::check`] for the rest.
pub fn import(path: &Path) -> Result<Import<TetMesh>, FileError> {
    parse(Reader::open(&path.with_extension("node"))?, Reader::open(&path.with_extension("ele"))?)
}

/// Writes a mesh as a pair of TetGen files, each atomically.
pub fn write(path: &Path, mesh: &TetMesh) -> Result<(), FileError> {
    write_atomically(&path.with_extension("node"), |out| {
        writeln!(out, "{} 3 0 0", mesh.positions.len())?;
        mesh.positions.iter().zip(1..).try_for_each(|(p, n)| writeln!(out, "{n} {} {} {}", p.x, p.y, p.z))
    })?;
    write_atomically(&path.with_extension("ele"), |out| {
        writeln!(out, "{} 4 0", mesh.tets.len())?;
        let from_one = mesh.tets.iter().map(|t| t.map(|n| n + 1)).zip(1..);
        from_one.into_iter().try_for_each(|([a, b, c, d], n)| writeln!(out, "{n} {a} {b} {c} {d}"))
    })
}

fn parse(mut nodes: Reader, mut elements: Reader) -> Result<Import<TetMesh>, FileError> {
    let numbered = parse_nodes(&mut nodes)?;
    elements.comment = Some(b'#');
    let count = elements.count("the count of elements", 10)?;
    let corners: usize = elements.number("the corners of an element", "4 or 10")?;
    let attributes: usize = elements.number("the attributes of an element", "a count")?;
    if ![4, 10].contains(&corners) {
        return Err(elements.error("the corners of an element", corners, "4 or 10"));
    }
    let mut tets = Vec::with_capacity(count);
    for tet in 0..count {
        let field = format!("element {tet}");
        let mut number = || elements.number::<u64>(&field, "a number and its nodes");
        number()?;
        let [a, b, c, d] = [number()?, number()?, number()?, number()?];
        tets.push(numbered.corners(&elements, tet, [a, b, c, d])?);
        elements.skip_words((corners - 4).saturating_add(attributes));
    }
    let of_more_nodes = if corners > 4 { count } else { 0 };
    let import = elements.mesh(numbered.positions, Elements { tets, of_more_nodes, ..Elements::default() })?;
    Ok(Import { mesh: turned(import.mesh), ..import })
}

/// Swaps the corner order if all volumes are negative.
fn turned(mut mesh: TetMesh) -> TetMesh {
    if (0..mesh.tets.len()).all(|t| mesh.volume_mm3(t) < 0.0) {
        mesh.tets.iter_mut().for_each(|tet| tet.swap(2, 3));
    }
    mesh
}

fn parse_nodes(reader: &mut Reader) -> Result<Numbered, FileError> {
    reader.comment = Some(b'#');
    let count = reader.count("the count of nodes", 8)?;
    let dimension: u32 = reader.number("the dimension", "3")?;
    if dimension != 3 {
        return Err(reader.error("the dimension", dimension, "3"));
    }
    let attributes: usize = reader.number("the count of attributes", "a count")?;
    let markers: usize = reader.number("the count of markers", "0 or 1")?;
    let mut nodes = Numbered::default();
    for node in 0..count {
        let number = reader.number(&format!("the number of node {node}"), "a number")?;
        nodes.push(number, reader.xyz(node)?);
        reader.skip_words(attributes.saturating_add(markers));
    }
    nodes.sort(reader).map(|()| nodes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Note;
    use crate::file::tests::{octahedron, survive_mutations};

    const NODES: &str = "# four\n4 3 1 1\n0 0 0 0 5.5 1\n1 1 0 0 5.5 1\n2 0 1 0 5.5 1\n3 0 0 1 5.5 1 # last\n";
    const ELEMENTS: &str = "1 4 1\n0 0 1 2 3 77\n";

    fn parsed(nodes: &str, elements: &str) -> Result<TetMesh, FileError> {
        imported(nodes, elements).map(|import| import.mesh)
    }

    fn imported(nodes: &str, elements: &str) -> Result<Import<TetMesh>, FileError> {
        let reader = |name: &str, text: &str| Reader::of(Path::new(name), text.as_bytes().to_vec());
        parse(reader("a.node", nodes), reader("a.ele", elements))
    }

    #[test]
    fn written_files_are_read_back() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("mesh.ele");
        write(&path, &octahedron()).unwrap();
        assert_eq!(import(&path).unwrap().mesh, octahedron());
        assert_eq!(import(&path.with_extension("node")).unwrap().mesh, octahedron());
    }

    #[test]
    fn attributes_are_left_out_and_faults_named() {
        let mesh = parsed(NODES, ELEMENTS).unwrap();
        assert_eq!(mesh.tets, [[0, 1, 2, 3]]);
        assert_eq!(parsed(NODES, &ELEMENTS.replace("0 1 2", "1 0 2")).unwrap().check(), Ok(()));
        let fault = |nodes: &str, elements: &str| parsed(nodes, elements).unwrap_err().to_string();
        assert!(fault(&NODES.replace("4 3 1", "4 2 1"), ELEMENTS).contains("a.node: the dimension is 2"));
        assert!(fault(&NODES.replace("3 0 0 1", "2 0 0 1"), ELEMENTS).contains("node 2 is there twice"));
        assert!(fault(NODES, "1 4 0\n0 1 0 2 9\n").contains("a.ele: tetrahedron 0"));
        assert!(fault(NODES, "99999999 4 0\n0 1 0 2 3\n").contains("count of elements"));
        assert!(fault(NODES, "1 8 0\n0 1 0 2 3 4 5 6 7\n").contains("corners of an element"));
        assert!(fault("", ELEMENTS).contains("end of the file"));
    }

    #[test]
    fn edge_nodes_are_dropped() {
        let nodes = NODES.replace("4 3 1", "5 3 1") + "4 0.5 0 0 5.5 1\n";
        let quadratic = imported(&nodes, "1 10 0\n0 0 1 2 3 4 4 4 4 4 4\n").unwrap();
        assert_eq!(quadratic.mesh.check(), Ok(()));
        assert_eq!(quadratic.notes, [Note::Corners(1), Note::Orphans(1)]);
    }

    #[test]
    fn damage_is_survived() {
        let elements = || Reader::of(Path::new("damaged.file"), ELEMENTS.as_bytes().to_vec());
        survive_mutations(NODES.as_bytes(), |nodes| parse(nodes, elements()));
        let nodes = || Reader::of(Path::new("damaged.file"), NODES.as_bytes().to_vec());
        survive_mutations(ELEMENTS.as_bytes(), |elements| parse(nodes(), elements));
    }
}
