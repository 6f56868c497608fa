//! The choice itself.

use crate::choice::{Choice, choose};
use crate::machine::check;
use crate::step::{edge_mm, stable_dt_ms};
use crate::{Bone, Machine, Picture, PlanError, Quality, Row, Rows, Scene, Setup, Tissue};

/// Share of a tick that the rigid contact may take; the rest is for device, force model and guard.
const TICK_SHARE: f64 = 0.25;
/// What a second and each further solver thread adds.
const THREAD_GAIN: f64 = 0.8;
/// Longest step of a solver that has a stable bound, ms: one haptic tick at 1 kHz.
const LONGEST_DT_MS: f64 = 1.0;
/// Step of the implicit solver, ms: four haptic ticks at 1 kHz.
pub(crate) const IMPLICIT_DT_MS: f64 = 4.0;
/// Time of a haptic tick without bone and of what belongs to it in other threads (device, force model, guard, tissue's collision, recording), µs.
const FIXED_US_PER_TICK: f64 = 25.0;

/// What to run.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// Bone; `None` in a scene without. Its error is in N.
    pub bone: Option<Choice<Bone>>,
    /// Tissue; `None` in a scene without. Its error is in mm.
    pub tissue: Option<Choice<Tissue>>,
    /// Picture. Its error is in percent of white.
    pub picture: Choice<Picture>,
    /// What a session takes whatever is chosen, cores.
    pub fixed_cores: f64,
    /// What was asked for.
    pub scene: Scene,
    /// For which machine.
    pub machine: Machine,
}

impl Plan {
    /// What to run; what the scene lacks is as usual.
    pub fn setup(&self) -> Setup {
        let usual = Quality::Usual.preset().expect("only Auto has none");
        Setup {
            bone: self.bone.map_or(usual.bone, |choice| choice.what),
            tissue: self.tissue.map_or(usual.tissue, |choice| choice.what),
            picture: self.picture.what,
        }
    }

    /// CPU seconds a second, all parts together.
    pub fn cores(&self) -> f64 {
        let parts = [self.bone.map(|c| c.cost), self.tissue.map(|c| c.cost), Some(self.picture.cost)];
        self.fixed_cores + parts.into_iter().flatten().sum::<f64>()
    }

    /// Whether every part is within its tolerance.
    pub fn meets_tolerances(&self) -> bool {
        self.bone.is_none_or(|c| c.meets_tolerance)
            && self.tissue.is_none_or(|c| c.meets_tolerance)
            && self.picture.meets_tolerance
    }

    /// Whether every part runs in time.
    pub fn in_time(&self) -> bool {
        self.bone.is_none_or(|c| c.in_time) && self.tissue.is_none_or(|c| c.in_time) && self.picture.in_time
    }

    /// Solver step, ms, and mean edge of the tetrahedra, mm.
    pub fn step_and_edge(&self) -> Option<(f64, f64)> {
        let tissue = self.tissue?.what;
        Some((dt_ms(&self.scene, &tissue), edge_mm(self.scene.brain_mm3, tissue.tets)))
    }
}

/// The plan by the stored rows.
///
/// # Errors
/// When a number of the machine or the scene makes no sense.
pub fn plan(machine: &Machine, scene: &Scene) -> Result<Plan, PlanError> {
    plan_with(machine, scene, &Rows::stored()?)
}

/// The plan by rows of the caller's own.
///
/// # Errors
/// When a number makes no sense or a list of rows that the scene needs is empty.
pub fn plan_with(machine: &Machine, scene: &Scene, rows: &Rows) -> Result<Plan, PlanError> {
    check(machine, scene)?;
    let fixed_cores = FIXED_US_PER_TICK * 1e-6 * scene.device_rate_hz;
    let mut free = f64::from(machine.threads) - fixed_cores;
    let bone = scene.has_bone.then(|| bone(machine, scene, rows)).transpose()?;
    free -= bone.map_or(0.0, |choice| choice.cost);
    let tissue = scene.has_tissue.then(|| tissue(machine, scene, rows, free)).transpose()?;
    free -= tissue.map_or(0.0, |choice| choice.cost);
    let picture = picture(machine, scene, rows, free)?;
    Ok(Plan { bone, tissue, picture, fixed_cores, scene: *scene, machine: *machine })
}

fn bone(machine: &Machine, scene: &Scene, rows: &Rows) -> Result<Choice<Bone>, PlanError> {
    let longest = TICK_SHARE;
    let judged = rows.bone.iter().map(|row| {
        let cost = bone_cores(machine, scene, row);
        (row.what, bone_error_n(scene, row), cost, cost <= longest)
    });
    choose(judged, scene.force_error_n).ok_or(PlanError::NoRows("bone"))
}

fn tissue(machine: &Machine, scene: &Scene, rows: &Rows, free: f64) -> Result<Choice<Tissue>, PlanError> {
    let most = solver_cores(free) / scene.headroom;
    let judged = rows.tissue.iter().map(|row| {
        let cost = tissue_cores(machine, scene, row);
        (row.what, row.error.at_most(&scene.tissue_features()), cost, cost <= most)
    });
    choose(judged, scene.displacement_mm).ok_or(PlanError::NoRows("tissue"))
}

fn picture(machine: &Machine, scene: &Scene, rows: &Rows, free: f64) -> Result<Choice<Picture>, PlanError> {
    let judged = rows.picture.iter().map(|row| {
        let cost = picture_cores(machine, scene, row);
        (row.what, row.error.at_most(&scene.picture_features()), cost, cost <= free)
    });
    choose(judged, scene.picture_error_percent).ok_or(PlanError::NoRows("picture"))
}

/// Error of the force that 95 of 100 ticks stay within, N.
pub fn bone_error_n(scene: &Scene, row: &Row<Bone>) -> f64 {
    scene.stiffness * row.error.at_most(&scene.bone_features())
}

/// What a way to touch bone costs, cores.
pub fn bone_cores(machine: &Machine, scene: &Scene, row: &Row<Bone>) -> f64 {
    machine.us_per_rigid_tick * row.cost.expected(&scene.bone_features()) * 1e-6 * scene.device_rate_hz
}

/// What a way to move tissue in real time costs, cores.
pub fn tissue_cores(machine: &Machine, scene: &Scene, row: &Row<Tissue>) -> f64 {
    let step_ms = row.what.tets as f64 * machine.ns_per_tet_step * 1e-6 * row.cost.expected(&scene.tissue_features());
    step_ms / dt_ms(scene, &row.what)
}

/// What a way to draw costs the processor, cores: nothing where a device draws.
pub fn picture_cores(machine: &Machine, scene: &Scene, row: &Row<Picture>) -> f64 {
    if machine.device_draws {
        return 0.0;
    }
    let pixels = scene.picture_pixels.map(f64::from).iter().product::<f64>();
    machine.ns_per_ray * 1e-9 * pixels * row.cost.expected(&scene.picture_features()) * scene.pictures_per_s
}

fn dt_ms(scene: &Scene, tissue: &Tissue) -> f64 {
    match tissue.solver {
        "corotational" => IMPLICIT_DT_MS,
        _ => stable_dt_ms(scene.brain_mm3, tissue.tets, &scene.material).min(LONGEST_DT_MS),
    }
}

/// Work of one core that a solver gets done on so many: further threads add less than the first.
fn solver_cores(free: f64) -> f64 {
    let free = free.max(0.05);
    if free <= 1.0 { free } else { 1.0 + THREAD_GAIN * (free - 1.0) }
}
