//! The pass that draws the MRI on the cut surface of the brain.

use crate::RenderError;
use crate::border::Border;
use crate::scene::Scene;
use crate::section;
use glam::Vec4;
use trepan_gpu::{Bindings, Buffer, DepthTest, Draws, Format, Gpu, Pipeline, PipelineSpec, Slot, Topology};

/// Largest number of triangles of a cut; a brain of 100,000 tetrahedra needs about 8,000.
const MOST_TRIANGLES: usize = 16_384;

/// The pass that draws the cut surface of the brain.
#[derive(Debug)]
pub(crate) struct Face {
    pipeline: Pipeline,
    /// The same below whatever is drawn later.
    below: Pipeline,
    corners: Buffer<[Vec4; 2]>,
    cut: Vec<[Vec4; 2]>,
}

impl Face {
    pub fn new(gpu: &Gpu) -> Result<Self, RenderError> {
        let spec = PipelineSpec {
            label: "cut",
            wgsl: trepan_shaders::RENDER_CUT,
            slots: &[Slot::Uniform, Slot::Storage],
            targets: &[Format::Rgba32Uint, Format::Rgba32Uint],
            depth: DepthTest::Nearest,
            blend: false,
            topology: Topology::Triangles,
        };
        let corners = Buffer::zeroed(gpu, "cut", 3 * MOST_TRIANGLES)?;
        let below = Pipeline::new(gpu, &PipelineSpec { depth: DepthTest::Ignored, ..spec })?;
        Ok(Self { pipeline: Pipeline::new(gpu, &spec)?, below, corners, cut: Vec::new() })
    }

    pub fn bind(&self, gpu: &Gpu, scene: &Buffer<Scene>) -> Result<Bindings, RenderError> {
        Ok(self.pipeline.bind(gpu, &[scene.into(), (&self.corners).into()])?)
    }

    /// Cuts the brain; returns the number of triangles over the limit.
    pub fn follow(&mut self, gpu: &Gpu, plane: Vec4, brain: &Border) -> u32 {
        self.cut.clear();
        if plane == Vec4::ZERO {
            return 0;
        }
        let mut left = 0;
        for triangle in section::triangles(plane, brain) {
            if self.cut.len() < 3 * MOST_TRIANGLES {
                self.cut.extend(triangle.map(|corner| [corner.place.extend(1.0), corner.rest.extend(1.0)]));
            } else {
                left += 1;
            }
        }
        self.corners.write(gpu, 0, &self.cut);
        left
    }

    /// Whether nothing is cut.
    pub fn is_empty(&self) -> bool {
        self.cut.is_empty()
    }

    /// Draws the cut below all that is drawn later.
    pub fn draw_below(&self, draws: &mut Draws, bindings: &Bindings) {
        draws.draw(&self.below, bindings, self.cut.len() as u32);
    }

    /// Draws the cut together with the boundary triangles.
    pub fn draw(&self, draws: &mut Draws, bindings: &Bindings) {
        if !self.cut.is_empty() {
            draws.draw(&self.pipeline, bindings, self.cut.len() as u32);
        }
    }
}
