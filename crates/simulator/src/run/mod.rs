//! What both ways of running share: the stages, what the picture sees, what is known at the end.
//!
//! A session runs live on threads ([`crate::run::threads`]) or again from a recording, step by step
//! ([`crate::run::lockstep`]).

pub(crate) mod clock;
pub(crate) mod film;
pub(crate) mod journal;
pub(crate) mod lesson;
pub mod lockstep;
pub(crate) mod stop;
pub mod threads;
pub(crate) mod watch;

use crate::run::film::Shot;
use crate::run::journal::Written;
use crate::stages::collision_step::{CollisionStage, SoftFrame};
use crate::stages::haptic_tick::{HapticStage, Tick, ToolSample};
use crate::stages::notice::{Notice, What};
use crate::stages::score::ScoreKeeper;
use crate::stages::second_hand::{SecondHand, SecondOutcome, SecondView};
use crate::stages::solver_step::{SolverFaults, SolverStage};
use hdrhistogram::Histogram;
use std::sync::mpsc::Receiver;
use trepan_contact::{GuardCounters, NodalContacts, SurfacePatch};
use trepan_geometry::Vec3;
use trepan_link::cell::{Reader, Writer, cell};
use trepan_soft::Loads;

/// The three loops' bodies.
pub struct Stages {
    /// Always there.
    pub haptic: HapticStage,
    /// Where both hands hold something.
    pub second: Option<SecondHand>,
    /// Where the brain deforms.
    pub tissue: Option<Tissue>,
}

/// The two loops of soft tissue.
pub struct Tissue {
    /// Tool against tissue.
    pub collision: CollisionStage,
    /// Tissue against itself.
    pub solver: SolverStage,
}

/// The session as the picture sees it.
#[derive(Clone, Copy, Debug)]
pub struct View {
    /// Tool and phase.
    pub sample: ToolSample,
    /// Session time, ms.
    pub time_ms: f64,
    /// Force on the hand, N.
    pub force: Vec3,
    /// The longest force that the guard lets through, N.
    pub force_limit_n: f32,
    /// The second hand, where there is one.
    pub second: Option<SecondView>,
    /// Depth in bone and tissue, mm.
    pub depth_mm: [f32; 2],
    /// From the tool's ball to the brain at rest, mm.
    pub brain_distance_mm: f32,
    /// Standing warnings, bits.
    pub warnings: u32,
    /// The newest thing that happened beside the warnings.
    pub news: Option<Notice>,
    /// Speed of the spindle, 1 at its free speed.
    pub spindle: f32,
    /// Bone removed so far, mm³.
    pub removed_mm3: f64,
    /// Ticks, late ticks, held ticks so far.
    pub counts: [u64; 3],
    /// Whether the operation is over.
    pub finished: bool,
}

impl View {
    /// Before the first tick, under a guard that lets this much force through, N.
    pub fn at(sample: ToolSample, force_limit_n: f32) -> Self {
        Self {
            sample,
            time_ms: 0.0,
            force: Vec3::ZERO,
            force_limit_n,
            second: None,
            depth_mm: [0.0; 2],
            brain_distance_mm: f32::INFINITY,
            warnings: 0,
            news: None,
            spindle: 0.0,
            removed_mm3: 0.0,
            counts: [0; 3],
            finished: false,
        }
    }
}

/// Read ends for the picture.
pub struct RenderInputs {
    /// Newest tick.
    pub view: Reader<View>,
    /// Newest brain, where there is one.
    pub soft: Option<Reader<SoftFrame>>,
    /// A recording's film, where it is filmed.
    pub film: Option<Receiver<Shot>>,
}

/// A collision result under its number.
pub type Numbered<T> = (u64, T);

/// Write and read ends of every cell between the loops.
pub struct Cells {
    /// Haptic loop to collision loop.
    pub tool: (Writer<ToolSample>, Reader<ToolSample>),
    /// Haptic loop to picture.
    pub view: (Writer<View>, Reader<View>),
    /// Collision loop to haptic loop.
    pub patch: (Writer<Numbered<SurfacePatch>>, Reader<Numbered<SurfacePatch>>),
    /// Collision loop to solver loop.
    pub loads: (Writer<Numbered<Loads>>, Reader<Numbered<Loads>>),
    /// Solver loop to collision loop.
    pub soft: (Writer<SoftFrame>, Reader<SoftFrame>),
    /// Solver loop to picture.
    pub shown: (Writer<SoftFrame>, Reader<SoftFrame>),
}

impl Cells {
    /// All cells, holding the start of the session.
    pub fn new(stages: &Stages, sample: ToolSample) -> Self {
        let mut frame = SoftFrame::default();
        if let Some(tissue) = &stages.tissue {
            tissue.solver.publish(&mut frame);
        }
        let view = View::at(sample, stages.haptic.guard().config().max_force_n);
        Self {
            tool: cell(sample),
            view: cell(view),
            patch: cell((0, SurfacePatch::default())),
            loads: cell((0, Loads { contacts: NodalContacts::with_room(), ..Loads::default() })),
            soft: cell(frame.clone()),
            shown: cell(frame),
        }
    }
}

/// Times of one kind of step, ns. Adding never allocates; what is over 1 s counts as 1 s.
#[derive(Clone, Debug)]
pub struct Times(Histogram<u64>);

impl Default for Times {
    fn default() -> Self {
        Self(Histogram::new_with_bounds(1, 1_000_000_000, 3).expect("fixed bounds are valid"))
    }
}

impl Times {
    /// Adds a duration in µs.
    pub fn add_us(&mut self, us: f32) {
        self.0.saturating_record((f64::from(us) * 1e3).max(1.0) as u64);
    }

    /// A quantile in µs; 0 when nothing was added.
    pub fn quantile_us(&self, quantile: f64) -> f64 {
        if self.0.is_empty() { 0.0 } else { self.0.value_at_quantile(quantile) as f64 * 1e-3 }
    }

    /// The largest, µs.
    pub fn max_us(&self) -> f64 {
        self.0.max() as f64 * 1e-3
    }

    /// Counts of times in bins of a tenth of a decade, as (lower edge in µs, count); for a chart.
    pub fn bins(&self) -> Vec<(f64, u64)> {
        self.0
            .iter_log(10, 10f64.powf(0.1))
            .map(|v| (v.value_iterated_to() as f64 * 1e-3, v.count_since_last_iteration()))
            .collect()
    }
}

/// Counts and times of the haptic loop.
#[derive(Clone, Debug, Default)]
pub struct Ticks {
    /// Ticks run.
    pub count: u64,
    /// Ticks that were not done by the next deadline.
    pub late: u64,
    /// Ticks that felt an old collision result.
    pub held: u64,
    /// Compute time.
    pub times: Times,
    /// The newest thing that happened beside the warnings.
    pub news: Option<Notice>,
}

impl Ticks {
    /// Takes note of something that happened.
    pub fn hear(&mut self, notice: Notice) {
        if !matches!(notice.what, What::Warning(..)) {
            self.news = Some(notice);
        }
    }

    /// Counts one tick.
    pub fn add(&mut self, tick: &Tick) {
        use trepan_link::wire::TickRecord;
        self.count += 1;
        self.late += u64::from(tick.record.has(TickRecord::LATE));
        self.held += u64::from(tick.record.has(TickRecord::HELD));
        self.times.add_us(tick.record.compute_us);
    }

    /// The view after a tick.
    pub fn view(&self, tick: &Tick, stage: &HapticStage, second: Option<SecondView>, finished: bool) -> View {
        View {
            sample: tick.sample,
            time_ms: tick.record.time_ms,
            force: tick.wrench.force(),
            force_limit_n: stage.guard().config().max_force_n,
            second,
            depth_mm: [tick.record.depth_mm, tick.record.tissue_depth_mm],
            brain_distance_mm: tick.record.brain_distance_mm,
            warnings: tick.warnings,
            news: self.news,
            spindle: stage.spindle_share(&tick.record),
            removed_mm3: stage.scores().bone_removed_mm3,
            counts: [self.count, self.late, self.held],
            finished,
        }
    }
}

/// How the solver fared.
#[derive(Clone, Debug, Default)]
pub struct SolverOutcome {
    /// Step, ms.
    pub dt_ms: f32,
    /// Steps done.
    pub steps: u64,
    /// Simulated time over the time that was to be simulated.
    pub real_time_factor: f64,
    /// Compute time of a step.
    pub times: Times,
    /// Compute time of a collision step.
    pub collision_times: Times,
    /// Largest displacement of a node, mm.
    pub max_displacement_mm: f32,
    /// Largest displacement left at the end, mm.
    pub end_displacement_mm: f32,
    /// What the solver had to put right.
    pub solver_faults: SolverFaults,
}

/// How a replay compares with its recording.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize)]
pub struct Replayed {
    /// Ticks run again.
    pub ticks: u64,
    /// Ticks that the session had, as far as its recording says: more where some are lost, or the
    /// replay was ended.
    pub recorded: u64,
    /// What the recording lacks of its session; `null` when nothing.
    pub losses: Option<String>,
    /// Ticks whose forces came out the same, bit for bit, in both hands where there were two.
    pub identical: u64,
    /// Largest difference of force, N.
    pub max_difference_n: f32,
}

impl Replayed {
    /// How far the replay is like its recording, in a line.
    pub fn told(&self) -> String {
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

/// All that is known at the end of a run.
#[derive(Debug, Default)]
pub struct Outcome {
    /// The haptic loop.
    pub ticks: Ticks,
    /// Length of the run, s of session time.
    pub seconds: f64,
    /// Soft tissue, where there was some.
    pub solver: Option<SolverOutcome>,
    /// Scores.
    pub scores: ScoreKeeper,
    /// What the force guard did.
    pub guard: GuardCounters,
    /// The longest force that it let through, N.
    pub force_limit_n: f32,
    /// Force at the very end, N: zero.
    pub end_force_n: f32,
    /// The second hand, where there was one.
    pub second: Option<SecondOutcome>,
    /// The recording.
    pub written: Written,
    /// PlanComparison which recording, in a replay.
    pub replayed: Option<Replayed>,
    /// What the operating system did not allow.
    pub remarks: Vec<String>,
}
