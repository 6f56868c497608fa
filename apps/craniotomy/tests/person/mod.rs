//! A scripted person with a mouse in front of a real window. Needs Xvfb and xdotool.

use std::fs;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};
use trepan_link::Recording;
use trepan_link::wire::TickRecord;

/// Pixels in a row of the display, and the colour of the main button.
const WIDTH: usize = 1280;
const SKY: [u8; 3] = [86, 180, 233];
/// "End the operation" at 1280 by 800.
const END: [u32; 2] = [1140, 775];

/// A display of 1280 by 800 pixels with the program on it.
pub struct Person {
    screen: Child,
    program: Child,
    display: String,
    home: PathBuf,
}

impl Person {
    /// Sits down in front of the program; `None` where the tools are missing.
    pub fn sits_down(home: &Path, settings: &str) -> Option<Self> {
        Command::new("xdotool").arg("version").output().ok()?;
        Command::new("import").arg("-version").output().ok()?;
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
        let file = std::env::var_os("TREPAN_PERSON_PROGRAM").unwrap_or(env!("CARGO_BIN_EXE_craniotomy").into());
        let log = fs::File::create(home.join("said")).unwrap();
        let program = Command::new(file)
            .env("DISPLAY", &display)
            .env("TREPAN_CONFIG", home.join("config"))
            .env("TREPAN_SESSIONS", home.join("sessions"))
            .env("TREPAN_CACHE", Path::new(env!("CARGO_TARGET_TMPDIR")).join("cases"))
            .stdout(Stdio::null())
            .stderr(log)
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
    pub fn does(&self, what: &str) -> Vec<u8> {
        Command::new("xdotool").args(what.split(' ')).env("DISPLAY", &self.display).output().unwrap().stdout
    }

    pub fn clicks(&self, [x, y]: [u32; 2]) {
        self.does(&format!("mousemove {x} {y}"));
        std::thread::sleep(Duration::from_millis(300));
        self.does("click 1");
        std::thread::sleep(Duration::from_millis(700));
    }

    /// Middle of the button of the usual next step: the first large patch in its colour, sky blue.
    pub fn main_button(&self) -> Option<[u32; 2]> {
        let args = ["-window", "root", "-depth", "8", "rgb:-"];
        let pixels = Command::new("import").args(args).env("DISPLAY", &self.display).output().ok()?.stdout;
        let is_sky = |x: usize, y: usize| pixels.get(3 * (y * WIDTH + x)..).is_some_and(|rgb| rgb.starts_with(&SKY));
        let is_patch = |x: usize, y: usize| (0..6).all(|n| is_sky(x + 6 * n, y) && is_sky(x, y + n));
        let places = (0..pixels.len() / 3).map(|at| (at % WIDTH, at / WIDTH));
        let (x, y) = places.filter(|(x, _)| x + 40 < WIDTH).find(|(x, y)| is_patch(*x, *y))?;
        Some([x as u32 + 20, y as u32 + 12])
    }

    /// Presses the button of the usual next step once it is there.
    pub fn goes_on(&self) {
        self.waits_for("the next step", || self.main_button().is_some());
        self.clicks(self.main_button().unwrap());
    }

    pub fn waits_for(&self, what: &str, done: impl Fn() -> bool) {
        let patience = Instant::now() + Duration::from_secs(240);
        while !done() {
            assert!(Instant::now() < patience, "{what} did not come");
            std::thread::sleep(Duration::from_millis(100));
        }
    }

    /// Folders of the sessions that hold a file.
    fn sessions(&self, with: &str) -> Vec<PathBuf> {
        let programs = fs::read_dir(self.home.join("sessions")).into_iter().flatten().flatten();
        let entries = programs.flat_map(|program| fs::read_dir(program.path()).into_iter().flatten().flatten());
        entries.map(|entry| entry.path()).filter(|path| path.join(with).is_file()).collect()
    }

    /// Number of folders of sessions.
    pub fn number_of_sessions(&self) -> usize {
        self.sessions("session.mcap").len()
    }

    /// Number of cases that the start page remembers.
    fn recent_cases(&self) -> usize {
        let kept = fs::read(self.home.join("config/settings.json")).unwrap_or_default();
        let kept: serde_json::Value = serde_json::from_slice(&kept).unwrap_or_default();
        kept["recent"].as_array().map_or(0, Vec::len)
    }

    /// Waits until the nth session runs.
    pub fn waits_for_session(&self, nth: usize) {
        let recorded = |path: &PathBuf| path.join("session.mcap").metadata().is_ok_and(|file| file.len() > 100_000);
        self.waits_for("a running session", || {
            self.sessions("session.mcap").iter().filter(|p| recorded(p)).count() == nth
        });
        std::thread::sleep(Duration::from_secs(2));
    }

    /// Ends the nth session, says yes to the question, and waits for its summary and result page.
    pub fn ends(&self, nth: usize) -> serde_json::Value {
        // A slow picture may miss a click.
        self.waits_for("the summary", || {
            if self.sessions("summary.json").len() < nth {
                self.clicks(END);
                self.does("key Return");
                std::thread::sleep(Duration::from_millis(700));
            }
            self.sessions("summary.json").len() == nth
        });
        // The case is remembered, and its result shown, once everything is written.
        self.waits_for("the case among the recent ones", || self.recent_cases() == nth);
        let mut all = self.sessions("summary.json");
        all.sort();
        serde_json::from_slice(&fs::read(all[nth - 1].join("summary.json")).unwrap()).unwrap()
    }
}

impl Person {
    /// The recording of the newest session, as far as it is written.
    pub fn recording(&self) -> Recording {
        let mut all = self.sessions("session.mcap");
        all.sort();
        Recording::open(&all.last().unwrap().join("session.mcap")).unwrap_or_default()
    }

    /// All recordings, oldest first, and whether their session has its summary.
    pub fn recordings(&self) -> Vec<(Recording, bool)> {
        let mut all = self.sessions("session.mcap");
        all.sort();
        let open = |path: &PathBuf| Recording::open(&path.join("session.mcap")).unwrap_or_default();
        all.iter().map(|path| (open(path), path.join("summary.json").is_file())).collect()
    }

    /// Its newest tick.
    pub fn tick(&self) -> TickRecord {
        self.recording().ticks.last().copied().unwrap_or_default()
    }

    /// Number of its events whose text contains some words.
    pub fn count_in_log(&self, words: &str) -> usize {
        self.recording().events.iter().filter(|event| event.text.contains(words)).count()
    }

    /// Whether the program still runs.
    pub fn is_there(&self) -> bool {
        Path::new(&format!("/proc/{}/exe", self.program.id())).exists()
    }

    /// Exit code of the program, -1 after a signal; `None` while it runs.
    pub fn code(&mut self) -> Option<i32> {
        self.program.try_wait().unwrap().map(|status| status.code().unwrap_or(-1))
    }

    /// What the program wrote on its console.
    pub fn log(&self) -> String {
        fs::read_to_string(self.home.join("said")).unwrap_or_default()
    }

    /// Does nothing for some seconds.
    pub fn rests(&self, seconds: f32) {
        std::thread::sleep(Duration::from_secs_f32(seconds));
    }

    /// Moves the pointer.
    pub fn points(&self, [x, y]: [f32; 2]) {
        self.does(&format!("mousemove {x:.0} {y:.0}"));
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
