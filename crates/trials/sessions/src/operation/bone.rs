//! What the hand must feel of the bone along the operation's path, by the f64 truth.
//!
//! # Theory
//! The path is the planned script, the same for every run; the bone is the CT as the scanner gave
//! it, trilinear, and nothing of the judged method takes part. The force is the depth times the
//! stiffness of the contact, without damping, vibration and guard:
//! ```text
//! f = k (proxy - device)        error = |f - f of the truth|
//! ```
//! The truth ends with the last tick of the pedal: the way out and the probe at the rim are not
//! judged.
//!
//! The budget changes one thing at a time and leaves the rest exact.

use super::Scope;
use crate::scripted::{FELT_N, OPENING, milliseconds, path};
use anyhow::Result;
use glam::DVec3;
use trepan_bone::BoneVolume;
use trepan_evidence::suite::{Findings, Row};
use trepan_geometry::{Buttons, Tool, Vec3, quantile};
use trepan_haptics::script::{Script, Site};
use trepan_patient::{Cache, Recipe, Scene, open_case};
use trepan_rigid::removal::RemovalLaw;
use trepan_rigid::truth::{Ball, Bone, Scan};
use trepan_rigid::{Method, RigidStep};
use trepan_stages::Program;
use trepan_trials_bone::rigid;
use trepan_trials_scenes::case;
use trepan_volume::{AIR_HU, Grid, Interpolation, VoxelVolume, resample, skull_only};

/// Stiffness of the contact with bone, N/mm.
const STIFFNESS: f64 = 2.0;
/// Radius of the tray's first burr, which the script drills with, mm.
const BURR_MM: f32 = 3.0;
/// How far around the entry bone is looked for, mm: further than any tool reaches into it.
const AROUND_MM: f64 = 30.0;

/// When the burr works for the last time, ms: so far the truth goes.
fn last_cut_ms(scope: Scope, path: &Script) -> u64 {
    (1..=milliseconds(scope)).rfind(|ms| path.at(*ms as f64).buttons.has(Buttons::PEDAL)).unwrap_or(0)
}

/// What the hand feels at each tick: from the device to where the tool is held, mm.
pub struct ProxyOffsets {
    /// At each tick.
    pub lifted: Vec<DVec3>,
    /// Whether the burr works.
    pub drilling: Vec<bool>,
}

/// Errors of force on bone against the truth.
pub struct BoneErrors {
    /// Of ticks at which one of the two feels something, N.
    all_n: Vec<f64>,
    /// The same while the burr works.
    drilling_n: Vec<f64>,
    /// Angle between the normals, degrees, where both feel something.
    normal_deg: Vec<f64>,
}

impl ProxyOffsets {
    /// What a run of the operation felt.
    pub fn of(lifted: &[Vec3]) -> Self {
        Self { lifted: lifted.iter().map(|v| v.as_dvec3()).collect(), drilling: Vec::new() }
    }

    /// The truth on a CT, with ticks of `dt_ms`; every whole ms is kept.
    fn exact(scan: Scan, path: &Script, until_ms: u64, ticks_per_ms: u32) -> Self {
        let (mut bone, law) = (Bone::new(scan), RemovalLaw::RATE);
        let start = path.at(0.0).tip().as_dvec3();
        let mut ball = Ball::new(BURR_MM, start);
        let mut felt = Self { lifted: Vec::new(), drilling: Vec::new() };
        for tick in 1..=until_ms * u64::from(ticks_per_ms) {
            let tool = path.at(tick as f64 / f64::from(ticks_per_ms));
            let device = tool.tip().as_dvec3();
            let lifted = ball.follow(&bone, device);
            let drilling = tool.buttons.has(Buttons::PEDAL);
            if tick % u64::from(ticks_per_ms) == 0 {
                felt.lifted.push(lifted);
                felt.drilling.push(drilling);
            }
            if drilling {
                let axis = (tool.world_from_tool.rotation * Vec3::Z).as_dvec3();
                ball.drill(&mut bone, (device, axis), &law, 1.0 / ticks_per_ms as f32);
            }
        }
        felt
    }

    /// What the recommended method feels in the same voxels, contact and removal alone.
    fn by_method(ct: &VoxelVolume<i16>, isovalue: i16, path: &Script, until_ms: u64) -> Self {
        let bone = BoneVolume::new(ct, isovalue).expect("the skull has bone");
        let (mut contact, mut out) = (Method::RECOMMENDED.build(&Tool::burr(BURR_MM)), RigidStep::default());
        contact.reset(path.at(0.0).world_from_tool);
        let mut felt = Self { lifted: Vec::new(), drilling: Vec::new() };
        for ms in 1..=until_ms {
            let tool = path.at(ms as f64);
            contact.step(&bone, &tool, tool.buttons.has(Buttons::PEDAL), 1.0, &mut out);
            felt.lifted.push((out.manifold.depth_mm * out.manifold.normal).as_dvec3());
            felt.drilling.push(tool.buttons.has(Buttons::PEDAL));
        }
        felt
    }

    /// Errors against the truth.
    pub fn against(&self, truth: &Self) -> BoneErrors {
        let mut errors = BoneErrors { all_n: Vec::new(), drilling_n: Vec::new(), normal_deg: Vec::new() };
        for ((a, b), drilling) in self.lifted.iter().zip(&truth.lifted).zip(&truth.drilling) {
            let felt = [a, b].map(|lifted| STIFFNESS * lifted.length() > f64::from(FELT_N));
            if felt[0] || felt[1] {
                let error = STIFFNESS * a.distance(*b);
                errors.all_n.push(error);
                errors.drilling_n.extend(drilling.then_some(error));
            }
            if felt[0] && felt[1] {
                errors.normal_deg.push(a.angle_between(*b).to_degrees());
            }
        }
        errors
    }
}

impl BoneErrors {
    /// By their names with units.
    pub fn named(mut self) -> [(&'static str, f64); 8] {
        let rms = (self.all_n.iter().map(|e| e * e).sum::<f64>() / self.all_n.len() as f64).sqrt();
        let within = self.drilling_n.iter().filter(|e| **e <= 0.05).count() as f64 / self.drilling_n.len() as f64;
        [
            ("bone_force_error_rms_n", rms),
            ("bone_force_error_p50_n", quantile(&mut self.all_n, 0.5)),
            ("bone_force_error_p95_n", quantile(&mut self.all_n, 0.95)),
            ("drilling_force_error_p50_n", quantile(&mut self.drilling_n, 0.5)),
            ("drilling_force_error_p95_n", quantile(&mut self.drilling_n, 0.95)),
            ("drilling_within_0.05_n_percent", 100.0 * within),
            ("proxy_error_p95_mm", quantile(&mut self.all_n, 0.95) / STIFFNESS),
            ("bone_normal_error_p95_deg", quantile(&mut self.normal_deg, 0.95)),
        ]
    }
}

/// The truth of the built-in case along the plan at a site.
pub fn truth(scope: Scope, site: &Site) -> Result<ProxyOffsets> {
    let (ct, isovalue) = rigid::head();
    let scan = Scan::around(&ct, isovalue, site.entry.as_dvec3(), AROUND_MM);
    let path = path(scope, site)?;
    Ok(ProxyOffsets::exact(scan, &path, last_cut_ms(scope, &path), 1))
}

/// Splits the error of force while the burr works: one thing at a time is not exact.
pub fn budget(scope: Scope, findings: &mut Findings) {
    let recipe = Recipe { opening: Some(OPENING.into()), ..case::recipe() };
    let cache = Cache::of_user().expect("there is a cache");
    let case = open_case(Program::Integrated, &case::inputs(), &recipe, &cache).expect("the built-in case opens");
    let site = Scene::new(Program::Integrated, case).expect("it has an opening").site;
    let path = path(scope, &site).expect("the site is sound");
    let (ct, isovalue) = rigid::head();
    let until = last_cut_ms(scope, &path);
    let around = |ct: &VoxelVolume<i16>| Scan::around(ct, isovalue, site.entry.as_dvec3(), AROUND_MM);
    let truth = ProxyOffsets::exact(around(&ct), &path, until, 1);
    let row = |what: &str, felt: &ProxyOffsets, truth: &ProxyOffsets| {
        let row = Row::new("error budget of drilling", what);
        felt.against(truth).named().into_iter().fold(row, |row, (name, value)| row.metric(name, value))
    };
    let mut rows =
        vec![row("time step: half a ms against 1 ms", &ProxyOffsets::exact(around(&ct), &path, until, 2), &truth)];
    for &spacing_mm in scope.pick(&[0.75f32][..], &[1.0, 0.75, 0.5]) {
        let mut skull = resample(&ct, &Grid::isotropic_over(&ct, spacing_mm), Interpolation::Cubic, AIR_HU);
        skull_only(&mut skull, isovalue);
        let exact = ProxyOffsets::exact(around(&skull), &path, until, 1);
        let method = ProxyOffsets::by_method(&skull, isovalue, &path, until);
        rows.push(row(&format!("resampling to {spacing_mm} mm, else exact"), &exact, &truth));
        rows.push(row(&format!("cut and law on voxels of {spacing_mm} mm, against exact ones there"), &method, &exact));
        rows.push(row(&format!("all of it on voxels of {spacing_mm} mm"), &method, &truth));
    }
    findings.rows.extend(rows);
}
