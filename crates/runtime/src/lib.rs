//! Runs the stages of a session on threads, or replays them from a recording, bit for bit.
//!
//! # Theory
//! Three loops exchange their newest values without waiting: haptic tick, collision step, solver
//! step. [`threads`] gives each stage its thread and its clock; [`lockstep`] gives the same stages
//! what a recording holds, in the recorded order, on one thread.
//!
//! # Practice
//! [`Run`] is what both need, [`Outcome`] what both return. A journal records every tick from a
//! thread of its own, a [film] what a window needs to play the session in both directions. A
//! [watcher](watch) is a session whose device is another session's hand; a [teacher](lesson) sends
//! requests back.
//!
//! # When not to use it
//! To step one stage in your own loop: use `trepan-stages`.

pub mod clock;
pub mod film;
pub mod joining;
mod journal;
pub mod lesson;
pub mod lockstep;
pub mod stop;
pub mod threads;
pub mod watch;

pub use watch::WatchError;

use crate::film::{Filming, Shot};
use crate::journal::Written;
use crate::stop::Stop;
use crate::watch::{Share, Watching};
use hdrhistogram::Histogram;
use serde::{Serialize, Serializer};
use std::sync::mpsc::Receiver;
use trepan_contact::{GuardCounters, NodalContacts, SurfacePatch};
use trepan_geometry::{Buttons, Tool, ToolState, Vec3};
use trepan_link::cell::{Reader, Writer, cell};
use trepan_link::wire::TickRecord;
use trepan_link::{Recorder, SceneWriter};
use trepan_mesh::Split;
use trepan_soft::Loads;
use trepan_stages::collision_step::{CollisionStage, SoftFrame, Wound};
use trepan_stages::flap::FlapPlace;
use trepan_stages::force_scale::ForceScale;
use trepan_stages::haptic_tick::{HapticStage, Tick, ToolSample};
use trepan_stages::haptic_tick::{SecondTool, is_held_by_arms};
use trepan_stages::notice::{Notice, What};
use trepan_stages::program::Program;
use trepan_stages::score::ScoreKeeper;
use trepan_stages::second_hand::{SecondHand, SecondOutcome, SecondView};
use trepan_stages::solver_step::{SolverFaults, SolverStage};

/// What a live session and a replay need.
pub struct Run<'a> {
    /// Bodies of the loops.
    pub stages: Stages,
    /// The tool before the first tick.
    pub start: ToolSample,
    /// Destination of the records.
    pub recorder: Recorder,
    /// Publishes the records, where the session is shared.
    pub share: Option<Share>,
    /// The session that is watched: its wound is taken over first.
    pub watching: Option<Watching>,
    /// Film of a live session, and the file that it goes to.
    pub scene: Option<(Filming, SceneWriter)>,
    /// Ends the session.
    pub stop: &'a Stop,
}

/// Bodies of the three loops.
pub struct Stages {
    /// The haptic tick of the first hand.
    pub haptic: HapticStage,
    /// The haptic tick of the second hand, if there is one.
    pub second: Option<SecondHand>,
    /// Collision and solver, where the brain deforms.
    pub tissue: Option<Tissue>,
}

/// Bodies of the two loops of soft tissue.
pub struct Tissue {
    /// Collision of tool and tissue.
    pub collision: CollisionStage,
    /// Deformation of the tissue.
    pub solver: SolverStage,
}

/// State of the session as it is rendered.
#[derive(Clone, Copy, Debug)]
pub struct View {
    /// Tool and phase.
    pub sample: ToolSample,
    /// Session time, ms.
    pub time_ms: f64,
    /// Force on the hand, N.
    pub force: Vec3,
    /// Largest force that the guard lets through, N.
    pub force_limit_n: f32,
    /// Force of the task, N.
    pub task_n: f32,
    /// Newtons at the hand per newton of the task, on bone.
    pub force_scale: ForceScale,
    /// The second hand, if there is one.
    pub second: Option<SecondView>,
    /// Depth in bone and tissue, mm.
    pub depth_mm: [f32; 2],
    /// Distance from the tool's ball to the brain at rest, mm.
    pub brain_distance_mm: f32,
    /// Active warnings, bits.
    pub warnings: u32,
    /// Newest notice that is not a warning.
    pub news: Option<Notice>,
    /// Speed of the spindle over its free speed.
    pub spindle: f32,
    /// Bone removed so far, mm³.
    pub removed_mm3: f64,
    /// Whether the bone is open, or need not be: only then a tool for the brain can be taken.
    pub bone_open: bool,
    /// Where the planned flap is.
    pub flap: FlapPlace,
    /// Longest time that the tool rested on tissue so far, s.
    pub hold_s: f64,
    /// Numbers of ticks, late ticks and ticks with a stale patch.
    pub counts: [u64; 3],
    /// Whether the operation is over.
    pub finished: bool,
}

impl View {
    /// View before the first tick; the guard's force limit is in N.
    pub fn at(sample: ToolSample, force_limit_n: f32) -> Self {
        Self {
            sample,
            time_ms: 0.0,
            force: Vec3::ZERO,
            force_limit_n,
            task_n: 0.0,
            force_scale: ForceScale(1.0),
            second: None,
            depth_mm: [0.0; 2],
            brain_distance_mm: f32::INFINITY,
            warnings: 0,
            news: None,
            spindle: 0.0,
            removed_mm3: 0.0,
            bone_open: true,
            flap: FlapPlace::default(),
            hold_s: 0.0,
            counts: [0; 3],
            finished: false,
        }
    }
}

impl View {
    /// The same view at a recorded tick: pose, tool, forces, depths.
    pub fn on(self, record: &TickRecord, program: Program) -> Self {
        let &TickRecord { tick, proxy, twist, buttons, time_ms, tool: slot, .. } = record;
        let state = ToolState { world_from_tool: proxy, twist, buttons: Buttons(buttons), time_ms };
        let tray = program.tray();
        let slot = usize::from(slot).min(tray.len() - 1);
        let drilling = record.has(TickRecord::DRILLING);
        Self {
            sample: ToolSample { tick, state, tool: tray[slot], slot, drilling, second: None, idle: false },
            time_ms,
            force: record.wrench.force,
            task_n: self.force_scale.task_n(record),
            depth_mm: [record.depth_mm, record.tissue_depth_mm],
            brain_distance_mm: record.brain_distance_mm,
            ..self
        }
    }
}

/// What an arm holds from some times on, ms, by recorded ticks; its force is not recorded, and NaN.
pub fn arms(ticks: &[TickRecord], tray: &[Tool]) -> Vec<(f64, Option<SecondView>)> {
    let asks = |tick: &TickRecord| Buttons(tick.buttons).has(Buttons::ARM);
    let mut found: Vec<(f64, Option<SecondView>)> = Vec::new();
    for pair in ticks.windows(2).filter(|pair| asks(&pair[1]) && !asks(&pair[0])) {
        let tool = tray.get(usize::from(pair[0].tool)).filter(|tool| is_held_by_arms(tool.kind));
        let is_held = found.last().is_some_and(|(_, held)| held.is_some());
        let (world_from_tool, force) = (pair[0].proxy, Vec3::NAN);
        let held = tool.filter(|_| !is_held).map(|tool| SecondView { tool: *tool, world_from_tool, force });
        found.extend((is_held || held.is_some()).then_some((pair[1].time_ms, held)));
    }
    found
}

/// Read ends for rendering.
pub struct RenderInputs {
    /// Newest tick.
    pub view: Reader<View>,
    /// Newest state of the brain, where it deforms.
    pub soft: Option<Reader<SoftFrame>>,
    /// How the wound bleeds now, and how the dura lies.
    pub wound: Option<Reader<Wound>>,
    /// Film of a replay in a window.
    pub film: Option<Receiver<Shot>>,
}

/// Surface patches of the first hand's tool, and of the second's or an arm's.
pub type Patches = [SurfacePatch; 2];

/// A collision result with its sequence number.
pub type Numbered<T> = (u64, T);

/// Write and read ends of every cell between the loops.
pub struct Cells {
    /// Haptic loop to collision loop.
    pub tool: (Writer<ToolSample>, Reader<ToolSample>),
    /// Haptic loop to rendering.
    pub view: (Writer<View>, Reader<View>),
    /// Collision loop to haptic loop.
    pub patch: (Writer<Numbered<Patches>>, Reader<Numbered<Patches>>),
    /// Collision loop to solver loop.
    pub loads: (Writer<Numbered<Loads>>, Reader<Numbered<Loads>>),
    /// Solver loop to collision loop.
    pub soft: (Writer<SoftFrame>, Reader<SoftFrame>),
    /// Solver loop to rendering.
    pub shown: (Writer<SoftFrame>, Reader<SoftFrame>),
    /// Collision loop to rendering.
    pub wound: (Writer<Wound>, Reader<Wound>),
    /// Haptic loop to the film.
    pub filmed: (Writer<View>, Reader<View>),
    /// Solver loop to the film.
    pub filmed_soft: (Writer<SoftFrame>, Reader<SoftFrame>),
}

impl Cells {
    /// Makes all cells with the state at the start of the session.
    pub fn new(stages: &Stages, sample: ToolSample) -> Self {
        let mut frame = SoftFrame::default();
        if let Some(tissue) = &stages.tissue {
            tissue.solver.publish(&mut frame);
        }
        let loads = Loads { contacts: NodalContacts::with_room(), fills: frame.fills.clone(), ..Loads::default() };
        let wound = stages.tissue.as_ref().map(|tissue| tissue.collision.wound().clone()).unwrap_or_default();
        let view = View::at(sample, stages.haptic.guard().config().max_force_n);
        Self {
            tool: cell(sample),
            view: cell(view),
            patch: cell((0, Patches::default())),
            loads: cell((0, loads)),
            soft: cell(frame.clone()),
            wound: cell(wound),
            filmed: cell(view),
            filmed_soft: cell(frame.clone()),
            shown: cell(frame),
        }
    }
}

/// Histogram of the compute times of one kind of step, ns. Adding does not allocate; times over 1 s
/// count as 1 s.
#[derive(Clone, Debug)]
pub struct Times(Histogram<u64>);

impl Default for Times {
    fn default() -> Self {
        Self(Histogram::new_with_bounds(1, 1_000_000_000, 3).expect("fixed bounds are valid"))
    }
}

impl Serialize for Times {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        Quantiles::from(self).serialize(to)
    }
}

impl Times {
    /// Adds a duration in µs.
    pub fn add_us(&mut self, us: f32) {
        self.0.saturating_record((f64::from(us) * 1e3).max(1.0) as u64);
    }

    /// Returns a quantile, µs; 0 without samples.
    pub fn quantile_us(&self, quantile: f64) -> f64 {
        if self.0.is_empty() { 0.0 } else { self.0.value_at_quantile(quantile) as f64 * 1e-3 }
    }

    /// Returns the largest time, µs.
    pub fn max_us(&self) -> f64 {
        self.0.max() as f64 * 1e-3
    }

    /// Returns the counts in bins of a tenth of a decade, as (upper edge in µs, count), for a
    /// chart.
    pub fn bins(&self) -> Vec<(f64, u64)> {
        self.0
            .iter_log(10, 10f64.powf(0.1))
            .map(|v| (v.value_iterated_to() as f64 * 1e-3, v.count_since_last_iteration()))
            .collect()
    }
}

/// Quantiles of a time, µs.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Quantiles {
    /// Median.
    pub p50: f64,
    /// 99 % quantile.
    pub p99: f64,
    /// 99.9 % quantile.
    pub p999: f64,
    /// Largest value.
    pub max: f64,
}

impl From<&Times> for Quantiles {
    fn from(times: &Times) -> Self {
        let [p50, p99, p999] = [0.5, 0.99, 0.999].map(|q| times.quantile_us(q));
        Self { p50, p99, p999, max: times.max_us() }
    }
}

/// Counts and times of the haptic loop.
#[derive(Clone, Debug, Default)]
pub struct Ticks {
    /// Ticks run.
    pub count: u64,
    /// Ticks that missed their deadline.
    pub late: u64,
    /// Ticks that used a stale collision result.
    pub held: u64,
    /// Compute time.
    pub times: Times,
    /// Newest notice that is not a warning.
    pub news: Option<Notice>,
}

impl Ticks {
    /// Keeps a notice as the newest, unless it is a warning.
    pub fn record(&mut self, notice: Notice) {
        if !matches!(notice.what, What::Warning(..)) {
            self.news = Some(notice);
        }
    }

    /// Counts one tick.
    pub fn add(&mut self, tick: &Tick) {
        self.count += 1;
        self.late += u64::from(tick.record.has(TickRecord::LATE));
        self.held += u64::from(tick.record.has(TickRecord::HELD));
        self.times.add_us(tick.record.compute_us);
    }

    /// Returns the view after a tick, with the second hand, or an arm by the force of its patch.
    pub fn view(
        &self,
        tick: &Tick,
        stage: &HapticStage,
        (second, patches): (Option<SecondView>, &Patches),
        finished: bool,
    ) -> View {
        let on_arm = patches[1].force_n * patches[1].normal;
        let view =
            |SecondTool { tool, state, .. }| SecondView { tool, world_from_tool: state.world_from_tool, force: on_arm };
        let second = second.or(tick.sample.second.map(view));
        View {
            sample: tick.sample,
            time_ms: tick.record.time_ms,
            force: tick.wrench.force(),
            force_limit_n: stage.guard().config().max_force_n,
            task_n: stage.force_scale().task_n(&tick.record),
            force_scale: stage.force_scale(),
            second,
            depth_mm: [tick.record.depth_mm, tick.record.tissue_depth_mm],
            brain_distance_mm: tick.record.brain_distance_mm,
            warnings: tick.warnings,
            news: self.news,
            spindle: stage.spindle_share(&tick.record),
            removed_mm3: stage.scores().bone_removed_mm3,
            bone_open: stage.is_open(),
            flap: stage.flap_place(),
            hold_s: stage.scores().longest_hold_s,
            counts: [self.count, self.late, self.held],
            finished,
        }
    }
}

/// Outcome of the solver loop, as in `summary.json`.
#[derive(Clone, Debug, Default, Serialize)]
pub struct SolverOutcome {
    /// Length of a step, ms.
    pub dt_ms: f32,
    /// Compute time of a step.
    #[serde(rename = "step_us")]
    pub times: Times,
    /// Compute time of a collision step.
    #[serde(rename = "collision_us")]
    pub collision_times: Times,
    /// Simulated time over wall time.
    pub real_time_factor: f64,
    /// Largest displacement of a node, mm.
    pub max_displacement_mm: f32,
    /// Largest displacement of a node at the end, mm.
    pub end_displacement_mm: f32,
    /// Faults of the solver, summed over steps.
    #[serde(flatten)]
    pub solver_faults: SolverFaults,
    /// What is left of each tetrahedron, of 65535; empty where nothing could be resected.
    #[serde(skip)]
    pub fills: Vec<u16>,
    /// Splits of nodes by cuts.
    #[serde(skip)]
    pub splits: Vec<Split>,
    /// The wound at the end.
    #[serde(skip)]
    pub wound: Wound,
}

impl SolverOutcome {
    /// Returns the part of the outcome that a solver stage knows itself.
    pub fn of(stage: &SolverStage) -> Self {
        Self {
            dt_ms: stage.mean_dt_ms(),
            max_displacement_mm: stage.max_displacement_mm(),
            end_displacement_mm: stage.displacement_mm(),
            solver_faults: *stage.solver_faults(),
            fills: stage.fills().to_vec(),
            splits: stage.splits().to_vec(),
            ..Self::default()
        }
    }
}

/// Comparison of a replay with its recording.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Replayed {
    /// Ticks replayed.
    pub ticks: u64,
    /// Ticks of the session, as far as its recording shows; more than `ticks` where some are lost
    /// or the replay ended early.
    pub recorded: u64,
    /// What the recording lacks of its session; `null` if it is whole.
    pub losses: Option<String>,
    /// Ticks with forces equal bit for bit, in both hands where there are two.
    pub identical: u64,
    /// Largest difference in force, N.
    pub max_difference_n: f32,
}

impl Replayed {
    /// Describes the agreement of replay and recording in a line.
    pub fn describe(&self) -> String {
        let Self { ticks, recorded, losses, identical, max_difference_n } = self;
        let more = if losses.is_some() { "at least " } else { "" };
        let part = match ticks < recorded || losses.is_some() {
            true => format!("a part only, {ticks} of {more}{recorded} ticks; in this part "),
            false => String::new(),
        };
        format!(
            "{part}{identical} of {ticks} ticks gave the same force, bit for bit; largest difference {max_difference_n:.6} N"
        )
    }
}

/// Outcome of a live session or a replay.
#[derive(Debug, Default)]
pub struct Outcome {
    /// Counts and times of the haptic loop.
    pub ticks: Ticks,
    /// Length of the run, s of session time.
    pub seconds: f64,
    /// The solver loop, where the brain deforms.
    pub solver: Option<SolverOutcome>,
    /// Scores.
    pub scores: ScoreKeeper,
    /// Ticks in which the force guard acted, by cause.
    pub guard: GuardCounters,
    /// Force limit of the guard, N.
    pub force_limit_n: f32,
    /// Newtons at the hand per newton of the task, on bone; 0 before a run.
    pub force_scale: f32,
    /// Force after the last tick, N; zero after a clean end.
    pub end_force_n: f32,
    /// The second hand, if there is one.
    pub second: Option<SecondOutcome>,
    /// Result of the recording thread.
    pub written: Written,
    /// Comparison with the recording, in a replay.
    pub replayed: Option<Replayed>,
    /// Remarks on the run: missing real-time priority, a loop that panicked.
    pub remarks: Vec<String>,
}

impl Outcome {
    /// Returns the part of the outcome that the stages know themselves.
    pub fn of(stage: &HapticStage, second: Option<&SecondHand>) -> Self {
        Self {
            scores: *stage.scores(),
            guard: stage.guard().counters(),
            force_limit_n: stage.guard().config().max_force_n,
            force_scale: stage.force_scale().0,
            second: second.map(SecondHand::outcome),
            ..Self::default()
        }
    }
}

/// The examples of the README compile.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
