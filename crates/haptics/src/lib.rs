//! Haptic devices behind one seam: read where the tool is, apply a force that a guard has passed.
//!
//! ```text
//!   device ──read──> tool in world space ──> scene ──> wrench ──guard──> GuardedWrench ──apply──> device
//! ```
//!
//! # Practice
//! World space is the patient's RAS+ mm; forces are N, torques N mm. Each driver converts from its
//! vendor's units and axes. A device takes nothing but a [`GuardedWrench`], which only the force
//! guard makes: no path goes round it. `read` and `apply` are called once per haptic tick; they
//! neither allocate, lock nor wait, unless the device itself is the clock (documented at the
//! driver).
//!
//! # When not to use it
//! For input that moves a camera or a menu.

mod clutch;
mod device;
mod dynamic;
mod error;
mod fault;
pub mod force_dimension;
pub mod haply;
pub mod hardware;
pub mod mouse;
mod name;
pub mod openhaptics;
mod ramp;
pub mod replay;
pub mod script;
pub mod simulated;
pub mod spacemouse;
pub mod template;
mod threaded;
mod workspace;

pub use clutch::Clutch;
pub use device::{Capabilities, HapticDevice, Reading, Status};
pub use error::DeviceError;
pub use fault::{Fault, Watch};
pub use name::{DeviceName, Listed, NameError, list};
pub use threaded::ThreadedDevice;
pub use workspace::Workspace;

#[doc(no_inline)]
pub use trepan_contact::GuardedWrench;

/// A driver of metal gives no force that was made for a pose older than this, ms.
const STALE_MS: f64 = 5.0;

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct ReadmeExamples;
