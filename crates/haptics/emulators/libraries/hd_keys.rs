//! Keys that a test may set in or read from libHD's emulator.

// Of the first device; use `of_second` for the second.
/// Position, mm.
pub const POSITION_X: u32 = 0;
/// See [`POSITION_X`].
pub const POSITION_Y: u32 = 1;
/// See [`POSITION_X`].
pub const POSITION_Z: u32 = 2;
/// Velocity, mm/s; over 1000 the device rejects force.
pub const VELOCITY_X: u32 = 3;
/// Buttons, as bits.
pub const BUTTONS: u32 = 4;
/// Turn about the device's y axis, rad.
pub const TURN_Y: u32 = 5;
/// The calibration state that the device reports.
pub const CALIBRATION: u32 = 6;
/// Driven axes: 3 or 6.
pub const OUTPUT_DOF: u32 = 7;
/// An error that each end of a frame raises, until set to 0.
pub const ERROR: u32 = 8;
/// The name of the device: 0 `Default Device`, 1 `Left`, 2 only no name at all, 3 `Right`; -1 for
/// no device.
pub const NAME: u32 = 9;
/// Factor on the transform's columns, as drift.
pub const DRIFT: u32 = 10;
/// Heat that a tick of 1 N adds; at 1 the motors are too warm.
pub const HEATING: u32 = 11;
/// 1: another program uses the device.
pub const TAKEN: u32 = 12;

// Of the library.
/// 1: there is no licence.
pub const UNLICENSED: u32 = 50;
/// Runs the scheduler for so many ticks, on the caller's thread.
pub const TICKS: u32 = 51;
/// 1: the scheduler does not start.
pub const STUCK: u32 = 52;

// Read-only, of a device.
/// Force on the motors, N.
pub const FORCE_X: u32 = 100;
/// See [`FORCE_X`].
pub const FORCE_Y: u32 = 101;
/// See [`FORCE_X`].
pub const FORCE_Z: u32 = 102;
/// Torque on the motors, N mm.
pub const TORQUE_X: u32 = 103;
/// Whether the device is open.
pub const OPEN: u32 = 106;
/// Whether its force is switched on.
pub const ENABLED: u32 = 107;
// Read-only, of the library.
/// Whether the scheduler runs.
pub const RUNNING: u32 = 150;
/// Whether something is scheduled.
pub const SCHEDULED: u32 = 151;
/// How often a rule of the library was broken.
pub const MISUSE: u32 = 152;
/// How many devices were initialised so far.
pub const INITIALISED: u32 = 153;

/// The key for the second device.
pub const fn of_second(key: u32) -> u32 {
    key + 1000
}
