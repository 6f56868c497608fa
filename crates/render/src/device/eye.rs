//! The view of one eye: hits kept between pictures, bound to the passes.

use super::light::Sheets;
use super::passes::{Division, Passes};
use crate::RenderError;
use crate::bricks::NOTHING;
use crate::camera::View;
use crate::frame::Frame;
use crate::recast::Recast;
use crate::scene::Scene;
use crate::stereo::StereoLook;
use trepan_gpu::{Bindings, Buffer, Depth, DrawTarget, Format, Gpu, Recorder, Target, Texture, TextureSpec};

/// The textures of an eye.
#[derive(Debug)]
pub(crate) struct EyeTextures {
    /// Index of its scene uniform.
    number: usize,
    /// Rectangle of its view in the picture.
    pub area: [u32; 4],
    /// Width and height at which it is drawn, pixels.
    pub drawn: [u32; 2],
    pub skull_hit: Texture,
    pub recast: Recast,
    /// Rectangle of pixels to cast.
    part: Buffer<[u32; 4]>,
    brain_hit: Texture,
    brain_rest: Texture,
    depth: Texture,
    /// The separate view before it is copied into the picture, if any.
    pub apart: Option<(Texture, Bindings)>,
    skull: Bindings,
    light: Bindings,
    overlay: Bindings,
    /// Bindings of the boundary and its cut.
    brain: Option<[Bindings; 2]>,
}

impl EyeTextures {
    /// A view drawn with `drawn` pixels, directly into the picture or separately.
    pub fn new(
        gpu: &Gpu,
        number: usize,
        area: [u32; 4],
        division: &Division,
        passes: &Passes,
        picture: &Texture,
    ) -> Result<Self, RenderError> {
        let [x, y, width, height] = area;
        let drawn = [width, height].map(|n| ((n as f32 * division.detail).round() as u32).clamp(1, n));
        let whole = [x, y] == [0, 0] && drawn == [width, height] && division.stereo != Some(StereoLook::Anaglyph);
        let sheet = |label, format, stored_to| {
            let size = [drawn[0], drawn[1], 1];
            Texture::new(gpu, &TextureSpec { label, size, volume: false, format, drawn_to: true, stored_to })
        };
        let scene = &passes.scenes[number];
        let skull_hit = sheet("skull hit", Format::Rgba32Uint, true)?;
        let brain_hit = sheet("brain hit", Format::Rgba32Uint, false)?;
        let brain_rest = sheet("brain rest", Format::Rgba32Uint, false)?;
        let separate = |texture: Texture| -> Result<_, RenderError> {
            let bindings = passes.enlarge.bind(gpu, scene, &texture)?;
            Ok((texture, bindings))
        };
        let apart = (!whole).then(|| separate(sheet("apart", Format::Rgba8Unorm, true)?)).transpose()?;
        let brain = bind_brain(gpu, passes, scene)?;
        let part = Buffer::zeroed(gpu, "part", 1)?;
        let lit = apart.as_ref().map_or(picture, |(texture, _)| texture);
        let light = passes.light.bind(gpu, scene, &sheets([&skull_hit, &brain_hit, &brain_rest, lit], passes))?;
        Ok(Self {
            number,
            area,
            drawn,
            recast: Recast::default(),
            depth: sheet("depth", Format::Depth32Float, false)?,
            apart,
            skull: passes.skull.bind(gpu, scene, &part, &skull_hit)?,
            light,
            part,
            overlay: passes.overlay.bind(gpu, scene, &skull_hit, &brain_hit)?,
            brain,
            skull_hit,
            brain_hit,
            brain_rest,
        })
    }

    /// Rebinds bone, brain and lighting, after a paint's texture or their buffers changed.
    pub fn rebind(&mut self, gpu: &Gpu, passes: &Passes, picture: &Texture) -> Result<(), RenderError> {
        let scene = &passes.scenes[self.number];
        self.skull = passes.skull.bind(gpu, scene, &self.part, &self.skull_hit)?;
        self.brain = bind_brain(gpu, passes, scene)?;
        let sheets = sheets([&self.skull_hit, &self.brain_hit, &self.brain_rest, self.lit(picture)], passes);
        self.light = passes.light.bind(gpu, scene, &sheets)?;
        Ok(())
    }

    /// Draws bone, brain, tools and overlay; returns the number of pixels cast again.
    pub fn draw(
        &mut self,
        recorder: &mut Recorder,
        passes: &Passes,
        frame: &Frame,
        seen: &Scene,
        view: &View,
        picture: &Texture,
    ) -> u32 {
        self.draw_brain(recorder, passes, frame.show_brain);
        let pixels_cast = self.cast(recorder, passes, frame.show_bone, seen, view);
        let [w, h] = self.drawn;
        passes.light.draw(recorder, &self.light, self.drawn);
        passes.overlay.draw(recorder, &self.overlay, [0, 0, w, h], self.lit(picture));
        pixels_cast
    }

    /// The texture in whose upper left corner the view is lit.
    fn lit<'a>(&'a self, picture: &'a Texture) -> &'a Texture {
        self.apart.as_ref().map_or(picture, |(texture, _)| texture)
    }

    fn draw_brain(&self, recorder: &mut Recorder, passes: &Passes, shown: bool) {
        let (Some((brain, face)), Some([border, cut]), true) = (&passes.brain, &self.brain, shown) else {
            return clear(recorder, &self.brain_hit, 0.0);
        };
        let colours = [&self.brain_hit, &self.brain_rest].map(|texture| Target { texture, clear: Some([0.0; 4]) });
        let target = DrawTarget { colours: &colours, depth: Some(Depth { texture: &self.depth, clear: Some(1.0) }) };
        recorder.draw("brain", &target, |draws| {
            if brain.border.is_closed() && !face.is_empty() {
                face.draw_below(draws, cut);
                brain.draw_over_cut(draws, border);
            } else {
                brain.draw(draws, border);
                face.draw(draws, cut);
            }
        });
    }

    fn cast(&mut self, recorder: &mut Recorder, passes: &Passes, shown: bool, seen: &Scene, view: &View) -> u32 {
        if !shown || !passes.skull.is_some() {
            self.recast.forget();
            clear(recorder, &self.skull_hit, f64::from(NOTHING.to_bits()));
            return 0;
        }
        let Some(part) = self.recast.part(view, seen.bone_cut, self.drawn) else { return 0 };
        let [_, _, width, height] = part;
        self.part.write(recorder.gpu(), 0, &[part]);
        passes.skull.cast(recorder, &self.skull, [width, height]);
        width * height
    }
}

/// Bindings of the brain's boundary and of its cut.
fn bind_brain(gpu: &Gpu, passes: &Passes, scene: &Buffer<Scene>) -> Result<Option<[Bindings; 2]>, RenderError> {
    let Some((brain, face)) = &passes.brain else { return Ok(None) };
    Ok(Some([brain.bind(gpu, scene)?, face.bind(gpu, scene)?]))
}

fn sheets<'a>([skull_hit, brain_hit, brain_rest, picture]: [&'a Texture; 4], passes: &'a Passes) -> Sheets<'a> {
    let [bone_coat, brain_coat] = passes.coats.each_ref().map(|coat| &coat.texture);
    let mri = &passes.mri.texture;
    Sheets { skull_hit, brain_hit, brain_rest, mri, skull: &passes.skull, bone_coat, brain_coat, picture }
}

/// Fills a texture.
pub(crate) fn clear(recorder: &mut Recorder, texture: &Texture, value: f64) {
    let colours = [Target { texture, clear: Some([0.0, 0.0, 0.0, value]) }];
    recorder.draw("clear", &DrawTarget { colours: &colours, depth: None }, |_| ());
}
