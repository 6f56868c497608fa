//! Layers of the surface seen along one axis through a small picture around the tool.
//!
//! # Theory
//! Heidelberger, Teschner and Gross 2003: the surface in a volume of interest is rendered into a
//! layered depth image, each pixel a sorted list of where its ray enters and leaves. A point is
//! inside when its pixel has more entries than exits before it. The tetrahedron is found by a walk
//! from behind the nearest layer.
//!
//! ```text
//!   ray of a pixel ───▶ enter ▓▓▓▓▓ leave   enter ▓▓•▓▓ leave    • inside: 2 in, 1 out before
//! ```
//!
//! # Practice
//! All border triangles are read in each step. No picture is more exact than its pixels: near the
//! surface a point may be taken for one outside.
//!
//! # When not to use it
//! Where no point may be missed; on a surface that crosses itself.
//!
//! # Sources
//! Heidelberger et al. 2003, section 4 (layered depth image) and 5.2 (vertex in volume).
//! Liberties: on the processor instead of the graphics card; the rays go along z through the whole
//! body, so that nothing has to close the volume of interest.

use trepan_deformable::Descriptor;
use trepan_deformable::Search;
use trepan_deformable::kit::Extent;
use trepan_deformable::kit::MovingSurface;
use trepan_deformable::kit::Scene;
use trepan_deformable::kit::walk;
use trepan_deformable::kit::{Hits, NONE};
use trepan_geometry::Vec3;

/// Pixels along a side, and most layers of one.
const SIDE: usize = 24;
const LAYERS: usize = 8;

/// Where the ray of a pixel crosses the surface.
#[derive(Clone, Copy)]
struct Layer {
    z: f32,
    /// 1 where it enters, -1 where it leaves.
    turn: i32,
    tet: u32,
}

struct ImageSpace {
    pixels: Vec<[Layer; LAYERS]>,
    counts: Vec<u8>,
}

impl Search for ImageSpace {
    fn find(&mut self, scene: &Scene, surface: &mut MovingSurface, hits: &mut Hits) {
        let mut seen = Extent::of(scene.points);
        if !seen.low.cmple(seen.high).all() {
            return;
        }
        (seen.low.z, seen.high.z) = (f32::NEG_INFINITY, f32::INFINITY);
        let (origin, size) = (Vec3::from(seen.low), Vec3::from(seen.high - seen.low).max(Vec3::splat(1e-6)));
        let scale = SIDE as f32 / size.x.max(size.y);
        self.counts.fill(0);
        for (nodes, &tet) in surface.triangles.iter().zip(&surface.tet_of_triangle) {
            let corners = nodes.map(|n| scene.positions[n as usize]);
            if Extent::of(&corners).overlaps(&seen) && corners.iter().all(|c| c.is_finite()) {
                let to_pixels = |c: Vec3| Vec3::new((c.x - origin.x) * scale, (c.y - origin.y) * scale, c.z);
                hits.overflow += self.draw(corners.map(to_pixels), tet);
            }
        }
        for (i, p) in scene.points.iter().enumerate().filter(|(_, p)| p.is_finite()) {
            let at = |x: f32| ((x * scale) as usize).min(SIDE - 1);
            let pixel = at(p.y - origin.y) * SIDE + at(p.x - origin.x);
            let layers = &self.pixels[pixel][..usize::from(self.counts[pixel])];
            let inside: i32 = layers.iter().filter(|layer| layer.z <= p.z).map(|layer| layer.turn).sum();
            let away = |layer: &Layer| (layer.z - p.z).abs();
            let nearest = layers.iter().min_by(|a, b| away(a).total_cmp(&away(b)));
            if let Some(nearest) = nearest.filter(|_| inside > 0) {
                walk(scene, i, nearest.tet, hits);
            }
        }
        self.spread(scene, hits);
    }
}

impl ImageSpace {
    /// Adds a layer to each pixel whose centre a triangle covers; returns how many did not fit.
    fn draw(&mut self, [a, b, c]: [Vec3; 3], tet: u32) -> u32 {
        let area = cross(b - a, c - a);
        let (low, high) = (a.min(b).min(c), a.max(b).max(c));
        let first = |x: f32| (x - 0.5).ceil().clamp(0.0, SIDE as f32) as usize;
        let mut overflow = 0;
        if area == 0.0 {
            return 0;
        }
        for y in first(low.y)..first(high.y) {
            for x in first(low.x)..first(high.x) {
                let p = Vec3::new(x as f32 + 0.5, y as f32 + 0.5, 0.0);
                let (u, v) = (cross(p - a, c - a) / area, cross(b - a, p - a) / area);
                if u < 0.0 || v < 0.0 || u + v > 1.0 {
                    continue;
                }
                let (z, pixel) = (a.z + u * (b.z - a.z) + v * (c.z - a.z), y * SIDE + x);
                let count = usize::from(self.counts[pixel]);
                match self.pixels[pixel].get_mut(count) {
                    // Outward triangles look down where the ray enters.
                    Some(layer) => *layer = Layer { z, turn: if area < 0.0 { 1 } else { -1 }, tet },
                    None => overflow += 1,
                }
                self.counts[pixel] = (count + 1).min(LAYERS) as u8;
            }
        }
        overflow
    }

    /// Points that the picture did not place start from the one before that has a place.
    fn spread(&self, scene: &Scene, hits: &mut Hits) {
        let mut start = NONE;
        for i in 0..scene.points.len() {
            if hits.tet[i] == NONE && start != NONE {
                walk(scene, i, start, hits);
            }
            start = if hits.tet[i] == NONE { start } else { hits.tet[i] };
        }
    }
}

/// z of a cross product.
fn cross(a: Vec3, b: Vec3) -> f32 {
    a.x * b.y - a.y * b.x
}

/// The layered picture.
pub const METHOD: Descriptor = Descriptor {
    is_complete: false,
    ..Descriptor::of("image-space", "Heidelberger et al. 2003", |_| {
        let none = Layer { z: 0.0, turn: 0, tet: NONE };
        Box::new(ImageSpace { pixels: vec![[none; LAYERS]; SIDE * SIDE], counts: vec![0; SIDE * SIDE] })
    })
};
