//! PLY surfaces (`.ply`).
//!
//! # Theory
//! A text header lists elements, their counts and properties, each a number or a list preceded by
//! its length. The rows of each element follow, as text or as binary of either byte order.
//!
//! # Practice
//! Reads `x`, `y`, `z` of `vertex`, and the list `vertex_indices` (or `vertex_index`) of `face`;
//! everything else is skipped. Polygons are split into triangle fans. Positions are mm; PLY has no
//! unit. Writes binary, little-endian.
//!
//! # Sources
//! G. Turk, "The PLY Polygon File Format", 1994.

use crate::TriMesh;
use crate::file::{FileError, Format, Import, Reader, write_atomically};
use std::path::Path;

/// The format.
pub const FORMAT: Format<TriMesh> = Format { name: "PLY (.ply)", endings: &["ply"], starts: &[], import, write };

/// Reads a surface, with notes about the file.
pub fn import(path: &Path) -> Result<Import<TriMesh>, FileError> {
    parse(Reader::open(path)?)
}

/// Writes a surface as binary PLY, atomically.
pub fn write(path: &Path, mesh: &TriMesh) -> Result<(), FileError> {
    write_atomically(path, |out| {
        writeln!(
            out,
            "ply\nformat binary_little_endian 1.0\ncomment SPACE=RAS\nelement vertex {}",
            mesh.positions.len()
        )?;
        writeln!(out, "property float x\nproperty float y\nproperty float z")?;
        writeln!(out, "element face {}", mesh.triangles.len())?;
        writeln!(out, "property list uchar uint vertex_indices\nend_header")?;
        mesh.positions.iter().flat_map(|p| p.to_array()).try_for_each(|c| out.write_all(&c.to_le_bytes()))?;
        for triangle in &mesh.triangles {
            out.write_all(&[3])?;
            triangle.iter().try_for_each(|n| out.write_all(&n.to_le_bytes()))?;
        }
        Ok(())
    })
}

pub(crate) fn parse(reader: Reader) -> Result<Import<TriMesh>, FileError> {
    let mut file = Ply { reader, encoding: Encoding::Text };
    let elements = file.header()?;
    let (mut positions, mut triangles) = (Vec::new(), Vec::new());
    for element in &elements {
        let least = element.properties.iter().map(|p| file.least_bytes(p)).sum();
        let count = file.reader.checked_count(&format!("the count of {}", element.name), element.count, least)?;
        for row in 0..count {
            let mut xyz = [f64::NAN; 3];
            for property in &element.properties {
                let values = file.values(property)?;
                match (element.name.as_str(), property.name.as_str()) {
                    ("vertex", name) => {
                        let axis = ["x", "y", "z"].iter().position(|axis| *axis == name);
                        axis.zip(values.first()).into_iter().for_each(|(axis, value)| xyz[axis] = *value);
                    }
                    ("face", "vertex_indices" | "vertex_index") => {
                        let corners = file.corners(row, &values)?;
                        triangles.extend(corners[1..].windows(2).map(|pair| [corners[0], pair[0], pair[1]]));
                    }
                    _ => {}
                }
            }
            if element.name == "vertex" {
                positions.push(file.reader.position(row, xyz)?);
            }
        }
    }
    file.reader.surface(positions, triangles)
}

#[derive(Clone, Copy, PartialEq)]
enum Encoding {
    Text,
    Little,
    Big,
}

/// A kind of element, its count and properties.
struct Element {
    name: String,
    count: u64,
    properties: Vec<Property>,
}

/// A property of an element.
struct Property {
    name: String,
    /// Type of the length, for a list.
    length: Option<Kind>,
    kind: Kind,
}

#[derive(Clone, Copy, PartialEq)]
enum Kind {
    Signed(usize),
    Unsigned(usize),
    Float(usize),
}

impl Kind {
    fn named(name: &str) -> Option<Self> {
        Some(match name {
            "char" | "int8" => Self::Signed(1),
            "short" | "int16" => Self::Signed(2),
            "int" | "int32" => Self::Signed(4),
            "uchar" | "uint8" => Self::Unsigned(1),
            "ushort" | "uint16" => Self::Unsigned(2),
            "uint" | "uint32" => Self::Unsigned(4),
            "float" | "float32" => Self::Float(4),
            "double" | "float64" => Self::Float(8),
            _ => return None,
        })
    }

    fn bytes(self) -> usize {
        match self {
            Self::Signed(n) | Self::Unsigned(n) | Self::Float(n) => n,
        }
    }
}

struct Ply {
    reader: Reader,
    encoding: Encoding,
}

impl Ply {
    fn header(&mut self) -> Result<Vec<Element>, FileError> {
        let magic = self.reader.line().unwrap_or_default();
        if magic.trim() != "ply" {
            return Err(self.reader.error("the first line", format!("{magic:?}"), "ply"));
        }
        let mut elements: Vec<Element> = Vec::new();
        loop {
            let Some(line) = self.reader.line() else {
                return Err(self.reader.error("the header", "cut off", "ended by end_header; copy the file again"));
            };
            match line.split_ascii_whitespace().collect::<Vec<_>>()[..] {
                ["comment", ..] => self.reader.heed_space(&line),
                ["format", name, _] => self.encoding = self.encoding(name)?,
                ["element", name, count] => {
                    let wrong = || self.reader.error(format!("the count of {name}"), count, "a whole number");
                    let count = count.parse().map_err(|_| wrong())?;
                    elements.push(Element { name: name.into(), count, properties: Vec::new() });
                }
                ["property", ref words @ ..] => {
                    let property = self.property(words, &line)?;
                    let Some(element) = elements.last_mut() else {
                        return Err(self.reader.error("a property", line, "after the element that has it"));
                    };
                    element.properties.push(property);
                }
                ["end_header"] => break,
                _ => {}
            }
        }
        // Elements without properties take no bytes, whatever count the header states.
        elements.retain(|element| !element.properties.is_empty());
        Ok(elements)
    }

    fn encoding(&self, name: &str) -> Result<Encoding, FileError> {
        match name {
            "ascii" => Ok(Encoding::Text),
            "binary_little_endian" => Ok(Encoding::Little),
            "binary_big_endian" => Ok(Encoding::Big),
            other => Err(self.reader.error("the format", other, "ascii, binary_little_endian or binary_big_endian")),
        }
    }

    fn property(&self, words: &[&str], line: &str) -> Result<Property, FileError> {
        let whole = |kind: &Kind| !matches!(kind, Kind::Float(_));
        let found = match *words {
            ["list", length, kind, name] => Kind::named(length)
                .filter(whole)
                .zip(Kind::named(kind))
                .map(|(length, kind)| (Some(length), kind, name)),
            [kind, name] => Kind::named(kind).map(|kind| (None, kind, name)),
            _ => None,
        };
        let (length, kind, name) = found.ok_or_else(|| {
            self.reader.error("a property", line, "a number type and a name, or list, two types and a name")
        })?;
        Ok(Property { name: name.into(), length, kind })
    }

    /// Smallest size of a property, bytes.
    fn least_bytes(&self, property: &Property) -> usize {
        match self.encoding {
            Encoding::Text => 2,
            _ => property.length.unwrap_or(property.kind).bytes(),
        }
    }

    /// Reads a property's numbers in the next row.
    fn values(&mut self, property: &Property) -> Result<Vec<f64>, FileError> {
        let count = match property.length {
            None => 1,
            Some(kind) => {
                let length = self.value(&property.name, kind)?;
                let each = if self.encoding == Encoding::Text { 2 } else { property.kind.bytes() };
                let field = format!("the length of {}", property.name);
                // A negative length becomes 0, and an empty list is not a polygon.
                self.reader.checked_count(&field, length as u64, each)?
            }
        };
        (0..count).map(|_| self.value(&property.name, property.kind)).collect()
    }

    fn value(&mut self, name: &str, kind: Kind) -> Result<f64, FileError> {
        if self.encoding == Encoding::Text {
            return self.reader.number(name, "a number; is the file cut off?");
        }
        let bytes = kind.bytes();
        let mut raw = [0; 8];
        raw[..bytes].copy_from_slice(self.reader.take(name, bytes)?);
        if self.encoding == Encoding::Big {
            raw[..bytes].reverse();
        }
        let word = u64::from_le_bytes(raw);
        let unused = 64 - 8 * bytes as u32;
        Ok(match kind {
            Kind::Unsigned(_) => word as f64,
            Kind::Signed(_) => ((word << unused) as i64 >> unused) as f64,
            Kind::Float(4) => f32::from_bits(word as u32).into(),
            Kind::Float(_) => f64::from_bits(word),
        })
    }

    /// Converts a polygon's vertex numbers to indices.
    fn corners(&self, row: usize, values: &[f64]) -> Result<Vec<u32>, FileError> {
        let whole = |v: &f64| v.fract() == 0.0 && (0.0..f64::from(u32::MAX)).contains(v);
        match values.len() >= 3 && values.iter().all(whole) {
            true => Ok(values.iter().map(|&v| v as u32).collect()),
            false => Err(self.reader.error(
                format!("face {row}"),
                format!("{values:?}"),
                "at least three vertex numbers from 0",
            )),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Surface;
    use crate::file::tests::{octahedron, of_bytes, of_text, survive_mutations};

    const TEXT: &str = "ply\r\nformat ascii 1.0\r\ncomment a square\r\nelement vertex 4\r\nproperty float x\r\nproperty float y\r\nproperty uchar red\r\nproperty float z\r\nelement face 1\r\nproperty list uchar int vertex_indices\r\nproperty uchar red\r\nelement edge 1\r\nproperty int vertex1\r\nend_header\r\n0 0 9 0\r\n1 0 9 0\r\n1 1 9 0\r\n0 1 9 0.5\r\n4 0 1 2 3 7\r\n5\r\n";

    /// The surface of [`TEXT`] as big-endian binary, with lists of another type.
    fn big() -> Vec<u8> {
        let mut bytes = b"ply\nformat binary_big_endian 1.0\nelement vertex 4\nproperty double x\nproperty double y\nproperty double z\nelement face 1\nproperty list ushort short vertex_index\nend_header\n".to_vec();
        for c in [0.0f64, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0, 0.5] {
            bytes.extend(c.to_be_bytes());
        }
        [4i16, 0, 1, 2, 3].iter().for_each(|n| bytes.extend(n.to_be_bytes()));
        bytes
    }

    #[test]
    fn written_files_are_read_back() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("surface.ply");
        let mesh = octahedron();
        let surface = Surface::of(&mesh).to_tri_mesh(&mesh.positions);
        write(&path, &surface).unwrap();
        assert_eq!(import(&path).unwrap().mesh, surface);
        survive_mutations(&std::fs::read(&path).unwrap(), parse);
    }

    #[test]
    fn text_and_both_byte_orders_are_read_and_faults_named() {
        let square = of_text(TEXT, parse).unwrap();
        assert_eq!(square.triangles, [[0, 1, 2], [0, 2, 3]]);
        assert_eq!(square.positions[3].to_array(), [0.0, 1.0, 0.5]);
        assert_eq!(of_bytes(&big(), parse).unwrap().mesh, square);
        let fault = |from: &str, to: &str| of_text(&TEXT.replace(from, to), parse).unwrap_err().to_string();
        assert!(fault("4 0 1 2 3 7", "4 0 1 2 8 7").contains("triangle 1"));
        assert!(fault("4 0 1 2 3 7", "2 0 1 7").contains("at least three"));
        assert!(fault("vertex 4", "vertex 400000000000").contains("cut off"));
        assert!(fault("0 1 9 0.5", "0 1 9 nan").contains("finite"));
        assert!(fault("float x", "half x").contains("number type"));
        assert!(fault("ascii", "morse").contains("binary_little_endian"));
        assert!(fault("end_header", "end").contains("cut off"));
        assert!(fault("ply", "plx").contains("ply"));
    }

    #[test]
    fn damage_is_survived() {
        survive_mutations(TEXT.as_bytes(), parse);
        survive_mutations(&big(), parse);
        // Iterating over this many empty items would never end.
        let endless = TEXT.replace("element edge 1\r\nproperty int vertex1", "element edge 18446744073709551615");
        assert!(of_text(&endless, parse).is_ok());
    }

    #[test]
    fn surfaces_of_a_head_are_closed() {
        let path =
            Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data/mri-head-labelled/surface_brain.ply");
        if !path.exists() {
            println!("{} is not there: not tried", path.display());
            return;
        }
        let brain = import(&path).unwrap().mesh;
        assert_eq!((brain.positions.len(), brain.triangles.len()), (10242, 20480));
        assert!(brain.is_closed() && brain.volume_mm3() > 9e5, "{} mm3", brain.volume_mm3());
    }
}
