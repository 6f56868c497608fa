//! Volumes: known moves of a real MRI found again, files round trips, a ball's distances, the brain of the built-in head.

use super::Scope;
use crate::suite::{Findings, Gate, Row};
use glam::{DAffine3, DQuat, DVec3};
use std::time::Instant;
use trepan_fixtures::case_head;
use trepan_geometry::Vec3;
use trepan_volume::{
    BrainConfig, DistanceField, Grid, Interpolation, RegistrationConfig, VoxelVolume, brain_mask, hounsfield, nifti,
    nrrd, read, register, resample,
};

/// A move counts as recovered within these.
const RIGHT: (f64, f64) = (1.0, 1.0);

/// Every question.
pub fn run(scope: Scope) -> Findings {
    let mut findings = Findings::default();
    let rows: [fn(Scope, &mut Findings); 4] = [registration, round_trips, distances, brain];
    for (_, row) in rows.into_iter().enumerate().filter(|(number, _)| scope.takes(number + 1)) {
        row(scope, &mut findings);
    }
    findings
}

fn image(path: &std::path::Path) -> VoxelVolume<f32> {
    read(path).expect("the built-in case is whole")
}

/// Random moves of up to 20° and 30 mm, each onto its own turned grid with its own grey values and noise.
fn registration(scope: Scope, findings: &mut Findings) {
    let trials = scope.pick(4, 100);
    let still = image(&case_head().mri);
    let (low, high) = still.world_corners();
    let middle = 0.5 * (low + high);
    let mut random = fastrand::Rng::with_seed(7);
    let (mut mm, mut degrees, mut seconds) = (Vec::new(), Vec::new(), Vec::new());
    for _ in 0..trials {
        let known = random_move(middle, &mut random);
        let moving = scanned_again(&still, known, &mut random);
        let start = Instant::now();
        let found = register(&still, &moving, &RegistrationConfig::default());
        seconds.push(start.elapsed().as_secs_f64());
        let error = found.map_or(DAffine3::from_translation(DVec3::splat(1e3)), |f| f.fixed_from_moving * known);
        mm.push((error.transform_point3(middle) - middle).length());
        degrees.push(DQuat::from_mat3(&error.matrix3).to_scaled_axis().length().to_degrees());
    }
    let right = mm.iter().zip(&degrees).filter(|&(&mm, &turn)| mm <= RIGHT.0 && turn <= RIGHT.1).count();
    let share = 100.0 * right as f64 / trials as f64;
    findings.gates.push(Gate::at_least("moves of the MRI recovered to 1 mm and 1 degree, percent", share, 95.0));
    findings.rows.push(
        Row::new("moves up to 20 degrees and 30 mm", "register")
            .with("trials", trials)
            .metric("recovered_percent", share)
            .metric("error_p50_mm", quantile(&mut mm, 0.5))
            .metric("error_p95_mm", quantile(&mut mm, 0.95))
            .metric("error_p50_deg", quantile(&mut degrees, 0.5))
            .metric("error_p95_deg", quantile(&mut degrees, 0.95))
            .metric("cost_s", quantile(&mut seconds, 0.5)),
    );
}

fn random_move(middle: DVec3, random: &mut fastrand::Rng) -> DAffine3 {
    let mut direction = || loop {
        let v = DVec3::new(random.f64(), random.f64(), random.f64()) * 2.0 - 1.0;
        if (0.01..1.0).contains(&v.length_squared()) {
            return v.normalize();
        }
    };
    let (axis, way) = (direction(), direction());
    let turn = DQuat::from_axis_angle(axis, random.f64() * 20f64.to_radians());
    DAffine3::from_translation(middle + way * random.f64() * 30.0)
        * DAffine3::from_quat(turn)
        * DAffine3::from_translation(-middle)
}

fn scanned_again(still: &VoxelVolume<f32>, known: DAffine3, random: &mut fastrand::Rng) -> VoxelVolume<f32> {
    let mut grid = Grid::isotropic_over(still, 1.2);
    grid.world_from_voxel = known.inverse() * grid.world_from_voxel;
    let mut moving = resample(still, &grid, Interpolation::Trilinear, 0.0);
    moving.world_from_voxel = known * grid.world_from_voxel;
    moving
        .data
        .iter_mut()
        .for_each(|v| *v = 900.0 * (*v / 255.0).powf(0.7) + 40.0 * (random.f32() + random.f32() - 1.0));
    moving
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

fn quantile(values: &mut [f64], share: f64) -> f64 {
    values.sort_by(f64::total_cmp);
    values[((values.len() - 1) as f64 * share).round() as usize]
}
