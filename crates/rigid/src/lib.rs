//! A round tool against voxel bone: contact, proxy and drilling, by interchangeable methods.
//!
//! # Theory
//! Every method answers one call per haptic tick, [`RigidContact::step`]: where may the tool be
//! (its proxy), how deep does the hand press it into the bone, along which normal, and what does
//! the burr take away. The answer is a [`RigidStep`]; a force model makes newtons of it.
//!
//! ```text
//! pose ─→ step ─→ manifold (normal, depth, point) ─→ force model
//!           └──→ proxy (for the picture), bone removed
//! ```
//!
//! # Practice
//! [`Method::RECOMMENDED`] is [`god_object_sphere`], [`brute`] its oracle; `trepan-rivals` has
//! other methods, [`frame`] the parts to write one. A step does not allocate, lock or wait; the
//! same bone and path give the same bytes. The step is the one writer of the
//! [`BoneVolume`](trepan_bone::BoneVolume).
//!
//! ```
//! use trepan_geometry::{Pose, Tool, ToolState, Vec3};
//! use trepan_rigid::{Method, RigidStep};
//! use trepan_bone::BoneVolume;
//! use trepan_volume::VoxelVolume;
//!
//! // Bone below z = 0: the density falls through 400 HU there, with 1000 HU per voxel.
//! let mut ct = VoxelVolume::isotropic([24, 24, 24], Vec3::new(-6.0, -6.0, -9.0), 0.5, 0);
//! for at in 0..ct.data.len() {
//!     let z = -9.0 + 0.5 * (at / (24 * 24)) as f32;
//!     ct.data[at] = (400.0 - 2000.0 * z).clamp(-1000.0, 1500.0) as i16;
//! }
//! let bone = BoneVolume::new(&ct, 400)?;
//! let mut contact = Method::RECOMMENDED.build(&Tool::burr(2.0));
//! contact.reset(Pose::from_translation(Vec3::Z * 2.5));
//! let mut out = RigidStep::default();
//! let tool = ToolState::at(Pose::from_translation(Vec3::Z * 1.7));
//! contact.step(&bone, &tool, false, 1.0, &mut out);
//! assert!((out.manifold.depth_mm - 0.3).abs() < 0.01 && out.manifold.normal.z > 0.999);
//! # Ok::<(), trepan_bone::BoneError>(())
//! ```
//!
//! # When not to use it
//! For soft tissue, or for bones that move: the bone is fixed in the world. Tools that are not
//! round at the tip have `mesh_shell` of `trepan-rivals` and a penalty method only.

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
mod readme {}

mod ball;
pub mod brute;
mod burr;
mod cell;
mod chain;
mod cut_ball;
mod cut_discs;
mod disc;
mod eight;
pub mod frame;
pub mod god_object_sphere;
mod half_spaces;
mod lean;
mod list;
mod local_surface;
mod method;
mod nodes;
pub mod removal;
mod rows;
mod seam;
mod shaft;
mod solid;
pub mod spindle;
mod surface;
pub mod truth;
mod window;

pub use method::{Descriptor, Extent, Method};
pub use seam::{RigidContact, RigidStep};
