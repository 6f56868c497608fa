//! Converts numpy arrays to the crates' types and back, and says what is wrong with an array.

use crate::errors::value;
use glam::{DAffine3, DMat3, DVec3, Quat, Vec3};
use numpy::ndarray::{self, Dimension, ShapeBuilder};
use numpy::{
    Element, IxDyn, PyArray1, PyArray2, PyArray3, PyArrayMethods, PyReadonlyArray, PyReadonlyArrayDyn,
    PyUntypedArrayMethods, dtype,
};
use pyo3::prelude::*;
use pyo3::types::IntoPyDict;
use trepan_geometry::Pose;
use trepan_mesh::TetMesh;
use trepan_volume::{Grid, VoxelVolume, room_for_voxels};

/// Any Python object.
pub type Any<'py> = Bound<'py, PyAny>;
/// A numpy array of one axis.
pub type Array1<'py, T> = Bound<'py, PyArray1<T>>;
/// A numpy array of two axes.
pub type Array2<'py, T> = Bound<'py, PyArray2<T>>;
/// A numpy array of three axes.
pub type Array3<'py, T> = Bound<'py, PyArray3<T>>;

/// An array of a type and a number of axes.
///
/// Numbers of another type are converted where no value can change, and to floats; anything else
/// is a `ValueError`.
pub fn array<'py, T: Element, D: Dimension>(
    any: &Any<'py>,
    name: &str,
    shape: &str,
) -> PyResult<PyReadonlyArray<'py, T, D>> {
    if let Ok(array) = any.cast::<numpy::PyArray<T, D>>() {
        return Ok(array.try_readonly()?);
    }
    let py = any.py();
    let numpy = py.import("numpy")?;
    let plain = numpy.call_method1("asarray", (any,)).map_err(|fault| value(format!("{name} is no array: {fault}")))?;
    let [found, wanted] = [plain.getattr("dtype")?, dtype::<T>(py).into_any()];
    let kind = |dtype: &Any<'_>| dtype.getattr("kind")?.extract::<char>();
    let to_float = kind(&wanted)? == 'f' && "fiub".contains(kind(&found)?);
    if !to_float && !numpy.call_method1("can_cast", (&found, &wanted, "safe"))?.is_truthy()? {
        return Err(value(format!("{name} has dtype {found}, it must be {wanted}; convert it with .astype({wanted})")));
    }
    let options = [("copy", false)].into_py_dict(py)?;
    let converted = plain.call_method("astype", (wanted,), Some(&options))?;
    let found: Vec<usize> = plain.getattr("shape")?.extract()?;
    let converted = converted.cast_into::<numpy::PyArray<T, D>>();
    converted
        .map(|array| array.readonly())
        .map_err(|_| value(format!("{name} has shape {}, it must be {shape}", tuple(&found))))
}

/// A shape as Python writes it.
fn tuple(shape: &[usize]) -> String {
    let numbers: Vec<String> = shape.iter().map(ToString::to_string).collect();
    format!("({}{})", numbers.join(", "), if shape.len() == 1 { "," } else { "" })
}

/// Largest coordinate, mm: a kilometre.
const FAR_MM: f32 = 1e6;

/// A number within bounds, whose name ends with its unit.
pub fn within(number: f32, name: &str, [low, high]: [f32; 2]) -> PyResult<f32> {
    match (low..=high).contains(&number) {
        true => Ok(number),
        false => Err(value(format!("{name} is {number}: it must be {low} to {high}"))),
    }
}

/// Whether a place is finite and within a kilometre.
fn is_place(point: &Vec3) -> bool {
    point.abs().cmple(Vec3::splat(FAR_MM)).all()
}

/// An affine of shape (4, 4).
pub fn affine(any: &Any<'_>) -> PyResult<DAffine3> {
    let array = array::<f64, numpy::Ix2>(any, "affine", "(4, 4)")?;
    let of = array.as_array();
    if of.shape() != [4, 4] {
        return Err(value(format!("affine has shape {}, it must be (4, 4)", tuple(of.shape()))));
    }
    let column = |at: usize| DVec3::new(of[[0, at]], of[[1, at]], of[[2, at]]);
    let affine = DAffine3::from_mat3_translation(DMat3::from_cols(column(0), column(1), column(2)), column(3));
    let row = [of[[3, 0]], of[[3, 1]], of[[3, 2]], of[[3, 3]]];
    let volume = affine.matrix3.determinant().abs();
    if !affine.is_finite() || row != [0.0, 0.0, 0.0, 1.0] || volume < 1e-12 {
        let text = "it must be finite and invertible with the last row 0, 0, 0, 1, from voxel indices to RAS mm";
        return Err(value(format!("affine is {affine:?} over the row {row:?}; {text}")));
    }
    Ok(affine)
}

/// An affine as an array of shape (4, 4).
pub fn affine_out(py: Python<'_>, affine: DAffine3) -> Array2<'_, f64> {
    let columns = glam::DMat4::from(affine).to_cols_array();
    PyArray2::from_owned_array(py, ndarray::Array2::from_shape_fn((4, 4), |(row, column)| columns[4 * column + row]))
}

/// A volume from an object with `data` of shape (i, j, k) and `affine`. Copies the samples.
pub fn volume<T: Element + Copy>(any: &Any<'_>) -> PyResult<VoxelVolume<T>> {
    let [data, place] = fields(any, "volume", ["data", "affine"])?;
    volume_of(&data, &place)
}

fn volume_of<T: Element + Copy>(data: &Any<'_>, place: &Any<'_>) -> PyResult<VoxelVolume<T>> {
    let (name, world_from_voxel) = ("volume.data", affine(place)?);
    let array = array::<T, numpy::Ix3>(data, name, "(i, j, k)")?;
    let dims: [usize; 3] = core::array::from_fn(|axis| array.shape()[axis]);
    if dims.iter().any(|&n| n < 2) {
        return Err(value(format!("{name} has shape {}, it needs 2 voxels along each axis", tuple(&dims))));
    }
    Ok(VoxelVolume { dims, data: array.as_array().t().iter().copied().collect(), world_from_voxel })
}

/// A mask: every voxel that is not 0 is 1.
pub fn mask(any: &Any<'_>) -> PyResult<VoxelVolume<u8>> {
    let [data, place] = fields(any, "volume", ["data", "affine"])?;
    let is_set = any.py().import("numpy")?.call_method1("not_equal", (data, 0))?;
    volume_of(&is_set.call_method1("astype", ("uint8",))?, &place)
}

/// The samples as an array of shape (i, j, k), i fastest, without a copy.
pub fn volume_out<T: Element>(py: Python<'_>, data: Vec<T>, dims: [usize; 3]) -> PyResult<Array3<'_, T>> {
    Ok(PyArray3::from_owned_array(py, ndarray::Array3::from_shape_vec(dims.f(), data).map_err(value)?))
}

/// Refuses a grid without voxels, or one that memory cannot hold.
pub fn check_room(grid: &Grid) -> PyResult<()> {
    if grid.voxels() == 0 {
        return Err(value(format!("the grid has the shape {}: it needs a voxel along each axis", tuple(&grid.dims))));
    }
    room_for_voxels(grid.voxels() as u64, 4).map_err(|fault| value(format!("the grid: {fault}; take a larger spacing")))
}

/// Finite points from an array of shape (n, 3).
pub fn points(any: &Any<'_>, name: &str) -> PyResult<Vec<Vec3>> {
    let points: Vec<Vec3> = rows::<f32, 3>(any, name)?.into_iter().map(Vec3::from_array).collect();
    match points.iter().position(|point| !is_place(point)) {
        Some(at) => Err(value(format!(
            "{name}[{at}] is {}: every coordinate must be finite and within a kilometre",
            points[at]
        ))),
        None => Ok(points),
    }
}

/// Rows of an array of shape (n, N).
pub fn rows<T: Element + Copy, const N: usize>(any: &Any<'_>, name: &str) -> PyResult<Vec<[T; N]>> {
    let array = array::<T, numpy::Ix2>(any, name, &format!("(n, {N})"))?;
    let of = array.as_array();
    if of.ncols() != N {
        return Err(value(format!("{name} has shape {}, it must be (n, {N})", tuple(of.shape()))));
    }
    Ok(of.rows().into_iter().map(|row| core::array::from_fn(|column| row[column])).collect())
}

/// Rows of node numbers, each from 0.
pub fn indices<const N: usize>(any: &Any<'_>, name: &str) -> PyResult<Vec<[u32; N]>> {
    if let Ok(rows) = rows::<u32, N>(any, name) {
        return Ok(rows);
    }
    let number = |row: usize, n: i64| u32::try_from(n).map_err(|_| value(format!("{name}[{row}] names node {n}")));
    let rows = rows::<i64, N>(any, name)?;
    let rows = rows.iter().enumerate().map(|(at, row)| {
        let mut out = [0; N];
        row.iter().zip(&mut out).try_for_each(|(&n, out)| number(at, n).map(|n| *out = n))?;
        Ok(out)
    });
    rows.collect()
}

/// Node numbers from an array of shape (n,).
pub fn nodes(any: &Any<'_>, name: &str) -> PyResult<Vec<u32>> {
    let flat: PyReadonlyArrayDyn<'_, i64> = array::<i64, IxDyn>(any, name, "(n,)")?;
    if flat.ndim() != 1 {
        return Err(value(format!("{name} has shape {}, it must be (n,)", tuple(flat.shape()))));
    }
    let node = |&n: &i64| u32::try_from(n).map_err(|_| value(format!("{name} names node {n}; nodes count from 0")));
    flat.as_array().iter().map(node).collect()
}

/// Two fields of an object.
pub fn fields<'py>(any: &Any<'py>, name: &str, fields: [&str; 2]) -> PyResult<[Any<'py>; 2]> {
    match fields.map(|field| any.getattr(field)) {
        [Ok(a), Ok(b)] => Ok([a, b]),
        _ => {
            let (found, [a, b]) = (any.get_type().name()?, fields);
            Err(pyo3::exceptions::PyTypeError::new_err(format!("{name} is a {found}: it must have .{a} and .{b}")))
        }
    }
}

/// The tetrahedra of an object with `positions` and `tets`, with every number checked.
pub fn tet_mesh(any: &Any<'_>) -> PyResult<TetMesh> {
    let [positions, tets] = fields(any, "mesh", ["positions", "tets"])?;
    let mesh = TetMesh { positions: points(&positions, "mesh.positions")?, tets: indices(&tets, "mesh.tets")? };
    mesh.check_indices().map_err(value)?;
    Ok(mesh)
}

/// One vector from three numbers.
pub fn vector(any: &Any<'_>, name: &str) -> PyResult<Vec3> {
    let numbers = any.extract::<[f32; 3]>().map_err(|_| value(format!("{name} must be three numbers")))?;
    let vector = Vec3::from_array(numbers);
    if is_place(&vector) {
        Ok(vector)
    } else {
        Err(value(format!("{name} is {vector}: it must be finite, within 1e6")))
    }
}

/// A pose from a position, mm, and a quaternion x, y, z, w; no turn without one.
pub fn pose(position: &Any<'_>, quaternion: Option<&Any<'_>>) -> PyResult<Pose> {
    let translation = vector(position, "position")?;
    let Some(quaternion) = quaternion else { return Ok(Pose::from_translation(translation)) };
    let numbers = quaternion.extract::<[f32; 4]>().map_err(|_| value("quaternion must be four numbers x, y, z, w"))?;
    Ok(Pose::from_parts(translation, turn(numbers, "quaternion")?))
}

/// A unit quaternion from x, y, z, w of any length but 0.
pub fn turn(numbers: [f32; 4], name: &str) -> PyResult<Quat> {
    let quaternion = Quat::from_array(numbers);
    let length = quaternion.length();
    if length.is_finite() && length > 1e-6 {
        return Ok(quaternion / length);
    }
    Err(value(format!("{name} is {numbers:?}: x, y, z, w must be finite and not all 0")))
}

/// Vectors as an array of shape (n, N), with one copy.
pub fn rows_out<'py, T: Element + Copy, const N: usize>(py: Python<'py>, rows: &[[T; N]]) -> PyResult<Array2<'py, T>> {
    let flat = rows.as_flattened().to_vec();
    Ok(PyArray2::from_owned_array(py, ndarray::Array2::from_shape_vec((rows.len(), N), flat).map_err(value)?))
}

/// Points as an array of shape (n, 3), with one copy.
pub fn points_out<'py>(py: Python<'py>, points: &[Vec3]) -> PyResult<Array2<'py, f32>> {
    rows_out(py, bytemuck::cast_slice::<Vec3, [f32; 3]>(points))
}

/// A column of numbers.
pub fn column<'py, T: Element, R>(py: Python<'py>, rows: &[R], of: impl Fn(&R) -> T) -> Array1<'py, T> {
    PyArray1::from_vec(py, rows.iter().map(of).collect())
}

/// A column of vectors.
pub fn columns<'py, T: Element + Copy, const N: usize, R>(
    py: Python<'py>,
    rows: &[R],
    of: impl Fn(&R) -> [T; N],
) -> PyResult<Array2<'py, T>> {
    rows_out(py, &rows.iter().map(of).collect::<Vec<_>>())
}
