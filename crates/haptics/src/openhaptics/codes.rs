//! Numbers of HDAPI, version 3.

/// Handle of no device.
pub(super) const INVALID_HANDLE: u32 = 0xFFFF_FFFF;

// Errors.
pub(super) const SUCCESS: u32 = 0x0000;
pub(super) const WARM_MOTORS: u32 = 0x0200;
pub(super) const EXCEEDED_MAX_FORCE: u32 = 0x0201;
pub(super) const EXCEEDED_MAX_FORCE_IMPULSE: u32 = 0x0202;
pub(super) const EXCEEDED_MAX_VELOCITY: u32 = 0x0203;
pub(super) const FORCE_ERROR: u32 = 0x0204;
pub(super) const DEVICE_FAULT: u32 = 0x0300;
pub(super) const DEVICE_ALREADY_INITIATED: u32 = 0x0301;
pub(super) const COMM_ERROR: u32 = 0x0302;

// Values to read.
pub(super) const CURRENT_BUTTONS: u32 = 0x2000;
pub(super) const CURRENT_VELOCITY: u32 = 0x2051;
pub(super) const CURRENT_TRANSFORM: u32 = 0x2052;
pub(super) const CURRENT_ANGULAR_VELOCITY: u32 = 0x2053;
pub(super) const DEVICE_MODEL_TYPE: u32 = 0x2501;
pub(super) const USABLE_WORKSPACE_DIMENSIONS: u32 = 0x2551;
pub(super) const OUTPUT_DOF: u32 = 0x2554;
pub(super) const CALIBRATION_STYLE: u32 = 0x2555;
pub(super) const NOMINAL_MAX_FORCE: u32 = 0x2603;
pub(super) const NOMINAL_MAX_CONTINUOUS_FORCE: u32 = 0x2604;

// Values to set.
pub(super) const CURRENT_FORCE: u32 = 0x2700;
pub(super) const CURRENT_TORQUE: u32 = 0x2701;

// Capabilities.
pub(super) const FORCE_OUTPUT: u32 = 0x4000;

// Calibration.
pub(super) const CALIBRATION_OK: u32 = 0x5000;
pub(super) const CALIBRATION_NEEDS_UPDATE: u32 = 0x5001;

// Scheduler.
pub(super) const MAX_PRIORITY: u16 = 65535;
pub(super) const CALLBACK_DONE: u32 = 0;
pub(super) const CALLBACK_CONTINUE: u32 = 1;
