//! The textures that one size of picture needs, bound to the passes.

use crate::RenderError;
use crate::anaglyph::Anaglyph;
use crate::brain::Brain;
use crate::cut::Face;
use crate::enlarge::Enlarge;
use crate::eye::Eye;
use crate::layout::Layout;
use crate::light::Light;
use crate::mri::Mri;
use crate::overlay::Shapes;
use crate::paint::Coat;
use crate::scene::Scene;
use crate::skull::Skull;
use crate::slice::Slices;
use crate::stereo::StereoLook;
use trepan_gpu::{Bindings, Buffer, Format, Gpu, Texture, TextureSpec};

/// What the passes share.
#[derive(Debug)]
pub(crate) struct Passes {
    /// What each eye knows.
    pub scenes: [Buffer<Scene>; 2],
    pub skull: Skull,
    /// The border, and where it is cut open.
    pub brain: Option<(Brain, Face)>,
    pub mri: Mri,
    /// Paint over bone and over the brain.
    pub coats: [Coat; 2],
    pub light: Light,
    pub overlay: Shapes,
    pub enlarge: Enlarge,
    pub anaglyph: Anaglyph,
    pub slices: Slices,
}

/// How the picture is divided.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Division {
    /// Width and height of the picture, pixels.
    pub size: [u32; 2],
    /// Whether slices are wanted.
    pub slices: bool,
    /// Share of the 3-D view's pixels along an edge that are drawn.
    pub detail: f32,
    /// How two eyes share the 3-D view, if two look.
    pub stereo: Option<StereoLook>,
}

/// The textures.
#[derive(Debug)]
pub(crate) struct Canvas {
    pub division: Division,
    pub layout: Layout,
    pub picture: Texture,
    /// One, or the left and the right.
    pub eyes: Vec<Eye>,
    /// Of both eyes' views, where they come into one.
    pub anaglyph: Option<Bindings>,
    pub slices: [Bindings; 3],
    /// Places at rest of the brain's cuts, the slices one below the other.
    pub section: Texture,
}

impl Canvas {
    pub fn new(gpu: &Gpu, division: Division, passes: &Passes) -> Result<Self, RenderError> {
        let [width, height] = division.size;
        if width == 0 || height == 0 {
            return Err(RenderError::Size(width, height));
        }
        let layout = Layout::of(width, height, division.slices);
        let sheet = |label, [width, height]: [u32; 2], format| {
            Texture::new(gpu, &TextureSpec { label, size: [width, height, 1], volume: false, format, drawn_to: true })
        };
        let areas = StereoLook::areas(division.stereo, layout.view);
        let eye = |(number, area)| Eye::new(gpu, number, area, &division, passes);
        let eyes = areas.into_iter().enumerate().map(eye).collect::<Result<Vec<_>, _>>()?;
        let anaglyph = match &eyes[..] {
            [Eye { apart: Some((left, _)), .. }, Eye { apart: Some((right, _)), .. }]
                if division.stereo == Some(StereoLook::Anaglyph) =>
            {
                Some(passes.anaglyph.bind(gpu, &passes.scenes[0], [left, right])?)
            }
            _ => None,
        };
        let column = layout.slices.map_or([1, 1], |s| [s[0][2], height]);
        let section = sheet("section", column, Format::Rgba32Uint)?;
        let (density, mri) = (&passes.skull.density, &passes.mri.texture);
        Ok(Self {
            division,
            layout,
            picture: sheet("picture", division.size, Format::Rgba8Unorm)?,
            anaglyph,
            slices: passes.slices.bind(gpu, &passes.scenes[0], density, mri, &section)?,
            eyes,
            section,
        })
    }
}
