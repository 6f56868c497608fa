//! VTK XML files (`.vtu`) of tetrahedra.
//!
//! # Theory
//! An `UnstructuredGrid` with one `Piece`: `Points`, and `Cells` as `connectivity`, `offsets` and
//! `types` (10 is the 4-node tetrahedron, 24 the 10-node one, 71 and 78 those of any order). A
//! `DataArray` is text, base64 between its tags, or at an offset in `AppendedData` (base64 or raw).
//! Binary data start with their length; compressed data with the number of blocks, the size of a
//! block and of the last one, and each block's compressed size.
//!
//! # Practice
//! Reads text, base64 and both kinds of appended data, uncompressed or zlib, in both byte orders;
//! skips cells of other types and all point and cell data. Several pieces, LZ4 and LZMA are
//! rejected. Writes uncompressed base64, f32, and the field `SPACE` as 3D Slicer does; meshio 5.3.5
//! reads no file with a text field, so give it another format. Positions are mm; the corner order
//! is that of [`TetMesh`].
//!
//! # Sources
//! VTK File Formats, in The VTK User's Guide, 11th edition.

use crate::TetMesh;
use crate::file::{Elements, FileError, Format, Import, Reader, write_atomically};
use base64::Engine;
use base64::engine::general_purpose::STANDARD as BASE64;
use std::io::Read;
use std::path::Path;
use trepan_geometry::Vec3;

/// Cell type of the 4-node tetrahedron.
pub(crate) const TETRAHEDRON: u8 = 10;

/// The format.
pub const FORMAT: Format<TetMesh> =
    Format { name: "VTK XML (.vtu)", endings: &["vtu"], starts: &["<?xml", "<VTKFile"], import, write };

/// Reads the tetrahedra of a VTK XML file. Only indices are checked; call [`TetMesh::check`] for
/// the rest.
pub fn import(path: &Path) -> Result<Import<TetMesh>, FileError> {
    parse(Reader::open(path)?)
}

/// Start of the text `RAS`, as 3D Slicer looks for it; letters are numbers, and 0 ends it.
const SPACE: &str = "<Array type=\"String\" Name=\"SPACE\" NumberOfTuples=\"1\" format=\"ascii\">";

/// Writes a mesh as VTK XML, atomically.
pub fn write(path: &Path, mesh: &TetMesh) -> Result<(), FileError> {
    let positions: Vec<u8> = mesh.positions.iter().flat_map(Vec3::to_array).flat_map(f32::to_le_bytes).collect();
    let connectivity: Vec<u8> = mesh.tets.iter().flatten().flat_map(|n| n.to_le_bytes()).collect();
    let offsets: Vec<u8> = (1..=mesh.tets.len() as u64).flat_map(|n| (4 * n).to_le_bytes()).collect();
    let types = vec![TETRAHEDRON; mesh.tets.len()];
    let inline = |bytes: &[u8]| BASE64.encode([&(bytes.len() as u64).to_le_bytes(), bytes].concat());
    write_atomically(path, |out| {
        let (nodes, cells) = (mesh.positions.len(), mesh.tets.len());
        writeln!(out, "<?xml version=\"1.0\"?>")?;
        writeln!(
            out,
            "<VTKFile type=\"UnstructuredGrid\" version=\"1.0\" byte_order=\"LittleEndian\" header_type=\"UInt64\">"
        )?;
        writeln!(out, "<UnstructuredGrid>\n<FieldData>\n{SPACE}82 65 83 0</Array>\n</FieldData>")?;
        writeln!(out, "<Piece NumberOfPoints=\"{nodes}\" NumberOfCells=\"{cells}\">\n<Points>")?;
        writeln!(out, "<DataArray type=\"Float32\" Name=\"Points\" NumberOfComponents=\"3\" format=\"binary\">")?;
        writeln!(out, "{}\n</DataArray>\n</Points>\n<Cells>", inline(&positions))?;
        for (name, kind, bytes) in
            [("connectivity", "UInt32", &connectivity), ("offsets", "Int64", &offsets), ("types", "UInt8", &types)]
        {
            writeln!(
                out,
                "<DataArray type=\"{kind}\" Name=\"{name}\" format=\"binary\">\n{}\n</DataArray>",
                inline(bytes)
            )?;
        }
        writeln!(out, "</Cells>\n</Piece>\n</UnstructuredGrid>\n</VTKFile>")
    })
}

pub(crate) fn parse(mut reader: Reader) -> Result<Import<TetMesh>, FileError> {
    let bytes = reader.take("the file", reader.size())?.to_vec();
    let xml = Xml::new(&bytes, &reader)?;
    let ((positions, elements), space) = (xml.grid()?, xml.space()?);
    reader.heed_space(&format!("SPACE={space}"));
    reader.mesh(positions, elements)
}

/// The file and the array format in its first tags.
struct Xml<'a> {
    bytes: &'a [u8],
    reader: &'a Reader,
    big_endian: bool,
    long_headers: bool,
    compressor: Option<&'a str>,
    /// Start of appended data, and whether they are raw.
    appended: Option<(usize, bool)>,
}

/// A tag: its name and attributes as text, and its end.
struct Tag<'a> {
    text: &'a str,
    end: usize,
}

impl<'a> Tag<'a> {
    /// The next tag from `at` on, skipping comments.
    fn next(bytes: &'a [u8], mut at: usize) -> Option<Self> {
        loop {
            let start = at + bytes.get(at..)?.iter().position(|b| *b == b'<')? + 1;
            let end = start + bytes[start..].iter().position(|b| *b == b'>')?;
            if !bytes[start..].starts_with(b"!") && !bytes[start..].starts_with(b"?") {
                return Some(Self { text: std::str::from_utf8(&bytes[start..end]).ok()?, end: end + 1 });
            }
            at = end + 1;
        }
    }

    fn name(&self) -> &'a str {
        self.text.split_ascii_whitespace().next().unwrap_or_default()
    }

    fn attribute(&self, name: &str) -> Option<&'a str> {
        let from = self.text.match_indices(name).find_map(|(at, _)| {
            let before = self.text[..at].chars().next_back().is_some_and(char::is_whitespace);
            let rest = self.text[at + name.len()..].trim_start().strip_prefix('=')?.trim_start();
            before.then_some(rest)
        })?;
        let quote = from.chars().next().filter(|c| *c == '"' || *c == '\'')?;
        from[1..].split(quote).next()
    }
}

impl<'a> Xml<'a> {
    fn new(bytes: &'a [u8], reader: &'a Reader) -> Result<Self, FileError> {
        let root = Tag::next(bytes, 0).filter(|t| t.name() == "VTKFile");
        let root =
            root.ok_or_else(|| reader.error("the first tag", "not VTKFile", "<VTKFile type=\"UnstructuredGrid\" …>"))?;
        let kind = root.attribute("type").unwrap_or_default();
        if kind != "UnstructuredGrid" {
            return Err(reader.error("the type", kind, "UnstructuredGrid; convert it to tetrahedra"));
        }
        let big_endian = root.attribute("byte_order") == Some("BigEndian");
        let long_headers = root.attribute("header_type") == Some("UInt64");
        let compressor = root.attribute("compressor");
        Ok(Self { bytes, reader, big_endian, long_headers, compressor, appended: appended(bytes) })
    }

    /// The field `SPACE`; empty without one.
    fn space(&self) -> Result<String, FileError> {
        let mut at = 0;
        while let Some(tag) = Tag::next(self.bytes, at).filter(|tag| tag.name() != "AppendedData") {
            if tag.name() == "Array" && tag.attribute("Name") == Some("SPACE") {
                let letters = self.array(&tag, "SPACE")?;
                return Ok(letters.into_iter().map(|letter| char::from(letter as u8)).take(8).collect());
            }
            at = tag.end;
        }
        Ok(String::new())
    }

    /// Positions and cells.
    fn grid(&self) -> Result<(Vec<Vec3>, Elements), FileError> {
        let (mut points, mut connectivity, mut offsets, mut types) = (None, None, None, None);
        let (mut at, mut section, mut pieces) = (0, "", 0);
        while let Some(tag) = Tag::next(self.bytes, at) {
            at = tag.end;
            match (tag.name(), section, tag.attribute("Name")) {
                ("AppendedData", ..) => break,
                ("Piece", ..) => pieces += 1,
                ("DataArray", "Points", _) => points = Some(self.array(&tag, "Points")?),
                ("DataArray", "Cells", Some("connectivity")) => connectivity = Some(self.array(&tag, "connectivity")?),
                ("DataArray", "Cells", Some("offsets")) => offsets = Some(self.array(&tag, "offsets")?),
                ("DataArray", "Cells", Some("types")) => types = Some(self.array(&tag, "types")?),
                ("DataArray" | "/DataArray" | "InformationKey" | "/InformationKey" | "Value" | "/Value", ..) => {}
                (name, ..) => section = name,
            }
        }
        if pieces != 1 {
            return Err(self.reader.error("the number of pieces", pieces, "1; merge them where the file was made"));
        }
        let missing = |name: &str| self.reader.error(name, "missing", "a DataArray");
        let points = points.ok_or_else(|| missing("Points"))?;
        let positions = points.as_chunks::<3>().0.iter().enumerate().map(|(n, &xyz)| self.reader.position(n, xyz));
        let (offsets, types) = (offsets.ok_or_else(|| missing("offsets"))?, types.ok_or_else(|| missing("types"))?);
        let starts: Vec<usize> = [0].into_iter().chain(offsets.into_iter().map(|end| end as usize)).collect();
        let nodes = connectivity.ok_or_else(|| missing("connectivity"))?.into_iter().map(|n| n as i64);
        let types: Vec<u8> = types.into_iter().map(|kind| kind as u8).collect();
        let elements = elements(self.reader, &starts, &nodes.collect::<Vec<_>>(), &types)?;
        Ok((positions.collect::<Result<_, _>>()?, elements))
    }

    /// Reads the numbers of an array.
    fn array(&self, tag: &Tag, name: &str) -> Result<Vec<f64>, FileError> {
        let rest = &self.bytes[tag.end..];
        let inline = &rest[..rest.iter().position(|b| *b == b'<').unwrap_or(rest.len())];
        match tag.attribute("format").unwrap_or("ascii") {
            "ascii" => self.text_array(inline, name),
            "binary" => {
                let stream = decoded(inline).ok_or_else(|| self.damaged(name, "not base64"))?;
                self.binary_array(tag, name, &stream)
            }
            "appended" => {
                let offset = tag.attribute("offset").and_then(|o| o.parse::<usize>().ok());
                let (start, raw) =
                    self.appended.ok_or_else(|| self.reader.error("AppendedData", "missing", "there"))?;
                let stream = offset
                    .and_then(|o| self.bytes.get(start.checked_add(o)?..))
                    .ok_or_else(|| self.damaged(name, "past the end"))?;
                if raw {
                    self.binary_array(tag, name, stream)
                } else {
                    self.binary_array(tag, name, &decoded_prefix(stream))
                }
            }
            other => Err(self.reader.error(format!("the format of {name}"), other, "ascii, binary or appended")),
        }
    }

    fn damaged(&self, name: &str, got: &str) -> FileError {
        self.reader.error(format!("the data of {name}"), got, "complete; copy the file again")
    }

    fn text_array(&self, text: &[u8], name: &str) -> Result<Vec<f64>, FileError> {
        let text = std::str::from_utf8(text).map_err(|_| self.damaged(name, "not text"))?;
        let number =
            |word: &str| word.parse().map_err(|_| self.reader.error(format!("a number of {name}"), word, "a number"));
        text.split_ascii_whitespace().map(number).collect()
    }

    fn binary_array(&self, tag: &Tag, name: &str, stream: &[u8]) -> Result<Vec<f64>, FileError> {
        let bytes = match self.compressor {
            None => self.plain(stream),
            Some("vtkZLibDataCompressor") => self.inflated(stream),
            Some(other) => {
                let wanted = "none or vtkZLibDataCompressor; save it with another";
                return Err(self.reader.error("the compressor", other, wanted));
            }
        };
        let bytes = bytes.ok_or_else(|| self.damaged(name, "cut off or damaged"))?;
        let kind = tag.attribute("type").unwrap_or_default();
        let (size, of) = number_type(kind).ok_or_else(|| {
            self.reader.error(format!("the type of {name}"), kind, "Float32, Float64 or Int/UInt of 8 to 64")
        })?;
        Ok(numbers(&bytes, (size, of), self.big_endian))
    }

    /// The length field at the start of data, and its size in bytes.
    fn length(&self, stream: &[u8], at: usize) -> Option<(usize, usize)> {
        let size = if self.long_headers { 8 } else { 4 };
        let mut little = [0; 8];
        little[..size].copy_from_slice(stream.get(at..at.checked_add(size)?)?);
        if self.big_endian {
            little[..size].reverse();
        }
        Some((usize::try_from(u64::from_le_bytes(little)).ok()?, size))
    }

    fn plain(&self, stream: &[u8]) -> Option<Vec<u8>> {
        let (length, header) = self.length(stream, 0)?;
        Some(stream.get(header..header.checked_add(length)?)?.to_vec())
    }

    fn inflated(&self, stream: &[u8]) -> Option<Vec<u8>> {
        let (blocks, size) = self.length(stream, 0)?;
        let (block, _) = self.length(stream, size)?;
        let mut at = blocks.checked_add(3)?.checked_mul(size)?;
        let mut bytes = Vec::new();
        for n in 0..blocks {
            let (compressed, _) = self.length(stream, (3 + n) * size)?;
            let raw = stream.get(at..at.checked_add(compressed)?)?;
            let before = bytes.len();
            flate2::read::ZlibDecoder::new(raw).take(block as u64).read_to_end(&mut bytes).ok()?;
            if bytes.len() == before {
                return None;
            }
            at += compressed;
        }
        Some(bytes)
    }
}

/// Conversion of eight bytes to a number.
pub(crate) type Meaning = fn([u8; 8]) -> f64;

/// Size of a number type and its conversion from little-endian, zero-padded bytes.
pub(crate) fn number_type(kind: &str) -> Option<(usize, Meaning)> {
    Some(match kind {
        "Float32" => (4, |b| f32::from_bits(u64::from_le_bytes(b) as u32).into()),
        "Float64" => (8, f64::from_le_bytes),
        "Int8" => (1, |b| f64::from(b[0] as i8)),
        "UInt8" | "String" => (1, |b| b[0].into()),
        "Int16" => (2, |b| f64::from(u64::from_le_bytes(b) as i16)),
        "UInt16" => (2, |b| f64::from(u64::from_le_bytes(b) as u16)),
        "Int32" => (4, |b| f64::from(u64::from_le_bytes(b) as i32)),
        "UInt32" => (4, |b| f64::from(u64::from_le_bytes(b) as u32)),
        "Int64" => (8, |b| i64::from_le_bytes(b) as f64),
        "UInt64" => (8, |b| u64::from_le_bytes(b) as f64),
        _ => return None,
    })
}

/// Converts the numbers of a type in a row.
pub(crate) fn numbers(bytes: &[u8], (size, of): (usize, Meaning), big_endian: bool) -> Vec<f64> {
    let number = |raw: &[u8]| {
        let mut little = [0; 8];
        little[..size].copy_from_slice(raw);
        if big_endian {
            little[..size].reverse();
        }
        of(little)
    };
    bytes.chunks_exact(size).map(number).collect()
}

/// Sorts the cells of a grid by type; cell c has the nodes `starts[c]..starts[c + 1]`.
pub(crate) fn elements(reader: &Reader, starts: &[usize], nodes: &[i64], types: &[u8]) -> Result<Elements, FileError> {
    if starts.len() != types.len() + 1 {
        let got = format!("{} for {} cells", types.len(), starts.len().saturating_sub(1));
        return Err(reader.error("the count of cell types", got, "one for each cell"));
    }
    let mut elements = Elements::default();
    for (cell, &kind) in types.iter().enumerate() {
        if !matches!(kind, TETRAHEDRON | 24 | 71 | 78) {
            elements.others += 1;
            continue;
        }
        let nodes = nodes.get(starts[cell]..starts[cell + 1]).unwrap_or_default();
        let Some(&corners) = nodes.first_chunk::<4>().filter(|_| kind != TETRAHEDRON || nodes.len() == 4) else {
            let got = format!("{} nodes", nodes.len());
            return Err(reader.error(format!("tetrahedron {cell}"), got, "4 nodes, or more of a higher order"));
        };
        elements.tets.push(corners.map(|n| u32::try_from(n).unwrap_or(u32::MAX)));
        elements.of_more_nodes += usize::from(nodes.len() > 4);
    }
    Ok(elements)
}

/// Start of appended data (after the underscore), and whether they are raw.
fn appended(bytes: &[u8]) -> Option<(usize, bool)> {
    let at = bytes.windows(13).position(|w| w == b"<AppendedData")?;
    let tag = Tag::next(bytes, at)?;
    let start = tag.end + bytes[tag.end..].iter().position(|b| *b == b'_')? + 1;
    Some((start, tag.attribute("encoding") == Some("raw")))
}

/// Decodes base64 up to the next tag.
fn decoded_prefix(stream: &[u8]) -> Vec<u8> {
    let end = stream.iter().position(|b| *b == b'<').unwrap_or(stream.len());
    decoded(&stream[..end]).unwrap_or_default()
}

/// Decodes several base64 texts in a row, each with its padding, and white space between letters.
fn decoded(text: &[u8]) -> Option<Vec<u8>> {
    let letters: Vec<u8> = text.iter().copied().filter(|b| !b.is_ascii_whitespace()).collect();
    let ends = |pair: [u8; 2]| pair[0] == b'=' && pair[1] != b'=';
    let parts = letters.chunk_by(|&a, &b| !ends([a, b]));
    let mut bytes = Vec::with_capacity(letters.len() / 4 * 3);
    parts.map(|part| BASE64.decode_vec(part, &mut bytes).ok()).collect::<Option<()>>()?;
    Some(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Note;
    use crate::file::tests::{octahedron, of_bytes, of_text, survive_mutations};
    use std::io::Write;

    #[test]
    fn base64_in_several_parts_is_decoded_and_anything_else_refused() {
        assert_eq!(decoded(b"Zm9vYg==Zm9v\nYmE=").unwrap(), b"foobfooba");
        assert_eq!(decoded(b"").unwrap(), b"");
        assert_eq!((decoded(b"Zg"), decoded(b"Zg*=")), (None, None));
    }

    const TEXT: &str = "<VTKFile type=\"UnstructuredGrid\" version=\"0.1\" byte_order=\"BigEndian\">\n<!-- note -->\n<UnstructuredGrid>\n\
        <Piece NumberOfPoints=\"4\" NumberOfCells=\"2\">\n<PointData><DataArray type=\"Int8\" Name=\"x\">1 2 3 4</DataArray></PointData>\n\
        <Points><DataArray type=\"Float32\" NumberOfComponents=\"3\" format=\"ascii\">0 0 0 1 0 0 0 1 0 0 0 1</DataArray></Points>\n\
        <Cells><DataArray type=\"Int32\" Name=\"connectivity\" format=\"ascii\">0 1 2 0 1 2 3</DataArray>\n\
        <DataArray type=\"Int32\" Name=\"offsets\" format=\"ascii\">3 7</DataArray>\n\
        <DataArray type=\"UInt8\" Name=\"types\" format=\"ascii\">5 10</DataArray></Cells>\n</Piece></UnstructuredGrid></VTKFile>\n";

    fn zlib(bytes: &[u8]) -> Vec<u8> {
        let mut encoder = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::default());
        encoder.write_all(bytes).unwrap();
        encoder.finish().unwrap()
    }

    /// [`TEXT`]'s mesh with raw appended, compressed data in two blocks each.
    fn appended_file() -> Vec<u8> {
        let points: Vec<u8> = [0.0f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]
            .iter()
            .flat_map(|c| c.to_le_bytes())
            .collect();
        let cells: Vec<u8> = [0i64, 1, 2, 3].iter().flat_map(|c| c.to_le_bytes()).collect();
        let mut data = Vec::new();
        let mut offsets = Vec::new();
        for bytes in [points, cells, 4i64.to_le_bytes().to_vec(), vec![10]] {
            offsets.push(data.len());
            let blocks: Vec<Vec<u8>> = bytes.chunks(16).map(zlib).collect();
            let sizes = [blocks.len(), 16, bytes.len() % 16].into_iter().chain(blocks.iter().map(Vec::len));
            data.extend(sizes.flat_map(|n| (n as u32).to_le_bytes()));
            data.extend(blocks.concat());
        }
        let array = |n: usize, kind: &str, name: &str| {
            format!("<DataArray type=\"{kind}\" Name=\"{name}\" format=\"appended\" offset=\"{}\"/>", offsets[n])
        };
        let mut file = format!(
            "<?xml version=\"1.0\"?>\n<VTKFile type=\"UnstructuredGrid\" byte_order=\"LittleEndian\" compressor=\"vtkZLibDataCompressor\"><UnstructuredGrid>\
             <Piece NumberOfPoints=\"4\" NumberOfCells=\"1\"><Points>{}</Points><Cells>{}{}{}</Cells></Piece></UnstructuredGrid><AppendedData encoding=\"raw\">_",
            array(0, "Float32", "Points"), array(1, "Int64", "connectivity"), array(2, "Int64", "offsets"), array(3, "UInt8", "types"),
        ).into_bytes();
        file.extend(data);
        file.extend(b"</AppendedData></VTKFile>");
        file
    }

    #[test]
    fn written_files_are_read_back() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("mesh.vtu");
        write(&path, &octahedron()).unwrap();
        assert_eq!(import(&path).unwrap().mesh, octahedron());
        survive_mutations(&std::fs::read(&path).unwrap(), parse);
    }

    #[test]
    fn text_and_appended_data_agree() {
        let text = of_text(TEXT, parse).unwrap();
        assert_eq!(text.tets, [[0, 1, 2, 3]]);
        assert_eq!(of_bytes(&appended_file(), parse).unwrap().mesh, text);
        let space = "<FieldData><Array type=\"String\" Name=\"SPACE\" format=\"binary\">AAAABExQUwA=</Array></FieldData>\n<Piece";
        let lps = of_bytes(TEXT.replace("<Piece", space).as_bytes(), parse).unwrap();
        assert_eq!((lps.mesh.positions[1].x, &lps.notes[1..]), (-1.0, &[Note::Lps][..]));
        let keys = "4<InformationKey name=\"L\"><Value index=\"0\">1</Value></InformationKey></DataArray>";
        let keys = TEXT.replace("0 1 2 0 1 2 3</DataArray>", &format!("0 1 2 0 1 2 3{}", &keys[1..]));
        assert_eq!(of_text(&keys, parse).unwrap(), text);
    }

    #[test]
    fn of_10_node_tetrahedra_the_corners_are_read_and_others_counted() {
        let text = TEXT.replace("0 1 2 3<", "0 1 2 3 1 1 1 1 1 1<").replace("3 7<", "3 13<").replace("5 10<", "5 24<");
        let import = of_bytes(text.as_bytes(), parse).unwrap();
        assert_eq!(import.mesh, of_text(TEXT, parse).unwrap());
        assert_eq!(import.notes, [Note::Corners(1), Note::Others(1)]);
    }

    #[test]
    fn faults_are_named() {
        let fault = |from: &str, to: &str| of_text(&TEXT.replace(from, to), parse).unwrap_err().to_string();
        assert!(fault("\"UnstructuredGrid\"", "\"PolyData\"").contains("type is PolyData"));
        assert!(fault("3 7<", "3 9<").contains("tetrahedron 1"));
        assert!(fault("0 1 2 3<", "0 1 2 4<").contains("names node 4"));
        assert!(fault("5 10", "5").contains("one for each cell"));
        assert!(fault("\"offsets\"", "\"off\"").contains("offsets is missing"));
        assert!(fault("0 0 0 1<", "0 0 0 z<").contains("a number of Points"));
        let lz4 = TEXT.replace("byte_order", "compressor=\"vtkLZ4DataCompressor\" byte_order");
        assert_eq!(of_text(&lz4, parse).unwrap(), of_text(TEXT, parse).unwrap(), "text is not compressed");
        let fault = of_text(&lz4.replacen("ascii\">0 0 0 1 0 0 0 1 0 0 0 1", "binary\">AAAA", 1), parse)
            .unwrap_err()
            .to_string();
        assert!(fault.contains("the compressor is vtkLZ4"), "{fault}");
    }

    #[test]
    fn damage_is_survived() {
        survive_mutations(TEXT.as_bytes(), parse);
        survive_mutations(&appended_file(), parse);
    }
}
