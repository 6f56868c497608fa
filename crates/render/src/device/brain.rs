//! The brain pass: the boundary of the deformed tetrahedra with smooth normals.
//!
//! # Practice
//! Only boundary nodes are uploaded, 32 bytes each per frame. Normals are the area-weighted mean
//! over a node's triangles, computed on the processor.

use crate::border::Border;
use crate::scene::Scene;
use crate::{Cortex, Frame, RenderError};
use glam::{Vec3, Vec4};
use trepan_gpu::{Bindings, Buffer, DepthTest, Draws, Format, Gpu, Pipeline, PipelineSpec, Slot, Topology};
use trepan_mesh::TetMesh;

/// The brain's boundary on the device.
#[derive(Debug)]
pub(crate) struct Brain {
    pub border: Border,
    device: Device,
    pipeline: Pipeline,
    /// What turns its back, and its face, where a closed cortex is cut.
    sides: [Pipeline; 2],
}

#[derive(Debug)]
struct Device {
    places: Buffer<Vec4>,
    normals: Buffer<Vec4>,
    rest: Buffer<Vec4>,
    looks: Buffer<Vec4>,
    corners: Buffer<[u32; 3]>,
}

impl Device {
    /// Buffers for a boundary at rest; one node and one triangle where there is none.
    fn of(gpu: &Gpu, border: &Border) -> Result<Self, RenderError> {
        let (nodes, triangles) = (border.places.len().max(1), border.triangles.len().max(1));
        let device = Self {
            places: Buffer::zeroed(gpu, "brain places", nodes)?,
            normals: Buffer::zeroed(gpu, "brain normals", nodes)?,
            rest: Buffer::zeroed(gpu, "brain at rest", nodes)?,
            looks: Buffer::zeroed(gpu, "brain looks", nodes)?,
            corners: Buffer::zeroed(gpu, "brain corners", triangles)?,
        };
        device.rest.write(gpu, 0, &wide(&border.at_rest));
        device.looks.write(gpu, 0, &border.looks);
        device.corners.write(gpu, 0, &border.triangles);
        Ok(device)
    }
}

impl Brain {
    pub fn new(gpu: &Gpu, mesh: &TetMesh, cortex: Option<&Cortex>) -> Result<Self, RenderError> {
        let border = Border::of(mesh, cortex);
        let device = Device::of(gpu, &border)?;
        let slots = [Slot::Uniform, Slot::Storage, Slot::Storage, Slot::Storage, Slot::Storage, Slot::Storage];
        let spec = PipelineSpec {
            label: "brain",
            wgsl: trepan_shaders::RENDER_BRAIN,
            slots: &slots,
            targets: &[Format::Rgba32Uint, Format::Rgba32Uint],
            depth: DepthTest::Nearest,
            blend: false,
            topology: Topology::Triangles,
        };
        let side = |depth| Pipeline::new(gpu, &PipelineSpec { depth, ..spec });
        let sides = [side(DepthTest::BackDepth)?, side(DepthTest::NearestFront)?];
        Ok(Self { border, device, pipeline: Pipeline::new(gpu, &spec)?, sides })
    }

    /// Updates what is seen of the brain, and the dura over it, from a frame.
    /// Returns whether other triangles are there than before: then the pass is to be bound again.
    pub fn follow(&mut self, gpu: &Gpu, frame: &Frame) -> Result<bool, RenderError> {
        let is_other =
            self.border.leave_out(frame.brain_gone, frame.brain_splits) | self.border.cover(frame.dura.as_ref())?;
        if is_other {
            self.device = Device::of(gpu, &self.border)?;
        }
        self.border.follow(frame.brain_positions, &frame.balls())?;
        self.border.stain(frame.brain_stains);
        let places = self.border.places.iter().zip(&self.border.stains).map(|(place, stain)| place.extend(*stain));
        self.device.places.write(gpu, 0, &places.collect::<Vec<_>>());
        self.device.normals.write(gpu, 0, &wide(&self.border.normals));
        Ok(is_other)
    }

    /// Binds the pass to the frame's uniform.
    pub fn bind(&self, gpu: &Gpu, scene: &Buffer<Scene>) -> Result<Bindings, RenderError> {
        let d = &self.device;
        let vertices = [&d.places, &d.normals, &d.rest, &d.looks].map(Into::into);
        let [places, normals, rest, looks] = vertices;
        Ok(self.pipeline.bind(gpu, &[scene.into(), places, normals, rest, looks, (&d.corners).into()])?)
    }

    /// Draws a closed cortex over its cut: the cut stays where the inside would be seen.
    pub fn draw_over_cut(&self, draws: &mut Draws, bindings: &Bindings) {
        let own = 3 * self.border.own as u32;
        self.sides.iter().for_each(|side| draws.draw(side, bindings, own));
        self.draw(draws, bindings);
    }

    /// Draws the boundary triangles.
    pub fn draw(&self, draws: &mut Draws, bindings: &Bindings) {
        draws.draw(&self.pipeline, bindings, 3 * self.border.triangles.len() as u32);
    }
}

fn wide(vectors: &[Vec3]) -> Vec<Vec4> {
    vectors.iter().map(|v| v.extend(1.0)).collect()
}
