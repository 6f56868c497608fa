//! A mesh format in one file, of another crate.

use std::path::Path;
use trepan_geometry::Vec3;
use trepan_mesh::{FileError, Format, Import, TetMesh, VOLUME_FORMATS, read_among, write_among};

/// One tetrahedron at the origin with the edge in the file, mm.
const TOY: Format<TetMesh> =
    Format { name: "toy (.toy)", endings: &["toy"], starts: &["one tetrahedron of "], import, write };

fn import(path: &Path) -> Result<Import<TetMesh>, FileError> {
    let io = |source| FileError::Io { path: path.into(), source };
    let text = std::fs::read_to_string(path).map_err(io)?;
    let edge_mm: f32 = text[TOY.starts[0].len()..].parse().unwrap_or(1.0);
    let positions = [Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z].map(|p| edge_mm * p).to_vec();
    Ok(Import { mesh: TetMesh { positions, tets: vec![[0, 1, 2, 3]] }, notes: Vec::new() })
}

fn write(path: &Path, mesh: &TetMesh) -> Result<(), FileError> {
    let text = format!("{}{}", TOY.starts[0], mesh.positions[1].x);
    std::fs::write(path, text).map_err(|source| FileError::Io { path: path.into(), source })
}

#[test]
fn a_format_of_one_file_is_written_recognised_and_read() {
    let folder = tempfile::tempdir().unwrap();
    let [path, renamed] = ["mesh.toy", "mesh.mesh"].map(|name| folder.path().join(name));
    let mesh = TetMesh {
        positions: [Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z].map(|p| 2.0 * p).to_vec(),
        tets: vec![[0, 1, 2, 3]],
    };
    write_among(&[TOY], &path, &mesh).unwrap();
    assert_eq!(read_among(&[TOY], &path).unwrap(), mesh);
    std::fs::rename(&path, &renamed).unwrap();
    assert_eq!(read_among(&[TOY], &renamed).unwrap(), mesh, "by its content");
    assert!(read_among(VOLUME_FORMATS, &renamed).is_err(), "the list does not have it");
}
