//! CPU version of `light.wgsl`: shades the nearest of bone, brain and tool at a pixel.

use super::Inputs;
use super::brain::Fragment;
use super::drilled::{Surface, lift};
use super::skull::{Ray, on_cut};
use super::tool::{BORE_MM, lit};
use crate::border::{DURA, PIA, wave};
use crate::bricks::NOTHING;
use crate::mix::trilinear;
use crate::mri::Signals;
use crate::scene::Scene;
use crate::tool::{TINES, TUBE, ToolShape};
use glam::{Vec3, Vec4};
use std::sync::LazyLock;

/// The colour of a pixel; `near` selects the tools that may appear there, `shading` those whose
/// shadow may fall there.
pub(crate) fn fragment(
    inputs: &Inputs,
    [x, y]: [usize; 2],
    [near, shading]: [[bool; 2]; 2],
    bone: &Ray,
    brain: &Fragment,
) -> [u8; 4] {
    let scene = inputs.scene;
    let (along, eye) = (scene.ray_of(x, y), scene.eye.truncate());
    let meets = |n: usize| if near[n] { scene.tools[n].reach(eye, along) } else { NOTHING };
    let [first, second] = [meets(0), meets(1)];
    // Where one plane cuts both, the depths are equal: bone is shown, even if the mesh reaches into
    // it.
    let under_bone = brain.cut && on_cut(scene.bone_cut, eye + bone.t * along);
    let brain_t = if under_bone { NOTHING } else { brain.t };
    let t = bone.t.min(brain_t).min(first).min(second);
    let point = eye + t * along;
    let colour = if t >= NOTHING {
        let back = (y as f32 + 0.5) / scene.up.w;
        Vec3::new(0.105, 0.125, 0.155).lerp(Vec3::new(0.035, 0.04, 0.05), back)
    } else if t == first {
        shade_tool(scene, point, along, &scene.tools[0])
    } else if t == second {
        shade_tool(scene, point, along, &scene.tools[1])
    } else if t == brain_t {
        shade_brain(inputs, point, along, shading, brain)
    } else {
        shade_bone(inputs, point, along, shading, bone)
    };
    shown(colour)
}

/// Converts a linear colour to bytes for gamma 2.2, by a table over the square root, where the
/// curve is nearly straight.
pub(crate) fn shown(colour: Vec3) -> [u8; 4] {
    const LAST: usize = 4095;
    static SHOWN: LazyLock<Vec<u8>> = LazyLock::new(|| {
        let byte = |n: usize| (n as f32 / LAST as f32).powf(2.0 / 2.2) * 255.0;
        (0..=LAST).map(|n| byte(n).round() as u8).collect()
    });
    let table: &[u8] = &SHOWN;
    let at = |x: f32| table[((x.clamp(0.0, 1.0).sqrt() * LAST as f32 + 0.5) as usize).min(LAST)];
    [at(colour.x), at(colour.y), at(colour.z), 255]
}

fn shade_bone(inputs: &Inputs, point: Vec3, along: Vec3, shading: [bool; 2], bone: &Ray) -> Vec3 {
    let scene = inputs.scene;
    let colour = bone_colour(inputs, point, bone.normal);
    let mut colour = inputs.bone_paint.map_or(colour, |paint| paint.over(colour, point));
    let wet = wetness(scene, point);
    if wet > 0.0 {
        colour = colour.lerp(colour * Vec3::new(0.72, 0.48, 0.42), wet);
        if dusty(point) {
            colour = colour.lerp(Vec3::new(0.95, 0.92, 0.86), 0.6 * wet);
        }
    }
    let key = past_tools(scene, point, shading) * f32::from(u8::from(bone.lit));
    lit(scene, colour, bone.normal, along, bone.open, key, 0.06 + 0.4 * wet)
}

/// Distance from the burr up to which bone is wet, mm, numerical.
pub(crate) const WET_MM: f32 = 7.0;

/// Wetness of bone: while the burr turns, a film of water and blood covers its surroundings.
fn wetness(scene: &Scene, point: Vec3) -> f32 {
    let tip = scene.tools[0].tip;
    let away = point.distance(tip.truncate()) - tip.w;
    scene.light.w * (1.0 - smoothstep(1.0, WET_MM, away))
}

/// Whether there is a grain of bone dust at a point: one cell of 0.5 mm in twelve.
fn dusty(point: Vec3) -> bool {
    let [x, y, z] = (point * 2.0).floor().to_array().map(|v| v as i32 as u32);
    let mixed = x.wrapping_mul(73_856_093) ^ y.wrapping_mul(19_349_663) ^ z.wrapping_mul(83_492_791);
    (mixed.wrapping_mul(2_654_435_761) >> 16).is_multiple_of(12)
}

fn shade_brain(inputs: &Inputs, point: Vec3, along: Vec3, shading: [bool; 2], brain: &Fragment) -> Vec3 {
    let scene = inputs.scene;
    let painted = |colour| inputs.brain_paint.map_or(colour, |paint| paint.over(colour, brain.rest));
    let mut key = past_tools(scene, point, shading);
    if brain.cut {
        return painted(cut_colour(scene, inputs.mri, brain.rest)) * (0.6 + 0.4 * key);
    }
    let mut open = brain.open;
    key *= open;
    if scene.forward.w > 0.0 {
        let g = inputs.bricks.grid_of(point);
        open *= inputs.bricks.openness(g, brain.normal, scene.bone_cut);
        if inputs.bricks.shadowed(g, Surface { normal: brain.normal, lift: lift(&inputs.bricks.grid) }, scene) {
            key *= 0.25;
        }
    }
    if brain.stain < 0.75 * DURA {
        let normal = if brain.normal.dot(along) > 0.0 { -brain.normal } else { brain.normal };
        return lit(scene, dura_colour(brain.rest), normal, along, open, key, 0.25);
    }
    let flesh = match inputs.mri {
        Some(signals) if brain.open > 0.5 * (1.0 + PIA) => bare_colour(scene, signals, brain.rest),
        mri => vessels_over(
            brain_colour(scene, mri, brain.rest - BELOW_MM * brain.normal),
            brain.ways,
            in_sulcus(brain.open),
        ),
    };
    let colour = painted(flesh);
    let (colour, film) = stained(colour, brain.stain);
    lit(scene, colour, brain.normal, along, open, key, 0.35 + 0.15 * film)
}

/// Ways, of 2 mm, within which a vein, an artery and a branch are whole, and past which there is
/// none, numerical.
const VESSELS: [[f32; 2]; 3] = [[0.20, 0.32], [0.10, 0.20], [0.03, 0.08]];

/// How much a place lies in a sulcus, 0 to 1, by the light of the surroundings there.
fn in_sulcus(open: f32) -> f32 {
    1.0 - smoothstep(0.65, 0.95, open)
}

/// Whether a vessel of the pia is seen, by the ways to them and the light of the surroundings.
pub(crate) fn has_vessel(look: Vec4) -> bool {
    let [vein, artery, branch] = VESSELS.map(|[_, end]| end);
    look.z.abs() < branch || look.y.abs() < artery || look.x.abs() < vein && in_sulcus(look.w) > 0.0
}

/// Vessels of the pia over a colour, by the ways to them: veins keep to the sulci, arteries and
/// their branches cross the gyri.
fn vessels_over(colour: Vec3, ways: Vec3, in_sulcus: f32) -> Vec3 {
    let [vein, artery, branch] = VESSELS;
    let line = |[whole, end]: [f32; 2], way: f32| 1.0 - smoothstep(whole, end, way.abs());
    let fine = colour.lerp(Vec3::new(0.66, 0.20, 0.17), 0.30 * line(branch, ways.z));
    let red = fine.lerp(Vec3::new(0.58, 0.09, 0.08), 0.6 * line(artery, ways.y));
    red.lerp(Vec3::new(0.27, 0.07, 0.13), 0.85 * line(vein, ways.x) * in_sulcus)
}

/// Colour of the dura: pale, with vessels that branch; by the place at rest, mm.
fn dura_colour(rest: Vec3) -> Vec3 {
    let vessel = 1.0
        - smoothstep(0.02, 0.10, wave(0.16 * rest).0.abs().min(wave(0.29 * Vec3::new(rest.y, rest.z, rest.x)).0.abs()));
    Vec3::new(0.80, 0.68, 0.62).lerp(Vec3::new(0.55, 0.22, 0.22), 0.7 * vessel)
}

/// Colour of tissue under blood or burnt, and how much of it the blood covers.
fn stained(colour: Vec3, stain: f32) -> (Vec3, f32) {
    let film = 1.0 - (-stain.max(0.0) / 0.15).exp();
    let burnt = colour.lerp(Vec3::new(0.10, 0.07, 0.05), 0.85 * (-stain).clamp(0.0, 1.0));
    (burnt.lerp(Vec3::new(0.36, 0.02, 0.02), film), film)
}

pub(crate) fn smoothstep(low: f32, high: f32, x: f32) -> f32 {
    let s = ((x - low) / (high - low)).clamp(0.0, 1.0);
    s * s * (3.0 - 2.0 * s)
}

/// Fraction of the lamp's light that passes a body at distance `gap` from the beam, `way` mm away.
fn pass_by(gap: f32, way: f32) -> f32 {
    smoothstep(-1.0, 1.0, gap / (0.10 * way + 0.3))
}

/// Fraction of light that the tools let pass to a point, of those that may shade it.
fn past_tools(scene: &Scene, point: Vec3, shading: [bool; 2]) -> f32 {
    let tools = scene.tools.iter().zip(shading).filter(|(_, shading)| *shading);
    tools.map(|(tool, _)| past(scene.light.truncate(), point, tool.tip, tool.tail)).product()
}

fn past(light: Vec3, point: Vec3, tip: Vec4, tail: Vec4) -> f32 {
    if tip.w < 0.0 {
        return 1.0;
    }
    gaps(light, point, tip, tail).into_iter().map(|[gap, way]| pass_by(gap, way)).product()
}

/// Whether a tool may take light from a point of a ball.
pub(crate) fn is_shaded(light: Vec3, middle: Vec3, radius_mm: f32, tool: &ToolShape) -> bool {
    let [to, end] = [tool.tip, tool.tail].map(|point| point.truncate() - middle);
    let axis = end - to;
    let from_beam = |to: Vec3| (to - to.dot(light).max(0.0) * light).length();
    // Nowhere in the ball is a gap smaller than the distance of beam and shaft less its radius.
    let across = axis - axis.dot(light) * light;
    let nearest = [to.dot(across) / across.length_squared().max(1e-6), to.dot(axis) / axis.length_squared().max(1e-6)];
    let places = nearest.map(|share| (-share).clamp(0.0, 1.0)).into_iter().chain([0.0, 1.0]);
    let distance = places.map(|share| from_beam(to + share * axis)).fold(f32::INFINITY, f32::min);
    let way = to.dot(light).max(end.dot(light)).max(0.0);
    let is_near = |gap: f32, way: f32| gap - radius_mm < 0.10 * (way + radius_mm) + 0.3;
    let by_ball = is_near(from_beam(to) - tool.tip.w, to.dot(light).max(0.0));
    tool.tip.w >= 0.0 && (by_ball || is_near(distance - tool.tail.w, way))
}

/// Distances of a tool's ball and shaft from the beam to a point, and how far along it they are.
fn gaps(light: Vec3, point: Vec3, tip: Vec4, tail: Vec4) -> [[f32; 2]; 2] {
    let to = tip.truncate() - point;
    let way = to.dot(light).max(0.0);
    let by_ball = [(to - way * light).length() - tip.w, way];
    let axis = (tail - tip).truncate();
    let (b, c, d) = (light.dot(axis), axis.length_squared(), -light.dot(to));
    let on_axis = ((-axis.dot(to) - b * d) / (c - b * b).max(1e-6)).clamp(0.0, 1.0);
    let on_beam = (b * on_axis - d).max(0.0);
    let gap = (on_beam * light - to - on_axis * axis).length() - tail.w;
    [by_ball, [gap, on_beam]]
}

/// Densities up to which a cut face is diploe, and from which on a table, HU, numerical.
const DIPLOE_HU: [f32; 2] = [800.0, 1350.0];

fn bone_colour(inputs: &Inputs, point: Vec3, normal: Vec3) -> Vec3 {
    let inside = inputs.bricks.hu(inputs.bricks.grid_of(point - normal * 1.2));
    let isovalue = inputs.scene.dims.w;
    let dense = smoothstep(isovalue, isovalue + 500.0, inside);
    let grown = Vec3::new(0.80, 0.62, 0.50).lerp(Vec3::new(0.93, 0.89, 0.80), dense);
    // The CT is denser than the isovalue where a tool made the surface: pale tables, red diploe.
    let here = inputs.bricks.hu(inputs.bricks.grid_of(point));
    let made = smoothstep(isovalue + 80.0, isovalue + 240.0, here);
    let table = smoothstep(DIPLOE_HU[0], DIPLOE_HU[1], here);
    grown.lerp(Vec3::new(0.58, 0.27, 0.21).lerp(Vec3::new(0.92, 0.85, 0.73), table), made)
}

/// Tissue without its pia, as in the walls of a hole: grey matter is pink, white matter cream.
fn bare_colour(scene: &Scene, signals: &Signals, rest: Vec3) -> Vec3 {
    let signal = signal(scene, signals, signals.texture_from_world.transform_point3(rest));
    let white = smoothstep(0.35, 0.75, signal.w);
    tinted(Vec3::new(0.66, 0.38, 0.34).lerp(Vec3::new(0.92, 0.78, 0.64), white), signal)
}

/// Depth below the surface at which the MRI is sampled, mm, numerical: where grey matter is.
const BELOW_MM: f32 = 2.0;

fn brain_colour(scene: &Scene, mri: Option<&Signals>, rest: Vec3) -> Vec3 {
    let flesh = Vec3::new(0.90, 0.53, 0.45);
    mri.map_or(flesh * 0.85, |signals| {
        let signal = signal(scene, signals, signals.texture_from_world.transform_point3(rest));
        tinted(flesh * (0.42 + 0.68 * smoothstep(0.05, 0.60, signal.w)), signal)
    })
}

/// The MRI on the cut brain, as grey as in the slices.
fn cut_colour(scene: &Scene, mri: Option<&Signals>, rest: Vec3) -> Vec3 {
    mri.map_or(Vec3::new(0.62, 0.32, 0.29), |signals| {
        let signal = signal(scene, signals, signals.texture_from_world.transform_point3(rest));
        tinted(Vec3::splat(signal.w), signal).powf(2.2)
    })
}

/// Mark and grey value within the window at texture coordinates, 0 to 1.
pub(crate) fn signal(scene: &Scene, signals: &Signals, at: Vec3) -> Vec4 {
    let voxel = at * Vec3::from(signals.dims.map(|n| n as f32)) - 0.5;
    let signal = match signals.is_marked {
        true => trilinear(signals.dims, voxel, |n| Vec4::from(signals.texels[n].map(f32::from))) / 255.0,
        false => Vec4::W * (trilinear(signals.dims, voxel, |n| f32::from(signals.texels[n][3])) / 255.0),
    };
    signal.with_w(((signal.w - scene.mri_window.x) * scene.mri_window.y).clamp(0.0, 1.0))
}

/// CPU version of the shader's `tinted`: a colour with a mark over it.
pub(crate) fn tinted(colour: Vec3, signal: Vec4) -> Vec3 {
    let mark = signal.truncate();
    let share = mark.max_element();
    colour.lerp(mark / share.max(1e-3), 0.45 * share)
}

fn shade_tool(scene: &Scene, point: Vec3, along: Vec3, tool: &ToolShape) -> Vec3 {
    let colour = tool_colour(tool.turned(point - tool.tip.truncate()), tool);
    lit(scene, colour, tool.normal(point), along, 1.0, 1.0, 0.7)
}

/// Steel, dark in flutes and in a tube's bore; tines are insulated above their tips.
fn tool_colour(p: Vec3, tool: &ToolShape) -> Vec3 {
    match tool.look.x as i32 {
        _ if tool.is_fluted(p) => Vec3::new(0.80, 0.80, 0.78).lerp(Vec3::new(0.30, 0.32, 0.36), tool.groove(p)),
        TUBE if p.z < BORE_MM && p.truncate().length() < 0.56 * tool.tail.w => Vec3::splat(0.02),
        TINES if p.z > 8.0 => Vec3::new(0.13, 0.22, 0.42),
        _ => Vec3::new(0.62, 0.66, 0.72),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_tool_shades_lies_in_balls_that_it_may_shade() {
        let mut random = fastrand::Rng::with_seed(3);
        let mut number = |low: f32, high: f32| low + (high - low) * random.f32();
        let mut shaded = 0;
        for n in 0..20_000 {
            let mut vector = |size: f32| Vec3::new(number(-size, size), number(-size, size), number(-size, size));
            let (light, tip, middle) = (vector(1.0).normalize_or(Vec3::Z), vector(30.0), vector(30.0));
            // Every second shaft points towards the lamp, or nearly so.
            let aside = if n % 2 == 0 { 0.3 } else { 2.0 };
            let tail = tip + 120.0 * (light + aside * vector(1.0)).normalize_or(Vec3::X);
            let (radius_mm, offset) = (3.0, vector(1.0).normalize_or(Vec3::Y));
            let point = middle + 0.99 * radius_mm * offset;
            let tool = ToolShape { tip: tip.extend(1.5), tail: tail.extend(2.0), ..ToolShape::NONE };
            if past(light, point, tool.tip, tool.tail) < 1.0 {
                shaded += 1;
                assert!(is_shaded(light, middle, radius_mm, &tool), "{n}: {light} {tip} {tail} {middle} {point}");
            }
        }
        assert!(shaded > 500, "{shaded}");
    }
}
