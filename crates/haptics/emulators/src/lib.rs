//! Emulators of the vendors' software, libHD, libdrd and Haply's service, with faults on demand.
//!
//! # Theory
//! libHD and libdrd are shared libraries with the makers' symbols and numbers ([`Library`]); the
//! driver loads them like the real ones. The caller controls time: it triggers libHD's servo ticks
//! and tells libdrd's watchdog how long there was no call. Haply's service ([`service::Service`])
//! is a WebSocket server in this process.
//!
//! # Practice
//! Each emulator enforces the maker's rules (frames, current device, expert mode) and counts
//! violations.
//!
//! # Sources
//! OpenHaptics API reference, Force Dimension SDK reference, Haply Inverse SDK documentation:
//! names, types, numbers and messages only.
//!
//! # When not to use it
//! Outside tests: no device is behind it.
#![expect(clippy::unwrap_used, reason = "a test may stop where it fails")]

#[path = "../libraries/drd_keys.rs"]
pub mod drd;
#[path = "../libraries/hd_keys.rs"]
pub mod hd;
mod library;
pub mod service;

pub use library::Library;
