//! Colour overlays on bone and brain: plan and remaining thickness during the operation, deviation
//! from the plan and forces at the end.
//!
//! # Practice
//! | colour | on bone, during | on bone, at the end | on the brain |
//! |---|---|---|---|
//! | sky blue | planned outline | planned and left | |
//! | green | | planned and taken | |
//! | yellow to vermilion | brain 3 to 0 mm below | vermilion: taken outside the plan | `∫ F dt` |
//! | purple | | | must not be touched |
//!
//! On the brain yellow is the least force over time, vermilion the most. The colours are those of
//! Okabe and Ito (2008), distinct for all kinds of colour vision. An overlay is a box of some
//! 10⁵ texels, made once in tens of milliseconds.

use glam::IVec3;
use trepan_bone::BoneVolume;
use trepan_geometry::{Aabb, Tool, Vec3};
use trepan_link::wire::TickRecord;
use trepan_patient::Plan;
use trepan_render::Paint;
use trepan_report::regions::touched;
use trepan_volume::DistanceField;

const SKY: [f32; 3] = [86.0, 180.0, 233.0];
const GREEN: [f32; 3] = [0.0, 158.0, 115.0];
const YELLOW: [f32; 3] = [240.0, 228.0, 66.0];
const VERMILION: [f32; 3] = [213.0, 94.0, 0.0];
const PURPLE: [f32; 3] = [204.0, 121.0, 167.0];

/// Spacing of texels, mm.
const TEXEL_MM: f32 = 1.0;
/// Half the width of an outline, mm.
const LINE_MM: f32 = 0.8;
/// Distance to the brain under which the bone is coloured, mm.
const CLOSE_MM: f32 = 3.0;
/// Margin of the overlay around the plan, mm.
const AROUND_MM: f32 = 6.0;
/// Depth of the overlay, mm.
const DEEP_MM: f32 = 20.0;
/// Standard deviation of a touch on the map of forces, mm.
const SPREAD_MM: f32 = 2.0;
/// Largest number of texels of a map along an axis.
const MAX_TEXELS: u32 = 160;

/// Colour overlays during the operation.
#[derive(Clone, Debug, Default)]
pub(crate) struct Colours {
    /// Over the bone.
    pub bone: Option<Paint>,
    /// Over the brain.
    pub brain: Option<Paint>,
}

/// Paints the plan's outline and the distance of bone to the brain below it.
pub(crate) fn planned(plan: &Plan, brain: Option<&DistanceField>) -> Paint {
    let (middle, inward) = (plan.site.entry, plan.site.inward);
    let reach = plan.hole_mm.max(plan.flap_mm) + AROUND_MM;
    let around = Aabb::of_points(&[middle - 4.0 * inward, middle + DEEP_MM * inward]).inflated(reach + 4.0);
    paint(1, around, TEXEL_MM, |place| {
        let aside = |from: Vec3| (place - from).reject_from(inward).length();
        let of_lines = [aside(plan.hole()) - plan.hole_mm, plan.beside_mm(place)];
        if of_lines.iter().any(|mm| mm.abs() < LINE_MM) {
            return coloured(SKY, 0.9);
        }
        let below = brain.filter(|_| aside(middle) < reach).map_or(f32::INFINITY, |field| field.sample(place));
        let close = 1.0 - below.max(0.0) / CLOSE_MM;
        if close > 0.0 { coloured(warm(close), 0.7 * close.sqrt()) } else { CLEAR }
    })
}

/// Paints the structures on the brain that must not be touched.
pub(crate) fn forbidden(field: &DistanceField, around: Aabb) -> Paint {
    paint(1, around, (around.size().max_element() / MAX_TEXELS as f32).max(TEXEL_MM), |place| {
        let near = 1.0 - field.sample(place).max(0.0) / 2.0;
        if near > 0.0 { coloured(PURPLE, 0.85 * near) } else { CLEAR }
    })
}

/// Paints removed and planned bone, voxel by voxel around the plan.
pub(crate) fn against(plan: &Plan, bone: &BoneVolume) -> Paint {
    let reach = plan.hole_mm.max(plan.flap_mm) + 2.0 * AROUND_MM;
    let around = Aabb::of_points(&[plan.site.entry, plan.site.entry + DEEP_MM * plan.site.inward]).inflated(reach);
    let low = bone.centre_of(bone.voxel_of(around.min));
    let was_bone = |voxel: IVec3| bone.scanned(voxel) >= bone.isovalue();
    paint(2, Aabb { min: low, max: around.max }, bone.spacing_mm(), |place| {
        let voxel = bone.voxel_of(place);
        if !was_bone(voxel) {
            return CLEAR;
        }
        let gone = |voxel: IVec3| was_bone(voxel) && !bone.is_bone(voxel);
        let sides = [IVec3::X, IVec3::Y, IVec3::Z].into_iter().flat_map(|side| [voxel + side, voxel - side]);
        // The rim of removed bone has its colour too, so that the remaining surface shows it.
        let at_rim = |planned: bool| sides.clone().any(|at| gone(at) && plan.takes(bone.centre_of(at)) == planned);
        match (plan.takes(place), gone(voxel)) {
            (true, true) => coloured(GREEN, 0.9),
            (true, false) => coloured(SKY, 0.9),
            (false, true) => coloured(VERMILION, 1.0),
            (false, false) if at_rim(false) => coloured(VERMILION, 1.0),
            (false, false) if at_rim(true) => coloured(GREEN, 0.9),
            (false, false) => CLEAR,
        }
    })
}

/// Paints force over time on the brain at rest, where the tool touched it; `None` without touches.
pub(crate) fn forces(brain: &DistanceField, tray: &[Tool], ticks: &[TickRecord]) -> Option<Paint> {
    let pressed = |tick: &&TickRecord| tick.phase == 1 && tick.tissue_depth_mm > 0.0;
    let touched = |tick: &TickRecord| (touched(brain, tray, tick), tick.tissue_n());
    // Every 10th tick is enough: the tool moves less than the spread of a touch in that time.
    let touches: Vec<(Vec3, f32)> = ticks.iter().filter(pressed).step_by(10).map(touched).collect();
    let places: Vec<Vec3> = touches.iter().map(|touch| touch.0).collect();
    if places.is_empty() {
        return None;
    }
    let around = Aabb::of_points(&places).inflated(3.0 * SPREAD_MM);
    let texel_mm = (around.size().max_element() / MAX_TEXELS as f32).max(TEXEL_MM);
    let mut sums = vec![0.0f32; dims(around, texel_mm).iter().map(|n| *n as usize).product()];
    let [nx, ny, _] = dims(around, texel_mm).map(|n| n as usize);
    let reach = (3.0 * SPREAD_MM / texel_mm).ceil() as i32;
    for (place, force) in &touches {
        let middle = ((*place - around.min) / texel_mm).round().as_ivec3();
        let offsets = || -reach..=reach;
        for (k, j, i) in offsets().flat_map(|k| offsets().flat_map(move |j| offsets().map(move |i| (k, j, i)))) {
            let texel = (middle + IVec3::new(i, j, k)).max(IVec3::ZERO).as_usizevec3();
            let apart = around.min + texel_mm * texel.as_vec3() - *place;
            if let Some(sum) =
                sums.get_mut(texel.x + nx * (texel.y + ny * texel.z)).filter(|_| texel.x < nx && texel.y < ny)
            {
                *sum += force * (-0.5 * apart.length_squared() / SPREAD_MM.powi(2)).exp();
            }
        }
    }
    let most = sums.iter().copied().fold(1e-9, f32::max);
    let mut at = 0;
    Some(paint(2, around, texel_mm, |_| {
        at += 1;
        let share = sums[at - 1] / most;
        if share > 0.02 { coloured(warm(share), 0.9 * share.sqrt()) } else { CLEAR }
    }))
}

/// A transparent texel.
const CLEAR: [u8; 4] = [0; 4];

/// Interpolates from yellow at 0 to vermilion at 1.
fn warm(share: f32) -> [f32; 3] {
    std::array::from_fn(|n| YELLOW[n] + share.clamp(0.0, 1.0) * (VERMILION[n] - YELLOW[n]))
}

/// Converts an sRGB colour to linear light.
fn coloured(srgb: [f32; 3], alpha: f32) -> [u8; 4] {
    let linear = |value: f32| (255.0 * (value / 255.0).powf(2.2)).round() as u8;
    let [r, g, b] = srgb;
    [linear(r), linear(g), linear(b), (255.0 * alpha.clamp(0.0, 1.0)).round() as u8]
}

fn dims(around: Aabb, texel_mm: f32) -> [u32; 3] {
    (around.size() / texel_mm).to_array().map(|n| n.ceil().clamp(1.0, 512.0) as u32 + 1)
}

/// Makes a box of colours, x fastest. `version` 1 is the operation, 2 the maps at the end.
fn paint(version: u64, around: Aabb, texel_mm: f32, mut colour: impl FnMut(Vec3) -> [u8; 4]) -> Paint {
    let dims = dims(around, texel_mm);
    let [nx, ny, nz] = dims;
    let mut rgba = Vec::with_capacity((nx * ny * nz) as usize);
    for (k, j, i) in (0..nz).flat_map(|k| (0..ny).flat_map(move |j| (0..nx).map(move |i| (k, j, i)))) {
        rgba.push(colour(around.min + texel_mm * Vec3::new(i as f32, j as f32, k as f32)));
    }
    Paint { origin: around.min, spacing_mm: Vec3::splat(texel_mm), dims, rgba, version }
}

#[cfg(test)]
mod tests {
    use super::*;
    use trepan_geometry::{Pose, Wrench};
    use trepan_haptics::script::Site;
    use trepan_volume::{AIR_HU, VoxelVolume};

    fn at(paint: &Paint, place: Vec3) -> [u8; 4] {
        let texel = ((place - paint.origin) / paint.spacing_mm).round().as_uvec3();
        paint.rgba[(texel.x + paint.dims[0] * (texel.y + paint.dims[1] * texel.z)) as usize]
    }

    #[test]
    fn plan_and_deviations_are_painted_at_their_places() {
        let mut ct = VoxelVolume::isotropic([50, 50, 14], Vec3::ZERO, 1.0, AIR_HU);
        ct.data[50 * 50 * 4..50 * 50 * 10].fill(1000);
        let bone = BoneVolume::new(&ct, 400).unwrap();
        let site = Site { entry: Vec3::new(25.0, 25.0, 9.5), inward: Vec3::NEG_Z, bone_mm: 6.0, brain_mm: 8.0 };
        let plan = Plan::new(Some(&bone), site, 5.0, 0.0).unwrap();
        let paint = planned(&plan, None);
        let alpha = |x: f32| at(&paint, Vec3::new(x, 25.0, 9.0))[3];
        assert!(alpha(30.0) > 200 && alpha(25.0) == 0 && alpha(34.0) == 0);
        for (x, y) in [(25, 25), (33, 25)] {
            bone.set_hu(IVec3::new(x, y, 8), AIR_HU);
        }
        let map = against(&plan, &bone);
        let colour = |x: f32| at(&map, Vec3::new(x, 25.0, 8.0));
        assert_eq!(colour(25.0), coloured(GREEN, 0.9));
        assert_eq!(colour(33.0), coloured(VERMILION, 1.0));
        assert_eq!((colour(27.0), colour(34.0), colour(36.0)), (coloured(SKY, 0.9), coloured(VERMILION, 1.0), CLEAR));
    }

    #[test]
    fn the_map_of_forces_is_hottest_where_the_brain_was_pressed_longest() {
        let touch = |x: f32| TickRecord {
            phase: 1,
            tissue_depth_mm: 1.0,
            contact_normal: Vec3::Z,
            proxy: Pose::from_translation(Vec3::new(x, 0.0, 2.0)),
            wrench: Wrench { force: 0.3 * Vec3::Z, torque: Vec3::ZERO },
            ..TickRecord::default()
        };
        let ticks: Vec<TickRecord> = (0..900).map(|n| touch(if n < 600 { 0.0 } else { 20.0 })).collect();
        let brain = DistanceField::of_mask(&VoxelVolume::isotropic([4; 3], Vec3::ZERO, 1.0, 0u8));
        let map = forces(&brain, &[Tool::probe(2.0)], &ticks).unwrap();
        let alpha = |x: f32| at(&map, Vec3::new(x, 0.0, 0.0))[3];
        assert!(alpha(0.0) > 215 && alpha(20.0) > 120 && alpha(20.0) < alpha(0.0) && alpha(10.0) == 0);
        assert!(forces(&brain, &[], &[]).is_none());
    }
}
