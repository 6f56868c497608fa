//! The view of one eye, with hits kept between pictures.

use super::brain::Fragments;
use super::edges::Edges;
use super::reuse::LastPicture;
use super::skull::{Ray, TILE, cast, clear};
use super::tiles::{EDGE, Tiles};
use super::{Inputs, light, overlay, rows};
use crate::border::Border;
use crate::bricks::NOTHING;
use crate::camera::{SAMPLES, View};
use crate::image::{Enlarge, Image};
use crate::overlay::Item;
use crate::recast::Recast;
use crate::stereo::StereoLook;

/// The stored hits and the view of an eye.
#[derive(Debug)]
pub(crate) struct EyeHits {
    /// Rectangle of its view in the picture.
    pub area: [u32; 4],
    /// Width and height of the drawn view, pixels; enlarged into the rectangle.
    pub size: [u32; 2],
    pub rays: Vec<Ray>,
    pub recast: Recast,
    /// Distance that is free of bone for each tile, mm.
    clear: Vec<f32>,
    fragments: Fragments,
    pixels: Vec<[u8; 4]>,
    /// The tiles that the last picture drew anew.
    tiles: Tiles,
    /// What the pixels show; `None` if they hold for no other picture.
    drawn: Option<LastPicture>,
    /// The edges of the last picture, once they are smoothed.
    edges: Option<Edges>,
}

/// Edge pixels that a thread takes at once.
const CHUNK: usize = 256;

impl EyeHits {
    pub fn of(area: [u32; 4], size: [u32; 2]) -> Self {
        let [width, height] = size.map(|n| n as usize);
        Self {
            area,
            size,
            rays: vec![Ray::NONE; width * height],
            recast: Recast::default(),
            clear: Vec::new(),
            fragments: Fragments::of(width, height),
            pixels: vec![[0; 4]; width * height],
            tiles: Tiles::of([width, height]),
            drawn: None,
            edges: None,
        }
    }

    /// Draws bone, brain, tools and overlay; returns the number of pixels cast again.
    pub fn draw(
        &mut self,
        inputs: &Inputs,
        brain: Option<&Border>,
        show_bone: bool,
        view: &View,
        items: &[Item],
        threads: usize,
    ) -> u32 {
        let size = self.size.map(|n| n as usize);
        self.edges = None;
        let mut drawn = LastPicture::of(inputs, brain.is_some(), view, items, size);
        let before =
            self.drawn.take().filter(|before| drawn.may_follow(before) && brain.is_none_or(|brain| !brain.changes.all));
        self.tiles.fill(before.is_none());
        let part = self.cast(inputs, show_bone, view, threads);
        if let Some([x, y, w, h]) = part.map(|part| part.map(|n| n as usize)) {
            self.tiles.mark_rectangle([x, y, x + w, y + h]);
        }
        let known = before.is_some().then_some(&mut self.tiles);
        self.fragments.draw(brain, view, inputs.scene.brain_cut, threads, known);
        if let Some(before) = &before {
            drawn.mark(before, &mut self.tiles);
        }
        if inputs.bricks.casting.sparse {
            self.tiles.grow();
        }
        drawn.measure(before, &self.tiles, &self.rays, &self.fragments, self.tiles.threads(threads));
        self.light(inputs, brain, &drawn, self.tiles.threads(threads));
        self.drawn = Some(drawn);
        let (rays, fragments) = (&self.rays, &self.fragments);
        let depth = |at: usize| rays[at].t.min(fragments.t(brain, at));
        items.iter().for_each(|item| overlay::draw(item, inputs.scene, view, &mut self.pixels, depth));
        part.map_or(0, |[_, _, w, h]| w * h)
    }

    /// Whether all samples of the edges are taken.
    pub fn is_smooth(&self) -> bool {
        self.edges.as_ref().is_some_and(|edges| edges.taken == SAMPLES || edges.pixels.is_empty())
    }

    /// The view of the next sample of the edges.
    pub fn next_view(&mut self, view: &View) -> View {
        let (pixels, width) = (&self.pixels, self.size[0] as usize);
        let taken = self.edges.get_or_insert_with(|| Edges::of(pixels, width)).taken;
        view.sample(taken, self.size)
    }

    /// Adds a sample of the edges, seen by their next view.
    pub fn refine(
        &mut self,
        inputs: &Inputs,
        brain: Option<&Border>,
        show_bone: bool,
        view: &View,
        items: &[Item],
        threads: usize,
    ) {
        let Some(mut edges) = self.edges.take() else { return };
        self.drawn = None;
        self.tiles.fill(true);
        self.fragments.draw(brain, view, inputs.scene.brain_cut, threads, None);
        let [width, height] = self.size.map(|n| n as usize);
        let (bricks, scene, fragments) = (inputs.bricks, inputs.scene, &self.fragments);
        let tools = scene.tools.map(|tool| overlay::rectangle(&tool, view, [width, height]));
        let cast_bone = show_bone && bricks.is_some();
        let sample = |pixel: usize| {
            let at = [pixel % width, pixel / width];
            let ray = if cast_bone { cast(bricks, scene, at, 0.0, &[]) } else { Ray::NONE };
            let brain = &fragments.at(brain, pixel);
            let near = tools.map(|tool| overlay::inside(tool, at));
            (light::fragment(inputs, at, [near, [true; 2]], &ray, brain), ray.t.min(brain.t))
        };
        let mut samples = vec![([0; 4], NOTHING); edges.pixels.len()];
        rows::share(threads, samples.chunks_mut(CHUNK).enumerate(), |n, chunk| {
            chunk.iter_mut().zip(&edges.pixels[n * CHUNK..]).for_each(|(to, &pixel)| *to = sample(pixel));
        });
        if !items.is_empty() {
            // Shapes are drawn over a whole picture; only its edges count.
            let (mut picture, mut depths) = (self.pixels.clone(), vec![NOTHING; self.pixels.len()]);
            for (&pixel, (colour, t)) in edges.pixels.iter().zip(&samples) {
                (picture[pixel], depths[pixel]) = (*colour, *t);
            }
            items.iter().for_each(|item| overlay::draw(item, scene, view, &mut picture, |at| depths[at]));
            samples.iter_mut().zip(&edges.pixels).for_each(|((colour, _), &pixel)| *colour = picture[pixel]);
        }
        let colours: Vec<[u8; 4]> = samples.into_iter().map(|(colour, _)| colour).collect();
        edges.add(&colours, &mut self.pixels);
        self.edges = Some(edges);
    }

    /// Casts the rays that may see a change; returns their rectangle.
    fn cast(&mut self, inputs: &Inputs, shown: bool, view: &View, threads: usize) -> Option<[u32; 4]> {
        let (bricks, scene) = (inputs.bricks, inputs.scene);
        if !shown || !bricks.is_some() {
            self.rays.fill(Ray::NONE);
            self.recast.forget();
            return None;
        }
        let part = self.recast.part(view, scene.bone_cut, self.size)?;
        let [x, y, w, h] = part.map(|n| n as usize);
        let [columns, lines] = [w, h].map(|n| n.div_ceil(TILE));
        self.clear.resize(columns * lines, 0.0);
        rows::share(threads, rows::of(&mut self.clear, columns, 0..lines, 0..columns), |line, row| {
            let first = |n| [x + TILE * n, y + TILE * line];
            row.iter_mut().enumerate().for_each(|(n, far)| *far = clear(bricks, scene, first(n)));
        });
        let clears = &self.clear;
        let exact = |[at_x, at_y]: [usize; 2], around: &[Ray]| {
            cast(bricks, scene, [at_x, at_y], clears[(at_x - x) / TILE + columns * ((at_y - y) / TILE)], around)
        };
        let width = self.size[0] as usize;
        if bricks.casting.sparse && part[2..] == self.size[..] {
            let between = |at, around: &[Ray]| Ray::between(scene, at, around);
            let mut tiles = Tiles::of([w, h]);
            tiles.fill(true);
            rows::sparsely(threads, &mut self.rays, width, &tiles, exact, between);
        } else {
            rows::share(threads, rows::of(&mut self.rays, width, y..y + h, x..x + w), |y, row| {
                row.iter_mut().enumerate().for_each(|(n, ray)| *ray = exact([x + n, y], &[]));
            });
        }
        Some(part)
    }

    /// Shades every pixel of marked tiles.
    fn light(&mut self, inputs: &Inputs, brain: Option<&Border>, drawn: &LastPicture, threads: usize) {
        let [width, height] = self.size.map(|n| n as usize);
        let (rays, fragments, tiles) = (&self.rays, &self.fragments, &self.tiles);
        let exact = |[x, y]: [usize; 2], _: &[[u8; 4]]| {
            let at = x + width * y;
            light::fragment(inputs, [x, y], drawn.near([x, y]), &rays[at], &fragments.at(brain, at))
        };
        if !inputs.bricks.casting.sparse {
            return rows::share(threads, rows::of(&mut self.pixels, width, 0..height, 0..width), |y, row| {
                tiles.spans(y).flatten().for_each(|x| row[x] = exact([x, y], &[]));
            });
        }
        // Interpolates between colours of smooth, unoccluded bone or cortex.
        let bone = |at: usize| rays[at].t < fragments.t(brain, at);
        let plain = inputs.brain_paint.is_none();
        rows::sparsely(threads, &mut self.pixels, width, tiles, exact, |[x, y], around| {
            let at = x + width * y;
            let (aside, off) = (x % 2, y % 2 * width);
            let corners = [at - aside - off, at + aside - off, at - aside + off, at + aside + off];
            let cortex = |brain| {
                let look = (plain && are_alike(around)).then(|| fragments.even_look(brain, at, corners)).flatten();
                look.is_some_and(|look| !light::has_vessel(look)) && !bone(at) && !corners.into_iter().any(bone)
            };
            let smooth = drawn.near([x, y])[0] == [false; 2]
                && match rays[at].is_between() && bone(at) {
                    true => corners.into_iter().all(bone),
                    false => brain.is_some_and(cortex),
                };
            smooth.then(|| mean(around))
        });
    }

    /// Enlarges what was drawn anew into the picture; for an anaglyph all, and only green and blue,
    /// over the other eye's luminance.
    pub fn show(&mut self, picture: &mut Image, look: Option<StereoLook>, is_second: bool, threads: usize) {
        let [x, y, width, height] = self.area.map(|n| n as usize);
        let wide = picture.width as usize;
        let pixels = bytemuck::cast_slice_mut::<u8, [u8; 4]>(&mut picture.rgba);
        let enlarge = Enlarge::of(&self.pixels, self.size, [self.area[2], self.area[3]]);
        let in_one = look == Some(StereoLook::Anaglyph);
        if in_one {
            self.tiles.fill(true);
        }
        let tiles = &self.tiles;
        rows::share(tiles.threads(threads), rows::of(pixels, wide, y..y + height, x..x + width), |at, row| {
            if in_one && is_second {
                let mut seen = vec![[0; 4]; width];
                enlarge.row(at - y, 0..width, &mut seen);
                row.iter_mut().zip(seen).for_each(|(pixel, seen)| *pixel = anaglyph(*pixel, seen));
                return;
            }
            let [first, second] = enlarge.between(at - y);
            let beyond = (first / EDGE != second / EDGE).then_some(second);
            for columns in [first].into_iter().chain(beyond).flat_map(|line| tiles.spans(line)) {
                let columns = enlarge.reached(columns);
                enlarge.row(at - y, columns.clone(), &mut row[columns]);
            }
        });
    }
}

/// CPU version of `anaglyph.wgsl`.
fn anaglyph([r, g, b, _]: [u8; 4], right: [u8; 4]) -> [u8; 4] {
    let grey = 0.299 * f32::from(r) + 0.587 * f32::from(g) + 0.114 * f32::from(b);
    [grey.round() as u8, right[1], right[2], 255]
}

/// Difference of colours between which one may be interpolated, of 255, numerical.
const ALIKE: u8 = 10;

/// Whether two or four colours differ little.
fn are_alike(colours: &[[u8; 4]]) -> bool {
    let Some(first) = colours.first() else { return false };
    (0..3).all(|c| colours.iter().all(|colour| colour[c].abs_diff(first[c]) <= ALIKE))
}

/// The mean of two or four colours.
fn mean(colours: &[[u8; 4]]) -> [u8; 4] {
    let sum = |c: usize| colours.iter().map(|colour| u32::from(colour[c])).sum::<u32>();
    let count = colours.len() as u32;
    [0, 1, 2, 3].map(|c| ((sum(c) + count / 2) / count) as u8)
}
