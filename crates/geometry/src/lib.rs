//! Plain geometric data that every Trepan crate shares: poses, twists, wrenches, tools, boxes,
//! point shells, units.
//!
//! # Theory
//! Rigid motion in the plainest form: a pose is a unit quaternion and a translation, written target
//! first (`world_from_tool`), so that a product of transforms reads as its own check. Twists and
//! wrenches are pairs of vectors in world axes at the origin of the tool frame.
//!
//! # Practice
//! Units are one consistent set: **mm, ms, g**, hence N, MPa, m/s and N/mm (see [`units`]). World
//! space is the patient's RAS+ mm: x to the patient's right, y to the front, z to the head. Loops
//! use f32 [`Vec3`] (the one that parry3d uses too); offline work uses f64, and [`bridge`] is the
//! only place where one becomes the other.
//!
//! # When not to use it
//! For scene graphs, constraint solving or anything with a life cycle: nothing here owns a resource
//! or has a clock.

mod aabb;
pub mod bridge;
mod motion;
mod shell;
mod tool;
pub mod units;

pub use aabb::Aabb;
pub use glam::{Mat3, Quat, Vec3, Vec4};
pub use glamx::Pose3 as Pose;
pub use motion::{Buttons, ToolState, Twist, Wrench};
pub use shell::{Pointshell, Spread};
pub use tool::{Tool, ToolKind};
