//! Emulators of what the makers of haptic devices ship: libHD, libdrd and Haply's service, without
//! a device, with faults on demand.
//!
//! # Theory
//! libHD and libdrd are shared libraries with the makers' symbols and numbers ([`Library`]); the
//! driver loads them as it would load the true ones. Time is the caller's: libHD's servo ticks when
//! it is told to, and libdrd's watchdog is told how long nobody called. Haply's service
//! ([`service::Service`]) is a WebSocket server in this process.
//!
//! # Practice
//! Each emulator keeps the maker's rules (frames, current device, expert mode) and counts who
//! breaks them.
//!
//! # Sources
//! OpenHaptics API reference, Force Dimension SDK reference, Haply Inverse SDK documentation:
//! names, types, numbers and messages only.
//!
//! # When not to use it
//! In anything but tests: no device is behind it.
#![expect(clippy::unwrap_used, reason = "a test may stop where it fails")]

#[path = "../libraries/drd_keys.rs"]
pub mod drd;
#[path = "../libraries/hd_keys.rs"]
pub mod hd;
mod library;
pub mod service;

pub use library::Library;
