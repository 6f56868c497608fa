//! One tick of the second hand: an aspirator that touches bone and brain and cuts nothing.
//!
//! # Theory
//! ```text
//! device pose → bone contact (proxy) ──────────╮
//! brain at rest → d = r - φ(tip), n = ∇φ ──────┴→ force models → the hand's own guard → wrench
//! ```
//!
//! # Practice
//! Its tick follows the first hand's in the same loop, so that it meets the bone that the burr has
//! left in that very tick: a replay meets the same. A tick does not allocate, lock, log or panic.
//! The brain is met where it lies at rest: this hand neither moves it nor feels it move. The hands
//! do not feel each other.
//!
//! # When not to use it
//! To retract the brain: press it with the first hand.

use crate::stages::fault::{AfterFault, Seen};
use crate::stages::haptic_tick::HapticConfig;
use crate::stages::notice::{Notice, What};
use std::sync::Arc;
use trepan_contact::{Contact, ContactManifold, ForceGuard, ForceModel, GuardCounters, GuardedWrench, Viscoelastic};
use trepan_geometry::{Buttons, Pose, Tool, ToolState, Vec3, Wrench};
use trepan_haptics::{Reading, Status};
use trepan_link::wire::{SecondRecord, TickRecord};
use trepan_rigid::{RigidContact, RigidStep};
use trepan_volume::{BoneVolume, DistanceField};

/// The second hand as the picture sees it.
#[derive(Clone, Copy, Debug)]
pub struct SecondView {
    /// Where contact lets the tool be.
    pub world_from_tool: Pose,
    /// Force on the hand, N.
    pub force: Vec3,
}

/// How the second hand fared.
#[derive(Clone, Copy, Debug, Default)]
pub struct SecondOutcome {
    /// The largest force, N.
    pub peak_force_n: f32,
    /// What its force guard did.
    pub guard: GuardCounters,
    /// Force at the very end, N: zero.
    pub end_force_n: f32,
}

/// The state that lives from tick to tick.
pub struct SecondHand {
    config: HapticConfig,
    bone: Option<Arc<BoneVolume>>,
    brain: Option<Arc<DistanceField>>,
    rigid: Box<dyn RigidContact>,
    step: RigidStep,
    tissue: ContactManifold,
    guard: ForceGuard,
    held: Option<ToolState>,
    fault: AfterFault,
    released: bool,
    peak_force_n: f32,
    force_n: f32,
}

impl SecondHand {
    /// A hand whose tool is wherever its device first says. Of the configuration it takes method,
    /// forces, guard and tick.
    pub fn new(config: HapticConfig, bone: Option<Arc<BoneVolume>>, brain: Option<Arc<DistanceField>>) -> Self {
        Self {
            rigid: config.rigid.build(&Self::tool()),
            guard: ForceGuard::new(config.guard),
            config,
            bone,
            brain,
            step: RigidStep::default(),
            tissue: ContactManifold::default(),
            held: None,
            fault: AfterFault::default(),
            released: false,
            peak_force_n: 0.0,
            force_n: 0.0,
        }
    }

    /// What it holds.
    pub fn tool() -> Tool {
        Tool::aspirator()
    }

    /// Where its tool is; `None` before its device has said where.
    pub fn place(&self) -> Option<Pose> {
        self.held.map(|_| self.rigid.proxy())
    }

    /// The tick, after the first hand's of the same number.
    pub fn tick(
        &mut self,
        tick: u64,
        reading: &Reading,
        tell: &mut dyn FnMut(Notice),
    ) -> (GuardedWrench, SecondRecord) {
        let (tool, stale) = self.last_valid_state(reading);
        let proxy = self.touch_bone(&tool);
        self.touch_brain(proxy.translation);
        let lost = reading.status == Status::Lost;
        if let Some(waits) = self.follow_fault(&tool, lost, stale) {
            tell(Notice { tick, time_ms: tool.time_ms, what: What::Force { waits, second: true } });
        }
        let let_go = lost || self.fault.waits() || tool.buttons.has(Buttons::PAUSE);
        let wanted = if let_go { Wrench::ZERO } else { self.desired_wrench(&tool) };
        let wrench = self.guard.guard(wanted, &tool, self.config.dt_ms);
        self.force_n = wrench.force().length();
        self.peak_force_n = self.peak_force_n.max(self.force_n);
        let clamped = wanted.force.length() > self.config.guard.max_force_n;
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

    /// How it fared so far.
    pub fn outcome(&self) -> SecondOutcome {
        let guard = self.guard.counters();
        SecondOutcome { peak_force_n: self.peak_force_n, guard, end_force_n: self.force_n }
    }

    /// The reading, or the last sound one when the device gave nothing usable. The first one says
    /// where the tool begins.
    fn last_valid_state(&mut self, reading: &Reading) -> (ToolState, bool) {
        let fresh = matches!(reading.status, Status::Fresh | Status::Finished) && reading.tool.is_finite();
        let begins = self.held.is_none();
        let last = self.held.unwrap_or(ToolState::at(Pose::IDENTITY));
        let held = if fresh {
            reading.tool
        } else {
            ToolState { twist: Default::default(), time_ms: reading.tool.time_ms, ..last }
        };
        if begins && fresh {
            self.rigid.reset(held.world_from_tool);
        }
        if fresh {
            self.held = Some(held);
        }
        (held, !fresh)
    }

    /// Lets the force go where the device is gone, and come back by a deliberate act only; says
    /// when it does.
    fn follow_fault(&mut self, tool: &ToolState, lost: bool, stale: bool) -> Option<bool> {
        let touches = self.step.manifold.touches() || self.tissue.depth_mm > 0.0;
        let seen = self.config.force_waits.then_some(Seen { lost, stale, touches })?;
        let waits = self.fault.tick(tool, seen, self.config.dt_ms)?;
        match waits {
            true => self.guard.release(),
            false if !self.released => self.guard.resume(),
            false => {}
        }
        Some(waits)
    }

    /// The bone, once the tool is somewhere; gives the proxy.
    fn touch_bone(&mut self, tool: &ToolState) -> Pose {
        let (Some(bone), Some(_)) = (&self.bone, self.held) else { return tool.world_from_tool };
        self.rigid.step(bone, tool, false, self.config.dt_ms, &mut self.step);
        self.rigid.proxy()
    }

    fn touch_brain(&mut self, tip: Vec3) {
        self.tissue.clear();
        let (Some(brain), Some(_)) = (&self.brain, self.held) else { return };
        let radius_mm = Self::tool().tip_radius_mm;
        let depth_mm = radius_mm - brain.sample(tip);
        let normal = brain.gradient(tip).normalize_or_zero();
        if depth_mm > 0.0 && normal != Vec3::ZERO {
            self.tissue.set_single(Contact { point: tip - radius_mm * normal, normal, depth_mm });
        }
    }

    fn desired_wrench(&mut self, tool: &ToolState) -> Wrench {
        let HapticConfig { bone_force, tissue_force, dt_ms, .. } = &mut self.config;
        let bone: &mut Viscoelastic = &mut bone_force.mean;
        bone.wrench(tool, &self.step.manifold, *dt_ms) + tissue_force.wrench(tool, &self.tissue, *dt_ms)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::program::Program;
    use crate::stages::alarms::Limits;
    use trepan_contact::{GuardConfig, Vibration};
    use trepan_volume::VoxelVolume;

    /// Bone under z = 0; brain under z = -8 mm.
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
            program: Program::Craniotomy,
            rigid: trepan_rigid::Method::RECOMMENDED,
            dt_ms: 1.0,
            bone_force: Vibration::drill(Viscoelastic { stiffness: 2.0, damping: 0.5 }),
            tissue_force: Viscoelastic { stiffness: 0.3, damping: 0.3 },
            guard: GuardConfig { ramp_in_ms: 0.0, passivity: None, ..GuardConfig::default() },
            limits: Limits::default(),
            opening_needed: true,
            force_waits: true,
        };
        let bone = with_bone.then(|| Arc::new(BoneVolume::new(&ct, 400).unwrap()));
        SecondHand::new(config, bone, Some(Arc::new(DistanceField::of_mask(&mask))))
    }

    /// Lowers the tip from 5 mm to `z` in 200 ticks, then rests for 200; gives the last record.
    fn lowered(hand: &mut SecondHand, z: f32, status: Status) -> SecondRecord {
        let mut last = SecondRecord::default();
        for tick in 1..=400u32 {
            let share = (tick as f32 / 200.0).min(1.0);
            let mut tool = ToolState::at(Pose::from_translation(Vec3::Z * (5.0 + share * (z - 5.0))));
            tool.time_ms = f64::from(tick);
            let status = if tick > 300 { status } else { Status::Fresh };
            last = hand.tick(tick.into(), &Reading { tool, status }, &mut |_| {}).1;
        }
        last
    }

    #[test]
    fn it_rests_on_bone_and_on_the_brain_with_the_force_of_each() {
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
    fn after_a_loss_force_waits_for_a_deliberate_act() {
        let mut hand = hand(true);
        let mut told = Vec::new();
        let mut time_ms = 0.0;
        let mut run = |ticks: u32, z: f32, buttons: Buttons, status: Status| {
            let mut peak_n = 0f32;
            for _ in 0..ticks {
                time_ms += 1.0;
                let tool = ToolState { buttons, time_ms, ..ToolState::at(Pose::from_translation(Vec3::Z * z)) };
                let done = hand.tick(time_ms as u64, &Reading { tool, status }, &mut |notice| told.push(notice.what));
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
        assert_eq!(told, waits);
    }

    #[test]
    fn nothing_is_felt_before_the_device_says_where_it_is() {
        let mut hand = hand(true);
        let tool = ToolState::at(Pose::from_translation(Vec3::Z * -5.0));
        for tick in 1..50 {
            let (wrench, record) = hand.tick(tick, &Reading { tool, status: Status::Stale }, &mut |_| {});
            assert_eq!((wrench.force(), record.has(TickRecord::STALE)), (Vec3::ZERO, true));
        }
    }
}
