//! The pass of the nodes: forces gathered, contact added, motion by central differences, what is
//! not sane held.

use crate::gpu::device_state::DeviceState;
use crate::gpu::forces::Forces;
use crate::gpu::groups;
use crate::gpu::pass::Pass;
use crate::gpu::press::Press;
use crate::gpu::topology::Topology;
use trepan_gpu::Slot::{Storage, StorageMut, Uniform};
use trepan_gpu::{Gpu, GpuError};
use trepan_shaders::TLED_UPDATE;

/// The pass that moves nodes.
pub(crate) fn pass(
    gpu: &Gpu,
    state: &DeviceState,
    topology: &Topology,
    forces: &Forces,
    press: &Press,
) -> Result<Pass, GpuError> {
    groups(gpu, "update", state.u.len())?;
    let bound = [
        (Uniform, (&state.step).into()),
        (Storage, (&topology.starts).into()),
        (Storage, (&forces.slots).into()),
        (Storage, (&state.nodes).into()),
        (Storage, (&press.pushed).into()),
        (StorageMut, (&state.u).into()),
        (StorageMut, (&state.v).into()),
        (StorageMut, (&state.noticed).into()),
        (Storage, (&state.anchors).into()),
    ];
    Pass::new(gpu, "update", TLED_UPDATE, &bound, state.u.len())
}
