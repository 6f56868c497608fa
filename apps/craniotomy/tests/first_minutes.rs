//! A scripted person with a mouse in a real window: the built-in case, then a DICOM folder by the
//! dialogue. Needs Xvfb and xdotool; without them it says so and ends.
#![cfg(target_os = "linux")]
#![expect(clippy::unwrap_used, reason = "a test may panic")]

#[path = "../../integrated/tests/dicom/mod.rs"]
mod dicom;

use std::fs;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

/// A display of 1280 by 800 pixels with the program on it.
struct Person {
    screen: Child,
    program: Child,
    display: String,
    home: PathBuf,
}

impl Person {
    /// Sits down in front of the program; `None` where the tools are missing.
    fn sits_down(home: &Path, settings: &str) -> Option<Self> {
        Command::new("xdotool").arg("version").output().ok()?;
        let mut screen = Command::new("Xvfb")
            .args(["-displayfd", "1", "-screen", "0", "1280x800x24"])
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .ok()?;
        let mut number = String::new();
        BufReader::new(screen.stdout.take().unwrap()).read_line(&mut number).unwrap();
        let display = format!(":{}", number.trim());
        fs::create_dir_all(home.join("config")).unwrap();
        fs::write(home.join("config/settings.json"), settings).unwrap();
        let program = Command::new(env!("CARGO_BIN_EXE_craniotomy"))
            .env("DISPLAY", &display)
            .env("TREPAN_CONFIG", home.join("config"))
            .env("TREPAN_SESSIONS", home.join("sessions"))
            .env("TREPAN_CACHE", Path::new(env!("CARGO_TARGET_TMPDIR")).join("cases"))
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        let person = Self { screen, program, display, home: home.into() };
        person.waits_for("the window", || !person.does("search --name Trepan").is_empty());
        std::thread::sleep(Duration::from_secs(2));
        // Without a window manager nobody else gives the window the keys.
        person.does("search --name Trepan windowfocus");
        Some(person)
    }

    /// Lets xdotool do something; returns what it printed.
    fn does(&self, what: &str) -> Vec<u8> {
        Command::new("xdotool").args(what.split(' ')).env("DISPLAY", &self.display).output().unwrap().stdout
    }

    fn clicks(&self, [x, y]: [u32; 2]) {
        self.does(&format!("mousemove {x} {y}"));
        std::thread::sleep(Duration::from_millis(300));
        self.does("click 1");
        std::thread::sleep(Duration::from_millis(700));
    }

    fn waits_for(&self, what: &str, done: impl Fn() -> bool) {
        let patience = Instant::now() + Duration::from_secs(240);
        while !done() {
            assert!(Instant::now() < patience, "{what} did not come");
            std::thread::sleep(Duration::from_millis(100));
        }
    }

    /// Folders of the sessions that hold a file.
    fn sessions(&self, with: &str) -> Vec<PathBuf> {
        let entries = fs::read_dir(self.home.join("sessions/craniotomy")).into_iter().flatten().flatten();
        entries.map(|entry| entry.path()).filter(|path| path.join(with).is_file()).collect()
    }

    /// Number of cases that the start page remembers.
    fn recent_cases(&self) -> usize {
        let kept = fs::read(self.home.join("config/settings.json")).unwrap_or_default();
        let kept: serde_json::Value = serde_json::from_slice(&kept).unwrap_or_default();
        kept["recent"].as_array().map_or(0, Vec::len)
    }

    /// Waits until the session runs, ends it, and waits for its summary and its result page.
    fn operates(&self, nth: usize) -> serde_json::Value {
        let recorded = |path: &PathBuf| path.join("session.mcap").metadata().is_ok_and(|file| file.len() > 100_000);
        self.waits_for("a running session", || {
            self.sessions("session.mcap").iter().filter(|p| recorded(p)).count() == nth
        });
        std::thread::sleep(Duration::from_secs(2));
        self.does("mousemove 400 400");
        // A slow picture may miss a key.
        self.waits_for("the summary", || {
            self.does("key q");
            self.sessions("summary.json").len() == nth
        });
        // The case is remembered, and its result shown, once everything is written.
        self.waits_for("the case among the recent ones", || self.recent_cases() == nth);
        let mut all = self.sessions("summary.json");
        all.sort();
        serde_json::from_slice(&fs::read(all[nth - 1].join("summary.json")).unwrap()).unwrap()
    }
}

impl Drop for Person {
    fn drop(&mut self) {
        for child in [&mut self.program, &mut self.screen] {
            _ = child.kill();
            _ = child.wait();
        }
    }
}

/// Controls at 1280 by 800: "Start the operation", "Back to the start page", "Open CT...", the
/// first folder of the dialogue and "Use this folder".
const START: [u32; 2] = [95, 755];
const BACK: [u32; 2] = [110, 755];
const OPEN_CT: [u32; 2] = [160, 135];
const FIRST_FOLDER: [u32; 2] = [200, 186];
const USE: [u32; 2] = [85, 755];

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
    person.clicks(START);
    let first = person.operates(1);
    assert_eq!((first["case"].as_str(), first["person"].as_str()), (Some("case-head"), Some("Ada")));
    for place in [BACK, OPEN_CT, FIRST_FOLDER, USE, START] {
        person.clicks(place);
    }
    let second = person.operates(2);
    let case = second["case"].as_str().unwrap();
    assert!(case.starts_with("case-") && case != "case-head" && !case.contains("MUSTERMANN"), "{case}");
}
