//! Detects the format of a mesh file and calls its reader or writer.
//!
//! # Practice
//! A format is one file with a [`Format`]; its name in one of the two lists brings it to the
//! programs. [`import_among`] and [`write_among`] use it from any crate (`tests/toy_format.rs`).
//! Reading detects the content first, since programs use `.mesh`, `.msh` and `.vtk` differently;
//! writing uses the ending.

use crate::file::{FileError, Format, Import};
use crate::{TetMesh, TriMesh, abaqus, gmsh, medit, obj, ply, stl, tetgen, vtk, vtu};
use std::io::Read;
use std::path::Path;
use trepan_volume::open_regular;

/// The formats of tetrahedra.
pub const VOLUME_FORMATS: &[Format<TetMesh>] =
    &[vtk::FORMAT, vtu::FORMAT, gmsh::FORMAT, medit::FORMAT, tetgen::FORMAT, abaqus::FORMAT];

/// The formats of triangle surfaces.
pub const SURFACE_FORMATS: &[Format<TriMesh>] = &[stl::FORMAT, obj::FORMAT, ply::FORMAT];

/// Bytes of a file in which its format is recognised.
const START: u64 = 32;

/// Reads tetrahedra from a file of any of the [`VOLUME_FORMATS`]. Only indices are checked; call
/// [`TetMesh::check`] for the rest.
pub fn read(path: &Path) -> Result<TetMesh, FileError> {
    read_among(VOLUME_FORMATS, path)
}

/// Reads tetrahedra as [`read`] does, with notes about the file.
pub fn import(path: &Path) -> Result<Import<TetMesh>, FileError> {
    import_among(VOLUME_FORMATS, path)
}

/// Reads a triangle surface from a file of any of the [`SURFACE_FORMATS`].
pub fn read_surface(path: &Path) -> Result<TriMesh, FileError> {
    read_among(SURFACE_FORMATS, path)
}

/// Reads a triangle surface, with notes about the file.
pub fn import_surface(path: &Path) -> Result<Import<TriMesh>, FileError> {
    import_among(SURFACE_FORMATS, path)
}

/// Writes tetrahedra in the format of the file's ending.
pub fn write(path: &Path, mesh: &TetMesh) -> Result<(), FileError> {
    write_among(VOLUME_FORMATS, path, mesh)
}

/// Writes a triangle surface in the format of the file's ending.
pub fn write_surface(path: &Path, mesh: &TriMesh) -> Result<(), FileError> {
    write_among(SURFACE_FORMATS, path, mesh)
}

/// Reads a file as [`import_among`] does, without its notes.
pub fn read_among<M>(formats: &[Format<M>], path: &Path) -> Result<M, FileError> {
    import_among(formats, path).map(|import| import.mesh)
}

/// Reads a file in the one of `formats` that its first bytes belong to, else in that of its ending.
pub fn import_among<M>(formats: &[Format<M>], path: &Path) -> Result<Import<M>, FileError> {
    let named = formats.iter().find(|format| format.endings.contains(&ending(path).as_str()));
    if let Some(format) = named.filter(|format| format.starts.is_empty()) {
        return (format.import)(path);
    }
    let start = start(path).map_err(|source| FileError::Io { path: path.into(), source })?;
    let begins = |format: &&Format<M>| format.starts.iter().any(|text| start.starts_with(text.as_bytes()));
    match formats.iter().find(begins).or(named) {
        Some(format) => (format.import)(path),
        None => {
            // The comments of a Nastran deck begin with $.
            let nastran = start.starts_with(b"$") || ["bdf", "nas", "fem"].contains(&ending(path).as_str());
            let got = if nastran { "perhaps Nastran, which is not read (meshio converts it)" } else { "unknown" };
            Err(unknown(path, "the format", got.into(), formats))
        }
    }
}

/// Writes a file in the one of `formats` that its ending belongs to.
pub fn write_among<M>(formats: &[Format<M>], path: &Path, mesh: &M) -> Result<(), FileError> {
    let ending = ending(path);
    match formats.iter().find(|format| format.endings.contains(&ending.as_str())) {
        Some(format) => (format.write)(path, mesh),
        None => Err(unknown(path, "the name's ending", format!("{ending:?}"), formats)),
    }
}

fn ending(path: &Path) -> String {
    path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase()).unwrap_or_default()
}

fn start(path: &Path) -> std::io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    open_regular(path)?.take(START).read_to_end(&mut bytes)?;
    Ok(bytes)
}

fn unknown<M>(path: &Path, field: &str, got: String, formats: &[Format<M>]) -> FileError {
    let names: Vec<&str> = formats.iter().map(|format| format.name).collect();
    FileError::Field { path: path.into(), field: field.into(), got, wanted: names.join(" or ") }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::file::tests::octahedron;
    use crate::{Note, Surface};
    use trepan_geometry::Vec3;

    #[test]
    fn every_format_gives_the_same_mesh_back() {
        let folder = tempfile::tempdir().unwrap();
        for ending in VOLUME_FORMATS.iter().map(|format| format.endings[0]) {
            let path = folder.path().join(format!("mesh.{ending}"));
            write(&path, &octahedron()).unwrap();
            assert_eq!(read(&path).unwrap(), octahedron(), "{ending}");
        }
        let mesh = octahedron();
        let surface = Surface::of(&mesh).to_tri_mesh(&mesh.positions);
        for ending in SURFACE_FORMATS.iter().map(|format| format.endings[0]) {
            let path = folder.path().join(format!("surface.{ending}"));
            write_surface(&path, &surface).unwrap();
            assert!((read_surface(&path).unwrap().volume_mm3() - mesh.total_mm3()).abs() < 1e-6, "{ending}");
        }
    }

    #[test]
    fn space_is_written_and_lps_turns_a_mesh_by_half() {
        let folder = tempfile::tempdir().unwrap();
        let mesh = octahedron();
        let surface = Surface::of(&mesh).to_tri_mesh(&mesh.positions);
        let read = |path: &Path| {
            if path.file_stem().is_some_and(|name| name == "mesh") {
                let Import { mesh, notes } = import(path).unwrap();
                assert_eq!(mesh.check(), Ok(()));
                return (mesh.positions, notes);
            }
            let Import { mesh, notes } = import_surface(path).unwrap();
            assert!(mesh.volume_mm3() > 0.0, "it is not inside out");
            (mesh.positions, notes)
        };
        for name in ["mesh.vtk", "mesh.vtu", "surface.stl", "surface.obj", "surface.ply"] {
            let path = folder.path().join(name);
            write(&path, &mesh).or_else(|_| write_surface(&path, &surface)).unwrap();
            let (ras, notes) = read(&path);
            assert!(notes.is_empty(), "{name}: {notes:?}");
            let spaces: [&[u8]; 2] =
                if name == "mesh.vtu" { [b"82 65 83 0", b"76 80 83 0"] } else { [b"SPACE=RAS", b"SPACE=LPS"] };
            let bytes = std::fs::read(&path).unwrap();
            let at = bytes.windows(spaces[0].len()).position(|w| w == spaces[0]).expect("it says its space");
            std::fs::write(&path, [&bytes[..at], spaces[1], &bytes[at + spaces[0].len()..]].concat()).unwrap();
            let turned: Vec<Vec3> = ras.iter().map(|p| Vec3::new(-p.x, -p.y, p.z)).collect();
            assert_eq!(read(&path), (turned, vec![Note::Lps]), "{name}");
        }
    }

    #[test]
    fn the_content_decides_before_the_ending() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("mesh.msh");
        write(&path, &octahedron()).unwrap();
        let renamed = folder.path().join("mesh.mesh");
        std::fs::rename(&path, &renamed).unwrap();
        assert_eq!(read(&renamed).unwrap(), octahedron());
    }

    #[test]
    fn nastran_is_not_taken_for_gmsh() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("head.bdf");
        for text in ["$ a head\nBEGIN BULK\nGRID,1,,0.,0.,0.\nENDDATA\n", "SOL 101\nCEND\n"] {
            std::fs::write(&path, text).unwrap();
            let fault = read(&path).unwrap_err().to_string();
            assert!(fault.contains("head.bdf: the format is perhaps Nastran") && fault.contains(".vtk"), "{fault}");
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
