//! The same picture without any graphics device: every pass again in plain Rust.
//!
//! # Theory
//! Each file here is the twin of a shader of the same name and reads the same [`Scene`]: the rays leap and solve cubics as `bricks.wgsl` does, light
//! falls as in `light.wgsl`. So this is the oracle for the shaders, and the picture of machines without a driver.
//!
//! # Practice
//! Rows are shared between as many threads as there are processors. Before the rays of a tile of 8x8 pixels go, the tile leaps as one beam to where
//! bone may be (`bricks.rs`), which spares most rays that meet nothing all their steps; the device has no such pass. The hits of the last picture are kept, as on the device. Triangles of the brain
//! that reach behind the eye are left out.
//!
//! # When not to use it
//! Where there is any driver, even a software one: that draws the same picture and serves the window.

mod brain;
mod bricks;
mod contour;
mod light;
mod rows;
mod section;
mod skull;
mod slice;

use crate::RenderError;
use crate::brain::Border;
use crate::camera::View;
use crate::frame::{Frame, SceneData};
use crate::image::Image;
use crate::layout::Layout;
use crate::mri::Signals;
use crate::painter::Kept;
use crate::renderer::{BRICKS_PER_FRAME, DrawReport, Hit};
use crate::scene::Scene;
use crate::slice::Plane;
use brain::Fragments;
pub use bricks::Casting;

use bricks::Bricks;
use glam::Vec3;
use skull::{Ray, TILE};
use trepan_geometry::Aabb;

/// Draws pictures of one scene on the processor.
#[derive(Debug)]
pub struct ProcessorRenderer {
    bricks: Bricks,
    brain: Option<Border>,
    mri: Option<Signals>,
    bounds: Aabb,
    layout: Layout,
    picture: Image,
    rays: Vec<Ray>,
    /// Up to where no ray of a tile meets bone, mm.
    clear: Vec<f32>,
    fragments: Fragments,
    /// Changed bricks that one picture takes over at most; the rest comes with the next pictures.
    pub bricks_per_frame: usize,
    /// Threads that share the rows of a picture; by default one for each processor.
    pub threads: usize,
}

/// What the passes read.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Inputs<'a> {
    pub scene: &'a Scene,
    pub bricks: &'a Bricks,
    pub mri: Option<&'a Signals>,
}

impl ProcessorRenderer {
    /// Loads a scene for pictures of `size` pixels, width and height.
    pub fn new(data: &SceneData, size: [u32; 2]) -> Result<Self, RenderError> {
        Self::with(Kept::of(data)?, size)
    }

    /// Takes over what was kept of a scene.
    pub(crate) fn with(kept: Kept, size: [u32; 2]) -> Result<Self, RenderError> {
        let mut renderer = Self {
            bounds: kept.bounds,
            bricks: Bricks::of(kept.bone),
            brain: kept.brain,
            mri: kept.mri,
            layout: Layout::of(0, 0, false),
            picture: Image { width: 0, height: 0, rgba: Vec::new() },
            rays: Vec::new(),
            clear: Vec::new(),
            fragments: Fragments::default(),
            bricks_per_frame: BRICKS_PER_FRAME,
            threads: std::thread::available_parallelism().map_or(1, usize::from),
        };
        renderer.divide(size, true)?;
        Ok(renderer)
    }

    /// Changes the size of the pictures, width and height.
    pub fn resize(&mut self, size: [u32; 2]) -> Result<(), RenderError> {
        self.divide(size, self.layout.slices.is_some())
    }

    fn divide(&mut self, [width, height]: [u32; 2], slices: bool) -> Result<(), RenderError> {
        if width == 0 || height == 0 {
            return Err(RenderError::Size(width, height));
        }
        let layout = Layout::of(width, height, slices);
        if (self.picture.width, self.picture.height, self.layout) != (width, height, layout) {
            let [_, _, w, h] = layout.view.map(|n| n as usize);
            self.layout = layout;
            self.picture = Image { width, height, rgba: vec![0; 4 * width as usize * height as usize] };
            self.rays = vec![Ray::NONE; w * h];
            self.fragments = Fragments::of(w, h);
            self.bricks.recast.forget();
        }
        Ok(())
    }

    /// Draws a picture.
    pub fn draw(&mut self, frame: &Frame) -> Result<DrawReport, RenderError> {
        self.divide([self.picture.width, self.picture.height], frame.slices.shown)?;
        let view = self.view(frame);
        let followed = self.bricks.follow(self.bricks_per_frame);
        if let Some(brain) = &mut self.brain {
            brain.follow(frame.brain_positions)?;
        }
        let [_, _, width, height] = self.layout.view;
        let mri_from_world = self.mri.as_ref().map(|m| m.texture_from_world);
        let scene = Scene::of(frame, &view, [width, height], &self.bricks.grid, mri_from_world);
        let pixels_cast = self.cast(frame, &view, &scene);
        let shown = self.brain.as_ref().filter(|_| frame.show_brain);
        self.fragments.draw(shown, &view);
        self.light(&scene);
        let lines_left = self.slices(frame, &scene);
        Ok(DrawReport { bricks: followed.bricks, bricks_left: followed.left, pixels_cast, lines_left })
    }

    fn cast(&mut self, frame: &Frame, view: &View, scene: &Scene) -> u32 {
        let [_, _, width, height] = self.layout.view;
        if !frame.show_bone || !self.bricks.is_some() {
            self.rays.fill(Ray::NONE);
            self.bricks.recast.forget();
            return 0;
        }
        let Some(part) = self.bricks.recast.part(view, [width, height]) else { return 0 };
        let [x, y, w, h] = part.map(|n| n as usize);
        let bricks = &self.bricks;
        let [columns, lines] = [w, h].map(|n| n.div_ceil(TILE));
        self.clear.resize(columns * lines, 0.0);
        rows::share(self.threads, rows::of(&mut self.clear, columns, 0..lines, 0..columns), |line, row| {
            let first = |n| [x + TILE * n, y + TILE * line];
            row.iter_mut().enumerate().for_each(|(n, clear)| *clear = skull::clear(bricks, scene, first(n)));
        });
        let (clears, top) = (&self.clear, y);
        let rows = rows::of(&mut self.rays, width as usize, y..y + h, x..x + w);
        rows::share(self.threads, rows, |y, row| {
            let clear = &clears[columns * ((y - top) / TILE)..];
            let cast = |n: usize| skull::cast(bricks, scene, [x + n, y], clear[n / TILE]);
            row.iter_mut().enumerate().for_each(|(n, ray)| *ray = cast(n));
        });
        part[2] * part[3]
    }

    fn light(&mut self, scene: &Scene) {
        let [_, _, width, height] = self.layout.view.map(|n| n as usize);
        let inputs = Inputs { scene, bricks: &self.bricks, mri: self.mri.as_ref() };
        let (rays, fragments) = (&self.rays, &self.fragments);
        let pixels = bytemuck::cast_slice_mut::<u8, [u8; 4]>(&mut self.picture.rgba);
        let rows = rows::of(pixels, self.picture.width as usize, 0..height, 0..width);
        rows::share(self.threads, rows, |y, row| {
            for (x, pixel) in row.iter_mut().enumerate() {
                let at = x + width * y;
                *pixel = light::fragment(&inputs, [x, y], &rays[at], fragments.at(at));
            }
        });
    }

    fn slices(&mut self, frame: &Frame, scene: &Scene) -> u32 {
        let Some(rectangles) = self.layout.slices else { return 0 };
        let through = frame.focus(self.bounds);
        let look = frame.slices.with_bone(self.bricks.is_some());
        let planes = Plane::three(through, self.bounds, frame.slices.half_height_mm, &rectangles);
        let inputs = Inputs { scene, bricks: &self.bricks, mri: self.mri.as_ref() };
        let width = self.picture.width as usize;
        let pixels = bytemuck::cast_slice_mut::<u8, [u8; 4]>(&mut self.picture.rgba);
        for (n, (plane, rectangle)) in planes.iter().zip(&rectangles).enumerate() {
            let [x, y, w, h] = rectangle.map(|n| n as usize);
            let cut = self.brain.iter().flat_map(|brain| crate::section::triangles(plane, brain));
            let places = section::places([w, h], cut);
            let rows = rows::of(pixels, width, y..y + h, x..x + w);
            rows::share(self.threads, rows, |row_at, row| {
                for (column, pixel) in row.iter_mut().enumerate() {
                    let at = [column, row_at - y];
                    let rest = places[column + w * (row_at - y)];
                    *pixel = slice::fragment(&inputs, plane, n, [w, h], at, rest, &look);
                }
            });
            if let Some(brain) = &self.brain {
                contour::draw(pixels, width, *rectangle, brain.corners().filter_map(|t| plane.cut(t)));
            }
        }
        0
    }

    /// Changes how rays go through the bone, to measure what it is worth.
    pub fn set_casting(&mut self, casting: Casting) {
        self.bricks.casting = casting;
        self.bricks.recast.forget();
    }

    /// Bricks, cells and samples that a ray of the newest picture has looked at in the mean, without its shadow.
    pub fn steps_per_ray(&self) -> f64 {
        self.rays.iter().map(|ray| f64::from(ray.steps)).sum::<f64>() / self.rays.len().max(1) as f64
    }

    /// Pixels of the picture, width and height.
    pub fn size(&self) -> [u32; 2] {
        [self.picture.width, self.picture.height]
    }

    /// Which part of the picture is what.
    pub fn layout(&self) -> Layout {
        self.layout
    }

    /// The camera of a frame as vectors, for the 3-D view of this picture.
    pub fn view(&self, frame: &Frame) -> View {
        let [_, _, width, height] = self.layout.view;
        frame.camera.view(width as f32 / height as f32)
    }

    /// The newest picture.
    pub fn image(&self) -> &Image {
        &self.picture
    }

    /// The bone at each pixel of the 3-D view, row by row.
    pub fn bone_hits(&self) -> Vec<Option<Hit>> {
        let hit = |r: &Ray| (r.t < crate::skull::NOTHING).then_some(Hit { distance_mm: r.t, normal: r.normal });
        self.rays.iter().map(hit).collect()
    }
}

/// A colour from 0 to 1 as bytes, rounded as the device does.
pub(crate) fn bytes(colour: Vec3) -> [u8; 4] {
    let [r, g, b] = (colour.clamp(Vec3::ZERO, Vec3::ONE) * 255.0).round().to_array();
    [r as u8, g as u8, b as u8, 255]
}
