//! Measures frames a second for the thesis's skulls (Table 3.2) and a brain of 22,000 tetrahedra,
//! by processor and device; the camera moves.
//!
//! # Practice
//! The thesis draws 15 to 20 frames a second at 1680x1050 on the graphics card of its day. Times
//! are of whole pictures without slices, to the last pixel.

use super::scenes::{SKULLS, brain, frame, skull, swaying};
use super::{By, EXACT, SPARSE, Setting};
use glam::Vec3;
use std::sync::Arc;
use trepan_bone::BoneVolume;
use trepan_evidence::part::Scope;
use trepan_evidence::suite::{Findings, Row};
use trepan_evidence::timer::Samples;
use trepan_gpu::Gpu;
use trepan_render::{Camera, Cut, Frame, SceneData};

/// The table's skulls, then the brain alone, cut, and in its skull.
pub fn run(scope: Scope, gpu: Option<&Gpu>, findings: &mut Findings) {
    let size = scope.pick([480, 300], [1680, 1050]);
    let skulls = scope.pick(&SKULLS[..1], &SKULLS[..]);
    for &(name, dims, voxel_mm) in skulls {
        let bone = skull(dims, voxel_mm);
        let data = SceneData { bone: Some(bone.clone()), brain: None, mri: None, tint: None, cortex: None };
        measure(&format!("{name}, {}x{}x{}", dims[0], dims[1], dims[2]), &data, size, gpu, scope, findings, &[]);
    }
    let (mesh, mri) = brain(scope.pick(4000, 22_000));
    let sways: Vec<Vec<Vec3>> = (0..4).map(|turn| swaying(&mesh, turn)).collect();
    let (_, dims, voxel_mm) = skulls[skulls.len() / 2];
    let bone: Arc<BoneVolume> = skull(dims, voxel_mm);
    let name = format!("brain of {} tetrahedra", mesh.tets.len());
    let data = SceneData { bone: None, brain: Some(&mesh), mri: Some(&mri), tint: None, cortex: None };
    measure(&name, &data, size, gpu, scope, findings, &sways);
    measure(
        &format!("{name} in its skull"),
        &SceneData { bone: Some(bone), ..data },
        size,
        gpu,
        scope,
        findings,
        &sways,
    );
}

/// A scene from a camera that moves, with a brain that sways; a brain without a skull also cut in
/// the middle.
fn measure(
    scene: &str,
    data: &SceneData,
    size: [u32; 2],
    gpu: Option<&Gpu>,
    scope: Scope,
    findings: &mut Findings,
    sways: &[Vec<Vec3>],
) {
    let middle = data.bone.as_ref().map(|bone| bone.bounds()).or(data.brain.map(|mesh| mesh.bounds()));
    let bounds = middle.expect("there is something to see");
    let distance_mm = 1.9 * bounds.size().max_element();
    let shown = |turn: usize, cut: Option<Cut>| {
        let towards = Vec3::new(0.5 + 0.02 * (turn % 2) as f32, 1.0, 0.45);
        let camera = Camera::viewed_from(bounds.centre(), towards, distance_mm);
        let brain_positions = sways.get(turn % sways.len().max(1)).map(Vec::as_slice);
        Frame { camera, brain_positions, cut, ..frame(Vec3::ZERO, towards, 1.0, 0.6) }
    };
    let cut = Cut { point: bounds.centre(), normal: Vec3::Y, bone: false };
    for mut by in By::of(data, gpu, size) {
        let mut ways = vec![("", EXACT, None)];
        match (&by, &data.bone) {
            (_, None) => ways.push((": cut open", EXACT, Some(cut))),
            (By::Processor(_), Some(_)) => {
                let half = Setting { detail: 0.5, ..SPARSE };
                ways.extend([
                    (": sparse rays", SPARSE, None),
                    (": sparse rays, half the pixels along an edge", half, None),
                ]);
            }
            (By::Device(_), Some(_)) => (),
        }
        for (how, setting, cut) in ways {
            by.set(&setting, size);
            by.draw(&shown(1, cut));
            let times = Samples::of(scope.pick(2, 3), |turn| by.draw(&shown(turn, cut)));
            let ms = 1e-3 * times.quantile(0.5);
            let mut row = Row::new(format!("{scene} at {}x{}", size[0], size[1]), format!("{}{how}", by.name()))
                .with("machine", by.machine())
                .metric("frame_p50_ms", ms)
                .metric("frames_per_s", 1e3 / ms)
                .metric("ns_per_pixel", 1e6 * ms / f64::from(size[0] * size[1]));
            if let (By::Processor(p), Some(_)) = (&by, &data.bone) {
                row = row.metric("steps_per_ray", p.steps_per_ray());
            }
            findings.rows.push(row);
        }
    }
}
