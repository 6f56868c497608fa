// What a test may set or ask of the libHD emulator. Included by both.
pub const POSITION_X: u32 = 0;
pub const POSITION_Y: u32 = 1;
pub const POSITION_Z: u32 = 2;
pub const VELOCITY_X: u32 = 3;
pub const BUTTONS: u32 = 4;
/// Turn about the device's y axis, rad.
pub const TURN_Y: u32 = 5;
pub const CALIBRATION: u32 = 6;
pub const OUTPUT_DOF: u32 = 7;
/// An error that each end of a frame raises, until it is set to 0.
pub const ERROR: u32 = 8;
/// The name that the device answers to: 0 `Default Device`, 1 `Left`, 2 only no name at all.
pub const NAME: u32 = 9;
/// 1: there is no licence.
pub const UNLICENSED: u32 = 10;
/// Factor on the transform's columns, as drift.
pub const DRIFT: u32 = 11;
/// Lets the scheduler run for so many ticks, on the caller's thread.
pub const TICKS: u32 = 12;

// To ask only.
pub const FORCE_X: u32 = 100;
pub const FORCE_Y: u32 = 101;
pub const FORCE_Z: u32 = 102;
pub const TORQUE_X: u32 = 103;
pub const OPEN: u32 = 104;
pub const RUNNING: u32 = 105;
pub const SCHEDULED: u32 = 106;
pub const ENABLED: u32 = 107;
pub const MISUSE: u32 = 108;
pub const INITIALISED: u32 = 109;
