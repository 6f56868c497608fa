//! One haptic tick: takes a device's pose, returns a guarded wrench and a record.
//!
//! # Theory
//! ```text
//! device pose → bone contact (proxy, drilling) ─╮
//! newest surface patch → tissue depth ──────────┴→ force models → force guard → wrench
//! ```
//! The seven steps of rigid handling (thesis, 3.2 to 3.4) run inside [`RigidContact`]. The force of
//! tissue comes from the tangent plane of the last collision result, evaluated at the tick's pose:
//! a slow collision thread reduces accuracy, not stability. The force of an old patch fades: full
//! force up to [`FRESH_MS`], none after [`GONE_MS`].
//!
//! A tick is nine stages. Each hands on a plain value, and the record is made of all of them:
//!
//! ```text
//! read      sense
//! compute   follow_requests → touch_bone → sample → touch_tissue → desired_wrench → guard
//! record    record → warn → count_hole; the caller gives the wrench to the device
//! ```
//!
//! # Practice
//! The stage has no clock and no device: the same readings and patches give wrenches equal bit for
//! bit, live or in a replay. A tick does not allocate, lock, log or panic.

mod arm;
mod requests;

pub use crate::tissue::{FRESH_MS, GONE_MS};
pub use arm::{SecondTool, is_held_by_arms};

use crate::alarms::{Feed, Pace, WarningInputs};
use crate::drill::{Drill, REACH_MM, remaining_thickness_mm};
use crate::fault::{AfterFault, DeviceStatus, last_valid_state};
use crate::flap::{Flap, FlapPlace};
use crate::force_scale::ForceScale;
use crate::haptic_config::HapticConfig;
use crate::notice::{Notice, Watch, What};
use crate::program::Phase;
use crate::score::ScoreKeeper;
use crate::tissue::meet_patch;
use crate::tray::Tray;
use crate::undo::Undo;
use std::sync::Arc;
use trepan_bone::{BoneVolume, FlapSearch};
use trepan_contact::{ContactManifold, ForceGuard, ForceModel, GuardedWrench, SurfacePatch};
use trepan_geometry::{Buttons, Pose, Tool, ToolState, Vec3, Wrench};
use trepan_haptics::{Reading, Status};
use trepan_link::wire::TickRecord;
use trepan_rigid::spindle::Spindle;
use trepan_rigid::{RigidContact, RigidStep};
use trepan_volume::DistanceField;

impl HapticStage {
    /// Runs a tick; notices go to `notify`. The caller applies the wrench.
    pub fn tick(&mut self, input: &TickInput<'_>, notify: &mut dyn FnMut(Notice)) -> Tick {
        let hand = self.sense(&input.reading);
        let report = &mut |what| notify(Notice { tick: input.tick, time_ms: hand.tool.time_ms, what });
        let intent = self.follow_requests(&hand, input, report);
        let bone = self.touch_bone(&hand, intent, report);
        let sample = self.sample(&hand, input, intent);
        let is_held = self.touch_tissue(input.patch, &sample);
        let desired = self.desired_wrench(&hand, intent, report);
        let wrench = self.guard.guard(desired.sum(), &hand.tool, self.config.dt_ms);
        let record = self.record(input, (&hand, intent, bone, is_held), &sample, (desired, wrench));
        self.warn(&record, input, &sample, (bone, desired), report);
        self.count_hole(bone, report);
        self.scores.add(&record);
        Tick { wrench, sample, record, warnings: self.watch.standing() }
    }
}

/// What the device says of the hand in a tick.
#[derive(Clone, Copy, Debug)]
struct Hand {
    /// The tool, or its last valid pose at rest.
    tool: ToolState,
    /// Whether the device gave no usable pose.
    is_stale: bool,
    /// Whether the device is lost.
    is_lost: bool,
}

/// What the hand does in a tick.
#[derive(Clone, Copy, Debug)]
struct Intent {
    /// Whether the tool cuts.
    drilling: bool,
    /// Bone restored by undoing, mm³; negative for a redo.
    restored_mm3: f32,
}

/// What the tool meets in the bone in a tick, beside the [`RigidStep`].
#[derive(Clone, Copy, Debug)]
struct BoneContact {
    /// Remaining bone ahead of a cutting burr, mm; infinite if it does not cut.
    ahead_mm: f32,
    /// Whether the burr comes through, for the first time in its stroke.
    came_through: bool,
}

/// Inputs of a tick.
#[derive(Clone, Copy, Debug)]
pub struct TickInput<'a> {
    /// Number of the tick, from 1.
    pub tick: u64,
    /// Reading of the device.
    pub reading: Reading,
    /// The newest collision result.
    pub patch: &'a SurfacePatch,
    /// Its sequence number; 0 before the first.
    pub patch_seq: u64,
    /// The second hand's tool after the last tick; `None` without one.
    pub second: Option<ToolState>,
    /// Force of the tissue on the second hand's tool, or an arm's, N: it warns as the first's does.
    pub second_n: f32,
}

/// The tool as sent to the other threads.
#[derive(Clone, Copy, Debug)]
pub struct ToolSample {
    /// Number of the tick.
    pub tick: u64,
    /// State with the pose of the proxy; at rest while it touches bone.
    pub state: ToolState,
    /// The present tool.
    pub tool: Tool,
    /// Its slot in the tray.
    pub slot: usize,
    /// Whether the tool cuts.
    pub drilling: bool,
    /// The tool of the second hand, one tick before, or of an arm; `None` without one.
    pub second: Option<SecondTool>,
    /// Whether the hand draws back from a tool that it left with an arm: its own does nothing yet.
    pub idle: bool,
}

impl ToolSample {
    /// The tools that act, with their slots: that of the first hand, that of the second.
    pub fn tools(&self) -> [Option<SecondTool>; 2] {
        let first = SecondTool { tool: self.tool, slot: self.slot, state: self.state };
        [Some(first).filter(|_| !self.idle), self.second]
    }

    /// Returns the phase of the present tool.
    pub fn phase(&self) -> Phase {
        Phase::of(&self.tool)
    }
}

/// Results of a tick.
#[derive(Clone, Copy, Debug)]
pub struct Tick {
    /// For the device.
    pub wrench: GuardedWrench,
    /// For the other threads.
    pub sample: ToolSample,
    /// For the recording; the caller sets the compute time.
    pub record: TickRecord,
    /// Active warnings, bits as in [`Warning::ALL`](crate::Warning::ALL).
    pub warnings: u32,
}

/// Desired wrenches of bone and tissue, before the guard.
#[derive(Clone, Copy, Debug, Default)]
struct DesiredWrench {
    bone: Wrench,
    /// `None` where tissue only causes warnings.
    tissue: Option<Wrench>,
}

impl DesiredWrench {
    fn sum(&self) -> Wrench {
        self.tissue.map_or(self.bone, |tissue| self.bone + tissue)
    }

    /// Returns the tissue's part of the guarded force, N, scaled as the sum was.
    fn tissue_within(&self, given: Vec3) -> Vec3 {
        let desired_n = self.sum().force.length();
        let share = if desired_n > 0.0 { (given.length() / desired_n).min(1.0) } else { 1.0 };
        share * self.tissue.unwrap_or_default().force
    }
}

/// State of the first hand.
pub struct HapticStage {
    config: HapticConfig,
    bone: Option<Arc<BoneVolume>>,
    brain: Option<Arc<DistanceField>>,
    forbidden: Option<Arc<DistanceField>>,
    tray: Tray,
    rigid: Vec<Option<Box<dyn RigidContact>>>,
    bone_step: RigidStep,
    tissue: ContactManifold,
    guard: ForceGuard,
    watch: Watch,
    scores: ScoreKeeper,
    last_valid: ToolState,
    proxy: Pose,
    drill: Drill,
    undo: Undo,
    /// Number of strokes that came through, without those undone.
    holes: u32,
    feed: Feed,
    pace: Pace,
    flap: Option<Flap>,
    /// Whether the flap's button was pressed in the last tick.
    asked_flap: bool,
    fault: AfterFault,
    released: bool,
    arm: arm::Arm,
}

impl HapticStage {
    /// Makes a stage with the tool at `start`. Without bone there is no rigid contact; without a
    /// brain there are no warnings of it.
    pub fn new(
        config: HapticConfig,
        bone: Option<Arc<BoneVolume>>,
        brain: Option<Arc<DistanceField>>,
        start: ToolState,
    ) -> Self {
        let proxy = start.world_from_tool;
        let contact_of = |tool: &Tool| {
            bone.as_ref().map(|_| {
                let mut rigid = config.rigid.build(tool);
                rigid.reset(proxy);
                rigid
            })
        };
        let rigid = config.program.tray().iter().map(contact_of).collect();
        let guard = ForceGuard::new(config.guard);
        let scores = ScoreKeeper::at(ForceScale(config.force_scale));
        Self {
            rigid,
            guard,
            tray: Tray::new(config.program),
            config,
            bone,
            brain,
            forbidden: None,
            bone_step: RigidStep::default(),
            tissue: ContactManifold::default(),
            watch: Watch::default(),
            scores,
            last_valid: start,
            proxy,
            drill: Drill::default(),
            undo: Undo::default(),
            holes: 0,
            feed: Feed::default(),
            pace: Pace::UNKNOWN,
            flap: None,
            asked_flap: false,
            fault: AfterFault::default(),
            released: false,
            arm: arm::Arm::default(),
        }
    }

    /// Adds a flap that can be lifted once it is cut free; if it is not `planned`, the free piece
    /// below the tool.
    pub fn with_flap(self, search: FlapSearch, planned: bool) -> Self {
        Self { flap: Some(Flap::new(search, planned)), ..self }
    }

    /// Adds the distance field of structures that no tool may come close to.
    pub fn forbidding(self, forbidden: Arc<DistanceField>) -> Self {
        Self { forbidden: Some(forbidden), ..self }
    }

    /// Fades the force to zero over the coming ticks.
    pub fn release(&mut self) {
        self.guard.release();
        self.released = true;
    }

    /// Where the planned flap is.
    pub fn flap_place(&self) -> FlapPlace {
        self.flap.as_ref().map(Flap::place).unwrap_or_default()
    }

    /// Whether the force is released and zero.
    pub fn is_at_rest(&self) -> bool {
        self.guard.is_at_rest()
    }

    /// Returns the phase of the present tool.
    pub fn phase(&self) -> Phase {
        self.tray.phase()
    }

    /// Returns the scores so far.
    pub fn scores(&self) -> &ScoreKeeper {
        &self.scores
    }

    /// Returns the force guard.
    pub fn guard(&self) -> &ForceGuard {
        &self.guard
    }

    /// Returns the speed of the spindle in a tick over its free speed.
    pub fn spindle_share(&self, record: &TickRecord) -> f32 {
        self.spindle().map_or(0.0, |spindle| record.spindle_rpm / spindle.free_rpm)
    }

    /// Returns the newtons at the hand per newton of the task, on bone.
    pub fn force_scale(&self) -> ForceScale {
        ForceScale(self.config.force_scale)
    }

    /// Returns the motor of the present tool.
    fn spindle(&self) -> Option<Spindle> {
        self.config.rigid.removal().for_tool(&self.tool()).spindle()
    }

    /// Switches the force off after a fault of the device until a deliberate action of the user.
    fn follow_fault(&mut self, hand: &Hand, report: &mut dyn FnMut(What)) {
        if self.config.force_waits {
            let status = DeviceStatus { lost: hand.is_lost, stale: hand.is_stale, touches: !self.is_free() };
            let change = self.fault.follow(&hand.tool, status, self.config.dt_ms, &mut self.guard, self.released);
            change.into_iter().for_each(|waits| report(What::Force { waits, second: false }));
        }
    }

    fn tool(&self) -> Tool {
        self.tray.tool()
    }

    /// The hand by a reading.
    fn sense(&mut self, reading: &Reading) -> Hand {
        let (tool, is_stale) = last_valid_state(reading, self.last_valid);
        self.last_valid = tool;
        Hand { tool, is_stale, is_lost: reading.status == Status::Lost }
    }

    /// Follows the buttons: changes the tool, cuts, undoes and redoes strokes.
    fn follow_requests(&mut self, hand: &Hand, input: &TickInput<'_>, report: &mut dyn FnMut(What)) -> Intent {
        self.change_tool(&hand.tool, input.tick <= 1, report);
        self.follow_arm(&hand.tool, input, report);
        let drilling = self.drills(&hand.tool);
        let restored_mm3 = self.undo(&hand.tool, drilling, self.second_tool(input), report);
        Intent { drilling, restored_mm3 }
    }

    /// Runs the contact with bone and moves the flap.
    fn touch_bone(&mut self, hand: &Hand, intent: Intent, report: &mut dyn FnMut(What)) -> BoneContact {
        let (tool, drilling) = (&hand.tool, intent.drilling);
        match (&self.bone, &mut self.rigid[self.tray.slot()]) {
            (Some(bone), Some(rigid)) => {
                rigid.step(bone, tool, drilling, self.config.dt_ms, &mut self.bone_step);
                self.proxy = rigid.proxy();
                if drilling {
                    self.undo.newest(bone).mm3 += self.bone_step.removed_mm3;
                }
            }
            _ => self.proxy = tool.world_from_tool,
        }
        self.follow_flap(tool, drilling, report);
        let ahead_mm = self.bone_ahead(drilling);
        BoneContact { ahead_mm, came_through: self.drill.came_through(&self.bone_step, ahead_mm) }
    }

    /// Counts a hole through the bone.
    fn count_hole(&mut self, bone: BoneContact, report: &mut dyn FnMut(What)) {
        if bone.came_through {
            self.holes += 1;
            self.bone.iter().for_each(|bone| self.undo.newest(bone).through += 1);
            report(What::Through);
        }
    }

    /// Returns the speed of the spindle, 1/min: the free speed in air, reduced by the load in bone,
    /// 0 while not drilling.
    fn spindle_rpm(&self, drilling: bool) -> f32 {
        match self.spindle() {
            Some(_) if drilling && self.bone_step.manifold.touches() => self.bone_step.spindle_rpm,
            Some(spindle) if drilling => spindle.free_rpm,
            _ => 0.0,
        }
    }

    /// The tool for the other threads.
    fn sample(&self, hand: &Hand, input: &TickInput<'_>, intent: Intent) -> ToolSample {
        let mut state = ToolState { world_from_tool: self.proxy, ..hand.tool };
        if self.bone_step.manifold.touches() {
            state.twist = Default::default();
        }
        let (tick, second) = (input.tick, self.second_tool(input));
        let (tool, slot, idle) = (self.tool(), self.tray.slot(), self.arm.leaves());
        ToolSample { tick, state, tool, slot, drilling: intent.drilling, second, idle }
    }

    /// Sets the contact with tissue at the present pose; returns whether the patch in contact is
    /// stale.
    fn touch_tissue(&mut self, patch: &SurfacePatch, sample: &ToolSample) -> bool {
        if self.arm.leaves() {
            self.tissue.clear();
            return false;
        }
        meet_patch(patch, &sample.state, &self.tool(), self.config.tissue_force.stiffness, &mut self.tissue)
    }

    /// Returns the desired wrenches; none after a fault or during a pause. Tissue has one in the
    /// brain phase only (thesis 6.4: while drilling, it only causes warnings).
    fn desired_wrench(&mut self, hand: &Hand, intent: Intent, report: &mut dyn FnMut(What)) -> DesiredWrench {
        self.follow_fault(hand, report);
        if hand.is_lost || self.fault.waits() || hand.tool.buttons.has(Buttons::PAUSE) {
            self.config.bone_force.mean.reset();
            return DesiredWrench::default();
        }
        let (tool, drilling) = (&hand.tool, intent.drilling);
        let free = self.spindle().map_or(f32::INFINITY, |spindle| spindle.free_rpm);
        self.config.bone_force.turn(self.spindle_rpm(drilling) / free);
        let dt_ms = self.config.dt_ms;
        let bone = self.config.bone_force.wrench(tool, &self.bone_step.manifold, dt_ms);
        let brain = self.phase() == Phase::Brain;
        let tissue = brain.then(|| self.config.tissue_force.wrench(tool, &self.tissue, dt_ms));
        DesiredWrench { bone, tissue }
    }

    fn record(
        &self,
        input: &TickInput<'_>,
        (hand, intent, bone, is_held): (&Hand, Intent, BoneContact, bool),
        sample: &ToolSample,
        (desired, wrench): (DesiredWrench, GuardedWrench),
    ) -> TickRecord {
        let flags = [
            (is_held, TickRecord::HELD),
            (intent.drilling, TickRecord::DRILLING),
            (hand.is_stale, TickRecord::STALE),
            (hand.is_lost, TickRecord::LOST),
            (bone.came_through, TickRecord::THROUGH),
            (self.undo.runs(), TickRecord::UNDOING),
            (desired.sum().force.length() > self.config.guard.max_force_n, TickRecord::CLAMPED),
            (self.released, TickRecord::RELEASED),
            (true, TickRecord::TISSUE),
        ];
        let manifold = &self.bone_step.manifold;
        TickRecord {
            tick: input.tick,
            time_ms: sample.state.time_ms,
            device: input.reading.tool.world_from_tool,
            twist: input.reading.tool.twist,
            buttons: input.reading.tool.buttons.0,
            proxy: self.proxy,
            wrench: wrench.wrench(),
            tissue_force: desired.tissue_within(wrench.force()),
            contact_normal: if manifold.touches() { manifold.normal } else { self.tissue.normal },
            depth_mm: manifold.depth_mm,
            tissue_depth_mm: self.tissue.depth_mm,
            removed_mm3: self.bone_step.removed_mm3 - intent.restored_mm3,
            spindle_rpm: self.spindle_rpm(sample.drilling),
            brain_distance_mm: self.brain_distance(sample.state.world_from_tool),
            patch_seq: input.patch_seq,
            compute_us: 0.0,
            flags: flags.iter().filter(|(on, _)| *on).map(|(_, bit)| bit).sum(),
            phase: self.phase() as u8,
            tool: self.tray.slot() as u8,
        }
    }

    /// Returns the remaining bone ahead of a cutting burr, mm; infinite if it does not cut.
    fn bone_ahead(&self, drilling: bool) -> f32 {
        match &self.bone {
            // A craniotome's foot runs under the bone and protects the dura.
            Some(bone) if drilling && self.tool().cutting_mm == 0.0 && self.bone_step.manifold.touches() => {
                remaining_thickness_mm(bone, self.proxy, &self.tool(), self.bone_step.manifold.normal)
            }
            _ => f32::INFINITY,
        }
    }

    /// Returns the distance from the tool's ball to the brain's rest surface, mm; negative inside,
    /// infinite without a brain. A craniotome's ball is a blunt foot made to run on the dura: its
    /// distance is measured from the lower end of the cutting part.
    fn brain_distance(&self, world_from_tool: Pose) -> f32 {
        let Some(field) = &self.brain else { return f32::INFINITY };
        let Tool { tip_radius_mm, cutting_mm, .. } = self.tool();
        let tip = world_from_tool.translation;
        match cutting_mm > 0.0 {
            true => field.sample(tip + world_from_tool.rotation * (tip_radius_mm * Vec3::Z)),
            false => field.sample(tip) - tip_radius_mm,
        }
    }

    /// Raises and clears the warnings.
    fn warn(
        &mut self,
        record: &TickRecord,
        &TickInput { patch, second_n, .. }: &TickInput<'_>,
        sample: &ToolSample,
        (bone, desired): (BoneContact, DesiredWrench),
        report: &mut dyn FnMut(What),
    ) {
        let inputs = self.warning_inputs(record, sample, bone.ahead_mm, patch, (desired, second_n));
        for (warning, present, value) in inputs.causes(record, &self.config.limits) {
            self.watch.update(warning, present, value, record.time_ms).into_iter().for_each(&mut *report);
        }
    }

    /// Returns the inputs of the warnings.
    fn warning_inputs(
        &mut self,
        record: &TickRecord,
        sample: &ToolSample,
        ahead_mm: f32,
        patch: &SurfacePatch,
        (desired, second_n): (DesiredWrench, f32),
    ) -> WarningInputs {
        let radius_mm = sample.tool.tip_radius_mm;
        let forbidden = self.forbidden.as_ref().map(|field| field.sample(sample.state.tip()) - radius_mm);
        let (phase, craniotome) = (self.phase(), sample.tool.cutting_mm > 0.0);
        WarningInputs {
            bare_cutter: phase == Phase::Craniotomy && !craniotome,
            craniotome,
            ahead_mm,
            breach_ms: self.feed.follow(ahead_mm, REACH_MM, self.config.dt_ms),
            tissue_n: record.tissue_n().max(second_n),
            rest_n: if phase == Phase::Brain { desired.bone.force.length() } else { 0.0 },
            forbidden_mm: forbidden.unwrap_or(f32::INFINITY),
            desired_n: desired.sum().force.length(),
            stalled: record.spindle_rpm == 0.0 && self.config.rigid.removal().spindle().is_some(),
            age_ms: (record.time_ms - patch.time_ms) as f32,
            tissue_pace: self.pace.follow(record.time_ms, patch.tissue_ms),
            warm: self.guard.is_heat_limited(),
        }
    }
}
