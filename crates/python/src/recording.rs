//! Recordings of sessions as columns of numbers.

use crate::arrays::{column, columns};
use crate::errors::{compute, content, of_file};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::collections::BTreeMap;
use std::path::PathBuf;
use trepan_geometry::Pose;
use trepan_link::wire::{SessionHeader, TickRecord};

/// What a session left in its MCAP file.
#[pyclass(frozen, module = "trepan._trepan")]
pub struct Recording {
    recording: trepan_link::Recording,
    /// Name of the program that recorded.
    #[pyo3(get)]
    app: String,
    /// Its version.
    #[pyo3(get)]
    version: String,
    /// Name of the case.
    #[pyo3(get)]
    case: String,
    /// The session's configuration, an entry for each setting by its path.
    #[pyo3(get)]
    config: BTreeMap<String, String>,
    /// Hashes of the inputs by name.
    #[pyo3(get)]
    hashes: BTreeMap<String, String>,
    /// What is missing in the file; `None` for a complete one.
    #[pyo3(get)]
    losses: Option<String>,
}

fn quaternion(pose: &Pose) -> [f32; 4] {
    pose.rotation.to_array()
}

#[pymethods]
impl Recording {
    #[new]
    #[pyo3(signature = (path, allow_damaged=false))]
    fn new(py: Python<'_>, path: PathBuf, allow_damaged: bool) -> PyResult<Self> {
        let recording = compute(py, || trepan_link::Recording::open(&path))?.map_err(of_file)?;
        let losses = recording.losses();
        if let Some(losses) = losses.as_ref().filter(|_| recording.damage.is_some() && !allow_damaged) {
            let remedy = "fetch the file again, or give allow_damaged=True for what can be read";
            return Err(content(format!("{}: {losses}; {remedy}", path.display())));
        }
        let SessionHeader { app, version, case, config, hashes, .. } = recording.header.clone();
        Ok(Self { recording, app, version, case, config, hashes, losses })
    }

    fn __len__(&self) -> usize {
        self.recording.ticks.len()
    }

    /// One array a column, of all haptic ticks.
    fn ticks<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let (ticks, out) = (&self.recording.ticks[..], PyDict::new(py));
        out.set_item("tick", column(py, ticks, |t| t.tick))?;
        out.set_item("time_ms", column(py, ticks, |t| t.time_ms))?;
        out.set_item("device_mm", columns(py, ticks, |t| t.device.translation.to_array())?)?;
        out.set_item("device_quaternion", columns(py, ticks, |t| quaternion(&t.device))?)?;
        out.set_item("velocity_m_s", columns(py, ticks, |t| t.twist.linear.to_array())?)?;
        out.set_item("buttons", column(py, ticks, |t| t.buttons))?;
        out.set_item("proxy_mm", columns(py, ticks, |t| t.proxy.translation.to_array())?)?;
        out.set_item("proxy_quaternion", columns(py, ticks, |t| quaternion(&t.proxy))?)?;
        out.set_item("force_n", columns(py, ticks, |t| t.wrench.force.to_array())?)?;
        out.set_item("torque_n_mm", columns(py, ticks, |t| t.wrench.torque.to_array())?)?;
        out.set_item("tissue_n", column(py, ticks, TickRecord::tissue_n))?;
        out.set_item("contact_normal", columns(py, ticks, |t| t.contact_normal.to_array())?)?;
        out.set_item("depth_mm", column(py, ticks, |t| t.depth_mm))?;
        out.set_item("tissue_depth_mm", column(py, ticks, |t| t.tissue_depth_mm))?;
        out.set_item("removed_mm3", column(py, ticks, |t| t.removed_mm3))?;
        out.set_item("spindle_rpm", column(py, ticks, |t| t.spindle_rpm))?;
        out.set_item("brain_distance_mm", column(py, ticks, |t| t.brain_distance_mm))?;
        out.set_item("compute_us", column(py, ticks, |t| t.compute_us))?;
        out.set_item("late", column(py, ticks, |t| t.has(TickRecord::LATE)))?;
        out.set_item("drilling", column(py, ticks, |t| t.has(TickRecord::DRILLING)))?;
        out.set_item("through", column(py, ticks, |t| t.has(TickRecord::THROUGH)))?;
        out.set_item("clamped", column(py, ticks, |t| t.has(TickRecord::CLAMPED)))?;
        out.set_item("phase", column(py, ticks, |t| t.phase))?;
        out.set_item("tool", column(py, ticks, |t| t.tool))?;
        Ok(out)
    }

    /// One array a column, of the second hand's ticks; empty ones without it.
    fn second<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let (ticks, out) = (&self.recording.second[..], PyDict::new(py));
        out.set_item("tick", column(py, ticks, |t| t.tick))?;
        out.set_item("time_ms", column(py, ticks, |t| t.time_ms))?;
        out.set_item("buttons", column(py, ticks, |t| t.buttons))?;
        out.set_item("proxy_mm", columns(py, ticks, |t| t.proxy.translation.to_array())?)?;
        out.set_item("proxy_quaternion", columns(py, ticks, |t| quaternion(&t.proxy))?)?;
        out.set_item("force_n", columns(py, ticks, |t| t.wrench.force.to_array())?)?;
        out.set_item("depth_mm", column(py, ticks, |t| t.depth_mm))?;
        out.set_item("tissue_depth_mm", column(py, ticks, |t| t.tissue_depth_mm))?;
        Ok(out)
    }

    /// One array a column, of all solver steps.
    fn solver<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let (steps, out) = (&self.recording.solver[..], PyDict::new(py));
        out.set_item("step", column(py, steps, |s| s.step))?;
        out.set_item("time_ms", column(py, steps, |s| s.time_ms))?;
        out.set_item("max_displacement_mm", column(py, steps, |s| s.max_displacement_mm))?;
        out.set_item("inverted", column(py, steps, |s| s.inverted))?;
        out.set_item("compute_us", column(py, steps, |s| s.compute_us))?;
        Ok(out)
    }

    /// Tick, time in ms, kind and text of each event.
    fn events(&self) -> Vec<(u64, f64, String, String)> {
        let events = self.recording.events.iter();
        events.map(|event| (event.tick, event.time_ms, event.kind.clone(), event.text.clone())).collect()
    }
}
