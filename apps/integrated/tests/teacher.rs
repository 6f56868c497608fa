//! A teacher of a running session: her requests reach the haptic loop and the recording, and end
//! when she sends nothing more.

use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};
use trepan_geometry::Buttons;
use trepan_link::Recording;
use trepan_link::topics::Session;
use trepan_link::wire::{TeacherRecord, TickRecord};

fn program(out: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_integrated"));
    command.args(["--headless", "--quality", "usual", "--frames-per-second", "0", "--out"]).arg(out).args(arguments);
    command.env("TREPAN_CACHE", Path::new(env!("CARGO_TARGET_TMPDIR")).join("cases"));
    command.stdout(Stdio::null()).stderr(Stdio::null());
    command
}

fn paused(tick: &TickRecord) -> bool {
    Buttons(tick.buttons).has(Buttons::PAUSE)
}

#[test]
fn a_teacher_pauses_a_session_and_the_pause_ends_without_records() {
    let folder = tempfile::tempdir().expect("a folder");
    let (live, again) = (folder.path().join("live"), folder.path().join("again"));
    let name = format!("lesson-{}", std::process::id());
    let mut trainee = program(&live, &["--duration", "12", "--share", &name]).spawn().expect("it starts");
    let session = Session::join(&name).expect("shared memory");
    let mut ticks = session.subscriber::<TickRecord>().expect("ticks");
    let mut teacher = session.publisher::<TeacherRecord>().expect("a teacher");
    let began = Instant::now();
    let pressing = |tick: TickRecord| tick.time_ms > 2500.0 && tick.wrench.force.length() > 0.1;
    while !ticks.newest().expect("ticks").is_some_and(pressing) {
        assert!(began.elapsed() < Duration::from_secs(60), "the session does not press on the bone");
        std::thread::sleep(Duration::from_millis(1));
    }
    // She requests the pause for a while, then sends nothing more.
    for seq in 1..=20 {
        teacher
            .send(&TeacherRecord { seq, flags: TeacherRecord::PAUSE, ..TeacherRecord::default() })
            .expect("she sends");
        std::thread::sleep(Duration::from_millis(20));
    }
    assert!(trainee.wait().expect("it ends").success());

    let recording = Recording::open(&live.join("session.mcap")).expect("a recording");
    let pause: Vec<_> = recording.ticks.iter().filter(|tick| paused(tick)).collect();
    let [first, last] = [pause.first(), pause.last()].map(|tick| tick.expect("a pause").time_ms);
    assert!((5900.0..7500.0).contains(&(last - first)), "her silence ends it after 6 s, not {}", last - first);
    assert_eq!(pause.len() as u64, pause.last().expect("a pause").tick - pause[0].tick + 1, "one pause");
    let quiet = |tick: &&&TickRecord| tick.time_ms > first + 50.0;
    assert!(pause.iter().filter(quiet).all(|tick| tick.wrench.force.length() == 0.0 && tick.removed_mm3 == 0.0));
    let events: Vec<_> = recording.events.iter().filter(|event| event.kind == "teacher").collect();
    assert!(
        events.len() == 2 && events[0].text.starts_with("begins") && events[1].text.starts_with("ends"),
        "{events:?}"
    );

    let file = format!("replay:{}", live.join("session.mcap").display());
    assert!(program(&again, &["--device", &file]).status().expect("it runs").success());
    let summary = std::fs::read_to_string(again.join("summary.json")).expect("a summary");
    let summary: serde_json::Value = serde_json::from_str(&summary).expect("it is JSON");
    assert_eq!(summary["replay"]["identical"], summary["replay"]["ticks"], "a replay needs no teacher");
}
