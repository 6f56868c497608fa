//! CPU version of `brain.wgsl`: the brain's triangles with smooth normals.
//!
//! # Practice
//! First the nearest triangle at each pixel is found, then what is seen of it, where it is seen: a
//! cortex has half a million triangles, a picture shows a tenth of them.

use super::rows;
use super::tiles::{EDGE, Tiles};
use crate::border::Border;
use crate::bricks::NOTHING;
use crate::camera::View;
use crate::chunks::Chunk;
use crate::cut::height;
use crate::mix::{greater, lesser};
use crate::section::{self, Corner};
use glam::{Vec2, Vec3, Vec4};
use rayon::prelude::*;
use std::ops::Range;

/// The nearest triangle at every pixel.
#[derive(Clone, Debug, Default)]
pub(crate) struct Fragments {
    width: usize,
    height: usize,
    nearest: Vec<Meeting>,
    /// Whether the last picture had a brain.
    drawn: bool,
    /// The brain's vertices in the view.
    vertices: Vec<Vertex>,
    /// Lower and upper corner of each chunk of triangles in the view, pixels.
    boxes: Vec<[Vec2; 2]>,
    /// Triangles of the cut, after those of the brain.
    cut: Vec<[Corner; 3]>,
    first_cut: u32,
    plane: Vec4,
    eye: Vec3,
}

/// Which triangle is seen at a pixel, and where on it.
#[derive(Clone, Copy, Debug)]
struct Meeting {
    /// One over its depth, 1/mm; 0 where none is.
    nearness: f32,
    /// Its number, and [`BACK`] if it turns its back.
    triangle: u32,
    /// Weights of the second and the third corner.
    weights: [f32; 2],
}

/// Bands of rows for each thread, numerical: a thread that comes late leaves its bands to others.
const BANDS: usize = 2;

/// The bit of what turns its back where a closed cortex is cut: the cut is seen there.
const BACK: u32 = 1 << 31;

/// Share of its depth by which a surface that goes on evenly leaves the plane of its neighbours,
/// numerical: 0.1 mm at the operating distance.
const EVEN: f32 = 5e-4;

const NOWHERE: Meeting = Meeting { nearness: 0.0, triangle: 0, weights: [0.0; 2] };

/// The brain at a pixel.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Fragment {
    /// Distance along the ray, mm, or [`NOTHING`].
    pub t: f32,
    pub normal: Vec3,
    /// The rest position, world mm.
    pub rest: Vec3,
    /// Whether this is the cut surface.
    pub cut: bool,
    /// Blood, mm; towards -1 a burn.
    pub stain: f32,
    /// Light of the surroundings, 0 to 1.
    pub open: f32,
    /// Ways to a vein, an artery and a branch, of 2 mm.
    pub ways: Vec3,
}

const NONE: Fragment =
    Fragment { t: NOTHING, normal: Vec3::Z, rest: Vec3::ZERO, cut: false, stain: 0.0, open: 1.0, ways: Vec3::ONE };

/// A vertex in the view.
#[derive(Clone, Copy, Debug)]
struct Vertex {
    /// Place in the picture, pixels from the upper left.
    at: Vec2,
    /// One over its depth, 1/mm; 0 where it is not before the eye.
    nearness: f32,
}

impl Vertex {
    /// Projects a point into a view of so many pixels.
    fn seen(view: &View, size: Vec2, place: Vec3) -> Self {
        let (at, depth) = view.project(place);
        let nearness = if depth > View::NEAR_MM { 1.0 / depth } else { 0.0 };
        Self { at: (Vec2::new(at.x, -at.y) * 0.5 + 0.5) * size, nearness }
    }
}

impl Fragments {
    pub fn of(width: usize, height: usize) -> Self {
        Self { width, height, nearest: vec![NOWHERE; width * height], ..Self::default() }
    }

    /// One over the depth at a pixel, 1/mm; 0 where nothing is seen.
    pub fn nearness(&self, pixel: usize) -> f32 {
        let Meeting { nearness, triangle, .. } = self.nearest[pixel];
        if triangle & BACK == 0 { nearness } else { 0.0 }
    }

    /// Distance along the ray at a pixel, mm, or [`NOTHING`].
    pub fn t(&self, brain: Option<&Border>, pixel: usize) -> f32 {
        let Meeting { nearness, triangle, weights: [v, w] } = self.nearest[pixel];
        let Some(brain) = brain.filter(|_| nearness > 0.0 && triangle & BACK == 0) else { return NOTHING };
        if triangle >= self.first_cut {
            return self.at(Some(brain), pixel).t;
        }
        let corners = brain.triangles[triangle as usize].map(|n| brain.places[n as usize]);
        ((1.0 - v - w) * corners[0] + v * corners[1] + w * corners[2]).distance(self.eye)
    }

    /// The look of the cortex at a pixel, if it goes on evenly there between others.
    pub fn even_look(&self, brain: &Border, pixel: usize, others: [usize; 4]) -> Option<Vec4> {
        let Meeting { nearness, triangle, weights: [v, w] } = self.nearest[pixel];
        // What is cut or turns its back has larger numbers.
        let is_cortex = |n: &usize| self.nearest[*n].nearness > 0.0 && (self.nearest[*n].triangle as usize) < brain.own;
        let mean = 0.25 * others.iter().map(|n| self.nearest[*n].nearness).sum::<f32>();
        let is_even = (mean - nearness).abs() < EVEN * nearness && is_cortex(&pixel) && others.iter().all(is_cortex);
        let corners = is_even.then(|| brain.triangles[triangle as usize])?;
        let looks = corners.map(|n| brain.looks[n as usize]);
        Some((1.0 - v - w) * looks[0] + v * looks[1] + w * looks[2])
    }

    /// What is seen at a pixel of the brain that was drawn last.
    pub fn at(&self, brain: Option<&Border>, pixel: usize) -> Fragment {
        let Meeting { nearness, triangle, weights: [v, w] } = self.nearest[pixel];
        let Some(brain) = brain.filter(|_| nearness > 0.0 && triangle & BACK == 0) else { return NONE };
        let weights = [1.0 - v - w, v, w];
        let mean = |of: &[Vec3], corners: [u32; 3]| (0..3).map(|k| weights[k] * of[corners[k] as usize]).sum::<Vec3>();
        if let Some(at) = triangle.checked_sub(self.first_cut) {
            let corners = &self.cut[at as usize];
            let of = |value: fn(&Corner) -> Vec3| (0..3).map(|k| weights[k] * value(&corners[k])).sum::<Vec3>();
            let t = of(|c| c.place).distance(self.eye);
            return Fragment { t, normal: self.plane.truncate(), rest: of(|c| c.rest), cut: true, ..NONE };
        }
        let corners = brain.triangles[triangle as usize];
        let look: Vec4 = (0..3).map(|k| weights[k] * brain.looks[corners[k] as usize]).sum();
        Fragment {
            t: mean(&brain.places, corners).distance(self.eye),
            normal: mean(&brain.normals, corners).normalize_or(Vec3::Z),
            rest: mean(&brain.at_rest, corners),
            cut: false,
            stain: (0..3).map(|k| weights[k] * brain.stains[corners[k] as usize]).sum(),
            open: look.w,
            ways: look.truncate(),
        }
    }

    /// Redraws the boundary and its cut; `None` clears.
    ///
    /// In a view that was drawn before only what changed is drawn again: its tiles are marked.
    pub fn draw(
        &mut self,
        border: Option<&Border>,
        view: &View,
        brain_cut: Vec4,
        threads: usize,
        known: Option<&mut Tiles>,
    ) {
        let mut tiles = Tiles::of([self.width, self.height]);
        // Where most changed, finding out where takes longer than to draw all of it.
        let all = known.is_none() || border.is_some_and(|border| border.changes.are_most(border.triangles.len()));
        if std::mem::replace(&mut self.drawn, border.is_some()) && all {
            self.mark_seen(&mut tiles);
            self.nearest.fill(NOWHERE);
        }
        let Some(border) = border else { return };
        (self.plane, self.eye, self.first_cut) = (brain_cut, view.eye, border.triangles.len() as u32);
        self.cut.clear();
        if brain_cut != Vec4::ZERO {
            self.cut.extend(section::triangles(brain_cut, border));
        }
        if all {
            self.project(border, view);
            self.rasterise(border, view, threads, None);
            self.mark_seen(&mut tiles);
        } else {
            self.follow(border, view, &mut tiles);
            if tiles.marks().contains(&true) {
                self.rasterise(border, view, threads, Some(&tiles));
            }
        }
        known.into_iter().for_each(|known| known.join(&tiles));
    }

    /// Marks the tiles in which the brain is seen.
    fn mark_seen(&self, tiles: &mut Tiles) {
        for (y, row) in self.nearest.chunks_exact(self.width.max(1)).enumerate() {
            for (column, part) in row.chunks(EDGE).enumerate() {
                if part.iter().any(|meeting| meeting.nearness > 0.0) {
                    tiles.mark_rectangle([EDGE * column, y, EDGE * column + 1, y + 1]);
                }
            }
        }
    }

    /// Projects all vertices.
    fn project(&mut self, border: &Border, view: &View) {
        let size = Vec2::new(self.width as f32, self.height as f32);
        let seen = |place: &Vec3| Vertex::seen(view, size, *place);
        border.places.par_iter().map(seen).collect_into_vec(&mut self.vertices);
        let vertices = &self.vertices;
        border.chunks.par_iter().map(|chunk| around(chunk, vertices)).collect_into_vec(&mut self.boxes);
    }

    /// Projects the vertices that moved; marks where a triangle looks different.
    fn follow(&mut self, border: &Border, view: &View, tiles: &mut Tiles) {
        let changes = &border.changes;
        self.mark(border, tiles);
        let size = Vec2::new(self.width as f32, self.height as f32);
        let moved = changes.moved.iter().zip(&border.places);
        for (vertex, (_, place)) in self.vertices.iter_mut().zip(moved).filter(|(_, (moved, _))| **moved) {
            *vertex = Vertex::seen(view, size, *place);
        }
        self.mark(border, tiles);
        let mut next = 0;
        for (chunk, bounds) in border.chunks.iter().zip(&mut self.boxes) {
            let some = changes.triangles[next..].iter().take_while(|n| (**n as usize) < chunk.triangles.end).count();
            next += some;
            if some > 0 {
                *bounds = around(chunk, &self.vertices);
            }
        }
    }

    /// Marks where the triangles that look different are seen.
    fn mark(&self, border: &Border, tiles: &mut Tiles) {
        for &n in &border.changes.triangles {
            let corners = border.triangles[n as usize].map(|n| &self.vertices[n as usize]);
            let [a, b, c] = corners.map(|v| v.at);
            let is_back = (b - a).perp_dot(c - a) > 0.0;
            let is_hidden = is_back && border.is_closed() && (n as usize) < border.own;
            if !is_hidden && corners.iter().all(|v| v.nearness > 0.0) {
                tiles.mark(a.min(b).min(c), a.max(b).max(c));
            }
        }
    }

    /// Draws all triangles, or those that meet marked tiles.
    fn rasterise(&mut self, border: &Border, view: &View, threads: usize, tiles: Option<&Tiles>) {
        let threads = tiles.map_or(threads, |tiles| tiles.threads(threads));
        let size = Vec2::new(self.width as f32, self.height as f32);
        let is_seen = |[low, high]: &[Vec2; 2]| {
            let is_inside = low.x < size.x && low.y < size.y && high.x > 0.0 && high.y > 0.0;
            is_inside && tiles.is_none_or(|tiles| tiles.meet(*low, *high))
        };
        let chunks = border.chunks.iter().zip(&self.boxes).filter(|(_, bounds)| is_seen(bounds));
        let chunks: Vec<(Range<usize>, [Vec2; 2])> = chunks.map(|(c, bounds)| (c.triangles.clone(), *bounds)).collect();
        let brain_cut = self.plane;
        let (vertices, cut) = (&self.vertices, &self.cut);
        let count = if threads > 1 { BANDS * threads } else { 1 };
        let ends = bands(chunks.iter().map(|(_, [low, high])| 0.5 * (low.y + high.y)), self.height, count);
        let mut nearest = &mut self.nearest[..];
        let parts = ends.windows(2).map(|ends| {
            let (part, rest) = std::mem::take(&mut nearest).split_at_mut(self.width * (ends[1] - ends[0]));
            nearest = rest;
            (ends[0], part)
        });
        let parts: Vec<(usize, &mut [Meeting])> = parts.collect();
        rows::share(threads, parts.into_iter(), |first, part| {
            let rows = first..first + part.len() / self.width.max(1);
            let (start, end) = (rows.start as f32, rows.end as f32);
            if let Some(tiles) = tiles {
                for (y, row) in rows.clone().zip(part.chunks_exact_mut(self.width)) {
                    tiles.spans(y).for_each(|span| row[span].fill(NOWHERE));
                }
            }
            let mut band = Band { width: self.width, rows, nearest: part, tiles };
            let seen = chunks.iter().filter(|(_, [low, high])| low.y < end && start < high.y);
            for n in seen.flat_map(|(triangles, _)| triangles.clone()) {
                let corners = border.triangles[n].map(|n| n as usize);
                // What turns its back is hidden by what is before it, or shows that it was cut.
                let side = match border.is_closed() && n < border.own {
                    true if brain_cut == Vec4::ZERO => Side::Front,
                    true => Side::Marked,
                    false => Side::Both,
                };
                band.triangle(n as u32, corners.map(|n| &vertices[n]), side, |weights| {
                    let place = (0..3).map(|k| weights[k] * border.places[corners[k]]).sum();
                    brain_cut == Vec4::ZERO || height(brain_cut, place) <= 0.0
                });
            }
            for (n, corners) in (self.first_cut..).zip(cut) {
                let corners = corners.map(|corner| Vertex::seen(view, size, corner.place));
                let side = if border.is_closed() { Side::Cut } else { Side::Both };
                band.triangle(n, corners.each_ref(), side, |_| true);
            }
        });
    }
}

/// The box around a chunk's triangles in the view, without what is behind the eye.
fn around(chunk: &Chunk, vertices: &[Vertex]) -> [Vec2; 2] {
    let corners = chunk.vertices.iter().map(|n| &vertices[*n as usize]);
    let before = corners.filter(|vertex| vertex.nearness > 0.0 && vertex.at.is_finite());
    let least = |a: Vec2, b: Vec2| Vec2::new(lesser(a.x, b.x), lesser(a.y, b.y));
    let most = |a: Vec2, b: Vec2| Vec2::new(greater(a.x, b.x), greater(a.y, b.y));
    before.fold([Vec2::INFINITY, Vec2::NEG_INFINITY], |[low, high], v| [least(low, v.at), most(high, v.at)])
}

/// Rows at which so many bands begin and end, with as many chunks each.
fn bands(middles: impl Iterator<Item = f32>, height: usize, count: usize) -> Vec<usize> {
    let mut rows: Vec<f32> = middles.collect();
    rows.sort_unstable_by(f32::total_cmp);
    let middle = |n: usize| rows.get(n * rows.len() / count).copied().unwrap_or(0.0);
    let mut ends: Vec<usize> = (1..count).map(|n| (middle(n).max(0.0) as usize).min(height)).collect();
    ends.insert(0, 0);
    ends.push(height);
    ends
}

/// Which side of a triangle is drawn, and how.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Side {
    Both,
    Front,
    /// Both, the back with a mark.
    Marked,
    /// Both, where a marked back would be seen.
    Cut,
}

/// Some rows of the picture.
struct Band<'a> {
    width: usize,
    rows: Range<usize>,
    nearest: &'a mut [Meeting],
    /// The tiles that are drawn; all if `None`. In others a triangle changes nothing.
    tiles: Option<&'a Tiles>,
}

impl Band<'_> {
    /// Draws a triangle where it is the nearest so far and `is_left`, by the weights of its
    /// corners.
    fn triangle(&mut self, number: u32, corners: [&Vertex; 3], side: Side, is_left: impl Fn([f32; 3]) -> bool) {
        let [a, b, c] = corners.map(|v| v.at);
        let double_area = (b - a).perp_dot(c - a);
        // Pictures have y downwards: what faces the eye is clockwise. Degenerate triangles and
        // those with a non-finite position are skipped.
        let is_back = double_area > 0.0;
        if is_back && side == Side::Front || double_area == 0.0 || !double_area.is_finite() {
            return;
        }
        let (low, high) = (a.min(b).min(c), a.max(b).max(c));
        if self.tiles.is_some_and(|tiles| !tiles.meet(low, high)) {
            return;
        }
        let lines = first(low.y).max(self.rows.start)..past(high.y).min(self.rows.end);
        let columns = first(low.x)..past(high.x).min(self.width);
        if lines.is_empty() || columns.is_empty() || corners.iter().any(|v| v.nearness <= 0.0) {
            return;
        }
        let edges = [(b, c - b), (c, a - c), (a, b - a)];
        let (least, sign) = (Vec4::ZERO, Vec4::splat(double_area.signum()));
        // Perspective-correct interpolation: attributes are divided by depth.
        let scales = corners.map(|corner| corner.nearness / double_area);
        let mark = if is_back && side == Side::Marked { BACK } else { 0 };
        for y in lines {
            let line = y as i32 as f32 + 0.5;
            let row = &mut self.nearest[self.width * (y - self.rows.start)..][..self.width];
            for first in columns.clone().step_by(4) {
                let middles = Vec4::splat(first as i32 as f32) + Vec4::new(0.5, 1.5, 2.5, 3.5);
                // Twice the area between each edge and the middles of four pixels.
                let twice = edges.map(|(from, to)| Vec4::splat(to.x * (line - from.y)) - to.y * (middles - from.x));
                let [a, b, c] = twice.map(|w| (w * sign).cmplt(least));
                let row = &mut row[first..columns.end.min(first + 4)];
                let mut seen = !(a | b | c).bitmask() & ((1 << row.len()) - 1);
                if seen == 0 {
                    continue;
                }
                let over = [0, 1, 2].map(|n| twice[n] * scales[n]);
                let nearness = over[0] + over[1] + over[2];
                if side != Side::Cut {
                    let before = Vec4::from([0, 1, 2, 3].map(|n| row.get(n).map_or(0.0, |m| m.nearness)));
                    seen &= nearness.cmpgt(before).bitmask();
                }
                while seen != 0 {
                    let lane = seen.trailing_zeros() as usize;
                    seen &= seen - 1;
                    let nearest = &mut row[lane];
                    let is_hidden = side == Side::Cut && (nearest.triangle & BACK == 0 || nearest.nearness <= 0.0);
                    let weights = over.map(|over| over[lane] / nearness[lane]);
                    if !is_hidden && is_left(weights) {
                        let weights = [weights[1], weights[2]];
                        *nearest = Meeting { nearness: nearness[lane], triangle: number | mark, weights };
                    }
                }
            }
        }
    }
}

/// The first pixel with its middle at or after a place; none is before the picture.
fn first(at: f32) -> usize {
    let floor = (at - 0.5) as usize;
    floor + usize::from((floor as f32) < at - 0.5)
}

/// The pixel after the last one with its middle at or before a place.
fn past(at: f32) -> usize {
    (at + 0.5) as usize
}
