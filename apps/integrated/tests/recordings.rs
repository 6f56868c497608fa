//! Recordings that are damaged, cut or of another case: a replay reports it, and a repair keeps the
//! readable part.
#![expect(clippy::unwrap_used, reason = "a test may panic")]

use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use trepan_link::Recording;

fn integrated(arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_integrated"));
    command.env("TREPAN_CACHE", Path::new(env!("CARGO_TARGET_TMPDIR")).join("cases"));
    command.args(arguments).output().unwrap()
}

fn log_of(output: &Output) -> String {
    [&output.stdout, &output.stderr].map(|bytes| String::from_utf8_lossy(bytes)).concat()
}

/// A temporary folder and the bytes of a recorded session of three seconds.
struct Bench {
    folder: tempfile::TempDir,
    whole: Vec<u8>,
}

impl Bench {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let bench = Self { folder, whole: Vec::new() };
        let live = bench.path("live");
        let run = bench.session(&live, &["--quality", "usual", "--duration", "3"]);
        assert!(run.status.success(), "{}", log_of(&run));
        Self { whole: fs::read(live.join("session.mcap")).unwrap(), ..bench }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn file(&self, name: &str, bytes: &[u8]) -> PathBuf {
        fs::write(self.path(name), bytes).unwrap();
        self.path(name)
    }

    fn session(&self, out: &Path, more: &[&str]) -> Output {
        let out = out.to_str().unwrap();
        integrated(&[&["--headless", "--frames-per-second", "0", "--out", out], more].concat())
    }

    fn again(&self, file: &Path, more: &[&str]) -> (Output, Value) {
        let out = self.path("again");
        let device = format!("replay:{}", file.display());
        let output = self.session(&out, &[&["--device", &device, "--overwrite"], more].concat());
        let summary = fs::read(out.join("summary.json")).map_or(Value::Null, |b| serde_json::from_slice(&b).unwrap());
        (output, summary)
    }
}

/// Returns the middle of the chunk in which the second half of an MCAP file begins, or of the next.
fn middle_of_a_chunk(file: &[u8]) -> usize {
    const CHUNK: u8 = 6;
    let mut at = 8;
    loop {
        let length = u64::from_le_bytes(file[at + 1..at + 9].try_into().unwrap()) as usize;
        let end = at + 9 + length;
        if file[at] == CHUNK && end > file.len() / 2 {
            return at + 9 + length / 2;
        }
        at = end;
    }
}

#[test]
fn a_replay_of_a_damaged_recording_reports_it_and_a_repair_keeps_the_rest() {
    let bench = Bench::new();
    let all = Recording::of_bytes(&bench.whole, Path::new("whole")).unwrap().ticks.len();
    let mut bytes = bench.whole.clone();
    let at = middle_of_a_chunk(&bytes);
    bytes[at..at + 16].fill(0x5a);
    let damaged = bench.file("damaged.mcap", &bytes);

    let (output, summary) = bench.again(&damaged, &[]);
    let text = log_of(&output);
    assert_eq!(output.status.code(), Some(1), "{text}");
    let ran = summary["replay"]["ticks"].as_u64().unwrap() as usize;
    assert!(ran > 100 && ran < all && summary["replay"]["recorded"] == all, "{}", summary["replay"]);
    assert!(summary["replay"]["identical"] == ran, "what came before the damage is as recorded");
    for word in [&format!("replay: a part only, {ran} of at least {all} ticks"), "at byte", "recording repair"] {
        assert!(text.contains(word), "{word:?} is missing: {text}");
    }
    assert!(summary["remarks"].to_string().contains("is not whole"), "{}", summary["remarks"]);

    let repaired = bench.path("repaired.mcap");
    let [from, to] = [&damaged, &repaired].map(|path| path.to_str().unwrap());
    let check = |file| integrated(&["recording", "check", file]);
    assert!(
        check(from).status.code() == Some(1) && log_of(&check(from)).contains(&format!("of {all} ticks can be read"))
    );
    let mend = integrated(&["recording", "repair", from, to]);
    assert!(mend.status.success() && log_of(&mend).contains("are missing"), "{}", log_of(&mend));
    let kept = Recording::open(&repaired).unwrap();
    assert!(kept.indexed && kept.damage.is_none() && kept.ticks.len() > all - 250, "{}", kept.ticks.len());
    let again = integrated(&["recording", "repair", from, to]);
    assert!(again.status.code() == Some(2) && log_of(&again).contains("exists already"));
    let (output, _) = bench.again(&repaired, &[]);
    assert_eq!(output.status.code(), Some(1), "ticks are missing: {}", log_of(&output));
}

#[test]
fn a_truncated_recording_is_replayed_as_far_as_it_goes_or_refused() {
    let bench = Bench::new();
    let killed = bench.file("killed.mcap", &bench.whole[..bench.whole.len() * 2 / 3]);
    let (output, summary) = bench.again(&killed, &[]);
    assert!(output.status.code() == Some(1) && log_of(&output).contains("a part only"), "{}", log_of(&output));
    assert!(summary["replay"]["losses"].as_str().unwrap().contains("cut or damaged"));

    fs::remove_dir_all(bench.path("again")).unwrap();
    let stump = bench.file("stump.mcap", &bench.whole[..3000]);
    let (output, _) = bench.again(&stump, &[]);
    let text = log_of(&output);
    assert!(output.status.code() == Some(2) && !bench.path("again").exists(), "{text}");
    assert!(text.contains("nothing to run again") && text.contains("recording repair"), "{text}");

    let folder = bench.path("runs");
    fs::create_dir(&folder).unwrap();
    fs::copy(&killed, folder.join("a.mcap")).unwrap();
    fs::write(folder.join("b.mcap"), &bench.whole).unwrap();
    let (output, _) = bench.again(&folder, &[]);
    assert!(output.status.code() == Some(1) && log_of(&output).contains("1 of 2 recordings"), "{}", log_of(&output));
    assert!(integrated(&["recording", "check", folder.join("b.mcap").to_str().unwrap()]).status.success());
}

#[test]
fn a_replay_lasts_no_longer_than_its_duration_flag() {
    let bench = Bench::new();
    let file = bench.file("whole.mcap", &bench.whole);
    let (output, summary) = bench.again(&file, &["--duration", "1"]);
    assert!(output.status.success(), "{}", log_of(&output));
    let replay = &summary["replay"];
    let ticks = replay["ticks"].as_u64().unwrap();
    assert!((800..1010).contains(&ticks) && replay["identical"] == ticks, "{replay}");
    assert!(replay["recorded"].as_u64().unwrap() > 2000 && log_of(&output).contains("a part only"), "{replay}");
    let (output, summary) = bench.again(&file, &["--duration", "3"]);
    assert!(output.status.success() && summary["replay"]["ticks"] == summary["replay"]["recorded"]);
}

#[test]
fn a_recording_of_another_patient_is_refused() {
    let bench = Bench::new();
    let file = bench.file("whole.mcap", &bench.whole);
    let head = trepan_fixtures::case_head();
    // An additional byte after the voxels changes the hash, as another patient would.
    let mut bytes = fs::read(&head.ct).unwrap();
    bytes.push(0);
    let ending: String = head.ct.file_name().unwrap().to_string_lossy().into();
    let other = bench.file(&format!("other-{ending}"), &bytes);
    let mri = head.mri.to_str().unwrap();
    let (output, _) = bench.again(&file, &["--ct", other.to_str().unwrap(), "--mri", mri]);
    let text = log_of(&output);
    assert!(output.status.code() == Some(2) && text.contains("another case") && text.contains("--ct"), "{text}");
    assert!(!bench.path("again").exists());
    // The same images given as files and with other voxels: the same patient.
    let own = ["--ct", head.ct.to_str().unwrap(), "--mri", mri, "--spacing-mm", "2", "--duration", "0.5"];
    let (output, summary) = bench.again(&file, &own);
    assert!(output.status.success(), "{}", log_of(&output));
    assert!(summary["remarks"].to_string().contains("made otherwise"), "{}", summary["remarks"]);
    let out = bench.path("compare");
    let coarse = bench.path("again").join("session.mcap");
    let compared =
        integrated(&["compare", file.to_str().unwrap(), coarse.to_str().unwrap(), "--out", out.to_str().unwrap()]);
    let page = fs::read_to_string(out.join("compare.html")).unwrap();
    assert!(compared.status.success() && page.contains("One patient") && !page.contains("different anatomies"));
}

#[test]
fn a_session_is_listed_and_exported_with_its_scores_and_markups() {
    let bench = Bench::new();
    let live = bench.path("live");
    let [ticks, class, killed] = ["ticks.csv", "class.csv", "killed.csv"].map(|name| bench.path(name));
    let text = |path: &Path| path.to_str().unwrap().to_string();
    let run = |line: &[&str]| integrated(line);
    let recording = text(&live.join("session.mcap"));
    let exported = run(&["recording", "export", &recording, "--csv", &text(&ticks)]);
    assert!(exported.status.success(), "{}", log_of(&exported));
    let all = Recording::open(&live.join("session.mcap")).unwrap();
    assert_eq!(fs::read_to_string(&ticks).unwrap().lines().count(), all.ticks.len() + 1);
    assert!(all.events.iter().all(|event| event.kind != "score"), "scores are numbers, not events");
    let cut = bench.file("killed.mcap", &bench.whole[..bench.whole.len() * 2 / 3]);
    let exported = run(&["recording", "export", &text(&cut), "--csv", &text(&killed)]);
    assert!(exported.status.code() == Some(1) && log_of(&exported).contains("is not whole"), "{}", log_of(&exported));
    let listed = log_of(&run(&["sessions", "list", &text(&live)]));
    assert!(listed.contains("integrated") && listed.contains("1 session in"), "{listed}");
    assert!(run(&["sessions", "export", &text(&live), "--csv", &text(&class)]).status.success());
    assert_eq!(fs::read_to_string(&class).unwrap().lines().count(), 2);
    let none = run(&["sessions", "list", &text(&live), "--person", "nobody"]);
    assert!(none.status.success() && log_of(&none).contains("0 sessions"));
    for name in ["opening.mrk.json", "plan.mrk.json", "flap-line.mrk.json", "tool-path.mrk.json"] {
        let markup: Value = serde_json::from_slice(&fs::read(live.join(name)).unwrap()).unwrap();
        assert!(!markup["markups"][0]["controlPoints"].as_array().unwrap().is_empty(), "{name}");
    }
    assert!(live.join("removed-label.nii.gz").is_file());
}
