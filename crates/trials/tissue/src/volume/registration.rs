//! Known moves found again: of a real MRI onto itself, and of a real patient's MRI onto the CT.

use super::{data_folder, image, quantile};
use glam::{DAffine3, DMat3, DQuat, DVec3};
use std::time::Instant;
use trepan_evidence::part::Scope;
use trepan_evidence::suite::{Findings, Gate, Row};
use trepan_fixtures::case_head;
use trepan_volume::{Grid, Interpolation, RegistrationConfig, VoxelVolume, register, resample};

/// A move counts as recovered within these, mm and degrees.
const RIGHT: (f64, f64) = (1.0, 1.0);

/// An accepted answer further off than this is a wrong one, mm and degrees. The thick pair's voxels
/// are 4 mm high.
const BOUND: (f64, f64) = (3.0, 3.0);

/// Random moves of up to 20° and 30 mm, each onto its own turned grid with its own grey values and
/// noise.
pub fn mri(scope: Scope, findings: &mut Findings) {
    let trials = scope.pick(4, 100);
    let still = image(&case_head().mri);
    let (low, high) = still.world_corners();
    let middle = 0.5 * (low + high);
    let mut random = scope.random(7);
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
    let way = way * random.f64() * 30.0;
    DAffine3::from_translation(middle + way) * DAffine3::from_quat(turn) * DAffine3::from_translation(-middle)
}

/// A turn around the middle and a way along the diagonal.
pub(super) fn moved_by(middle: DVec3, way_mm: f64, turn: DQuat) -> DAffine3 {
    let way = DVec3::splat(way_mm / 3f64.sqrt());
    DAffine3::from_translation(middle + way) * DAffine3::from_quat(turn) * DAffine3::from_translation(-middle)
}

pub(super) fn scanned_again(still: &VoxelVolume<f32>, known: DAffine3, random: &mut fastrand::Rng) -> VoxelVolume<f32> {
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

/// Registers an MRI that was moved against the CT. One patient's is as delivered (with the
/// reference registration as truth) and as resampled onto the CT, with its padding; another
/// patient's must be refused.
pub fn ct(scope: Scope, findings: &mut Findings) {
    let Some(data) = data_folder() else { return };
    let pair = data.join("ct-mri-pair-thick");
    let (ct, delivered) = (image(&pair.join("ct_hu.nii.gz")), image(&pair.join("mri_t1.nii.gz")));
    let mut moved_back = delivered;
    moved_back.world_from_voxel = REFERENCE.inverse() * moved_back.world_from_voxel;
    let resampled = image(&pair.join("mri_t1_registered_to_ct.nii.gz"));
    let trials = scope.pick(2, 60);
    for (scene, still) in [("CT and MRI as delivered", moved_back), ("CT and MRI with padding", resampled)] {
        let tally = Tally::of(&ct, &still, trials, scope);
        findings.gates.push(Gate::at_most(
            format!("{scene}: accepted and off by over 3 mm or 3 degrees"),
            tally.wrong,
            0.0,
        ));
        let share = 100.0 * tally.recovered / trials as f64;
        findings.gates.push(Gate::at_least(
            format!("{scene}: moves recovered to 3 mm and 3 degrees, percent"),
            share,
            90.0,
        ));
        findings.rows.push(tally.row(scene, trials));
    }
    let other = image(&case_head().mri);
    let trials = scope.pick(1, 20);
    let tally = Tally::of(&ct, &other, trials, scope);
    let share = 100.0 * tally.refused / trials as f64;
    findings.gates.push(Gate::at_least("moves of another patient's MRI refused, percent", share, 100.0));
    findings.rows.push(tally.row("CT and another patient's MRI", trials));
}

/// From the CT's world into the delivered MRI's, RAS mm: the data set's own registration.
const REFERENCE: DAffine3 = DAffine3 {
    matrix3: DMat3::from_cols(
        DVec3::new(0.996_605, -0.082_326, 0.001_068),
        DVec3::new(0.082_321, 0.996_153, -0.030_033),
        DVec3::new(0.001_408, 0.030_019, 0.999_548),
    ),
    translation: DVec3::new(-4.446_998, 17.714_118, -25.710_057),
};

/// What became of some moves.
#[derive(Default)]
struct Tally {
    recovered: f64,
    refused: f64,
    wrong: f64,
    /// Of what was accepted.
    mm: Vec<f64>,
    degrees: Vec<f64>,
    seconds: Vec<f64>,
    least_confidence: f64,
}

impl Tally {
    fn of(ct: &VoxelVolume<f32>, still: &VoxelVolume<f32>, trials: usize, scope: Scope) -> Self {
        let (low, high) = ct.world_corners();
        let middle = 0.5 * (low + high);
        let mut random = scope.random(11);
        let mut tally = Self { least_confidence: 1.0, ..Self::default() };
        for _ in 0..trials {
            let known = random_move(middle, &mut random);
            let mut grid = Grid::of(still);
            grid.world_from_voxel = known.inverse() * grid.world_from_voxel;
            let mut moving = resample(still, &grid, Interpolation::Trilinear, 0.0);
            moving.world_from_voxel = known * grid.world_from_voxel;
            let start = Instant::now();
            let found = register(ct, &moving, &RegistrationConfig::default());
            tally.seconds.push(start.elapsed().as_secs_f64());
            let Ok(found) = found else {
                tally.refused += 1.0;
                continue;
            };
            let error = found.fixed_from_moving * known;
            let mm = error.transform_point3(middle).distance(middle);
            let degrees = DQuat::from_mat3(&error.matrix3).to_scaled_axis().length().to_degrees();
            let right = mm <= BOUND.0 && degrees <= BOUND.1;
            tally.recovered += f64::from(u8::from(right));
            tally.wrong += f64::from(u8::from(!right));
            tally.least_confidence = tally.least_confidence.min(found.confidence);
            tally.mm.push(mm);
            tally.degrees.push(degrees);
        }
        tally
    }

    fn row(mut self, scene: &str, trials: usize) -> Row {
        let row = Row::new(scene, "register")
            .with("trials", trials)
            .metric("recovered", self.recovered)
            .metric("refused", self.refused)
            .metric("wrongly_accepted", self.wrong)
            .metric("cost_s", quantile(&mut self.seconds, 0.5));
        if self.mm.is_empty() {
            return row;
        }
        row.metric("least_confidence", self.least_confidence)
            .metric("error_p50_mm", quantile(&mut self.mm, 0.5))
            .metric("error_p95_mm", quantile(&mut self.mm, 0.95))
            .metric("error_max_mm", quantile(&mut self.mm, 1.0))
            .metric("error_max_deg", quantile(&mut self.degrees, 1.0))
    }
}
