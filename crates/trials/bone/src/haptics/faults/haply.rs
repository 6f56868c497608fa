//! Fault cases of the driver of Haply's service, in real time.

use super::{Bench, Case, Course, Loop, MotorForce, Scope, Then, refused, row, run};
use std::thread;
use std::time::{Duration, Instant};
use trepan_emulators::service::{Behaviour, Service};
use trepan_evidence::suite::Row;
use trepan_haptics::haply::{Config, Haply};
use trepan_haptics::{DeviceError, Fault};

const DRIVER: &str = "haply";
/// Length of a loop tick.
const TICK: Duration = Duration::from_millis(1);
/// Longest wait for the response to a tick.
const PATIENCE: Duration = Duration::from_millis(2);

/// Device in a loop that runs as fast as the service responds until the fault begins, then at 1
/// kHz.
struct Inverse {
    service: Service,
    hand: Loop<Haply>,
    start: Instant,
    began: Option<Instant>,
    silent: bool,
}

/// Rows of all fault cases.
pub fn rows(scope: Scope) -> Vec<Row> {
    let in_use = cases().into_iter().filter_map(|case| {
        let courses = courses(&case, scope.pick(3, 5)).ok()?;
        Some(row(DRIVER, &case, &courses))
    });
    in_use.chain(at_opening()).collect()
}

/// Longest tick of a run that the machine left alone, ms.
const HELD_MS: f64 = 3.0;
/// Largest number of runs of a case.
const MOST_RUNS: usize = 20;

/// Runs until the machine left `wanted` runs alone.
fn courses(case: &Case<Inverse>, wanted: usize) -> Result<Vec<Course>, DeviceError> {
    let mut courses: Vec<Course> = Vec::new();
    while courses.len() < MOST_RUNS && courses.iter().filter(|one| one.held_ms <= HELD_MS).count() < wanted {
        courses.push(run(&mut Inverse::new()?, case));
    }
    Ok(courses)
}

impl Inverse {
    fn new() -> Result<Self, DeviceError> {
        let service = Service::start(Behaviour::default());
        let hand = Loop::new(open(&service)?);
        Ok(Self { service, hand, start: Instant::now(), began: None, silent: false })
    }

    fn behave(&mut self, change: impl FnOnce(&mut Behaviour)) {
        self.service.behave(change);
        self.began = Some(Instant::now());
    }

    fn event(&mut self, name: &str, safety: &str) {
        let event = format!(r#"{{"name":"{name}","level":"warning","data":{{"safety_type":"{safety}"}}}}"#);
        self.behave(|b| b.event = Some(event));
    }

    fn now_ms(&self) -> f64 {
        self.start.elapsed().as_secs_f64() * 1e3
    }

    /// Waits for the next tick: for the response before the fault, for 1 ms after it.
    fn wait(&self, messages: u32) {
        let asked = Instant::now();
        if self.began.is_some() {
            thread::sleep(TICK);
        }
        while self.began.is_none() && self.service.received().messages == messages && asked.elapsed() < PATIENCE {
            thread::yield_now();
        }
    }
}

impl Bench for Inverse {
    fn tick(&mut self) -> MotorForce {
        let messages = self.service.received().messages;
        if !self.silent {
            let now_ms = self.now_ms();
            self.hand.tick(now_ms);
        }
        self.wait(messages);
        let received = self.service.received();
        let force_n = received.force.unwrap_or_default().iter().map(|n| n * n).sum::<f64>().sqrt();
        // The service records most precisely when the force ended.
        let at_ms = match (self.began, received.no_force_after) {
            (Some(began), Some(after)) if force_n == 0.0 => ((began - self.start) + after).as_secs_f64() * 1e3,
            _ => self.now_ms(),
        };
        MotorForce { at_ms, force_n }
    }

    fn fault(&self) -> Option<Fault> {
        self.hand.device.watch().fault()
    }
}

fn open(service: &Service) -> Result<Haply, DeviceError> {
    Haply::open(&Config { service: service.simulation.clone(), events: service.events.clone(), ..Config::default() })
}

const UNCALIBRATED: &str = r#"{"calibrated":false,"power_supply":true,"ready":true}"#;
const UNPOWERED: &str = r#"{"calibrated":true,"power_supply":false,"ready":true}"#;
const UNREADY: &str = r#"{"calibrated":true,"power_supply":true,"ready":false}"#;
const WITHOUT_POSE: &str = r#"{"inverse3":[{"device_id":"049D","state":{"mode":"idle"}}]}"#;
const OLD: &str = r#"{"inverse3":{"049D":{}}}"#;
/// Malformed device and grip beside valid ones, and a grip in two lists.
const NEIGHBOURS: &str = r#"{"inverse3":[{"device_id":7,"state":"?"},{"device_id":"049D","state":
    {"cursor_position":{"x":0,"y":0,"z":0},"cursor_velocity":{"x":0,"y":0,"z":0}}}],"verse_grip":[{"state":[]}],
    "wireless_verse_grip":[{"device_id":"60BD","state":{"buttons":{"a":true}}}],
    "custom_verse_grip":[{"device_id":"60BD","state":{"buttons":{"a":true}}}]}"#;

fn cases() -> Vec<Case<Inverse>> {
    let cut: [(_, fn(&mut Inverse), _); 15] = [
        ("not calibrated", |b| b.behave(|s| s.status = UNCALIBRATED.into()), Fault::NotCalibrated),
        ("no power", |b| b.behave(|s| s.status = UNPOWERED.into()), Fault::NoPower),
        ("not ready", |b| b.behave(|s| s.status = UNREADY.into()), Fault::Braked),
        ("garbage JSON", |b| b.behave(|s| s.garbage = Some("{\"inverse3\": [".into())), Fault::InvalidMessage),
        ("replies of an older version", |b| b.behave(|s| s.garbage = Some(OLD.into())), Fault::InvalidMessage),
        ("replies 50 ms late", |b| b.behave(|s| s.late_ms = 50), Fault::ServiceSilent),
        ("replies 10 ms late", |b| b.behave(|s| s.late_ms = 10), Fault::ServiceSilent),
        ("no replies", |b| b.behave(|s| s.mute = true), Fault::ServiceSilent),
        ("stale pose: replies without one", |b| b.behave(|s| s.garbage = Some(WITHOUT_POSE.into())), Fault::Stale),
        ("unplugged in contact", |b| b.behave(|s| s.unplugged = true), Fault::Disconnected),
        ("service restarts", |b| b.behave(|s| s.hang_up = true), Fault::Disconnected),
        ("emergency brake", |b| b.event("device-safety-triggered", "ebrake_triggered"), Fault::Braked),
        ("motors stalled", |b| b.event("device-safety-triggered", "stall_detected"), Fault::Braked),
        ("device disconnected, by event", |b| b.event("device-disconnected", ""), Fault::Braked),
        ("loop silent", silence, Fault::LoopSilent),
    ];
    let kept: [(_, fn(&mut Inverse)); 3] = [
        ("replies 1 ms late", |b| b.behave(|s| s.late_ms = 1)),
        ("malformed neighbours, doubled grip", |b| b.behave(|s| s.garbage = Some(NEIGHBOURS.into()))),
        ("unknown event", |b| b.event("something-new", "")),
    ];
    let cut = cut.into_iter().map(|(name, begin, fault)| Case { name, begin, then: Then::Cut(fault) });
    cut.chain(kept.into_iter().map(|(name, begin)| Case { name, begin, then: Then::Kept })).collect()
}

fn silence(bench: &mut Inverse) {
    bench.behave(|_| {});
    bench.silent = true;
}

fn at_opening() -> Vec<Row> {
    let faults: [(_, Behaviour, _); 4] = [
        ("no device", Behaviour { unplugged: true, ..Behaviour::default() }, "plug it in"),
        ("service older than 3.5", Behaviour { inventory: Some(OLD.into()), ..Behaviour::default() }, "update Haply's"),
        ("not Haply's service", Behaviour { inventory: Some("hello".into()), ..Behaviour::default() }, "has its port"),
        ("answers nothing", Behaviour { inventory: Some(String::new()), ..Behaviour::default() }, "has its port"),
    ];
    let refusal = |(name, behaviour, words)| {
        let service = Service::start(behaviour);
        let opened = open(&service);
        let force = service.received().force.unwrap_or_default();
        refused(DRIVER, name, opened, words, force.into_iter().map(f64::abs).sum())
    };
    let nobody = Config { service: "127.0.0.1:1".into(), ..Config::default() };
    let absent = refused(DRIVER, "no service", Haply::open(&nobody), "install and start Haply's", 0.0);
    faults.into_iter().map(refusal).chain([absent]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use trepan_emulators::service::READY;

    #[test]
    fn the_json_texts_match_their_names() {
        let json = |text: &str| serde_json::from_str::<serde_json::Value>(text).unwrap();
        assert!(json(NEIGHBOURS)["inverse3"].is_array() && json(OLD)["inverse3"].is_object());
        assert!([UNCALIBRATED, UNPOWERED, UNREADY, READY].iter().all(|text| json(text)["ready"].is_boolean()));
    }
}
