//! The renderer on the processor: every pass in plain Rust, without a graphics device.
//!
//! # Theory
//! Each file is the CPU version of the shader of the same name and reads the same [`Scene`]: rays
//! skip empty space and solve cubics as in `bricks.wgsl`, lighting is as in `light.wgsl`. It is the
//! reference for the shaders, and the renderer for machines without a driver.
//!
//! # Practice
//! Rows are shared between as many threads as there are processors. Five optimisations are not in
//! the shaders. While the camera stands still only tiles in which something changed are drawn
//! again, and slices only while what they show changes (`reuse.rs`); a tool's shadow is computed in
//! tiles where it may fall. Each tile of 8x8 pixels first
//! advances as one beam to where bone may be. Rays skip by the octant of their direction and test
//! a cell only if its occupancy bit is set (`bricks.rs`). While the camera moves, rays are sparse
//! ([`Casting::sparse`]): a quarter of the pixels, and the others where neighbouring tangent
//! planes disagree (`skull.rs`); colours between like ones on an even cortex without a vessel are
//! interpolated too (`eye.rs`). The hits of the last picture are kept, as on the device. At rest
//! edges are smoothed (`edges.rs`). Triangles of the brain that reach behind the eye are skipped.
//!
//! # When not to use it
//! Where there is a graphics card: it draws the same picture and serves the window.

mod brain;
mod bricks;
mod contour;
mod drilled;
mod edges;
mod eye;
mod light;
mod line;
mod overlay;
mod reuse;
mod root;
mod rows;
mod section;
mod skull;
mod slice;
mod tiles;
mod tool;

use crate::RenderError;
use crate::border::Border;
use crate::camera::View;
use crate::frame::{Frame, SceneData, SliceLook};
use crate::image::Image;
use crate::kept::SceneCache;
use crate::layout::Layout;
use crate::mri::Signals;
use crate::overlay::items;
use crate::paint::Paint;
use crate::report::{BRICKS_PER_FRAME, DrawReport, Hit, LEAST_DETAIL, eye_view};
use crate::scene::Scene;
use crate::slice::Plane;
use crate::stereo::StereoLook;
use crate::tool::ToolShape;
pub use bricks::Casting;

use bricks::Bricks;
use eye::EyeHits;
use glam::Vec3;
use skull::Ray;
use std::sync::Arc;
use trepan_geometry::Aabb;

/// Renders pictures of one scene on the processor.
#[derive(Debug)]
pub struct ProcessorRenderer {
    bricks: Bricks,
    brain: Option<Border>,
    mri: Option<Arc<Signals>>,
    bounds: Aabb,
    layout: Layout,
    picture: Image,
    stereo: Option<StereoLook>,
    /// One eye, or the left and the right.
    eyes: Vec<EyeHits>,
    /// Fraction of the 3-D view's pixels along an edge.
    detail: f32,
    /// The next slice to be drawn.
    turn: usize,
    /// Whether no slice was drawn yet in this size.
    fresh: bool,
    /// What the slices show, and how many of them are still to show it.
    shown: (Option<SliceState>, usize),
    /// Most changed bricks processed per picture; the rest follows in the next pictures.
    pub bricks_per_frame: usize,
    /// Slices drawn per picture, in turn; the others stay as they are. All three by default.
    pub slices_per_frame: usize,
    /// Threads that share the rows of a picture; by default one per processor.
    pub threads: usize,
}

/// What slices show, but for brain and bone.
type SliceState = ([Plane; 3], SliceLook, [ToolShape; 2]);

/// The inputs of the passes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Inputs<'a> {
    pub scene: &'a Scene,
    pub bricks: &'a Bricks,
    pub mri: Option<&'a Signals>,
    pub bone_paint: Option<&'a Paint>,
    pub brain_paint: Option<&'a Paint>,
}

impl ProcessorRenderer {
    /// Loads a scene for pictures of `size` pixels, width and height.
    pub fn new(data: &SceneData, size: [u32; 2]) -> Result<Self, RenderError> {
        Self::with(SceneCache::of(data)?, size)
    }

    /// Creates a renderer from a stored scene.
    pub(crate) fn with(kept: SceneCache, size: [u32; 2]) -> Result<Self, RenderError> {
        let mut renderer = Self {
            bounds: kept.bounds,
            bricks: Bricks::of(kept.bone),
            brain: kept.brain,
            mri: kept.mri,
            layout: Layout::of(0, 0, false),
            picture: Image { width: 0, height: 0, rgba: Vec::new() },
            stereo: None,
            eyes: Vec::new(),
            detail: 1.0,
            turn: 0,
            fresh: true,
            shown: (None, 0),
            bricks_per_frame: BRICKS_PER_FRAME,
            slices_per_frame: 3,
            threads: std::thread::available_parallelism().map_or(1, usize::from),
        };
        renderer.divide(size, true, None)?;
        Ok(renderer)
    }

    /// Changes the size of the pictures, width and height.
    pub fn resize(&mut self, size: [u32; 2]) -> Result<(), RenderError> {
        self.divide(size, self.layout.slices.is_some(), self.stereo)
    }

    /// Draws the 3-D view with a fraction of the pixels along an edge, from 0.05 to 1, and enlarges
    /// it. Slices keep all their pixels.
    pub fn set_detail(&mut self, share: f32) -> Result<(), RenderError> {
        self.detail = if share.is_finite() { share.clamp(LEAST_DETAIL, 1.0) } else { 1.0 };
        self.resize(self.size())
    }

    fn divide(
        &mut self,
        [width, height]: [u32; 2],
        slices: bool,
        stereo: Option<StereoLook>,
    ) -> Result<(), RenderError> {
        if width == 0 || height == 0 {
            return Err(RenderError::Size(width, height));
        }
        let layout = Layout::of(width, height, slices);
        if (self.picture.width, self.picture.height, self.layout) != (width, height, layout) {
            self.layout = layout;
            self.picture = Image { width, height, rgba: vec![0; 4 * width as usize * height as usize] };
            self.eyes.clear();
            self.fresh = true;
        }
        self.stereo = stereo;
        let areas = StereoLook::areas(stereo, layout.view);
        let drawn = |area: &[u32; 4]| [area[2], area[3]].map(|n| ((n as f32 * self.detail).round() as u32).clamp(1, n));
        if !self.eyes.iter().map(|eye| (eye.area, eye.size)).eq(areas.iter().map(|area| (*area, drawn(area)))) {
            self.eyes = areas.iter().map(|area| EyeHits::of(*area, drawn(area))).collect();
        }
        Ok(())
    }

    /// Draws a picture.
    pub fn draw(&mut self, frame: &Frame) -> Result<DrawReport, RenderError> {
        let size = [self.picture.width, self.picture.height];
        self.divide(size, frame.slices.shown, frame.stereo.map(|s| s.look))?;
        [frame.bone_paint, frame.brain_paint].into_iter().flatten().try_for_each(Paint::check)?;
        let followed = self.bricks.follow(self.bricks_per_frame);
        if let Some(brain) = &mut self.brain {
            brain.leave_out(frame.brain_gone, frame.brain_splits);
            brain.cover(frame.dura.as_ref())?;
            brain.stain(frame.brain_stains);
            brain.follow(frame.brain_positions, &frame.balls())?;
        }
        let (items, lines_left) = items(&frame.overlay, self.view(frame).eye);
        let mri_from_world = self.mri.as_ref().map(|m| m.texture_from_world);
        let mut pixels_cast = 0;
        let mut eyes = std::mem::take(&mut self.eyes);
        for (n, eye) in eyes.iter_mut().enumerate() {
            let view = eye_view(frame, eye.area, n);
            let scene = Scene::of(frame, &view, eye.size, &self.bricks.grid, mri_from_world);
            eye.recast.note(followed.changed);
            let inputs = self.inputs(frame, &scene);
            let brain = self.brain.as_ref().filter(|_| frame.show_brain);
            pixels_cast += eye.draw(&inputs, brain, frame.show_bone, &view, &items, self.threads);
            eye.show(&mut self.picture, self.stereo, n > 0, self.threads);
            if n == 0 {
                self.slices(frame, &scene, followed.bricks > 0);
            }
        }
        self.eyes = eyes;
        self.brain.iter_mut().for_each(Border::settle);
        Ok(DrawReport { bricks: followed.bricks, bricks_left: followed.left, pixels_cast, lines_left })
    }

    /// Smooths the edges of the 3-D view by one more sample of a pixel; returns whether there was
    /// one to add. `frame` must be the one that was drawn last. With stereo edges stay as they are.
    pub fn refine(&mut self, frame: &Frame) -> bool {
        let mut eyes = std::mem::take(&mut self.eyes);
        let added = match &mut eyes[..] {
            [eye] if !eye.is_smooth() => {
                let view = eye.next_view(&eye_view(frame, eye.area, 0));
                let mri_from_world = self.mri.as_ref().map(|m| m.texture_from_world);
                let scene = Scene::of(frame, &view, eye.size, &self.bricks.grid, mri_from_world);
                let (items, _) = items(&frame.overlay, view.eye);
                let brain = self.brain.as_ref().filter(|_| frame.show_brain);
                eye.refine(&self.inputs(frame, &scene), brain, frame.show_bone, &view, &items, self.threads);
                eye.show(&mut self.picture, None, false, self.threads);
                true
            }
            _ => false,
        };
        self.eyes = eyes;
        added
    }

    /// Whether bone has changed since the last picture.
    pub fn is_stale(&mut self) -> bool {
        self.bricks.is_stale()
    }

    fn inputs<'a>(&'a self, frame: &Frame<'a>, scene: &'a Scene) -> Inputs<'a> {
        let (bone_paint, brain_paint) = (frame.bone_paint, frame.brain_paint);
        Inputs { scene, bricks: &self.bricks, mri: self.mri.as_deref(), bone_paint, brain_paint }
    }

    fn slices(&mut self, frame: &Frame, scene: &Scene, drilled: bool) {
        let Some(rectangles) = self.layout.slices else { return };
        let through = frame.focus(self.bounds);
        let look = frame.slices.with_bone(self.bricks.is_some());
        let planes = Plane::three(through, self.bounds, frame.slices.half_height_mm, &rectangles);
        let state = Some((planes, look, scene.tools));
        let (was, due) = std::mem::replace(&mut self.shown, (state, 0));
        let fresh = std::mem::take(&mut self.fresh);
        let moves = self.brain.as_ref().is_some_and(|brain| brain.changes.all || !brain.changes.triangles.is_empty());
        let due = if was != state || fresh || drilled || moves { 3 } else { due };
        let count = due.min(if fresh { 3 } else { self.slices_per_frame });
        self.shown.1 = due - count;
        let (bricks, mri, width) = (&self.bricks, self.mri.as_deref(), self.picture.width as usize);
        let inputs = Inputs { scene, bricks, mri, bone_paint: None, brain_paint: None };
        let pixels = bytemuck::cast_slice_mut::<u8, [u8; 4]>(&mut self.picture.rgba);
        let first = self.turn;
        self.turn = (first + count) % 3;
        for n in (first..first + count).map(|n| n % 3) {
            let (plane, rectangle) = (&planes[n], &rectangles[n]);
            let [x, y, w, h] = rectangle.map(|n| n as usize);
            let places = self.brain.as_ref().map_or_else(Vec::new, |brain| section::places([w, h], plane, brain));
            let rows = rows::of(pixels, width, y..y + h, x..x + w);
            rows::share(self.threads, rows, |row_at, row| {
                for (column, pixel) in row.iter_mut().enumerate() {
                    let at = [column, row_at - y];
                    let rest = places.get(column + w * (row_at - y)).copied().flatten();
                    *pixel = slice::fragment(&inputs, plane, n, [w, h], at, rest, &look);
                }
            });
            if let Some(brain) = &self.brain {
                contour::draw(pixels, width, *rectangle, brain.across(plane.level()).filter_map(|t| plane.cut(t)));
            }
        }
    }

    /// How rays are cast through bone.
    pub fn casting(&self) -> Casting {
        self.bricks.casting
    }

    /// Changes how rays are cast through bone.
    pub fn set_casting(&mut self, casting: Casting) {
        if self.bricks.casting != casting {
            self.bricks.casting = casting;
            self.eyes.iter_mut().for_each(|eye| eye.recast.forget());
        }
    }

    /// Mean number of bricks, cells and samples visited per ray in the last picture, without shadow
    /// rays.
    pub fn steps_per_ray(&self) -> f64 {
        let rays = &self.eyes[0].rays;
        rays.iter().map(|ray| f64::from(ray.steps)).sum::<f64>() / rays.len().max(1) as f64
    }

    /// Pixels of the picture, width and height.
    pub fn size(&self) -> [u32; 2] {
        [self.picture.width, self.picture.height]
    }

    /// The layout of the picture.
    pub fn layout(&self) -> Layout {
        self.layout
    }

    /// A frame's camera as vectors, for the 3-D view; with stereo, from between the eyes.
    pub fn view(&self, frame: &Frame) -> View {
        let [_, _, width, height] = self.eyes[0].area;
        frame.camera.view(width as f32 / height as f32)
    }

    /// The last picture.
    pub fn image(&self) -> &Image {
        &self.picture
    }

    /// The bone at each pixel of the 3-D view, row by row.
    pub fn bone_hits(&self) -> Vec<Option<Hit>> {
        let hit = |r: &Ray| (r.t < crate::bricks::NOTHING).then_some(Hit { distance_mm: r.t, normal: r.normal });
        self.eyes[0].rays.iter().map(hit).collect()
    }
}

/// Converts a colour from 0 to 1 to bytes, rounded like on the device.
pub(crate) fn bytes(colour: Vec3) -> [u8; 4] {
    // The library's `round` is a call.
    let [r, g, b] = (colour.clamp(Vec3::ZERO, Vec3::ONE) * 255.0 + 0.5).to_array();
    [r as u8, g as u8, b as u8, 255]
}
