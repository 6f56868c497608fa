//! The pass of the elements: forces on their nodes, one thread a tetrahedron.
//!
//! # Theory
//! The arithmetic of `law.rs`, `element.rs` and `stiffness.rs` for a neo-Hookean solid. Every corner writes to a slot of its own; slots lie sorted by
//! node, so the node's pass reads one run in a fixed order and nothing is added by atomics: the same bits in every run.
//!
//! # Practice
//! 80 bytes read in a row and 64 bytes scattered a tetrahedron and step, besides the displacements of four nodes.

use crate::block::omega2_over_stiffness;
use crate::gpu::device_state::DeviceState;
use crate::gpu::{LANES, groups};
use crate::law::{Constitutive, NeoHookean};
use crate::layout::Layout;
use trepan_gpu::{Bindings, Buffer, Dispatches, Gpu, GpuError, Kernel, Slot};
use trepan_shaders::TLED_FORCES;
use trepan_soft::Body;

/// Elements on the device and the kernel of their forces.
pub(crate) struct Forces {
    kernel: Kernel,
    bindings: Bindings,
    count: u32,
    /// Where a node's run of slots begins, one more than nodes.
    pub starts: Buffer<u32>,
    /// Forces by slot, N.
    pub slots: Buffer<[f32; 4]>,
}

impl Forces {
    pub fn new(gpu: &Gpu, body: &Body, layout: &Layout, state: &DeviceState) -> Result<Self, GpuError> {
        let count = layout.tet_at.len();
        groups(gpu, "forces", count)?;
        let corners = corners(body, layout);
        let (starts, slots_of) = runs(&corners, layout.node_at.len());
        let corners = Buffer::from_slice(gpu, "corners", &corners)?;
        let slots_of = Buffer::from_slice(gpu, "slots", &slots_of)?;
        let rows = Buffer::from_slice(gpu, "rows", &rows(body, layout))?;
        let slots = Buffer::zeroed(gpu, "forces", 4 * count)?;
        let wanted = [Slot::Uniform, Slot::Storage, Slot::Storage, Slot::Storage, Slot::Storage, Slot::StorageMut];
        let kernel = Kernel::new(gpu, "forces", TLED_FORCES, "main", &wanted)?;
        let bindings = kernel.bind(
            gpu,
            &[
                (&state.step).into(),
                (&corners).into(),
                (&slots_of).into(),
                (&rows).into(),
                (&state.u).into(),
                (&slots).into(),
            ],
        )?;
        let starts = Buffer::from_slice(gpu, "starts", &starts)?;
        Ok(Self { kernel, bindings, count: count as u32, starts, slots })
    }

    /// Adds the pass to a submission.
    pub fn dispatch(&self, to: &mut Dispatches) {
        to.dispatch(&self.kernel, &self.bindings, [self.count.div_ceil(LANES), 1, 1]);
    }
}

/// Places of the corners, elements in the solver's order.
fn corners(body: &Body, layout: &Layout) -> Vec<[u32; 4]> {
    layout.tet_at.iter().map(|&t| body.mesh.tets[t as usize].map(|n| layout.place_of[n as usize])).collect()
}

/// Where the run of each place begins, and the slot of every corner.
fn runs(corners: &[[u32; 4]], places: usize) -> (Vec<u32>, Vec<[u32; 4]>) {
    let mut starts = vec![0u32; places + 1];
    corners.iter().flatten().for_each(|&place| starts[place as usize + 1] += 1);
    (1..starts.len()).for_each(|i| starts[i] += starts[i - 1]);
    let mut next = starts.clone();
    let mut take = |place: u32| {
        next[place as usize] += 1;
        next[place as usize] - 1
    };
    let slots = corners.iter().map(|tet| tet.map(&mut take)).collect();
    (starts, slots)
}

/// Three rows an element: the gradients of corners 1 to 3, and beside them μ V, κ V and ω² over stiffness at rest.
fn rows(body: &Body, layout: &Layout) -> Vec<[f32; 4]> {
    let of = |&t: &u32| {
        let shape = body.shape(t as usize);
        let material = body.material(t as usize);
        let constants = NeoHookean::constants(&material.law(), shape.volume_mm3);
        let omega2 = omega2_over_stiffness::<NeoHookean, 2>(&shape, material, &constants);
        let beside = [constants[0], constants[1], omega2];
        [0, 1, 2].map(|a| shape.gradients[a + 1].as_vec3().extend(beside[a]).to_array())
    };
    layout.tet_at.iter().flat_map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use trepan_soft::boxes;

    #[test]
    fn every_corner_owns_one_slot_in_the_run_of_its_node() {
        let mesh = boxes::split_box([3, 2, 2], trepan_geometry::Vec3::splat(9.0));
        let body = Body::uniform(mesh, vec![], trepan_soft::Material::BRAIN);
        let layout = Layout::of(&body);
        let corners = corners(&body, &layout);
        let (starts, slots) = runs(&corners, layout.node_at.len());
        let mut taken = vec![false; 4 * corners.len()];
        for (&place, &slot) in corners.iter().flatten().zip(slots.iter().flatten()) {
            assert!((starts[place as usize]..starts[place as usize + 1]).contains(&slot));
            assert!(!std::mem::replace(&mut taken[slot as usize], true));
        }
        assert!(taken.iter().all(|t| *t));
    }
}
