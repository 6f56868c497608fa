// What a test may set or ask of the libdrd emulator. Included by both.
pub const POSITION_X: u32 = 0;
pub const POSITION_Y: u32 = 1;
pub const POSITION_Z: u32 = 2;
pub const VELOCITY_X: u32 = 3;
pub const BUTTONS: u32 = 4;
/// Turn about the device's x axis, rad.
pub const TURN_X: u32 = 5;
pub const DEVICES: u32 = 6;
pub const INITIALISED: u32 = 7;
pub const ACTIVE_WRIST: u32 = 8;
/// 1: every call fails.
pub const UNPLUGGED: u32 = 9;
/// 1: reads come too soon.
pub const TOO_SOON: u32 = 10;
/// Why the force is off.
pub const CAUSE: u32 = 11;
pub const POWER: u32 = 12;
/// 1: auto-initialisation fails.
pub const STUCK: u32 = 13;
/// 1: another program has the device.
pub const BUSY: u32 = 14;
/// Lets this many ms pass without a call.
pub const SILENCE_MS: u32 = 15;

// To ask only.
pub const FORCE_X: u32 = 100;
pub const FORCE_Y: u32 = 101;
pub const FORCE_Z: u32 = 102;
pub const TORQUE_X: u32 = 103;
pub const OPEN: u32 = 106;
pub const FORCE_ON: u32 = 107;
pub const MOVED_BY_ITSELF: u32 = 108;
pub const MISUSE: u32 = 109;
