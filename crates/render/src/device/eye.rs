//! The view of one eye: hits kept between pictures, bound to the passes.

use super::light::Inputs;
use super::passes::{Division, Passes};
use crate::RenderError;
use crate::bricks::NOTHING;
use crate::camera::View;
use crate::frame::Frame;
use crate::recast::Recast;
use crate::scene::Scene;
use crate::stereo::StereoLook;
use trepan_gpu::{Bindings, Depth, DrawTarget, Format, Gpu, Recorder, Target, Texture, TextureSpec};

/// The textures of an eye.
#[derive(Debug)]
pub(crate) struct Eye {
    /// Index of its scene uniform.
    number: usize,
    /// Rectangle of its view in the picture.
    pub area: [u32; 4],
    /// Width and height at which it is drawn, pixels.
    pub drawn: [u32; 2],
    pub skull_hit: Texture,
    pub recast: Recast,
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

impl Eye {
    /// A view drawn with `drawn` pixels, directly into the picture or separately.
    pub fn new(
        gpu: &Gpu,
        number: usize,
        area: [u32; 4],
        division: &Division,
        passes: &Passes,
    ) -> Result<Self, RenderError> {
        let [x, y, width, height] = area;
        let drawn = [width, height].map(|n| ((n as f32 * division.detail).round() as u32).clamp(1, n));
        let whole = [x, y] == [0, 0] && drawn == [width, height] && division.stereo != Some(StereoLook::Anaglyph);
        let sheet = |label, format| {
            let size = [drawn[0], drawn[1], 1];
            Texture::new(gpu, &TextureSpec { label, size, volume: false, format, drawn_to: true })
        };
        let scene = &passes.scenes[number];
        let skull_hit = sheet("skull hit", Format::Rgba32Uint)?;
        let brain_hit = sheet("brain hit", Format::Rgba32Uint)?;
        let brain_rest = sheet("brain rest", Format::Rgba32Uint)?;
        let separate = |texture: Texture| -> Result<_, RenderError> {
            let bindings = passes.enlarge.bind(gpu, scene, &texture)?;
            Ok((texture, bindings))
        };
        let apart = (!whole).then(|| separate(sheet("apart", Format::Rgba8Unorm)?)).transpose()?;
        let brain = passes
            .brain
            .as_ref()
            .map(|(brain, face)| -> Result<_, RenderError> { Ok([brain.bind(gpu, scene)?, face.bind(gpu, scene)?]) });
        Ok(Self {
            number,
            area,
            drawn,
            recast: Recast::default(),
            depth: sheet("depth", Format::Depth32Float)?,
            apart,
            skull: passes.skull.bind(gpu, scene)?,
            light: passes.light.bind(gpu, scene, &inputs(&skull_hit, &brain_hit, &brain_rest, passes))?,
            overlay: passes.overlay.bind(gpu, scene, &skull_hit, &brain_hit)?,
            brain: brain.transpose()?,
            skull_hit,
            brain_hit,
            brain_rest,
        })
    }

    /// Rebinds bone and lighting, after a paint's texture or the bone's buffers changed.
    pub fn rebind(&mut self, gpu: &Gpu, passes: &Passes) -> Result<(), RenderError> {
        self.skull = passes.skull.bind(gpu, &passes.scenes[self.number])?;
        let inputs = inputs(&self.skull_hit, &self.brain_hit, &self.brain_rest, passes);
        self.light = passes.light.bind(gpu, &passes.scenes[self.number], &inputs)?;
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
        let ([w, h], area) = (self.drawn, self.area);
        let (texture, area) = self.apart.as_ref().map_or((picture, area), |(texture, _)| (texture, [0, 0, w, h]));
        passes.light.draw(recorder, &self.light, area, texture);
        passes.overlay.draw(recorder, &self.overlay, area, texture);
        pixels_cast
    }

    fn draw_brain(&self, recorder: &mut Recorder, passes: &Passes, shown: bool) {
        let (Some((brain, face)), Some([border, cut]), true) = (&passes.brain, &self.brain, shown) else {
            return clear(recorder, &self.brain_hit, 0.0);
        };
        let colours = [&self.brain_hit, &self.brain_rest].map(|texture| Target { texture, clear: Some([0.0; 4]) });
        let target = DrawTarget { colours: &colours, depth: Some(Depth { texture: &self.depth, clear: Some(1.0) }) };
        recorder.draw("brain", &target, |draws| {
            brain.draw(draws, border);
            face.draw(draws, cut);
        });
    }

    fn cast(&mut self, recorder: &mut Recorder, passes: &Passes, shown: bool, seen: &Scene, view: &View) -> u32 {
        if !shown || !passes.skull.is_some() {
            self.recast.forget();
            clear(recorder, &self.skull_hit, f64::from(NOTHING.to_bits()));
            return 0;
        }
        let Some(part) = self.recast.part(view, seen.bone_cut, self.drawn) else { return 0 };
        passes.skull.cast(recorder, &self.skull, part, &self.skull_hit);
        part[2] * part[3]
    }
}

fn inputs<'a>(
    skull_hit: &'a Texture,
    brain_hit: &'a Texture,
    brain_rest: &'a Texture,
    passes: &'a Passes,
) -> Inputs<'a> {
    let [bone_coat, brain_coat] = passes.coats.each_ref().map(|coat| &coat.texture);
    let mri = &passes.mri.texture;
    Inputs { skull_hit, brain_hit, brain_rest, mri, skull: &passes.skull, bone_coat, brain_coat }
}

/// Fills a texture.
pub(crate) fn clear(recorder: &mut Recorder, texture: &Texture, value: f64) {
    let colours = [Target { texture, clear: Some([0.0, 0.0, 0.0, value]) }];
    recorder.draw("clear", &DrawTarget { colours: &colours, depth: None }, |_| ());
}
