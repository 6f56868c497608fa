//! The passes of averaged nodal pressure: every element's change of volume, and its mean around the
//! nodes.
//!
//! # Practice
//! 80 bytes read in a row a tetrahedron and step besides its nodes, 4 written, and 8 read for each
//! of its corners.

use crate::gpu::device_state::DeviceState;
use crate::gpu::forces::Forces;
use crate::gpu::groups;
use crate::gpu::pass::Pass;
use crate::gpu::topology::{Topology, owners};
use crate::node_groups::NodeGroups;
use trepan_gpu::Slot::{Storage, StorageMut, Uniform};
use trepan_gpu::{Buffer, Gpu, GpuError};
use trepan_shaders::TLED_VOLUMES;
use trepan_soft::Body;
use trepan_soft::simd::Layout;

/// The passes of averaged pressure, in their order.
pub(crate) fn passes(
    gpu: &Gpu,
    (body, layout, node_groups): (&Body, &Layout, &NodeGroups),
    state: &DeviceState,
    topology: &Topology,
    forces: &Forces,
) -> Result<[Pass; 2], GpuError> {
    let (elements, count) = (layout.tet_at.len(), node_groups.place_of.len());
    groups(gpu, "node_groups", count)?;
    let quarter = |&t: &u32| (0.25 * body.mesh.volume_mm3(t as usize)) as f32;
    let quarters: Vec<f32> = layout.tet_at.iter().map(quarter).collect();
    let quarters = Buffer::from_slice(gpu, "quarters", &quarters)?;
    let swollen = Buffer::<f32>::zeroed(gpu, "swollen", elements + topology.sheet_corners.len())?;
    let starts = Buffer::from_slice(gpu, "group starts", &topology.runs.of_groups)?;
    let owners = Buffer::from_slice(gpu, "owners", &owners(&topology.runs))?;
    let inverse = Buffer::from_slice(gpu, "inverse volumes", &node_groups.inverse_volumes(body, layout))?;
    let of_volumes = [
        (Uniform, (&state.step).into()),
        (Storage, (&topology.corners).into()),
        (Storage, (&forces.rows).into()),
        (Storage, (&state.u).into()),
        (Storage, (&quarters).into()),
        (StorageMut, (&swollen).into()),
    ];
    let of_means = [
        (Uniform, (&state.step).into()),
        (Storage, (&starts).into()),
        (Storage, (&owners).into()),
        (Storage, (&swollen).into()),
        (Storage, (&inverse).into()),
        (StorageMut, (&topology.volume_change).into()),
    ];
    let volumes = Pass::new(gpu, "volumes", TLED_VOLUMES[0], &of_volumes, elements)?;
    Ok([volumes, Pass::new(gpu, "node_groups", TLED_VOLUMES[1], &of_means, count)?])
}
