//! The records exchanged between loops and written to files: ticks, collision steps, solver steps,
//! events.
//!
//! # Practice
//! Plain data in mm, ms, N; world space is the patient's RAS+ mm. All records except
//! [`EventRecord`] and [`SessionHeader`] are `Copy` and may be sent from a real-time loop. A record
//! contains everything that a replay needs for bit-identical forces, and nothing that identifies a
//! patient.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use trepan_geometry::{Pose, Twist, Vec3, Wrench};

/// One tick of the haptic loop.
#[derive(Clone, Copy, Debug, Default)]
pub struct TickRecord {
    /// Number of the tick, from 0.
    pub tick: u64,
    /// Session time at which the device was read, ms.
    pub time_ms: f64,
    /// Device pose, `world_from_tool`.
    pub device: Pose,
    /// Device velocity.
    pub twist: Twist,
    /// Pressed buttons, one bit each.
    pub buttons: u32,
    /// Proxy pose, `world_from_tool`.
    pub proxy: Pose,
    /// Wrench applied to the hand, after the guard.
    pub wrench: Wrench,
    /// The tissue's part of that force, N, if [`TickRecord::TISSUE`] is set; read it by
    /// [`tissue_n`](Self::tissue_n).
    pub tissue_force: Vec3,
    /// Unit contact normal out of the obstacle; zero without contact.
    pub contact_normal: Vec3,
    /// Penetration depth in bone, mm.
    pub depth_mm: f32,
    /// Penetration depth in tissue, mm.
    pub tissue_depth_mm: f32,
    /// Bone removed in this tick, mm³; negative if a stroke was undone.
    pub removed_mm3: f32,
    /// Spindle speed, 1/min; 0 when off or stalled.
    pub spindle_rpm: f32,
    /// Distance from the tip to the brain's rest surface, mm; negative inside. For a craniotome,
    /// from its cutting part above the foot.
    pub brain_distance_mm: f32,
    /// Sequence number of the surface patch that the tick used.
    pub patch_seq: u64,
    /// Computation time of the tick, µs.
    pub compute_us: f32,
    /// Flags: [`TickRecord::LATE`] and others.
    pub flags: u32,
    /// Phase of the operation.
    pub phase: u8,
    /// Index of the tool in the tray.
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
    /// The device returned an old pose.
    pub const STALE: u32 = 1 << 4;
    /// The force was being ramped down at the end.
    pub const RELEASED: u32 = 1 << 5;
    /// The device was lost; no force was requested.
    pub const LOST: u32 = 1 << 6;
    /// The burr broke through the bone, for the first time in its stroke.
    pub const THROUGH: u32 = 1 << 7;
    /// [`tissue_force`](Self::tissue_force) is set; not in older recordings.
    pub const TISSUE: u32 = 1 << 8;
    /// A stroke was being undone or redone.
    pub const UNDOING: u32 = 1 << 9;

    /// Whether every flag of `mask` is set.
    pub fn has(&self, mask: u32) -> bool {
        self.flags & mask == mask
    }

    /// Force of the tissue on the hand, N. In older recordings without it, the whole force if no
    /// bone was touched, else 0.
    pub fn tissue_n(&self) -> f32 {
        match (self.has(Self::TISSUE), self.tissue_depth_mm > 0.0 && self.depth_mm == 0.0) {
            (true, _) => self.tissue_force.length(),
            (false, true) => self.wrench.force.length(),
            (false, false) => 0.0,
        }
    }

    /// Unit normal out of the tissue; the contact normal if the tissue force is zero.
    pub fn tissue_normal(&self) -> Vec3 {
        self.tissue_force.try_normalize().unwrap_or(self.contact_normal)
    }
}

/// One tick of the second hand.
#[derive(Clone, Copy, Debug, Default)]
pub struct SecondRecord {
    /// Number of the tick, equal to the first hand's.
    pub tick: u64,
    /// Session time at which the device was read, ms.
    pub time_ms: f64,
    /// Device pose, `world_from_tool`.
    pub device: Pose,
    /// Device velocity.
    pub twist: Twist,
    /// Pressed buttons, one bit each.
    pub buttons: u32,
    /// Proxy pose, `world_from_tool`.
    pub proxy: Pose,
    /// Wrench applied to the hand, after the guard.
    pub wrench: Wrench,
    /// Penetration depth in bone, mm.
    pub depth_mm: f32,
    /// Penetration depth in the brain, mm; at rest where none deforms.
    pub tissue_depth_mm: f32,
    /// Flags as in [`TickRecord`]: `STALE`, `LOST`, `RELEASED`, `CLAMPED`.
    pub flags: u32,
}

impl SecondRecord {
    /// Whether every flag of `mask` is set.
    pub fn has(&self, mask: u32) -> bool {
        self.flags & mask == mask
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
    /// Penetration depth, mm.
    pub depth_mm: f32,
    /// Pointshell points inside the tissue.
    pub points: u32,
    /// Computation time of the step, µs.
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
    /// Number of inverted elements.
    pub inverted: u32,
    /// Computation time of the step, µs.
    pub compute_us: f32,
    /// 1 from the first step of a cheaper solver on, else 0.
    pub cheaper: u32,
    /// Splits of nodes by cuts that the solver has.
    pub splits: u32,
}

/// A single event: a warning, a phase change, a device fault.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct EventRecord {
    /// Haptic tick in which it happened.
    pub tick: u64,
    /// Session time, ms.
    pub time_ms: f64,
    /// Kind: `phase`, `warning`, `device`...; `warning` and `error` also set the level in viewers.
    /// Older recordings have their scores here, as `score`.
    pub kind: String,
    /// Text for a reader.
    pub text: String,
}

/// A teacher's state: a ghost tool, a marker on the anatomy, a pause, simulated complications.
#[derive(Clone, Copy, Debug, Default)]
pub struct TeacherRecord {
    /// Number of the record, from 1.
    pub seq: u64,
    /// Pose of the ghost tool, `world_from_tool`.
    pub ghost: Pose,
    /// Position of the marker, world mm.
    pub marker: Vec3,
    /// Flags: [`TeacherRecord::GHOST`] and others.
    pub flags: u32,
}

impl TeacherRecord {
    /// The ghost is visible.
    pub const GHOST: u32 = 1;
    /// The marker is visible.
    pub const MARKER: u32 = 1 << 1;
    /// The teacher requests a pause.
    pub const PAUSE: u32 = 1 << 2;
    /// The drill has no power.
    pub const NO_POWER: u32 = 1 << 3;
    /// The trainee sees a bleeding warning.
    pub const BLEEDING: u32 = 1 << 4;
}

/// State of a shared session at a tick, for who joins late.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct StateRecord {
    /// Number of the tick.
    pub tick: u64,
    /// Session time, ms.
    pub time_ms: f64,
    /// The state, in words that only the session's stages know.
    pub words: Vec<u64>,
    /// Checksum of the words.
    pub checksum: u32,
}

impl StateRecord {
    /// Checksum of words, as a whole record has it.
    pub fn sum(words: &[u64]) -> u32 {
        let mut sum = crc32fast::Hasher::new();
        words.iter().for_each(|word| sum.update(&word.to_le_bytes()));
        sum.finalize()
    }
}

/// Description of a session: enough to repeat it, without a patient's name, number, date or folder.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct SessionHeader {
    /// Recording program.
    pub app: String,
    /// Its version.
    pub version: String,
    /// Name of the case: the built-in one's, or a user's pseudonym.
    pub case: String,
    /// Seed of all random numbers.
    pub seed: u64,
    /// Hashes of the inputs, by name, hexadecimal.
    pub hashes: BTreeMap<String, String>,
    /// The configuration, by name.
    pub config: BTreeMap<String, String>,
}
