//! Meshes: read, write, fill a mask with tetrahedra, isosurfaces, quality, cell sizes.

use crate::arrays::{Any, Array1, Array2, fields, indices, mask, points, points_out, rows_out, tet_mesh, volume};
use crate::errors::{compute, of_file, value};
use numpy::PyArray1;
use pyo3::prelude::*;
use std::path::PathBuf;
use trepan_geometry::Vec3;
use trepan_mesh::lattice::{self, Fine};
use trepan_mesh::{Quality, Surface, TetMesh, TriMesh};
use trepan_voxel_size::{CostModel, Measures, VoxelSizeError};

type Mesh<'py> = (Array2<'py, f32>, Array2<'py, u32>);

fn mesh_out<'py, const N: usize>(py: Python<'py>, positions: &[Vec3], corners: &[[u32; N]]) -> PyResult<Mesh<'py>> {
    Ok((points_out(py, positions)?, rows_out(py, corners)?))
}

fn texts(notes: &[trepan_mesh::Note]) -> Vec<String> {
    notes.iter().map(ToString::to_string).collect()
}

/// Reads tetrahedra: positions, tets, notes.
#[pyfunction]
pub fn import_mesh(py: Python<'_>, path: PathBuf) -> PyResult<(Mesh<'_>, Vec<String>)> {
    let import = compute(py, || trepan_mesh::import(&path))?.map_err(of_file)?;
    Ok((mesh_out(py, &import.mesh.positions, &import.mesh.tets)?, texts(&import.notes)))
}

/// Reads triangles: positions, triangles, notes.
#[pyfunction]
pub fn import_surface(py: Python<'_>, path: PathBuf) -> PyResult<(Mesh<'_>, Vec<String>)> {
    let import = compute(py, || trepan_mesh::import_surface(&path))?.map_err(of_file)?;
    Ok((mesh_out(py, &import.mesh.positions, &import.mesh.triangles)?, texts(&import.notes)))
}

/// Writes tetrahedra in the format of the name's ending.
#[pyfunction]
pub fn write_mesh(py: Python<'_>, path: PathBuf, mesh: &Any<'_>) -> PyResult<()> {
    let mesh = tet_mesh(mesh)?;
    compute(py, || trepan_mesh::write(&path, &mesh))?.map_err(of_file)
}

/// Writes triangles in the format of the name's ending.
#[pyfunction]
pub fn write_surface(py: Python<'_>, path: PathBuf, mesh: &Any<'_>) -> PyResult<()> {
    let [positions, triangles] = fields(mesh, "mesh", ["positions", "triangles"])?;
    let (positions, triangles) = (points(&positions, "mesh.positions")?, indices(&triangles, "mesh.triangles")?);
    let mesh = TriMesh { positions, triangles };
    let nodes = mesh.positions.len();
    if let Some(at) = mesh.triangles.iter().position(|corners| corners.iter().any(|&n| n as usize >= nodes)) {
        return Err(value(format!("triangles[{at}] names a node over {}, the last one", nodes.saturating_sub(1))));
    }
    compute(py, || trepan_mesh::write_surface(&path, &mesh))?.map_err(of_file)
}

/// Fills the largest part of a mask with tetrahedra.
#[pyfunction]
pub fn tetrahedra<'py>(
    py: Python<'py>,
    volume: &Any<'py>,
    target_tets: usize,
    smoothing: f64,
    coarsening: u32,
    fine: Option<([f32; 3], f32, u32)>,
) -> PyResult<Mesh<'py>> {
    let mask = mask(volume)?;
    let fine = fine.map(|(centre, radius_mm, halvings)| Fine { centre: centre.into(), radius_mm, halvings });
    let config = lattice::Config { target_tets, smoothing, coarsening, fine, ..lattice::Config::default() };
    let mesh = compute(py, || lattice::tetrahedra(&mask, &config))?.map_err(value)?;
    mesh_out(py, &mesh.positions, &mesh.tets)
}

/// The surface on which a CT reaches an isovalue.
#[pyfunction]
pub fn isosurface<'py>(py: Python<'py>, volume: &Any<'py>, isovalue: i16) -> PyResult<Mesh<'py>> {
    let ct = self::volume::<i16>(volume)?;
    let mesh = compute(py, || trepan_mesh::isosurface(&ct, isovalue))?;
    mesh_out(py, &mesh.positions, &mesh.triangles)
}

/// The boundary triangles of tetrahedra, with the tetrahedron of each.
#[pyfunction]
pub fn boundary<'py>(py: Python<'py>, mesh: &Any<'py>) -> PyResult<(Array2<'py, u32>, Array1<'py, u32>)> {
    let mesh = tet_mesh(mesh)?;
    let surface = compute(py, || Surface::of(&mesh))?;
    Ok((rows_out(py, &surface.triangles)?, PyArray1::from_vec(py, surface.tet_of_triangle)))
}

/// Checks a mesh as the solvers need it, and measures its elements.
#[pyfunction]
pub fn quality(py: Python<'_>, mesh: &Any<'_>) -> PyResult<Vec<(&'static str, f64)>> {
    let mesh: TetMesh = tet_mesh(mesh)?;
    mesh.check().map_err(value)?;
    let quality = compute(py, || Quality::of(&mesh))?;
    Ok(vec![
        ("min_dihedral_deg", quality.min_dihedral_deg),
        ("max_dihedral_deg", quality.max_dihedral_deg),
        ("total_mm3", quality.total_mm3),
        ("min_edge_mm", quality.min_edge_mm),
        ("mean_edge_mm", quality.mean_edge_mm),
        ("min_height_mm", quality.min_height_mm),
    ])
}

/// Cell sizes for a mesh, mm: by the cost model, and the mean edge.
#[pyfunction]
pub fn voxel_size(py: Python<'_>, mesh: &Any<'_>, p_nc: f64, r_t: f64) -> PyResult<(f64, f64)> {
    let mesh = tet_mesh(mesh)?;
    let sizes = || {
        let measures = Measures::of(&mesh)?;
        Ok::<_, VoxelSizeError>((CostModel { p_nc, r_t }.analytic(&measures)?, measures.traditional_mm()))
    };
    compute(py, sizes)?.map_err(value)
}

/// A box of tetrahedra with cells along each axis, one corner at 0.
#[pyfunction]
pub fn split_box(py: Python<'_>, cells: [usize; 3], size_mm: [f32; 3]) -> PyResult<(Array2<'_, f32>, Array2<'_, u32>)> {
    let cubes = cells.iter().fold(1usize, |n, &m| n.saturating_mul(m));
    if !(1..=1_000_000).contains(&cubes) || !size_mm.iter().all(|mm| mm.is_finite() && *mm > 0.0) {
        let text = "1 to 1,000,000 cells in all, and lengths over 0";
        return Err(value(format!("cells is {cells:?} and size_mm {size_mm:?}: they must be {text}")));
    }
    let mesh = trepan_soft::boxes::split_box(cells, size_mm.into());
    Ok((points_out(py, &mesh.positions)?, rows_out(py, &mesh.tets)?))
}
