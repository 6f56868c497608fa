//! Volumes: registration of known MRI motions, file round trips, distance fields, and the brain
//! mask
//! of the built-in head.

mod files;
mod moves;
mod registration;

use std::time::Instant;
use trepan_evidence::part::{Part, Scope};
use trepan_evidence::suite::{Findings, Gate, Row};
use trepan_fixtures::case_head;
use trepan_geometry::{Vec3, quantile};
use trepan_volume::{
    BrainConfig, DistanceField, Grid, Interpolation, VoxelVolume, brain_mask, hounsfield, nifti, nrrd, read, resample,
};

/// Lists a part for every subject.
pub fn parts(scope: Scope) -> Vec<Part> {
    type Question = fn(Scope, &mut Findings);
    let all: [(&str, Question); 7] = [
        ("registration of MRI", registration::mri),
        ("registration of CT", registration::ct),
        ("files", files::files),
        ("round trips", round_trips),
        ("distances", distances),
        ("carving", carving),
        ("brain", brain),
    ];
    let mut parts: Vec<Part> = all.map(|(name, question)| Part::new(name, question)).into();
    if !scope.quick {
        parts.push(Part::new("odd moves", moves::run));
    }
    parts
}

/// Folder of real images named by the environment variable `TREPAN_DATA`; prints a note if there is
/// none.
fn data_folder() -> Option<std::path::PathBuf> {
    let folder = std::env::var_os("TREPAN_DATA").map(std::path::PathBuf::from).filter(|folder| folder.is_dir());
    if folder.is_none() {
        eprintln!("volume: real files are skipped: set TREPAN_DATA to the folder that holds them");
    }
    folder
}

fn image(path: &std::path::Path) -> VoxelVolume<f32> {
    read(path).expect("the built-in case is whole")
}

fn round_trips(_: Scope, findings: &mut Findings) {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let case = case_head();
    for (scene, from) in [("CT", &case.ct), ("MRI", &case.mri)] {
        let volume = image(from);
        for name in ["there.nii", "there.nii.gz", "there.nrrd"] {
            let path = folder.path().join(name);
            let written =
                if name.ends_with("nrrd") { nrrd::write(&path, &volume) } else { nifti::write(&path, &volume) };
            written.expect("the temporary folder has room");
            let start = Instant::now();
            let back = image(&path);
            let seconds = start.elapsed().as_secs_f64();
            let wrong = volume.data.iter().zip(&back.data).filter(|(a, b)| a.to_bits() != b.to_bits()).count();
            let same_place = back.dims == volume.dims && back.world_from_voxel == volume.world_from_voxel;
            let wrong = if same_place { wrong as f64 } else { f64::INFINITY };
            findings.gates.push(Gate::at_most(format!("{scene} voxels changed through {name}"), wrong, 0.0));
            findings.rows.push(
                Row::new(format!("{scene} written and read"), name)
                    .metric("cost_s", seconds)
                    .metric("read_million_voxels_per_s", 1e-6 * volume.data.len() as f64 / seconds),
            );
        }
    }
}

fn distances(scope: Scope, findings: &mut Findings) {
    let edge = scope.pick(64, 128);
    let radius = 0.31 * edge as f32;
    let mut ball = VoxelVolume::isotropic([edge; 3], Vec3::splat(-0.5 * edge as f32), 1.0, 0f32);
    for at in 0..ball.data.len() {
        ball.data[at] = radius - ball.centre_of([at % edge, at / edge % edge, at / (edge * edge)]).length() as f32;
    }
    for (method, level) in [("level", true), ("mask", false)] {
        let start = Instant::now();
        let field = match level {
            true => DistanceField::of_level(&ball, 0.0),
            false => DistanceField::of_mask(&ball.map(|v| u8::from(v >= 0.0))),
        };
        let seconds = start.elapsed().as_secs_f64();
        let truth = ball.data.iter().map(|v| -v);
        let mut errors: Vec<f64> =
            field.values().data.iter().zip(truth).map(|(a, b)| f64::from((a - b).abs())).collect();
        findings.rows.push(
            Row::new("distances to a ball", method)
                .with("voxels", ball.data.len())
                .metric("cost_s", seconds)
                .metric("error_p95_mm", quantile(&mut errors, 0.95))
                .metric("error_max_mm", quantile(&mut errors, 1.0)),
        );
    }
}

/// Bites out of a skull: compares the distance updated around each bite with one computed from
/// scratch.
fn carving(scope: Scope, findings: &mut Findings) {
    const REACH_MM: f32 = 5.0;
    let edge = scope.pick(96, 192);
    let mut skull = VoxelVolume::isotropic([edge; 3], Vec3::splat(-0.25 * edge as f32), 0.5, 0f32);
    let (outer, centre) = (0.22 * edge as f32, |skull: &VoxelVolume<f32>, at: usize| {
        skull.centre_of([at % edge, at / edge % edge, at / (edge * edge)]).as_vec3()
    });
    for at in 0..skull.data.len() {
        skull.data[at] = 3.0 - (centre(&skull, at).length() - outer + 3.0).abs();
    }
    let mut field = DistanceField::of_level(&skull, 0.0);
    let (mut local, mut whole, mut worst) = (f64::INFINITY, f64::INFINITY, 0f32);
    for bite in 0..scope.pick(3, 10) {
        let place = Vec3::new((0.3 * bite as f32).sin(), 0.0, (0.3 * bite as f32).cos()) * outer;
        for at in 0..skull.data.len() {
            let away = centre(&skull, at).distance(place) - 2.0;
            skull.data[at] = skull.data[at].min(away);
        }
        let voxel =
            |p: Vec3| [p.x, p.y, p.z].map(|x| ((x + 0.25 * edge as f32) / 0.5).clamp(0.0, edge as f32 - 1.0) as usize);
        // Voxels further than 3 mm from the bite's surface keep their values.
        let changed = [voxel(place - 6.0), voxel(place + 6.0)];
        let start = Instant::now();
        field.update(|p| skull.data[skull.index(p)], changed, REACH_MM);
        local = local.min(start.elapsed().as_secs_f64());
        let start = Instant::now();
        let truth = DistanceField::of_level(&skull, 0.0);
        whole = whole.min(start.elapsed().as_secs_f64());
        for (found, truth) in field.values().data.iter().zip(&truth.values().data) {
            worst = worst.max((found.clamp(-REACH_MM, REACH_MM) - truth.clamp(-REACH_MM, REACH_MM)).abs());
        }
    }
    findings.gates.push(Gate::at_most("distance after carving against a full computation, mm", worst.into(), 1e-3));
    findings.rows.push(
        Row::new("a bite of 2 mm out of a skull, reach 5 mm", "update")
            .with("voxels", skull.data.len())
            .metric("cost_s", local)
            .metric("share_of_full_cost", local / whole)
            .metric("error_max_mm", worst.into()),
    );
}

fn brain(_: Scope, findings: &mut Findings) {
    let case = case_head();
    let (ct, mri, truth) = (image(&case.ct), image(&case.mri), image(&case.labels));
    let ct = hounsfield(&ct).expect("the built-in CT is in HU");
    let start = Instant::now();
    let mask = brain_mask(&mri, Some(&ct), &BrainConfig::default()).expect("the built-in head has a brain");
    let seconds = start.elapsed().as_secs_f64();
    let truth = resample(&truth, &Grid::of(&mask), Interpolation::Nearest, 0.0);
    let count = |f: &dyn Fn(bool, bool) -> bool| {
        mask.data.iter().zip(&truth.data).filter(|&(&m, &t)| f(m != 0, t != 0.0)).count() as f64
    };
    let dice = 2.0 * count(&|m, t| m && t) / (count(&|m, _| m) + count(&|_, t| t));
    findings
        .rows
        .push(Row::new("brain of the built-in head", "brain_mask").metric("cost_s", seconds).metric("dice", dice));
}
