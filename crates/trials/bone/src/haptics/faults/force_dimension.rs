//! Fault cases of the libdrd driver.

use super::{Bench, Case, Loop, MotorForce, Then, refused, row, run};
use trepan_emulators::{Library, drd};
use trepan_evidence::suite::Row;
use trepan_haptics::force_dimension::{Config, ForceDimension};
use trepan_haptics::{DeviceError, Fault};

const DRIVER: &str = "force-dimension";

/// Device in a loop.
struct Omega {
    library: Library,
    hand: Loop<ForceDimension>,
    tick: u32,
    /// Time for which the loop does not run, ms.
    silent_ms: Option<f64>,
    /// Whether reads come too soon in every other tick.
    hasty: bool,
}

/// Rows of all fault cases.
pub fn rows() -> Vec<Row> {
    let in_use = cases().into_iter().filter_map(|case| {
        let mut bench = Omega::new(Library::drd()).ok()?;
        let course = run(&mut bench, &case);
        Some(row(DRIVER, &case, &[course]))
    });
    let old = Case { name: "older library without optional functions", begin: |_| {}, then: Then::Kept };
    let older = Omega::new(Library::old_drd()).ok().map(|mut bench| row(DRIVER, &old, &[run(&mut bench, &old)]));
    in_use.chain(older).chain(at_opening()).collect()
}

impl Omega {
    fn new(library: Library) -> Result<Self, DeviceError> {
        let hand = Loop::new(open(&library)?);
        Ok(Self { library, hand, tick: 0, silent_ms: None, hasty: false })
    }
}

impl Bench for Omega {
    fn tick(&mut self) -> MotorForce {
        self.tick += 1;
        if self.hasty {
            self.library.set(drd::TOO_SOON, f64::from(self.tick % 2));
        }
        match &mut self.silent_ms {
            Some(silent_ms) if *silent_ms < 20.0 => {
                *silent_ms += 1.0;
                self.library.set(drd::SILENCE_MS, *silent_ms);
            }
            // The loop resumes: it learns why there is no force.
            _ => self.hand.tick(self.tick.into()),
        }
        let force = [drd::FORCE_X, drd::FORCE_Y, drd::FORCE_Z].map(|key| self.library.get(key));
        MotorForce { at_ms: self.tick.into(), force_n: force.iter().map(|n| n * n).sum::<f64>().sqrt() }
    }

    fn fault(&self) -> Option<Fault> {
        self.hand.device.watch().fault()
    }
}

fn open(library: &Library) -> Result<ForceDimension, DeviceError> {
    ForceDimension::open(&Config { library: Some(library.path().to_owned()), ..Config::default() })
}

fn cases() -> Vec<Case<Omega>> {
    let cut: [(_, fn(&mut Omega), _); 11] = [
        ("force button", |b| b.library.set(drd::CAUSE, 1.0), Fault::Braked),
        ("tool too fast", |b| b.library.set(drd::CAUSE, 2.0), Fault::TooFast),
        ("watchdog ran out", |b| b.library.set(drd::CAUSE, 3.0), Fault::LoopSilent),
        ("USB lost, by its status", |b| b.library.set(drd::CAUSE, 5.0), Fault::Disconnected),
        ("dead-man switch", |b| b.library.set(drd::CAUSE, 6.0), Fault::Braked),
        ("loop silent", |b| b.silent_ms = Some(0.0), Fault::LoopSilent),
        ("no power", |b| b.library.set(drd::POWER, 0.0), Fault::NoPower),
        ("unplugged in contact", |b| b.library.set(drd::UNPLUGGED, 1.0), Fault::Disconnected),
        ("force refused", |b| b.library.set(drd::REFUSES_FORCE, 1.0), Fault::Disconnected),
        ("stale pose: every read too soon", |b| b.library.set(drd::TOO_SOON, 1.0), Fault::Stale),
        ("stale pose: not a number", |b| b.library.set(drd::POSITION_X, f64::NAN), Fault::Stale),
    ];
    let kept: [(_, fn(&mut Omega)); 3] = [
        ("every other read too soon", |b| b.hasty = true),
        ("velocity not known", |b| b.library.set(drd::NO_VELOCITY, 1.0)),
        ("motors saturated, at each force", |_| {}),
    ];
    let cut = cut.into_iter().map(|(name, begin, fault)| Case { name, begin, then: Then::Cut(fault) });
    cut.chain(kept.into_iter().map(|(name, begin)| Case { name, begin, then: Then::Kept })).collect()
}

fn at_opening() -> Vec<Row> {
    let faults: [(_, fn(&Library), _); 4] = [
        ("no device", |l| l.set(drd::DEVICES, 0.0), "plug it in"),
        ("in use by another program", |l| l.set(drd::BUSY, 1.0), "close other programs"),
        ("not initialised", |l| l.set(drd::INITIALISED, 0.0), "take your hands off"),
        ("firmware without a watchdog", |l| l.set(drd::NO_WATCHDOG, 1.0), "update the device's firmware"),
    ];
    let refusal = |(name, begin, words): (&str, fn(&Library), &str)| {
        let library = Library::drd();
        begin(&library);
        let opened = open(&library);
        refused(DRIVER, name, opened, words, library.get(drd::FORCE_X))
    };
    let lacking = refused(DRIVER, "library without a function", open(&Library::nothing()), "lacks the function", 0.0);
    faults.into_iter().map(refusal).chain([lacking]).collect()
}
