//! The choice itself, and what it says about its neighbours.

use crate::{
    Machine, MeshRow, PlanError, RigidRow, Rows, Scene,
    machine::check,
    step::{edge_mm, stable_dt_ms},
};
use core::fmt;

/// Share of a tick that the rigid contact may take; the rest is for device, force model and guard.
const TICK_SHARE: f64 = 0.25;
/// What a second and each further solver thread adds.
const THREAD_GAIN: f64 = 0.8;
/// Longest solver step, ms: one haptic tick at 1 kHz.
const LONGEST_DT_MS: f64 = 1.0;

/// What to run.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// Voxels and point shell for bone. Its error is in N, its cost in µs for each tick.
    pub rigid: Choice<RigidRow>,
    /// Tetrahedra for tissue. Its error is in mm, its cost in cores.
    pub mesh: Choice<MeshRow>,
    /// Solver step, ms.
    pub dt_ms: f64,
    /// Simulated over real time on this machine.
    pub real_time_factor: f64,
    /// Mean edge of the tetrahedra, mm.
    pub edge_mm: f64,
    /// What was asked for.
    pub scene: Scene,
}

/// One row that was taken, and its neighbours.
#[derive(Clone, Debug, PartialEq)]
pub struct Choice<R> {
    /// The row.
    pub row: R,
    /// Its error in this scene.
    pub error: f64,
    /// Its cost on this machine.
    pub cost: f64,
    /// Whether the error is within the scene's tolerance.
    pub meets_tolerance: bool,
    /// Whether it runs in time.
    pub in_time: bool,
    /// The cheapest row with a smaller error: row, error, cost, whether it runs in time.
    pub better: Option<(R, f64, f64, bool)>,
    /// The most accurate row that costs less.
    pub cheaper: Option<(R, f64, f64, bool)>,
}

/// The plan by the stored rows.
///
/// # Errors
/// When a number of the machine or the scene makes no sense.
pub fn plan(machine: &Machine, scene: &Scene) -> Result<Plan, PlanError> {
    plan_with(machine, scene, &Rows::stored())
}

/// The plan by rows of the caller's own.
///
/// # Errors
/// When a number makes no sense or a list of rows is empty.
pub fn plan_with(machine: &Machine, scene: &Scene, rows: &Rows) -> Result<Plan, PlanError> {
    check(machine, scene)?;
    let tick_us = |row: &RigidRow| machine.us_per_rigid_tick * row.relative_time;
    let most_us = TICK_SHARE * 1e6 / scene.device_rate_hz;
    let rigid = choose(&rows.rigid, scene.force_error_n, |row| {
        (scene.stiffness * row.depth_error_mm, tick_us(row), tick_us(row) <= most_us)
    })
    .ok_or(PlanError::NoRows("rigid"))?;
    let cores = solver_cores(machine, rigid.cost * 1e-6 * scene.device_rate_hz);
    let factor = |row: &MeshRow| dt_ms(scene, row) / (row.tets as f64 * machine.ns_per_tet_step * 1e-6 / cores);
    let mesh = choose(&rows.mesh, scene.displacement_mm, |row| {
        (row.error_in(scene), cores / factor(row), factor(row) >= scene.headroom)
    })
    .ok_or(PlanError::NoRows("mesh"))?;
    let (dt_ms, real_time_factor) = (dt_ms(scene, &mesh.row), factor(&mesh.row));
    let edge_mm = edge_mm(scene.brain_mm3, mesh.row.tets);
    Ok(Plan { rigid, mesh, dt_ms, real_time_factor, edge_mm, scene: *scene })
}

fn dt_ms(scene: &Scene, row: &MeshRow) -> f64 {
    stable_dt_ms(scene.brain_mm3, row.tets, &scene.material).min(LONGEST_DT_MS)
}

/// Cores' worth of solver: what the haptic thread leaves of all threads; further threads add less than the first.
fn solver_cores(machine: &Machine, haptic_load: f64) -> f64 {
    let free = (f64::from(machine.threads) - haptic_load).max(0.05);
    if free <= 1.0 { free } else { 1.0 + THREAD_GAIN * (free - 1.0) }
}

/// Picks by `judge(row) -> (error, cost, in time)`.
fn choose<R: Copy>(rows: &[R], tolerance: f64, judge: impl Fn(&R) -> (f64, f64, bool)) -> Option<Choice<R>> {
    let judged: Vec<_> = rows.iter().map(|&row| (row, judge(&row))).map(|(row, (e, c, t))| (row, e, c, t)).collect();
    let cheapest = |keep: &dyn Fn(f64, bool) -> bool| {
        judged.iter().filter(|(_, e, _, t)| keep(*e, *t)).min_by(|a, b| a.2.total_cmp(&b.2)).copied()
    };
    let most_accurate = |keep: &dyn Fn(f64, bool) -> bool| {
        judged.iter().filter(|(_, _, c, t)| keep(*c, *t)).min_by(|a, b| a.1.total_cmp(&b.1)).copied()
    };
    let (row, error, cost, in_time) = cheapest(&|e, t| t && e <= tolerance)
        .or_else(|| most_accurate(&|_, t| t))
        .or_else(|| cheapest(&|_, _| true))?;
    let better = cheapest(&|e, _| e < error);
    let cheaper = most_accurate(&|c, _| c < cost);
    Some(Choice { row, error, cost, meets_tolerance: error <= tolerance, in_time, better, cheaper })
}

impl fmt::Display for Plan {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (rigid, mesh, scene) = (&self.rigid, &self.mesh, &self.scene);
        let bone = |row: &RigidRow| match row.points {
            0 => format!("{} on {} mm voxels", row.method, row.spacing_mm),
            points => format!("{} on {} mm voxels with {points} points", row.method, row.spacing_mm),
        };
        let tissue = |row: &MeshRow| format!("{} tetrahedra", row.tets);
        writeln!(f, "bone: {}", bone(&rigid.row))?;
        writeln!(f, "  {}", reason(rigid, scene.force_error_n, "N", "us a tick"))?;
        neighbours(f, rigid, bone, "N", "us a tick")?;
        writeln!(f, "tissue: {}, edge {:.1} mm, step {:.3} ms", tissue(&mesh.row), self.edge_mm, self.dt_ms)?;
        writeln!(f, "  {}", reason(mesh, scene.displacement_mm, "mm", "cores"))?;
        writeln!(f, "  {:.2} times real time, {:.2} wanted", self.real_time_factor, scene.headroom)?;
        neighbours(f, mesh, tissue, "mm", "cores")
    }
}

/// Why this row was taken.
fn reason<R>(choice: &Choice<R>, tolerance: f64, unit: &str, cost: &str) -> String {
    let Choice { error, cost: price, .. } = choice;
    let numbers = format!("error {error:.3} {unit} of {tolerance:.3} allowed, {price:.2} {cost}");
    match (choice.in_time, choice.meets_tolerance) {
        (true, true) => format!("cheapest within the tolerance: {numbers}"),
        (true, false) => format!("TOLERANCE NOT MET, the most accurate that runs in time: {numbers}"),
        (false, _) => format!("TOO SLOW even so, the cheapest there is: {numbers}"),
    }
}

fn neighbours<R>(
    f: &mut fmt::Formatter<'_>,
    choice: &Choice<R>,
    name: impl Fn(&R) -> String,
    unit: &str,
    cost: &str,
) -> fmt::Result {
    for (label, neighbour) in [("next better", &choice.better), ("next cheaper", &choice.cheaper)] {
        if let Some((row, error, price, in_time)) = neighbour {
            let late = if *in_time { "" } else { ", too slow here" };
            writeln!(f, "  {label}: {}: error {error:.3} {unit}, {price:.2} {cost}{late}", name(row))?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use trepan_soft::Material;

    const MACHINE: Machine = Machine { ns_per_tet_step: 20.0, us_per_rigid_tick: 40.0, threads: 1 };

    fn rows() -> Rows {
        let rigid = |spacing_mm, depth_error_mm, relative_time| RigidRow {
            method: "thesis",
            spacing_mm,
            points: 466,
            depth_error_mm,
            relative_time,
        };
        let mesh = |tets, relative_error| MeshRow { tets, relative_error };
        Rows {
            rigid: vec![rigid(1.0, 0.1, 0.8), rigid(0.5, 0.04, 1.0), rigid(0.25, 0.02, 2.0)],
            mesh: vec![mesh(5_000, 0.20), mesh(10_000, 0.12), mesh(20_000, 0.08), mesh(40_000, 0.05)],
        }
    }

    fn scene() -> Scene {
        Scene { tissue_motion_mm: 10.0, displacement_mm: 1.0, ..Scene::default() }
    }

    /// By hand: 2 N/mm · 0.04 mm = 0.08 N is the first under 0.1 N and takes 40 µs of 250. 1000 ticks of 40 µs leave 0.96 core.
    /// 20 000 tetrahedra: a = 7.985 mm, dt = 0.35 · 6.519/3.373 = 0.6766 ms; a step takes 20 000 · 20 ns / 0.96 = 0.4167 ms: 1.624 times real time.
    #[test]
    fn the_cheapest_within_the_tolerance_is_taken() {
        let plan = plan_with(&MACHINE, &scene(), &rows()).unwrap();
        assert_eq!((plan.rigid.row.spacing_mm, plan.mesh.row.tets), (0.5, 20_000));
        assert!((plan.rigid.error - 0.08).abs() < 1e-12 && plan.rigid.cost == 40.0);
        assert!((plan.dt_ms - 0.6766).abs() < 1e-3 && (plan.real_time_factor - 1.624).abs() < 5e-3);
        assert!((plan.mesh.cost - 0.96 / plan.real_time_factor).abs() < 1e-9);
        let (better, error, _, in_time) = plan.mesh.better.unwrap();
        assert_eq!((better.tets, in_time), (40_000, false));
        assert!((error - 0.5).abs() < 1e-12);
        assert_eq!(plan.mesh.cheaper.unwrap().0.tets, 10_000);
        assert!(plan.mesh.meets_tolerance && plan.mesh.in_time && plan.rigid.meets_tolerance);
    }

    #[test]
    fn a_slow_machine_takes_what_runs_and_says_that_the_tolerance_is_missed() {
        let slow = Machine { ns_per_tet_step: 40.0, ..MACHINE };
        let plan = plan_with(&slow, &scene(), &rows()).unwrap();
        assert_eq!(plan.mesh.row.tets, 10_000);
        assert!(plan.mesh.in_time && !plan.mesh.meets_tolerance);
        assert!(plan.to_string().contains("TOLERANCE NOT MET"));
        let hopeless = plan_with(&Machine { ns_per_tet_step: 1e4, ..MACHINE }, &scene(), &rows()).unwrap();
        assert_eq!(hopeless.mesh.row.tets, 5_000);
        assert!(hopeless.to_string().contains("TOO SLOW"));
    }

    #[test]
    fn errors_follow_the_motion_of_the_tissue_and_the_stiffness_of_the_contact() {
        let near = |a: f64, b: f64| (a - b).abs() < 1e-9;
        let stiffer = Scene { stiffness: 1.0, tissue_motion_mm: 20.0, ..scene() };
        let plan = plan_with(&MACHINE, &stiffer, &rows()).unwrap();
        assert!(near(plan.rigid.error, 0.1) && plan.rigid.row.spacing_mm == 1.0);
        assert!(near(rows().mesh[1].error_in(&stiffer), 2.4) && near(rows().mesh[1].error_in(&scene()), 1.2));
    }

    /// A body eleven times as stiff waves faster: the step shrinks with the speed of sound, the row stays unless it no longer runs in time.
    #[test]
    fn stiffer_tissue_needs_shorter_steps() {
        let at = |material| plan_with(&MACHINE, &Scene { material, ..scene() }, &rows()).unwrap();
        let (brain, thesis) = (at(Material::BRAIN), at(Material::THESIS));
        let ratio = Material::THESIS.wave_speed() / Material::BRAIN.wave_speed();
        let same_row = thesis.mesh.row == brain.mesh.row;
        assert!(thesis.dt_ms < brain.dt_ms || !same_row);
        assert!(ratio > 1.8 && !same_row && thesis.mesh.row.tets < brain.mesh.row.tets);
    }

    #[test]
    fn more_threads_and_looser_tolerances_never_cost_more_accuracy_or_time() {
        for threads in 1..8 {
            let at = |threads| {
                plan_with(&Machine { threads, ..MACHINE }, &Scene { displacement_mm: 0.1, ..scene() }, &rows()).unwrap()
            };
            assert!(at(threads + 1).mesh.error <= at(threads).mesh.error);
        }
        for k in 1..20 {
            let at = |mm| plan_with(&MACHINE, &Scene { displacement_mm: mm, ..scene() }, &rows()).unwrap().mesh.cost;
            assert!(at(0.1 * (k + 1) as f64) <= at(0.1 * k as f64));
        }
    }

    #[test]
    fn bad_numbers_are_refused_by_name() {
        let refused = |machine, scene| plan_with(&machine, &scene, &rows()).unwrap_err().to_string();
        assert!(refused(Machine { threads: 0, ..MACHINE }, scene()).contains("threads"));
        assert!(refused(MACHINE, Scene { headroom: 0.5, ..scene() }).contains("headroom"));
        assert!(refused(MACHINE, Scene { brain_mm3: f64::NAN, ..scene() }).contains("brain_mm3"));
        assert_eq!(plan_with(&MACHINE, &scene(), &Rows { rigid: vec![], ..rows() }), Err(PlanError::NoRows("rigid")));
    }
}
