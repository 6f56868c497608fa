//! The pass of the nodes: forces gathered, contact added, motion by central differences, what is
//! not sane held.

use crate::gpu::device_state::DeviceState;
use crate::gpu::forces::Forces;
use crate::gpu::press::Press;
use crate::gpu::topology::Topology;
use crate::gpu::{LANES, groups};
use trepan_gpu::{Bindings, Dispatches, Gpu, GpuError, Kernel, Slot};
use trepan_shaders::TLED_UPDATE;

/// The kernel that moves nodes.
pub(crate) struct Update {
    kernel: Kernel,
    bindings: Bindings,
    count: u32,
}

impl Update {
    pub fn new(
        gpu: &Gpu,
        state: &DeviceState,
        topology: &Topology,
        forces: &Forces,
        press: &Press,
    ) -> Result<Self, GpuError> {
        groups(gpu, "update", state.u.len())?;
        let mut wanted = [Slot::Storage; 8];
        wanted[0] = Slot::Uniform;
        wanted[5..].fill(Slot::StorageMut);
        let kernel = Kernel::new(gpu, "update", TLED_UPDATE, "main", &wanted)?;
        let bindings = kernel.bind(
            gpu,
            &[
                (&state.step).into(),
                (&topology.starts).into(),
                (&forces.slots).into(),
                (&state.nodes).into(),
                (&press.pushed).into(),
                (&state.u).into(),
                (&state.v).into(),
                (&state.noticed).into(),
            ],
        )?;
        Ok(Self { kernel, bindings, count: state.u.len() as u32 })
    }

    /// Adds the pass to a submission.
    pub fn dispatch(&self, to: &mut Dispatches) {
        to.dispatch(&self.kernel, &self.bindings, [self.count.div_ceil(LANES), 1, 1]);
    }
}
