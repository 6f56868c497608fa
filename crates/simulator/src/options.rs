//! The command line that the three programs share.

use crate::error::SessionError;
use crate::setting_paths;
use clap::error::ErrorKind;
use clap::{Args, CommandFactory, FromArgMatches, Parser, Subcommand};
use std::convert::Infallible;
use std::ffi::OsString;
use std::path::PathBuf;
use trepan_budget::Quality;
use trepan_models::ingredients::{KeyValue, setting};
use trepan_patient::{MadeTumour, TissueClass, TissueSource};
use trepan_report::constants;
use trepan_stages::force_scale::ForceScale;
use trepan_stages::program::Program;

/// Numerical range of `--young-modulus-kpa`.
pub(crate) const MODULI_KPA: [f64; 2] = [0.05, 1000.0];
/// Numerical range of `--aspiration`, mm/s.
pub(crate) const ASPIRATIONS_MM_S: [f64; 2] = [0.0, 50.0];
/// Numerical range of `--bleeding`.
pub(crate) const BLEEDINGS: [f64; 2] = [0.0, 20.0];
/// Numerical range of `--csf-speed-up`.
pub(crate) const CSF_SPEED_UPS: [f64; 2] = [1.0, 1000.0];
/// Numerical range of `--rate-hz`.
pub(crate) const RATES_HZ: [f64; 2] = [100.0, 10_000.0];

/// Flags of every program; names contain the unit.
#[derive(Clone, Debug, Parser)]
#[command(max_term_width = 120, version, args_conflicts_with_subcommands = true, after_help = constants::help())]
pub struct Options {
    /// Task instead of a session
    #[command(subcommand)]
    pub task: Option<Task>,
    /// A folder that `case build` made
    #[arg(help_heading = "Patient", long, value_name = "CASE", conflicts_with_all = ["ct", "mri", "labels", "tissues", "spacing_mm", "tets", "opening_refinement", "isovalue_hu", "register", "opening", "tumour"])]
    pub case: Option<PathBuf>,
    /// Images and how they are imported
    #[command(flatten)]
    pub patient: Patient,
    /// Haptic device, by name
    #[arg(help_heading = "Haptic devices", long, value_name = "DEVICE", value_parser = device, help = format!("Haptic device: {} [default: mouse with a window, else a script]", trepan_haptics::usage()))]
    pub device: Option<String>,
    /// Device of the second hand, which holds an aspirator: script:aspirate, script:suck,
    /// simulated:NAME, or a device that --list-devices shows
    #[arg(help_heading = "Haptic devices", long, value_name = "DEVICE", value_parser = device, conflicts_with = "watch")]
    pub second_device: Option<String>,
    /// Motion of the tool per motion of the hand, for devices with their own workspace; over 1,
    /// walls are softened by the same factor
    #[arg(
        help_heading = "Haptic devices",
        long,
        value_name = "SCALE",
        default_value_t = 1.0,
        allow_negative_numbers = true
    )]
    pub device_scale: f32,
    /// Newtons at the hand per newton of the task, on bone. People press a drill with up to 24 N
    /// [default: the device's greatest force over that, at most 1; a replay's as recorded]
    #[arg(help_heading = "Haptic devices", long, value_name = "SCALE", allow_negative_numbers = true)]
    pub force_scale: Option<f32>,
    /// Let other processes on this machine watch this session under this name
    #[arg(help_heading = "Session", long, value_name = "NAME")]
    pub share: Option<String>,
    /// Watch the session that runs with --share NAME, with the same case
    #[arg(help_heading = "Session", long, value_name = "NAME", conflicts_with_all = ["device", "share"])]
    pub watch: Option<String>,
    /// Language of the window: en, de, or a file in the folder `languages` beside the settings
    #[arg(help_heading = "Session", long, value_name = "LANGUAGE")]
    pub language: Option<String>,
    /// Run without a window
    #[arg(help_heading = "Session", long)]
    pub headless: bool,
    /// Duration of a scripted operation, and the longest of any other, seconds [default: 20 for a
    /// script, 75 for script:flap]
    #[arg(help_heading = "Session", long, value_name = "S", allow_negative_numbers = true)]
    pub duration: Option<f64>,
    /// File that records the session [default: session.mcap in the output folder]
    #[arg(help_heading = "Files", long, value_name = "FILE.mcap")]
    pub record: Option<PathBuf>,
    /// Folder for summary, report, recording, pictures [default: trepan-out/PROGRAM/DATE-AND-TIME]
    #[arg(help_heading = "Files", long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Name of the session; ends the name of its folder
    #[arg(help_heading = "Session", long, value_name = "NAME", conflicts_with = "out")]
    pub name: Option<String>,
    /// Who operates; the report compares with earlier sessions of the same person
    #[arg(help_heading = "Session", long, value_name = "NAME")]
    pub person: Option<String>,
    /// Lesson with steps and pass marks: first-operation, through or flap, or the name in a file of
    /// the user's own
    #[arg(help_heading = "Session", long, value_name = "NAME", conflicts_with = "watch")]
    pub lesson: Option<String>,
    /// Folder of the sessions that the start page begins
    #[arg(skip)]
    pub sessions: Option<PathBuf>,
    /// Place in the tray of the tool that a session with the mouse begins with
    #[arg(skip)]
    pub first_slot: usize,
    /// Replace the session that --out holds, or the file that --record names
    #[arg(help_heading = "Files", long)]
    pub overwrite: bool,
    /// Also write the drilled skull's surface as drilled.stl, some hundred MB
    #[arg(help_heading = "Files", long)]
    pub stl: bool,
    /// Also write drilled-fine.nii.gz: the skull around the removed bone, in voxels of 0.5 mm
    #[arg(help_heading = "Files", long)]
    pub drilled_fine: bool,
    /// Accuracy of bone, brain and picture [default: auto; a replay's as recorded]. Auto measures
    /// this machine and takes the cheapest models that keep the tolerances below; draft, usual and
    /// fine are the same on every machine
    #[arg(help_heading = "Models and accuracy", long, value_name = "auto|draft|usual|fine", value_parser = quality)]
    pub quality: Option<Quality>,
    /// Tolerances of --quality auto
    #[command(flatten)]
    pub tolerances: Tolerances,
    /// Ingredient of the models by hand, as in element=locking-free,threads=2; the last one of a
    /// key counts. Also any setting by its path in a recording, as in operation.flap_mm=30, and
    /// @FILE of such lines. `--set list` prints keys and paths [default: by --quality; a replay's
    /// as recorded]
    #[arg(help_heading = "Models and accuracy", long = "set", value_name = "KEY=VALUE|@FILE", value_delimiter = ',', value_parser = setting)]
    pub settings: Vec<Option<KeyValue>>,
    /// Solver of the brain's tissue, as --set solver=NAME
    #[arg(help_heading = "Models and accuracy", long, value_name = "NAME")]
    pub solver: Option<String>,
    /// Haptic method on bone, as --set rigid=NAME
    #[arg(help_heading = "Models and accuracy", long, value_name = "NAME")]
    pub rigid: Option<String>,
    /// Random seed
    #[arg(help_heading = "Session", long, value_name = "N", default_value_t = 1)]
    pub seed: u64,
    /// List the haptic devices and what each needs, then exit
    #[arg(help_heading = "Haptic devices", long)]
    pub list_devices: bool,
    /// List the physical constants, what each was calibrated to, and which are uncalibrated, then
    /// exit
    #[arg(help_heading = "Models and accuracy", long)]
    pub list_constants: bool,
    /// Young's modulus of the brain in a slow test, kPa; with relaxation solid-and-fluid it is
    /// stiffer at hand speed [default: 3; a replay's as recorded]
    #[arg(help_heading = "Models and accuracy", long, value_name = "KPA", allow_negative_numbers = true)]
    pub young_modulus_kpa: Option<f32>,
    /// Diameter of the planned bone flap around the opening, mm; 0 for a burr hole alone [default:
    /// 0; 24 with script:flap; a replay's as recorded]
    #[arg(help_heading = "Session", long, value_name = "MM", allow_negative_numbers = true)]
    pub flap: Option<f32>,
    /// Line of the planned bone flap as it was drawn on the skull, RAS mm; empty for a round one
    #[arg(skip)]
    pub flap_line: Vec<[f32; 3]>,
    /// Share of the fluid's buoyancy that is lost when the dura is opened, 0 to 1. The brain sinks
    /// [default: 0.3, fitted to the shift of 61 patients; with support=base 0.05, uncalibrated]
    #[arg(help_heading = "Models and accuracy", long, value_name = "SHARE", allow_negative_numbers = true)]
    pub csf_loss: Option<f32>,
    /// How much faster than in a patient the fluid drains, 1 to 1000 [default: 60]
    #[arg(help_heading = "Models and accuracy", long, value_name = "FACTOR", allow_negative_numbers = true)]
    pub csf_speed_up: Option<f32>,
    /// Rate at which the aspirator takes brain, 0 to 50 [default: 8, uncalibrated]
    #[arg(help_heading = "Models and accuracy", long, value_name = "MM/S", allow_negative_numbers = true)]
    pub aspiration: Option<f32>,
    /// Bleeding over the usual, 0 to 20 [default: 1, uncalibrated]
    #[arg(help_heading = "Models and accuracy", long, value_name = "FACTOR", allow_negative_numbers = true)]
    pub bleeding: Option<f32>,
    /// The dura: closed, to be incised, or open [default: closed where a skull covers a tumour]
    #[arg(help_heading = "Session", long, value_name = "STATE", value_parser = closed)]
    pub dura: Option<bool>,
    /// Tissue classes (as for --tissue) that raise a warning when a tool comes close, separated by
    /// commas [default: vessel]
    #[arg(help_heading = "Session", long, value_name = "CLASS,...", value_delimiter = ',')]
    pub forbid: Option<Vec<TissueClass>>,
    /// Replay only every Nth recording of --device replay:FOLDER, from the Ith on, as in 2/8
    #[arg(help_heading = "Files", long, value_name = "I/N", value_parser = shard)]
    pub shard: Option<(usize, usize)>,
    /// Haptic tick rate, Hz [default: 1000; a replay's as recorded]
    #[arg(help_heading = "Haptic devices", long, value_name = "HZ", allow_negative_numbers = true)]
    pub rate_hz: Option<f32>,
    /// Pictures per second of a headless run; 0 for none
    #[arg(help_heading = "Files", long, value_name = "N", default_value_t = 1.0, allow_negative_numbers = true)]
    pub frames_per_second: f64,
    /// Width and height of the picture, pixels
    #[arg(help_heading = "Files", long, value_name = "WxH", default_value = "960x600", value_parser = size)]
    pub picture: [u32; 2],
}

/// A patient's images and how they are imported.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Patient")]
pub struct Patient {
    /// Cache folder of imported cases [default: TREPAN_CACHE, else trepan/cases in the user's cache
    /// folder]
    #[arg(long, value_name = "DIR")]
    pub cache: Option<PathBuf>,
    /// CT of the patient: a file, or a folder of DICOM slices [default: the built-in case]
    #[arg(long, value_name = "PATH")]
    pub ct: Option<PathBuf>,
    /// MRI of the same patient in the same space
    #[arg(long, value_name = "PATH")]
    pub mri: Option<PathBuf>,
    /// DICOM series of the CT's folder, by the number that `case series` lists [default: the one
    /// with the most slices]
    #[arg(long, value_name = "N", requires = "ct")]
    pub ct_series: Option<usize>,
    /// DICOM series of the MRI's folder
    #[arg(long, value_name = "N", requires = "mri")]
    pub mri_series: Option<usize>,
    /// Label volume of the brain: all nonzero voxels [default: segmented from the MRI]
    #[arg(long, value_name = "PATH")]
    pub labels: Option<PathBuf>,
    /// Tissue class from a label volume: white, grey, ventricle, tumour, vessel, basal-ganglia,
    /// corpus-callosum or soft-tumour. All nonzero voxels inside the brain, or only the labels
    /// (codes, names of segments). Repeatable
    #[arg(long = "tissue", value_name = "CLASS=PATH[:LABEL,...]")]
    pub tissues: Vec<TissueSource>,
    /// Edge of a skull voxel, mm [default: by --quality; 1 for `case build`]
    #[arg(long, value_name = "MM", allow_negative_numbers = true)]
    pub spacing_mm: Option<f32>,
    /// Number of tetrahedra of the brain, met within 10 % [default: by --quality; 8000 for
    /// `case build`]
    #[arg(long, value_name = "N")]
    pub tets: Option<usize>,
    /// Halvings of the edge length within 7 mm of the opening, 4 mm deep, at the same count
    /// [default: by --quality; 4 for `case build`]
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = clap::value_parser!(u32).range(0..=4))]
    pub opening_refinement: Option<u32>,
    /// Register the MRI (and labels) to the CT by mutual information
    #[arg(long)]
    pub register: bool,
    /// Point outside the skull over the place to open, RAS mm [default: bone about 6 mm thick]. The
    /// default place is close to the brain, on the upper right front if possible, and the same for
    /// all voxel sizes
    #[arg(long, value_name = "X,Y,Z", value_parser = point, allow_hyphen_values = true)]
    pub opening: Option<[f32; 3]>,
    /// Make a tumour of a radius, mm, below the opening or around a point; the opening is over it
    #[arg(long, value_name = "[X,Y,Z,]R", value_parser = tumour, allow_hyphen_values = true)]
    pub tumour: Option<MadeTumour>,
    /// Threshold of bone, HU [default: from the histogram, 300 to 500]
    #[arg(long, value_name = "HU", allow_negative_numbers = true)]
    pub isovalue_hu: Option<i16>,
}

/// Tasks of a program besides a session.
#[derive(Clone, Debug, Subcommand)]
pub enum Task {
    /// Build cases, list DICOM series
    #[command(subcommand)]
    Case(CaseTask),
    /// Test haptic devices
    #[command(subcommand)]
    Device(DeviceTask),
    /// Check, repair and export recordings, make one file of a film
    #[command(subcommand)]
    Recording(RecordingTask),
    /// List the sessions that were kept, or write them as a table
    #[command(subcommand)]
    Sessions(SessionsTask),
    /// Print what a reader sees in an image, a DICOM folder, a mesh or a recording, without a case
    Inspect {
        /// A file or a folder
        path: PathBuf,
        /// Series of a folder or volume of a file, from 0 [default: the one that a program takes]
        #[arg(long, value_name = "N")]
        number: Option<usize>,
        /// Print JSON instead of lines
        #[arg(long)]
        json: bool,
    },
    /// Compare two recorded sessions on one page: scores, warnings, forces
    Compare {
        /// A recording, such as session.mcap
        first: PathBuf,
        /// Another recording
        second: PathBuf,
        /// Folder for compare.html
        #[arg(long, value_name = "DIR", default_value = "trepan-out/compare")]
        out: PathBuf,
    },
    /// Print which models `--quality auto` takes for a case on this machine, why, and what the next
    /// better and the next cheaper choice cost
    Plan {
        /// A folder that `case build` made
        #[arg(long, value_name = "CASE", conflicts_with_all = ["ct", "mri", "labels", "tissues", "spacing_mm", "tets", "opening_refinement", "isovalue_hu", "register", "opening", "tumour"])]
        case: Option<PathBuf>,
        /// The patient's images
        #[command(flatten)]
        patient: Box<Patient>,
        /// Tolerances to keep
        #[command(flatten)]
        tolerances: Tolerances,
        /// Haptic tick rate, Hz
        #[arg(long, value_name = "HZ", default_value_t = 1000.0, allow_negative_numbers = true)]
        rate_hz: f32,
        /// Width and height of the picture, pixels
        #[arg(long, value_name = "WxH", default_value = "960x600", value_parser = size)]
        picture: [u32; 2],
    },
}

/// Error tolerances of a session.
#[derive(Clone, Copy, Debug, Default, Args)]
#[command(next_help_heading = "Models and accuracy")]
pub struct Tolerances {
    /// Tolerance of the force error on bone, 95th percentile of the ticks, N [default: 0.1]
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    pub force_error_n: Option<f64>,
    /// Tolerance of the brain's displacement error near the tool, mm [default: 0.4]
    #[arg(long, value_name = "MM", allow_negative_numbers = true)]
    pub displacement_mm: Option<f64>,
    /// Tolerance of the force error on tissue, N, or a tenth of the force if that is more
    /// [default: 0.02]
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    pub tissue_force_n: Option<f64>,
    /// Tolerance of the picture error, percent of white [default: 1]
    #[arg(long, value_name = "PERCENT", allow_negative_numbers = true)]
    pub picture_error_percent: Option<f64>,
}

impl Tolerances {
    /// Refuses numbers out of range.
    pub fn check(&self) -> Result<(), SessionError> {
        within("force-error-n", self.force_error_n.unwrap_or(1.0), 1e-4, 100.0)?;
        within("tissue-force-n", self.tissue_force_n.unwrap_or(1.0), 1e-4, 100.0)?;
        within("displacement-mm", self.displacement_mm.unwrap_or(1.0), 1e-4, 100.0)?;
        within("picture-error-percent", self.picture_error_percent.unwrap_or(1.0), 1e-3, 100.0)
    }
}

/// Tasks with cases.
#[derive(Clone, Debug, Subcommand)]
pub enum CaseTask {
    /// List the DICOM series in a folder, for --ct-series and --mri-series
    Series {
        /// Folder to search, with its subfolders
        folder: PathBuf,
    },
    /// Build a case folder from images, for --case
    Build {
        /// The patient's images
        #[command(flatten)]
        patient: Box<Patient>,
        /// New case folder; it must not exist yet
        #[arg(long, value_name = "CASE")]
        out: PathBuf,
    },
}

/// Tasks with recordings.
#[derive(Clone, Debug, Subcommand)]
pub enum RecordingTask {
    /// Print a recording's length and case, and what it lacks; exit code 1 if it is incomplete
    Check {
        /// A recording, such as session.mcap
        file: PathBuf,
    },
    /// Print a recorded session's settings as a file for --set @FILE
    Settings {
        /// A recording, such as session.mcap
        file: PathBuf,
    },
    /// Write an intact recording from all that can be read of a truncated or damaged one, also
    /// after the damage; other programs can open it
    Repair {
        /// Truncated or damaged recording; it is not changed
        file: PathBuf,
        /// New recording; it must not exist yet
        out: PathBuf,
    },
    /// Make one file of the pictures of a film (key V in the window): an animated PNG, which
    /// browsers and office programs play
    Film {
        /// Folder of the film, or of its session
        folder: PathBuf,
        /// New file; it must not exist yet
        #[arg(value_name = "FILE.png")]
        out: PathBuf,
    },
    /// Write every tick as a row of a CSV file, for MATLAB, R, Python or Excel; exit code 1 if the
    /// recording is incomplete
    Export {
        /// A recording, such as session.mcap
        file: PathBuf,
        /// New file; it must not exist yet
        #[arg(long, value_name = "FILE.csv")]
        csv: PathBuf,
        /// Only one row in this time, ms [default: every tick]
        #[arg(long, value_name = "MS", allow_negative_numbers = true)]
        every_ms: Option<f64>,
    },
}

/// Tasks with the sessions that were kept.
#[derive(Clone, Debug, Subcommand)]
pub enum SessionsTask {
    /// Print a table: date, person, program, case, lesson, result, agreement with the plan, plunge
    List(SessionFilter),
    /// Write one row per session, with every score, for a spreadsheet or R
    Export {
        /// New file
        #[arg(long, value_name = "FILE.csv")]
        csv: PathBuf,
        /// Which sessions
        #[command(flatten)]
        wanted: SessionFilter,
    },
}

/// Which sessions are wanted; replays and watched sessions are left out.
#[derive(Clone, Debug, Default, Args)]
pub struct SessionFilter {
    /// Folders to search [default: those of the start page, and trepan-out]
    #[arg(value_name = "FOLDER")]
    pub folders: Vec<PathBuf>,
    /// Only of this person
    #[arg(long, value_name = "NAME")]
    pub person: Option<String>,
    /// Only of this lesson, by name or title
    #[arg(long, value_name = "NAME")]
    pub lesson: Option<String>,
    /// Only of cases whose name contains this
    #[arg(long, value_name = "NAME")]
    pub case: Option<String>,
}

/// Tasks with devices.
#[derive(Clone, Debug, Subcommand)]
pub enum DeviceTask {
    /// Test a device before a session: rate, jitter, delay, workspace and a soft wall, with a
    /// report
    Test {
        /// The device, as for --device
        #[arg(value_name = "NAME", value_parser = device)]
        name: String,
        /// Folder for device.json and device.html
        #[arg(long, value_name = "DIR", default_value = "trepan-out/device")]
        out: PathBuf,
        /// Length of the test, seconds
        #[arg(long, value_name = "S", default_value_t = 20.0, allow_negative_numbers = true)]
        duration: f64,
    },
}

impl Patient {
    /// Refuses numbers out of range.
    pub fn check(&self) -> Result<(), SessionError> {
        within("spacing-mm", self.spacing_mm.unwrap_or(1.0).into(), 0.2, 4.0)?;
        within("tets", self.tets.unwrap_or(8_000) as f64, 500.0, 1e6)?;
        within("isovalue-hu", self.isovalue_hu.unwrap_or(0).into(), -900.0, 3000.0)
    }
}

fn within(flag: &str, value: f64, low: f64, high: f64) -> Result<(), SessionError> {
    let fault = || SessionError::Usage(format!("--{flag} {value} is out of range: give {low} to {high}"));
    (low..=high).contains(&value).then_some(()).ok_or_else(fault)
}

/// Refuses a tick rate out of range.
pub(crate) fn rate(rate_hz: f64) -> Result<(), SessionError> {
    within("rate-hz", rate_hz, RATES_HZ[0], RATES_HZ[1])
}

/// Names of devices as makers and users call them, and those of `--device`.
const CALLED: [(&str, &str); 9] = [
    ("touch", "openhaptics"),
    ("touch-x", "openhaptics"),
    ("phantom", "openhaptics"),
    ("geomagic", "openhaptics"),
    ("omega", "force-dimension"),
    ("delta", "force-dimension"),
    ("sigma", "force-dimension"),
    ("falcon", "force-dimension"),
    ("inverse3", "haply"),
];

/// Takes a device by the name of `--device`, or by what its maker calls it.
fn device(text: &str) -> Result<String, Infallible> {
    let (kind, which) = text.split_at(text.find(':').unwrap_or(text.len()));
    let known = CALLED.iter().find(|(called, _)| called.eq_ignore_ascii_case(kind));
    Ok(known.map_or_else(|| text.into(), |(_, name)| format!("{name}{which}")))
}

fn point(text: &str) -> Result<[f32; 3], String> {
    let remedy = "expected X,Y,Z in mm: right, anterior and superior positive, as in 40,30,120";
    let numbers: Vec<f32> = text.split(',').map(|s| s.trim().parse().map_err(|_| remedy)).collect::<Result<_, _>>()?;
    let point: [f32; 3] = numbers.try_into().map_err(|_| remedy)?;
    if point.iter().all(|v| v.abs() <= 1e4) { Ok(point) } else { Err(remedy.into()) }
}

fn tumour(text: &str) -> Result<MadeTumour, String> {
    let remedy = "expected R or X,Y,Z,R in mm: a radius of 2 to 40, below the opening or around a point (right, anterior and superior positive), as in 7.5 or 30,40,80,7.5";
    let (place, radius) = text.rsplit_once(',').map_or((None, text), |(place, radius)| (Some(place), radius));
    let centre = place.map(point).transpose().map_err(|_| remedy)?;
    let radius_mm = radius.trim().parse().map_err(|_| remedy)?;
    if (2.0..=40.0).contains(&radius_mm) { Ok(MadeTumour { centre, radius_mm }) } else { Err(remedy.into()) }
}

fn quality(text: &str) -> Result<Quality, String> {
    let names = || Quality::ALL.map(Quality::name).join(", ");
    Quality::ALL.into_iter().find(|known| known.name() == text).ok_or_else(|| format!("give one of {}", names()))
}

fn closed(text: &str) -> Result<bool, String> {
    match text {
        "closed" => Ok(true),
        "open" => Ok(false),
        _ => Err("expected closed or open".into()),
    }
}

fn shard(text: &str) -> Result<(usize, usize), String> {
    let remedy = "expected I/N with 1 <= I <= N, as in 2/8";
    let (i, n) = text.split_once('/').ok_or(remedy)?;
    let (i, n): (usize, usize) = (i.parse().map_err(|_| remedy)?, n.parse().map_err(|_| remedy)?);
    if i >= 1 && i <= n { Ok((i - 1, n)) } else { Err(remedy.into()) }
}

fn size(text: &str) -> Result<[u32; 2], String> {
    let remedy = "expected WIDTHxHEIGHT with 16 to 8192 pixels each, as in 960x600";
    let (width, height) = text.split_once('x').ok_or(remedy)?;
    let side = |s: &str| s.parse().ok().filter(|n| (16..=8192).contains(n)).ok_or(remedy);
    Ok([side(width)?, side(height)?])
}

impl Options {
    /// Parses a program's command line; its help begins with what the program is for.
    pub(crate) fn of_program(
        program: Program,
        words: impl IntoIterator<Item = impl Into<OsString>>,
    ) -> Result<Self, clap::Error> {
        let (name, purpose) = (program.name(), program.purpose());
        let examples: String = program.examples().iter().map(|line| format!("  {name} {line}\n")).collect();
        let long = format!("{purpose}\n\nExamples:\n{examples}");
        let mut command =
            Self::command().name(name).bin_name(name).about(purpose).long_about(long.trim_end().to_string());
        let words = setting_paths::expand(words.into_iter().map(Into::into));
        let words = words.map_err(|fault| command.error(ErrorKind::ValueValidation, fault))?;
        let matches = command.try_get_matches_from_mut(words)?;
        Self::from_arg_matches(&matches).map_err(|fault| fault.format(&mut command))
    }

    /// Ingredients given by hand, `--rigid` and `--solver` first; refuses unknown names.
    pub(crate) fn given(&self) -> Result<Vec<KeyValue>, SessionError> {
        let flags = [("rigid", &self.rigid), ("solver", &self.solver)].into_iter();
        let named = flags.filter_map(|(name, text)| Some(KeyValue::by_flag(name, text.as_deref()?)));
        let named: Result<Vec<_>, _> = named.collect();
        Ok(named.map_err(SessionError::Usage)?.into_iter().chain(self.settings.iter().flatten().cloned()).collect())
    }

    /// Whether only the list of keys is wanted.
    pub(crate) fn lists_keys(&self) -> bool {
        self.settings.iter().any(Option::is_none)
    }

    /// Whether neither a case nor a device nor a place for files is named: a window begins with its
    /// start page.
    pub(crate) fn names_no_session(&self) -> bool {
        let Patient { ct, mri, labels, tissues, .. } = &self.patient;
        let paths = [&self.case, ct, mri, labels, &self.out, &self.record];
        let names = [&self.device, &self.second_device, &self.share, &self.watch, &self.name, &self.lesson];
        let none = paths.iter().all(|path| path.is_none()) && names.iter().all(|name| name.is_none());
        none && tissues.is_empty() && self.duration.is_none()
    }

    /// Refuses numbers out of range; the error names flag and range.
    pub fn check(&self) -> Result<(), SessionError> {
        self.patient.check()?;
        self.tolerances.check()?;
        within("duration", self.duration.unwrap_or(1.0), 0.1, 86_400.0)?;
        let [softest, stiffest] = MODULI_KPA;
        within("young-modulus-kpa", self.young_modulus_kpa.map_or(softest, f64::from), softest, stiffest)?;
        within("device-scale", self.device_scale.into(), 0.2, 5.0)?;
        let [least, most] = ForceScale::RANGE;
        within("force-scale", self.force_scale.map_or(most, f64::from), least, most)?;
        within("flap", self.flap.unwrap_or(0.0).into(), 0.0, 90.0)?;
        within("csf-speed-up", self.csf_speed_up.unwrap_or(1.0).into(), CSF_SPEED_UPS[0], CSF_SPEED_UPS[1])?;
        within("csf-loss", self.csf_loss.unwrap_or(0.0).into(), 0.0, 1.0)?;
        within("aspiration", self.aspiration.unwrap_or(0.0).into(), ASPIRATIONS_MM_S[0], ASPIRATIONS_MM_S[1])?;
        within("bleeding", self.bleeding.unwrap_or(0.0).into(), BLEEDINGS[0], BLEEDINGS[1])?;
        rate(self.rate_hz.map_or(RATES_HZ[0], f64::from))?;
        within("frames-per-second", self.frames_per_second, 0.0, 120.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn help_begins_with_the_purpose_and_five_examples_and_has_groups() {
        for program in [Program::Craniotomy, Program::Brain, Program::Integrated] {
            let of = |line: &str| Options::of_program(program, line.split(' ').map(String::from));
            let help = of("x --help").unwrap_err().to_string();
            assert!(help.starts_with(program.purpose()), "{help}");
            assert_eq!(help.matches(&format!("\n  {} ", program.name())).count(), 5, "{help}");
            for group in ["Patient:", "Haptic devices:", "Session:", "Files:", "Models and accuracy:"] {
                assert!(help.contains(&format!("\n{group}\n")), "{group} in {help}");
            }
            let lines = help.lines().count();
            assert!(lines < 240 && help.contains("--set list") && help.contains("--list-constants"), "{lines}\n{help}");
            let version = of("x --version").unwrap_err().to_string();
            assert_eq!(version.trim(), format!("{} {}", program.name(), env!("CARGO_PKG_VERSION")));
            for example in program.examples() {
                let parsed = of(&format!("x {example}"));
                assert!(parsed.is_ok(), "{example}: {}", parsed.unwrap_err());
            }
        }
    }

    #[test]
    fn names_of_makers_and_american_spellings_are_understood() {
        let parse = |line: &str| Options::try_parse_from(line.split(' ')).unwrap();
        let device = |name: &str| parse(&format!("x --device {name}")).device.unwrap();
        assert_eq!(
            [device("touch"), device("Touch:left"), device("omega:1")],
            ["openhaptics", "openhaptics:left", "force-dimension:1"]
        );
        assert_eq!(device("script:flap"), "script:flap");
        let spelt = parse("x --tissue gray=a.nii:3 --tissue tumor=b.nii --forbid tumor,vessel");
        let classes: Vec<_> = spelt.patient.tissues.iter().map(|source| source.class).collect();
        assert_eq!(classes, [TissueClass::Grey, TissueClass::Tumour]);
        assert_eq!(spelt.forbid.unwrap(), [TissueClass::Tumour, TissueClass::Vessel]);
        assert!(Options::try_parse_from(["x", "--tissue", "brain=a.nii"]).is_err());
    }

    #[test]
    fn bad_numbers_are_refused_with_a_range() {
        let parse = |line: &str| Options::try_parse_from(line.split(' '));
        assert!(parse("x --headless --duration 20 --out demo").unwrap().check().is_ok());
        let fault = parse("x --duration nan").unwrap().check().unwrap_err().to_string();
        assert!(fault.contains("--duration") && fault.contains("0.1 to 86400"), "{fault}");
        assert!(parse("x --flap 91").unwrap().check().is_err() && parse("x --csf-loss -0.1").unwrap().check().is_err());
        assert!(parse("x --forbid bone").unwrap_err().to_string().contains("vessel"));
        assert!(parse("x --device-scale 0").unwrap().check().is_err());
        assert!(parse("x --force-scale 0.2").unwrap().check().is_ok());
        assert!(parse("x --force-scale 2").unwrap().check().unwrap_err().to_string().contains("0.01 to 1"));
        assert!(parse("x --spacing-mm 0").unwrap().check().is_err());
        assert_eq!(parse("x --opening -40,30.5,120").unwrap().patient.opening, Some([-40.0, 30.5, 120.0]));
        let made = |centre, radius_mm| Some(MadeTumour { centre, radius_mm });
        assert_eq!(parse("x --tumour -40,30.5,80,7.5").unwrap().patient.tumour, made(Some([-40.0, 30.5, 80.0]), 7.5));
        assert_eq!(parse("x --tumour 10").unwrap().patient.tumour, made(None, 10.0));
        for bad in ["1,2,3", "1,9", "1,2,3,0", "1,2,3,-5", "1,2,3,nan", "1,2,nan,5", "1,2,3,99", "a"] {
            let fault = parse(&format!("x --tumour {bad}")).unwrap_err().to_string();
            assert!(fault.contains("radius of 2 to 40"), "{fault}");
        }
        assert!(parse("x --opening 1,2").is_err() && parse("x --opening 1,2,nan").is_err());
        assert!(parse("x --quality best").unwrap_err().to_string().contains("auto, draft, usual, fine"));
        assert_eq!(parse("x --quality fine").unwrap().quality, Some(Quality::Fine));
        assert!(parse("x --force-error-n 0").unwrap().check().unwrap_err().to_string().contains("--force-error-n"));
        assert!(parse("x plan --tets 5000 --displacement-mm 0.5 --spacing-mm 0.7").is_ok());
        let given = |line: &str| parse(line).unwrap().given().map_err(|fault| fault.to_string());
        let many = given("x --set element=plain,law.grey=ogden --set threads=2 --rigid thesis").unwrap();
        assert_eq!(format!("{many:?}"), "[--rigid thesis, --set element=plain, --set law.grey=ogden, --set threads=2]");
        assert_eq!(given("x --rigid magic").unwrap_err().split(';').next(), Some("--rigid magic is not known"));
        assert!(parse("x --set speed=2").unwrap_err().to_string().contains("known are rigid, rigid-points, shaft"));
        assert!(parse("x --set element=hex").unwrap_err().to_string().contains("plain, locking-free"));
        assert!(parse("x --set list").unwrap().lists_keys() && !parse("x").unwrap().lists_keys());
        assert!(parse("x --picture 960").is_err() && parse("x --picture 0x7").is_err());
    }
}
