//! A compute pass: a kernel with what it is bound to, and how many workgroups run it.

use crate::gpu::LANES;
use trepan_gpu::{Bindings, Dispatches, Gpu, GpuError, Kernel, Resource, Slot};

/// A pass over a fixed number of threads.
pub(crate) struct Pass {
    kernel: Kernel,
    bindings: Bindings,
    workgroups: u32,
}

impl Pass {
    /// Compiles `main` of a shader and binds its slots in their order.
    pub fn new(
        gpu: &Gpu,
        label: &'static str,
        wgsl: &str,
        bound: &[(Slot, Resource)],
        threads: usize,
    ) -> Result<Self, GpuError> {
        let (slots, resources): (Vec<Slot>, Vec<Resource>) = bound.iter().copied().unzip();
        let kernel = Kernel::new(gpu, label, wgsl, "main", &slots)?;
        let bindings = kernel.bind(gpu, &resources)?;
        Ok(Self { kernel, bindings, workgroups: (threads as u32).div_ceil(LANES) })
    }

    /// Adds the pass to a submission.
    pub fn dispatch(&self, to: &mut Dispatches) {
        to.dispatch(&self.kernel, &self.bindings, [self.workgroups, 1, 1]);
    }
}
