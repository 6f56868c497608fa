//! CPU version of `slice.wgsl`: one pixel of an orthogonal slice through the tool's tip.

use super::light::{signal, smoothstep, tinted};
use super::{Inputs, bytes};
use crate::frame::SliceLook;
use crate::slice::{LETTERS, Plane};
use glam::{Vec2, Vec3};
use trepan_volume::AIR_HU;

/// Letters of 5 x 5 dots, top row first, leftmost dot in the highest bit: R L A P S I.
const FONT: [u32; 6] = [0x1e8fa51, 0x108421f, 0x0e8fe31, 0x1e8fa10, 0x0f8383e, 0x0e2108e];

const YELLOW: Vec3 = Vec3::new(1.0, 0.80, 0.20);

/// The colour of a pixel of slice `n`.
pub(crate) fn fragment(
    inputs: &Inputs,
    plane: &Plane,
    n: usize,
    size: [usize; 2],
    at: [usize; 2],
    rest: Option<Vec3>,
    look: &SliceLook,
) -> [u8; 4] {
    let scene = inputs.scene;
    let size = Vec2::new(size[0] as f32, size[1] as f32);
    let pixel = Vec2::new(at[0] as f32, at[1] as f32) + 0.5;
    let offset = (2.0 * pixel / size - 1.0) * Vec2::new(plane.half.x, -plane.half.y);
    let world = plane.centre + offset.x * plane.right + offset.y * plane.up;
    let mut colour = tissue(inputs, world, rest.unwrap_or(world), look);
    let mm = 2.0 * plane.half.x / size.x;
    if scene.tools[0].tip.w > 0.0 {
        let away = world - scene.tools[0].tip.truncate();
        let away = Vec2::new(away.dot(plane.right), away.dot(plane.up));
        if away.length() > scene.tools[0].tip.w + 4.0 * mm && away.abs().min_element() < 0.5 * mm {
            colour = colour.lerp(Vec3::new(0.25, 0.85, 1.0), 0.65);
        }
        let gap = scene.tool_distance(world);
        if gap < 0.0 {
            colour = colour.lerp(YELLOW, 0.35);
        }
        if gap.abs() < 0.8 * mm {
            colour = YELLOW;
        }
    }
    if labelled(n, pixel, size) {
        colour = Vec3::new(0.95, 0.95, 0.80);
    }
    if pixel.min_element().min((size - pixel).min_element()) < 1.0 {
        colour = Vec3::new(0.22, 0.24, 0.28);
    }
    bytes(colour)
}

fn tissue(inputs: &Inputs, world: Vec3, rest: Vec3, look: &SliceLook) -> Vec3 {
    let g = inputs.bricks.grid_of(world);
    let dims = Vec3::from(inputs.bricks.grid.dims.map(|n| n as f32));
    let inside = (g + 0.5).cmpge(Vec3::ZERO).all() && (g + 0.5).cmple(dims).all();
    let hu = if inside { inputs.bricks.shown_hu(g) } else { f32::from(AIR_HU) };
    let grey = ((hu - (look.level_hu - 0.5 * look.width_hu)) / look.width_hu.max(1.0)).clamp(0.0, 1.0);
    let Some(signals) = inputs.mri else { return Vec3::splat(grey) };
    let place = signals.texture_from_world.transform_point3(rest);
    let known = place.cmpge(Vec3::ZERO).all() && place.cmple(Vec3::ONE).all();
    let isovalue = inputs.scene.dims.w;
    let share = look.mri_share * (1.0 - smoothstep(isovalue - 150.0, isovalue, hu));
    let grey = Vec3::splat(grey);
    if !known {
        return grey;
    }
    let signal = signal(inputs.scene, signals, place);
    grey.lerp(tinted(Vec3::splat(signal.w), signal), share)
}

fn labelled(slice: usize, pixel: Vec2, size: Vec2) -> bool {
    let scale = (size.y / 110.0).floor().max(1.0);
    // Letters lie within a few dots of the border; `floor` below is a call.
    if pixel.min_element().min((size - pixel).min_element()) > 8.0 * scale {
        return false;
    }
    let (near, middle, far) = (2.0 * scale, 0.5 * size - 2.5 * scale, size - 7.0 * scale);
    let places =
        [Vec2::new(near, middle.y), Vec2::new(far.x, middle.y), Vec2::new(middle.x, near), Vec2::new(middle.x, far.y)];
    LETTERS[slice].iter().zip(places).any(|(&letter, place)| {
        let dot = ((pixel - place) / scale).floor().as_ivec2();
        let inside = dot.cmpge(glam::IVec2::ZERO).all() && dot.cmple(glam::IVec2::splat(4)).all();
        inside && FONT[letter as usize] >> (24 - 5 * dot.y - dot.x) & 1 == 1
    })
}
