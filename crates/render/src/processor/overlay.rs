//! CPU version of `overlay.wgsl`: draws each shape in its pixel rectangle.

use super::light::shown;
use super::tool::{lit, shaft};
use crate::bricks::NOTHING;
use crate::camera::View;
use crate::overlay::Item;
use crate::scene::Scene;
use crate::tool::ToolShape;
use glam::{Vec2, Vec3};

/// Fraction of alpha behind the scene.
const HIDDEN: f32 = 0.25;

/// Draws a shape into a picture; `depth` is the scene's distance at a pixel.
pub(crate) fn draw(item: &Item, scene: &Scene, view: &View, pixels: &mut [[u8; 4]], depth: impl Fn(usize) -> f32) {
    let (width, eye) = (scene.right.w as usize, scene.eye.truncate());
    let [left, top, right, bottom] = rectangle(&item.tool, view, [width, scene.up.w as usize]);
    for (x, y) in (top..bottom).flat_map(|y| (left..right).map(move |x| (x, y))) {
        let (along, at) = (scene.ray_of(x, y), x + width * y);
        let (t, normal) = if item.is_arrow() { arrow(eye, along, &item.tool) } else { tool(eye, along, &item.tool) };
        if t >= NOTHING {
            continue;
        }
        let tools = scene.tools.map(|tool| tool.reach(eye, along));
        let hidden = t > depth(at).min(tools[0]).min(tools[1]);
        let alpha = item.colour.w * if hidden { HIDDEN } else { 1.0 };
        let colour = shown(lit(scene, item.colour.truncate(), normal, along, 1.0, 1.0, 0.3));
        for (below, over) in pixels[at].iter_mut().zip(colour).take(3) {
            *below = (f32::from(over) * alpha + f32::from(*below) * (1.0 - alpha)).round() as u8;
        }
    }
}

/// Pixel rectangle (first and end) around a body's box with a margin of one pixel.
/// It is the whole view if the box reaches behind the eye, and empty without a body.
pub(crate) fn rectangle(tool: &ToolShape, view: &View, [width, height]: [usize; 2]) -> [usize; 4] {
    let &ToolShape { tip, tail, .. } = tool;
    if tip.w <= 0.0 {
        return [0; 4];
    }
    let radius = tool.look.z;
    let size = Vec2::new(width as f32, height as f32);
    let (mut low, mut high) = (Vec2::INFINITY, Vec2::NEG_INFINITY);
    for n in 0..16 {
        let sides = Vec3::new((n & 1) as f32, (n >> 1 & 1) as f32, (n >> 2 & 1) as f32) * 2.0 - 1.0;
        let end = if n < 8 { tip } else { tail };
        let (at, depth) = view.project(end.truncate() + radius * sides);
        if depth < View::NEAR_MM {
            return [0, 0, width, height];
        }
        let at = (at * Vec2::new(0.5, -0.5) + 0.5) * size;
        (low, high) = (low.min(at), high.max(at));
    }
    let (low, high) = ((low - 1.0).floor().clamp(Vec2::ZERO, size), (high + 1.0).ceil().clamp(Vec2::ZERO, size));
    [low.x as usize, low.y as usize, high.x as usize, high.y as usize]
}

/// Whether a pixel lies in a rectangle.
pub(crate) fn inside([left, top, right, bottom]: [usize; 4], [x, y]: [usize; 2]) -> bool {
    (left..right).contains(&x) && (top..bottom).contains(&y)
}

fn tool(eye: Vec3, along: Vec3, tool: &ToolShape) -> (f32, Vec3) {
    let t = tool.reach(eye, along);
    (t, tool.normal(eye + t * along))
}

fn arrow(eye: Vec3, along: Vec3, &ToolShape { tip, tail, .. }: &ToolShape) -> (f32, Vec3) {
    let (from, to) = (tip.truncate(), tail.truncate());
    let down = (from - to).normalize();
    let depth = (3.0 * tail.w).min(0.6 * to.distance(from));
    let neck = (to + depth * down).extend(tip.w);
    let t = shaft(eye, along, tip, neck);
    let across = eye + t * along - from;
    let stem = (t, (across - down * across.dot(down)).normalize_or_zero());
    head(eye, along, to, down, depth, tail.w, stem)
}

/// The nearer of a given surface and an arrow's head.
/// The head is a cone around `down` from its apex, with height `depth` and base radius `radius`.
fn head(eye: Vec3, along: Vec3, apex: Vec3, down: Vec3, depth: f32, radius: f32, other: (f32, Vec3)) -> (f32, Vec3) {
    let mut nearest = other;
    let away = eye - apex;
    let slope = depth * depth / (depth * depth + radius * radius);
    let (d, o) = (along.dot(down), away.dot(down));
    let (a, b, c) = (d * d - slope, d * o - slope * along.dot(away), o * o - slope * away.length_squared());
    let room = b * b - a * c;
    for side in [-1.0, 1.0] {
        let t = (-b + side * room.max(0.0).sqrt()) / a;
        let deep = o + t * d;
        if room > 0.0 && t > 0.0 && t < nearest.0 && deep > 0.0 && deep < depth {
            nearest = (t, (slope * (away + t * along) - deep * down).normalize());
        }
    }
    let t = (depth - o) / d;
    let flat = away + t * along - depth * down;
    if t > 0.0 && t < nearest.0 && flat.length_squared() < radius * radius { (t, down) } else { nearest }
}
