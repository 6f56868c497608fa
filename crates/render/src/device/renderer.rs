//! Draws the picture from its parts: newest poses → changed bricks → brain → rays → light → slices.

use super::anaglyph::Anaglyph;
use super::average::Average;
use super::brain::Brain;
use super::canvas::Canvas;
use super::contour::Contour;
use super::cut::Face;
use super::enlarge::Enlarge;
use super::eye::clear;
use super::light::Light;
use super::overlay::Shapes;
use super::paint::Coat;
use super::passes::{Division, Passes};
use super::section::Section;
use super::skull::Skull;
use super::slice::Slices;
use crate::RenderError;
use crate::bricks::NOTHING;
use crate::camera::{SAMPLES, View};
use crate::cut::Cut;
use crate::frame::{Frame, SceneData, bounds};
use crate::image::Image;
use crate::layout::Layout;
use crate::mri::Mri;
use crate::report::{BRICKS_PER_FRAME, DrawReport, Hit, LEAST_DETAIL, OUTLINE, eye_view};
use crate::scene::Scene;
use crate::slice::Plane;
use glam::Vec3;
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::Instant;
use trepan_geometry::Aabb;
use trepan_gpu::{Buffer, Gpu, PassTime, Recorder, Texture, Timer};

/// Draws pictures of one scene into a texture.
#[derive(Debug)]
pub struct Renderer {
    gpu: Gpu,
    passes: Passes,
    section: Option<Section>,
    contour: Option<Contour>,
    canvas: Canvas,
    bounds: Aabb,
    timer: Option<Timer>,
    /// From the submission of the newest finished picture to its end, µs.
    took_us: Arc<AtomicU32>,
    /// Most changed bricks processed per picture; the rest follows in the next pictures.
    pub bricks_per_frame: usize,
}

impl Renderer {
    /// Loads a scene for pictures of `size` pixels, width and height.
    pub fn new(gpu: &Gpu, data: &SceneData, size: [u32; 2]) -> Result<Self, RenderError> {
        let scene = || Buffer::zeroed(gpu, "scene", 1);
        let brain =
            |mesh| -> Result<_, RenderError> { Ok((Brain::new(gpu, mesh, data.cortex.as_ref())?, Face::new(gpu)?)) };
        let passes = Passes {
            scenes: [scene()?, scene()?],
            skull: Skull::new(gpu, data.bone.clone())?,
            brain: data.brain.map(brain).transpose()?,
            mri: Mri::new(gpu, data.mri, data.tint)?,
            coats: [Coat::new(gpu, "bone paint")?, Coat::new(gpu, "brain paint")?],
            light: Light::new(gpu)?,
            overlay: Shapes::new(gpu)?,
            enlarge: Enlarge::new(gpu)?,
            anaglyph: Anaglyph::new(gpu)?,
            average: Average::new(gpu)?,
            slices: Slices::new(gpu)?,
        };
        let moves = passes.brain.is_some();
        let section = moves.then(|| Section::new(gpu, &passes.scenes[0])).transpose()?;
        let contour = moves.then(|| Contour::new(gpu, &passes.scenes[0], OUTLINE)).transpose()?;
        let canvas = Canvas::new(gpu, Division { size, slices: true, detail: 1.0, stereo: None }, &passes)?;
        Ok(Self {
            gpu: gpu.clone(),
            bounds: bounds(data),
            passes,
            section,
            contour,
            canvas,
            timer: Timer::new(gpu, 16)?,
            took_us: Arc::default(),
            bricks_per_frame: BRICKS_PER_FRAME,
        })
    }

    /// Draws a picture; does not wait for the device.
    pub fn draw(&mut self, frame: &Frame) -> Result<DrawReport, RenderError> {
        let stereo = frame.stereo.map(|s| s.look);
        self.divide(Division { slices: frame.slices.shown, stereo, ..self.canvas.division })?;
        if let Some(mean) = &mut self.canvas.mean {
            mean.taken = 0;
        }
        let (followed, grown) = self.passes.skull.follow(&self.gpu, self.bricks_per_frame)?;
        if grown {
            self.canvas.rebind(&self.gpu, &self.passes)?;
        }
        self.canvas.eyes.iter_mut().for_each(|eye| eye.recast.note(followed.changed));
        let lines_left = self.follow_brain(frame)? + self.follow_slices(frame) + self.follow_looks(frame)?;
        let mut timer = self.timer.take();
        let gpu = self.gpu.clone();
        let mut recorder = gpu.record("picture").timed(timer.as_mut());
        let pixels_cast = self.draw_views(&mut recorder, frame);
        self.draw_slices(&mut recorder);
        recorder.submit();
        let (took_us, begun) = (Arc::clone(&self.took_us), Instant::now());
        let tell = move || took_us.store(begun.elapsed().as_micros().min(u32::MAX.into()) as u32, Ordering::Relaxed);
        self.gpu.queue().on_submitted_work_done(tell);
        self.timer = timer;
        Ok(DrawReport { bricks: followed.bricks, bricks_left: followed.left, pixels_cast, lines_left })
    }

    /// Updates the brain and its cut; returns the number of triangles over the limit.
    fn follow_brain(&mut self, frame: &Frame) -> Result<u32, RenderError> {
        let Some((brain, face)) = &mut self.passes.brain else { return Ok(0) };
        let is_other = brain.follow(&self.gpu, frame)?;
        let left = face.follow(&self.gpu, Cut::plane(frame.cut.as_ref()), &brain.border);
        if is_other {
            self.canvas.rebind(&self.gpu, &self.passes)?;
        }
        Ok(left)
    }

    /// Uploads paints and overlay; returns the number of shapes over the limit.
    fn follow_looks(&mut self, frame: &Frame) -> Result<u32, RenderError> {
        let mut other = false;
        for (coat, paint) in self.passes.coats.iter_mut().zip([frame.bone_paint, frame.brain_paint]) {
            other |= coat.follow(&self.gpu, paint)?;
        }
        if other {
            self.canvas.rebind(&self.gpu, &self.passes)?;
        }
        Ok(self.passes.overlay.follow(&self.gpu, &frame.overlay, self.view(frame).eye))
    }

    /// Draws bone, brain, tools and overlay for each eye; returns the number of pixels cast.
    fn draw_views(&mut self, recorder: &mut Recorder, frame: &Frame) -> u32 {
        let Canvas { eyes, picture, anaglyph, layout, .. } = &mut self.canvas;
        let (passes, mri_from_world) = (&self.passes, self.passes.mri.texture_from_world);
        let mut pixels_cast = 0;
        for (n, eye) in eyes.iter_mut().enumerate() {
            let view = eye_view(frame, eye.area, n);
            let scene = Scene::of(frame, &view, eye.drawn, &passes.skull.grid, mri_from_world);
            passes.scenes[n].write(&self.gpu, 0, &[scene]);
            pixels_cast += eye.draw(recorder, passes, frame, &scene, &view, picture);
            if let (Some((_, bindings)), None) = (&eye.apart, &anaglyph) {
                passes.enlarge.draw(recorder, bindings, eye.area, picture);
            }
        }
        if let Some(bindings) = anaglyph {
            passes.anaglyph.draw(recorder, bindings, layout.view, picture);
        }
        pixels_cast
    }

    fn draw_slices(&self, recorder: &mut Recorder) {
        if let Some(rectangles) = &self.canvas.layout.slices {
            match &self.section {
                Some(section) => section.draw(recorder, rectangles, &self.canvas.section),
                None => clear(recorder, &self.canvas.section, 0.0),
            }
            self.passes.slices.draw(recorder, &self.canvas.slices, rectangles, &self.canvas.picture);
            if let Some(contour) = &self.contour {
                contour.draw(recorder, rectangles, &self.canvas.picture);
            }
        }
    }

    fn follow_slices(&mut self, frame: &Frame) -> u32 {
        let Some(rectangles) = &self.canvas.layout.slices else { return 0 };
        let planes = Plane::three(frame.focus(self.bounds), self.bounds, frame.slices.half_height_mm, rectangles);
        let look = frame.slices.with_bone(self.passes.skull.is_some());
        self.passes.slices.follow(&self.gpu, &planes, rectangles, &look);
        let Some((brain, _)) = &self.passes.brain else { return 0 };
        let contour = self.contour.as_mut().map_or(0, |c| c.follow(&self.gpu, &planes, &brain.border));
        contour + self.section.as_mut().map_or(0, |s| s.follow(&self.gpu, &planes, &brain.border))
    }

    /// Smooths the edges of the 3-D view by one more sample of every pixel; returns whether there
    /// was one to add. `frame` must be the one that was drawn last. With stereo or less detail
    /// edges stay as they are.
    pub fn refine(&mut self, frame: &Frame) -> Result<bool, RenderError> {
        let Canvas { eyes, picture, mean, .. } = &mut self.canvas;
        let (passes, gpu) = (&self.passes, self.gpu.clone());
        let [eye] = &mut eyes[..] else { return Ok(false) };
        if eye.apart.is_some() || mean.as_ref().is_some_and(|mean| mean.taken == SAMPLES) {
            return Ok(false);
        }
        let mean = match mean {
            Some(mean) => mean,
            None => mean.insert(passes.average.mean(&gpu, &passes.scenes[0], &passes.enlarge, eye.drawn, picture)?),
        };
        let view = eye_view(frame, eye.area, 0).sample(mean.taken, eye.drawn);
        let mut scene = Scene::of(frame, &view, eye.drawn, &passes.skull.grid, passes.mri.texture_from_world);
        scene.steps.z = 1.0 / (mean.taken + 1) as f32;
        passes.scenes[0].write(&gpu, 0, &[scene]);
        let mut recorder = gpu.record("sample");
        eye.draw(&mut recorder, passes, frame, &scene, &view, picture);
        passes.average.draw(&mut recorder, mean, &passes.enlarge, eye.area, picture);
        recorder.submit();
        Ok(true)
    }

    /// Whether bone has changed since the last picture.
    pub fn is_stale(&mut self) -> bool {
        self.passes.skull.is_stale()
    }

    /// Changes the size of the pictures, width and height.
    pub fn resize(&mut self, size: [u32; 2]) -> Result<(), RenderError> {
        self.divide(Division { size, ..self.canvas.division })
    }

    /// Draws a fraction of the 3-D view's pixels along an edge and enlarges them: 1 is all, 0.5 a
    /// quarter of them. Slices keep full resolution.
    pub fn set_detail(&mut self, share: f32) -> Result<(), RenderError> {
        let detail = if share.is_finite() { share.clamp(LEAST_DETAIL, 1.0) } else { 1.0 };
        self.divide(Division { detail, ..self.canvas.division })
    }

    /// Enables empty-space skipping (the default), or makes rays visit every cell, for
    /// measurements.
    pub fn set_leaping(&mut self, leaping: bool) {
        self.passes.skull.set_leaping(&self.gpu, leaping);
        self.canvas.eyes.iter_mut().for_each(|eye| eye.recast.forget());
    }

    fn divide(&mut self, division: Division) -> Result<(), RenderError> {
        if self.canvas.division != division {
            self.canvas = Canvas::new(&self.gpu, division, &self.passes)?;
        }
        Ok(())
    }

    /// The device in use.
    pub fn gpu(&self) -> &Gpu {
        &self.gpu
    }

    /// Pixels of the picture, width and height.
    pub fn size(&self) -> [u32; 2] {
        self.canvas.division.size
    }

    /// Width and height at which the 3-D view, or the left eye's, is drawn, pixels.
    pub fn view_size(&self) -> [u32; 2] {
        self.canvas.eyes[0].drawn
    }

    /// The layout of the picture.
    pub fn layout(&self) -> Layout {
        self.canvas.layout
    }

    /// A frame's camera as vectors, for the 3-D view; with stereo, from between the eyes.
    pub fn view(&self, frame: &Frame) -> View {
        let [_, _, width, height] = self.canvas.eyes[0].area;
        frame.camera.view(width as f32 / height as f32)
    }

    /// Time that the device took for the newest finished picture, s; 0 before the first.
    pub fn took_s(&self) -> f64 {
        1e-6 * f64::from(self.took_us.load(Ordering::Relaxed))
    }

    /// The box that the slices show, world mm.
    pub fn bounds(&self) -> Aabb {
        self.bounds
    }

    /// The last picture on the device.
    pub fn texture(&self) -> &Texture {
        &self.canvas.picture
    }

    /// Waits for the last picture and copies it.
    pub fn image(&self) -> Result<Image, RenderError> {
        let [width, height] = self.size();
        Ok(Image { width, height, rgba: self.canvas.picture.read::<u8>(&self.gpu)? })
    }

    /// Waits for the last picture and returns the bone at each pixel of its 3-D view
    /// ([`view_size`](Self::view_size)), row by row.
    pub fn bone_hits(&self) -> Result<Vec<Option<Hit>>, RenderError> {
        let hits = self.canvas.eyes[0].skull_hit.read::<[f32; 4]>(&self.gpu)?;
        let hit = |h: [f32; 4]| (h[3] < NOTHING).then(|| Hit { distance_mm: h[3], normal: unfold([h[0], h[1]]) });
        Ok(hits.into_iter().map(hit).collect())
    }

    /// Waits for the last picture and returns the device's time for each pass; empty if
    /// unsupported.
    pub fn pass_times(&self) -> Result<Vec<PassTime>, RenderError> {
        Ok(self.timer.as_ref().map(|t| t.read(&self.gpu)).transpose()?.unwrap_or_default())
    }
}

/// Decodes a unit vector from two octahedral coordinates.
fn unfold([x, y]: [f32; 2]) -> Vec3 {
    let z = 1.0 - x.abs() - y.abs();
    let folded = if z < 0.0 { [(1.0 - y.abs()).copysign(x), (1.0 - x.abs()).copysign(y)] } else { [x, y] };
    Vec3::new(folded[0], folded[1], z).normalize_or(Vec3::Z)
}
