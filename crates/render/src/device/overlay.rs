//! The overlay's pass.

use crate::RenderError;
use crate::overlay::{Item, MOST_ITEMS, Overlay, items};
use crate::scene::Scene;
use glam::Vec3;
use trepan_gpu::{
    Bindings, Buffer, DepthTest, DrawTarget, Format, Gpu, Pipeline, PipelineSpec, Recorder, Slot, Target, Texture,
    Topology,
};

/// The render pass.
#[derive(Debug)]
pub(crate) struct Shapes {
    pipeline: Pipeline,
    items: Buffer<Item>,
    count: u32,
}

impl Shapes {
    pub fn new(gpu: &Gpu) -> Result<Self, RenderError> {
        let spec = PipelineSpec {
            label: "overlay",
            wgsl: trepan_shaders::RENDER_OVERLAY,
            slots: &[Slot::Uniform, Slot::Storage, Slot::Integer2, Slot::Integer2],
            targets: &[Format::Rgba8Unorm],
            depth: DepthTest::Off,
            blend: true,
            topology: Topology::Triangles,
        };
        let items = Buffer::zeroed(gpu, "overlay", MOST_ITEMS)?;
        Ok(Self { pipeline: Pipeline::new(gpu, &spec)?, items, count: 0 })
    }

    pub fn bind(
        &self,
        gpu: &Gpu,
        scene: &Buffer<Scene>,
        skull_hit: &Texture,
        brain_hit: &Texture,
    ) -> Result<Bindings, RenderError> {
        Ok(self.pipeline.bind(gpu, &[scene.into(), (&self.items).into(), skull_hit.into(), brain_hit.into()])?)
    }

    /// Uploads the shapes of a frame; returns the number over the limit.
    pub fn follow(&mut self, gpu: &Gpu, overlay: &Overlay, eye: Vec3) -> u32 {
        let (items, left) = items(overlay, eye);
        self.items.write(gpu, 0, &items);
        self.count = items.len() as u32;
        left
    }

    pub fn draw(&self, recorder: &mut Recorder, bindings: &Bindings, view: [u32; 4], picture: &Texture) {
        if self.count > 0 {
            let colours = [Target { texture: picture, clear: None }];
            recorder.draw("overlay", &DrawTarget { colours: &colours, depth: None }, |d| {
                d.viewport(view);
                d.draw(&self.pipeline, bindings, 6 * self.count);
            });
        }
    }
}
