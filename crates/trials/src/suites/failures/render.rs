//! Picture: rays that pass through bone, or stop beside it.

use super::{Candidate, Family, Scope, Standing};
use crate::suites::render::accuracy::{march, rays};
use crate::suites::render::faults::{Drawer, drawers, made_or_empty};
use crate::suites::render::scenes::{ISO, frame};
use crate::suites::render::{By, EXACT, SPARSE};
use glam::{DVec3, Vec3};
use rayon::prelude::*;
use std::rc::Rc;
use std::sync::Arc;
use trepan_bone::BoneVolume;
use trepan_evidence::nearest::{Condition, Scale, Trial, exceeds};
use trepan_gpu::{Gpu, Prefer};
use trepan_render::Frame;

/// Share of the rays that may be wrong, and by how much, mm: half a voxel.
const MOST_SHARE: f64 = 0.02;
const MOST_MM: f64 = 0.5;
const SIZE: [u32; 2] = [24, 18];
/// Voxels of 1 mm along an axis.
const EDGE: usize = 30;
/// From where a plate is seen, mm, and the view's angle.
const AWAY_MM: f32 = 90.0;
const VIEW_RAD: f32 = 0.15;

/// A drawer and the device that it may draw on.
pub struct Picture {
    drawer: Drawer,
    gpu: Option<Rc<Gpu>>,
}

pub const FAMILY: Family<Picture> = Family {
    suite: "render",
    criterion: "a way to draw fails when more than 2 % of its rays hit where a march of 1/16 voxel in f64 hits nothing, \
                pass where it hits, or stop more than half a voxel from it",
    methods,
};

fn methods(scope: Scope) -> Vec<Candidate<Picture>> {
    let gpu = Gpu::open(Prefer::Hardware).ok().map(Rc::new);
    let candidate = |(name, drawer): (String, Drawer)| {
        let own = [EXACT.name, SPARSE.name].contains(&drawer.1.name);
        let standing = if own { Standing::Own } else { Standing::Rival };
        // A software device is slow to start, and starts anew for every bone.
        let conditions = if drawer.0 > 0 && scope.quick { &CONDITIONS[..1] } else { &CONDITIONS[..] };
        Candidate { name, standing, conditions, method: Picture { drawer, gpu: gpu.clone() } }
    };
    drawers(gpu.is_some()).into_iter().map(candidate).collect()
}

const AXES: [&str; 2] = ["ray", "distance of the hit, mm (0 = none)"];

const CONDITIONS: [Condition<Picture>; 4] = [
    Condition {
        name: "thickness of a plate",
        unit: "voxels",
        nominal: 3.0,
        limits: [0.02, 3.0],
        scale: Scale::Log,
        axes: AXES,
        trial: |by, thick| plate(by, thick, 60.0),
    },
    Condition {
        name: "diameter of rods",
        unit: "voxels",
        nominal: 6.0,
        limits: [0.25, 6.0],
        scale: Scale::Log,
        axes: AXES,
        trial: |by, diameter| rods(by, diameter, AWAY_MM),
    },
    Condition {
        name: "angle between ray and plate",
        unit: "°",
        nominal: 45.0,
        limits: [0.5, 45.0],
        scale: Scale::Log,
        axes: AXES,
        trial: |by, angle| plate(by, 3.0, angle),
    },
    Condition {
        name: "distance of the eye",
        unit: "mm",
        nominal: 90.0,
        limits: [90.0, 10_000.0],
        scale: Scale::Log,
        axes: AXES,
        trial: |by, away| rods(by, 6.0, away as f32),
    },
];

/// Draws bone where a signed distance in mm is over 0, 500 HU a voxel.
fn drawn(by: &Picture, inside_mm: impl Fn(DVec3) -> f64, frame: &Frame) -> Trial {
    match made_or_empty([EDGE; 3], |p| f64::from(ISO) + 500.0 * inside_mm(p)) {
        Ok(bone) => compared(by, &bone, frame),
        Err(fault) => Trial { fault: Some(format!("the volume is refused: {fault}")), trace: Vec::new() },
    }
}

/// A plate across the whole volume, its normal along nothing, seen at an angle to it, degrees.
fn plate(by: &Picture, thick_mm: f64, angle: f64) -> Trial {
    let normal = DVec3::new(0.36, 0.8, 0.48);
    let along = normal.any_orthonormal_vector();
    let (sin, cos) = angle.to_radians().sin_cos();
    let towards = (sin * normal + cos * along).as_vec3();
    drawn(by, |p| 0.5 * thick_mm - p.dot(normal).abs(), &frame(Vec3::ZERO, towards, AWAY_MM, VIEW_RAD))
}

/// Upright rods, three diameters apart.
fn rods(by: &Picture, diameter_mm: f64, away_mm: f32) -> Trial {
    let apart = 3.0 * diameter_mm;
    let beside = |x: f64| x - apart * (x / apart).round();
    let inside = |p: DVec3| 0.5 * diameter_mm - beside(p.x).hypot(beside(p.y));
    drawn(by, inside, &frame(Vec3::ZERO, Vec3::new(0.3, 1.0, 0.2), away_mm, 0.3))
}

fn compared(by: &Picture, bone: &Arc<BoneVolume>, frame: &Frame) -> Trial {
    let (number, setting) = by.drawer;
    let gpu = by.gpu.as_deref().filter(|_| number > 0);
    let mut drawer = By::all(bone, gpu, SIZE).remove(number);
    drawer.set(&setting, SIZE);
    drawer.draw(frame);
    let (hits, view) = (drawer.hits(), drawer.view(frame));
    let size = match &drawer {
        By::Processor(_) => SIZE.map(|n| (n as f32 * setting.detail).round() as u32),
        By::Device(device) => device.view_size(),
    };
    let rays: Vec<Vec3> = rays(&view, size).collect();
    let truth: Vec<Option<f64>> = rays.par_iter().map(|ray| march(bone, view.eye, *ray)).collect();
    let found = || hits.iter().map(|hit| hit.map(|hit| f64::from(hit.distance_mm)));
    let wrong = found().zip(&truth).filter(|(hit, truth)| match (hit, truth) {
        (Some(hit), Some(truth)) => exceeds((hit - truth).abs(), MOST_MM),
        (hit, truth) => hit.is_some() != truth.is_some(),
    });
    let (wrong, all) = (wrong.count(), truth.len());
    let fault = if hits.len() != all {
        Some(format!("{} rays of {all}", hits.len()))
    } else if wrong as f64 > MOST_SHARE * all as f64 {
        Some(format!("{wrong} of {all} rays are wrong"))
    } else {
        None
    };
    // The middle line of the picture.
    let line = (size[1] / 2 * size[0]) as usize..;
    let trace = found().skip(line.start).take(size[0] as usize).enumerate();
    Trial { fault, trace: trace.map(|(ray, hit)| (ray as f64, hit.unwrap_or(0.0))).collect() }
}
