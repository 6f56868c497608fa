//! What both renderers share: limits, counters, hits, the view of an eye.

use crate::camera::View;
use crate::frame::Frame;
use crate::stereo::Stereo;
use glam::Vec3;

/// Default for the most changed bricks processed per picture: 1 MiB of densities.
pub const BRICKS_PER_FRAME: usize = 1024;

/// Colour of the brain's outline in the slices.
pub const OUTLINE: Vec3 = Vec3::new(1.0, 0.45, 0.55);

/// Smallest fraction of the 3-D view's pixels along an edge.
pub(crate) const LEAST_DETAIL: f32 = 0.05;

/// Counters of drawing a picture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DrawReport {
    /// Changed bricks processed.
    pub bricks: u32,
    /// Changed bricks left for the next picture.
    pub bricks_left: u32,
    /// Pixels whose rays through the bone were cast again.
    pub pixels_cast: u32,
    /// Items over the limit: lines of the brain's outline, triangles of its cuts and shapes of the
    /// overlay.
    pub lines_left: u32,
}

/// The view of the left (0) or the right eye (1) in an area of the picture.
pub(crate) fn eye_view(frame: &Frame, [_, _, width, height]: [u32; 4], number: usize) -> View {
    let view = frame.camera.view(width as f32 / height as f32);
    Stereo::views(frame.stereo.as_ref(), view, frame.camera.distance_mm)[number]
}

/// A ray's hit on bone.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Distance from the eye, mm.
    pub distance_mm: f32,
    /// Unit normal, outwards.
    pub normal: Vec3,
}
