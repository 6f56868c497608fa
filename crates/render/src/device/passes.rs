//! The passes, and the division of the picture that they draw.

use super::anaglyph::Anaglyph;
use super::average::Average;
use super::brain::Brain;
use super::cut::Face;
use super::enlarge::Enlarge;
use super::light::Light;
use super::overlay::Shapes;
use super::paint::Coat;
use super::skull::Skull;
use super::slice::Slices;
use crate::mri::Mri;
use crate::scene::Scene;
use crate::stereo::StereoLook;
use trepan_gpu::Buffer;

/// Resources shared by the passes.
#[derive(Debug)]
pub(crate) struct Passes {
    /// Scene uniform of each eye.
    pub scenes: [Buffer<Scene>; 2],
    pub skull: Skull,
    /// The boundary surface and the cut surface.
    pub brain: Option<(Brain, Face)>,
    pub mri: Mri,
    /// Paint on bone and on the brain.
    pub coats: [Coat; 2],
    pub light: Light,
    pub overlay: Shapes,
    pub enlarge: Enlarge,
    pub anaglyph: Anaglyph,
    pub average: Average,
    pub slices: Slices,
}

/// Division of the picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Division {
    /// Width and height of the picture, pixels.
    pub size: [u32; 2],
    /// Whether slices are shown.
    pub slices: bool,
    /// Fraction of the 3-D view's pixels along an edge that are drawn.
    pub detail: f32,
    /// Layout of two eyes in the 3-D view, if stereo.
    pub stereo: Option<StereoLook>,
}
