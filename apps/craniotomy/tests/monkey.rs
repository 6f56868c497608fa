//! A seeded monkey with mouse and keys in front of a real window. If it says yes to the question
//! whether the session shall end, it plays on on the other pages, and if it closes the window, it
//! begins again. Needs Xvfb and xdotool; without them it says so and ends. `TREPAN_MONKEY_MINUTES`
//! lets it play longer, `TREPAN_MONKEY_SEED` otherwise, `TREPAN_PERSON_PROGRAM` with another
//! program's file.
#![cfg(target_os = "linux")]
#![expect(clippy::unwrap_used, reason = "a test may panic")]

#[expect(dead_code, reason = "another test uses the rest")]
mod person;

use person::Person;
use std::time::{Duration, Instant};
use trepan_contact::GuardConfig;
use trepan_link::Recording;

/// Minutes that the monkey plays in CI.
const MINUTES: f64 = 0.4;
/// Left and right edge of the slices at 1280 by 800, and the height of the window.
const SLICES: [u32; 2] = [760, 1000];
const HEIGHT: u32 = 800;
/// Keys that it presses: all that do something, and some that do not. Return would say yes to the
/// question whether the session shall end.
const KEYS: &str = "n u y x r d F2 F3 F4 F5 F6 m b t s w o c e p l i F1 question Escape q f 1 2 3 4 5 6 space Tab \
                    Up Down Left Right Prior Next plus minus Control_L Shift_L Alt_L g h j k z a bracketleft";

fn number(name: &str, usual: f64) -> f64 {
    std::env::var(name).ok().and_then(|text| text.parse().ok()).unwrap_or(usual)
}

/// A hand that does anything within a part of the window.
struct Monkey<'a> {
    person: &'a Person,
    random: fastrand::Rng,
    /// From the left to the right edge that it reaches, and whether it uses keys.
    reach: [u32; 2],
    keys: bool,
}

impl Monkey<'_> {
    fn plays(&mut self, minutes: f64) -> u32 {
        let (until, mut acts) = (Instant::now() + Duration::from_secs_f64(60.0 * minutes), 0);
        while Instant::now() < until && self.person.is_there() {
            self.acts();
            acts += 1;
        }
        self.person.does("mouseup 1 mouseup 2 mouseup 3 keyup shift keyup ctrl");
        acts
    }

    fn goes(&mut self) {
        let (x, y) = (self.random.u32(self.reach[0]..self.reach[1]), self.random.u32(0..HEIGHT));
        self.person.does(&format!("mousemove {x} {y}"));
    }

    fn acts(&mut self) {
        self.goes();
        match self.random.u8(0..10) {
            0..=1 => _ = self.person.does("click 1"),
            2..=3 => {
                self.person.does("mousedown 1");
                for _ in 0..self.random.u8(1..5) {
                    self.person.rests(self.random.f32());
                    self.goes();
                }
                self.person.does("mouseup 1");
            }
            4 => {
                let button = self.random.u8(2..4);
                self.person.does(&format!("mousedown {button}"));
                self.goes();
                self.person.rests(0.1);
                self.person.does(&format!("mouseup {button}"));
            }
            5..=6 => {
                let (button, times) = (self.random.u8(4..6), self.random.u8(1..30));
                self.person.does(&format!("click --repeat {times} --delay 10 {button}"));
            }
            7 if self.keys => {
                let held = ["shift", "ctrl"][self.random.usize(0..2)];
                self.person.does(&format!("keydown {held} click 4 click 1 click 5 keyup {held}"));
            }
            _ if self.keys => {
                let all: Vec<&str> = KEYS.split_whitespace().collect();
                let key = all[self.random.usize(0..all.len())];
                self.person.does(&format!("key {key}"));
                // The question is taken back as often as it is asked.
                if key == "q" {
                    self.person.does("key Escape");
                }
            }
            _ => _ = self.person.does("click 3"),
        }
        self.person.rests(0.05);
    }
}

/// Largest force on the hand in a recording over the limit of its guard, N.
fn over_limit_n(recording: &Recording) -> f32 {
    let peak_n: f32 = recording.header.config["device.peak_force_n"].parse().unwrap();
    let limit_n = if peak_n > 0.0 { peak_n } else { GuardConfig::default().max_force_n };
    recording.ticks.iter().map(|tick| tick.wrench.force.length() - limit_n).fold(f32::MIN, f32::max)
}

#[test]
fn a_monkey_breaks_nothing_and_cuts_nothing_outside_the_view() {
    let settings = serde_json::json!({ "quality": "draft" }).to_string();
    let until = Instant::now() + Duration::from_secs_f64(60.0 * number("TREPAN_MONKEY_MINUTES", MINUTES));
    let left = || until.saturating_duration_since(Instant::now()).as_secs_f64() / 60.0;
    let mut random = fastrand::Rng::with_seed(number("TREPAN_MONKEY_SEED", 1.0) as u64);
    while left() > 0.0 {
        let home = tempfile::tempdir().unwrap();
        let Some(mut person) = Person::sits_down(home.path(), &settings) else {
            eprintln!("Xvfb or xdotool is missing: no monkey plays");
            return;
        };
        person.goes_on();
        person.waits_for_session(1);
        let mut monkey = Monkey { person: &person, random: random.fork(), reach: SLICES, keys: false };
        let mut acts = monkey.plays(0.3 * left());
        person.rests(1.0);
        let removed: f64 = person.recording().ticks.iter().map(|tick| f64::from(tick.removed_mm3)).sum();
        assert_eq!(removed, 0.0, "a slice is looked at and nothing is cut");
        monkey.reach = [0, 1280];
        monkey.keys = true;
        acts += monkey.plays(left());
        person.rests(1.0);
        let log = person.log();
        assert!(!log.contains("panicked"), "{log}");
        // Somebody who closes the window after an error sees it once more on the console.
        let code = person.code();
        assert!(matches!(code, None | Some(0 | 2)), "the program ended with {code:?}:\n{log}");
        let recordings = person.recordings();
        for (recording, is_whole) in &recordings {
            let over_n = over_limit_n(recording);
            assert!(over_n <= 1e-4, "the guard let {over_n} N too much through");
            let runs = code.is_none() && std::ptr::eq(recording, &recordings.last().unwrap().0);
            assert!(*is_whole || runs, "a session that ended has no summary:\n{log}");
        }
        let ticks: usize = recordings.iter().map(|(recording, _)| recording.ticks.len()).sum();
        eprintln!("{acts} acts, {} session(s) of {:.0} s, ended with {code:?}", recordings.len(), ticks as f64 * 1e-3);
    }
}
