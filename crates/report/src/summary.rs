//! `summary.json`: the results of a session as numbers.

use crate::models::ModelSummary;
use crate::regions::Region;
use crate::tool_use::ToolUses;
use crate::uncertainty::Bands;
use serde::Serialize;
use std::collections::BTreeMap;
use std::fs;
use trepan_bone::Piece;
use trepan_contact::GuardCounters;
use trepan_patient::Plan;
use trepan_patient::PlanComparison;
use trepan_runtime::{Outcome, Quantiles, Replayed, SolverOutcome};
use trepan_stages::alarms::REAL_TIME;
use trepan_stages::by_cause;
use trepan_stages::notice::{Notice, What};
use trepan_stages::score::ScoreKeeper;
use trepan_stages::second_hand::SecondOutcome;
use trepan_stages::{Bleeding, DuraState};

/// The whole file.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Summary {
    /// Name of the program.
    pub app: String,
    /// Its version.
    pub version: String,
    /// When the session began, UTC as in RFC 3339.
    pub date: String,
    /// Session time of the last tick, s.
    pub length_s: f64,
    /// Hashes of the case and of its images, by name.
    pub hashes: BTreeMap<String, String>,
    /// Where the skull was to be opened.
    pub opening: Opening,
    /// Name of the case, without the patient's name.
    pub case: String,
    /// Who operated; `null` if that was not said.
    pub person: Option<String>,
    /// Name of the lesson; `null` without one.
    pub lesson: Option<String>,
    /// Name of the session; `null` without one.
    pub name: Option<String>,
    /// Name of the device.
    pub device: String,
    /// Models that ran, and why they were chosen.
    pub models: ModelSummary,
    /// Starts of the phases.
    pub phases: Vec<PhaseStart>,
    /// Times at which a stroke came through the bone, s of session time, undone strokes included.
    pub through_s: Vec<f64>,
    /// Haptic ticks run.
    pub ticks: u64,
    /// Measured rate of the haptic loop, Hz.
    pub rate_hz: f64,
    /// Requested rate of the haptic loop, Hz.
    pub asked_hz: f64,
    /// Ticks that missed their deadline.
    pub late_ticks: u64,
    /// Ticks that used a stale collision result.
    pub held_ticks: u64,
    /// Compute time of a tick, µs.
    pub tick_us: Quantiles,
    /// The solver of soft tissue; `null` without.
    pub solver: Option<SolverSummary>,
    /// Forces on the hand, N; those of the task are in the scores.
    pub hand_force_n: HandForces,
    /// Newtons at the hand per newton of the task, on bone.
    pub hand_force_scale: f32,
    /// Bone removed, mm³.
    pub bone_removed_mm3: f64,
    /// What an aspirator took; `null` if nothing.
    pub resection: Option<Resection>,
    /// Area of brain that scissors cut, mm².
    pub brain_cut_mm2: f64,
    /// How the wound bled; `null` if it did not.
    pub bleeding: Option<Bleeding>,
    /// What was done to the dura; `null` where it is not to be incised.
    pub dura: Option<DuraState>,
    /// Voxels of `removed-label.nii.gz`; `null` without bone.
    pub removed_label: Option<RemovedLabel>,
    /// Pieces of bone cut off the skull, such as a flap, at the end.
    pub cut_off: CutOff,
    /// Warnings raised.
    pub warnings: Vec<Raised>,
    /// Scores.
    pub scores: ScoreKeeper,
    /// What the spread of the physical constants leaves open.
    pub bands: Bands,
    /// Comparison of the removed bone with the plan; `null` without bone.
    pub plan: Option<PlanComparison>,
    /// Regions of the brain that were pressed, largest impulse first.
    pub regions: Vec<Region>,
    /// How the tools for the brain were used.
    pub tool_use: ToolUses,
    /// Ticks in which the force guard acted, by cause.
    #[serde(serialize_with = "by_cause")]
    pub guard: GuardCounters,
    /// The second hand; `null` without.
    pub second: Option<SecondSummary>,
    /// Pictures rendered.
    pub frames: u64,
    /// Pictures per second while rendering.
    pub fps: f64,
    /// Pictures of the window while something moved; `null` without.
    pub moving: Option<MovingSummary>,
    /// Comparison with the recording, in a replay.
    pub replay: Option<Replayed>,
    /// Records that did not fit into the ring buffers.
    pub dropped_records: u64,
    /// Remarks on the case, the machine and the run.
    pub remarks: Vec<String>,
    /// The machine.
    pub machine: Machine,
}

/// The planned opening.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct Opening {
    /// Point on the outer table, RAS mm.
    pub entry_mm: [f32; 3],
    /// Unit direction into the head.
    pub inward: [f32; 3],
    /// Thickness of the bone in that direction, mm.
    pub bone_mm: f32,
    /// Radius of the planned hole, mm.
    pub hole_mm: f32,
    /// Radius around the entry that holds the planned flap, mm; 0 without one.
    pub flap_mm: f32,
}

impl Opening {
    /// The opening of a plan.
    pub fn of(plan: &Plan) -> Self {
        let Plan { site, hole_mm, flap_mm, .. } = plan;
        let (entry_mm, inward) = (site.entry.to_array(), site.inward.to_array());
        Self { entry_mm, inward, bone_mm: site.bone_mm, hole_mm: *hole_mm, flap_mm: *flap_mm }
    }
}

/// The label map of the removed bone: voxels of the CT of which half or more is gone.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct RemovedLabel {
    /// Number of voxels.
    pub voxels: usize,
    /// Their volume, mm³; it differs from that of the bone removed by the voxels of the rim.
    pub label_mm3: f64,
}

/// What an aspirator took.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Resection {
    /// Share of the tumour that is gone, 0 to 1; 0 without a tumour.
    pub tumour_share: f64,
    /// Volume of other tissue that is gone, mm³.
    pub healthy_mm3: f64,
    /// The tissue classes of which something is gone, by name.
    pub tissues: BTreeMap<String, Resected>,
}

/// What an aspirator took of a tissue class.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Resected {
    /// Volume taken, mm³.
    pub taken_mm3: f64,
    /// Volume left, mm³.
    pub left_mm3: f64,
}

/// Pictures of the window while something moved.
#[derive(Clone, Debug, Serialize)]
pub struct MovingSummary {
    /// Number of pictures.
    pub frames: u64,
    /// Time from one picture to the next, µs.
    pub interval_us: Quantiles,
    /// Mean fraction of the 3-D view's pixels along an edge, 0 to 1.
    pub mean_detail: f64,
}

/// A phase and when it began.
#[derive(Clone, Debug, Serialize)]
pub struct PhaseStart {
    /// Name of the phase.
    pub name: String,
    /// Session time, s.
    pub from_s: f64,
}

/// A warning and when it was raised.
#[derive(Clone, Debug, Serialize)]
pub struct Raised {
    /// Session time, s.
    pub time_s: f64,
    /// Name of the warning.
    pub name: String,
    /// Text shown to the trainee.
    pub text: String,
}

/// Pieces of bone that are no longer connected to the skull.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct CutOff {
    /// Number of pieces of at least 1 mm³.
    pub pieces: usize,
    /// Volume of the largest piece, mm³.
    pub largest_mm3: f64,
}

impl CutOff {
    /// Adds the pieces that notices say were lifted and not put back: they are no longer there to
    /// be found.
    fn with_lifted(self, notices: &[Notice]) -> Self {
        let mut lifted: Vec<f64> = Vec::new();
        for notice in notices {
            match notice.what {
                What::FlapLifted(mm3) => lifted.push(mm3.into()),
                What::FlapReturned => _ = lifted.pop(),
                _ => {}
            }
        }
        let largest_mm3 = lifted.iter().copied().fold(self.largest_mm3, f64::max);
        Self { pieces: self.pieces + lifted.len(), largest_mm3 }
    }

    /// Compares the pieces before and now; `voxel_mm3` is the volume of a voxel.
    pub fn of(before: &[Piece], now: &[Piece], voxel_mm3: f32) -> Self {
        let mm3 = |piece: &Piece| piece.voxels as f64 * f64::from(voxel_mm3);
        let large: Vec<f64> = Piece::cut_off(before, now).iter().map(mm3).filter(|&mm3| mm3 >= 1.0).collect();
        Self { pieces: large.len(), largest_mm3: large.iter().copied().fold(0.0, f64::max) }
    }
}

/// Results of the solver.
#[derive(Clone, Debug, Default, Serialize)]
pub struct SolverSummary {
    /// Name of the solver.
    pub name: String,
    /// Number of tetrahedra.
    pub tets: usize,
    /// Number of nodes.
    pub nodes: usize,
    /// Number of fixed nodes.
    pub fixed_nodes: usize,
    /// Results of its loop.
    #[serde(flatten)]
    pub outcome: SolverOutcome,
}

/// Forces on the hand.
#[derive(Clone, Debug, Default, Serialize)]
pub struct HandForces {
    /// Largest force, N.
    pub max: f32,
    /// Largest change between two ticks, N.
    pub max_step: f32,
    /// Force after the last tick, N.
    pub end: f32,
}

/// Results of the second hand.
#[derive(Clone, Debug, Default, Serialize)]
pub struct SecondSummary {
    /// Name of its device.
    pub device: String,
    /// Results of its loop.
    #[serde(flatten)]
    pub outcome: SecondOutcome,
}

/// The machine that the session ran on.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Machine {
    /// Processor.
    pub cpu: String,
    /// Logical cores.
    pub cores: usize,
    /// Operating system and architecture.
    pub system: String,
    /// Graphics adapter, if pictures were rendered.
    pub graphics: Option<String>,
    /// Build profile: `release` or `dev`.
    pub profile: String,
}

impl Machine {
    /// Describes this machine.
    pub fn here(graphics: Option<String>) -> Self {
        let cpuinfo = fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
        let cpu = cpuinfo
            .lines()
            .find_map(|line| line.strip_prefix("model name")?.split_once(':'))
            .map(|(_, name)| name.trim());
        Self {
            cpu: cpu.unwrap_or("unknown").into(),
            cores: std::thread::available_parallelism().map_or(1, usize::from),
            system: format!("{} {}", std::env::consts::OS, std::env::consts::ARCH),
            graphics,
            profile: if cfg!(debug_assertions) { "dev" } else { "release" }.into(),
        }
    }
}

impl Summary {
    /// Adds the outcome at the end of a session: all that the loops measured. The remarks of both
    /// are joined.
    pub fn with(self, outcome: &Outcome) -> Self {
        let rate_hz = outcome.ticks.count as f64 / outcome.seconds.max(1e-9);
        let slow = outcome.replayed.is_none().then(|| slow(rate_hz, self.asked_hz)).flatten();
        let behind = outcome
            .solver
            .iter()
            .filter(|_| outcome.replayed.is_none())
            .filter_map(|solver| behind(solver.real_time_factor));
        let solver_faults = outcome.solver.iter().flat_map(|solver| solver.solver_faults.remarks());
        let wound = outcome.solver.as_ref().map(|solver| &solver.wound);
        let remarks = slow.into_iter().chain(behind).chain(self.remarks).chain(outcome.remarks.iter().cloned());
        Self {
            phases: phases(outcome),
            through_s: through_s(outcome),
            ticks: outcome.ticks.count,
            rate_hz,
            late_ticks: outcome.ticks.late,
            held_ticks: outcome.ticks.held,
            tick_us: (&outcome.ticks.times).into(),
            solver: outcome.solver.clone().map(|outcome| SolverSummary { outcome, ..self.solver.unwrap_or_default() }),
            hand_force_n: HandForces {
                max: outcome.scores.hand_peak_force_n,
                max_step: outcome.scores.hand_peak_force_step_n,
                end: outcome.end_force_n,
            },
            hand_force_scale: outcome.force_scale,
            bone_removed_mm3: outcome.scores.bone_removed_mm3,
            brain_cut_mm2: wound.map_or(0.0, |wound| wound.cut_mm2),
            bleeding: wound.map(|wound| wound.bleeding.clone()).filter(|b| b.bled_ml > 0.0),
            dura: wound.map(|wound| wound.dura.clone()).filter(|dura| !dura.places.is_empty()),
            cut_off: self.cut_off.with_lifted(&outcome.written.notices),
            warnings: warnings(outcome),
            scores: outcome.scores,
            bands: Bands::of(&outcome.scores, outcome.force_scale),
            guard: outcome.guard,
            second: outcome.second.map(|outcome| SecondSummary { outcome, ..self.second.unwrap_or_default() }),
            replay: outcome.replayed.clone(),
            dropped_records: outcome.written.dropped,
            remarks: remarks.chain(solver_faults).collect(),
            ..self
        }
    }
}

/// Returns the pictures per second of drawing; 0 without pictures.
pub fn fps(frames: u64, drawn_s: f64) -> f64 {
    if frames > 0 { frames as f64 / drawn_s.max(1e-3) } else { 0.0 }
}

/// Share of the requested rate under which a session counts as slow.
const FULL_RATE: f64 = 0.995;

/// Returns a remark where the haptic rate was lower than requested.
pub fn slow(rate_hz: f64, asked_hz: f64) -> Option<String> {
    (rate_hz < FULL_RATE * asked_hz).then(|| {
        format!(
            "SLOW: {rate_hz:.1} of {asked_hz:.0} ticks a second, forces came late: do not compare them; close programs, \
             or lower --rate-hz"
        )
    })
}

/// Returns a remark where the brain was slower than real time.
pub fn behind(real_time_factor: f64) -> Option<String> {
    (real_time_factor < f64::from(REAL_TIME)).then(|| {
        format!(
            "SLOW: the brain moved at {real_time_factor:.2} of real time and felt wrong: do not compare its forces; close \
             programs, or take a lower --quality"
        )
    })
}

fn phases(outcome: &Outcome) -> Vec<PhaseStart> {
    let start = |notice: &Notice| match notice.what {
        What::Phase(phase) => Some(PhaseStart { name: phase.name().into(), from_s: notice.time_ms * 1e-3 }),
        _ => None,
    };
    outcome.written.notices.iter().filter_map(start).collect()
}

fn through_s(outcome: &Outcome) -> Vec<f64> {
    let through = outcome.written.notices.iter().filter(|notice| notice.what == What::Through);
    through.map(|notice| notice.time_ms * 1e-3).collect()
}

fn warnings(outcome: &Outcome) -> Vec<Raised> {
    let raised = |notice: &Notice| match notice.what {
        What::Warning(warning, true, _) => {
            Some(Raised { time_s: notice.time_ms * 1e-3, name: warning.name().into(), text: notice.words().1 })
        }
        _ => None,
    };
    outcome.written.notices.iter().filter_map(raised).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn about() -> Summary {
        Summary { asked_hz: 1000.0, remarks: vec!["another".into()], ..Summary::default() }
    }

    #[test]
    fn a_slow_session_has_a_remark_and_a_replay_has_none() {
        let mut outcome = Outcome { seconds: 10.0, ..Outcome::default() };
        outcome.ticks.count = 9920;
        let live = about().with(&outcome);
        assert!(live.remarks.len() == 2 && live.remarks[0].contains("992.0"), "{:?}", live.remarks);
        outcome.replayed = Some(Replayed::default());
        assert_eq!(about().with(&outcome).remarks, ["another"]);
    }

    #[test]
    fn pictures_are_told_by_the_second_of_drawing_not_of_the_session() {
        assert_eq!([fps(300, 10.0), fps(0, 0.0)], [30.0, 0.0]);
    }

    #[test]
    fn each_stroke_that_came_through_has_its_time() {
        let notice = |time_ms: f64, what| Notice { tick: 1, time_ms, what };
        let mut outcome = Outcome::default();
        let notices =
            [(10.0, What::Undone(1.0)), (1500.0, What::Through), (1600.0, What::NotOpen), (2500.0, What::Through)];
        outcome.written.notices = notices.map(|(time_ms, what)| notice(time_ms, what)).into();
        assert_eq!(through_s(&outcome), [1.5, 2.5]);
    }

    #[test]
    fn a_lifted_flap_counts_as_cut_off_until_it_is_put_back() {
        let notice = |what| Notice { tick: 1, time_ms: 0.0, what };
        let other = CutOff { pieces: 1, largest_mm3: 20.0 };
        let lifted = [What::FlapFree(800.0), What::FlapLifted(800.0)].map(notice);
        assert_eq!(other.with_lifted(&lifted), CutOff { pieces: 2, largest_mm3: 800.0 });
        let back = [What::FlapLifted(800.0), What::FlapReturned].map(notice);
        assert_eq!(other.with_lifted(&back), other);
    }

    #[test]
    fn a_rate_under_199_of_200_gives_a_remark() {
        let notices = slow(992.0, 1000.0).expect("992 Hz are too few");
        assert!(notices.contains("992.0") && notices.contains("1000") && notices.contains("--rate-hz"), "{notices}");
        assert_eq!((slow(995.1, 1000.0), slow(1000.2, 1000.0), slow(498.0, 500.0)), (None, None, None));
    }
}
