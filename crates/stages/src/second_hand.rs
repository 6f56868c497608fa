//! One tick of the second hand: an aspirator that touches bone and brain and does not cut bone.
//!
//! # Theory
//! ```text
//! device pose → bone contact (proxy) ──────────╮
//! newest surface patch → tissue depth ─────────┴→ force models → force guard → wrench
//! ```
//!
//! # Practice
//! Its tick follows the first hand's in the same loop, so that it collides with the bone as the
//! burr left it in that tick, also in a replay. A tick does not allocate, lock, log or panic.
//! It presses the brain and feels it move as the first hand does. Where no brain deforms, contact
//! uses the rest shape: d = r - φ(tip), n = ∇φ. The tools of the two hands do not collide.

use crate::by_cause;
use crate::fault::{AfterFault, DeviceStatus, last_valid_state};
use crate::haptic_config::HapticConfig;
use crate::notice::{Notice, What};
use crate::tissue::meet_patch;
use serde::Serialize;
use std::sync::Arc;
use trepan_bone::BoneVolume;
use trepan_contact::{Contact, ContactManifold, ForceGuard, ForceModel, GuardCounters, GuardedWrench, SurfacePatch};
use trepan_geometry::{Buttons, Pose, Tool, ToolState, Twist, Vec3, Wrench};
use trepan_haptics::{Reading, Status};
use trepan_link::wire::{SecondRecord, TickRecord};
use trepan_rigid::{RigidContact, RigidStep};
use trepan_volume::DistanceField;

/// State of the second hand, or of an arm, as it is rendered.
#[derive(Clone, Copy, Debug)]
pub struct SecondView {
    /// The tool.
    pub tool: Tool,
    /// Pose of the proxy.
    pub world_from_tool: Pose,
    /// Force on the hand, N.
    pub force: Vec3,
}

/// Outcome of the second hand, as in `summary.json`.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct SecondOutcome {
    /// Largest force, N.
    #[serde(rename = "force_max_n")]
    pub peak_force_n: f32,
    /// Force after the last tick, N; zero after a clean end.
    #[serde(rename = "force_end_n")]
    pub end_force_n: f32,
    /// Ticks in which its force guard acted, by cause.
    #[serde(serialize_with = "by_cause")]
    pub guard: GuardCounters,
}

/// State of the second hand.
pub struct SecondHand {
    config: HapticConfig,
    bone: Option<Arc<BoneVolume>>,
    brain: Option<Arc<DistanceField>>,
    rigid: Box<dyn RigidContact>,
    step: RigidStep,
    tissue: ContactManifold,
    guard: ForceGuard,
    last_valid: Option<ToolState>,
    fault: AfterFault,
    released: bool,
    peak_force_n: f32,
    force_n: f32,
}

impl SecondHand {
    /// Makes a second hand; its tool begins at the first pose of its device. Used of the
    /// configuration are method, forces, guard, tick and `force_waits`.
    pub fn new(config: HapticConfig, bone: Option<Arc<BoneVolume>>, brain: Option<Arc<DistanceField>>) -> Self {
        Self {
            rigid: config.rigid.build(&Self::tool()),
            guard: ForceGuard::new(config.guard),
            config,
            bone,
            brain,
            step: RigidStep::default(),
            tissue: ContactManifold::default(),
            last_valid: None,
            fault: AfterFault::default(),
            released: false,
            peak_force_n: 0.0,
            force_n: 0.0,
        }
    }

    /// Returns the tool: an aspirator.
    pub fn tool() -> Tool {
        Tool::aspirator()
    }

    /// Returns the tool with the pose of the proxy, its pedal up while the force is off; `None`
    /// before the device's first pose.
    pub fn place(&self) -> Option<ToolState> {
        let tool = self.last_valid?;
        let buttons = if self.fault.waits() || self.released { Buttons(0) } else { tool.buttons };
        let twist = if self.step.manifold.touches() { Twist::default() } else { tool.twist };
        let world_from_tool = if self.bone.is_some() { self.rigid.proxy() } else { tool.world_from_tool };
        Some(ToolState { world_from_tool, buttons, twist, ..tool })
    }

    /// Runs a tick, after the first hand's tick of the same number, with the newest patch of this
    /// hand's tool.
    pub fn tick(
        &mut self,
        tick: u64,
        reading: &Reading,
        patch: &SurfacePatch,
        notify: &mut dyn FnMut(Notice),
    ) -> (GuardedWrench, SecondRecord) {
        let (tool, stale) = last_valid_state(reading, self.last_valid.unwrap_or(ToolState::at(Pose::IDENTITY)));
        if !stale && self.last_valid.replace(tool).is_none() {
            // The first valid pose sets the proxy.
            self.rigid.reset(tool.world_from_tool);
        }
        let proxy = self.touch_bone(&tool);
        self.touch_brain(&ToolState { world_from_tool: proxy, ..tool }, patch);
        let lost = reading.status == Status::Lost;
        if self.config.force_waits {
            let touches = self.step.manifold.touches() || self.tissue.depth_mm > 0.0;
            let status = DeviceStatus { lost, stale, touches };
            let change = self.fault.follow(&tool, status, self.config.dt_ms, &mut self.guard, self.released);
            let what = change.map(|waits| What::Force { waits, second: true });
            what.into_iter().for_each(|what| notify(Notice { tick, time_ms: tool.time_ms, what }));
        }
        let let_go = lost || self.fault.waits() || tool.buttons.has(Buttons::PAUSE);
        let desired = if let_go { self.let_go() } else { self.desired_wrench(&tool) };
        let wrench = self.guard.guard(desired, &tool, self.config.dt_ms);
        self.force_n = wrench.force().length();
        self.peak_force_n = self.peak_force_n.max(self.force_n);
        let clamped = desired.force.length() > self.config.guard.max_force_n;
        let bits = [
            (clamped, TickRecord::CLAMPED),
            (stale, TickRecord::STALE),
            (self.released, TickRecord::RELEASED),
            (lost, TickRecord::LOST),
        ];
        let record = SecondRecord {
            tick,
            time_ms: tool.time_ms,
            device: reading.tool.world_from_tool,
            twist: reading.tool.twist,
            buttons: reading.tool.buttons.0,
            proxy,
            wrench: wrench.wrench(),
            depth_mm: self.step.manifold.depth_mm,
            tissue_depth_mm: self.tissue.depth_mm,
            flags: bits.iter().filter(|(on, _)| *on).map(|(_, bit)| bit).sum(),
        };
        (wrench, record)
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

    /// Returns the outcome so far.
    pub fn outcome(&self) -> SecondOutcome {
        let guard = self.guard.counters();
        SecondOutcome { peak_force_n: self.peak_force_n, guard, end_force_n: self.force_n }
    }

    /// Runs the contact with bone, once a pose is known; returns the proxy.
    fn touch_bone(&mut self, tool: &ToolState) -> Pose {
        let (Some(bone), Some(_)) = (&self.bone, self.last_valid) else { return tool.world_from_tool };
        self.rigid.step(bone, tool, false, self.config.dt_ms, &mut self.step);
        self.rigid.proxy()
    }

    fn touch_brain(&mut self, tool: &ToolState, patch: &SurfacePatch) {
        self.tissue.clear();
        let (Some(brain), Some(_)) = (&self.brain, self.last_valid) else { return };
        if self.config.program.has_tissue() {
            let stiffness = self.config.tissue_force.stiffness;
            meet_patch(patch, tool, &Self::tool(), stiffness, &mut self.tissue);
            return;
        }
        let (tip, radius_mm) = (tool.tip(), Self::tool().tip_radius_mm);
        let depth_mm = radius_mm - brain.sample(tip);
        let normal = brain.gradient(tip).normalize_or_zero();
        if depth_mm > 0.0 && normal != Vec3::ZERO {
            self.tissue.set_single(Contact { point: tip - radius_mm * normal, normal, depth_mm });
        }
    }

    /// Forgets what the tool held on to; no wrench.
    fn let_go(&mut self) -> Wrench {
        self.config.bone_force.mean.reset();
        Wrench::ZERO
    }

    fn desired_wrench(&mut self, tool: &ToolState) -> Wrench {
        let HapticConfig { bone_force, tissue_force, dt_ms, .. } = &mut self.config;
        // An aspirator does not vibrate.
        bone_force.mean.wrench(tool, &self.step.manifold, *dt_ms) + tissue_force.wrench(tool, &self.tissue, *dt_ms)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::program::Program;
    use trepan_contact::GuardConfig;
    use trepan_volume::VoxelVolume;

    /// Makes a hand above bone under z = 0 and brain under z = -8 mm.
    fn hand(with_bone: bool) -> SecondHand {
        let n = 40;
        let mut ct = VoxelVolume::isotropic([n; 3], Vec3::splat(-19.5), 1.0, -1000i16);
        let mut mask = ct.map(|_| 0u8);
        for at in 0..ct.data.len() {
            let z = -19.5 + (at / (n * n)) as f32;
            ct.data[at] = (400.0 - 800.0 * z).clamp(-1000.0, 1500.0) as i16;
            mask.data[at] = u8::from(z < -8.0);
        }
        let config = HapticConfig {
            guard: GuardConfig { ramp_in_ms: 0.0, passivity: None, ..GuardConfig::default() },
            ..HapticConfig::usual(Program::Craniotomy)
        };
        let bone = with_bone.then(|| Arc::new(BoneVolume::new(&ct, 400).unwrap()));
        SecondHand::new(config, bone, Some(Arc::new(DistanceField::of_mask(&mask))))
    }

    /// Lowers the tip from 5 mm to `z` in 200 ticks, then rests for 200; returns the last record.
    fn lowered(hand: &mut SecondHand, z: f32, status: Status) -> SecondRecord {
        let mut last = SecondRecord::default();
        for tick in 1..=400u32 {
            let share = (tick as f32 / 200.0).min(1.0);
            let mut tool = ToolState::at(Pose::from_translation(Vec3::Z * (5.0 + share * (z - 5.0))));
            tool.time_ms = f64::from(tick);
            let status = if tick > 300 { status } else { Status::Fresh };
            last = hand.tick(tick.into(), &Reading { tool, status }, &SurfacePatch::default(), &mut |_| {}).1;
        }
        last
    }

    #[test]
    fn the_second_hand_feels_bone_and_brain_with_their_stiffness() {
        let on_bone = lowered(&mut hand(true), 0.5, Status::Fresh);
        assert!((on_bone.wrench.force - Vec3::Z * 2.0).length() < 0.3, "{:?}", on_bone.wrench);
        assert!((on_bone.proxy.translation.z - 1.5).abs() < 0.15 && on_bone.tissue_depth_mm == 0.0, "{on_bone:?}");
        let on_brain = lowered(&mut hand(false), -9.0, Status::Fresh);
        assert!((on_brain.wrench.force - Vec3::Z * 0.75).length() < 0.2, "{:?}", on_brain.wrench);
    }

    #[test]
    fn a_lost_device_and_a_release_leave_no_force() {
        assert_eq!(lowered(&mut hand(true), 0.5, Status::Lost).wrench.force, Vec3::ZERO);
        let mut hand = hand(true);
        lowered(&mut hand, 0.5, Status::Fresh);
        hand.release();
        assert_eq!(lowered(&mut hand, 0.5, Status::Fresh).wrench.force, Vec3::ZERO);
        assert!(hand.is_at_rest() && hand.outcome().peak_force_n > 1.5);
    }

    #[test]
    fn after_a_loss_the_force_is_off_until_a_deliberate_action() {
        let mut hand = hand(true);
        let mut notices = Vec::new();
        let mut time_ms = 0.0;
        let mut run = |ticks: u32, z: f32, buttons: Buttons, status: Status| {
            let mut peak_n = 0f32;
            for _ in 0..ticks {
                time_ms += 1.0;
                let tool = ToolState { buttons, time_ms, ..ToolState::at(Pose::from_translation(Vec3::Z * z)) };
                let (reading, mut notify) = (Reading { tool, status }, |notice: Notice| notices.push(notice.what));
                let done = hand.tick(time_ms as u64, &reading, &SurfacePatch::default(), &mut notify);
                peak_n = peak_n.max(done.0.force().length());
            }
            peak_n
        };
        run(50, 5.0, Buttons(0), Status::Fresh);
        assert!(run(300, 0.8, Buttons(0), Status::Fresh) > 0.5, "it pressed");
        run(20, 0.8, Buttons(0), Status::Lost);
        assert_eq!(run(500, 0.8, Buttons(0), Status::Fresh), 0.0, "it came back by itself");
        assert!(run(300, 0.8, Buttons::NEXT_TOOL, Status::Fresh) > 0.5);
        run(20, 0.8, Buttons(0), Status::Lost);
        assert_eq!(run(20, 0.8, Buttons(0), Status::Fresh), 0.0);
        run(300, 5.0, Buttons(0), Status::Fresh);
        assert!(run(300, 0.8, Buttons(0), Status::Fresh) > 0.5);
        let waits: Vec<What> = [true, false, true, false].map(|waits| What::Force { waits, second: true }).into();
        assert_eq!(notices, waits);
    }

    #[test]
    fn its_tool_follows_the_device_where_there_is_no_bone() {
        let mut hand = hand(false);
        lowered(&mut hand, -9.0, Status::Fresh);
        assert_eq!(hand.place().unwrap().tip(), Vec3::Z * -9.0);
    }

    #[test]
    fn there_is_no_force_before_the_devices_first_pose() {
        let mut hand = hand(true);
        let tool = ToolState::at(Pose::from_translation(Vec3::Z * -5.0));
        let reading = Reading { tool, status: Status::Stale };
        for tick in 1..50 {
            let (wrench, record) = hand.tick(tick, &reading, &SurfacePatch::default(), &mut |_| {});
            assert_eq!((wrench.force(), record.has(TickRecord::STALE)), (Vec3::ZERO, true));
        }
    }
}
