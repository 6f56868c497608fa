//! Side by side with VTK's ray caster for processors, which runs as a program of its own in a
//! throw-away Python environment.
//!
//! # Practice
//! Needs Python 3 with `venv`, and its package index once; without them it says so and finds
//! nothing. `TREPAN_PYTHON` names another Python, one that may have VTK already. Both look at the
//! same shell from the same eye with all cores, while the camera moves. Each one's error is that of
//! its picture against its own with the finest steps, since their lamps differ; ours has shadows
//! and ambient light, VTK's has neither. VTK's time is that of the first distance of samples whose
//! error is no larger than ours.

use super::scenes::{ISO, frame, head};
use super::{By, EXACT, SPARSE, Setting};
use anyhow::{Context, Result, ensure};
use glam::Vec3;
use std::path::Path;
use trepan_evidence::part::{Part, Scope};
use trepan_evidence::suite::{Findings, Gate, Row};
use trepan_evidence::timer::Samples;
use trepan_render::{Casting, Image};
use trepan_trials_scenes::python::Workshop;

/// Draws with VTK.
const SCRIPT: &str = include_str!("rivals.py");
/// Distances between VTK's samples, voxels, finest first; the first is its reference.
const STEPS: [f64; 5] = [0.0625, 0.125, 0.25, 0.5, 1.0];

/// A shell by both.
pub fn parts(_: Scope) -> Vec<Part> {
    vec![Part::new("all", |scope, findings| findings.append(run(scope)))]
}

fn run(scope: Scope) -> Findings {
    let mut findings = Findings::default();
    let size = scope.pick([640, 480], [1680, 1050]);
    let edge = scope.pick(100, 160);
    match vtk(edge, size, 4) {
        Ok(theirs) => compare(edge, size, scope, &theirs, &mut findings),
        Err(fault) => println!("  left out, since there is no Python with VTK: {fault:#}"),
    }
    findings
}

/// What VTK took with a distance of samples, and how far its picture is from its finest.
struct Theirs {
    step_voxel: f64,
    ms: f64,
    error_percent: f64,
}

fn compare(edge: usize, size: [u32; 2], scope: Scope, theirs: &[Theirs], findings: &mut Findings) {
    let scene = format!("drilled shell of {edge} voxels at {}x{}", size[0], size[1]);
    let row = |method: String, ms: f64, error: f64| {
        Row::new(&scene, method).metric("frame_p50_ms", ms).metric("image_error_percent", error)
    };
    for t in theirs {
        findings.rows.push(row(format!("VTK: samples every {} voxel", t.step_voxel), t.ms, t.error_percent));
    }
    let [here, aside] =
        [0.0, 0.01].map(|turn| frame(Vec3::ZERO, Vec3::new(0.2 + turn, 1.0, 0.5), 1.75 * edge as f32, 0.6));
    let mut by = By::all(&head(edge), None, size).remove(0);
    by.set(&Setting { casting: Casting { step_voxel: Some(0.0625), ..EXACT.casting }, ..EXACT }, size);
    by.draw(&here);
    let reference = by.image();
    for setting in [EXACT, SPARSE] {
        by.set(&setting, size);
        by.draw(&aside);
        let times = Samples::of(scope.pick(3, 9), |n| by.draw(if n % 2 == 0 { &here } else { &aside }));
        let (ms, error) = (1e-3 * times.quantile(0.5), by.image().error_percent(&reference));
        let equal = theirs.iter().rev().find(|t| t.error_percent <= error).unwrap_or(&theirs[0]);
        let ratio = equal.ms / ms;
        findings
            .rows
            .push(row(format!("processor: {}", setting.name), ms, error).metric("times_as_fast_as_vtk_ratio", ratio));
        let name = format!("processor, {}: times as fast as VTK at no larger image error", setting.name);
        findings.gates.push(Gate::at_least(name, ratio, 5.0));
    }
}

/// VTK's times and errors, finest samples first.
fn vtk(edge: usize, size: [u32; 2], repeats: usize) -> Result<Vec<Theirs>> {
    let workshop = Workshop::with(&[("vtk", "vtk"), ("numpy", "numpy")], SCRIPT)?;
    let at = |name: &str| workshop.at(name);
    let bone = head(edge);
    let [nx, ny, nz] = bone.dims().map(|n| n as i32);
    let voxels = (0..nx * ny * nz).map(|n| bone.hu(glam::IVec3::new(n % nx, n / nx % ny, n / (nx * ny))));
    let bytes: Vec<u8> = voxels.flat_map(i16::to_le_bytes).collect();
    let view = frame(Vec3::ZERO, Vec3::new(0.2, 1.0, 0.5), 1.75 * edge as f32, 0.6).camera.view(1.0);
    let scene = serde_json::json!({
        "volume": at("volume.raw"), "dims": [nx, ny, nz], "spacing_mm": bone.spacing_mm(), "origin": bone.origin().to_array(),
        "isovalue": ISO, "eye": view.eye.to_array(), "target": [0, 0, 0], "up": view.up.to_array(),
        "fov_deg": 0.6f32.to_degrees(), "size": size, "repeats": repeats, "steps_voxel": STEPS,
    });
    let files = [("volume.raw", bytes), ("scene.json", scene.to_string().into())];
    files.into_iter().try_for_each(|(name, bytes)| std::fs::write(at(name), bytes))?;
    let output = workshop.run([at("scene.json"), at("picture")])?;
    let ms = output.lines().filter_map(|line| line.strip_prefix("ms ")?.split_once(' ')?.1.parse::<f64>().ok());
    let image = |n: usize| read(&at(&format!("picture{n}.rgb")), size);
    let finest = image(0)?;
    let theirs = ms
        .enumerate()
        .map(|(n, ms)| Ok(Theirs { step_voxel: STEPS[n], ms, error_percent: image(n)?.error_percent(&finest) }));
    let theirs = theirs.collect::<Result<Vec<_>>>()?;
    ensure!(theirs.len() == STEPS.len(), "VTK tells {} times", theirs.len());
    Ok(theirs)
}

/// A picture as VTK left it: three bytes a pixel.
fn read(path: &Path, [width, height]: [u32; 2]) -> Result<Image> {
    let rgb = std::fs::read(path).with_context(|| path.display().to_string())?;
    let whole = rgb.len() == 3 * (width * height) as usize;
    ensure!(whole, "{} has {} bytes; {width}x{height} pixels have 3 each", path.display(), rgb.len());
    Ok(Image { width, height, rgba: rgb.chunks_exact(3).flat_map(|p| [p[0], p[1], p[2], 255]).collect() })
}
