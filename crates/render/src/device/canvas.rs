//! The textures for one picture size, bound to the passes.

use super::average::Mean;
use super::eye::EyeTextures;
use super::passes::{Division, Passes};
use crate::RenderError;
use crate::layout::Layout;
use crate::stereo::StereoLook;
use trepan_gpu::{Bindings, Format, Gpu, Texture, TextureSpec};

/// The textures.
#[derive(Debug)]
pub(crate) struct Canvas {
    pub division: Division,
    pub layout: Layout,
    pub picture: Texture,
    /// One eye, or the left and the right.
    pub eyes: Vec<EyeTextures>,
    /// Both eyes' views, for an anaglyph.
    pub anaglyph: Option<Bindings>,
    pub slices: [Bindings; 3],
    /// Samples of the view at rest, once there are any.
    pub mean: Option<Mean>,
    /// Rest positions on the brain's cuts, the slices one below the other.
    pub section: Texture,
}

impl Canvas {
    pub fn new(gpu: &Gpu, division: Division, passes: &Passes) -> Result<Self, RenderError> {
        let [width, height] = division.size;
        if width == 0 || height == 0 {
            return Err(RenderError::Size(width, height));
        }
        let layout = Layout::of(width, height, division.slices);
        let sheet = |label, [width, height]: [u32; 2], format, stored_to| {
            let size = [width, height, 1];
            Texture::new(gpu, &TextureSpec { label, size, volume: false, format, drawn_to: true, stored_to })
        };
        let picture = sheet("picture", division.size, Format::Rgba8Unorm, true)?;
        let areas = StereoLook::areas(division.stereo, layout.view);
        let eye = |(number, area)| EyeTextures::new(gpu, number, area, &division, passes, &picture);
        let eyes = areas.into_iter().enumerate().map(eye).collect::<Result<Vec<_>, _>>()?;
        let anaglyph = match &eyes[..] {
            [EyeTextures { apart: Some((left, _)), .. }, EyeTextures { apart: Some((right, _)), .. }]
                if division.stereo == Some(StereoLook::Anaglyph) =>
            {
                Some(passes.anaglyph.bind(gpu, &passes.scenes[0], [left, right])?)
            }
            _ => None,
        };
        let column = layout.slices.map_or([1, 1], |s| [s[0][2], height]);
        let section = sheet("section", column, Format::Rgba32Uint, false)?;
        Ok(Self {
            division,
            layout,
            picture,
            anaglyph,
            slices: bind_slices(gpu, passes, &section)?,
            eyes,
            section,
            mean: None,
        })
    }

    /// Binds the passes that read bone or paint again, after their buffers or textures changed.
    pub fn rebind(&mut self, gpu: &Gpu, passes: &Passes) -> Result<(), RenderError> {
        self.slices = bind_slices(gpu, passes, &self.section)?;
        self.eyes.iter_mut().try_for_each(|eye| eye.rebind(gpu, passes, &self.picture))
    }
}

fn bind_slices(gpu: &Gpu, passes: &Passes, section: &Texture) -> Result<[Bindings; 3], RenderError> {
    passes.slices.bind(gpu, &passes.scenes[0], &passes.skull, &passes.mri.texture, section)
}
