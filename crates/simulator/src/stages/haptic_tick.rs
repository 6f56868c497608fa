//! One haptic tick: a device's pose in, a guarded wrench and a record out.
//!
//! # Theory
//! ```text
//! device pose → bone contact (proxy, drilling) ─╮
//! newest surface patch → tissue depth ──────────┴→ force models → force guard → wrench
//! ```
//! The seven steps of rigid handling (thesis, 3.2 to 3.4) run inside [`RigidContact`]; tissue is felt through the tangent plane of
//! the last collision result at the tick's own pose, so that a slow collision thread costs sharpness, not stability. A patch
//! that grows old fades: full force up to [`FRESH_MS`], none after [`GONE_MS`].
//!
//! # Practice
//! The stage has no clock and no device: the same readings and patches give the same wrenches, bit for bit, live or in a
//! replay. A tick does not allocate, lock, log or panic.

use crate::program::{Phase, Program};
use crate::stages::drill::{BREAK_MM, Drill, THIN_MM, left_ahead_mm, spindle_rpm};
use crate::stages::notice::{Notice, Warning, Watch, What};
use crate::stages::score::ScoreKeeper;
use std::sync::Arc;
use trepan_contact::{ContactManifold, ForceGuard, ForceModel, GuardConfig, GuardedWrench, SurfacePatch};
use trepan_contact::{Vibration, Viscoelastic};
use trepan_geometry::{Buttons, Pose, Tool, ToolKind, ToolState, Vec3, Wrench};
use trepan_haptics::{Reading, Status};
use trepan_link::wire::TickRecord;
use trepan_rigid::{Method, RigidContact, RigidStep};
use trepan_volume::{BoneVolume, DistanceField};

/// Up to this age a patch gives its full force, ms.
pub const FRESH_MS: f32 = 10.0;
/// From this age on a patch gives no force, ms.
pub const GONE_MS: f32 = 60.0;

/// What a haptic stage is built from.
#[derive(Clone, Debug)]
pub struct HapticConfig {
    /// Phases and their order.
    pub program: Program,
    /// How bone is touched.
    pub rigid: Method,
    /// Length of a tick, ms.
    pub dt_ms: f32,
    /// Force of bone: k in N/mm, b in N ms/mm, with the buzz of the drill.
    pub bone_force: Vibration<Viscoelastic>,
    /// Force of tissue: k in N/mm, b in N ms/mm.
    pub tissue_force: Viscoelastic,
    /// Limits of the hand.
    pub guard: GuardConfig,
    /// Distance from the burr to the brain at which the trainee is warned, mm.
    pub near_mm: f32,
}

/// What one tick is given.
#[derive(Clone, Copy, Debug)]
pub struct TickInput<'a> {
    /// Number of the tick, from 1.
    pub tick: u64,
    /// What the device said.
    pub reading: Reading,
    /// The newest collision result.
    pub patch: &'a SurfacePatch,
    /// Its sequence number; 0 before the first.
    pub patch_seq: u64,
}

/// The tool as the other threads see it.
#[derive(Clone, Copy, Debug)]
pub struct ToolSample {
    /// Tick that made it.
    pub tick: u64,
    /// The tool where contact lets it be, moving as it really moved.
    pub state: ToolState,
    /// The phase, and with it the tool in the hand.
    pub phase: Phase,
    /// Whether the burr turns.
    pub drilling: bool,
}

/// What one tick gives.
#[derive(Clone, Copy, Debug)]
pub struct Tick {
    /// For the device.
    pub wrench: GuardedWrench,
    /// For the other threads.
    pub sample: ToolSample,
    /// For the recording; the time it took is the caller's to fill in.
    pub record: TickRecord,
    /// The standing warnings, bits as in [`Warning::ALL`].
    pub warnings: u32,
}

/// The state that lives from tick to tick.
pub struct HapticStage {
    config: HapticConfig,
    bone: Option<Arc<BoneVolume>>,
    brain: Option<Arc<DistanceField>>,
    phase: usize,
    rigid: Vec<Option<Box<dyn RigidContact>>>,
    bone_step: RigidStep,
    tissue: ContactManifold,
    guard: ForceGuard,
    watch: Watch,
    scores: ScoreKeeper,
    held: ToolState,
    proxy: Pose,
    asked_next: bool,
    drill: Drill,
    released: bool,
}

impl HapticStage {
    /// A stage with the tool at `start`. Without bone nothing rigid is felt; without a brain nothing warns of it.
    pub fn new(
        config: HapticConfig,
        bone: Option<Arc<BoneVolume>>,
        brain: Option<Arc<DistanceField>>,
        start: ToolState,
    ) -> Self {
        let proxy = start.world_from_tool;
        let contact_of = |phase: &Phase| {
            bone.as_ref().map(|_| {
                let mut rigid = config.rigid.build(&phase.tool());
                rigid.reset(proxy);
                rigid
            })
        };
        let rigid = config.program.phases().iter().map(contact_of).collect();
        let guard = ForceGuard::new(config.guard);
        Self {
            rigid,
            guard,
            config,
            bone,
            brain,
            phase: 0,
            bone_step: RigidStep::default(),
            tissue: ContactManifold::default(),
            watch: Watch::default(),
            scores: ScoreKeeper::default(),
            held: start,
            proxy,
            asked_next: false,
            drill: Drill::default(),
            released: false,
        }
    }

    /// The tick, in the order of its parts.
    pub fn tick(&mut self, input: &TickInput<'_>, tell: &mut dyn FnMut(Notice)) -> Tick {
        let (tool, stale) = self.sound(&input.reading);
        self.change_tool(&tool, input.tick, tell);
        let drilling = self.drills(&tool);
        let back_mm3 = self.undo(&tool, drilling, input.tick, tell);
        self.touch_bone(&tool, drilling);
        let ahead_mm = self.bone_ahead(drilling);
        let sample = self.sample(&tool, input.tick, drilling);
        let held = self.touch_tissue(input.patch, &sample);
        let lost = input.reading.status == Status::Lost;
        let wanted = if lost { Wrench::ZERO } else { self.wanted(&tool, drilling) };
        let heated = self.guard.counters().heated;
        let wrench = self.guard.guard(wanted, &tool, self.config.dt_ms);
        let warm = self.guard.counters().heated > heated;
        let mut record = self.record(input, &tool, &sample, wrench, held, stale, wanted);
        record.removed_mm3 -= back_mm3;
        self.warn(&record, input.patch, (wanted, warm, ahead_mm), tell);
        if self.drill.came_through(&self.bone_step, ahead_mm) {
            record.flags |= TickRecord::THROUGH;
            tell(Notice { tick: input.tick, time_ms: tool.time_ms, what: What::Through });
        }
        self.scores.add(&record, self.config.dt_ms);
        Tick { wrench, sample, record, warnings: self.watch.standing() }
    }

    /// Fades the force to zero over the coming ticks.
    pub fn release(&mut self) {
        self.guard.release();
        self.released = true;
    }

    /// Whether the force is released and zero.
    pub fn is_at_rest(&self) -> bool {
        self.guard.is_at_rest()
    }

    /// The phase, and with it the tool in the hand.
    pub fn phase(&self) -> Phase {
        self.config.program.phases()[self.phase]
    }

    /// The scores so far.
    pub fn scores(&self) -> &ScoreKeeper {
        &self.scores
    }

    /// What the force guard had to do.
    pub fn guard(&self) -> &ForceGuard {
        &self.guard
    }

    /// The reading, or the last sound one when the device gave nothing usable.
    fn sound(&mut self, reading: &Reading) -> (ToolState, bool) {
        let fresh = matches!(reading.status, Status::Fresh | Status::Finished) && reading.tool.is_finite();
        if fresh {
            self.held = reading.tool;
        } else {
            self.held.time_ms = reading.tool.time_ms;
            self.held.twist = Default::default();
        }
        (self.held, !fresh)
    }

    fn drills(&self, tool: &ToolState) -> bool {
        tool.buttons.has(Buttons::PEDAL) && self.tool().kind == ToolKind::Burr
    }

    fn tool(&self) -> Tool {
        self.phase().tool()
    }

    /// The next tool comes when it is asked for and the last one touches nothing.
    fn change_tool(&mut self, tool: &ToolState, tick: u64, tell: &mut dyn FnMut(Notice)) {
        if tick <= 1 {
            tell(Notice { tick, time_ms: tool.time_ms, what: What::Phase(self.phase()) });
        }
        let asks = tool.buttons.has(Buttons::NEXT_TOOL);
        let free = !self.bone_step.manifold.touches() && self.tissue.depth_mm <= 0.0;
        if asks && !self.asked_next && free && self.phase + 1 < self.config.program.phases().len() {
            self.phase += 1;
            if let Some(rigid) = &mut self.rigid[self.phase] {
                rigid.reset(self.proxy);
            }
            tell(Notice { tick, time_ms: tool.time_ms, what: What::Phase(self.phase()) });
        }
        self.asked_next = asks;
    }

    /// Lets the stroke begin or come back. Returns what came back, mm³.
    fn undo(&mut self, tool: &ToolState, drilling: bool, tick: u64, tell: &mut dyn FnMut(Notice)) -> f32 {
        let Some(bone) = &self.bone else { return 0.0 };
        let may_undo = self.phase() == Phase::Craniotomy && !self.bone_step.manifold.touches();
        let what = self.drill.stroke(bone, tool, drilling, may_undo);
        what.into_iter().for_each(|what| tell(Notice { tick, time_ms: tool.time_ms, what }));
        if let Some(What::Undone(mm3)) = what { mm3 } else { 0.0 }
    }

    fn touch_bone(&mut self, tool: &ToolState, drilling: bool) {
        match (&self.bone, &mut self.rigid[self.phase]) {
            (Some(bone), Some(rigid)) => {
                rigid.step(bone, tool, drilling, self.config.dt_ms, &mut self.bone_step);
                self.proxy = rigid.proxy();
                self.drill.removed(self.bone_step.removed_mm3);
            }
            _ => self.proxy = tool.world_from_tool,
        }
    }

    /// Speed of the spindle, 1/min.
    fn spindle_rpm(&self, drilling: bool) -> f32 {
        spindle_rpm(self.config.rigid.removal().spindle(), &self.bone_step, drilling)
    }

    fn sample(&mut self, tool: &ToolState, tick: u64, drilling: bool) -> ToolSample {
        let mut state = ToolState { world_from_tool: self.proxy, ..*tool };
        if self.bone_step.manifold.touches() {
            state.twist = Default::default();
        }
        ToolSample { tick, state, phase: self.phase(), drilling }
    }

    /// Tissue at the present pose; true when the patch is older than fresh.
    fn touch_tissue(&mut self, patch: &SurfacePatch, sample: &ToolSample) -> bool {
        self.tissue.clear();
        let age_ms = (sample.state.time_ms - patch.time_ms) as f32;
        let depth = patch.depth_at(sample.state.tip());
        if depth <= 0.0 || !patch.normal.is_finite() {
            return false;
        }
        let share = ((GONE_MS - age_ms) / (GONE_MS - FRESH_MS)).clamp(0.0, 1.0);
        self.tissue.normal = patch.normal;
        self.tissue.point = sample.state.tip() - self.tool().tip_radius_mm * patch.normal;
        self.tissue.depth_mm = depth * share;
        age_ms > FRESH_MS
    }

    /// Bone always pushes; tissue pushes in its own phase only (thesis 6.4: while drilling it only warns).
    fn wanted(&mut self, tool: &ToolState, drilling: bool) -> Wrench {
        let free = self.config.rigid.removal().spindle().map_or(f32::INFINITY, |spindle| spindle.free_rpm);
        self.config.bone_force.turn(self.spindle_rpm(drilling) / free);
        let dt_ms = self.config.dt_ms;
        let bone = self.config.bone_force.wrench(tool, &self.bone_step.manifold, dt_ms);
        if self.phase() != Phase::Brain {
            return bone;
        }
        bone + self.config.tissue_force.wrench(tool, &self.tissue, dt_ms)
    }

    fn record(
        &self,
        input: &TickInput<'_>,
        tool: &ToolState,
        sample: &ToolSample,
        wrench: GuardedWrench,
        held: bool,
        stale: bool,
        wanted: Wrench,
    ) -> TickRecord {
        let clamped = wanted.force.length() > self.config.guard.max_force_n;
        let bits = [
            (held, TickRecord::HELD),
            (clamped, TickRecord::CLAMPED),
            (sample.drilling, TickRecord::DRILLING),
            (stale, TickRecord::STALE),
            (self.released, TickRecord::RELEASED),
            (input.reading.status == Status::Lost, TickRecord::LOST),
        ];
        let bone = &self.bone_step.manifold;
        TickRecord {
            tick: input.tick,
            time_ms: tool.time_ms,
            device: input.reading.tool.world_from_tool,
            twist: input.reading.tool.twist,
            buttons: input.reading.tool.buttons.0,
            proxy: self.proxy,
            wrench: wrench.wrench(),
            contact_normal: if bone.touches() { bone.normal } else { self.tissue.normal },
            depth_mm: bone.depth_mm,
            tissue_depth_mm: self.tissue.depth_mm,
            removed_mm3: self.bone_step.removed_mm3,
            spindle_rpm: self.spindle_rpm(sample.drilling),
            brain_distance_mm: self.brain_distance(sample.state.tip()),
            patch_seq: input.patch_seq,
            compute_us: 0.0,
            flags: bits.iter().filter(|(on, _)| *on).map(|(_, bit)| bit).sum(),
            phase: self.phase as u8,
            tool: self.tool().kind as u8,
        }
    }

    /// Bone left ahead of a burr that cuts, mm; infinite when it does not.
    fn bone_ahead(&self, drilling: bool) -> f32 {
        match &self.bone {
            Some(bone) if drilling && self.bone_step.manifold.touches() => {
                left_ahead_mm(bone, self.proxy, &self.tool(), self.bone_step.manifold.normal)
            }
            _ => f32::INFINITY,
        }
    }

    /// From the tool's ball to the brain's rest surface, mm; negative inside, infinite without a brain.
    fn brain_distance(&self, tip: Vec3) -> f32 {
        self.brain.as_ref().map_or(f32::INFINITY, |field| field.sample(tip) - self.tool().tip_radius_mm)
    }

    /// Whether the drill stands still under its load.
    fn stalls(&self, record: &TickRecord) -> bool {
        record.spindle_rpm == 0.0 && self.config.rigid.removal().spindle().is_some()
    }

    fn warn(
        &mut self,
        record: &TickRecord,
        patch: &SurfacePatch,
        (wanted, warm, ahead_mm): (Wrench, bool, f32),
        tell: &mut dyn FnMut(Notice),
    ) {
        let burr = self.phase() == Phase::Craniotomy;
        let distance = record.brain_distance_mm;
        let touched = burr && (distance <= 0.0 || self.tissue.depth_mm > 0.0);
        let force = wanted.force.length();
        let age_ms = (record.time_ms - patch.time_ms) as f32;
        let causes = [
            (Warning::BoneThin, ahead_mm <= THIN_MM, ahead_mm),
            (Warning::BreakThrough, ahead_mm <= BREAK_MM, ahead_mm),
            (Warning::BrainNear, burr && distance <= self.config.near_mm, distance),
            (Warning::BrainTouched, touched, distance),
            (Warning::DrillStalled, record.has(TickRecord::DRILLING) && self.stalls(record), force),
            (Warning::ForceLimit, record.has(TickRecord::CLAMPED), force),
            (Warning::TissueLate, record.has(TickRecord::HELD), age_ms),
            (Warning::DeviceStale, record.has(TickRecord::STALE), 0.0),
            (Warning::MotorsWarm, warm, force),
        ];
        for (warning, present, value) in causes {
            if let Some(what) = self.watch.tell(warning, present, value, record.time_ms) {
                tell(Notice { tick: record.tick, time_ms: record.time_ms, what });
            }
        }
    }
}
