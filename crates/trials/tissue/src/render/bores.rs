//! Bores drilled through voxels of 1 mm, seen through the microscope: against a march through their
//! closed form, and what they cost.
//!
//! # Practice
//! Surfaces are compared, lit by one lamp without shadows: colour and ambient light depend on the
//! voxels and not on the bore.

use super::likeness::similarity;
use super::scenes::{ISO, frame};
use super::{By, EXACT, Hits};
use glam::{DVec3, Vec2, Vec3};
use std::sync::Arc;
use trepan_bone::BoneVolume;
use trepan_evidence::part::Scope;
use trepan_evidence::suite::{Findings, Gate, Row};
use trepan_evidence::timer::Samples;
use trepan_geometry::{Pose, Tool, ToolState};
use trepan_gpu::Gpu;
use trepan_render::{Hit, Image, View};
use trepan_rigid::{Method, RigidStep};
use trepan_volume::{AIR_HU, VoxelVolume};

/// Half the thickness of the plate, mm.
const HALF_MM: f64 = 2.6;
/// Where the bore's axis meets the plate's middle, mm.
const AXIS: Vec3 = Vec3::new(0.3, -0.4, 0.0);
/// Radii of the burrs, mm.
const RADII_MM: [f32; 2] = [1.5, 0.75];
/// Widths of the microscope's field, mm.
const FIELDS_MM: [f32; 2] = [9.0, 4.5];
/// Least SSIM of a bore's surface to its closed form.
const LIKE: f64 = 0.99;
/// Step of the march, mm.
const STEP_MM: f64 = 1.0 / 128.0;

/// A plate of bone, across z.
fn plate() -> Arc<BoneVolume> {
    let mut ct = VoxelVolume::isotropic([24; 3], Vec3::splat(-11.5), 1.0, AIR_HU);
    for at in 0..ct.data.len() {
        let p = ct.centre_of([at % 24, at / 24 % 24, at / 576]);
        ct.data[at] = (f64::from(ISO) + 300.0 * (HALF_MM - p.z.abs())).clamp(-1000.0, 1400.0) as i16;
    }
    Arc::new(BoneVolume::new(&ct, ISO).expect("the plate is bone"))
}

/// Drills through the plate along its normal, at 5 mm/s.
fn drill(bone: &BoneVolume, radius_mm: f32) {
    let mut burr = Method::RECOMMENDED.build(&Tool::burr(radius_mm));
    let mut step = RigidStep::default();
    burr.reset(Pose::from_translation(AXIS + 8.0 * Vec3::Z));
    for ms in 0..4000 {
        let tip = AXIS + Vec3::Z * (8.0 - 0.005 * ms as f32).max(-6.0);
        burr.step(bone, &ToolState::at(Pose::from_translation(tip)), true, 1.0, &mut step);
    }
}

/// Hits of the plate with a round bore.
fn truth(view: &View, [width, height]: [u32; 2], radius_mm: f64) -> Hits {
    let outside = |p: DVec3| (p.z.abs() - HALF_MM).max(radius_mm - (p - AXIS.as_dvec3()).with_z(0.0).length());
    let pixels = (0..width * height).map(|n| Vec2::new((n % width) as f32 + 0.5, (n / width) as f32 + 0.5));
    let rays = pixels.map(|p| view.ray(Vec2::new(2.0 * p.x / width as f32 - 1.0, 1.0 - 2.0 * p.y / height as f32)));
    let hit = |along: Vec3| {
        let (eye, along) = (view.eye.as_dvec3(), along.as_dvec3());
        let top = (HALF_MM - eye.z) / along.z;
        let count = ((-HALF_MM - eye.z) / along.z - top) / STEP_MM;
        let at =
            (0..=count as u32).map(|n| top + STEP_MM * f64::from(n)).find(|&t| outside(eye + t * along) <= 1e-6)?;
        let rise = |axis: DVec3| outside(eye + at * along + 1e-3 * axis) - outside(eye + at * along - 1e-3 * axis);
        let normal = DVec3::from(DVec3::AXES.map(rise)).normalize().as_vec3();
        Some(Hit { distance_mm: at as f32, normal })
    };
    rays.map(hit).collect()
}

/// The surface alone under a lamp.
fn lit(hits: &Hits, [width, height]: [u32; 2]) -> Image {
    let lamp = Vec3::new(-0.5, 0.3, 0.8).normalize();
    let grey = |hit: &Option<Hit>| hit.map_or(0, |hit| (40.0 + 200.0 * hit.normal.dot(lamp).max(0.0)) as u8);
    Image { width, height, rgba: hits.iter().map(grey).flat_map(|v| [v, v, v, 255]).collect() }
}

/// Each burr's bore by every drawer.
pub fn run(scope: Scope, gpu: Option<&Gpu>, findings: &mut Findings) {
    let size = scope.pick([240, 200], [640, 480]);
    for (radius, field_mm) in RADII_MM.into_iter().flat_map(|radius| FIELDS_MM.map(|field_mm| (radius, field_mm))) {
        let (bone, whole) = (plate(), plate());
        drill(&bone, radius);
        let view_of = |turn: f32| {
            let towards_eye = Vec3::new(0.25 + turn, 0.5, 1.0);
            frame(AXIS.with_z(HALF_MM as f32), towards_eye, 250.0, field_mm / 250.0)
        };
        let (here, aside) = (view_of(0.0), view_of(0.01));
        let drawers = By::all(&bone, gpu, size).into_iter().zip(By::all(&whole, gpu, size));
        for (mut by, mut uncut) in drawers {
            let ms = |by: &mut By| {
                by.set(&EXACT, size);
                let draw = |n: usize| by.draw(if n.is_multiple_of(2) { &here } else { &aside });
                1e-3 * Samples::of(scope.pick(3, 9), draw).quantile(0.5)
            };
            let (cost, before) = (ms(&mut by), ms(&mut uncut));
            by.draw(&here);
            let (hits, truth) = (by.hits(), truth(&by.view(&here), size, radius.into()));
            let (errors, lost) = super::accuracy::apart(&hits, &truth);
            let p95 = errors.get(errors.len() * 95 / 100).copied().unwrap_or(f64::NAN);
            let like = similarity(&lit(&hits, size), &lit(&truth, size));
            let scene = format!("bore of {} mm in voxels of 1 mm, field of {field_mm} mm", 2.0 * radius);
            let name = format!("{}: {scene}: SSIM of its surface to the closed form", by.name());
            let gate = Gate::at_least(name, like, LIKE);
            let row = Row::new(scene, by.name());
            findings.rows.push(
                row.with("rays", hits.len())
                    .with("machine", by.machine())
                    .metric("ssim", like)
                    .metric("depth_error_p95_mm", p95)
                    .metric("hits_on_one_side_percent", 100.0 * lost as f64 / hits.len() as f64)
                    .metric("frame_p50_ms", cost)
                    .metric("frame_before_the_bore_p50_ms", before),
            );
            findings.gates.push(gate);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_burr_drills_the_round_bore_that_the_picture_is_compared_with() {
        let mut findings = Findings::default();
        run(Scope { quick: true, seed: 1 }, None, &mut findings);
        assert_eq!(findings.gates.len(), RADII_MM.len() * FIELDS_MM.len());
        findings.rows.iter().for_each(|row| println!("{row:?}"));
        assert!(!findings.gates.iter().any(Gate::breaks), "{:?}", findings.gates);
    }
}
