//! Combines both eyes' views into one picture for red-cyan glasses.

use super::enlarge::fill;
use crate::RenderError;
use crate::scene::Scene;
use trepan_gpu::{
    Bindings, Buffer, DepthTest, Format, Gpu, Pipeline, PipelineSpec, Recorder, Resource, Slot, Texture, Topology,
};

/// The render pass.
#[derive(Debug)]
pub(crate) struct Anaglyph {
    pipeline: Pipeline,
}

impl Anaglyph {
    pub fn new(gpu: &Gpu) -> Result<Self, RenderError> {
        let spec = PipelineSpec {
            label: "anaglyph",
            wgsl: trepan_shaders::RENDER_ANAGLYPH,
            slots: &[Slot::Uniform, Slot::Texture2, Slot::Texture2, Slot::Sampler],
            targets: &[Format::Rgba8Unorm],
            depth: DepthTest::Off,
            blend: false,
            topology: Topology::Triangles,
        };
        Ok(Self { pipeline: Pipeline::new(gpu, &spec)? })
    }

    /// Binds the left and the right eye's views.
    pub fn bind(&self, gpu: &Gpu, scene: &Buffer<Scene>, eyes: [&Texture; 2]) -> Result<Bindings, RenderError> {
        Ok(self.pipeline.bind(gpu, &[scene.into(), eyes[0].into(), eyes[1].into(), Resource::Linear])?)
    }

    pub fn draw(&self, recorder: &mut Recorder, bindings: &Bindings, view: [u32; 4], picture: &Texture) {
        fill(recorder, &self.pipeline, bindings, view, picture);
    }
}
