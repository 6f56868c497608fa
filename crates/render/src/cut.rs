//! A plane that cuts the brain and shows the deformed MRI on the cut.
//!
//! # Theory
//! The plane cuts the deformed tetrahedra in triangles and quadrilaterals with known rest
//! positions, and so MRI values. Within a tetrahedron the deformation is linear, so that
//! interpolation between the corners is exact (Tejada and Ertl 2005 do the same along rays).
//!
//! # Practice
//! World mm. All tetrahedra are tested once per picture; triangles over the limit are counted in
//! the picture's report.

use crate::RenderError;
use crate::brain::Border;
use crate::scene::Scene;
use crate::section;
use glam::{Vec3, Vec4};
use trepan_gpu::{Bindings, Buffer, Draws, Format, Gpu, Pipeline, PipelineSpec, Slot, Topology};

/// A cutting plane; the side that its normal points to is removed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cut {
    /// A point of the plane, world mm.
    pub point: Vec3,
    /// Direction of the removed side, of any length; zero cuts nothing.
    pub normal: Vec3,
    /// Whether bone is cut too; tools and overlay never are.
    pub bone: bool,
}

impl Cut {
    /// Unit normal n and offset w of the plane n·x = w, as the shaders read it; zeroes cut nothing.
    pub(crate) fn plane(cut: Option<&Self>) -> Vec4 {
        let sound = cut.filter(|c| c.point.is_finite()).and_then(|c| Some((c.point, c.normal.try_normalize()?)));
        sound.map_or(Vec4::ZERO, |(point, normal)| normal.extend(normal.dot(point)))
    }
}

/// Signed height of a point over a plane, mm; 0 without a plane.
pub(crate) fn height(plane: Vec4, point: Vec3) -> f32 {
    plane.truncate().dot(point) - plane.w
}

/// Largest number of triangles of a cut; a brain of 100,000 tetrahedra needs about 8,000.
const MOST_TRIANGLES: usize = 16_384;

/// The pass that draws the cut surface of the brain.
#[derive(Debug)]
pub(crate) struct Face {
    pipeline: Pipeline,
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
            depth: true,
            blend: false,
            topology: Topology::Triangles,
        };
        let corners = Buffer::zeroed(gpu, "cut", 3 * MOST_TRIANGLES)?;
        Ok(Self { pipeline: Pipeline::new(gpu, &spec)?, corners, cut: Vec::new() })
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

    /// Draws the cut together with the boundary triangles.
    pub fn draw(&self, draws: &mut Draws, bindings: &Bindings) {
        if !self.cut.is_empty() {
            draws.draw(&self.pipeline, bindings, self.cut.len() as u32);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_plane_without_a_normal_or_a_place_cuts_nothing() {
        let cut = Cut { point: Vec3::new(0.0, 0.0, 5.0), normal: 3.0 * Vec3::Z, bone: false };
        let plane = Cut::plane(Some(&cut));
        assert_eq!([Vec3::ZERO, Vec3::new(9.0, -4.0, 7.0)].map(|p| height(plane, p)), [-5.0, 2.0]);
        for none in [Cut { normal: Vec3::ZERO, ..cut }, Cut { point: Vec3::NAN, ..cut }] {
            assert_eq!(height(Cut::plane(Some(&none)), Vec3::splat(1e9)), 0.0);
        }
    }
}
