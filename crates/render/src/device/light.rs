//! The lighting pass: shades the nearest of bone, brain and tool at each pixel of the 3-D view.
//!
//! # Practice
//! A compute pass, as in `skull.rs`.

use super::skull::{Skull, VOLUMES, tiles};
use crate::RenderError;
use crate::scene::Scene;
use trepan_gpu::{Bindings, Buffer, Format, Gpu, Kernel, Recorder, Resource, Slot, Texture};

/// The compute pass.
#[derive(Debug)]
pub(crate) struct Light {
    kernel: Kernel,
}

/// The textures of the pass.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sheets<'a> {
    pub skull_hit: &'a Texture,
    pub brain_hit: &'a Texture,
    pub brain_rest: &'a Texture,
    pub mri: &'a Texture,
    pub skull: &'a Skull,
    pub bone_coat: &'a Texture,
    pub brain_coat: &'a Texture,
    /// Where the lit view is stored, from the upper left corner.
    pub picture: &'a Texture,
}

impl Light {
    pub fn new(gpu: &Gpu) -> Result<Self, RenderError> {
        let own = [[Slot::Integer2; 3], [Slot::Texture3; 3]].concat();
        let slots = [&[Slot::Uniform], &VOLUMES[..], &own, &[Slot::Store2(Format::Rgba8Unorm)]].concat();
        Ok(Self { kernel: Kernel::new(gpu, "light", trepan_shaders::RENDER_LIGHT, "main", &slots)? })
    }

    pub fn bind(&self, gpu: &Gpu, scene: &Buffer<Scene>, of: &Sheets) -> Result<Bindings, RenderError> {
        let own = [of.skull_hit, of.brain_hit, of.brain_rest, of.mri, of.bone_coat, of.brain_coat, of.picture];
        Ok(self.kernel.bind(gpu, &[&[scene.into()], &of.skull.volumes()[..], &own.map(Resource::from)].concat())?)
    }

    /// Shades a view of `size` pixels.
    pub fn draw(&self, recorder: &mut Recorder, bindings: &Bindings, size: [u32; 2]) {
        recorder.dispatch("light", &self.kernel, bindings, tiles(size));
    }
}
