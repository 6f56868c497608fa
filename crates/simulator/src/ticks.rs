//! `recording export`: the ticks of a recording as CSV, for MATLAB, R, Python and Excel.
//!
//! # Practice
//! The recording is read chunk by chunk, so memory does not grow with its length. What is not
//! finite is an empty field. With a time between rows, removed bone is summed since the row before,
//! and a breakthrough between two rows stands in the later one. The second hand is left out.

use crate::config::SessionConfig;
use crate::error::SessionError;
use std::fmt::Write as _;
use std::io::{BufWriter, Write};
use std::path::Path;
use std::process::ExitCode;
use trepan_link::stream;
use trepan_link::wire::{SessionHeader, TickRecord};
use trepan_report::csv;
use trepan_report::printable::{count, printable};
use trepan_stages::force_scale::ForceScale;
use trepan_stages::program::{Phase, Program};

/// One row: a tick, and what was summed since the row before.
struct Sampled<'a> {
    tick: &'a TickRecord,
    scale: ForceScale,
    removed_mm3: f64,
    removed_in_all_mm3: f64,
    through: bool,
}

/// A column: its name with the unit, and its value.
type Column = (&'static str, fn(&Sampled) -> f64);

/// Columns with numbers, after those of phase and tool.
const COLUMNS: [Column; 48] = [
    ("tip_x_ras_mm", |s| s.tick.proxy.translation.x.into()),
    ("tip_y_ras_mm", |s| s.tick.proxy.translation.y.into()),
    ("tip_z_ras_mm", |s| s.tick.proxy.translation.z.into()),
    ("tip_quaternion_x", |s| s.tick.proxy.rotation.x.into()),
    ("tip_quaternion_y", |s| s.tick.proxy.rotation.y.into()),
    ("tip_quaternion_z", |s| s.tick.proxy.rotation.z.into()),
    ("tip_quaternion_w", |s| s.tick.proxy.rotation.w.into()),
    ("device_x_ras_mm", |s| s.tick.device.translation.x.into()),
    ("device_y_ras_mm", |s| s.tick.device.translation.y.into()),
    ("device_z_ras_mm", |s| s.tick.device.translation.z.into()),
    ("device_quaternion_x", |s| s.tick.device.rotation.x.into()),
    ("device_quaternion_y", |s| s.tick.device.rotation.y.into()),
    ("device_quaternion_z", |s| s.tick.device.rotation.z.into()),
    ("device_quaternion_w", |s| s.tick.device.rotation.w.into()),
    ("device_velocity_x_mm_per_ms", |s| s.tick.twist.linear.x.into()),
    ("device_velocity_y_mm_per_ms", |s| s.tick.twist.linear.y.into()),
    ("device_velocity_z_mm_per_ms", |s| s.tick.twist.linear.z.into()),
    ("buttons", |s| s.tick.buttons.into()),
    ("hand_force_x_n", |s| s.tick.wrench.force.x.into()),
    ("hand_force_y_n", |s| s.tick.wrench.force.y.into()),
    ("hand_force_z_n", |s| s.tick.wrench.force.z.into()),
    ("hand_force_n", |s| s.tick.wrench.force.length().into()),
    ("hand_torque_x_n_mm", |s| s.tick.wrench.torque.x.into()),
    ("hand_torque_y_n_mm", |s| s.tick.wrench.torque.y.into()),
    ("hand_torque_z_n_mm", |s| s.tick.wrench.torque.z.into()),
    ("hand_tissue_force_n", |s| s.tick.tissue_n().into()),
    ("task_force_n", |s| s.scale.task_n(s.tick).into()),
    ("contact_normal_x", |s| s.tick.contact_normal.x.into()),
    ("contact_normal_y", |s| s.tick.contact_normal.y.into()),
    ("contact_normal_z", |s| s.tick.contact_normal.z.into()),
    ("bone_depth_mm", |s| s.tick.depth_mm.into()),
    ("tissue_depth_mm", |s| s.tick.tissue_depth_mm.into()),
    ("brain_distance_mm", |s| s.tick.brain_distance_mm.into()),
    ("removed_mm3", |s| s.removed_mm3),
    ("removed_in_all_mm3", |s| s.removed_in_all_mm3),
    ("spindle_per_min", |s| s.tick.spindle_rpm.into()),
    ("is_drilling", |s| flag(s, TickRecord::DRILLING)),
    ("is_through", |s| f64::from(u8::from(s.through))),
    ("is_undoing", |s| flag(s, TickRecord::UNDOING)),
    ("is_clamped", |s| flag(s, TickRecord::CLAMPED)),
    ("is_released", |s| flag(s, TickRecord::RELEASED)),
    ("is_late", |s| flag(s, TickRecord::LATE)),
    ("is_held", |s| flag(s, TickRecord::HELD)),
    ("is_stale", |s| flag(s, TickRecord::STALE)),
    ("is_lost", |s| flag(s, TickRecord::LOST)),
    ("patch", |s| s.tick.patch_seq as f64),
    ("compute_us", |s| s.tick.compute_us.into()),
    ("tool_number", |s| s.tick.tool.into()),
];

fn flag(sampled: &Sampled, flag: u32) -> f64 {
    f64::from(u8::from(sampled.tick.has(flag)))
}

/// Writes a CSV file from a recording.
pub(crate) fn export(file: &Path, csv: &Path, every_ms: Option<f64>) -> Result<ExitCode, SessionError> {
    if csv.exists() {
        return Err(SessionError::Usage(format!("{} exists already: name a file that does not", csv.display())));
    }
    if every_ms.is_some_and(|ms| !(ms > 0.0 && ms.is_finite())) {
        return Err(SessionError::Usage("--every-ms is out of range: give more than 0".into()));
    }
    let failed = SessionError::output(csv);
    let folder = csv.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let mut out = BufWriter::new(tempfile::NamedTempFile::new_in(folder).map_err(failed)?);
    let mut rows = Rows::new(every_ms);
    out.write_all(heading().as_bytes()).map_err(failed)?;
    let streamed = stream(file, |part| {
        part.ticks.iter().try_for_each(|tick| rows.add(&part.header, tick, &mut out)).map_err(failed)
    })?;
    let out = out.into_inner().map_err(|fault| failed(fault.into_error()))?;
    out.persist(csv).map_err(|fault| failed(fault.error))?;
    println!("{}", printable(&format!("{}: {}", csv.display(), count(rows.written, "row"))));
    Ok(streamed.losses().map_or(ExitCode::SUCCESS, |losses| {
        println!("{}", printable(&format!("{} is not whole: {losses}; the rows are those", file.display())));
        ExitCode::FAILURE
    }))
}

fn heading() -> String {
    csv::line(["tick", "time_ms", "phase", "tool"].into_iter().chain(COLUMNS.iter().map(|(name, _)| *name)))
}

/// Writes rows, and sums what happens between them.
struct Rows {
    every_ms: Option<f64>,
    next_ms: f64,
    removed_mm3: f64,
    removed_in_all_mm3: f64,
    through: bool,
    written: usize,
    text: String,
    /// Force scale of the recording, once its header is read.
    scale: Option<ForceScale>,
}

impl Rows {
    fn new(every_ms: Option<f64>) -> Self {
        let text = String::with_capacity(1024);
        Self {
            every_ms,
            next_ms: f64::NEG_INFINITY,
            removed_mm3: 0.0,
            removed_in_all_mm3: 0.0,
            through: false,
            written: 0,
            text,
            scale: None,
        }
    }

    fn add(&mut self, header: &SessionHeader, tick: &TickRecord, out: &mut impl Write) -> std::io::Result<()> {
        self.removed_mm3 += f64::from(tick.removed_mm3);
        self.removed_in_all_mm3 += f64::from(tick.removed_mm3);
        self.through |= tick.has(TickRecord::THROUGH);
        if tick.time_ms < self.next_ms {
            return Ok(());
        }
        if let Some(every_ms) = self.every_ms {
            self.next_ms = ((tick.time_ms / every_ms).floor() + 1.0) * every_ms;
        }
        let scale = match self.scale {
            Some(scale) => scale,
            None => SessionConfig::of(header).map_err(std::io::Error::other)?.device.force_scale(),
        };
        self.scale = Some(scale);
        let (removed_mm3, removed_in_all_mm3) = (std::mem::take(&mut self.removed_mm3), self.removed_in_all_mm3);
        let sampled =
            Sampled { tick, scale, removed_mm3, removed_in_all_mm3, through: std::mem::take(&mut self.through) };
        let phase = [Phase::Craniotomy, Phase::Brain].get(usize::from(tick.phase)).map_or("", |phase| phase.name());
        self.text.clear();
        _ = write!(self.text, "{},{},{phase},{}", tick.tick, number(tick.time_ms), tool(header, tick));
        for (_, value) in COLUMNS {
            self.text.push(',');
            self.text += &number(value(&sampled));
        }
        self.text.push('\n');
        self.written += 1;
        out.write_all(self.text.as_bytes())
    }
}

/// Name of the tool in a tick; empty if the program is unknown.
fn tool(header: &SessionHeader, tick: &TickRecord) -> String {
    let program = [Program::Craniotomy, Program::Brain, Program::Integrated];
    let tray = program.into_iter().find(|program| program.name() == header.app).map_or(&[][..], Program::tray);
    let tool = tray.get(usize::from(tick.tool));
    tool.map_or(String::new(), |tool| format!("{} {} mm", tool.kind.name(), 2.0 * tool.tip_radius_mm))
}

/// Writes a number with a decimal point; values of f32 as the shortest text that gives them back.
fn number(value: f64) -> String {
    let narrow = value as f32;
    match value {
        v if !v.is_finite() => String::new(),
        v if v.fract() == 0.0 && v.abs() < 1e15 => format!("{v:.0}"),
        v if f64::from(narrow) == v && v.abs() < 1e-4 => format!("{narrow:e}"),
        v if f64::from(narrow) == v => format!("{narrow}"),
        v if v.abs() < 1e-4 => format!("{v:e}"),
        v => format!("{v}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use trepan_geometry::{Vec3, Wrench};
    use trepan_link::Recorder;

    fn recorded(folder: &Path, ticks: u32) -> std::path::PathBuf {
        let path = folder.join("session.mcap");
        let config = [("device_force_scale".to_string(), "0.5".to_string())].into();
        let header = SessionHeader { app: "integrated".into(), config, ..SessionHeader::default() };
        let mut recorder = Recorder::create(&path, &header).unwrap();
        for n in 1..=ticks {
            let tick = TickRecord {
                tick: n.into(),
                time_ms: f64::from(n) + 0.25,
                wrench: Wrench { force: Vec3::new(0.0, -1.5, 0.0), torque: Vec3::ZERO },
                removed_mm3: 0.5,
                brain_distance_mm: f32::INFINITY,
                flags: if n == 3 { TickRecord::THROUGH } else { 0 },
                ..TickRecord::default()
            };
            recorder.tick(&tick).unwrap();
        }
        recorder.finish().unwrap();
        path
    }

    fn cells(csv: &Path) -> Vec<Vec<String>> {
        let text = std::fs::read_to_string(csv).unwrap();
        text.lines().map(|line| line.split(',').map(String::from).collect()).collect()
    }

    #[test]
    fn every_tick_is_a_row_with_units_in_the_header() {
        let folder = tempfile::tempdir().unwrap();
        let (file, csv) = (recorded(folder.path(), 1000), folder.path().join("ticks.csv"));
        assert_eq!(export(&file, &csv, None).unwrap(), ExitCode::SUCCESS);
        let cells = cells(&csv);
        assert!(cells.len() == 1001 && cells.iter().all(|row| row.len() == 4 + COLUMNS.len()));
        let of = |row: usize, name: &str| &cells[row][cells[0].iter().position(|known| known == name).unwrap()];
        assert_eq!(
            (of(3, "time_ms"), of(3, "hand_force_y_n"), of(3, "task_force_n")),
            (&"3.25".into(), &"-1.5".into(), &"3".into())
        );
        assert_eq!(
            (of(3, "removed_in_all_mm3"), of(3, "is_through"), of(4, "is_through")),
            (&"1.5".into(), &"1".into(), &"0".into())
        );
        assert_eq!(
            (of(9, "brain_distance_mm"), of(9, "phase"), of(9, "tool")),
            (&"".into(), &"craniotomy".into(), &"burr 6 mm".into())
        );
        assert!(export(&file, &csv, None).unwrap_err().to_string().contains("exists already"));
    }

    #[test]
    fn thinned_rows_lose_no_bone_and_a_cut_file_gives_what_is_whole() {
        let folder = tempfile::tempdir().unwrap();
        let (file, csv) = (recorded(folder.path(), 1000), folder.path().join("ticks.csv"));
        export(&file, &csv, Some(10.0)).unwrap();
        let all = cells(&csv);
        let at = |name: &str| all[0].iter().position(|known| known == name).unwrap();
        let sum: f64 = all[1..].iter().map(|row| row[at("removed_mm3")].parse::<f64>().unwrap()).sum();
        assert_eq!((all.len(), &all[100][at("removed_in_all_mm3")]), (102, &sum_text(990)));
        assert_eq!((sum, all[2][at("is_through")].as_str()), (500.0, "1"));
        let bytes = std::fs::read(&file).unwrap();
        std::fs::write(&file, &bytes[..bytes.len() * 3 / 5]).unwrap();
        let cut = folder.path().join("cut.csv");
        assert_eq!(export(&file, &cut, None).unwrap(), ExitCode::FAILURE);
        let rows = cells(&cut).len();
        assert!(rows > 100 && rows < 900, "{rows}");
        assert!(export(&file, &folder.path().join("x.csv"), Some(0.0)).is_err());
    }

    /// Bone removed up to a tick.
    fn sum_text(tick: u32) -> String {
        number(0.5 * f64::from(tick))
    }

    #[test]
    fn the_layout_for_foxglove_plots_what_a_recording_has() {
        let layout = include_str!("../../link/foxglove-layout.json");
        let scores = serde_json::to_value(trepan_stages::ScoreKeeper::default()).unwrap();
        let plotted: Vec<&str> = layout.split('"').filter_map(|text| text.strip_prefix("/score.")).collect();
        assert!(plotted.len() >= 3 && plotted.iter().all(|name| scores.get(name).is_some()), "{plotted:?}");
    }

    #[test]
    fn a_number_reads_back_in_any_program() {
        let texts = [f64::from(0.1f32), 1e-7, -0.5, f64::NAN, 12.345678901234, 3.0].map(number);
        assert_eq!(texts, ["0.1", "1e-7", "-0.5", "", "12.345678901234", "3"]);
    }
}
