//! Twin of `skull.wgsl`: the bone's isosurface at a pixel.

use super::bricks::{Bricks, under};
use crate::cut::height;
use crate::scene::Scene;
use crate::skull::NOTHING;
use glam::{Vec3, Vec4};

/// What a pixel's ray meets of the bone.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ray {
    /// Distance, mm, or [`NOTHING`].
    pub t: f32,
    /// Bricks, cells and samples looked at.
    pub steps: u32,
    /// Unit, outwards.
    pub normal: Vec3,
    /// Ambient light that gets there.
    pub open: f32,
    /// Whether the lamp's light gets there.
    pub lit: bool,
}

impl Ray {
    pub const NONE: Self = Self { t: NOTHING, steps: 0, normal: Vec3::Z, open: 1.0, lit: false };
}

/// Pixels along an edge of a tile.
pub(crate) const TILE: usize = 8;

/// Distance up to which no ray of the tile with this first pixel meets bone.
pub(crate) fn clear(bricks: &Bricks, scene: &Scene, [x, y]: [usize; 2]) -> f32 {
    let far = TILE - 1;
    let corners = [[x, y], [x + far, y], [x, y + far], [x + far, y + far]].map(|[x, y]| scene.ray_of(x, y));
    let middle = corners.iter().sum::<Vec3>().normalize();
    let spread = corners.iter().map(|c| c.distance(middle)).fold(0.0, f32::max);
    let spacing = bricks.grid.spacing_mm;
    bricks.clear(bricks.grid_of(scene.eye.truncate()), middle / spacing, 1.01 * spread / spacing)
}

/// The ray of a pixel, which meets no bone before `from`, mm.
pub(crate) fn cast(bricks: &Bricks, scene: &Scene, [x, y]: [usize; 2], from: f32) -> Ray {
    if from >= NOTHING {
        return Ray::NONE;
    }
    let (along, eye) = (scene.ray_of(x, y), scene.eye.truncate());
    let o = bricks.grid_of(eye);
    let d = along / bricks.grid.spacing_mm;
    let [near, far] = under(scene.bone_cut, eye, along);
    let (t, steps) = bricks.trace(o, d, near.max(from), far);
    if t >= NOTHING {
        return Ray { steps, ..Ray::NONE };
    }
    let g = o + d * t;
    let normal = if on_cut(scene.bone_cut, eye + t * along) {
        scene.bone_cut.truncate()
    } else {
        bricks.outward_normal(g, along)
    };
    let lit = normal.dot(scene.light.truncate()) > 0.0 && !bricks.shadowed(g, normal, scene);
    Ray { t, steps, normal, open: 0.999 * bricks.openness(g, normal, scene.bone_cut), lit }
}

/// Whether a point that a ray has met is where bone is cut.
fn on_cut(bone_cut: Vec4, point: Vec3) -> bool {
    bone_cut.truncate() != Vec3::ZERO && height(bone_cut, point).abs() < 0.01
}
