//! Writes the output files of a session, each of them atomically.

use crate::ReportError;
use crate::debrief::Debrief;
use crate::drilled::{self, Drilled};
use crate::page::{self, Shot};
use crate::summary::{Resection, Summary};
use crate::whole::whole;
use crate::{csv, slicer};
use std::collections::BTreeMap;
use std::ffi::OsStr;
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::{SystemTime, UNIX_EPOCH};
use trepan_bone::BoneVolume;
use trepan_link::Recording;
use trepan_mesh::{isosurface, stl};
use trepan_runtime::Outcome;
use trepan_stages::program::Program;
use trepan_volume::{VoxelVolume, write_beside};

/// Files that a session writes into its folder, besides pictures.
const NAMES: [&str; 14] = [
    "summary.json",
    "scores.csv",
    "report.html",
    "drilled.nii.gz",
    "drilled.nrrd",
    "drilled-fine.nii.gz",
    "drilled.stl",
    "removed-label.nii.gz",
    "removed-label.nrrd",
    slicer::OPENING,
    slicer::PLAN,
    slicer::FLAP,
    slicer::PATH,
    RECORDING,
];
/// Default name of the recording; `--record` gives another.
pub const RECORDING: &str = "session.mcap";
/// The film of a recording's session, beside it.
pub fn scene_of(record: &Path) -> PathBuf {
    record.with_extension("scene")
}

/// Largest number of letters of a session's name in the name of its folder.
const MOST_LETTERS: usize = 60;
/// Folder of the pictures.
const FRAMES: &str = "frames";

/// Whether a folder holds files of a session.
pub fn holds_session(out: &Path) -> bool {
    NAMES.iter().any(|name| out.join(name).exists())
}

/// Returns a new folder below `ROOT/PROGRAM`, named after the time (UTC) and the session's name.
pub fn dated(program: Program, root: Option<&Path>, name: Option<&str>) -> PathBuf {
    let now = seconds_now();
    let place = root.unwrap_or(Path::new("trepan-out")).join(program.name());
    let fit = |c: char| if c.is_alphanumeric() { c } else { '-' };
    let name = name.map(|name| name.trim().chars().map(fit).take(MOST_LETTERS).collect::<String>());
    let name = name.filter(|name| !name.is_empty()).map_or_else(String::new, |name| format!("-{name}"));
    let (first, mut nth) = (place.join(date_and_time(now) + &name), 1);
    let mut folder = first.clone();
    while folder.exists() {
        nth += 1;
        folder = first.with_extension(nth.to_string());
    }
    folder
}

fn seconds_now() -> u64 {
    SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default().as_secs()
}

/// The present date and time, UTC as in RFC 3339.
pub fn now() -> String {
    rfc_3339(seconds_now())
}

fn rfc_3339(seconds: u64) -> String {
    let text = date_and_time(seconds);
    let (date, time) = text.split_once('T').unwrap_or((&text, ""));
    format!("{date}T{}Z", time.replace('-', ":"))
}

/// Formats seconds since 1970 as date and time (UTC) for a file name. Days follow Hinnant's
/// `civil_from_days`.
fn date_and_time(seconds: u64) -> String {
    let days = seconds / 86_400 + 719_468;
    let (era, of_era) = (days / 146_097, days % 146_097);
    let year_of_era = (of_era - of_era / 1460 + of_era / 36_524 - of_era / 146_096) / 365;
    let of_year = of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
    let shifted = (5 * of_year + 2) / 153;
    let (day, month) = (of_year - (153 * shifted + 2) / 5 + 1, if shifted < 10 { shifted + 3 } else { shifted - 9 });
    let year = year_of_era + era * 400 + u64::from(month <= 2);
    let [h, m, s] = [seconds / 3600 % 24, seconds / 60 % 60, seconds % 60];
    format!("{year:04}-{month:02}-{day:02}T{h:02}-{m:02}-{s:02}")
}

/// Folder of a session that is being written. Dropped before [`keep`](Self::keep), it removes the
/// session's files; a recording that can be opened is kept, up to its last whole chunk.
#[derive(Debug)]
pub struct Files {
    out: PathBuf,
    record: PathBuf,
    /// Folders that this session created, the deepest first.
    made: Vec<PathBuf>,
    kept: bool,
}

impl Files {
    /// Creates the folder and its folder for pictures, and removes the files of an older session.
    pub fn make(out: &Path, record: &Path) -> Result<Self, ReportError> {
        let missing = out.ancestors().filter(|folder| !folder.as_os_str().is_empty() && !folder.exists());
        let made = missing.map(PathBuf::from).collect();
        let files = Self { out: out.into(), record: record.into(), made, kept: false };
        let failed = ReportError::output(out);
        fs::create_dir_all(out.join(FRAMES)).map_err(failed)?;
        files.clear()?;
        Ok(files)
    }

    /// Keeps the files: the session is complete.
    pub fn keep(mut self) {
        self.kept = true;
    }

    /// Removes a session's files and pictures, except those that the user took in the window.
    fn clear(&self) -> Result<(), ReportError> {
        let frames = self.out.join(FRAMES);
        let pictures = fs::read_dir(&frames).into_iter().flatten().flatten();
        let pictures = pictures.map(|entry| entry.path()).filter(|path| path.extension() == Some(OsStr::new("png")));
        let files = NAMES.iter().map(|name| self.out.join(name)).chain([self.record.clone(), scene_of(&self.record)]);
        for path in files.filter(|path| path.exists()).chain(pictures) {
            fs::remove_file(&path).map_err(ReportError::output(&path))?;
        }
        Ok(())
    }
}

impl Drop for Files {
    fn drop(&mut self) {
        if self.kept {
            return;
        }
        // The recording has another name while the other files are removed.
        let ticks = Recording::open(&self.record).map_or(0, |recording| recording.ticks.len());
        let kept = self.record.with_extension("kept");
        let saved = ticks > 0 && fs::rename(&self.record, &kept).is_ok();
        _ = self.clear();
        if saved && fs::rename(&kept, &self.record).is_ok() {
            tracing::warn!("only the recording of this session is kept: {ticks} ticks in {}", self.record.display());
        }
        _ = fs::remove_dir(self.out.join(FRAMES));
        for folder in &self.made {
            _ = fs::remove_dir(folder);
        }
    }
}

/// Writes the drilled skull: its densities, HU, and the labels of what was removed. If asked, also
/// the densities on the nodes around what was removed, and with `surface` the isosurface as
/// triangles.
pub fn skull(
    out: &Path,
    drilled: &Drilled,
    around: Option<&VoxelVolume<i16>>,
    bone: &BoneVolume,
    surface: bool,
) -> Result<(), ReportError> {
    let failed = |fault: &dyn std::fmt::Display| ReportError::Usage(format!("{fault}; give another folder with --out"));
    write_beside(out, "removed-label", &drilled.removed).map_err(|fault| failed(&fault))?;
    for (name, volume) in [("drilled", Some(&drilled.densities)), ("drilled-fine", around)] {
        volume.map_or(Ok(()), |volume| write_beside(out, name, volume).map(drop)).map_err(|fault| failed(&fault))?;
    }
    if surface {
        let triangles = isosurface(&drilled::on_nodes(bone), bone.isovalue());
        stl::write(&out.join("drilled.stl"), &triangles).map_err(|fault| failed(&fault))?;
    }
    Ok(())
}

/// Writes summary, scores and report.
pub fn write(
    out: &Path,
    recording: &Recording,
    summary: &Summary,
    outcome: &Outcome,
    (debrief, shots): (&Debrief, &[Shot]),
) -> Result<(), ReportError> {
    let json =
        serde_json::to_vec_pretty(summary).map_err(|fault| ReportError::Internal(format!("summary: {fault}")))?;
    whole(&out.join("summary.json"), &json)?;
    whole(&out.join("scores.csv"), scores(summary).as_bytes())?;
    let page = page::html(summary, outcome, recording, (debrief, shots))?;
    whole(&out.join("report.html"), page.as_bytes())
}

/// Formats the scores as CSV lines of name and value; each name is used once and ends with its
/// unit.
fn scores(summary: &Summary) -> String {
    let text = |value: &Option<String>| value.clone().unwrap_or_default();
    let about = [
        ("date_utc", summary.date.clone()),
        ("person", text(&summary.person)),
        ("program", summary.app.clone()),
        ("version", summary.version.clone()),
        ("case", summary.case.clone()),
        ("lesson", text(&summary.lesson)),
        ("session_name", text(&summary.name)),
        ("device", summary.device.clone()),
        ("length_s", summary.length_s.to_string()),
    ];
    let about = about.into_iter().map(|(name, value)| (name.to_string(), value));
    let hashes = summary.hashes.iter().map(|(name, hash)| (format!("hashes.{name}"), hash.clone()));
    let about: String = about.chain(hashes).map(|(name, value)| csv::line([name, value])).collect();
    let parts = [
        ("scores", serde_json::to_value(summary.scores)),
        ("plan", serde_json::to_value(summary.plan)),
        ("cut_off", serde_json::to_value(summary.cut_off)),
        ("bleeding", serde_json::to_value(&summary.bleeding)),
        ("dura", serde_json::to_value(&summary.dura)),
        ("both_hands", serde_json::to_value(summary.tool_use.both_hands)),
    ];
    let mut csv = format!("name,value\n{about}");
    for (part, value) in parts {
        for (name, value) in value.ok().as_ref().and_then(|value| value.as_object()).into_iter().flatten() {
            let value = if value.is_null() { String::new() } else { value.to_string() };
            _ = writeln!(csv, "{part}.{name},{value}");
        }
    }
    if let Some(Resection { tumour_share, healthy_mm3, .. }) = summary.resection {
        _ = writeln!(csv, "resection.tumour_share,{tumour_share}\nresection.healthy_mm3,{healthy_mm3}");
    }
    _ = writeln!(csv, "brain_cut_mm2,{}", summary.brain_cut_mm2);
    for of in &summary.tool_use.tools {
        let name = of.name.replace(", ", "_").replace(' ', "_");
        for (key, value) in serde_json::to_value(of).ok().as_ref().and_then(|of| of.as_object()).into_iter().flatten() {
            if key != "name" {
                _ = writeln!(csv, "tools.{name}.{key},{value}");
            }
        }
    }
    for region in &summary.regions {
        let name = region.name.replace(' ', "_");
        _ = writeln!(csv, "regions.{name}.seconds,{}", region.seconds);
        _ = writeln!(csv, "regions.{name}.impulse_n_s,{}", region.impulse_n_s);
        _ = writeln!(csv, "regions.{name}.peak_n,{}", region.peak_n);
    }
    let mut warnings = BTreeMap::<&str, (usize, f64)>::new();
    for raised in &summary.warnings {
        warnings.entry(&raised.name).or_insert((0, raised.time_s)).0 += 1;
    }
    for (name, (count, first_s)) in warnings {
        _ = writeln!(csv, "warnings.{name}.count,{count}\nwarnings.{name}.first_s,{first_s}");
    }
    csv
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::summary::Raised;

    #[test]
    fn a_time_gives_a_name_that_sorts() {
        assert_eq!(date_and_time(0), "1970-01-01T00-00-00");
        assert_eq!(date_and_time(951_827_696), "2000-02-29T12-34-56");
        assert_eq!(date_and_time(1_795_418_102), "2026-11-23T07-15-02");
        assert!(dated(Program::Brain, None, None).starts_with("trepan-out/brain"));
        let named = dated(Program::Brain, Some(Path::new("kept")), Some(" second try/..\u{e9} "));
        assert!(named.starts_with("kept/brain") && named.to_str().unwrap().ends_with("-second-try---é"), "{named:?}");
    }

    #[test]
    fn a_date_is_that_of_rfc_3339_and_each_score_has_its_own_name() {
        assert_eq!(rfc_3339(951_827_696), "2000-02-29T12:34:56Z");
        let raised = |name: &str, time_s| Raised { time_s, name: name.into(), text: String::new() };
        let summary = Summary {
            date: rfc_3339(0),
            person: Some("Lovelace, Ada".into()),
            hashes: [("ct".to_string(), "00ff".to_string())].into(),
            warnings: vec![raised("brain-near", 2.5), raised("brain-near", 7.0), raised("bone-thin", 2.0)],
            ..Summary::default()
        };
        let csv = scores(&summary);
        let names: Vec<_> = csv.lines().map(|line| line.split(',').next().unwrap()).collect();
        let once: std::collections::HashSet<_> = names.iter().collect();
        assert_eq!(once.len(), names.len(), "{csv}");
        for line in [
            "date_utc,1970-01-01T00:00:00Z",
            "person,\"Lovelace, Ada\"",
            "hashes.ct,00ff",
            "warnings.brain-near.count,2",
            "warnings.brain-near.first_s,2.5",
            "scores.log_dimensionless_jerk,",
        ] {
            assert!(csv.lines().any(|known| known == line), "{line} in {csv}");
        }
    }

    #[test]
    fn files_of_a_failed_session_are_removed_and_others_kept() {
        let home = tempfile::tempdir().unwrap();
        let out = home.path().join("a/b");
        let half = || {
            let files = Files::make(&out, &out.join(RECORDING)).unwrap();
            for name in ["summary.json", RECORDING, "frames/frame-00001.png"] {
                fs::write(out.join(name), "half").unwrap();
            }
            assert!(holds_session(&out));
            files
        };
        drop(half());
        assert!(!home.path().join("a").exists());
        fs::create_dir_all(&out).unwrap();
        fs::write(out.join("mine.txt"), "x").unwrap();
        drop(half());
        let left: Vec<_> = fs::read_dir(&out).unwrap().map(|entry| entry.unwrap().file_name()).collect();
        assert_eq!(left, ["mine.txt"]);
        half().keep();
        assert!(holds_session(&out) && out.join("frames/frame-00001.png").exists());
    }
}
