//! The pass of the membrane: forces of its triangles on their nodes, one thread a triangle.
//!
//! # Theory
//! The arithmetic of `sheet.rs`. A triangle has four slots like a tetrahedron, of which the last
//! stays zero.
//!
//! # Practice
//! 80 bytes read in a row and 48 scattered a triangle and step, besides its nodes.

use crate::gpu::device_state::DeviceState;
use crate::gpu::forces::Forces;
use crate::gpu::groups;
use crate::gpu::pass::Pass;
use crate::gpu::topology::Topology;
use trepan_gpu::Slot::{Storage, StorageMut, Uniform};
use trepan_gpu::{Buffer, Gpu, GpuError};
use trepan_shaders::TLED_MEMBRANE;
use trepan_soft::Body;

/// The pass of a body's membrane.
pub(crate) fn pass(
    gpu: &Gpu,
    body: &Body,
    state: &DeviceState,
    topology: &Topology,
    forces: &Forces,
) -> Result<Pass, GpuError> {
    let count = topology.sheet_corners.len();
    groups(gpu, "membrane", count)?;
    let slots = topology.runs.slots.as_chunks::<4>().0[topology.runs.slots.len() / 4 - count..].iter();
    let corners: Vec<[u32; 4]> = topology.sheet_corners.iter().zip(slots).flat_map(|(at, to)| [*at, *to]).collect();
    let rows = |t: usize| {
        let shape = body.membrane.shape(t, &body.mesh.positions);
        let [x, y] = shape.axes.map(glam::DVec3::as_vec3);
        let [_, a, b] = shape.gradients.map(glam::DVec2::as_vec2);
        let stiffness = (f64::from(body.membrane.shear_n_per_mm) * shape.area_mm2) as f32;
        [x.extend(a.x), y.extend(a.y), b.extend(stiffness).extend(0.0)].map(|row| row.to_array())
    };
    let rows: Vec<[f32; 4]> = (0..count).flat_map(rows).collect();
    let (corners, rows) = (Buffer::from_slice(gpu, "triangles", &corners)?, Buffer::from_slice(gpu, "sheet", &rows)?);
    let bound = [
        (Uniform, (&state.step).into()),
        (Storage, (&corners).into()),
        (Storage, (&rows).into()),
        (Storage, (&state.u).into()),
        (StorageMut, (&forces.slots).into()),
    ];
    Pass::new(gpu, "membrane", TLED_MEMBRANE, &bound, count)
}
