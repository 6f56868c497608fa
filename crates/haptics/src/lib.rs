//! Haptic devices behind one trait: read the tool's pose, apply a force checked by the force guard.
//!
//! ```text
//! device ──read──> tool in world space ──> scene ──> wrench ──guard──> GuardedWrench ──> device
//! ```
//!
//! # Practice
//! World space is the patient's RAS+ mm; forces are N, torques N mm. Each driver converts from its
//! vendor's units and axes. A device accepts only a [`GuardedWrench`], which only the force guard
//! creates, so that no force bypasses it. `read` and `apply` are called once per haptic tick. They
//! neither allocate, lock nor wait, unless the device itself sets the rate (documented at the
//! driver).
//!
//! # When not to use it
//! For input that moves a camera or a menu.

mod clutch;
mod descriptor;
mod device;
mod dynamic;
mod error;
mod fault;
pub mod force_dimension;
pub mod haply;
mod latest;
mod list;
pub mod mouse;
pub mod openhaptics;
mod ramp;
pub mod replay;
pub mod script;
mod scripted;
pub mod simulated;
pub mod spacemouse;
pub mod template;
mod threaded;
mod workspace;

pub use clutch::Clutch;
pub use descriptor::{Descriptor, DeviceName, Listed, Motion, NameError, OpenedDevice, Setting, no_argument};
pub use device::{Capabilities, HapticDevice, Reading, Status};
pub use error::DeviceError;
pub use fault::{Fault, Watch};
pub use list::{list, usage};
pub use threaded::ThreadedDevice;
pub use workspace::Workspace;

#[doc(no_inline)]
pub use trepan_contact::GuardedWrench;

/// Largest age of the pose that a hardware driver accepts a force for, ms.
const STALE_MS: f64 = 5.0;

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct ReadmeExamples;
