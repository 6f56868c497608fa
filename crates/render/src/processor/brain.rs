//! Twin of `brain.wgsl`: the brain's border as triangles with smooth normals.

use crate::brain::Border;
use crate::camera::View;
use crate::skull::NOTHING;
use glam::{Vec2, Vec3};

/// The nearest triangle at every pixel.
#[derive(Clone, Debug, Default)]
pub(crate) struct Fragments {
    width: usize,
    height: usize,
    nearest: Vec<Fragment>,
}

/// The brain at a pixel.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Fragment {
    depth: f32,
    /// Distance along the ray, mm, or [`NOTHING`].
    pub t: f32,
    pub normal: Vec3,
    /// The place at rest, world mm.
    pub rest: Vec3,
}

const NONE: Fragment = Fragment { depth: f32::INFINITY, t: NOTHING, normal: Vec3::Z, rest: Vec3::ZERO };

impl Fragments {
    pub fn of(width: usize, height: usize) -> Self {
        Self { width, height, nearest: vec![NONE; width * height] }
    }

    pub fn at(&self, pixel: usize) -> &Fragment {
        &self.nearest[pixel]
    }

    /// Draws the border anew; none clears.
    pub fn draw(&mut self, border: Option<&Border>, view: &View) {
        self.nearest.fill(NONE);
        let Some(border) = border else { return };
        let size = Vec2::new(self.width as f32, self.height as f32);
        let projected: Vec<(Vec2, f32)> = border
            .places
            .iter()
            .map(|&p| {
                let (at, depth) = view.project(p);
                ((Vec2::new(at.x, -at.y) * 0.5 + 0.5) * size, depth)
            })
            .collect();
        for corners in &border.triangles {
            let points = corners.map(|n| projected[n as usize]);
            if points.iter().all(|p| p.1 > View::NEAR_MM) {
                self.triangle(border, corners, &points, view.eye);
            }
        }
    }

    fn triangle(&mut self, border: &Border, corners: &[u32; 3], points: &[(Vec2, f32); 3], eye: Vec3) {
        let [a, b, c] = points.map(|p| p.0);
        let double_area = (b - a).perp_dot(c - a);
        let low = a.min(b).min(c).floor().max(Vec2::ZERO);
        let high = a.max(b).max(c).ceil().min(Vec2::new(self.width as f32, self.height as f32));
        if double_area == 0.0 {
            return;
        }
        for y in low.y as usize..high.y.max(0.0) as usize {
            for x in low.x as usize..high.x.max(0.0) as usize {
                let p = Vec2::new(x as f32 + 0.5, y as f32 + 0.5);
                let flat = [(c - b).perp_dot(p - b), (a - c).perp_dot(p - c), (b - a).perp_dot(p - a)]
                    .map(|w| w / double_area);
                if flat.iter().any(|&w| w < 0.0) {
                    continue;
                }
                // What is linear in space is linear in the picture after a division by depth.
                let over = [0, 1, 2].map(|n| flat[n] / points[n].1);
                let depth = 1.0 / over.iter().sum::<f32>();
                let fragment = &mut self.nearest[x + self.width * y];
                if depth < fragment.depth {
                    let mean =
                        |value: &dyn Fn(u32) -> Vec3| (0..3).map(|n| over[n] * depth * value(corners[n])).sum::<Vec3>();
                    let place = mean(&|n| border.places[n as usize]);
                    let normal = mean(&|n| border.normals[n as usize]).normalize_or(Vec3::Z);
                    *fragment = Fragment { depth, t: place.distance(eye), normal, rest: mean(&|n| border.at_rest(n)) };
                }
            }
        }
    }
}
