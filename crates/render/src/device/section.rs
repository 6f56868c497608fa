//! The pass that cuts the deformed brain by the slices.

use crate::RenderError;
use crate::border::Border;
use crate::scene::Scene;
use crate::section::triangles;
use crate::slice::Plane;
use glam::Vec4;
use trepan_gpu::{
    Bindings, Buffer, DepthTest, DrawTarget, Format, Gpu, Pipeline, PipelineSpec, Recorder, Slot, Target, Texture,
    Topology,
};

/// Largest number of triangles of one slice; a brain of 100,000 tetrahedra needs about 8,000.
const MOST_TRIANGLES: usize = 16_384;

/// The render pass for three slices.
#[derive(Debug)]
pub(crate) struct Section {
    pipeline: Pipeline,
    corners: [Buffer<[Vec4; 2]>; 3],
    bindings: [Bindings; 3],
    counts: [u32; 3],
    cut: Vec<[Vec4; 2]>,
}

impl Section {
    pub fn new(gpu: &Gpu, scene: &Buffer<Scene>) -> Result<Self, RenderError> {
        let spec = PipelineSpec {
            label: "section",
            wgsl: trepan_shaders::RENDER_SECTION,
            slots: &[Slot::Uniform, Slot::Storage],
            targets: &[Format::Rgba32Uint],
            depth: DepthTest::Off,
            blend: false,
            topology: Topology::Triangles,
        };
        let pipeline = Pipeline::new(gpu, &spec)?;
        let corners = || Buffer::<[Vec4; 2]>::zeroed(gpu, "section", 3 * MOST_TRIANGLES);
        let corners = [corners()?, corners()?, corners()?];
        let bind = |corners: &Buffer<[Vec4; 2]>| pipeline.bind(gpu, &[scene.into(), corners.into()]);
        let bindings = [bind(&corners[0])?, bind(&corners[1])?, bind(&corners[2])?];
        Ok(Self { pipeline, corners, bindings, counts: [0; 3], cut: Vec::with_capacity(3 * MOST_TRIANGLES) })
    }

    /// Cuts the brain by three planes; returns the number of triangles over the limit.
    pub fn follow(&mut self, gpu: &Gpu, planes: &[Plane; 3], brain: &Border) -> u32 {
        let mut left = 0;
        for (n, plane) in planes.iter().enumerate() {
            self.cut.clear();
            for triangle in triangles(plane.level(), brain) {
                if self.cut.len() < 3 * MOST_TRIANGLES {
                    self.cut.extend(triangle.map(|c| [plane.at(c.place).extend(0.0).extend(1.0), c.rest.extend(1.0)]));
                } else {
                    left += 1;
                }
            }
            self.counts[n] = self.cut.len() as u32;
            self.corners[n].write(gpu, 0, &self.cut);
        }
        left
    }

    /// Draws the cuts into `places`, the slices one below the other.
    pub fn draw(&self, recorder: &mut Recorder, rectangles: &[[u32; 4]; 3], places: &Texture) {
        let colours = [Target { texture: places, clear: Some([0.0; 4]) }];
        recorder.draw("section", &DrawTarget { colours: &colours, depth: None }, |d| {
            for (n, [_, y, width, height]) in rectangles.iter().enumerate() {
                d.viewport([0, *y, *width, *height]);
                d.draw(&self.pipeline, &self.bindings[n], self.counts[n]);
            }
        });
    }
}
