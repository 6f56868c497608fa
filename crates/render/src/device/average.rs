//! Averages samples of the 3-D view at rest: smooth edges on the device.
//!
//! # Practice
//! Every pixel is drawn again for each sample, one sample a call: a graphics card has the time. The
//! mean is kept in half precision, since shares of 1/16 would be lost in bytes.

use super::enlarge::{Enlarge, fill};
use crate::RenderError;
use crate::scene::Scene;
use trepan_gpu::{
    Bindings, Buffer, Format, Gpu, Pipeline, PipelineSpec, Recorder, Slot, Texture, TextureSpec, Topology,
};

/// The render pass.
#[derive(Debug)]
pub(crate) struct Average {
    pipeline: Pipeline,
}

/// The textures of a view of some size.
#[derive(Debug)]
pub(crate) struct Mean {
    size: [u32; 2],
    /// The newest sample.
    pub sample: Texture,
    mean: Texture,
    /// Adds the sample to the mean; copies the mean into the picture.
    bindings: [Bindings; 2],
    /// Samples in the mean.
    pub taken: usize,
}

impl Average {
    pub fn new(gpu: &Gpu) -> Result<Self, RenderError> {
        let spec = PipelineSpec {
            label: "average",
            wgsl: trepan_shaders::RENDER_AVERAGE,
            slots: &[Slot::Uniform, Slot::Texture2],
            targets: &[Format::Rgba16Float],
            depth: false,
            blend: true,
            topology: Topology::Triangles,
        };
        Ok(Self { pipeline: Pipeline::new(gpu, &spec)? })
    }

    /// Textures for a view of `size` pixels.
    pub fn mean(
        &self,
        gpu: &Gpu,
        scene: &Buffer<Scene>,
        enlarge: &Enlarge,
        size: [u32; 2],
    ) -> Result<Mean, RenderError> {
        let sheet = |label, format| {
            let size = [size[0], size[1], 1];
            Texture::new(gpu, &TextureSpec { label, size, volume: false, format, drawn_to: true })
        };
        let (sample, mean) = (sheet("sample", Format::Rgba8Unorm)?, sheet("mean", Format::Rgba16Float)?);
        let add = self.pipeline.bind(gpu, &[scene.into(), (&sample).into()])?;
        let bindings = [add, enlarge.bind(gpu, scene, &mean)?];
        Ok(Mean { size, sample, mean, bindings, taken: 0 })
    }

    /// Adds the sample to the mean, and shows it in an area of the picture.
    pub fn draw(&self, recorder: &mut Recorder, mean: &mut Mean, enlarge: &Enlarge, area: [u32; 4], picture: &Texture) {
        let [width, height] = mean.size;
        fill(recorder, &self.pipeline, &mean.bindings[0], [0, 0, width, height], &mean.mean);
        enlarge.draw(recorder, &mean.bindings[1], area, picture);
        mean.taken += 1;
    }
}
