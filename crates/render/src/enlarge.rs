//! Enlarges a 3-D view that was drawn with fewer pixels than the picture has for it.

use crate::RenderError;
use crate::scene::Scene;
use trepan_gpu::{
    Bindings, Buffer, DrawTarget, Format, Gpu, Pipeline, PipelineSpec, Recorder, Resource, Slot, Target, Texture,
    Topology,
};

/// The pass.
#[derive(Debug)]
pub(crate) struct Enlarge {
    pipeline: Pipeline,
}

impl Enlarge {
    pub fn new(gpu: &Gpu) -> Result<Self, RenderError> {
        let spec = PipelineSpec {
            label: "enlarge",
            wgsl: trepan_shaders::RENDER_ENLARGE,
            slots: &[Slot::Uniform, Slot::Texture2, Slot::Sampler],
            targets: &[Format::Rgba8Unorm],
            depth: false,
            blend: false,
            topology: Topology::Triangles,
        };
        Ok(Self { pipeline: Pipeline::new(gpu, &spec)? })
    }

    pub fn bind(&self, gpu: &Gpu, scene: &Buffer<Scene>, coarse: &Texture) -> Result<Bindings, RenderError> {
        Ok(self.pipeline.bind(gpu, &[scene.into(), coarse.into(), Resource::Linear])?)
    }

    pub fn draw(&self, recorder: &mut Recorder, bindings: &Bindings, view: [u32; 4], picture: &Texture) {
        let colours = [Target { texture: picture, clear: Some([0.0, 0.0, 0.0, 1.0]) }];
        recorder.draw("enlarge", &DrawTarget { colours: &colours, depth: None }, |d| {
            d.viewport(view);
            d.draw(&self.pipeline, bindings, 3);
        });
    }
}
