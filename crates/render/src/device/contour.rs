//! The outline of the deformed brain in a slice: triangles cut by a plane, drawn as lines.

use crate::RenderError;
use crate::border::Border;
use crate::scene::Scene;
use crate::slice::Plane;
use glam::{Vec2, Vec3, Vec4};
use trepan_gpu::{
    Bindings, Buffer, DepthTest, DrawTarget, Format, Gpu, Pipeline, PipelineSpec, Recorder, Slot, Target, Texture,
    Topology,
};

/// Largest number of lines of one slice; a brain of 100,000 boundary triangles needs about 2,000.
const MOST_LINES: usize = 16_384;

/// The render pass for three slices.
#[derive(Debug)]
pub(crate) struct Contour {
    pipeline: Pipeline,
    ends: [Buffer<Vec2>; 3],
    bindings: [Bindings; 3],
    counts: [u32; 3],
    lines: Vec<Vec2>,
}

impl Contour {
    pub fn new(gpu: &Gpu, scene: &Buffer<Scene>, colour: Vec3) -> Result<Self, RenderError> {
        let spec = PipelineSpec {
            label: "contour",
            wgsl: trepan_shaders::RENDER_CONTOUR,
            slots: &[Slot::Uniform, Slot::Uniform, Slot::Storage],
            targets: &[Format::Rgba8Unorm],
            depth: DepthTest::Off,
            blend: true,
            topology: Topology::Lines,
        };
        let pipeline = Pipeline::new(gpu, &spec)?;
        let ink = Buffer::from_slice(gpu, "ink", &[colour.extend(0.9)])?;
        let ends = || Buffer::<Vec2>::zeroed(gpu, "contour", 2 * MOST_LINES);
        let ends = [ends()?, ends()?, ends()?];
        let bind =
            |ends: &Buffer<Vec2>, ink: &Buffer<Vec4>| pipeline.bind(gpu, &[scene.into(), ink.into(), ends.into()]);
        let bindings = [bind(&ends[0], &ink)?, bind(&ends[1], &ink)?, bind(&ends[2], &ink)?];
        Ok(Self { pipeline, ends, bindings, counts: [0; 3], lines: Vec::with_capacity(2 * MOST_LINES) })
    }

    /// Cuts the brain by three planes; returns the number of lines over the limit.
    pub fn follow(&mut self, gpu: &Gpu, planes: &[Plane; 3], brain: &Border) -> u32 {
        let mut left = 0;
        for (n, plane) in planes.iter().enumerate() {
            self.lines.clear();
            for ends in brain.across(plane.level()).filter_map(|t| plane.cut(t)) {
                if self.lines.len() < 2 * MOST_LINES {
                    self.lines.extend(ends);
                } else {
                    left += 1;
                }
            }
            self.counts[n] = self.lines.len() as u32;
            self.ends[n].write(gpu, 0, &self.lines);
        }
        left
    }

    pub fn draw(&self, recorder: &mut Recorder, rectangles: &[[u32; 4]; 3], picture: &Texture) {
        let colours = [Target { texture: picture, clear: None }];
        recorder.draw("contour", &DrawTarget { colours: &colours, depth: None }, |d| {
            for n in 0..3 {
                d.viewport(rectangles[n]);
                d.draw(&self.pipeline, &self.bindings[n], self.counts[n]);
            }
        });
    }
}
