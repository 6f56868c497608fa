//! What the device keeps between steps: the nodes' state and the numbers of the step, as
//! `step.wgsl` declares them.

use crate::nodes::{anchors_by_place, inverse_masses_and_weights};
use trepan_gpu::{Buffer, Gpu, GpuError};
use trepan_soft::Body;
use trepan_soft::simd::Layout;

/// The uniform of every pass; the fields stand in the order of `step.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub(crate) struct Step {
    pub gravity: [f32; 3],
    pub dt: f32,
    pub keep: f32,
    pub gain: f32,
    pub max_speed: f32,
    pub max_displacement: f32,
    pub springs: u32,
    pub elements: u32,
    pub nodes: u32,
    pub node_groups: u32,
    pub fade_keep: [f32; 4],
    pub fade_gain: [f32; 4],
    pub planes: u32,
    pub opening_mpa: f32,
    pub singles: u32,
    pub touched: u32,
    pub up: [f32; 3],
    pub level_mm: f32,
    pub weight: [f32; 3],
    pub unused_too: u32,
}

/// Place at rest and anchor of a node, as `fluid.wgsl` declares them.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub(crate) struct AnchorAt {
    rest: [f32; 3],
    along: f32,
    normal: [f32; 3],
    across: f32,
    in_fluid: f32,
    open_mm2: f32,
    unused: [f32; 2],
}

impl AnchorAt {
    /// Of every node, by place.
    fn of(body: &Body, layout: &Layout) -> Vec<Self> {
        let anchors = anchors_by_place(body, layout);
        let of = |(place, &node): (usize, &u32)| {
            let anchor = anchors.get(place).copied().unwrap_or_default();
            Self {
                rest: body.mesh.positions[node as usize].to_array(),
                along: anchor.along,
                normal: anchor.normal.to_array(),
                across: anchor.across,
                in_fluid: anchor.in_fluid,
                open_mm2: anchor.open_mm2,
                unused: [0.0; 2],
            }
        };
        layout.node_at.iter().enumerate().map(of).collect()
    }
}

/// Buffers that several passes share.
pub(crate) struct DeviceState {
    pub step: Buffer<Step>,
    /// Displacements by place, mm.
    pub u: Buffer<[f32; 4]>,
    /// Velocities by place, mm/ms.
    pub v: Buffer<[f32; 4]>,
    /// By place: 1/m, 1/g; the share of m that has weight.
    pub nodes: Buffer<[f32; 4]>,
    /// By place, since it was cleared: inverted elements, times limited, times not finite, bits of
    /// the largest growth of ω².
    pub noticed: Buffer<[u32; 4]>,
    /// By place, as `fluid.wgsl` declares it.
    pub anchors: Buffer<AnchorAt>,
    /// 1/m by place on this side.
    pub inverse_mass: Vec<f32>,
    weight: Vec<f32>,
}

impl DeviceState {
    /// Nodes at rest, of masses by mesh node, g, which may be more than what their weight comes
    /// from.
    pub fn new(gpu: &Gpu, body: &Body, layout: &Layout, masses: &[f64]) -> Result<Self, GpuError> {
        let (inverse_mass, weight) = inverse_masses_and_weights(body, layout, masses);
        let nodes: Vec<[f32; 4]> = inverse_mass.iter().zip(&weight).map(|(&m, &w)| [m, w, 0.0, 0.0]).collect();
        Ok(Self {
            step: Buffer::zeroed(gpu, "step", 1)?,
            u: Buffer::zeroed(gpu, "u", nodes.len())?,
            v: Buffer::zeroed(gpu, "v", nodes.len())?,
            noticed: Buffer::zeroed(gpu, "noticed", nodes.len())?,
            nodes: Buffer::from_slice(gpu, "nodes", &nodes)?,
            anchors: Buffer::from_slice(gpu, "anchors", &AnchorAt::of(body, layout))?,
            inverse_mass,
            weight,
        })
    }

    /// 1/m of the node at a place, 1/g, and the share of m that has weight.
    pub fn mass_of(&self, place: u32) -> [f32; 2] {
        [self.inverse_mass[place as usize], self.weight[place as usize]]
    }
}
