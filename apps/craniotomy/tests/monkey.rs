//! A seeded monkey with mouse and keys in front of a real window. Needs Xvfb and xdotool; without
//! them it says so and ends. `TREPAN_MONKEY_MINUTES` lets it play longer, `TREPAN_MONKEY_SEED`
//! otherwise, `TREPAN_PERSON_PROGRAM` with another program's file.
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
    let peak_n: f32 = recording.header.config["device_peak_force_n"].parse().unwrap();
    let limit_n = if peak_n > 0.0 { peak_n } else { GuardConfig::default().max_force_n };
    recording.ticks.iter().map(|tick| tick.wrench.force.length() - limit_n).fold(f32::MIN, f32::max)
}

#[test]
fn a_monkey_breaks_nothing_and_cuts_nothing_outside_the_view() {
    let home = tempfile::tempdir().unwrap();
    let settings = serde_json::json!({ "quality": "draft" }).to_string();
    let Some(person) = Person::sits_down(home.path(), &settings) else {
        eprintln!("Xvfb or xdotool is missing: no monkey plays");
        return;
    };
    let minutes = number("TREPAN_MONKEY_MINUTES", MINUTES);
    let seed = number("TREPAN_MONKEY_SEED", 1.0) as u64;
    person.goes_on();
    person.waits_for_session(1);
    let mut monkey = Monkey { person: &person, random: fastrand::Rng::with_seed(seed), reach: SLICES, keys: false };
    let mut acts = monkey.plays(0.3 * minutes);
    person.rests(1.0);
    let removed: f64 = person.recording().ticks.iter().map(|tick| f64::from(tick.removed_mm3)).sum();
    assert_eq!(removed, 0.0, "a slice is looked at and nothing is cut");
    monkey.reach = [0, 1280];
    monkey.keys = true;
    acts += monkey.plays(0.7 * minutes);
    person.rests(1.0);
    assert!(person.is_there(), "the program has ended:\n{}", person.said());
    assert!(!person.said().contains("panicked"), "{}", person.said());
    let recording = person.recording();
    let over_n = over_limit_n(&recording);
    eprintln!("{acts} acts, {:.0} s, {over_n:.3} N over the limit", recording.ticks.len() as f64 * 1e-3);
    assert!(over_n <= 1e-4, "the guard let {over_n} N too much through");
    let lasted_s = recording.ticks.last().unwrap().time_ms * 1e-3;
    assert!(lasted_s > 0.8 * 60.0 * minutes, "the session ended by itself after {lasted_s} s");
}
