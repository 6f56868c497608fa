//! CPU version of `tool.wgsl`: tools in closed form, and their lighting.

use crate::bricks::NOTHING;
use crate::scene::Scene;
use crate::tool::{BURR, CRANIOTOME, PERFORATOR, SCALPEL, SPATULA, TINES, TUBE, ToolShape};
use glam::{Mat3, Vec2, Vec3, Vec4, Vec4Swizzles};

/// Distance along the ray to a ball, or [`NOTHING`].
fn ball(eye: Vec3, along: Vec3, centre: Vec3, radius: f32) -> f32 {
    let to = centre - eye;
    let middle = to.dot(along);
    let room = radius * radius - (to - middle * along).length_squared();
    let t = middle - room.max(0.0).sqrt();
    if room > 0.0 && t > 0.0 { t } else { NOTHING }
}

/// A ray that is so near has met a tool, mm, numerical.
const NEAR_MM: f32 = 0.01;
/// Most steps of a ray, numerical.
const MOST_STEPS: usize = 64;
/// Length of a perforator's body with its hub as drawn, mm, numerical.
const BODY_MM: f32 = 13.0;
/// Depth of a tube's bore as drawn, mm, numerical.
pub(crate) const BORE_MM: f32 = 8.0;

fn capsule(p: Vec3, low: f32, high: f32) -> f32 {
    (p - p.z.clamp(low, high) * Vec3::Z).length()
}

fn block(p: Vec3, half: Vec3) -> f32 {
    let away = p.abs() - half;
    away.max(Vec3::ZERO).length() + away.max_element().min(0.0)
}

impl ToolShape {
    /// The tool's frame in the world.
    fn frame(&self) -> Mat3 {
        let axis = (self.tail - self.tip).xyz() / self.look.w;
        Mat3::from_cols(self.across.xyz(), axis.cross(self.across.xyz()), axis)
    }

    /// A direction in the tool's frame.
    pub fn turned(&self, v: Vec3) -> Vec3 {
        self.frame().transpose() * v
    }

    /// How deep in a flute a place in the tool's frame is, 0 to 1.
    pub fn groove(&self, p: Vec3) -> f32 {
        let (flutes, twist) = match self.look.x as i32 {
            PERFORATOR => (3.0, 0.3),
            CRANIOTOME => (4.0, 1.2),
            _ => (8.0, 3.0 / self.tip.w),
        };
        0.5 - 0.5 * (flutes * (p.y.atan2(p.x) - self.across.w) + twist * p.z).sin()
    }

    /// Whether a place on the surface is on its fluted part.
    pub fn is_fluted(&self, p: Vec3) -> bool {
        let (r, cut) = (self.tip.w, self.look.y);
        match self.look.x as i32 {
            BURR => p.length() < 1.01 * r,
            PERFORATOR => p.z < BODY_MM,
            CRANIOTOME => p.z < cut && capsule(p, 0.0, cut) < r + 0.02,
            _ => false,
        }
    }

    /// At most the distance from a place in the tool's frame to the drawn surface, over 0.8; mm.
    fn gap(&self, p: Vec3) -> f32 {
        let (r, s, [_, cut, _, length]) = (self.tip.w, self.tail.w, self.look.to_array());
        let round = p.truncate().length();
        let stem = capsule(p, 0.0, length) - s;
        match self.look.x as i32 {
            BURR => (p.length() - r + 0.12 * round * self.groove(p)).min(stem),
            PERFORATOR => {
                let body = (capsule(p, 0.0, BODY_MM) - r).max(0.6 * round + 0.8 * (p.z - BODY_MM));
                (body + 0.28 * round * self.groove(p)).min(stem)
            }
            CRANIOTOME => {
                let mill = capsule(p, 0.0, cut) - r + 0.22 * round * self.groove(p);
                let sleeve = (round - 2.6).max((p.z - cut - 6.0).abs() - 5.0);
                let middle = Vec3::new(2.1, 0.0, 0.5 * (cut + 2.0 - r));
                let arm = block(p - middle, Vec3::new(0.4, 0.8, 0.5 * (cut + 2.0 + r)));
                let foot = block(p - Vec3::new(0.5, 0.0, 0.35 - r), Vec3::new(2.0, 1.0, 0.35));
                mill.min(sleeve).min(arm).min(foot).min(if p.z < cut { NOTHING } else { stem })
            }
            SPATULA => {
                let flat = Vec2::new(p.x, p.z - p.z.clamp(0.0, length)).length() - r;
                let across = Vec2::new(flat, p.y.abs() - 0.5);
                across.max(Vec2::ZERO).length() + across.max_element().min(0.0)
            }
            TUBE => (p.length() - r).min(stem).max(-(round - 0.55 * s).max(p.z - BORE_MM)),
            TINES => {
                let aside = 0.5 * s + (0.1 * (p.z - 10.0)).clamp(0.0, 4.0);
                let tine = capsule(Vec3::new(p.x.abs() - aside, p.y, p.z), 0.5 * s - r, length);
                tine - 0.5 * s - (0.02 * p.z).clamp(0.0, 0.8)
            }
            SCALPEL => {
                let q = Vec2::new(p.x, p.z + r);
                let sides = q.dot(Vec2::new(-0.997, -0.080)).max(q.dot(Vec2::new(0.944, -0.330)));
                let blade = sides.max((p.x - 2.2).max(p.z - 14.0)).max(p.y.abs() - 0.2);
                let middle = Vec3::new(0.6, 0.0, 0.5 * (length + 13.0));
                blade.min(block(p - middle, Vec3::new(1.6, 0.9, 0.5 * (length - 13.0))))
            }
            _ => (p.length() - r).min(stem),
        }
    }

    /// Distance along the ray to the tool, or [`NOTHING`]. Inside the round bound its axis is no
    /// farther than the bound's radius, so what is farther from the tool has left the bound.
    pub fn reach(&self, eye: Vec3, along: Vec3) -> f32 {
        let (tip, far) = (self.tip.xyz(), self.look.z);
        let tail = self.tail.xyz().extend(far);
        let ends = ball(eye, along, tip, far).min(ball(eye, along, tail.xyz(), far));
        let bound = ends.min(shaft(eye, along, self.tip, tail));
        if self.tip.w < 0.0 || bound >= NOTHING {
            return NOTHING;
        }
        let (start, way) = (self.turned(eye + bound * along - tip), self.turned(along));
        let mut t = 0.0;
        for _ in 0..MOST_STEPS {
            let left = self.gap(start + t * way);
            if left < NEAR_MM {
                return bound + t;
            }
            if left > far + 0.1 {
                break;
            }
            t += 0.8 * left;
        }
        NOTHING
    }

    /// Unit normal at a place on the tool: the slope of its distance, from four places around.
    pub fn normal(&self, point: Vec3) -> Vec3 {
        const AROUND: [Vec3; 4] =
            [Vec3::new(1.0, -1.0, -1.0), Vec3::new(-1.0, -1.0, 1.0), Vec3::new(-1.0, 1.0, -1.0), Vec3::ONE];
        let p = self.turned(point - self.tip.xyz());
        let slope: Vec3 = AROUND.iter().map(|&d| d * self.gap(p + 0.02 * d)).sum();
        (self.frame() * slope).normalize()
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

#[cfg(test)]
mod tests {
    use super::*;
    use trepan_geometry::{Pose, Tool};

    #[test]
    fn each_tool_is_drawn_with_its_tip_where_contact_has_it() {
        let tools = [
            Tool::burr(2.0),
            Tool::burr(3.0),
            Tool::perforator(),
            Tool::craniotome(),
            Tool::probe(2.0),
            Tool::spatula(),
            Tool::aspirator(),
            Tool::bipolar(),
            Tool::scalpel(),
        ];
        for tool in tools {
            let shape = ToolShape::of(&tool, &Pose::IDENTITY, 0.4);
            // Parallel rays from below, over all that lies within the bound.
            let places = (-60..=60).flat_map(|x| (-60..=60).map(move |y| 0.1 * Vec2::new(x as f32, y as f32)));
            let heights = places.map(|at| shape.reach(at.extend(-100.0), Vec3::Z) - 100.0);
            let lowest = heights.fold(f32::INFINITY, f32::min);
            // A tube's rim lies above the end of its ball.
            let rim = if tool.kind == trepan_geometry::ToolKind::Aspirator { 0.25 } else { 0.03 };
            let above = lowest + tool.tip_radius_mm;
            assert!((-0.03..rim).contains(&above), "{}: {above} mm above the tip", tool.kind.name());
            // From aside there is something at every height, but between parted tines.
            let aside =
                |z: f32| (0..24).map(move |n| Vec3::from((Vec2::from_angle(0.26 * n as f32), 0.0)) + z * Vec3::Z);
            for from in [0.0f32, 1.0, 5.0, 8.0].into_iter().flat_map(aside) {
                let (out, z) = (from.with_z(0.0), from.z * Vec3::Z);
                let t = shape.reach(z + 50.0 * out, -out);
                assert!(t < 50.0, "{} has a hole at {from}", tool.kind.name());
                let normal = shape.normal(z + (50.0 - t) * out);
                assert!(normal.is_finite() && normal.dot(out) > 0.0, "{}: normal {normal} at {from}", tool.kind.name());
            }
        }
    }
}
