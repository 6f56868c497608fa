//! Fault cases of the libHD driver.

use super::{Bench, Case, Loop, MotorForce, Then, refused, row, run};
use trepan_emulators::{Library, hd};
use trepan_evidence::suite::Row;
use trepan_haptics::openhaptics::{Config, OpenHaptics};
use trepan_haptics::{DeviceError, Fault, HapticDevice};

const DRIVER: &str = "openhaptics";

/// First device in a loop, a second one beside it, and the library, whose servo ticks after each
/// loop tick.
struct Touch {
    library: Library,
    hand: Loop<OpenHaptics>,
    other: OpenHaptics,
    tick: u32,
    /// Whether the loop does not run.
    silent: bool,
    /// Loop ticks per servo tick.
    servo_period: u32,
    /// Loop ticks since the last servo tick.
    servo_waits: u32,
    /// Loop ticks during which no code can act.
    paused: u32,
}

/// Rows of all fault cases.
pub fn rows() -> Vec<Row> {
    let in_use = cases().into_iter().filter_map(|case| {
        let mut bench = Touch::new().ok()?;
        let course = run(&mut bench, &case);
        Some(row(DRIVER, &case, &[course]))
    });
    in_use.chain(at_opening()).collect()
}

impl Touch {
    fn new() -> Result<Self, DeviceError> {
        let library = Library::hd();
        library.set(hd::of_second(hd::NAME), 3.0);
        let hand = Loop::new(open(&library, None)?);
        let other = open(&library, Some("Right"))?;
        Ok(Self { library, hand, other, tick: 0, silent: false, servo_period: 1, servo_waits: 0, paused: 0 })
    }

    fn error(&mut self, code: u32) {
        self.library.set(hd::ERROR, code.into());
    }
}

impl Bench for Touch {
    fn tick(&mut self) -> MotorForce {
        self.tick += 1;
        if !self.silent {
            self.hand.tick(self.tick.into());
            self.other.read(self.tick.into());
        }
        self.servo_waits += 1;
        if self.servo_waits >= self.servo_period {
            self.servo_waits = 0;
            self.library.set(hd::TICKS, 1.0);
        }
        let force = [hd::FORCE_X, hd::FORCE_Y, hd::FORCE_Z].map(|key| self.library.get(key));
        MotorForce { at_ms: (self.tick - self.paused).into(), force_n: force.iter().map(|n| n * n).sum::<f64>().sqrt() }
    }

    fn fault(&self) -> Option<Fault> {
        self.hand.device.watch().fault()
    }
}

fn open(library: &Library, name: Option<&str>) -> Result<OpenHaptics, DeviceError> {
    let (library, device) = (Some(library.path().to_owned()), name.map(str::to_owned));
    OpenHaptics::open(&Config { device, library, ..Config::default() })
}

fn cases() -> Vec<Case<Touch>> {
    let case = |name, begin, then| Case { name, begin, then };
    let codes: [(_, fn(&mut Touch), _); 14] = [
        ("motors too warm by their own heat", |b| b.library.set(hd::HEATING, 0.3), Fault::Overheated),
        ("motors too warm 0200", |b| b.error(0x0200), Fault::Overheated),
        ("force refused: too great 0201", |b| b.error(0x0201), Fault::ForceRefused),
        ("force refused: too sudden 0202", |b| b.error(0x0202), Fault::ForceRefused),
        ("tool over 1 m/s 0203", |b| b.library.set(hd::VELOCITY_X, 2000.0), Fault::TooFast),
        ("force error 0204", |b| b.error(0x0204), Fault::ForceRefused),
        ("device fault 0300", |b| b.error(0x0300), Fault::Disconnected),
        ("unplugged in contact 0302", |b| b.error(0x0302), Fault::Disconnected),
        ("link set up wrongly 0303", |b| b.error(0x0303), Fault::Stopped),
        ("servo's timer fails 0304", |b| b.error(0x0304), Fault::Stopped),
        ("frame begun twice 0400", |b| b.error(0x0400), Fault::Stopped),
        ("force outside a frame 0402", |b| b.error(0x0402), Fault::Stopped),
        ("scheduler full 0501", |b| b.error(0x0501), Fault::Stopped),
        ("calibration lost 5002", |b| b.library.set(hd::CALIBRATION, f64::from(0x5002)), Fault::NotCalibrated),
    ];
    let times: [(_, fn(&mut Touch), _); 5] = [
        ("calibration with a jump 5001", |b| b.library.set(hd::CALIBRATION, f64::from(0x5001)), Fault::NotCalibrated),
        ("loop silent", |b| b.silent = true, Fault::LoopSilent),
        ("stale pose: not a number", |b| b.library.set(hd::POSITION_X, f64::NAN), Fault::Stale),
        ("callbacks every 8 ms", |b| b.servo_period = 8, Fault::Stale),
        ("no callback for 200 ms, from its return", pause, Fault::Stale),
    ];
    let kept: [(_, fn(&mut Touch)); 3] = [
        ("callbacks every 3 ms", |b| b.servo_period = 3),
        ("the other device is unplugged 0302", |b| b.library.set(hd::of_second(hd::ERROR), f64::from(0x0302))),
        ("the other device is too warm 0200", |b| b.library.set(hd::of_second(hd::ERROR), f64::from(0x0200))),
    ];
    let cut = codes.into_iter().chain(times).map(|(name, begin, fault)| case(name, begin, Then::Cut(fault)));
    cut.chain(kept.into_iter().map(|(name, begin)| case(name, begin, Then::Kept))).collect()
}

/// Runs the loop for 200 ms without the library.
fn pause(bench: &mut Touch) {
    bench.servo_period = 201;
    (0..200).for_each(|_| _ = bench.tick());
    (bench.servo_period, bench.paused) = (1, 200);
}

fn at_opening() -> Vec<Row> {
    let faults: [(_, fn(&Library), _); 4] = [
        ("wrong name 0300", |l| l.set(hd::NAME, 1.0), "give the name that the maker's set-up tool shows"),
        ("taken by another program 0301", |l| l.set(hd::TAKEN, 1.0), "close other programs"),
        ("no licence 0600", |l| l.set(hd::UNLICENSED, 1.0), "Invalid license (error 0600)"),
        ("scheduler does not start 0304", |l| l.set(hd::STUCK, 1.0), "Timer error (error 0304)"),
    ];
    let refusal = |(name, begin, words): (&str, fn(&Library), &str)| {
        let library = Library::hd();
        begin(&library);
        let opened = open(&library, None);
        refused(DRIVER, name, opened, words, library.get(hd::FORCE_X))
    };
    let lacking =
        refused(DRIVER, "library without a function", open(&Library::nothing(), None), "lacks the function", 0.0);
    faults.into_iter().map(refusal).chain([lacking]).collect()
}
