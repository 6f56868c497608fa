//! Gmsh files (`.msh`), versions 1, 2.2 and 4.1, text and binary.
//!
//! # Theory
//! Sections between `$Name` and `$EndName` (`$NOD` and `$ELM` in version 1). Nodes and elements
//! carry their own numbers. Version 2.2 gives each element its type and tags; version 4.1 groups
//! both by geometric entity. Element type 4 is the 4-node tetrahedron, 11 the 10-node one, 29 to
//! 31 those of higher order. Binary files hold little-endian i32, u64 and f64 after the counts.
//!
//! # Practice
//! Tetrahedra are read (of more nodes the corners), once if several physical groups list them;
//! other elements and all tags are skipped. Writes 2.2 as text, with enough digits to restore each
//! f32. Positions are mm; the corner order is that of [`TetMesh`]. Version 4.0 is rejected.
//!
//! # Sources
//! C. Geuzaine, J.-F. Remacle: Gmsh reference manual, sections MSH file format.

use crate::TetMesh;
use crate::file::numbered::Numbered;
use crate::file::{Elements, FileError, Format, Import, Reader, write_atomically};
use std::path::Path;

/// The format.
pub const FORMAT: Format<TetMesh> =
    Format { name: "Gmsh (.msh)", endings: &["msh"], starts: &["$MeshFormat", "$NOD"], import, write };

/// Reads the tetrahedra of a Gmsh file. Only indices are checked; call [`TetMesh::check`] for the
/// rest.
pub fn import(path: &Path) -> Result<Import<TetMesh>, FileError> {
    parse(Reader::open(path)?)
}

/// Writes a mesh as Gmsh 2.2 text, atomically.
pub fn write(path: &Path, mesh: &TetMesh) -> Result<(), FileError> {
    write_atomically(path, |out| {
        writeln!(out, "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n{}", mesh.positions.len())?;
        mesh.positions.iter().zip(1..).try_for_each(|(p, n)| writeln!(out, "{n} {} {} {}", p.x, p.y, p.z))?;
        writeln!(out, "$EndNodes\n$Elements\n{}", mesh.tets.len())?;
        let mut from_one = mesh.tets.iter().map(|t| t.map(|n| n + 1)).zip(1..);
        from_one.try_for_each(|([a, b, c, d], n)| writeln!(out, "{n} 4 2 1 1 {a} {b} {c} {d}"))?;
        writeln!(out, "$EndElements")
    })
}

pub(crate) fn parse(mut reader: Reader) -> Result<Import<TetMesh>, FileError> {
    let first = reader.line().unwrap_or_default();
    if first.trim() == "$NOD" {
        return Gmsh {
            reader,
            binary: false,
            nodes: Numbered::default(),
            tets: Vec::new(),
            beside: Elements::default(),
        }
        .version_1();
    }
    if first.trim() != "$MeshFormat" {
        return Err(reader.error("line 1", first, "$MeshFormat, or $NOD in version 1"));
    }
    let version = reader.word().unwrap_or_default().to_owned();
    let newer = match version.as_str() {
        "2" | "2.1" | "2.2" => false,
        "4.1" => true,
        other => return Err(reader.error("the version", other, "2.2 or 4.1; convert it with gmsh")),
    };
    let binary = reader.number::<u8>("the file type", "0 or 1")? == 1;
    let word_size: u8 = reader.number("the size of numbers", "8")?;
    if word_size != 8 {
        return Err(reader.error("the size of numbers", word_size, "8"));
    }
    reader.line();
    if binary && i32::from_le_bytes(reader.array("the byte order mark")?) != 1 {
        return Err(reader.error("the byte order mark", "not 1", "1: the file must be little-endian"));
    }
    let file = Gmsh { reader, binary, nodes: Numbered::default(), tets: Vec::new(), beside: Elements::default() };
    file.sections(newer)
}

struct Gmsh {
    reader: Reader,
    binary: bool,
    nodes: Numbered,
    /// Corners by node number.
    tets: Vec<[u64; 4]>,
    /// The counts of other elements.
    beside: Elements,
}

impl Gmsh {
    fn sections(mut self, newer: bool) -> Result<Import<TetMesh>, FileError> {
        while let Some(line) = self.reader.line() {
            match (line.trim(), newer) {
                ("$Nodes", false) => self.nodes_2()?,
                ("$Nodes", true) => self.nodes_4()?,
                ("$Elements", false) => self.elements_2()?,
                ("$Elements", true) => self.elements_4()?,
                (name, _) if name.starts_with('$') && !name.starts_with("$End") => {
                    let end = format!("$End{}", &name[1..]);
                    self.reader.skip_past_line(&end)?;
                }
                _ => {}
            }
        }
        self.finish()
    }

    fn version_1(mut self) -> Result<Import<TetMesh>, FileError> {
        self.nodes_2()?;
        self.reader.skip_past_line("$ELM")?;
        let count = self.count_line("the count of $ELM", 8, 8)?;
        for _ in 0..count {
            let [_, kind, _] = self.entity("the header of an element")?;
            self.int("the entity of an element")?;
            let nodes = self.int("the nodes of an element")?;
            let known = nodes_of(kind).is_some_and(|n| n as u64 == nodes);
            if !known {
                return Err(self.reader.error(
                    "an element",
                    format!("type {kind} with {nodes} nodes"),
                    "a type with its number of nodes",
                ));
            }
            self.element(kind, Self::int)?;
        }
        self.finish()
    }

    fn finish(mut self) -> Result<Import<TetMesh>, FileError> {
        self.nodes.sort(&self.reader)?;
        let corners = |(t, numbers): (usize, &[u64; 4])| self.nodes.corners(&self.reader, t, *numbers);
        let tets = self.tets.iter().enumerate().map(corners).collect::<Result<_, _>>()?;
        self.reader.mesh(self.nodes.positions, Elements { tets, ..self.beside })
    }

    /// A 4-byte number of a binary file, or a word of a text.
    fn int(&mut self, field: &str) -> Result<u64, FileError> {
        if !self.binary {
            return self.reader.number::<i64>(field, "a whole number").map(|n| n as u64);
        }
        let bytes: [u8; 4] = self.reader.array(field)?;
        Ok(i64::from(i32::from_le_bytes(bytes)) as u64)
    }

    /// An 8-byte number of a binary file, or a word of a text.
    fn long(&mut self, field: &str) -> Result<u64, FileError> {
        if self.binary {
            self.reader.array(field).map(u64::from_le_bytes)
        } else {
            self.reader.number(field, "a whole number")
        }
    }

    fn double(&mut self, field: &str) -> Result<f64, FileError> {
        if self.binary {
            self.reader.array(field).map(f64::from_le_bytes)
        } else {
            self.reader.number(field, "a number")
        }
    }

    /// Parses a count of items with the given sizes in text and binary.
    fn count(&mut self, field: &str, in_text: usize, in_binary: usize) -> Result<usize, FileError> {
        let count = self.long(field)?;
        self.reader.checked_count(field, count, if self.binary { in_binary } else { in_text })
    }

    /// Parses a count in version 2, always a line of text.
    fn count_line(&mut self, field: &str, in_text: usize, in_binary: usize) -> Result<usize, FileError> {
        let count = self.reader.number(field, "a count")?;
        self.reader.line();
        self.reader.checked_count(field, count, if self.binary { in_binary } else { in_text })
    }

    fn node(&mut self, number: u64) -> Result<(), FileError> {
        let field = "the coordinates of a node";
        let xyz = [self.double(field)?, self.double(field)?, self.double(field)?];
        let position = self.reader.position(number as usize, xyz)?;
        self.nodes.push(number, position);
        Ok(())
    }

    fn nodes_2(&mut self) -> Result<(), FileError> {
        let count = self.count_line("the count of $Nodes", 8, 28)?;
        for _ in 0..count {
            let number = self.int("the number of a node")?;
            self.node(number)?;
        }
        Ok(())
    }

    fn nodes_4(&mut self) -> Result<(), FileError> {
        let blocks = self.count("the blocks of $Nodes", 8, 20)?;
        (0..3).try_for_each(|_| self.long("the totals of $Nodes").map(drop))?;
        for _ in 0..blocks {
            let [dimension, _, parametric] = self.entity("a block of $Nodes")?;
            let count = self.count("the count of a block of $Nodes", 8, 32)?;
            let numbers = (0..count).map(|_| self.long("the number of a node")).collect::<Result<Vec<u64>, _>>()?;
            for number in numbers {
                self.node(number)?;
                let parameters = if parametric == 1 { dimension.min(3) } else { 0 };
                (0..parameters).try_for_each(|_| self.double("a parameter of a node").map(drop))?;
            }
        }
        Ok(())
    }

    fn entity(&mut self, field: &str) -> Result<[u64; 3], FileError> {
        Ok([self.int(field)?, self.int(field)?, self.int(field)?])
    }

    fn elements_2(&mut self) -> Result<(), FileError> {
        let count = self.count_line("the count of $Elements", 8, 12)?;
        let mut read = 0;
        while read < count {
            // Text has one header per element: number, type, tags; binary has one for several:
            // type, count, tags.
            let [first, second, tags] = self.entity("the header of an element")?;
            let (kind, elements) = if self.binary { (first, second) } else { (second, 1) };
            let elements = self.reader.checked_count("the elements under a header", elements, 4)?;
            for _ in 0..elements {
                let unused = if self.binary { tags.saturating_add(1) } else { tags };
                let unused = self.reader.checked_count("the tags of an element", unused, 2)?;
                (0..unused).try_for_each(|_| self.int("a tag").map(drop))?;
                self.element(kind, Self::int)?;
            }
            read += elements;
        }
        Ok(())
    }

    fn elements_4(&mut self) -> Result<(), FileError> {
        let blocks = self.count("the blocks of $Elements", 8, 20)?;
        (0..3).try_for_each(|_| self.long("the totals of $Elements").map(drop))?;
        for _ in 0..blocks {
            let [_, _, kind] = self.entity("a block of $Elements")?;
            let count = self.count("the count of a block of $Elements", 4, 16)?;
            for _ in 0..count {
                self.long("the number of an element")?;
                self.element(kind, Self::long)?;
            }
        }
        Ok(())
    }

    /// Reads the nodes of an element; keeps tetrahedra.
    fn element(&mut self, kind: u64, number: fn(&mut Self, &str) -> Result<u64, FileError>) -> Result<(), FileError> {
        let Some(nodes) = nodes_of(kind) else {
            return Err(self.reader.error("an element's type", kind, "one of 1 to 31 (see the Gmsh manual)"));
        };
        let mut corners = [0; 4];
        for at in 0..nodes {
            let node = number(self, "the nodes of an element")?;
            if at < 4 {
                corners[at] = node;
            }
        }
        match kind {
            4 => self.tets.push(corners),
            11 | 29..=31 => {
                self.beside.of_more_nodes += 1;
                self.tets.push(corners);
            }
            _ => self.beside.others += 1,
        }
        Ok(())
    }
}

/// Number of nodes of an element type.
fn nodes_of(kind: u64) -> Option<usize> {
    const NODES: [usize; 31] =
        [2, 3, 4, 4, 8, 6, 5, 3, 6, 9, 10, 27, 18, 14, 1, 8, 20, 15, 13, 9, 10, 12, 15, 15, 21, 4, 5, 6, 20, 35, 56];
    let at = usize::try_from(kind).ok()?.checked_sub(1)?;
    NODES.get(at).copied()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Note;
    use crate::file::tests::{octahedron, of_bytes, of_text, survive_mutations};

    const OLD: &str = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n1\n3 1 \"brain\"\n$EndPhysicalNames\n$Nodes\n4\n7 0 0 0\n8 1 0 0\n9 0 1 0\n\
                       10 0 0 1\n$EndNodes\n$Elements\n2\n1 2 2 1 1 7 8 9\n2 4 2 1 1 7 8 9 10\n$EndElements\n";
    const NEW: &str = "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Entities\n0 0 0 0\n$EndEntities\n$Nodes\n2 4 7 10\n1 1 1 1\n7\n0 0 0 0.5\n3 1 0 3\n8\n9\n10\n\
                       1 0 0\n0 1 0\n0 0 1\n$EndNodes\n$Elements\n2 2 1 2\n2 1 2 1\n1 7 8 9\n3 1 4 1\n2 7 8 9 10\n$EndElements\n";

    const OLDEST: &str = "$NOD\n4\n7 0 0 0\n8 1 0 0\n9 0 1 0\n10 0 0 1\n$ENDNOD\n$ELM\n2\n1 2 1 1 3 7 8 9\n2 4 1 1 4 7 8 9 10\n$ENDELM\n";

    /// The same mesh as [`OLD`] in binary.
    fn old_binary() -> Vec<u8> {
        let ints = |values: &[i32]| values.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>();
        let mut bytes = b"$MeshFormat\n2.2 1 8\n\x01\0\0\0\n$EndMeshFormat\n$Nodes\n4\n".to_vec();
        for (number, xyz) in [(7, [0.0; 3]), (8, [1.0, 0.0, 0.0]), (9, [0.0, 1.0, 0.0]), (10, [0.0, 0.0, 1.0])] {
            bytes.extend(ints(&[number]));
            bytes.extend(xyz.iter().flat_map(|c: &f64| c.to_le_bytes()));
        }
        bytes.extend(b"\n$EndNodes\n$Elements\n2\n");
        bytes.extend(ints(&[2, 1, 1, 1, 5, 7, 8, 9]));
        bytes.extend(ints(&[4, 1, 1, 2, 5, 7, 8, 9, 10]));
        bytes.extend(b"\n$EndElements\n");
        bytes
    }

    #[test]
    fn written_files_are_read_back() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("mesh.msh");
        write(&path, &octahedron()).unwrap();
        assert_eq!(import(&path).unwrap().mesh, octahedron());
    }

    #[test]
    fn versions_and_encodings_agree() {
        let old = of_text(OLD, parse).unwrap();
        assert_eq!(old.tets, [[0, 1, 2, 3]]);
        assert_eq!(old, of_text(NEW, parse).unwrap());
        assert_eq!(old, of_text(OLDEST, parse).unwrap());
        assert_eq!(old, of_bytes(&old_binary(), parse).unwrap().mesh);
    }

    #[test]
    fn a_tetrahedron_in_two_groups_counts_once() {
        let text = |old: &str, from: [&str; 2], to: [&str; 2]| old.replace(from[0], to[0]).replace(from[1], to[1]);
        let again = text(OLD, ["$Elements\n2", "$EndElements"], ["$Elements\n3", "3 4 2 2 1 10 9 8 7\n$EndElements"]);
        let new =
            text(NEW, ["$Elements\n2 2", "$EndElements"], ["$Elements\n3 3", "3 2 4 1\n2 7 8 9 10\n$EndElements"]);
        let mut binary = old_binary();
        let one = [4, 1, 1, 2, 5, 7, 8, 9, 10].map(i32::to_le_bytes).concat();
        let end = binary.len() - b"\n$EndElements\n".len();
        binary.splice(end..end, one);
        let at = binary.windows(11).position(|w| w == b"$Elements\n2").unwrap();
        binary[at + 10] = b'3';
        for bytes in [again.as_bytes(), new.as_bytes(), &binary] {
            let import = of_bytes(bytes, parse).unwrap();
            assert_eq!(import.mesh, of_text(OLD, parse).unwrap());
            assert_eq!(import.notes[..2], [Note::Others(1), Note::Repeated(1)]);
        }
    }

    #[test]
    fn of_higher_order_the_corners_are_read() {
        let text = OLD.replace("$Nodes\n4", "$Nodes\n5\n1 0.5 0 0");
        for (kind, more) in [(11, 6), (29, 16), (30, 31), (31, 52)] {
            let text = text.replace("2 4 2 1 1 7 8 9 10", &format!("2 {kind} 2 1 1 7 8 9 10{}", " 1".repeat(more)));
            let import = of_bytes(text.as_bytes(), parse).unwrap();
            assert_eq!(import.mesh, of_text(OLD, parse).unwrap());
            assert_eq!(import.notes, [Note::Corners(1), Note::Others(1), Note::Orphans(1)]);
        }
    }

    #[test]
    fn faults_are_named() {
        let fault = |text: &str, from: &str, to: &str| of_text(&text.replace(from, to), parse).unwrap_err().to_string();
        assert!(fault(OLD, "$MeshFormat", "$Mesh").contains("$MeshFormat"));
        assert!(fault(OLDEST, "2 4 1 1 4", "2 4 1 1 5").contains("type 4 with 5 nodes"));
        assert!(fault(OLD, "2.2", "4.0").contains("version is 4.0"));
        assert!(fault(OLD, "$Nodes\n4", "$Nodes\n4000000000").contains("count of $Nodes"));
        assert!(fault(OLD, "7 8 9 10", "7 8 9 11").contains("tetrahedron 0"));
        assert!(fault(OLD, "2 4 2", "2 77 2").contains("type is 77"));
        assert!(fault(OLD, "$EndPhysicalNames", "").contains("$EndPhysicalNames"));
        assert!(fault(NEW, "3 1 4 1", "3 1 4 18446744073709551615").contains("block of $Elements"));
        assert!(fault(NEW, "8\n9\n10", "8\n9\n9").contains("node 9 is there twice"));
    }

    #[test]
    fn damage_is_survived() {
        survive_mutations(OLD.as_bytes(), parse);
        survive_mutations(NEW.as_bytes(), parse);
        survive_mutations(OLDEST.as_bytes(), parse);
        survive_mutations(&old_binary(), parse);
    }
}
