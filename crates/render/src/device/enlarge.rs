//! Copies a separately drawn 3-D view into the picture: with fewer pixels, or for one eye of two.

use crate::RenderError;
use crate::scene::Scene;
use trepan_gpu::{
    Bindings, Buffer, DepthTest, DrawTarget, Format, Gpu, Pipeline, PipelineSpec, Recorder, Resource, Slot, Target,
    Texture, Topology,
};

/// The render pass.
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
            depth: DepthTest::Off,
            blend: false,
            topology: Topology::Triangles,
        };
        Ok(Self { pipeline: Pipeline::new(gpu, &spec)? })
    }

    pub fn bind(&self, gpu: &Gpu, scene: &Buffer<Scene>, coarse: &Texture) -> Result<Bindings, RenderError> {
        Ok(self.pipeline.bind(gpu, &[scene.into(), coarse.into(), Resource::Linear])?)
    }

    pub fn draw(&self, recorder: &mut Recorder, bindings: &Bindings, view: [u32; 4], picture: &Texture) {
        fill(recorder, &self.pipeline, bindings, view, picture);
    }
}

/// Runs a pass over every pixel of a rectangle.
pub(crate) fn fill(
    recorder: &mut Recorder,
    pipeline: &Pipeline,
    bindings: &Bindings,
    view: [u32; 4],
    picture: &Texture,
) {
    let colours = [Target { texture: picture, clear: None }];
    recorder.draw(pipeline.label(), &DrawTarget { colours: &colours, depth: None }, |d| {
        d.viewport(view);
        d.draw(pipeline, bindings, 3);
    });
}
