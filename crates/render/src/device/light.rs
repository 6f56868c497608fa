//! The lighting pass: shades the nearest of bone, brain and tool at each pixel of the 3-D view.

use super::skull::{Skull, VOLUMES};
use crate::RenderError;
use crate::scene::Scene;
use trepan_gpu::{
    Bindings, Buffer, DrawTarget, Format, Gpu, Pipeline, PipelineSpec, Recorder, Resource, Slot, Target, Texture,
    Topology,
};

/// The render pass.
#[derive(Debug)]
pub(crate) struct Light {
    pipeline: Pipeline,
}

/// The inputs of the pass.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Inputs<'a> {
    pub skull_hit: &'a Texture,
    pub brain_hit: &'a Texture,
    pub brain_rest: &'a Texture,
    pub mri: &'a Texture,
    pub skull: &'a Skull,
    pub bone_coat: &'a Texture,
    pub brain_coat: &'a Texture,
}

impl Light {
    pub fn new(gpu: &Gpu) -> Result<Self, RenderError> {
        let own = [[Slot::Integer2; 3], [Slot::Texture3; 3]].concat();
        let slots = [&[Slot::Uniform], &VOLUMES[..], &own].concat();
        let spec = PipelineSpec {
            label: "light",
            wgsl: trepan_shaders::RENDER_LIGHT,
            slots: &slots,
            targets: &[Format::Rgba8Unorm],
            depth: false,
            blend: false,
            topology: Topology::Triangles,
        };
        Ok(Self { pipeline: Pipeline::new(gpu, &spec)? })
    }

    pub fn bind(&self, gpu: &Gpu, scene: &Buffer<Scene>, from: &Inputs) -> Result<Bindings, RenderError> {
        let hits = [from.skull_hit, from.brain_hit, from.brain_rest].map(Resource::from);
        let volumes = [from.mri, from.bone_coat, from.brain_coat].map(Resource::from);
        Ok(self.pipeline.bind(gpu, &[&[scene.into()], &from.skull.volumes()[..], &hits, &volumes].concat())?)
    }

    pub fn draw(&self, recorder: &mut Recorder, bindings: &Bindings, view: [u32; 4], picture: &Texture) {
        let colours = [Target { texture: picture, clear: None }];
        recorder.draw("light", &DrawTarget { colours: &colours, depth: None }, |d| {
            d.viewport(view);
            d.draw(&self.pipeline, bindings, 3);
        });
    }
}
