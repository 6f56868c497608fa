//! Brings 3-D views that were drawn apart into the picture: with fewer pixels, or both eyes in one.

use crate::RenderError;
use crate::scene::Scene;
use trepan_gpu::{
    Bindings, Buffer, DrawTarget, Format, Gpu, Pipeline, PipelineSpec, Recorder, Resource, Slot, Target, Texture,
    Topology,
};

/// The passes.
#[derive(Debug)]
pub(crate) struct Enlarge {
    one: Pipeline,
    both: Pipeline,
}

impl Enlarge {
    pub fn new(gpu: &Gpu) -> Result<Self, RenderError> {
        let both = PipelineSpec {
            label: "anaglyph",
            wgsl: trepan_shaders::RENDER_ANAGLYPH,
            slots: &[Slot::Uniform, Slot::Texture2, Slot::Texture2, Slot::Sampler],
            targets: &[Format::Rgba8Unorm],
            depth: false,
            blend: false,
            topology: Topology::Triangles,
        };
        let one = PipelineSpec {
            label: "enlarge",
            wgsl: trepan_shaders::RENDER_ENLARGE,
            slots: &[Slot::Uniform, Slot::Texture2, Slot::Sampler],
            ..both
        };
        Ok(Self { one: Pipeline::new(gpu, &one)?, both: Pipeline::new(gpu, &both)? })
    }

    pub fn bind(&self, gpu: &Gpu, scene: &Buffer<Scene>, coarse: &Texture) -> Result<Bindings, RenderError> {
        Ok(self.one.bind(gpu, &[scene.into(), coarse.into(), Resource::Linear])?)
    }

    pub fn bind_both(&self, gpu: &Gpu, scene: &Buffer<Scene>, eyes: [&Texture; 2]) -> Result<Bindings, RenderError> {
        Ok(self.both.bind(gpu, &[scene.into(), eyes[0].into(), eyes[1].into(), Resource::Linear])?)
    }

    /// Draws one eye's view.
    pub fn draw(&self, recorder: &mut Recorder, bindings: &Bindings, view: [u32; 4], picture: &Texture) {
        fill(recorder, &self.one, bindings, view, picture);
    }

    /// Draws both eyes' views.
    pub fn draw_both(&self, recorder: &mut Recorder, bindings: &Bindings, view: [u32; 4], picture: &Texture) {
        fill(recorder, &self.both, bindings, view, picture);
    }
}

fn fill(recorder: &mut Recorder, pipeline: &Pipeline, bindings: &Bindings, view: [u32; 4], picture: &Texture) {
    let colours = [Target { texture: picture, clear: None }];
    recorder.draw(pipeline.label(), &DrawTarget { colours: &colours, depth: None }, |d| {
        d.viewport(view);
        d.draw(pipeline, bindings, 3);
    });
}
