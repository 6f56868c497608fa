//! What leaping, sparse rays, steps and resolution cost, against the image error that they make.

use super::likeness::similarity;
use super::scenes::{frame, head};
use super::{By, EXACT, FINE_VOXEL, SPARSE, Setting};
use glam::Vec3;
use trepan_evidence::part::Scope;
use trepan_evidence::picture::{Chart, Mark};
use trepan_evidence::suite::{Findings, Gate, Row};
use trepan_evidence::timer::Samples;
use trepan_gpu::Gpu;
use trepan_render::Casting;

const fn stepped(name: &'static str, step: f32) -> Setting {
    Setting { name, casting: Casting { step_voxel: Some(step), ..EXACT.casting }, ..EXACT }
}

/// The first is what all pictures are drawn with; steps are the processor's alone.
pub(super) const SETTINGS: [Setting; 9] = [
    EXACT,
    SPARSE,
    Setting { name: "exact, no leaping", casting: Casting { leap: false, ..EXACT.casting }, ..EXACT },
    stepped("steps of 1/4 voxel", 0.25),
    stepped("steps of 1 voxel", 1.0),
    stepped("steps of 2 voxels", 2.0),
    Setting { name: "exact, 3/4 of the pixels along an edge", detail: 0.75, ..EXACT },
    Setting { name: "exact, 1/2 of the pixels along an edge", detail: 0.5, ..EXACT },
    Setting { name: "sparse rays, 1/2 of the pixels along an edge", detail: 0.5, ..SPARSE },
];

/// Steps and sparse rays are the processor's alone.
pub(super) fn known_to_device(setting: &Setting) -> bool {
    setting.casting.step_voxel.is_none() && !setting.casting.sparse
}

/// Time of a picture whose camera moves, against its difference from the processor's picture with
/// steps of 1/16 voxel.
pub fn run(scope: Scope, gpu: Option<&Gpu>, findings: &mut Findings) {
    let size = scope.pick([640, 480], [1680, 1050]);
    let bone = head(160);
    let here = frame(Vec3::ZERO, Vec3::new(0.2, 1.0, 0.5), 280.0, 0.6);
    let aside = frame(Vec3::ZERO, Vec3::new(0.21, 1.0, 0.5), 280.0, 0.6);
    let mut drawers = By::all(&bone, gpu, size);
    drawers[0].set(&stepped("reference", FINE_VOXEL as f32), size);
    drawers[0].draw(&here);
    let reference = drawers[0].image();
    let mut pictures = Vec::new();
    let mut chart = Chart {
        title: format!(
            "a drilled shell at {}x{}, the camera moves: step, resolution, leaping, sparse rays",
            size[0], size[1]
        ),
        cost: "frame_p50_ms".into(),
        error: "image_error_percent".into(),
        budget: Some((1e3 / 14.0, "14 frames/s".into())),
        ..Chart::default()
    };
    for by in &mut drawers {
        let device = matches!(by, By::Device(_));
        for setting in SETTINGS.iter().filter(|setting| !device || known_to_device(setting)) {
            by.set(setting, size);
            by.draw(&aside);
            // Each picture moves the camera, so every ray is cast; the last one is seen from here.
            let times = Samples::of(scope.pick(3, 9), |n| by.draw(if n % 2 == 0 { &here } else { &aside }));
            let image = by.image().enlarged(size);
            let mut row = Row::new(
                format!("drilled shell at {}x{}", size[0], size[1]),
                format!("{}: {}", by.name(), setting.name),
            )
            .with("machine", by.machine())
            .metric("frame_p50_ms", 1e-3 * times.quantile(0.5))
            .metric("frame_spread_percent", 100.0 * times.spread())
            .metric("frames_per_s", 1e6 / times.quantile(0.5))
            .metric("image_error_percent", image.error_percent(&reference))
            .metric("ssim", similarity(&image, &reference));
            if let By::Processor(p) = by {
                row = row.metric("steps_per_ray", p.steps_per_ray());
            }
            findings.rows.push(row);
            chart.marks.push(Mark {
                method: format!("{}: {}", by.name(), setting.name),
                cost: 1e-3 * times.quantile(0.5),
                error: image.error_percent(&reference),
            });
            if setting.name == SPARSE.name {
                let like = similarity(&image, &reference);
                findings.gates.push(Gate::at_least("sparse rays: SSIM to steps of 1/16 voxel", like, 0.99));
            }
            if setting.name == EXACT.name {
                let like = similarity(&image, &reference);
                findings.gates.push(Gate::at_least(format!("{}: SSIM to steps of 1/16 voxel", by.name()), like, 0.99));
                pictures.push(image);
            }
        }
    }
    if let [processor, device] = &pictures[..] {
        findings.gates.push(Gate::at_least("SSIM of device and processor", similarity(device, processor), 0.99));
    }
    findings.charts.push(chart);
}
