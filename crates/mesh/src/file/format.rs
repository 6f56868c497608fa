//! Detects the format of a mesh file and calls its reader or writer.
//!
//! # Practice
//! Reading detects the content first, since programs use `.mesh`, `.msh` and `.vtk` differently;
//! writing uses the extension.

use crate::file::{FileError, Reader};
use crate::{TetMesh, TriMesh, abaqus, gmsh, medit, obj, ply, stl, tetgen, vtk, vtu};
use std::path::Path;

type Parse = fn(Reader) -> Result<TetMesh, FileError>;

const VOLUME_FORMATS: &str =
    "legacy VTK (.vtk), VTK XML (.vtu), Gmsh (.msh), Medit (.mesh), TetGen (.node, .ele) or Abaqus (.inp)";

const SURFACE_FORMATS: &str = ".stl, .obj or .ply";

/// Reads tetrahedra from a file of any supported format. Only indices are checked; call
/// [`TetMesh::check`] for the rest.
pub fn read(path: &Path) -> Result<TetMesh, FileError> {
    let ending = ending(path);
    if ["node", "ele"].contains(&ending.as_str()) {
        return tetgen::read(path);
    }
    let reader = Reader::open(path)?;
    let starts: [(&str, Parse); 6] = [
        ("# vtk DataFile", vtk::parse),
        ("<?xml", vtu::parse),
        ("<VTKFile", vtu::parse),
        ("$", gmsh::parse),
        ("MeshVersionFormatted", medit::parse),
        ("*", abaqus::parse),
    ];
    match starts.iter().find(|(start, _)| reader.starts_with(start.as_bytes())) {
        Some((_, parse)) => parse(reader),
        None if ending == "mesh" => medit::parse(reader),
        None => Err(reader.error("the format", "unknown", VOLUME_FORMATS)),
    }
}

/// Reads a triangle surface: STL, OBJ or PLY, by the file's extension.
pub fn read_surface(path: &Path) -> Result<TriMesh, FileError> {
    match ending(path).as_str() {
        "stl" => stl::read(path),
        "obj" => obj::read(path),
        "ply" => ply::read(path),
        other => Err(unknown(path, other, SURFACE_FORMATS)),
    }
}

/// Writes tetrahedra in the format of the file's extension.
pub fn write(path: &Path, mesh: &TetMesh) -> Result<(), FileError> {
    match ending(path).as_str() {
        "vtk" => vtk::write(path, mesh),
        "vtu" => vtu::write(path, mesh),
        "msh" => gmsh::write(path, mesh),
        "mesh" => medit::write(path, mesh),
        "node" | "ele" => tetgen::write(path, mesh),
        "inp" => abaqus::write(path, mesh),
        other => Err(unknown(path, other, VOLUME_FORMATS)),
    }
}

/// Writes a triangle surface in the format of the file's extension: STL, OBJ or PLY.
pub fn write_surface(path: &Path, mesh: &TriMesh) -> Result<(), FileError> {
    match ending(path).as_str() {
        "stl" => stl::write(path, mesh),
        "obj" => obj::write(path, mesh),
        "ply" => ply::write(path, mesh),
        other => Err(unknown(path, other, SURFACE_FORMATS)),
    }
}

fn ending(path: &Path) -> String {
    path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase()).unwrap_or_default()
}

fn unknown(path: &Path, ending: &str, wanted: &str) -> FileError {
    FileError::Field {
        path: path.into(),
        field: "the name's ending".into(),
        got: format!("{ending:?}"),
        wanted: wanted.into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Surface;
    use crate::file::tests::octahedron;

    #[test]
    fn every_format_gives_the_same_mesh_back() {
        let folder = tempfile::tempdir().unwrap();
        for ending in ["vtk", "vtu", "msh", "mesh", "node", "inp"] {
            let path = folder.path().join(format!("mesh.{ending}"));
            write(&path, &octahedron()).unwrap();
            assert_eq!(read(&path).unwrap(), octahedron(), "{ending}");
        }
        let mesh = octahedron();
        let surface = Surface::of(&mesh).to_tri_mesh(&mesh.positions);
        for ending in ["stl", "obj", "ply"] {
            let path = folder.path().join(format!("surface.{ending}"));
            write_surface(&path, &surface).unwrap();
            assert!((read_surface(&path).unwrap().volume_mm3() - mesh.total_mm3()).abs() < 1e-6, "{ending}");
        }
    }

    #[test]
    fn an_unknown_format_lists_the_supported_ones() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("mesh.xyz");
        assert!(write(&path, &octahedron()).unwrap_err().to_string().contains(".msh"));
        std::fs::write(&path, "hello").unwrap();
        assert!(read(&path).unwrap_err().to_string().contains("mesh.xyz: the format is unknown"));
        assert!(read_surface(&path).unwrap_err().to_string().contains(".stl"));
    }
}
