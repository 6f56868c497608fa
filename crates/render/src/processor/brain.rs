//! CPU version of `brain.wgsl`: the brain's boundary triangles with smooth normals.

use crate::border::Border;
use crate::bricks::NOTHING;
use crate::camera::View;
use crate::cut::height;
use crate::section::{self, Corner};
use glam::{Vec2, Vec3, Vec4};

/// The nearest triangle at every pixel.
#[derive(Clone, Debug, Default)]
pub(crate) struct Fragments {
    width: usize,
    height: usize,
    nearest: Vec<Fragment>,
    drawn: bool,
}

/// The brain at a pixel.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Fragment {
    depth: f32,
    /// Distance along the ray, mm, or [`NOTHING`].
    pub t: f32,
    pub normal: Vec3,
    /// The rest position, world mm.
    pub rest: Vec3,
    /// Whether this is the cut surface.
    pub cut: bool,
    /// Blood, mm; towards -1 a burn.
    pub stain: f32,
}

const NONE: Fragment =
    Fragment { depth: f32::INFINITY, t: NOTHING, normal: Vec3::Z, rest: Vec3::ZERO, cut: false, stain: 0.0 };

impl Fragments {
    pub fn of(width: usize, height: usize) -> Self {
        Self { width, height, nearest: vec![NONE; width * height], drawn: false }
    }

    pub fn at(&self, pixel: usize) -> &Fragment {
        &self.nearest[pixel]
    }

    /// Redraws the boundary and its cut; `None` clears.
    pub fn draw(&mut self, border: Option<&Border>, view: &View, brain_cut: Vec4) {
        if std::mem::replace(&mut self.drawn, border.is_some()) {
            self.nearest.fill(NONE);
        }
        let Some(border) = border else { return };
        let vertex = |n: u32| {
            let place = border.places[n as usize];
            let (normal, stain) = (border.normals[n as usize], border.stains[n as usize]);
            Vertex { normal, stain, rest: border.at_rest(n), ..Vertex::seen(view, place) }
        };
        let vertices: Vec<Vertex> = (0..border.places.len() as u32).map(vertex).collect();
        for corners in &border.triangles {
            self.triangle(corners.map(|n| &vertices[n as usize]), view.eye, Some(brain_cut));
        }
        if brain_cut != Vec4::ZERO {
            let corner =
                |c: Corner| Vertex { normal: brain_cut.truncate(), rest: c.rest, ..Vertex::seen(view, c.place) };
            for corners in section::triangles(brain_cut, border) {
                let corners = corners.map(corner);
                self.triangle(corners.each_ref(), view.eye, None);
            }
        }
    }

    /// Draws a triangle of the boundary, clipped by the plane `under`, or of the cut.
    fn triangle(&mut self, corners: [&Vertex; 3], eye: Vec3, under: Option<Vec4>) {
        let [a, b, c] = corners.map(|v| v.at * Vec2::new(self.width as f32, self.height as f32));
        let double_area = (b - a).perp_dot(c - a);
        // Skips degenerate triangles and those with a non-finite position.
        if !corners.iter().all(|v| v.depth > View::NEAR_MM) || double_area == 0.0 || !double_area.is_finite() {
            return;
        }
        let low = a.min(b).min(c).floor().max(Vec2::ZERO);
        let high = a.max(b).max(c).ceil().min(Vec2::new(self.width as f32, self.height as f32));
        for y in low.y as usize..high.y.max(0.0) as usize {
            for x in low.x as usize..high.x.max(0.0) as usize {
                let p = Vec2::new(x as f32 + 0.5, y as f32 + 0.5);
                let flat = [(c - b).perp_dot(p - b), (a - c).perp_dot(p - c), (b - a).perp_dot(p - a)]
                    .map(|w| w / double_area);
                if flat.iter().any(|&w| w < 0.0) {
                    continue;
                }
                // Perspective-correct interpolation: attributes are divided by depth.
                let over = [0, 1, 2].map(|n| flat[n] / corners[n].depth);
                let depth = 1.0 / over.iter().sum::<f32>();
                let fragment = &mut self.nearest[x + self.width * y];
                if depth >= fragment.depth {
                    continue;
                }
                let mean =
                    |value: fn(&Vertex) -> Vec3| (0..3).map(|n| over[n] * depth * value(corners[n])).sum::<Vec3>();
                let place = mean(|v| v.place);
                if under.is_none_or(|plane| height(plane, place) <= 0.0) {
                    let normal = mean(|v| v.normal).normalize_or(Vec3::Z);
                    let (t, rest) = (place.distance(eye), mean(|v| v.rest));
                    let stain = (0..3).map(|n| over[n] * depth * corners[n].stain).sum();
                    *fragment = Fragment { depth, t, normal, rest, cut: under.is_none(), stain };
                }
            }
        }
    }
}

/// A corner of a triangle.
#[derive(Clone, Copy, Debug)]
struct Vertex {
    /// Picture coordinates, 0 to 1 from the upper left.
    at: Vec2,
    depth: f32,
    place: Vec3,
    normal: Vec3,
    rest: Vec3,
    stain: f32,
}

impl Vertex {
    /// Projects a point into the view.
    fn seen(view: &View, place: Vec3) -> Self {
        let (at, depth) = view.project(place);
        let at = Vec2::new(at.x, -at.y) * 0.5 + 0.5;
        Self { at, depth, place, normal: Vec3::ZERO, rest: Vec3::ZERO, stain: 0.0 }
    }
}
