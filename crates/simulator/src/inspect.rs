//! `inspect`: prints what the readers see in a file or a folder, without a case.
//!
//! # Practice
//! One JSON tree is made of each kind of file, and printed as it is or as indented lines. Nothing
//! is written. No element that could identify a patient is read.

use crate::error::SessionError;
use serde_json::{Map, Value, json};
use std::path::Path;
use std::process::ExitCode;
use trepan_link::Recording;
use trepan_mesh::{Quality, SURFACE_FORMATS, Surface, Topology, VOLUME_FORMATS};
use trepan_report::printable::printable;
use trepan_volume::{Import, VoxelVolume, dicom};

/// First bytes of a recording.
const MCAP: &[u8] = b"\x89MCAP";

/// Percentiles of the values that are printed.
const PERCENTILES: [usize; 7] = [1, 5, 25, 50, 75, 95, 99];

/// Prints a file or a folder, as lines or as JSON.
pub(crate) fn inspect(path: &Path, number: Option<usize>, as_json: bool) -> Result<ExitCode, SessionError> {
    let seen = of(path, number)?;
    match as_json {
        true => println!("{seen:#}"),
        false => lines(&seen, 0),
    }
    Ok(ExitCode::SUCCESS)
}

fn of(path: &Path, number: Option<usize>) -> Result<Value, SessionError> {
    if path.is_dir() {
        return folder(path, number);
    }
    let mut start = [0; 512];
    let got = trepan_volume::open_regular(path).and_then(|mut file| std::io::Read::read(&mut file, &mut start));
    let start = &start[..got.unwrap_or(0)];
    if start.starts_with(MCAP) {
        return recording(path);
    }
    let import = number.map_or_else(|| trepan_volume::import(path), |n| trepan_volume::import_number(path, n));
    match import {
        Ok(import) => Ok(volume(&import)),
        Err(fault @ trepan_volume::ReadError::Format { .. }) => mesh(path).unwrap_or_else(|| Err(fault.into())),
        Err(fault) => Err(fault.into()),
    }
}

/// The series of a folder, and the volume of the one that a program would take.
fn folder(path: &Path, number: Option<usize>) -> Result<Value, SessionError> {
    let series = dicom::series(path)?;
    let import = number.map_or_else(|| dicom::import(path), |n| dicom::import_series(path, n));
    let list: Vec<Value> = series.iter().enumerate().map(|(n, series)| one_series(n, series)).collect();
    let taken = match import {
        Ok(import) => volume(&import),
        Err(fault) if !list.is_empty() => json!({ "not read": fault.to_string() }),
        Err(fault) => return Err(fault.into()),
    };
    Ok(json!({ "kind": "DICOM folder", "series": list, "taken": taken }))
}

fn one_series(number: usize, series: &dicom::Series) -> Value {
    json!({
        "number": number,
        "modality": series.modality,
        "description": series.description,
        "number at the scanner": series.number,
        "slices": series.slices,
        "places": series.places,
        "phases": series.slices as f64 / series.places.max(1) as f64,
        "columns and rows": series.size,
        "spacing, mm": series.spacing_mm,
        "slices lie": series.direction,
        "TE, ms": series.echo_ms,
        "TR, ms": series.repetition_ms,
    })
}

fn volume(Import { volume, notes, modality, facts }: &Import) -> Value {
    let affine = volume.world_from_voxel;
    let rows = [0, 1, 2].map(|row| {
        let [x, y, z] = affine.matrix3.row(row).to_array();
        [x, y, z, affine.translation[row]]
    });
    let facts: Map<String, Value> = facts.iter().map(|(name, fact)| ((*name).into(), json!(fact))).collect();
    json!({
        "kind": "volume",
        "modality": modality,
        "size, voxels": volume.dims,
        "spacing, mm": volume.spacing_mm().to_array(),
        "affine to RAS, mm": rows,
        "values": values(volume),
        "facts": facts,
        "remarks": notes.iter().map(ToString::to_string).collect::<Vec<_>>(),
    })
}

/// Range, mean and percentiles of the finite values, each at or below its rank.
fn values(volume: &VoxelVolume<f32>) -> Value {
    let mut finite: Vec<f32> = volume.data.iter().copied().filter(|v| v.is_finite()).collect();
    let Some(last) = finite.len().checked_sub(1) else { return json!("none is a number") };
    let mean = finite.iter().map(|&v| f64::from(v)).sum::<f64>() / finite.len() as f64;
    let mut from = 0;
    let mut percentiles = Map::new();
    for percent in PERCENTILES {
        let at = percent * last / 100;
        let value = *finite[from..].select_nth_unstable_by(at - from, f32::total_cmp).1;
        percentiles.insert(format!("{percent} %"), json!(value));
        from = at;
    }
    let (least, greatest) = finite.iter().fold((f32::MAX, f32::MIN), |(l, g), &v| (l.min(v), g.max(v)));
    json!({ "least": least, "greatest": greatest, "mean": mean, "percentiles": percentiles })
}

/// A mesh of tetrahedra or a surface; `None` if the file is of no mesh format.
fn mesh(path: &Path) -> Option<Result<Value, SessionError>> {
    let ending = path.extension()?.to_string_lossy().to_ascii_lowercase();
    let mut endings =
        VOLUME_FORMATS.iter().flat_map(|f| f.endings).chain(SURFACE_FORMATS.iter().flat_map(|f| f.endings));
    if !endings.any(|known| *known == ending) {
        return None;
    }
    let tets = trepan_mesh::import(path).map(|trepan_mesh::Import { mesh, notes }| {
        let quality = Quality::of(&mesh);
        let (low, high) = bounds(mesh.positions.iter().copied());
        json!({
            "kind": "mesh of tetrahedra",
            "nodes": mesh.positions.len(),
            "tetrahedra": mesh.tets.len(),
            "volume, ml": quality.total_mm3 * 1e-3,
            "box in RAS, mm": [low, high],
            "dihedral angles, degrees": [quality.min_dihedral_deg, quality.max_dihedral_deg],
            "mean edge, mm": quality.mean_edge_mm,
            "parts": Topology::of(&mesh).components().1,
            "surface is closed": Surface::of(&mesh).is_closed(),
            "faults": mesh.check().err().map(|fault| fault.to_string()),
            "remarks": notes.iter().map(ToString::to_string).collect::<Vec<_>>(),
        })
    });
    let surface = || {
        trepan_mesh::import_surface(path).map(|trepan_mesh::Import { mesh, notes }| {
            let (low, high) = bounds(mesh.positions.iter().copied());
            json!({
                "kind": "surface of triangles",
                "vertices": mesh.positions.len(),
                "triangles": mesh.triangles.len(),
                "volume, ml": mesh.volume_mm3() * 1e-3,
                "box in RAS, mm": [low, high],
                "is closed": mesh.is_closed(),
                "remarks": notes.iter().map(ToString::to_string).collect::<Vec<_>>(),
            })
        })
    };
    Some(tets.or_else(|fault| surface().map_err(|_| fault)).map_err(|fault| SessionError::Case(fault.to_string())))
}

fn bounds(points: impl Iterator<Item = trepan_geometry::Vec3>) -> ([f32; 3], [f32; 3]) {
    let none = (trepan_geometry::Vec3::MAX, trepan_geometry::Vec3::MIN);
    let (low, high) = points.fold(none, |(low, high), point| (low.min(point), high.max(point)));
    (low.to_array(), high.to_array())
}

fn recording(path: &Path) -> Result<Value, SessionError> {
    let recording = Recording::open(path)?;
    let header = &recording.header;
    Ok(json!({
        "kind": "recording",
        "program": header.app,
        "case": header.case,
        "ticks": recording.ticks.len(),
        "length, s": recording.ticks.last().map_or(0.0, |tick| tick.time_ms * 1e-3),
        "ticks of a second hand": recording.second.len(),
        "collision steps": recording.collisions.len(),
        "solver steps": recording.solver.len(),
        "events": recording.events.len(),
        "compression": recording.compression,
        "has an index": recording.indexed,
        "lacks": recording.losses().map(|losses| losses.to_string()),
    }))
}

/// Prints a tree as indented lines; numbers of one list stand in one line.
fn lines(value: &Value, depth: usize) {
    let Value::Object(fields) = value else { return };
    let indent = "  ".repeat(depth);
    for (name, value) in fields.iter().filter(|(_, value)| !value.is_null()) {
        match value {
            Value::Object(_) => {
                println!("{indent}{name}:");
                lines(value, depth + 1);
            }
            Value::Array(items) if items.iter().any(|item| item.is_object() || item.is_string()) => {
                println!("{indent}{name}:");
                for item in items {
                    match item {
                        Value::Object(_) => {
                            lines(item, depth + 1);
                            println!();
                        }
                        other => println!("{indent}  {}", shown(other)),
                    }
                }
            }
            other => println!("{indent}{name}: {}", shown(other)),
        }
    }
}

fn shown(value: &Value) -> String {
    match value {
        Value::String(text) => printable(text).to_string(),
        other => other.to_string(),
    }
}
