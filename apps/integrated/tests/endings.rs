//! Ends of a session: by a signal, killed, by itself. Replays of it are equal bit for bit.
#![expect(clippy::unwrap_used, reason = "a test may panic")]

use serde_json::Value;
use std::fs;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};
use trepan_link::Recording;

fn operation(out: &Path, seconds: &str, more: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_integrated"));
    command.args(["--headless", "--frames-per-second", "0", "--duration", seconds, "--out"]).arg(out);
    // A plan depends on the machine; a replay and a watcher use the models of its recording.
    let again = more.iter().any(|word| word.starts_with("replay:") || *word == "--watch");
    command.args(["--quality", "usual"].iter().filter(|_| !again)).args(more);
    command
        .env("TREPAN_CACHE", Path::new(env!("CARGO_TARGET_TMPDIR")).join("cases"))
        .stderr(Stdio::null())
        .stdout(Stdio::null());
    command
}

/// Waits until the recording has grown to some size, then sends a signal.
fn signalled(mut child: Child, recording: &Path, signal: &str) -> Option<i32> {
    let patience = Instant::now() + Duration::from_secs(120);
    while fs::metadata(recording).map_or(0, |m| m.len()) < 100_000 {
        assert!(Instant::now() < patience, "the operation did not begin to record");
        assert!(child.try_wait().unwrap().is_none(), "the operation ended before it recorded");
        std::thread::sleep(Duration::from_millis(20));
    }
    assert!(Command::new("kill").args([signal, &child.id().to_string()]).status().unwrap().success());
    child.wait().unwrap().code()
}

#[test]
fn a_signal_ends_with_no_force_and_a_whole_recording() {
    for (signal, code) in [("-INT", 130), ("-TERM", 143)] {
        let out = tempfile::tempdir().unwrap();
        let record = out.path().join("session.mcap");
        let child = operation(out.path(), "60", &[]).spawn().unwrap();
        assert_eq!(signalled(child, &record, signal), Some(code));
        let recording = Recording::open(&record).unwrap();
        assert!(recording.losses().is_none() && recording.ticks.len() > 100);
        assert_eq!(recording.ticks.last().unwrap().wrench.force.length(), 0.0, "the force did not end at zero");
        let summary: Value = serde_json::from_slice(&fs::read(out.path().join("summary.json")).unwrap()).unwrap();
        assert_eq!(summary["hand_force_n"]["end"], 0.0);
    }
}

#[test]
fn a_killed_session_is_readable_to_its_last_chunk() {
    let out = tempfile::tempdir().unwrap();
    let record = out.path().join("session.mcap");
    let child = operation(out.path(), "60", &[]).spawn().unwrap();
    assert_eq!(signalled(child, &record, "-KILL"), None);
    let recording = Recording::open(&record).unwrap();
    assert!(recording.damage.is_some() && recording.ticks.len() > 100, "{} ticks", recording.ticks.len());
    assert!(recording.ticks.windows(2).all(|pair| pair[1].tick == pair[0].tick + 1));
}

#[test]
fn a_replay_gives_the_same_forces_bit_for_bit() {
    let (live, again) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    assert!(operation(live.path(), "6", &[]).status().unwrap().success());
    let device = format!("replay:{}", live.path().join("session.mcap").display());
    assert!(operation(again.path(), "6", &["--device", &device]).status().unwrap().success());
    let summary: Value = serde_json::from_slice(&fs::read(again.path().join("summary.json")).unwrap()).unwrap();
    assert_eq!(summary["replay"]["ticks"], summary["replay"]["identical"]);
    let [was, is] = [&live, &again].map(|out| Recording::open(&out.path().join("session.mcap")).unwrap());
    assert!(was.ticks.len() > 1000 && was.ticks.len() == is.ticks.len());
    assert!(was.ticks.iter().any(|t| t.wrench.force.length() > 0.1), "nothing was felt");
    for (a, b) in was.ticks.iter().zip(&is.ticks) {
        assert_eq!(
            a.wrench.force.to_array().map(f32::to_bits),
            b.wrench.force.to_array().map(f32::to_bits),
            "tick {}",
            a.tick
        );
        assert_eq!(a.proxy.translation, b.proxy.translation, "tick {}", a.tick);
    }
}

#[test]
fn every_session_has_a_folder_of_its_own_and_an_older_one_is_replaced_only_when_asked() {
    let home = tempfile::tempdir().unwrap();
    let run = |more: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_integrated"));
        command.args(["--headless", "--frames-per-second", "0", "--duration", "1", "--quality", "usual"]).args(more);
        command.env("TREPAN_CACHE", Path::new(env!("CARGO_TARGET_TMPDIR")).join("cases"));
        command.current_dir(home.path()).output().unwrap()
    };
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    for n in 1..=2 {
        let done = run(&[]);
        assert!(done.status.success(), "{}", text(&done.stderr));
        let folders: Vec<_> = fs::read_dir(home.path().join("trepan-out/integrated")).unwrap().flatten().collect();
        assert_eq!(folders.len(), n);
        let last = text(&done.stdout).lines().last().unwrap().to_string();
        assert!(folders.iter().any(|f| last.contains(f.file_name().to_str().unwrap())), "{last}");
        assert!(folders.iter().all(|f| f.path().join("summary.json").exists()), "{last}");
    }
    assert!(run(&["--out", "out"]).status.success());
    let old = fs::read(home.path().join("out/session.mcap")).unwrap();
    let again = run(&["--out", "out"]);
    assert_eq!(again.status.code(), Some(2));
    assert!(text(&again.stderr).contains("--overwrite"), "{}", text(&again.stderr));
    assert_eq!(old, fs::read(home.path().join("out/session.mcap")).unwrap());
    fs::write(home.path().join("out/drilled.stl"), "old").unwrap();
    assert!(run(&["--out", "out", "--overwrite"]).status.success());
    assert!(!home.path().join("out/drilled.stl").exists(), "a file of the older session stayed");
    assert!(home.path().join("out/summary.json").exists());
    // A replay never overwrites its own recording.
    let onto = run(&["--device", "replay:out/session.mcap", "--out", "out", "--overwrite"]);
    assert_eq!(onto.status.code(), Some(2), "{}", text(&onto.stderr));
}

#[test]
fn a_built_case_runs_and_is_not_overwritten() {
    let home = tempfile::tempdir().unwrap();
    let case = home.path().join("head");
    let build = || {
        let mut command = Command::new(env!("CARGO_BIN_EXE_integrated"));
        command.args(["case", "build", "--out"]).arg(&case);
        command.env("TREPAN_CACHE", Path::new(env!("CARGO_TARGET_TMPDIR")).join("cases")).output().unwrap()
    };
    assert!(build().status.success());
    let again = build();
    assert_eq!(again.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&again.stderr).contains("exists already"));
    let out = home.path().join("out");
    assert!(operation(&out, "1", &["--case", case.to_str().unwrap()]).status().unwrap().success());
    let card: Value = serde_json::from_slice(&fs::read(case.join("case.json")).unwrap()).unwrap();
    assert_eq!(card["files"].as_object().unwrap().len(), 5);
}

#[test]
fn a_watcher_follows_and_killing_one_has_no_effect() {
    let name = format!("test-{}", std::process::id());
    let [trainee, watcher, dead] = [(); 3].map(|()| tempfile::tempdir().unwrap());
    let own = ["--share", &name, "--tets", "4000", "--flap", "25", "--set", "friction=0.2"];
    let mut session = operation(trainee.path(), "8", &own).spawn().unwrap();
    let mut killed = operation(dead.path(), "60", &["--watch", &name]).spawn().unwrap();
    let following = operation(watcher.path(), "60", &["--watch", &name]).spawn().unwrap();
    std::thread::sleep(Duration::from_secs(4));
    killed.kill().unwrap();
    killed.wait().unwrap();
    assert!(session.wait().unwrap().success());
    assert!(following.wait_with_output().unwrap().status.success());
    let [was, seen] = [&trainee, &watcher].map(|out| Recording::open(&out.path().join("session.mcap")).unwrap());
    let probing = |recording: &Recording| recording.ticks.iter().any(|tick| tick.phase == 1);
    assert!(probing(&was) && probing(&seen), "the watcher did not follow to the last phase");
    let summary: Value = serde_json::from_slice(&fs::read(watcher.path().join("summary.json")).unwrap()).unwrap();
    assert!(summary["remarks"].to_string().contains(&format!("session {name} has ended")), "{}", summary["remarks"]);
    let [was, seen] = [was, seen].map(|recording| recording.header);
    assert_eq!(was.hashes, seen.hashes, "the watcher runs the trainee's case");
    let sizes = ["sizes.tets", "sizes.spacing_mm", "operation.flap_mm"];
    for key in sizes.into_iter().chain(["ingredients.friction", "ingredients.rigid", "solver_run"]) {
        assert_eq!(was.config[key], seen.config[key], "{key} is the trainee's");
    }
}

#[test]
fn a_watcher_without_a_session_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let mut command = operation(&out, "60", &["--watch", "nobody-shares-this"]);
    let output = command.stderr(Stdio::piped()).output().unwrap();
    let log = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.code() == Some(2) && !out.exists(), "{log}");
    for word in ["waiting for the session nobody-shares-this", "no session of this name", "--share"] {
        assert!(log.contains(word), "{word}: {log}");
    }
}

#[test]
fn a_session_that_was_interrupted_in_contact_replays_to_its_faded_end() {
    let [live, again] = [(); 2].map(|()| tempfile::tempdir().unwrap());
    let record = live.path().join("session.mcap");
    let pressing = |t: &trepan_link::wire::TickRecord| t.wrench.force.length() > 0.1;
    // The script rests on the bone for half of the time, so that a file that lags behind the
    // session shows contact too.
    let mut child = operation(live.path(), "40", &["--device", "script:aspirate"]).spawn().unwrap();
    let long = |r: &Recording| r.ticks.iter().filter(|t| pressing(t)).count() > 4000;
    while !Recording::open(&record).is_ok_and(|r| r.ticks.last().is_some_and(pressing) && long(&r)) {
        assert!(child.try_wait().unwrap().is_none(), "the operation ended before it touched bone");
        std::thread::sleep(Duration::from_millis(50));
    }
    assert_eq!(signalled(child, &record, "-INT"), Some(130));
    let was = Recording::open(&record).unwrap();
    let fading = was.ticks.iter().filter(|t| t.has(trepan_link::wire::TickRecord::RELEASED));
    assert!(fading.clone().any(pressing), "nothing was let go");
    assert_eq!(was.ticks.last().unwrap().wrench.force.length(), 0.0);
    let device = format!("replay:{}", record.display());
    assert!(operation(again.path(), "40", &["--device", &device]).status().unwrap().success());
    let summary: Value = serde_json::from_slice(&fs::read(again.path().join("summary.json")).unwrap()).unwrap();
    assert_eq!(summary["replay"]["ticks"], summary["replay"]["identical"]);
}

/// Runs the operation with its output on a small separate disk. Returns exit code, log and
/// recording; `None` where mounting is not allowed.
fn on_disk(options: &str, seconds: &str) -> Option<(Option<i32>, String, Option<Recording>)> {
    let kept = tempfile::tempdir().unwrap();
    let disk = kept.path().join("disk");
    fs::create_dir(&disk).unwrap();
    let script = format!(
        "mount -t tmpfs -o {options} none {0} || exit 99; \"$@\" --out {0}/out; code=$?; cp {0}/out/session.mcap {1}/ 2>/dev/null; ls -AR {0}/out >&2; exit $code",
        disk.display(),
        kept.path().display()
    );
    let mut command = Command::new("unshare");
    command.args(["-rm", "sh", "-c", &script, "sh", env!("CARGO_BIN_EXE_integrated")]);
    command.args(["--headless", "--quality", "usual", "--frames-per-second", "0", "--duration", seconds]);
    command.env("TREPAN_CACHE", Path::new(env!("CARGO_TARGET_TMPDIR")).join("cases"));
    let done = command.output().ok().filter(|done| !matches!(done.status.code(), Some(1 | 99)))?;
    let log = String::from_utf8_lossy(&done.stderr).into_owned();
    Some((done.status.code(), log, Recording::open(&kept.path().join("session.mcap")).ok()))
}

#[test]
fn a_full_disk_ends_the_recording_with_an_error_and_not_the_session() {
    let Some((code, log, recording)) = on_disk("size=900k", "8") else {
        eprintln!("this system lets no test mount a disk: not tried");
        return;
    };
    assert_eq!(code, Some(2), "{log}");
    assert!(log.contains("No space left") && log.contains("recording ended early") && log.contains("--out"), "{log}");
    // The session went on to its end; the recording before the fault is intact.
    assert!(log.contains("brain begins"), "{log}");
    let left = log.rsplit_once("/out:\n").unwrap().1;
    assert_eq!(left.trim(), "session.mcap", "{log}");
    let recording = recording.unwrap();
    assert!(recording.damage.is_some() && recording.ticks.len() > 1000, "{} ticks", recording.ticks.len());
    assert!(recording.ticks.windows(2).all(|pair| pair[1].tick == pair[0].tick + 1));
}

#[test]
fn a_read_only_folder_is_named_before_the_session_begins() {
    let Some((code, log, recording)) = on_disk("size=1500k,ro", "8") else {
        eprintln!("this system lets no test mount a disk: not tried");
        return;
    };
    assert_eq!((code, recording.is_none()), (Some(2), true), "{log}");
    assert!(log.contains("Read-only file system") && log.contains("--out") && !log.contains("begins"), "{log}");
}

#[test]
fn a_folder_of_recordings_is_replayed_in_shards() {
    let folder = tempfile::tempdir().unwrap();
    let runs = folder.path().join("runs");
    fs::create_dir(&runs).unwrap();
    for name in ["a", "b", "c"] {
        let record = runs.join(format!("{name}.mcap"));
        let mut command = operation(&folder.path().join(format!("first-{name}")), "1", &["--record"]);
        assert!(command.arg(&record).status().unwrap().success());
    }
    let device = format!("replay:{}", runs.display());
    let out = folder.path().join("again");
    for shard in ["1/2", "2/2"] {
        assert!(operation(&out, "1", &["--device", &device, "--shard", shard]).status().unwrap().success());
    }
    for name in ["a", "b", "c"] {
        let summary: Value = serde_json::from_slice(&fs::read(out.join(name).join("summary.json")).unwrap()).unwrap();
        assert_eq!(summary["replay"]["ticks"], summary["replay"]["identical"], "{name}");
    }
    assert_eq!(operation(&out, "1", &["--shard", "1/2"]).status().unwrap().code(), Some(2));
}
