//! The pass of the contact: the tool's spring with the device's own present nodes, one workgroup.

use crate::gpu::device_state::DeviceState;
use trepan_contact::{MAX_NODES, NodalContact};
use trepan_gpu::{Bindings, Buffer, Dispatches, Gpu, GpuError, Kernel, Slot};
use trepan_shaders::TLED_PRESS;

/// The contact on the device.
pub(crate) struct Press {
    kernel: Kernel,
    bindings: Bindings,
    /// Place and bits of the weight of every node that the tool touches.
    touched: Buffer<[u32; 2]>,
    /// Pressure of the newest step, N.
    pub pressure: Buffer<f32>,
    shown: Vec<[u32; 2]>,
}

impl Press {
    pub fn new(gpu: &Gpu, state: &DeviceState) -> Result<Self, GpuError> {
        let wanted = [Slot::Uniform, Slot::Storage, Slot::Storage, Slot::Storage, Slot::StorageMut];
        let kernel = Kernel::new(gpu, "press", TLED_PRESS, "main", &wanted)?;
        let touched = Buffer::zeroed(gpu, "touched", MAX_NODES)?;
        let pressure = Buffer::zeroed(gpu, "pressure", 1)?;
        let bindings = kernel.bind(
            gpu,
            &[(&state.step).into(), (&touched).into(), (&state.u).into(), (&state.v).into(), (&pressure).into()],
        )?;
        Ok(Self { kernel, bindings, touched, pressure, shown: Vec::with_capacity(MAX_NODES) })
    }

    /// Hands the touched nodes over, where they changed; gives how many there are. Nodes that the mesh lacks are left out.
    pub fn touch(&mut self, gpu: &Gpu, state: &mut DeviceState, contact: &NodalContact, place_of: &[u32]) -> u32 {
        let placed = |(n, w): (u32, f32)| Some([*place_of.get(n as usize)?, w.to_bits()]);
        if !contact.nodes().filter_map(placed).eq(self.shown.iter().copied()) {
            self.shown.iter().for_each(|&[place, _]| state.weigh(gpu, place, 0.0));
            self.shown.clear();
            self.shown.extend(contact.nodes().filter_map(placed));
            self.shown.iter().for_each(|&[place, w]| state.weigh(gpu, place, f32::from_bits(w)));
            self.touched.write(gpu, 0, &self.shown);
        }
        self.shown.len() as u32
    }

    /// Adds the pass to a submission.
    pub fn dispatch(&self, to: &mut Dispatches) {
        to.dispatch(&self.kernel, &self.bindings, [1, 1, 1]);
    }
}
