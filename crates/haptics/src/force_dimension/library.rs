//! Safe wrappers for the functions of libdrd (DHD and DRD).
//!
//! # Sources
//! Force Dimension SDK 3, headers `dhdc.h` and `drdc.h`: names, argument types and numbers only.
#![expect(unsafe_code, reason = "calls into the vendor's C library")]

use crate::DeviceError;
use crate::dynamic::{Loaded, functions, owned};
use std::ffi::{c_char, c_int, c_uint};
use std::path::Path;

const NAMES: &[&str] = if cfg!(windows) {
    &["drd64.dll", "dhd64.dll"]
} else if cfg!(target_os = "macos") {
    &["libdrd.dylib"]
} else {
    &["libdrd.so", "libdrd.so.3"]
};

const INSTALL: &str =
    "install the Force Dimension SDK so that the loader finds libdrd, and on Linux its udev rule for the device";

functions! {
    /// DHD and DRD. The last argument of most is the device's id; C's bool is one byte.
    Functions {
        safe {
            drdOpenID(c_char) -> c_int;
            drdClose(c_char) -> c_int;
            dhdGetSystemType(c_char) -> c_int;
            drdIsInitialized(c_char) -> u8;
            drdAutoInit(c_char) -> c_int;
            drdStop(u8, c_char) -> c_int;
            dhdEnableForce(u8, c_char) -> c_int;
            dhdSetGravityCompensation(c_int, c_char) -> c_int;
            dhdStop(c_char) -> c_int;
            dhdGetButtonMask(c_char) -> c_uint;
            dhdSetForceAndTorqueAndGripperForce(f64, f64, f64, f64, f64, f64, f64, c_char) -> c_int;
            dhdEnableExpertMode() -> c_int;
            dhdDisableExpertMode() -> c_int;
            dhdSetWatchdog(u8, c_char) -> c_int;
        }
        dhdGetDeviceCount() -> c_int;
        dhdGetSystemName(c_char) -> *const c_char;
        dhdGetPositionAndOrientationFrame(*mut f64, *mut f64, *mut f64, *mut [[f64; 3]; 3], c_char) -> c_int;
        dhdGetLinearVelocity(*mut f64, *mut f64, *mut f64, c_char) -> c_int;
        dhdGetStatus(*mut c_int, c_char) -> c_int;
        dhdErrorGetLastStr() -> *const c_char;
    }
}

type AngularVelocity = unsafe extern "system" fn(*mut f64, *mut f64, *mut f64, c_char) -> c_int;
type HasActiveWrist = unsafe extern "system" fn(c_char) -> u8;

/// libdrd, with the functions that older versions lack as options.
#[derive(Clone, Copy)]
pub(super) struct Drd {
    functions: Functions,
    angular_velocity: Option<AngularVelocity>,
    has_active_wrist: Option<HasActiveWrist>,
}

/// The result of a call.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Outcome {
    Done,
    /// The call came too early, so that the library did not query the device.
    TooSoon,
    Failed,
}

impl Outcome {
    /// Converts a return code: negative is a failure; 2 (motors saturated, direction kept) is a
    /// success.
    fn of(code: c_int) -> Self {
        if code < 0 {
            Self::Failed
        } else if code == 1 {
            Self::TooSoon
        } else {
            Self::Done
        }
    }
}

impl Drd {
    pub(super) fn load(path: Option<&Path>) -> Result<Self, DeviceError> {
        let library = Loaded::open(path, NAMES, INSTALL)?;
        Ok(Self {
            functions: Functions::of(&library)?,
            // SAFETY: the types are those of the vendor's header.
            angular_velocity: unsafe { library.symbol("dhdGetAngularVelocityRad") }.ok(),
            // SAFETY: as above.
            has_active_wrist: unsafe { library.symbol("dhdHasActiveWrist") }.ok(),
        })
    }

    pub(super) fn device_count(&self) -> i32 {
        // SAFETY: no arguments.
        unsafe { (self.functions.dhdGetDeviceCount)() }
    }

    /// Id of the device at `index`.
    pub(super) fn open(&self, index: i8) -> Option<i8> {
        i8::try_from((self.functions.drdOpenID)(index as c_char)).ok().filter(|id| *id >= 0)
    }

    pub(super) fn close(&self, id: i8) {
        (self.functions.drdClose)(id as c_char);
    }

    pub(super) fn system_type(&self, id: i8) -> i32 {
        (self.functions.dhdGetSystemType)(id as c_char)
    }

    pub(super) fn system_name(&self, id: i8) -> String {
        // SAFETY: the library returns null or a C string of its own that lives as long as it does.
        unsafe { owned((self.functions.dhdGetSystemName)(id as c_char)) }
    }

    pub(super) fn has_active_wrist(&self, id: i8) -> bool {
        // SAFETY: a number; an invalid id only returns an error.
        self.has_active_wrist.is_some_and(|ask| unsafe { ask(id as c_char) } != 0)
    }

    pub(super) fn is_initialised(&self, id: i8) -> bool {
        (self.functions.drdIsInitialized)(id as c_char) != 0
    }

    /// Lets the device find its zero; it moves by itself.
    pub(super) fn auto_init(&self, id: i8) -> Outcome {
        Outcome::of((self.functions.drdAutoInit)(id as c_char))
    }

    /// Ends regulation, so that the caller's force takes effect.
    pub(super) fn stop_regulation(&self, id: i8) -> Outcome {
        Outcome::of((self.functions.drdStop)(1, id as c_char))
    }

    pub(super) fn enable_force(&self, id: i8, on: bool) -> Outcome {
        Outcome::of((self.functions.dhdEnableForce)(u8::from(on), id as c_char))
    }

    pub(super) fn compensate_gravity(&self, id: i8) -> Outcome {
        Outcome::of((self.functions.dhdSetGravityCompensation)(1, id as c_char))
    }

    /// Turns the motors off and the brakes on.
    pub(super) fn stop(&self, id: i8) {
        (self.functions.dhdStop)(id as c_char);
    }

    /// Sets the firmware watchdog: force is dropped after `steps` of 125 µs without a call.
    pub(super) fn set_watchdog(&self, id: i8, steps: u8) -> Outcome {
        (self.functions.dhdEnableExpertMode)();
        let outcome = Outcome::of((self.functions.dhdSetWatchdog)(steps, id as c_char));
        (self.functions.dhdDisableExpertMode)();
        outcome
    }

    /// Position, m, and rows of the orientation.
    pub(super) fn pose(&self, id: i8) -> (Outcome, [f64; 3], [[f64; 3]; 3]) {
        let (mut p, mut rows) = ([0.0; 3], [[0.0; 3]; 3]);
        let [x, y, z] = &mut p;
        // SAFETY: pointers to the types in the header, valid during the call.
        let code = unsafe { (self.functions.dhdGetPositionAndOrientationFrame)(x, y, z, &raw mut rows, id as c_char) };
        (Outcome::of(code), p, rows)
    }

    /// Linear velocity, m/s; zero until the library has seen enough positions.
    pub(super) fn linear_velocity(&self, id: i8) -> [f64; 3] {
        let mut v = [0.0; 3];
        let [x, y, z] = &mut v;
        // SAFETY: as above.
        let code = unsafe { (self.functions.dhdGetLinearVelocity)(x, y, z, id as c_char) };
        if Outcome::of(code) == Outcome::Failed { [0.0; 3] } else { v }
    }

    /// Angular velocity, rad/s; zero where the library does not provide it.
    pub(super) fn angular_velocity(&self, id: i8) -> [f64; 3] {
        let mut v = [0.0; 3];
        let [x, y, z] = &mut v;
        // SAFETY: as above.
        let code = self.angular_velocity.map_or(-1, |ask| unsafe { ask(x, y, z, id as c_char) });
        if Outcome::of(code) == Outcome::Failed { [0.0; 3] } else { v }
    }

    pub(super) fn buttons(&self, id: i8) -> u32 {
        (self.functions.dhdGetButtonMask)(id as c_char)
    }

    /// Applies a force in N and a torque in N m.
    pub(super) fn set_wrench(&self, id: i8, f: [f64; 3], t: [f64; 3]) -> Outcome {
        let set = self.functions.dhdSetForceAndTorqueAndGripperForce;
        Outcome::of(set(f[0], f[1], f[2], t[0], t[1], t[2], 0.0, id as c_char))
    }

    /// The status values, if the device reports them.
    pub(super) fn status(&self, id: i8) -> Option<[c_int; 32]> {
        let mut status = [0; 32];
        // SAFETY: the header specifies 17 numbers; 32 leave room for later versions.
        let code = unsafe { (self.functions.dhdGetStatus)(status.as_mut_ptr(), id as c_char) };
        (Outcome::of(code) != Outcome::Failed).then_some(status)
    }

    /// The vendor's text for the last error.
    pub(super) fn last_error(&self) -> String {
        // SAFETY: the library returns null or a C string of its own that lives as long as it does.
        unsafe { owned((self.functions.dhdErrorGetLastStr)()) }
    }
}
