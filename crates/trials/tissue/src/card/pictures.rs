//! Pictures on the card: bone, and bone with brain, every ray of every picture, and bone as it is
//! drilled.
//!
//! # Practice
//! The built-in skull on voxels of 0.5 mm, the brain in 22 thousand tetrahedra that sway. The
//! camera moves before each picture. Wall clock: a picture drawn and waited for, as a window
//! without vertical sync does. Device: the card's own clock over all passes.

use super::row;
use crate::render::scenes::{SKULLS, brain, frame, skull, swaying};
use glam::{IVec3, Vec3};
use trepan_evidence::part::Scope;
use trepan_evidence::suite::{Findings, Gate};
use trepan_evidence::timer::Samples;
use trepan_gpu::Gpu;
use trepan_render::{Frame, ProcessorRenderer, Renderer, SceneData};
use trepan_volume::AIR_HU;

const SIZES: [[u32; 2]; 2] = [[1280, 800], [3840, 2160]];

/// Each size with bone alone and with both, then a brick that changes.
pub fn run(gpu: &Gpu, scope: Scope, findings: &mut Findings) {
    let software = gpu.is_software();
    let (_, dims, voxel_mm) = SKULLS[if software { 0 } else { 4 }];
    let bone = skull(dims, voxel_mm);
    let (mesh, mri) = brain(if software { 4_000 } else { 22_000 });
    let sways: Vec<Vec<Vec3>> = (0..4).map(|turn| swaying(&mesh, turn)).collect();
    let (centre, width) = (bone.bounds().centre(), bone.bounds().size().max_element());
    let shown = |turn: usize, both: bool| {
        let towards = Vec3::new(0.5 + 0.02 * turn as f32, 1.0, 0.45);
        let positions = both.then(|| &sways[turn % sways.len()][..]);
        Frame { brain_positions: positions, ..frame(centre, towards, 1.9 * width, 0.6) }
    };
    let pictures = if software { 3 } else { scope.pick(20, 60) };
    for size in &SIZES[..if software { 1 } else { SIZES.len() }] {
        for both in [false, true] {
            let mut data = SceneData { bone: Some(bone.clone()), brain: None, mri: None, tint: None, cortex: None };
            if both {
                (data.brain, data.mri) = (Some(&mesh), Some(&mri));
            }
            let scene = format!("{} at {}x{}", if both { "bone and brain" } else { "bone" }, size[0], size[1]);
            let Ok(mut renderer) = Renderer::new(gpu, &data, *size) else { continue };
            let mut device = Vec::new();
            let mut draw = |turn: usize| {
                renderer.draw(&shown(turn, both)).expect("drawn");
                gpu.wait().expect("the device answers");
            };
            (0..3).for_each(&mut draw);
            let wall = Samples::of(pictures, draw);
            for turn in 0..pictures.min(20) {
                renderer.draw(&shown(turn, both)).expect("drawn");
                let passes = renderer.pass_times().unwrap_or_default();
                device.push(passes.iter().map(|pass| pass.us).sum());
            }
            let device = Samples::from(device);
            let (wall_ms, frames) = (1e-3 * wall.quantile(0.5), 1e6 / wall.quantile(0.5));
            findings.rows.push(
                row(&scene, gpu.name())
                    .metric("frame_p50_ms", wall_ms)
                    .metric("frame_p99_ms", 1e-3 * wall.quantile(0.99))
                    .metric("device_p50_ms", 1e-3 * device.quantile(0.5))
                    .metric("frames_per_s", frames),
            );
            if size[1] == 2160 {
                findings.gates.push(Gate::at_least(format!("{scene}: pictures a second"), frames, 60.0));
            }
            let mut by_processor = ProcessorRenderer::new(&data, *size).expect("the scene loads");
            let times = Samples::of(3, |turn| _ = by_processor.draw(&shown(turn, both)).expect("drawn"));
            let found = row(&scene, format!("processor, {} threads", by_processor.threads));
            let ms = 1e-3 * times.quantile(0.5);
            findings.rows.push(found.metric("frame_p50_ms", ms).metric("frames_per_s", 1e3 / ms));
        }
    }
    let data = SceneData { bone: Some(bone.clone()), brain: None, mri: None, tint: None, cortex: None };
    let Ok(mut renderer) = Renderer::new(gpu, &data, SIZES[0]) else { return };
    let mut draw = |turn: usize| {
        renderer.draw(&shown(turn, false)).expect("drawn");
        gpu.wait().expect("the device answers");
    };
    draw(0);
    let still = Samples::of(pictures, &mut draw);
    // Anew in each round: a burr's ball of 6 mm somewhere in the skull.
    let drilled = Samples::of(pictures, |round| {
        let at = bone.voxel_of(centre + 0.3 * width * Vec3::new((round as f32).cos(), (round as f32).sin(), 0.4));
        (0..12i32.pow(3)).for_each(|n| bone.set_hu(at + IVec3::new(n % 12, n / 12 % 12, n / 144), AIR_HU));
        draw(round);
    });
    let found = row("bone at 1280x800, a ball of bone drilled between pictures", gpu.name());
    let [still, drilled] = [still, drilled].map(|times| 1e-3 * times.quantile(0.5));
    findings.rows.push(found.metric("frame_p50_ms", drilled).metric("upload_ms", drilled - still));
}
