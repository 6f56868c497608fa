//! Averages samples of the 3-D view at rest: smooth edges on the device.
//!
//! # Practice
//! Every pixel is drawn again for each sample, one sample a call: a graphics card has the time. The
//! mean is kept in half precision, since shares of 1/16 would be lost in bytes. A sample is drawn
//! in the picture, and the mean over it.

use super::enlarge::{Enlarge, fill};
use crate::RenderError;
use crate::scene::Scene;
use trepan_gpu::{
    Bindings, Buffer, DepthTest, Format, Gpu, Pipeline, PipelineSpec, Recorder, Slot, Texture, TextureSpec, Topology,
};

/// The render pass.
#[derive(Debug)]
pub(crate) struct Average {
    pipeline: Pipeline,
}

/// The mean of a view of some size.
#[derive(Debug)]
pub(crate) struct Mean {
    size: [u32; 2],
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
            depth: DepthTest::Off,
            blend: true,
            topology: Topology::Triangles,
        };
        Ok(Self { pipeline: Pipeline::new(gpu, &spec)? })
    }

    /// The mean of a view of `size` pixels in the upper left corner of the picture.
    pub fn mean(
        &self,
        gpu: &Gpu,
        scene: &Buffer<Scene>,
        enlarge: &Enlarge,
        size @ [width, height]: [u32; 2],
        picture: &Texture,
    ) -> Result<Mean, RenderError> {
        let (wide, format) = ([width, height, 1], Format::Rgba16Float);
        let spec = TextureSpec { label: "mean", size: wide, volume: false, format, drawn_to: true, stored_to: false };
        let mean = Texture::new(gpu, &spec)?;
        let add = self.pipeline.bind(gpu, &[scene.into(), picture.into()])?;
        let bindings = [add, enlarge.bind(gpu, scene, &mean)?];
        Ok(Mean { size, mean, bindings, taken: 0 })
    }

    /// Adds the sample to the mean, and shows it in an area of the picture.
    pub fn draw(&self, recorder: &mut Recorder, mean: &mut Mean, enlarge: &Enlarge, area: [u32; 4], picture: &Texture) {
        let [width, height] = mean.size;
        fill(recorder, &self.pipeline, &mean.bindings[0], [0, 0, width, height], &mean.mean);
        enlarge.draw(recorder, &mean.bindings[1], area, picture);
        mean.taken += 1;
    }
}
