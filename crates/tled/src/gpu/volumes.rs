//! The passes of averaged nodal pressure: every element's change of volume, and its mean around the
//! nodes.
//!
//! # Practice
//! 80 bytes read in a row a tetrahedron and step besides its nodes, 4 written, and 8 read for each
//! of its corners.

use crate::gpu::device_state::DeviceState;
use crate::gpu::forces::Forces;
use crate::gpu::topology::Topology;
use crate::gpu::{LANES, groups};
use crate::layout::Layout;
use crate::node_groups::NodeGroups;
use trepan_gpu::{Bindings, Buffer, Dispatches, Gpu, GpuError, Kernel, Slot};
use trepan_shaders::TLED_VOLUMES;
use trepan_soft::Body;

/// The kernels of averaged pressure.
pub(crate) struct Volumes {
    passes: [(Kernel, Bindings, u32); 2],
}

impl Volumes {
    pub fn new(
        gpu: &Gpu,
        (body, layout, node_groups): (&Body, &Layout, &NodeGroups),
        state: &DeviceState,
        topology: &Topology,
        forces: &Forces,
    ) -> Result<Self, GpuError> {
        let (elements, count) = (layout.tet_at.len(), node_groups.place_of.len());
        groups(gpu, "node_groups", count)?;
        let quarter = |&t: &u32| (0.25 * body.mesh.volume_mm3(t as usize)) as f32;
        let quarters: Vec<f32> = layout.tet_at.iter().map(quarter).collect();
        let quarters = Buffer::from_slice(gpu, "quarters", &quarters)?;
        let swollen = Buffer::<f32>::zeroed(gpu, "swollen", elements)?;
        let starts = Buffer::from_slice(gpu, "group starts", &topology.runs.of_groups)?;
        let owners = Buffer::from_slice(gpu, "owners", &topology.runs.owners)?;
        let inverse = Buffer::from_slice(gpu, "inverse volumes", &node_groups.inverse_volumes(body, layout))?;
        let mut wanted = [Slot::Storage; 6];
        (wanted[0], wanted[5]) = (Slot::Uniform, Slot::StorageMut);
        let volumes = Kernel::new(gpu, "volumes", TLED_VOLUMES[0], "main", &wanted)?;
        let step = &state.step;
        let of_volumes = [
            step.into(),
            (&topology.corners).into(),
            (&forces.rows).into(),
            (&state.u).into(),
            (&quarters).into(),
            (&swollen).into(),
        ];
        let of_volumes = volumes.bind(gpu, &of_volumes)?;
        let means = Kernel::new(gpu, "node_groups", TLED_VOLUMES[1], "main", &wanted)?;
        let of_means = [
            step.into(),
            (&starts).into(),
            (&owners).into(),
            (&swollen).into(),
            (&inverse).into(),
            (&topology.volume_change).into(),
        ];
        let of_means = means.bind(gpu, &of_means)?;
        Ok(Self { passes: [(volumes, of_volumes, elements as u32), (means, of_means, count as u32)] })
    }

    /// Adds the passes to a submission.
    pub fn dispatch(&self, to: &mut Dispatches) {
        for (kernel, bindings, count) in &self.passes {
            to.dispatch(kernel, bindings, [count.div_ceil(LANES), 1, 1]);
        }
    }
}
