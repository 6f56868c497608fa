//! Keys that a test may set in or read from libdrd's emulator.

/// Position, m, the maker's axes.
pub const POSITION_X: u32 = 0;
/// See [`POSITION_X`].
pub const POSITION_Y: u32 = 1;
/// See [`POSITION_X`].
pub const POSITION_Z: u32 = 2;
/// Velocity, m/s.
pub const VELOCITY_X: u32 = 3;
/// Buttons, as bits.
pub const BUTTONS: u32 = 4;
/// Turn about the device's x axis, rad.
pub const TURN_X: u32 = 5;
/// How many devices are connected.
pub const DEVICES: u32 = 6;
/// 1: the device knows its zero.
pub const INITIALISED: u32 = 7;
/// 1: the wrist is driven.
pub const ACTIVE_WRIST: u32 = 8;
/// 1: every call fails.
pub const UNPLUGGED: u32 = 9;
/// 1: reads come too soon.
pub const TOO_SOON: u32 = 10;
/// Why the force is off: 1 button, 2 velocity, 3 watchdog, 4 software, 5 USB, 6 dead-man.
pub const CAUSE: u32 = 11;
/// 1: there is power.
pub const POWER: u32 = 12;
/// 1: auto-initialisation fails.
pub const STUCK: u32 = 13;
/// 1: another program uses the device.
pub const BUSY: u32 = 14;
/// 1: forces are refused.
pub const REFUSES_FORCE: u32 = 15;
/// 1: the velocity is unknown.
pub const NO_VELOCITY: u32 = 16;
/// 1: the firmware has no watchdog.
pub const NO_WATCHDOG: u32 = 17;
/// Advances time by this many ms without a call.
pub const SILENCE_MS: u32 = 18;

// Read-only.
/// Force on the motors, N, the maker's axes.
pub const FORCE_X: u32 = 100;
/// See [`FORCE_X`].
pub const FORCE_Y: u32 = 101;
/// See [`FORCE_X`].
pub const FORCE_Z: u32 = 102;
/// Torque on the motors, N m.
pub const TORQUE_X: u32 = 103;
/// Whether the device is open.
pub const OPEN: u32 = 106;
/// Whether its force is switched on.
pub const FORCE_ON: u32 = 107;
/// How often the device moved by itself.
pub const MOVED_BY_ITSELF: u32 = 108;
/// How often a rule of the library was broken.
pub const MISUSE: u32 = 109;
