//! The records that loops send to one another and to files: one tick, one collision step, one
//! solver step, one event.
//!
//! # Practice
//! Plain data in mm, ms, N; world space is the patient's RAS+ mm. Everything but [`EventRecord`]
//! and [`SessionHeader`] is `Copy` and may be sent from a real-time loop. A record holds what a
//! replay needs to make the same forces again, bit for bit, and nothing that names a patient.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use trepan_geometry::{Pose, Twist, Vec3, Wrench};

/// One tick of the haptic loop.
#[derive(Clone, Copy, Debug)]
pub struct TickRecord {
    /// Number of the tick, from 0.
    pub tick: u64,
    /// Session time at which the device was read, ms.
    pub time_ms: f64,
    /// Where the device held the tool, `world_from_tool`.
    pub device: Pose,
    /// How the device moved it.
    pub twist: Twist,
    /// Pressed buttons, one bit each.
    pub buttons: u32,
    /// Where contact let the tool be, `world_from_tool`.
    pub proxy: Pose,
    /// What went to the hand after the guard.
    pub wrench: Wrench,
    /// The tissue's part of that force, N; only with [`TickRecord::TISSUE`], read it by
    /// [`tissue_n`](Self::tissue_n).
    pub tissue_force: Vec3,
    /// Unit normal of the contact out of the obstacle; zero without contact.
    pub contact_normal: Vec3,
    /// Depth in bone, mm.
    pub depth_mm: f32,
    /// Depth in tissue, mm.
    pub tissue_depth_mm: f32,
    /// Bone removed in this tick, mm³; negative where a stroke was undone.
    pub removed_mm3: f32,
    /// Speed of the drill's spindle, 1/min: 0 when it is off or has stalled.
    pub spindle_rpm: f32,
    /// Distance from the tip to the brain's surface at rest, mm; negative inside. Of a craniotome,
    /// from its cutting part above the foot.
    pub brain_distance_mm: f32,
    /// Sequence number of the surface patch that the tick used.
    pub patch_seq: u64,
    /// Time that the tick's computation took, µs.
    pub compute_us: f32,
    /// See [`TickRecord::LATE`] and its like.
    pub flags: u32,
    /// Phase of the operation.
    pub phase: u8,
    /// Which tool of the tray.
    pub tool: u8,
}

impl TickRecord {
    /// The tick began after its deadline.
    pub const LATE: u32 = 1;
    /// The tick reused an earlier collision result.
    pub const HELD: u32 = 1 << 1;
    /// The guard limited the force.
    pub const CLAMPED: u32 = 1 << 2;
    /// The drill turned.
    pub const DRILLING: u32 = 1 << 3;
    /// The device gave an old pose.
    pub const STALE: u32 = 1 << 4;
    /// The force was being let go at the end.
    pub const RELEASED: u32 = 1 << 5;
    /// The device was gone; no force was wanted.
    pub const LOST: u32 = 1 << 6;
    /// The burr came through the bone, for the first time in its stroke.
    pub const THROUGH: u32 = 1 << 7;
    /// [`tissue_force`](Self::tissue_force) is known; not in recordings of before it was kept.
    pub const TISSUE: u32 = 1 << 8;

    /// Whether every flag of `mask` is set.
    pub fn has(&self, mask: u32) -> bool {
        self.flags & mask == mask
    }

    /// Force of the tissue on the hand, N. In recordings of before it was kept it is the whole
    /// force where no bone was touched, else 0.
    pub fn tissue_n(&self) -> f32 {
        match (self.has(Self::TISSUE), self.tissue_depth_mm > 0.0 && self.depth_mm == 0.0) {
            (true, _) => self.tissue_force.length(),
            (false, true) => self.wrench.force.length(),
            (false, false) => 0.0,
        }
    }

    /// Unit normal out of the tissue; that of the contact where the tissue gives no force of its
    /// own.
    pub fn tissue_normal(&self) -> Vec3 {
        self.tissue_force.try_normalize().unwrap_or(self.contact_normal)
    }
}

impl Default for TickRecord {
    fn default() -> Self {
        Self {
            tick: 0,
            time_ms: 0.0,
            device: Pose::IDENTITY,
            twist: Twist::default(),
            buttons: 0,
            proxy: Pose::IDENTITY,
            wrench: Wrench::ZERO,
            tissue_force: Vec3::ZERO,
            contact_normal: Vec3::ZERO,
            depth_mm: 0.0,
            tissue_depth_mm: 0.0,
            removed_mm3: 0.0,
            spindle_rpm: 0.0,
            brain_distance_mm: 0.0,
            patch_seq: 0,
            compute_us: 0.0,
            flags: 0,
            phase: 0,
            tool: 0,
        }
    }
}

/// One tick of the second hand.
#[derive(Clone, Copy, Debug)]
pub struct SecondRecord {
    /// Number of the tick, as the first hand's.
    pub tick: u64,
    /// Session time at which the device was read, ms.
    pub time_ms: f64,
    /// Where the device held the tool, `world_from_tool`.
    pub device: Pose,
    /// How the device moved it.
    pub twist: Twist,
    /// Pressed buttons, one bit each.
    pub buttons: u32,
    /// Where contact let the tool be, `world_from_tool`.
    pub proxy: Pose,
    /// What went to the hand after the guard.
    pub wrench: Wrench,
    /// Depth in bone, mm.
    pub depth_mm: f32,
    /// Depth in the brain at rest, mm.
    pub tissue_depth_mm: f32,
    /// As in [`TickRecord`]: `STALE`, `LOST`, `RELEASED`, `CLAMPED`.
    pub flags: u32,
}

impl SecondRecord {
    /// Whether every flag of `mask` is set.
    pub fn has(&self, mask: u32) -> bool {
        self.flags & mask == mask
    }
}

impl Default for SecondRecord {
    fn default() -> Self {
        Self {
            tick: 0,
            time_ms: 0.0,
            device: Pose::IDENTITY,
            twist: Twist::default(),
            buttons: 0,
            proxy: Pose::IDENTITY,
            wrench: Wrench::ZERO,
            depth_mm: 0.0,
            tissue_depth_mm: 0.0,
            flags: 0,
        }
    }
}

/// One step of the collision loop between tool and tissue.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CollisionRecord {
    /// Number of the collision step; [`SolverRecord::contact_seq`] refers to it.
    pub seq: u64,
    /// Haptic tick whose tool pose was used.
    pub tick: u64,
    /// Solver step whose positions were used.
    pub solver_step: u64,
    /// Depth found, mm.
    pub depth_mm: f32,
    /// Shell points inside the tissue.
    pub points: u32,
    /// Time that the step took, µs.
    pub compute_us: f32,
}

/// One step of the tissue solver.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SolverRecord {
    /// Number of the step.
    pub step: u64,
    /// Collision step whose contact loaded the tissue.
    pub contact_seq: u64,
    /// Simulated time, ms.
    pub time_ms: f64,
    /// Largest displacement from rest, mm.
    pub max_displacement_mm: f32,
    /// Elements turned inside out.
    pub inverted: u32,
    /// Time that the step took, µs.
    pub compute_us: f32,
}

/// Something that happened once: a warning, a phase change, a device fault.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct EventRecord {
    /// Haptic tick in which it happened.
    pub tick: u64,
    /// Session time, ms.
    pub time_ms: f64,
    /// What sort: `phase`, `warning`, `device`, `score`...; `warning` and `error` also set the
    /// level that viewers show.
    pub kind: String,
    /// In words, for a reader.
    pub text: String,
}

/// What a teacher shows a trainee and asks of the simulator: a second tool, a marker on the
/// anatomy, a pause, trouble.
#[derive(Clone, Copy, Debug)]
pub struct TeacherRecord {
    /// Number of the record, from 1.
    pub seq: u64,
    /// Where the teacher holds a ghost of the tool, `world_from_tool`.
    pub ghost: Pose,
    /// Where the marker is, world mm.
    pub marker: Vec3,
    /// See [`TeacherRecord::GHOST`] and its like.
    pub flags: u32,
}

impl TeacherRecord {
    /// The ghost is to be seen.
    pub const GHOST: u32 = 1;
    /// The marker is to be seen.
    pub const MARKER: u32 = 1 << 1;
    /// The teacher asks for a pause.
    pub const PAUSE: u32 = 1 << 2;
    /// The drill shall have no power.
    pub const NO_POWER: u32 = 1 << 3;
    /// The trainee shall be told that the patient bleeds.
    pub const BLEEDING: u32 = 1 << 4;
}

impl Default for TeacherRecord {
    fn default() -> Self {
        Self { seq: 0, ghost: Pose::IDENTITY, marker: Vec3::ZERO, flags: 0 }
    }
}

/// What a session was: enough to run it again, and no patient's name, number, date or folder.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct SessionHeader {
    /// Program that recorded.
    pub app: String,
    /// Its version.
    pub version: String,
    /// Name of the case: the built-in one's, or a pseudonym that the user chose.
    pub case: String,
    /// Seed of everything random.
    pub seed: u64,
    /// Hashes of the inputs, by name, hexadecimal.
    pub hashes: BTreeMap<String, String>,
    /// The configuration, by name.
    pub config: BTreeMap<String, String>,
}
