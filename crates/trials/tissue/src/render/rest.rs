//! Measures what the window draws without a graphics card, moving and at rest.
//!
//! # Practice
//! Pictures a second while the camera moves, by the fraction of pixels; how long edges take at rest
//! and what they gain. 1280x800, the window's default, with slices, by the processor. The error is
//! against 4 x 4 samples in every pixel of the 3-D view.

use super::scenes::{SKULLS, brain, frame, skull, swaying};
use glam::Vec3;
use trepan_evidence::part::Scope;
use trepan_evidence::suite::{Findings, Gate, Row};
use trepan_evidence::timer::Samples;
use trepan_geometry::{Pose, Quat, Tool};
use trepan_render::{Camera, Casting, Frame, Image, ProcessorRenderer, SceneData, SliceLook};

/// Fractions of pixels along an edge that the window uses, and 1.
const DETAILS: [f32; 5] = [1.0, 0.75, 0.5, 0.4, 0.3];

/// The built-in head with its brain, drawn moving and at rest.
pub fn run(scope: Scope, findings: &mut Findings) {
    let size = scope.pick([320, 200], [1280, 800]);
    let (_, dims, voxel_mm) = SKULLS[scope.pick(0, 2)];
    let bone = skull(dims, voxel_mm);
    let (mesh, mri) = brain(scope.pick(4000, 22_000));
    let sways: Vec<Vec<Vec3>> = (0..4).map(|turn| swaying(&mesh, turn)).collect();
    let bounds = bone.bounds();
    let data = SceneData { bone: Some(bone), brain: Some(&mesh), mri: Some(&mri), tint: None, cortex: None };
    let entry = bounds.centre() + Vec3::new(20.0, 60.0, 55.0);
    let shaft = Quat::from_rotation_arc(Vec3::Z, Vec3::new(0.4, 0.6, 0.7).normalize());
    let shown = |turn: usize| {
        let towards = Vec3::new(0.5 + 0.02 * turn as f32, 1.0, 0.45);
        Frame {
            camera: Camera::viewed_from(bounds.centre(), towards, 1.9 * bounds.size().max_element()),
            tool: Some(Tool::burr(3.0)),
            world_from_tool: Pose::from_parts(entry, shaft),
            brain_positions: Some(&sways[turn % sways.len()]),
            slices: SliceLook::default(),
            ..frame(Vec3::ZERO, towards, 1.0, 0.6)
        }
    };
    let scene = format!("head at {}x{}", size[0], size[1]);
    let mut processor = ProcessorRenderer::new(&data, size).expect("the scene loads");
    for detail in DETAILS {
        processor.resize(size.map(|n| (n as f32 * detail).round() as u32)).expect("the size is allowed");
        processor.set_casting(Casting { sparse: detail < 1.0, ..Casting::default() });
        processor.draw(&shown(0)).expect("drawn");
        let times = Samples::of(scope.pick(3, 9), |turn| {
            processor.draw(&shown(turn + 1)).expect("drawn");
        });
        let ms = 1e-3 * times.quantile(0.5);
        let row = Row::new(&scene, "processor, moving camera").with("detail", detail);
        let row = row.with("machine", format!("{} threads", processor.threads));
        findings.rows.push(row.metric("frame_p50_ms", ms).metric("frames_per_s", 1e3 / ms));
    }
    edges(&scene, &data, size, &shown(0), findings);
}

/// Edges of a picture at rest.
fn edges(scene: &str, data: &SceneData, size: [u32; 2], frame: &Frame, findings: &mut Findings) {
    let frame = &Frame { slices: SliceLook { shown: false, ..frame.slices }, ..*frame };
    let mut fine = ProcessorRenderer::new(data, size.map(|n| 4 * n)).expect("the scene loads");
    fine.draw(frame).expect("drawn");
    let reference = quartered(fine.image());
    drop(fine);
    let mut processor = ProcessorRenderer::new(data, size).expect("the scene loads");
    processor.draw(frame).expect("drawn");
    let before = processor.image().error_percent(&reference);
    let mut samples = 0;
    let times = Samples::of(16, |_| samples += u32::from(processor.refine(frame)));
    let after = processor.image().error_percent(&reference);
    let row = Row::new(scene, "processor, at rest").with("samples", samples);
    findings.rows.push(
        row.metric("error_sharp_percent", before)
            .metric("error_smooth_percent", after)
            .metric("sample_p50_ms", 1e-3 * times.quantile(0.5)),
    );
    findings.gates.push(Gate::at_most("edges at rest: error against 16 samples a pixel, percent", after, 1.0));
}

/// The mean of 4 x 4 pixels.
fn quartered(image: &Image) -> Image {
    let [width, height] = [image.width / 4, image.height / 4];
    let mean = |x: u32, y: u32, c: usize| {
        let sum: u32 = (0..16).map(|n| u32::from(image.pixel(4 * x + n % 4, 4 * y + n / 4)[c])).sum();
        ((sum + 8) / 16) as u8
    };
    let rgba = (0..width * height).flat_map(|n| [0, 1, 2, 3].map(|c| mean(n % width, n / width, c))).collect();
    Image { width, height, rgba }
}
