//! The guarded haptic loop on the simulated device: where it is stable, how much energy it
//! generates,
//! and how much force the guard removes.
//!
//! # Theory
//! ```text
//! Gil, Hulin          stable   K < (b + b_h + B)/(T/2 + d)   hand's damping b_h added
//! Colgate, Schenkel   passive  K ≤ (b - B)/(T/2 + d)         their bound at d = 0, delay added to
//! T/2
//! Abbott, Okamura     K Δ/2 ≤ f_c                            else encoder steps sustain a small
//! cycle
//! ```
//! A device is passive if the hand cannot extract more energy than it put in; the device's own
//! losses count (Colgate and Schenkel; Abbott and Okamura). Energy out is therefore the motors'
//! work
//! less the device's friction losses, `b Δx²/T + f_c |Δx|` per tick, which is a lower bound of
//! them.
//! Friction losses of a long free motion must not offset a wall's energy: each contact has a
//! separate energy balance, and the whole run is one more; the worst counts. The work of the motors
//! alone is reported too: encoder steps hide up to `|F| Δ` from every controller (0.18 mJ on a
//! Touch), and a handle held by static friction hides its next start.
//!
//! # Practice
//! `limited`: guarded, with the wall no stiffer than the device's coupling limit
//! (`Capabilities::coupled`), as in sessions. Gates apply to the declared range: a hand with a
//! grip,
//! walls to 2 N/mm, delays to 2 ticks, `K Δ/2 ≤ f_c`; for `limited`, of the limited wall. All other
//! rows are reported without gates; there the guard must act and count its actions.

mod coupling;
mod faults;
mod maps;
mod pace;

use coupling::{Coupling, MILLION};
use trepan_contact::{Contact, ContactManifold, ForceGuard, ForceModel, GuardConfig, GuardCounters};
use trepan_evidence::part::{Part, Scope};
use trepan_evidence::suite::{Findings, Gate, Row};
use trepan_geometry::{Pose, ToolState, Vec3};
use trepan_haptics::HapticDevice;
use trepan_haptics::replay::Replay;
use trepan_haptics::simulated::Simulated;

/// Approach speed of the hand, mm/ms.
const APPROACH: f32 = 0.1;
const PRESS_MS: f32 = 3000.0;
/// Time at the end over which a press is judged, ms.
const JUDGED_MS: f32 = 1000.0;
/// Mean time that a wandering hand keeps a target, and time constant of its motion, ms.
const AIM_MS: f32 = 125.0;
const FOLLOW_MS: f32 = 25.0;
const NMM_PER_J: f64 = 1000.0;

/// Number of couplings in one part.
const TOGETHER: usize = 60;

/// Lists the parts: presses for every coupling with and without the controller, wandering hands,
/// and the timing of the loop.
pub fn parts(scope: Scope) -> Vec<Part> {
    let all = coupling::all(scope).len();
    let some = |first: usize| {
        Part::new(format!("couplings from {first}"), move |scope, findings: &mut Findings| {
            let numbered = coupling::all(scope).into_iter().enumerate().skip(first).take(TOGETHER);
            numbered.for_each(|(number, (scene, coupling))| couple(&scene, &coupling, number, scope, findings));
        })
    };
    let mut parts: Vec<Part> = (0..all).step_by(TOGETHER).map(some).collect();
    if !scope.quick {
        parts.push(Part::new("a million ticks", |scope, findings: &mut Findings| {
            findings.rows.push(wander_row("a million ticks", &MILLION, 1_000_000, 1_000_000, scope));
        }));
    }
    parts.push(Part::new("faults", |scope, findings: &mut Findings| {
        findings.rows = faults::rows(scope);
        findings.gates = faults::gates(&findings.rows);
    }));
    parts.push(Part::new("pace", |scope, findings: &mut Findings| findings.rows = pace::rows(scope)));
    parts
}

/// Runs every way of guarding one coupling.
fn couple(scene: &str, coupling: &Coupling, number: usize, scope: Scope, findings: &mut Findings) {
    findings.rows.push(press_row(scene, coupling, "guarded", scope));
    findings.rows.push(press_row(scene, coupling, "unguarded", scope));
    let limited = coupling.limited();
    if limited.wall != coupling.wall {
        findings.rows.push(press_row(scene, coupling, "limited", scope).with("declared", limited.declared()));
    }
    if coupling.declared() && coupling.wall.damping == 0.5 {
        findings.rows.push(wander_row(scene, coupling, number, scope.pick(5_000, 40_000), scope));
    }
}

/// Adds the gates over all couplings, and their maps.
pub fn judge(_: Scope, findings: &mut Findings) {
    let coupled: Vec<Row> = findings.rows.iter().filter(|row| row.config.contains_key("declared")).cloned().collect();
    findings.gates.extend(gates(&coupled));
    findings.maps.extend(maps::of(&coupled));
}

/// Measurements of a run.
#[derive(Clone, Copy, Default)]
struct Run {
    cycle_mm: f64,
    /// Amplitude of the cycle in the second half of the judged time over that in the first; under 1
    /// it
    /// decays.
    growth: f64,
    lost_percent: f64,
    to_hand_j: f64,
    from_motors_j: f64,
    counters: GuardCounters,
    ticks: usize,
}

impl Run {
    /// The worse of both in each value.
    fn or(self, other: Self) -> Self {
        let (mut counters, more) = (self.counters, other.counters);
        counters.passivity += more.passivity;
        counters.bounded += more.bounded;
        counters.restarted += more.restarted;
        Self {
            cycle_mm: self.cycle_mm.max(other.cycle_mm),
            growth: if self.cycle_mm >= other.cycle_mm { self.growth } else { other.growth },
            lost_percent: self.lost_percent.max(other.lost_percent),
            to_hand_j: self.to_hand_j.max(other.to_hand_j),
            from_motors_j: self.from_motors_j.max(other.from_motors_j),
            counters,
            ticks: self.ticks + other.ticks,
        }
    }
}

/// Ticks without force after which a contact is over.
const FREE_TICKS: u32 = 5;

/// Largest net energy given out, over the run and over any single contact.
#[derive(Default)]
struct Account {
    run_nmm: f64,
    contact_nmm: f64,
    free_ticks: u32,
    lowest_nmm: f64,
}

impl Account {
    fn book(&mut self, taken_nmm: f32, force: Vec3) {
        self.free_ticks = if force == Vec3::ZERO { self.free_ticks + 1 } else { 0 };
        self.run_nmm += f64::from(taken_nmm);
        self.contact_nmm = if self.free_ticks > FREE_TICKS { 0.0 } else { self.contact_nmm + f64::from(taken_nmm) };
        self.lowest_nmm = self.lowest_nmm.min(self.run_nmm).min(self.contact_nmm);
    }

    fn given_j(&self) -> f64 {
        self.lowest_nmm.abs() / NMM_PER_J
    }
}

/// Runs the loop with the hand's target given per tick, against a wall at x ≤ 0.
fn run_loop(coupling: &Coupling, intent: Vec<ToolState>, ticks: usize, guarded: bool) -> Run {
    let Coupling { device: config, hand, mut wall, tick_ms, .. } = *coupling;
    let judged_ticks = coupling.ticks(JUDGED_MS);
    let mut device = Simulated::new(config, hand, Box::new(Replay::new(intent)));
    let limits = device.capabilities().guard_config();
    let passivity = limits.passivity.filter(|_| guarded);
    let mut guard = ForceGuard::new(GuardConfig { ramp_in_ms: 0.0, passivity, ..limits });
    let (mut motors, mut to_hand) = (Account::default(), Account::default());
    let mut ways = [(f32::MAX, f32::MIN); 2];
    let (mut wanted_n, mut given_n) = (0.0f32, 0.0f32);
    for tick in 0..ticks {
        let (from, motor) = (device.position(), device.motor_force());
        let tool = device.read(tick as f64 * f64::from(tick_ms)).tool;
        let way = if tick == 0 { Vec3::ZERO } else { device.position() - from };
        let lost = config.damping * way.length_squared() / tick_ms + config.friction_n * way.length();
        motors.book(-motor.dot(way), motor);
        to_hand.book(lost - motor.dot(way), motor);
        let wrench = wall.wrench(&tool, &touch(&tool), tick_ms);
        let given = guard.guard(wrench, &tool, tick_ms);
        device.apply(given);
        if tick + judged_ticks >= ticks {
            let (way, x) = (&mut ways[usize::from(2 * (ticks - tick) <= judged_ticks)], device.position().x);
            *way = (way.0.min(x), way.1.max(x));
            wanted_n += wrench.force.length().min(guard.config().max_force_n);
            given_n += given.force().length();
        }
    }
    let [early, late] = ways.map(|(low, high)| f64::from(high - low).max(0.0));
    Run {
        cycle_mm: f64::from(ways[0].1.max(ways[1].1) - ways[0].0.min(ways[1].0)),
        growth: late / early.max(1e-6),
        lost_percent: f64::from(100.0 * (1.0 - given_n / wanted_n.max(f32::MIN_POSITIVE))),
        to_hand_j: to_hand.given_j(),
        from_motors_j: motors.given_j(),
        counters: guard.counters(),
        ticks,
    }
}

fn touch(tool: &ToolState) -> ContactManifold {
    let mut touch = ContactManifold::default();
    if tool.tip().x < 0.0 {
        touch.set_single(Contact { point: Vec3::ZERO, normal: Vec3::X, depth_mm: -tool.tip().x });
    }
    touch
}

fn at(x: f32) -> ToolState {
    ToolState::at(Pose::from_translation(Vec3::X * x))
}

/// Worst of several presses: the hand comes from 2 mm outside and presses until the wall
/// responds with the press's force.
fn press_row(scene: &str, wanted: &Coupling, method: &str, scope: Scope) -> Row {
    let limited = wanted.limited();
    let coupling = if method == "limited" { &limited } else { wanted };
    let press = |&force_n: &f32| {
        let depth = force_n / coupling.wall.stiffness + force_n / coupling.hand.stiffness;
        let way = APPROACH * coupling.tick_ms;
        let steps = ((2.0 + depth) / way).ceil() as usize;
        let intent = (0..=steps).map(|step| at((2.0 - way * step as f32).max(-depth))).collect();
        run_loop(coupling, intent, coupling.ticks(PRESS_MS), method != "unguarded")
    };
    let presses = scope.pick(&[1.0f32, 2.0][..], &[0.3, 1.0, 2.0][..]);
    let worst = presses.iter().map(press).reduce(Run::or).unwrap_or_default();
    row(scene, wanted, method, &worst)
        .metric("given_stiffness_n_per_mm", coupling.wall.stiffness.into())
        .metric("limit_cycle_mm", worst.cycle_mm)
        .metric("limit_cycle_growth", worst.growth)
        .metric("steady_force_lost_percent", worst.lost_percent)
}

/// A hand with random targets, each kept for up to a quarter of a second.
fn wander_row(scene: &str, coupling: &Coupling, own: usize, ticks: usize, scope: Scope) -> Row {
    let mut random = scope.random(own as u64);
    let mut intent = Vec::with_capacity(ticks);
    let (mut aim, mut place) = (2.0f32, 2.0f32);
    while intent.len() < ticks {
        if random.f32() < coupling.tick_ms / AIM_MS {
            aim = 2.0 - 10.0 * random.f32();
        }
        place += coupling.tick_ms / FOLLOW_MS * (aim - place);
        intent.push(at(place));
    }
    let found = run_loop(coupling, intent, ticks, true);
    row(&format!("wandering: {scene}"), coupling, "guarded", &found)
}

fn row(scene: &str, coupling: &Coupling, method: &str, run: &Run) -> Row {
    let Coupling { names: [name, grip], device, hand, wall, tick_ms } = coupling;
    Row::new(scene, method)
        .with("device", *name)
        .with("hand", *grip)
        .with("stiffness_n_per_mm", wall.stiffness)
        .with("damping_n_ms_per_mm", wall.damping)
        .with("rate_hz", 1e3 / tick_ms)
        .with("delay_ticks", device.delay_ticks)
        .with("quantum_mm", device.quantum_mm)
        .with("friction_n", device.friction_n)
        .with("hand_damping_n_ms_per_mm", hand.damping)
        .with("declared", coupling.declared())
        .metric("gil_n_per_mm", coupling.gil().into())
        .metric("colgate_n_per_mm", coupling.colgate().into())
        .metric("stiffness_over_gil", f64::from(wall.stiffness / coupling.gil()))
        .metric("energy_out_j", run.to_hand_j)
        .metric("motor_energy_out_j", run.from_motors_j)
        .metric("damped_percent", 100.0 * run.counters.passivity as f64 / run.ticks as f64)
        .metric("bounded_percent", 100.0 * run.counters.bounded as f64 / run.ticks as f64)
        .metric("restarts_count", run.counters.restarted as f64)
}

fn gates(rows: &[Row]) -> Vec<Gate> {
    let declared = |row: &&Row| row.method != "unguarded" && row.config["declared"] == true;
    let worst =
        |name: &str| rows.iter().filter(declared).filter_map(|row| row.metrics.get(name).copied()).fold(0.0, f64::max);
    let silent = |row: &&Row| {
        row.method == "guarded"
            && row.config["declared"] == false
            && row.metrics.get("limit_cycle_mm").is_some_and(|&cycle| cycle > 0.1)
            && row.metrics["motor_energy_out_j"] > 1e-4
            && row.metrics["damped_percent"] + row.metrics["bounded_percent"] == 0.0
    };
    let stirred = |row: &&Row| {
        let swings = row.metrics.get("limit_cycle_mm").is_some_and(|&cycle| cycle > 0.1);
        row.method == "unguarded" && swings && row.config["declared"] == true
    };
    let count = |found: usize| found as f64;
    let stirred = count(rows.iter().filter(stirred).count());
    vec![
        Gate::at_most("declared range: limit cycle, mm", worst("limit_cycle_mm"), 0.1),
        Gate::at_most("declared range: energy out to the hand, J", worst("energy_out_j"), 1e-4),
        Gate::at_most("declared range: steady force lost, percent", worst("steady_force_lost_percent"), 5.0),
        Gate::at_most("declared range: forces lost and restarted", worst("restarts_count"), 0.0),
        Gate::at_most(
            "outside it: walls that shake the hand and the guard does not report",
            count(rows.iter().filter(silent).count()),
            0.0,
        ),
        Gate::at_least("declared range: couplings that oscillate without the guard", stirred, 1.0),
    ]
}

#[cfg(test)]
mod tests {
    use super::coupling::tests::coupling;
    use super::*;

    #[test]
    fn losses_in_free_motion_do_not_offset_a_walls_energy() {
        let mut account = Account::default();
        (0..100).for_each(|_| account.book(1.0, Vec3::ZERO));
        account.book(-0.2, Vec3::X);
        account.book(-0.1, Vec3::X);
        account.book(0.5, Vec3::X);
        assert!((account.given_j() - 0.3e-3).abs() < 1e-9, "{}", account.given_j());
    }

    #[test]
    fn beyond_gils_bound_the_bare_loop_oscillates_and_generates_energy() {
        let press =
            |stiffness: f32| run_loop(&coupling(stiffness, 1), vec![at(-1.0 / stiffness - 1.0 / 0.15)], 3000, false);
        let (quiet, wild) = (press(0.8), press(2.0));
        assert!(quiet.cycle_mm < 0.05, "{}", quiet.cycle_mm);
        assert!(wild.cycle_mm > 1.0 && wild.from_motors_j > 1e-3, "{} mm, {} J", wild.cycle_mm, wild.from_motors_j);
    }
}
