//! The brain pass: the boundary of the deformed tetrahedra with smooth normals.
//!
//! # Practice
//! Only boundary nodes are uploaded, 32 bytes each per frame. Normals are the area-weighted mean
//! over a node's triangles, computed on the processor.

use crate::border::Border;
use crate::scene::Scene;
use crate::{Leaves, RenderError};
use glam::{Vec3, Vec4};
use trepan_gpu::{Bindings, Buffer, Draws, Format, Gpu, Pipeline, PipelineSpec, Slot, Topology};
use trepan_mesh::TetMesh;

/// The brain's boundary on the device.
#[derive(Debug)]
pub(crate) struct Brain {
    pub border: Border,
    device: Device,
    pipeline: Pipeline,
}

#[derive(Debug)]
struct Device {
    places: Buffer<Vec4>,
    normals: Buffer<Vec4>,
    rest: Buffer<Vec4>,
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
            corners: Buffer::zeroed(gpu, "brain corners", triangles)?,
        };
        let rest: Vec<Vec3> = (0..border.places.len() as u32).map(|n| border.at_rest(n)).collect();
        device.rest.write(gpu, 0, &wide(&rest));
        device.corners.write(gpu, 0, &border.triangles);
        Ok(device)
    }
}

impl Brain {
    pub fn new(gpu: &Gpu, mesh: &TetMesh) -> Result<Self, RenderError> {
        let border = Border::of(mesh);
        let device = Device::of(gpu, &border)?;
        let slots = [Slot::Uniform, Slot::Storage, Slot::Storage, Slot::Storage, Slot::Storage];
        let pipeline = Pipeline::new(
            gpu,
            &PipelineSpec {
                label: "brain",
                wgsl: trepan_shaders::RENDER_BRAIN,
                slots: &slots,
                targets: &[Format::Rgba32Uint, Format::Rgba32Uint],
                depth: true,
                blend: false,
                topology: Topology::Triangles,
            },
        )?;
        Ok(Self { border, device, pipeline })
    }

    /// Updates the boundary from the mesh's nodes, or resets it to rest, and the dura over it.
    /// Returns whether other triangles are there than before: then the pass is to be bound again.
    pub fn follow(
        &mut self,
        gpu: &Gpu,
        positions: Option<&[Vec3]>,
        gone: Option<&[bool]>,
        stains: Option<&[u8]>,
        dura: Option<&Leaves>,
    ) -> Result<bool, RenderError> {
        let is_other = self.border.leave_out(gone) | self.border.cover(dura)?;
        if is_other {
            self.device = Device::of(gpu, &self.border)?;
        }
        self.border.follow(positions)?;
        self.border.stain(stains);
        let places = self.border.places.iter().zip(&self.border.stains).map(|(place, stain)| place.extend(*stain));
        self.device.places.write(gpu, 0, &places.collect::<Vec<_>>());
        self.device.normals.write(gpu, 0, &wide(&self.border.normals));
        Ok(is_other)
    }

    /// Binds the pass to the frame's uniform.
    pub fn bind(&self, gpu: &Gpu, scene: &Buffer<Scene>) -> Result<Bindings, RenderError> {
        let d = &self.device;
        let all = [scene.into(), (&d.places).into(), (&d.normals).into(), (&d.rest).into(), (&d.corners).into()];
        Ok(self.pipeline.bind(gpu, &all)?)
    }

    /// Draws the boundary triangles.
    pub fn draw(&self, draws: &mut Draws, bindings: &Bindings) {
        draws.draw(&self.pipeline, bindings, 3 * self.border.triangles.len() as u32);
    }
}

fn wide(vectors: &[Vec3]) -> Vec<Vec4> {
    vectors.iter().map(|v| v.extend(1.0)).collect()
}
