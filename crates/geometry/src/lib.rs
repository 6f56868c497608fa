//! Geometric data types shared by all Trepan crates: poses, twists, wrenches, tools, boxes,
//! pointshells, units.
//!
//! # Theory
//! A pose is a unit quaternion and a translation, named target first (`world_from_tool`), so that a
//! product of transforms can be checked by its names. Twists and wrenches are pairs of vectors in
//! world axes at the origin of the tool frame.
//!
//! # Practice
//! Units are one consistent set: **mm, ms, g**, hence N, MPa, m/s and N/mm (see [`units`]). World
//! space is the patient's RAS+ mm: x to the patient's right, y to the front, z to the head. Loops
//! use f32 [`Vec3`] (the type that parry3d also uses); offline work uses f64, and only [`bridge`]
//! converts between them.
//!
//! # When not to use it
//! For scene graphs, constraint solving or objects with a life cycle: no type here owns a resource
//! or a clock.

mod aabb;
pub mod bridge;
mod motion;
mod shell;
mod statistics;
mod tool;
mod triangle;
pub mod units;

pub use aabb::Aabb;
pub use glam::{Mat3, Quat, Vec3, Vec4};
pub use glamx::Pose3 as Pose;
pub use motion::{Buttons, ToolState, Twist, Wrench};
pub use shell::{Pointshell, Spread};
pub use statistics::quantile;
pub use tool::{Tool, ToolKind};
pub use triangle::closest_weights;
