//! A scripted person with a mouse in a real window: the built-in case, then a DICOM folder by the
//! dialogue; a burr hole; a flap. Needs Xvfb and xdotool; without them it says so and ends.
#![cfg(target_os = "linux")]
#![expect(clippy::unwrap_used, reason = "a test may panic")]

#[path = "../../integrated/tests/dicom/mod.rs"]
mod dicom;
#[expect(dead_code, reason = "another test uses the rest")]
mod person;

use glam::{Mat2, Quat, Vec2, Vec3};
use person::Person;
use std::cell::Cell;
use std::fs;
use std::path::Path;
use std::time::{Duration, Instant};
use trepan_link::wire::TickRecord;

/// Controls at 1280 by 800: "Open CT..." and the first folder of the dialogue.
const OPEN_CT: [u32; 2] = [162, 404];
const FIRST_FOLDER: [u32; 2] = [250, 220];

#[test]
fn a_person_opens_the_built_in_case_and_then_a_dicom_folder() {
    let home = tempfile::tempdir().unwrap();
    let images = home.path().join("images");
    fs::create_dir(&images).unwrap();
    dicom::series(&images);
    let settings = serde_json::json!({ "folder": images, "quality": "draft", "person": "Ada" });
    let Some(person) = Person::sits_down(home.path(), &settings.to_string()) else {
        eprintln!("Xvfb or xdotool is missing: nobody sat down");
        return;
    };
    person.goes_on();
    person.waits_for_session(1);
    let first = person.ends(1);
    assert_eq!((first["case"].as_str(), first["person"].as_str()), (Some("case-head"), Some("Ada")));
    person.goes_on();
    person.clicks(OPEN_CT);
    person.clicks(FIRST_FOLDER);
    person.goes_on();
    person.goes_on();
    person.waits_for_session(2);
    let second = person.ends(2);
    let case = second["case"].as_str().unwrap();
    assert!(case.starts_with("case-") && case != "case-head" && !case.contains("MUSTERMANN"), "{case}");
}

/// Middle of the picture at 1280 by 800, where the opening is.
const MIDDLE: [f32; 2] = [374.0, 400.0];
/// Buttons of the panel: "Draw the tool back", "Lift the flap, or put it back", "craniotome".
const DRAW_BACK: [u32; 2] = [1090, 567];
const LIFT: [u32; 2] = [1135, 495];
const CRANIOTOME: [u32; 2] = [1135, 466];
/// Time after which a person presses again if nothing turns.
const PATIENCE: Duration = Duration::from_secs(20);
/// Diameter of the flap, mm.
const FLAP_MM: f32 = 16.0;

#[test]
fn a_person_drills_a_burr_hole_by_mouse_alone() {
    let home = tempfile::tempdir().unwrap();
    let settings = serde_json::json!({ "quality": "draft" });
    let Some(person) = Person::sits_down(home.path(), &settings.to_string()) else {
        eprintln!("Xvfb or xdotool is missing: nobody sat down");
        return;
    };
    let began = Instant::now();
    person.goes_on();
    person.waits_for_session(1);
    person.points(MIDDLE);
    person.rests(2.0);
    person.does("mousedown 1");
    // A slow picture may miss a press: after a while she presses again.
    let pressed = Cell::new(Instant::now());
    person.waits_for("the breakthrough", || {
        if pressed.get().elapsed() > PATIENCE && !person.tick().has(TickRecord::DRILLING) {
            ["mouseup 1", "mousedown 1"].into_iter().for_each(|what| _ = person.does(what));
            pressed.set(Instant::now());
        }
        person.count_in_log("came through") > 0
    });
    eprintln!("through {:.0} s after the click on the start page", began.elapsed().as_secs_f64());
    // She does not notice.
    person.rests(4.0);
    let deepest = |ticks: &[TickRecord]| ticks.iter().map(|tick| tick.brain_distance_mm).fold(f32::MAX, f32::min);
    let recording = person.recording();
    let at = recording.ticks.iter().position(|tick| tick.has(TickRecord::THROUGH)).unwrap();
    let past_mm = recording.ticks[at].brain_distance_mm - deepest(&recording.ticks[at..]);
    assert!(past_mm < 1.0, "the held button drilled on by {past_mm} mm");
    assert!(!person.tick().has(TickRecord::DRILLING));
    person.does("mouseup 1");
    let summary = person.ends(1);
    let removed_mm3 = summary["bone_removed_mm3"].as_f64().unwrap();
    eprintln!("{removed_mm3:.0} mm3 removed, {past_mm:.2} mm past the breakthrough");
    assert!(removed_mm3 > 50.0 && summary["through_s"].as_array().unwrap().len() == 1, "{removed_mm3}");
}

/// World mm on the skull around the middle of the picture, seen along the bone's normal.
struct Chart {
    middle: Vec2,
    /// Way of the tip for a pixel to the right and for a pixel down, in the skull's plane.
    per_pixel: Mat2,
    /// From world to that plane.
    plane: Quat,
}

impl Chart {
    /// Points at three places and looks where the tool is.
    fn of(person: &Person) -> Self {
        let at = |x: f32, y: f32, away: &[Vec3]| {
            person.points([MIDDLE[0] + x, MIDDLE[1] + y]);
            person.waits_for("the tool at the pointer", || {
                let before = person.tick();
                person.rests(1.0);
                let now = person.tick();
                let place = now.proxy.translation;
                let is_at_rest =
                    now.time_ms > before.time_ms + 300.0 && place.distance(before.proxy.translation) < 0.05;
                is_at_rest && away.iter().all(|other| other.distance(place) > 2.0)
            });
            person.tick().proxy.translation
        };
        let middle = at(0.0, 0.0, &[]);
        let right = at(40.0, 0.0, &[middle]);
        let down = at(0.0, 40.0, &[middle, right]);
        let normal = (down - middle).cross(right - middle).normalize();
        let plane = Quat::from_rotation_arc(Vec3::Z, normal).inverse();
        let way = |to: Vec3| (plane * (to - middle)).truncate() / 40.0;
        Self { middle: (plane * middle).truncate(), per_pixel: Mat2::from_cols(way(right), way(down)), plane }
    }

    /// Pixel of a place in the skull's plane, from the middle, mm.
    fn pixel(&self, place: Vec2) -> [f32; 2] {
        (Vec2::from(MIDDLE) + self.per_pixel.inverse() * place).to_array()
    }

    /// Where the tool is, from the middle, mm.
    fn tip(&self, person: &Person) -> Vec2 {
        (self.plane * person.tick().proxy.translation).truncate() - self.middle
    }
}

#[test]
fn a_person_cuts_and_lifts_a_flap_by_mouse_alone() {
    let home = tempfile::tempdir().unwrap();
    let Some(person) = operating(home.path(), FLAP_MM) else { return };
    let chart = Chart::of(&person);
    let rim = |turn: f32| 0.5 * FLAP_MM * Vec2::from_angle(turn);
    let goes_to_the_rim = || {
        person.points(chart.pixel(rim(0.0)));
        person.waits_for("the tool at the rim", || chart.tip(&person).distance(rim(0.0)) < 1.5);
        person.rests(1.0);
    };
    goes_to_the_rim();
    // Through the bone, then the width of the drill.
    for words in ["a hole", "a wide hole"] {
        let pressed_ms = person.tick().time_ms;
        person.does("mousedown 1");
        // The drill may run for less than the recording's next piece takes to be written.
        person.waits_for(words, || {
            let ticks = person.recording().ticks;
            let mut since = ticks.iter().rev().take_while(|tick| tick.time_ms > pressed_ms).peekable();
            since.peek().is_some_and(|last| !last.has(TickRecord::DRILLING))
                && since.any(|tick| tick.has(TickRecord::DRILLING))
        });
        person.does("mouseup 1");
        person.rests(1.5);
        eprintln!("{words} at {:.0} s", person.tick().time_ms * 1e-3);
    }
    person.clicks(CRANIOTOME);
    person.waits_for("the craniotome", || person.tick().tool == 3);
    goes_to_the_rim();
    person.does("mousedown 1");
    person.rests(3.0);
    eprintln!("inserted at {:.0} s: brain {:.1} mm", person.tick().time_ms * 1e-3, person.tick().brain_distance_mm);
    // The foot went in beside the pointer: the drag makes up for it.
    let off = chart.tip(&person) - rim(0.0);
    eprintln!("the foot is {off} mm off");
    let (steps, began_ms) = (36, person.tick().time_ms);
    for step in 1..=steps + 3 {
        let to = rim(step as f32 / steps as f32 * std::f32::consts::TAU);
        person.points(chart.pixel(to - off));
        // Faster than the tool, which follows on the pointer's way.
        person.rests(0.3);
    }
    let end = rim(3.0 / steps as f32 * std::f32::consts::TAU);
    person.waits_for("the end of the lap", || {
        chart.tip(&person).distance(end) < 1.5 && person.tick().time_ms > began_ms + 5e3
    });
    eprintln!("a lap at {:.0} s", person.tick().time_ms * 1e-3);
    // She goes on holding: the foot rides on the inner table, it does not sink.
    person.rests(6.0);
    let ticks = person.recording().ticks;
    let cutting = ticks.iter().filter(|tick| tick.tool == 3).map(|tick| tick.brain_distance_mm);
    let deepest_mm = cutting.fold(f32::MAX, f32::min);
    assert!(deepest_mm > 0.0, "the craniotome's cutter sank {} mm into the brain", -deepest_mm);
    person.does("mouseup 1");
    person.waits_for("the free flap", || person.count_in_log("the flap is free") == 1);
    person.clicks(DRAW_BACK);
    person.rests(1.0);
    person.clicks(LIFT);
    person.waits_for("the lifted flap", || person.count_in_log("the flap is lifted") == 1);
    let summary = person.ends(1);
    eprintln!("plan {}", summary["plan"]);
    assert!(summary["plan"]["dice"].as_f64().unwrap() > 0.8, "{}", summary["plan"]);
}

/// Middle of the axial slice at 1280 by 800.
const AXIAL: [f32; 2] = [870.0, 130.0];
/// From the left edge of "Back to the start page" to the middle of "Replay", pixels.
const TO_REPLAY: u32 = 334;

/// A person in a running session with a planned flap, mm; `None` where the tools are missing.
fn operating(home: &Path, flap_mm: f32) -> Option<Person> {
    let settings = serde_json::json!({ "quality": "draft", "flap_mm": flap_mm });
    let person = Person::sits_down(home, &settings.to_string());
    if person.is_none() {
        eprintln!("Xvfb or xdotool is missing: nobody sat down");
    }
    let person = person?;
    person.goes_on();
    person.waits_for_session(1);
    Some(person)
}

#[test]
fn a_slice_is_looked_at_and_never_cuts_or_moves_the_tool() {
    let home = tempfile::tempdir().unwrap();
    let Some(person) = operating(home.path(), 0.0) else { return };
    let removed =
        |person: &Person| person.recording().ticks.iter().map(|tick| f64::from(tick.removed_mm3)).sum::<f64>();
    person.points(AXIAL);
    person.rests(1.0);
    let before = person.tick().device.translation;
    person.does("mousedown 1");
    person.rests(4.0);
    person.does("mouseup 1");
    person.does("click --repeat 20 --delay 10 5");
    person.rests(1.0);
    let moved_mm = person.tick().device.translation.distance(before);
    assert!(removed(&person) == 0.0 && moved_mm < 0.1, "a slice moved the tool by {moved_mm} mm");
    assert_eq!(person.ends(1)["bone_removed_mm3"].as_f64(), Some(0.0));
}

#[test]
fn escape_and_a_key_alone_never_end_the_operation() {
    let home = tempfile::tempdir().unwrap();
    let Some(person) = operating(home.path(), 0.0) else { return };
    let runs_on = |person: &Person, after: &str| {
        let then = person.tick().time_ms;
        person.rests(2.0);
        assert!(person.tick().time_ms > then + 500.0, "{after} ended the operation");
    };
    (0..3).for_each(|_| _ = person.does("key Escape"));
    runs_on(&person, "Escape");
    person.does("key q");
    person.rests(1.0);
    runs_on(&person, "Q alone");
}

#[test]
fn a_closed_replay_leaves_no_session_behind() {
    let home = tempfile::tempdir().unwrap();
    let Some(person) = operating(home.path(), 0.0) else { return };
    person.ends(1);
    person.waits_for("the result", || person.main_button().is_some());
    person.rests(1.0);
    let [x, y] = person.main_button().unwrap();
    person.clicks([x - 20 + TO_REPLAY, y]);
    // A replay has the tool in the hand in the same colour, at another place.
    person.waits_for("the replay", || person.main_button() != Some([x, y]));
    person.rests(8.0);
    person.does("key q");
    person.waits_for("the result again", || person.main_button() == Some([x, y]));
    assert_eq!(person.number_of_sessions(), 1, "a replay is no session");
}
