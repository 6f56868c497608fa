//! CPU version of `tool.wgsl`: tools in closed form, and their lighting.

use crate::bricks::NOTHING;
use crate::scene::Scene;
use glam::{Vec3, Vec4};

/// Distance along the ray to a ball, or [`NOTHING`].
fn ball(eye: Vec3, along: Vec3, centre: Vec3, radius: f32) -> f32 {
    let to = centre - eye;
    let middle = to.dot(along);
    let room = radius * radius - (to - middle * along).length_squared();
    let t = middle - room.max(0.0).sqrt();
    if room > 0.0 && t > 0.0 { t } else { NOTHING }
}

/// Intersection of a ray with a tool.
pub(crate) struct ToolHit {
    pub tip: Vec4,
    pub tail: Vec4,
    /// Distances along the ray to ball, shaft and far end, or [`NOTHING`].
    pub at: [f32; 3],
}

impl ToolHit {
    pub const NONE: Self = Self { tip: Vec4::ZERO, tail: Vec4::ZERO, at: [NOTHING; 3] };

    pub fn of([tip, tail]: [Vec4; 2], eye: Vec3, along: Vec3) -> Self {
        let round = |end: Vec4| ball(eye, along, end.truncate(), end.w);
        let at = if tip.w > 0.0 { [round(tip), shaft(eye, along, tip, tail), round(tail)] } else { [NOTHING; 3] };
        Self { tip, tail, at }
    }

    pub fn t(&self) -> f32 {
        let [tip, stem, end] = self.at;
        tip.min(stem).min(end)
    }

    /// Unit normal at the hit point.
    pub fn normal(&self, point: Vec3) -> Vec3 {
        let (on_tip, on_end) = (self.t() == self.at[0], self.t() == self.at[2]);
        let axis = (self.tail - self.tip).truncate();
        let away = point - if on_end { self.tail } else { self.tip }.truncate();
        let across = away - axis * (away.dot(axis) / axis.length_squared().max(1e-9));
        if on_tip || on_end { away } else { across }.normalize()
    }
}

/// Distance along the ray to a shaft's lateral surface, or [`NOTHING`].
pub(crate) fn shaft(eye: Vec3, along: Vec3, tip: Vec4, tail: Vec4) -> f32 {
    let axis = (tail - tip).truncate();
    let away = eye - tip.truncate();
    let length2 = axis.length_squared();
    let a = length2 - axis.dot(along).powi(2);
    let b = length2 * away.dot(along) - axis.dot(away) * axis.dot(along);
    let c = length2 * (away.length_squared() - tail.w.powi(2)) - axis.dot(away).powi(2);
    let room = b * b - a * c;
    let t = (-b - room.max(0.0).sqrt()) / a.max(1e-9);
    let at = axis.dot(away) + t * axis.dot(along);
    if room > 0.0 && t > 0.0 && at > 0.0 && at < length2 { t } else { NOTHING }
}

/// Diffuse light from the upper left and the sky, and a highlight.
pub(crate) fn lit(scene: &Scene, albedo: Vec3, normal: Vec3, along: Vec3, open: f32, key: f32, gloss: f32) -> Vec3 {
    let light = scene.light.truncate();
    let facing = normal.dot(light).max(0.0) * key;
    let sky = 0.5 + 0.5 * normal.dot(scene.up.truncate().normalize());
    let ambient = open * Vec3::new(0.10, 0.09, 0.085).lerp(Vec3::new(0.25, 0.28, 0.33), sky);
    let head = 0.12 * (0.25 + 0.75 * open) * (-normal.dot(along)).max(0.0);
    let halfway = (light - along).normalize();
    let shine = gloss * normal.dot(halfway).max(0.0).powi(48) * key * open;
    albedo * (ambient + head + facing * Vec3::new(0.66, 0.63, 0.57)) + shine
}
