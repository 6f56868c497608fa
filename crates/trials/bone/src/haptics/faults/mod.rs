//! Every fault of the device emulators, by driver: how long force remains, and which message the
//! user gets.
//!
//! # Practice
//! A loop like a session's requests 1 N; then the fault begins. libHD and libdrd are given time
//! tick by tick, so that 1 ms is one tick and every run is identical. Haply's service runs in
//! parallel in real time: runs are added until the machine left enough of them alone, by their
//! longest tick and not by their result; the gates use the run that it disturbed least, and the
//! slowest is reported too. While the library itself pauses, no code can reach the motors: the time
//! counts from its return. `Kept` are faults that must not remove the force.

mod force_dimension;
mod haply;
mod openhaptics;

use super::Scope;
use std::path::Path;
use std::time::Instant;
use trepan_contact::{ForceGuard, GuardConfig, GuardedWrench};
use trepan_evidence::suite::{Gate, Row};
use trepan_geometry::{ToolState, Vec3, Wrench};
use trepan_haptics::{DeviceError, Fault, HapticDevice, Status};

/// Requested force, N.
const WANTED_N: f32 = 1.0;
/// Largest number of ticks until the force is reached: rests and ramps of driver and guard.
const SETTLE_TICKS: u32 = 20_000;
/// Ticks for which a fault is observed.
const WATCHED_TICKS: u32 = 300;
const LIMIT_MS: f64 = 10.0;

/// Required response to a fault.
#[derive(Clone, Copy)]
enum Then {
    /// Force off, with this message.
    Cut(Fault),
    /// No response.
    Kept,
}

/// Motor force at a time.
#[derive(Clone, Copy)]
struct MotorForce {
    /// Time, ms.
    at_ms: f64,
    /// Force magnitude, N.
    force_n: f64,
}

/// Driver on its emulator.
trait Bench {
    /// Runs one tick of the loop.
    fn tick(&mut self) -> MotorForce;
    /// Fault reported by the driver.
    fn fault(&self) -> Option<Fault>;
}

/// Fault case with the function that starts the fault.
struct Case<B> {
    name: &'static str,
    begin: fn(&mut B),
    then: Then,
}

/// Rows of all drivers.
pub fn rows(scope: Scope) -> Vec<Row> {
    [openhaptics::rows(), force_dimension::rows(), haply::rows(scope)].concat()
}

/// Gates over all rows.
pub fn gates(rows: &[Row]) -> Vec<Gate> {
    let of = |kind: &str, name: &str| -> Vec<f64> {
        rows.iter().filter(|row| row.config["kind"] == kind).map(|row| row.metrics[name]).collect()
    };
    let most = |values: Vec<f64>| values.into_iter().fold(0.0, f64::max);
    let least = |values: Vec<f64>| values.into_iter().fold(f64::INFINITY, f64::min);
    let all = |name: &str| most(rows.iter().filter_map(|row| row.metrics.get(name).copied()).collect());
    let silent = rows.iter().filter(|row| row.config["told_what_to_do"] == false).count();
    let few = |kind: &str| of(kind, "force_after_n").len() as f64;
    vec![
        Gate::at_least("faults in use that were tried", few("cut"), 45.0),
        Gate::at_least("faults: force before, N", least(of("cut", "force_before_n")), 0.99),
        Gate::at_most("faults: from fault to no force, ms", most(of("cut", "no_force_ms")), LIMIT_MS),
        Gate::at_most("faults at opening: force, N", most(of("refused", "force_after_n")), 0.0),
        Gate::at_most("faults whose message does not say what to do", silent as f64, 0.0),
        Gate::at_least("faults that must not matter: force kept, N", least(of("kept", "force_after_n")), 0.99),
        Gate::at_most("faults: largest rise of force, N in a tick", all("largest_rise_n"), 0.5),
        Gate::at_most("faults: largest force, N", all("largest_force_n"), f64::from(WANTED_N) * (1.0 + 1e-6)),
    ]
}

/// Guarded loop over a device, as in a session.
struct Loop<D> {
    device: D,
    guard: ForceGuard,
}

impl<D: HapticDevice> Loop<D> {
    fn new(device: D) -> Self {
        let guard = ForceGuard::new(GuardConfig { ramp_in_ms: 0.0, ..device.capabilities().guard_config() });
        Self { device, guard }
    }

    /// Reads, and applies the guarded force; a lost device gets zero force.
    fn tick(&mut self, time_ms: f64) {
        let reading = self.device.read(time_ms);
        let tool = ToolState { time_ms, ..reading.tool };
        let wanted = Wrench { force: Vec3::X * WANTED_N, torque: Vec3::ZERO };
        let given = self.guard.guard(wanted, &tool, 1.0);
        self.device.apply(if reading.status == Status::Lost { GuardedWrench::ZERO } else { given });
    }
}

/// Measurements of one run of a case.
#[derive(Clone, Copy)]
struct Course {
    before_n: f64,
    no_force_ms: f64,
    reported_ms: f64,
    after_n: f64,
    largest_n: f64,
    rise_n: f64,
    reported: Option<Fault>,
    /// Longest tick after the fault, ms.
    held_ms: f64,
}

/// Waits until the force is reached, starts the fault, and observes.
fn run<B: Bench>(bench: &mut B, case: &Case<B>) -> Course {
    let mut before = bench.tick();
    let (mut largest_n, mut rise_n) = (0.0f64, 0.0f64);
    for _ in 0..SETTLE_TICKS {
        let now = bench.tick();
        (largest_n, rise_n) = (largest_n.max(now.force_n), rise_n.max(now.force_n - before.force_n));
        before = now;
        if now.force_n > 0.999 * f64::from(WANTED_N) {
            break;
        }
    }
    (case.begin)(bench);
    let mut course = Course {
        before_n: before.force_n,
        no_force_ms: f64::INFINITY,
        reported_ms: f64::INFINITY,
        after_n: before.force_n,
        largest_n,
        rise_n,
        reported: None,
        held_ms: 0.0,
    };
    for _ in 0..WATCHED_TICKS {
        let began = Instant::now();
        let now = bench.tick();
        course.held_ms = course.held_ms.max(1e3 * began.elapsed().as_secs_f64());
        course.largest_n = course.largest_n.max(now.force_n);
        course.rise_n = course.rise_n.max(now.force_n - course.after_n);
        course.after_n = now.force_n;
        let passed_ms = now.at_ms - before.at_ms;
        if now.force_n == 0.0 {
            course.no_force_ms = course.no_force_ms.min(passed_ms);
        }
        if let (None, Some(fault)) = (course.reported, bench.fault()) {
            (course.reported, course.reported_ms) = (Some(fault), passed_ms);
        }
    }
    course
}

/// Row of one case, from the run that the machine disturbed least: the quickest cut, or the one
/// that kept most force.
fn row<B>(driver: &str, case: &Case<B>, courses: &[Course]) -> Row {
    let worst = |what: fn(&Course) -> f64| courses.iter().map(what).fold(0.0, f64::max);
    let disturbed = |course: &Course| match case.then {
        Then::Cut(_) => course.no_force_ms,
        Then::Kept => -course.after_n,
    };
    let Some(own) = courses.iter().min_by(|one, other| disturbed(one).total_cmp(&disturbed(other))) else {
        return Row::new(case.name, driver);
    };
    let row = Row::new(case.name, driver)
        .with("told", own.reported.map_or_else(|| "nothing".to_owned(), |fault| fault.to_string()))
        .metric("force_before_n", own.before_n)
        .metric("force_after_n", own.after_n)
        .metric("largest_force_n", worst(|course| course.largest_n))
        .metric("largest_rise_n", worst(|course| course.rise_n));
    match case.then {
        Then::Kept => row.with("kind", "kept").with("told_what_to_do", own.reported.is_none()),
        Then::Cut(fault) => row
            .with("kind", "cut")
            .with("told_what_to_do", own.reported == Some(fault))
            .metric("no_force_ms", own.no_force_ms)
            .metric("slowest_no_force_ms", worst(|course| course.no_force_ms))
            .metric("told_ms", own.reported_ms),
    }
}

/// Row of a device that must refuse to open with a message containing `words`; `force_n` is the
/// motor force then.
fn refused<D>(driver: &str, name: &str, opened: Result<D, DeviceError>, words: &str, force_n: f64) -> Row {
    let reported = opened.err().map_or_else(|| "it opened".to_owned(), |error| error.to_string());
    Row::new(name, driver)
        .with("kind", "refused")
        .with("told_what_to_do", reported.contains(words))
        .with("told", without_folders(&reported))
        .metric("force_after_n", force_n)
}

/// The message without folders in its paths, so that it is the same in every run.
fn without_folders(reported: &str) -> String {
    let file = |word: &str| {
        let path = Path::new(word);
        path.file_name()
            .filter(|_| path.is_absolute())
            .map_or_else(|| word.into(), |name| name.to_string_lossy().into_owned())
    };
    reported.split(' ').map(file).collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_contain_no_folder_of_this_run() {
        let reported = format!("{} lacks a/b", std::env::temp_dir().join("run-1").join("lib.so:").display());
        assert_eq!(without_folders(&reported), "lib.so: lacks a/b");
    }

    /// Device whose force ends some ticks after the fault.
    struct Slow {
        ticks: u32,
        left: Option<u32>,
    }

    impl Bench for Slow {
        fn tick(&mut self) -> MotorForce {
            self.ticks += 1;
            self.left = self.left.map(|left| left.saturating_sub(1));
            MotorForce { at_ms: self.ticks.into(), force_n: if self.left == Some(0) { 0.0 } else { 1.0 } }
        }
        fn fault(&self) -> Option<Fault> {
            (self.left == Some(0)).then_some(Fault::NoPower)
        }
    }

    #[test]
    fn a_late_cut_or_a_wrong_message_fails_its_gate() {
        let begin = |bench: &mut Slow| bench.left = Some(12);
        let failed = |then: Then| {
            let case = Case { name: "slow", begin, then };
            let course = run(&mut Slow { ticks: 0, left: None }, &case);
            let rows = [row("bench", &case, &[course])];
            let failed = gates(&rows).into_iter().skip(1).filter(|gate| !gate.pass);
            failed.map(|gate| (gate.name, gate.value)).collect::<Vec<_>>()
        };
        let late = ("faults: from fault to no force, ms".to_owned(), 12.0);
        let mute = ("faults whose message does not say what to do".to_owned(), 1.0);
        assert_eq!(failed(Then::Cut(Fault::Braked)), [late.clone(), mute.clone()]);
        assert_eq!(failed(Then::Cut(Fault::NoPower)), [late]);
        assert_eq!(failed(Then::Kept), [mute, ("faults that must not matter: force kept, N".to_owned(), 0.0)]);
    }
}
