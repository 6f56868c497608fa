//! The textures that one size of picture needs, bound to the passes.

use crate::RenderError;
use crate::brain::Brain;
use crate::enlarge::Enlarge;
use crate::layout::Layout;
use crate::light::{Inputs, Light};
use crate::mri::Mri;
use crate::scene::Scene;
use crate::skull::Skull;
use crate::slice::Slices;
use trepan_gpu::{Bindings, Buffer, Format, Gpu, Texture, TextureSpec};

/// What the passes of the 3-D view share.
#[derive(Debug)]
pub(crate) struct Passes {
    pub scene: Buffer<Scene>,
    pub skull: Skull,
    pub brain: Option<Brain>,
    pub mri: Mri,
    pub light: Light,
    pub enlarge: Enlarge,
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
}

/// The textures.
#[derive(Debug)]
pub(crate) struct Canvas {
    pub division: Division,
    pub layout: Layout,
    /// Width and height that the 3-D view is drawn with, pixels.
    pub drawn: [u32; 2],
    pub picture: Texture,
    pub skull_hit: Texture,
    pub brain_hit: Texture,
    pub brain_rest: Texture,
    pub depth: Texture,
    /// The 3-D view before it is enlarged, where it is drawn with fewer pixels.
    pub coarse: Option<(Texture, Bindings)>,
    pub skull: Bindings,
    pub light: Bindings,
    pub brain: Option<Bindings>,
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
        let [_, _, w, h] = layout.view;
        let drawn = [w, h].map(|n| ((n as f32 * division.detail).round() as u32).clamp(1, n));
        let sheet = |label, [width, height]: [u32; 2], format| {
            Texture::new(gpu, &TextureSpec { label, size: [width, height, 1], volume: false, format, drawn_to: true })
        };
        let skull_hit = sheet("skull hit", drawn, Format::Rgba32Uint)?;
        let brain_hit = sheet("brain hit", drawn, Format::Rgba32Uint)?;
        let brain_rest = sheet("brain rest", drawn, Format::Rgba32Uint)?;
        let inputs = Inputs {
            skull_hit: &skull_hit,
            brain_hit: &brain_hit,
            brain_rest: &brain_rest,
            mri: &passes.mri.texture,
            skull: &passes.skull,
        };
        let coarse = if drawn == [w, h] {
            None
        } else {
            let texture = sheet("coarse", drawn, Format::Rgba8Unorm)?;
            let bindings = passes.enlarge.bind(gpu, &passes.scene, &texture)?;
            Some((texture, bindings))
        };
        let column = layout.slices.map_or([1, 1], |s| [s[0][2], height]);
        let section = sheet("section", column, Format::Rgba32Uint)?;
        let (density, mri) = (&passes.skull.density, &passes.mri.texture);
        Ok(Self {
            division,
            layout,
            drawn,
            picture: sheet("picture", division.size, Format::Rgba8Unorm)?,
            depth: sheet("depth", drawn, Format::Depth32Float)?,
            coarse,
            skull: passes.skull.bind(gpu, &passes.scene)?,
            light: passes.light.bind(gpu, &passes.scene, &inputs)?,
            brain: passes.brain.as_ref().map(|b| b.bind(gpu, &passes.scene)).transpose()?,
            slices: passes.slices.bind(gpu, &passes.scene, density, mri, &section)?,
            section,
            skull_hit,
            brain_hit,
            brain_rest,
        })
    }
}
