//! Bone that is drilled, and the contact of a tool with it.

use crate::arrays::{
    Any, Array1, Array2, Array3, affine_out, array, column, columns, points, pose, turn, volume, volume_out, within,
};
use crate::errors::{compute, value};
use crate::tool::Tool;
use glam::Vec3;
use numpy::{PyArray1, PyArray2, PyUntypedArrayMethods};
use pyo3::prelude::*;
use std::sync::{Mutex, MutexGuard, PoisonError};
use trepan_geometry::{Pose, ToolState};
use trepan_rigid::removal::RemovalLaw;
use trepan_rigid::{Method, RigidContact as Contact, RigidStep as Step};

/// Ticks between two looks for Ctrl-C.
const TICKS: usize = 4096;

/// The skull during drilling: densities on cubes along RAS, and what was cut from them.
///
/// ``volume`` is a ``VoxelVolume`` of int16 HU (copied once) on cubes along RAS: ``resample`` makes
/// one. Voxels at or over ``isovalue``, HU, are bone. Raises ``ValueError`` for another grid or one
/// without bone. Several contacts may share it; one drills at a time.
#[pyclass(frozen, module = "trepan._trepan")]
pub struct BoneVolume {
    bone: trepan_bone::BoneVolume,
    /// One thread at a time may drill.
    writer: Mutex<()>,
}

#[pymethods]
impl BoneVolume {
    #[new]
    fn new(py: Python<'_>, volume: &Any<'_>, isovalue: i16) -> PyResult<Self> {
        let ct = self::volume::<i16>(volume)?;
        within(ct.spacing_mm().x as f32, "the edge of a voxel in mm", [0.02, 20.0])?;
        let bone = compute(py, || trepan_bone::BoneVolume::of(ct, isovalue))?.map_err(value)?;
        Ok(Self { bone, writer: Mutex::new(()) })
    }

    #[getter]
    fn shape(&self) -> (usize, usize, usize) {
        self.bone.dims().into()
    }

    #[getter]
    fn spacing_mm(&self) -> f32 {
        self.bone.spacing_mm()
    }

    /// Lowest and highest corner of the bone before drilling, RAS mm.
    #[getter]
    fn bounds_mm(&self) -> [[f32; 3]; 2] {
        let bounds = self.bone.bounds();
        [bounds.min.to_array(), bounds.max.to_array()]
    }

    /// Whether each point (n, 3), RAS mm, is in bone that was not cut.
    fn is_bone<'py>(&self, py: Python<'py>, positions: &Any<'py>) -> PyResult<Array1<'py, bool>> {
        let points = points(positions, "positions")?;
        let inside = compute(py, || points.iter().map(|&point| self.bone.holds(point)).collect())?;
        Ok(PyArray1::from_vec(py, inside))
    }

    /// Densities with what was cut, HU of shape (i, j, k), and the affine.
    fn snapshot<'py>(&self, py: Python<'py>) -> PyResult<(Array3<'py, i16>, Array2<'py, f64>)> {
        let now = compute(py, || self.bone.snapshot())?;
        Ok((volume_out(py, now.data, now.dims)?, affine_out(py, now.world_from_voxel)))
    }
}

/// What one tick found and did.
#[pyclass(frozen, get_all, module = "trepan._trepan")]
pub struct RigidStep {
    /// How far the hand is from the proxy, in the bone, mm.
    depth_mm: f32,
    /// Unit vector out of the bone; 0 without contact.
    normal: (f32, f32, f32),
    /// Point of application, RAS mm.
    point_mm: (f32, f32, f32),
    /// Where the tool is seen, held back by the bone, RAS mm.
    proxy_mm: (f32, f32, f32),
    /// Bone removed in this tick, mm3.
    removed_mm3: f32,
    /// Speed of the spindle under load, 1/min; 0 when stalled or not cutting.
    spindle_rpm: f32,
    /// Whether the cut came through to 3 mm without bone.
    broke_through: bool,
    /// Times that the method had to fall back, as after a jump.
    fallbacks: u32,
}

#[pymethods]
impl RigidStep {
    fn __repr__(&self) -> String {
        let Self { depth_mm, normal, removed_mm3, .. } = self;
        format!("RigidStep(depth_mm={depth_mm}, normal={normal:?}, removed_mm3={removed_mm3})")
    }
}

/// What a path of n ticks found and did; see :class:`RigidStep` for the columns.
#[pyclass(frozen, get_all, module = "trepan._trepan")]
pub struct RigidPath {
    depth_mm: Py<PyArray1<f32>>,
    normal: Py<PyArray2<f32>>,
    proxy_mm: Py<PyArray2<f32>>,
    removed_mm3: Py<PyArray1<f32>>,
    spindle_rpm: Py<PyArray1<f32>>,
    broke_through: Py<PyArray1<bool>>,
}

/// One tool against bone by the method god-object-sphere (crate ``trepan-rigid``).
#[pyclass(frozen, module = "trepan._trepan")]
pub struct RigidContact {
    bone: Py<BoneVolume>,
    law: RemovalLaw,
    state: Mutex<State>,
}

/// What a tick changes.
struct State {
    contact: Box<dyn Contact>,
    out: Step,
}

impl State {
    fn tick(&mut self, bone: &BoneVolume, pose: Pose, drilling: bool, dt_ms: f32) -> RigidStep {
        let _writer = drilling.then(|| bone.writer.lock().unwrap_or_else(PoisonError::into_inner));
        self.contact.step(&bone.bone, &ToolState::at(pose), drilling, dt_ms, &mut self.out);
        let Step { manifold, removed_mm3, spindle_rpm, broke_through, fallbacks, .. } = &self.out;
        RigidStep {
            depth_mm: manifold.depth_mm,
            normal: manifold.normal.into(),
            point_mm: manifold.point.into(),
            proxy_mm: self.contact.proxy().translation.into(),
            removed_mm3: *removed_mm3,
            spindle_rpm: *spindle_rpm,
            broke_through: *broke_through,
            fallbacks: *fallbacks,
        }
    }
}

#[pymethods]
impl RigidContact {
    #[new]
    fn new(py: Python<'_>, bone: Py<BoneVolume>, tool: &Tool) -> PyResult<Self> {
        let method = Method::RECOMMENDED;
        let contact = compute(py, || method.build(&tool.tool))?;
        let state = Mutex::new(State { contact, out: Step::default() });
        Ok(Self { bone, law: method.removal(), state })
    }

    /// Newtons of the task for a millimetre of depth, as the law of drilling has it.
    #[getter]
    fn stiffness_n_per_mm(&self) -> f32 {
        match self.law {
            RemovalLaw::Rate { stiffness, .. } => stiffness,
            RemovalLaw::PerTick { .. } => 0.0,
        }
    }

    /// Put the proxy there, RAS mm and x, y, z, w, and forget all history.
    #[pyo3(signature = (position, quaternion=None))]
    fn reset(&self, py: Python<'_>, position: &Any<'_>, quaternion: Option<&Any<'_>>) -> PyResult<()> {
        let pose = pose(position, quaternion)?;
        compute(py, || self.state().contact.reset(pose))
    }

    /// One haptic tick: move the proxy towards the pose, find the contact, drill.
    ///
    /// ``position`` is the centre of the tip, RAS mm; the shaft lies along +z of the tool, turned
    /// by ``quaternion`` x, y, z, w. Raises ``ValueError`` for numbers that are not finite. Some
    /// microseconds.
    #[pyo3(signature = (position, quaternion=None, drilling=false, dt_ms=1.0))]
    fn step(
        &self,
        py: Python<'_>,
        position: &Any<'_>,
        quaternion: Option<&Any<'_>>,
        drilling: bool,
        dt_ms: f32,
    ) -> PyResult<RigidStep> {
        let pose = pose(position, quaternion)?;
        within(dt_ms, "dt_ms", [1e-3, 1e3])?;
        let bone = self.bone.get();
        compute(py, || self.state().tick(bone, pose, drilling, dt_ms))
    }

    /// A tick for each of n poses: positions (n, 3), quaternions (n, 4), drilling (n,) or one.
    ///
    /// The same as n calls of :meth:`step`. Ctrl-C ends it between ticks.
    #[pyo3(signature = (positions, quaternions=None, drilling=None, dt_ms=1.0))]
    fn path(
        &self,
        py: Python<'_>,
        positions: &Any<'_>,
        quaternions: Option<&Any<'_>>,
        drilling: Option<&Any<'_>>,
        dt_ms: f32,
    ) -> PyResult<RigidPath> {
        let poses = poses(positions, quaternions)?;
        let drilling = switches(drilling, poses.len())?;
        within(dt_ms, "dt_ms", [1e-3, 1e3])?;
        let bone = self.bone.get();
        let mut ticks = Vec::with_capacity(poses.len());
        for (poses, drilling) in poses.chunks(TICKS).zip(drilling.chunks(TICKS)) {
            py.check_signals()?;
            let run = || {
                let mut state = self.state();
                let ticks = poses.iter().zip(drilling);
                ticks.map(|(&pose, &drilling)| state.tick(bone, pose, drilling, dt_ms)).collect::<Vec<_>>()
            };
            ticks.extend(compute(py, run)?);
        }
        Ok(RigidPath {
            depth_mm: column(py, &ticks, |tick| tick.depth_mm).unbind(),
            normal: columns(py, &ticks, |tick| tick.normal.into())?.unbind(),
            proxy_mm: columns(py, &ticks, |tick| tick.proxy_mm.into())?.unbind(),
            removed_mm3: column(py, &ticks, |tick| tick.removed_mm3).unbind(),
            spindle_rpm: column(py, &ticks, |tick| tick.spindle_rpm).unbind(),
            broke_through: column(py, &ticks, |tick| tick.broke_through).unbind(),
        })
    }
}

impl RigidContact {
    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

fn poses(positions: &Any<'_>, quaternions: Option<&Any<'_>>) -> PyResult<Vec<Pose>> {
    let positions = points(positions, "positions")?;
    let Some(quaternions) = quaternions else {
        return Ok(positions.into_iter().map(Pose::from_translation).collect());
    };
    let quaternions = crate::arrays::rows::<f32, 4>(quaternions, "quaternions")?;
    if quaternions.len() != positions.len() {
        let (found, wanted) = (quaternions.len(), positions.len());
        return Err(value(format!("quaternions has {found} rows, positions {wanted}: they must be as many")));
    }
    let pose = |(at, (position, numbers)): (usize, (Vec3, [f32; 4]))| {
        Ok(Pose::from_parts(position, turn(numbers, &format!("quaternions[{at}]"))?))
    };
    positions.into_iter().zip(quaternions).enumerate().map(pose).collect()
}

/// Whether the pedal is down in each tick: nothing, one switch for all, or an array of them.
fn switches(any: Option<&Any<'_>>, ticks: usize) -> PyResult<Vec<bool>> {
    let Some(any) = any else { return Ok(vec![false; ticks]) };
    if let Ok(one) = any.extract::<bool>() {
        return Ok(vec![one; ticks]);
    }
    let each = array::<bool, numpy::Ix1>(any, "drilling", "(n,) of bool, or one bool")?;
    match each.len() == ticks {
        true => Ok(each.as_array().to_vec()),
        false => Err(value(format!("drilling has {} entries, positions {ticks}: they must be as many", each.len()))),
    }
}
