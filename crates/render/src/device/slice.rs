//! The pass of the three slices.

use super::skull::Skull;
use crate::RenderError;
use crate::frame::SliceLook;
use crate::scene::Scene;
use crate::slice::{LETTERS, Plane};
use glam::Vec4;
use trepan_gpu::{
    Bindings, Buffer, DepthTest, DrawTarget, Format, Gpu, Pipeline, PipelineSpec, Recorder, Resource, Slot, Target,
    Texture, Topology,
};

/// Layout of the shader's `Slice`.
#[repr(C)]
#[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
struct Slice {
    centre: Vec4,
    right: Vec4,
    up: Vec4,
    window: Vec4,
    corner: Vec4,
    colour: Vec4,
}

/// The pass.
#[derive(Debug)]
pub(crate) struct Slices {
    pipeline: Pipeline,
    uniforms: [Buffer<Slice>; 3],
}

impl Slices {
    pub fn new(gpu: &Gpu) -> Result<Self, RenderError> {
        let volumes = [Slot::Texture3, Slot::Texture3, Slot::Sampler];
        let spec = PipelineSpec {
            label: "slice",
            wgsl: trepan_shaders::RENDER_SLICE,
            slots: &[&[Slot::Uniform, Slot::Uniform], &volumes[..], &[Slot::Integer2, Slot::Storage, Slot::Storage]]
                .concat(),
            targets: &[Format::Rgba8Unorm],
            depth: DepthTest::Off,
            blend: false,
            topology: Topology::Triangles,
        };
        let pipeline = Pipeline::new(gpu, &spec)?;
        let uniform = || Buffer::<Slice>::zeroed(gpu, "slice", 1);
        Ok(Self { pipeline, uniforms: [uniform()?, uniform()?, uniform()?] })
    }

    /// Binds the three slices; `section` holds the rest positions on the brain's cuts.
    pub fn bind(
        &self,
        gpu: &Gpu,
        scene: &Buffer<Scene>,
        skull: &Skull,
        mri: &Texture,
        section: &Texture,
    ) -> Result<[Bindings; 3], RenderError> {
        let bind = |n: usize| {
            let uniforms = [scene.into(), (&self.uniforms[n]).into()];
            let volumes = [(&skull.density).into(), mri.into(), Resource::Linear, section.into()];
            self.pipeline.bind(gpu, &[&uniforms[..], &volumes, &skull.drilled()].concat())
        };
        Ok([bind(0)?, bind(1)?, bind(2)?])
    }

    /// Uploads the slices' parameters.
    pub fn follow(&self, gpu: &Gpu, planes: &[Plane; 3], rectangles: &[[u32; 4]; 3], look: &SliceLook) {
        for n in 0..3 {
            let (plane, [x, y, width, height]) = (&planes[n], rectangles[n].map(|v| v as f32));
            let [left, right, top, bottom] = LETTERS[n];
            let slice = Slice {
                centre: plane.centre.extend(plane.half.x),
                right: plane.right.extend(plane.half.y),
                up: plane.up.extend(width),
                window: Vec4::new(look.level_hu - 0.5 * look.width_hu, look.width_hu.max(1.0), look.mri_share, height),
                corner: Vec4::new(x, y, left, right),
                colour: Vec4::new(0.22, 0.24, 0.28, 8.0 * top + bottom),
            };
            self.uniforms[n].write(gpu, 0, &[slice]);
        }
    }

    pub fn draw(
        &self,
        recorder: &mut Recorder,
        bindings: &[Bindings; 3],
        rectangles: &[[u32; 4]; 3],
        picture: &Texture,
    ) {
        let colours = [Target { texture: picture, clear: None }];
        recorder.draw("slice", &DrawTarget { colours: &colours, depth: None }, |d| {
            for n in 0..3 {
                d.viewport(rectangles[n]);
                d.draw(&self.pipeline, &bindings[n], 3);
            }
        });
    }
}
