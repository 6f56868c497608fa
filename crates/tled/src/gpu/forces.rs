//! The pass of the elements: forces on their nodes, one thread a tetrahedron, one dispatch a law.
//!
//! # Theory
//! The arithmetic of `law.rs`, `element.rs` and `stiffness.rs`. Every corner writes to a slot of
//! its own; slots lie sorted by group and so by node, so the node's pass reads one run in a fixed
//! order and nothing is added by atomics: the same bits in every run.
//!
//! # Practice
//! 80 bytes read in a row and 64 bytes scattered a tetrahedron and step, besides the displacements
//! of four nodes; 144 more read and written for a memory of past stress, 16 more for averaged nodal
//! pressure. What a body does not need is compiled out of its kernels.

use crate::block::omega2_over_stiffness;
use crate::config::Config;
use crate::gpu::device_state::DeviceState;
use crate::gpu::groups;
use crate::gpu::pass::Pass;
use crate::gpu::topology::Topology;
use crate::law::{Constitutive, MooneyRivlin, NeoHookean, Ogden, StVenantKirchhoff, Stiffening};
use crate::relaxation::PRONY_TERMS;
use crate::scaling::Scaling;
use trepan_gpu::Slot::{Storage, StorageMut, Uniform};
use trepan_gpu::{Buffer, Gpu, GpuError};
use trepan_shaders::TLED_FORCES;
use trepan_soft::simd::{Layout, kind};
use trepan_soft::{Body, Law};

/// Elements on the device and the kernels of their forces.
pub(crate) struct Forces {
    /// A pass for each law.
    pub laws: Vec<Pass>,
    /// Gradients, and constants beside them, three rows an element.
    pub rows: Buffer<[f32; 4]>,
    /// Forces by slot, N.
    pub slots: Buffer<[f32; 4]>,
}

impl Forces {
    pub fn new(
        gpu: &Gpu,
        (body, layout, scaling): (&Body, &Layout, &Scaling),
        config: &Config,
        state: &DeviceState,
        topology: &Topology,
    ) -> Result<Self, GpuError> {
        let count = layout.tet_at.len();
        groups(gpu, "forces", count)?;
        let constants: Vec<([f32; 5], f32)> = layout.tet_at.iter().map(|&t| constants(body, scaling, t)).collect();
        let rows = Buffer::from_slice(gpu, "rows", &rows(body, layout, &constants))?;
        let more: Vec<[f32; 4]> = constants.iter().map(|(c, _)| [c[2], c[3], c[4], 0.0]).collect();
        let wants_more = more.iter().any(|c| *c != [0.0; 4]);
        let more = Buffer::from_slice(gpu, "more", if wants_more { &more } else { &[[0.0; 4]] })?;
        let relaxes = !config.relaxation.is_none();
        let memory = Buffer::<f32>::zeroed(gpu, "memory", if relaxes { 6 * PRONY_TERMS * count } else { 1 })?;
        let slots = Buffer::zeroed(gpu, "forces", topology.runs.slots.len())?;
        let (mut laws, mut first) = (Vec::new(), 0u32);
        for tets in layout.tet_at.chunk_by(|&a, &b| kind(body, a) == kind(body, b)) {
            let range = Buffer::from_slice(gpu, "range", &[[first, tets.len() as u32, 0, 0]])?;
            let text = text(body, tets[0], relaxes, config.averaged_pressure);
            let bound = [
                (Uniform, (&state.step).into()),
                (Storage, (&topology.corners).into()),
                (Storage, (&rows).into()),
                (Storage, (&state.u).into()),
                (StorageMut, (&slots).into()),
                (Storage, (&more).into()),
                (StorageMut, (&memory).into()),
                (Storage, (&topology.volume_change).into()),
                (Uniform, (&range).into()),
            ];
            laws.push(Pass::new(gpu, "forces", &text, &bound, tets.len())?);
            first += tets.len() as u32;
        }
        Ok(Self { laws, rows, slots })
    }
}

/// The kernel of a tetrahedron's law, with what the body needs.
fn text(body: &Body, tet: u32, relaxes: bool, averages: bool) -> String {
    let law = TLED_FORCES[usize::from(kind(body, tet))];
    format!("const RELAXES = {relaxes};\nconst AVERAGES = {averages};\n{law}")
}

/// A tetrahedron's constants, and its ω² over stiffness at rest.
fn constants(body: &Body, scaling: &Scaling, tet: u32) -> ([f32; 5], f32) {
    match body.material(tet as usize).law() {
        Law::NeoHookean(_) => constants_of::<NeoHookean, 2>(body, scaling, tet),
        Law::StVenantKirchhoff { .. } => constants_of::<StVenantKirchhoff, 2>(body, scaling, tet),
        Law::MooneyRivlin { .. } => constants_of::<MooneyRivlin, 3>(body, scaling, tet),
        Law::Ogden { .. } => constants_of::<Ogden, 5>(body, scaling, tet),
        Law::Stiffening(_) => constants_of::<Stiffening, 4>(body, scaling, tet),
    }
}

fn constants_of<M: Constitutive<K>, const K: usize>(body: &Body, scaling: &Scaling, tet: u32) -> ([f32; 5], f32) {
    let (shape, material) = (body.shape(tet as usize), body.material(tet as usize));
    let constants = M::constants(&material.law(), shape.volume_mm3);
    let omega2 = omega2_over_stiffness::<M, K>(&shape, material, &constants) / scaling.factor(tet) as f32;
    (std::array::from_fn(|k| constants.get(k).copied().unwrap_or(0.0)), omega2)
}

/// Three rows an element: the gradients of corners 1 to 3, and beside them two constants and ω²
/// over stiffness at rest.
fn rows(body: &Body, layout: &Layout, constants: &[([f32; 5], f32)]) -> Vec<[f32; 4]> {
    let of = |(&t, (constants, omega2)): (&u32, &([f32; 5], f32))| {
        let (shape, beside) = (body.shape(t as usize), [constants[0], constants[1], *omega2]);
        [0, 1, 2].map(|a| shape.gradients[a + 1].as_vec3().extend(beside[a]).to_array())
    };
    layout.tet_at.iter().zip(constants).flat_map(of).collect()
}
