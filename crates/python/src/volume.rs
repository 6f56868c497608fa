//! Images: read, convert, resample, write.

use crate::arrays::{Any, Array2, Array3, affine_out, check_room, fields, mask, volume, volume_out, within};
use crate::errors::{compute, content, of_file, value};
use numpy::Element;
use pyo3::exceptions::PyFileNotFoundError;
use pyo3::prelude::*;
use std::path::PathBuf;
use trepan_volume::{DistanceField, Grid, Interpolation, ReadError, Sample, VoxelVolume};

type Image<'py, T> = (Array3<'py, T>, Array2<'py, f64>);

/// What a reader returns: samples, affine, notes, modality, facts.
type Imported<'py> = (Array3<'py, f32>, Array2<'py, f64>, Vec<String>, Option<String>, Vec<(&'static str, String)>);

fn image<T: Element>(py: Python<'_>, volume: VoxelVolume<T>) -> PyResult<Image<'_, T>> {
    Ok((volume_out(py, volume.data, volume.dims)?, affine_out(py, volume.world_from_voxel)))
}

/// Reads an image of any format: samples, affine, notes, modality, facts.
#[pyfunction]
#[pyo3(signature = (path, number=None))]
pub fn import_volume(py: Python<'_>, path: PathBuf, number: Option<usize>) -> PyResult<Imported<'_>> {
    let read = || trepan_volume::import_among(trepan_volume::FORMATS, &path, number);
    let import = compute(py, read)?.map_err(|fault| match fault {
        ReadError::Missing { .. } => PyFileNotFoundError::new_err(fault.to_string()),
        _ => of_file(fault),
    })?;
    let notes = import.notes.iter().map(ToString::to_string).collect();
    let (data, affine) = image(py, import.volume)?;
    Ok((data, affine, notes, import.modality, import.facts))
}

/// Writes float32 samples as NIfTI or NRRD, by the ending of the name.
#[pyfunction]
pub fn write_volume(py: Python<'_>, path: PathBuf, volume: &Any<'_>) -> PyResult<()> {
    let volume = self::volume::<f32>(volume)?;
    let write = || match path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("nrrd")) {
        true => trepan_volume::nrrd::write(&path, &volume),
        false => trepan_volume::nifti::write(&path, &volume),
    };
    compute(py, write)?.map_err(of_file)
}

/// Rounds a CT's samples to whole HU, int16; refuses what is no CT.
#[pyfunction]
pub fn hounsfield<'py>(py: Python<'py>, volume: &Any<'py>) -> PyResult<Array3<'py, i16>> {
    let ct = self::volume::<f32>(volume)?;
    let hu = compute(py, || trepan_volume::hounsfield(&ct))?.map_err(content)?;
    volume_out(py, hu.data, hu.dims)
}

/// The bone threshold from the histogram of a CT, HU.
#[pyfunction]
pub fn bone_isovalue(py: Python<'_>, volume: &Any<'_>) -> PyResult<i16> {
    let ct = self::volume::<i16>(volume)?;
    compute(py, || trepan_volume::bone_isovalue(&ct))
}

/// The CT with its largest piece of bone alone, and a remark on what was left out.
#[pyfunction]
pub fn skull_only<'py>(
    py: Python<'py>,
    volume: &Any<'py>,
    isovalue: i16,
) -> PyResult<(Array3<'py, i16>, Option<String>)> {
    let mut ct = self::volume::<i16>(volume)?;
    let islands = compute(py, || trepan_volume::skull_only(&mut ct, isovalue))?;
    Ok((volume_out(py, ct.data, ct.dims)?, islands.note()))
}

/// The grid of cubes along RAS that covers an image: shape and affine.
#[pyfunction]
pub fn isotropic_over<'py>(
    py: Python<'py>,
    shape: [usize; 3],
    affine: &Any<'py>,
    spacing_mm: f32,
) -> PyResult<([usize; 3], Array2<'py, f64>)> {
    within(spacing_mm, "spacing_mm", [1e-4, 1e3])?;
    // No sample is needed to place a grid.
    let empty = VoxelVolume::<u8> { dims: shape, data: Vec::new(), world_from_voxel: crate::arrays::affine(affine)? };
    let grid = Grid::isotropic_over(&empty, spacing_mm);
    check_room(&grid)?;
    Ok((grid.dims, affine_out(py, grid.world_from_voxel)))
}

/// Resamples an image of float32, int16, uint16 or uint8 to a grid.
#[pyfunction]
pub fn resample<'py>(
    py: Python<'py>,
    volume: &Any<'py>,
    shape: [usize; 3],
    to_affine: &Any<'py>,
    interpolation: &str,
    outside: f64,
) -> PyResult<Any<'py>> {
    let grid = Grid { dims: shape, world_from_voxel: crate::arrays::affine(to_affine)? };
    check_room(&grid)?;
    let how = match interpolation {
        "trilinear" => Interpolation::Trilinear,
        "cubic" => Interpolation::Cubic,
        "nearest" => Interpolation::Nearest,
        "majority" => Interpolation::Majority,
        _ => {
            let right = "trilinear, cubic, nearest or majority";
            return Err(value(format!("interpolation is {interpolation:?}: it must be {right}")));
        }
    };
    let [data, _] = fields(volume, "volume", ["data", "affine"])?;
    let kind: String = data.getattr("dtype")?.str()?.extract()?;
    match kind.as_str() {
        "int16" => resampled::<i16>(py, volume, &grid, how, outside),
        "uint16" => resampled::<u16>(py, volume, &grid, how, outside),
        "uint8" => resampled::<u8>(py, volume, &grid, how, outside),
        _ => resampled::<f32>(py, volume, &grid, how, outside),
    }
}

fn resampled<'py, T: Sample + Element>(
    py: Python<'py>,
    volume: &Any<'py>,
    grid: &Grid,
    how: Interpolation,
    outside: f64,
) -> PyResult<Any<'py>> {
    let from = self::volume::<T>(volume)?;
    if how == Interpolation::Cubic && from.data.iter().any(|sample| !sample.to_f32().is_finite()) {
        return Err(value("data holds NaN or infinity, which a spline spreads: replace them or take trilinear"));
    }
    let to = compute(py, || trepan_volume::resample(&from, grid, how, T::from_f32(outside as f32)))?;
    Ok(volume_out(py, to.data, to.dims)?.into_any())
}

/// The signed distance to the border of a mask, mm, negative inside.
#[pyfunction]
pub fn distance_field<'py>(py: Python<'py>, volume: &Any<'py>) -> PyResult<Array3<'py, f32>> {
    let mask = mask(volume)?;
    let field = compute(py, || DistanceField::of_mask(&mask).into_values())?;
    volume_out(py, field.data, field.dims)
}
