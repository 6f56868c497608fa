//! CPU version of `skull.wgsl`: the bone's isosurface at a pixel.

use super::bricks::{Bricks, under};
use super::drilled::{Surface, lift};
use crate::bricks::NOTHING;
use crate::cut::height;
use crate::scene::Scene;
use glam::{Vec3, Vec4};

/// The bone hit of a pixel's ray.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ray {
    /// Distance, mm, or [`NOTHING`].
    pub t: f32,
    /// Bricks, cells and samples visited; 0 where the hit was interpolated.
    pub steps: u32,
    /// Unit normal, outwards.
    pub normal: Vec3,
    /// Height of the surface's tangent plane over the eye along its normal, mm.
    pub plane: f32,
    /// Fraction of ambient light that reaches the point.
    pub open: f32,
    /// Whether the lamp's light reaches the point.
    pub lit: bool,
}

impl Ray {
    pub const NONE: Self = Self { t: NOTHING, steps: 0, normal: Vec3::Z, plane: 0.0, open: 1.0, lit: false };
}

/// Pixels along an edge of a tile.
pub(crate) const TILE: usize = 8;

/// Distance up to which no ray of the tile with this first pixel hits bone.
pub(crate) fn clear(bricks: &Bricks, scene: &Scene, [x, y]: [usize; 2]) -> f32 {
    let far = TILE - 1;
    let corners = [[x, y], [x + far, y], [x, y + far], [x + far, y + far]].map(|[x, y]| scene.ray_of(x, y));
    let middle = corners.iter().sum::<Vec3>().normalize();
    let spread = corners.iter().map(|c| c.distance(middle)).fold(0.0, f32::max);
    let spacing = bricks.grid.spacing_mm;
    bricks.clear(bricks.grid_of(scene.eye.truncate()), middle / spacing, 1.01 * spread / spacing)
}

/// Casts the ray of a pixel, known to be clear up to `from`, mm. It counts as lit if all neighbours
/// are.
pub(crate) fn cast(bricks: &Bricks, scene: &Scene, [x, y]: [usize; 2], from: f32, around: &[Ray]) -> Ray {
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
    let surface = if on_cut(scene.bone_cut, eye + t * along) {
        Surface { normal: scene.bone_cut.truncate(), lift: lift(&bricks.grid) }
    } else {
        bricks.surface(g, along)
    };
    let normal = surface.normal;
    let known = around.iter().any(|ray| ray.lit) && around.iter().all(|ray| ray.lit || ray.t >= NOTHING);
    let faces = normal.dot(scene.light.truncate()) > 0.0;
    let lit = faces && (known || !bricks.shadowed(g, surface, scene));
    let plane = t * along.dot(normal);
    Ray { t, steps, normal, plane, open: 0.999 * bricks.openness(g, normal, scene.bone_cut), lit }
}

/// Smallest cosine between neighbours' normals on smooth bone.
const SMOOTH: f32 = 0.95;

/// Largest distance of neighbours' tangent planes on smooth bone, voxels.
const FLAT_VOXEL: f32 = 0.15;

impl Ray {
    /// Whether the ray was interpolated between rays that hit smooth bone.
    pub fn is_between(&self) -> bool {
        self.steps == 0 && self.t < NOTHING
    }

    /// Interpolates a pixel's ray between others that hit nothing, or smooth bone whose tangent
    /// planes agree.
    pub fn between(scene: &Scene, [x, y]: [usize; 2], around: &[Self]) -> Option<Self> {
        let first = around.first()?;
        if first.t >= NOTHING {
            return around.iter().all(|ray| ray.t >= NOTHING).then_some(Self::NONE);
        }
        let alike = |ray: &Self| ray.t < NOTHING && ray.lit == first.lit && ray.normal.dot(first.normal) > SMOOTH;
        if !around.iter().all(alike) {
            return None;
        }
        let along = scene.ray_of(x, y);
        let share = 1.0 / around.len() as f32;
        let (mut low, mut high) = (f32::INFINITY, f32::NEG_INFINITY);
        let mut mean = Self { t: 0.0, steps: 0, normal: Vec3::ZERO, open: 0.0, ..*first };
        for ray in around {
            let t = ray.plane / along.dot(ray.normal);
            (low, high) = (low.min(t), high.max(t));
            mean.t += share * t;
            mean.normal += ray.normal;
            mean.open += share * ray.open;
        }
        let normal = mean.normal.normalize();
        let flat = high - low < FLAT_VOXEL * scene.origin.w;
        flat.then(|| Self { normal, plane: mean.t * along.dot(normal), ..mean })
    }
}

/// Whether a hit lies on the cutting plane.
pub(crate) fn on_cut(bone_cut: Vec4, point: Vec3) -> bool {
    bone_cut.truncate() != Vec3::ZERO && height(bone_cut, point).abs() < 0.01
}
