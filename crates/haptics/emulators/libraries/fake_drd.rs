//! An emulator of libdrd: the same symbols and numbers, a firmware watchdog, and time that the test
//! advances.
//!
//! Built with `--cfg old` it lacks the functions that old versions lack. An unplugged device has no
//! power and so no force.
#![allow(non_snake_case)]

#[path = "drd_keys.rs"]
mod keys;

use std::ffi::{c_char, c_int, c_uint};
use std::sync::Mutex;

const ID: c_char = 4;
const SETTINGS: usize = keys::SILENCE_MS as usize;

struct Fake {
    settings: [f64; SETTINGS],
    open: bool,
    force_on: bool,
    expert: bool,
    watchdog_ms: f64,
    wrench: [f64; 6],
    moved_by_itself: u32,
    misuse: u32,
}

static FAKE: Mutex<Fake> = Mutex::new(Fake {
    settings: {
        let mut settings = [0.0; SETTINGS];
        settings[keys::DEVICES as usize] = 1.0;
        settings[keys::INITIALISED as usize] = 1.0;
        settings[keys::POWER as usize] = 1.0;
        settings
    },
    open: false,
    force_on: false,
    expert: false,
    watchdog_ms: 0.0,
    wrench: [0.0; 6],
    moved_by_itself: 0,
    misuse: 0,
});

fn with<R>(act: impl FnOnce(&mut Fake) -> R) -> R {
    act(&mut FAKE.lock().unwrap())
}

/// A call to the device: fails when it is unplugged, counts as misuse when the id is wrong.
fn call(id: c_char, act: impl FnOnce(&mut Fake) -> c_int) -> c_int {
    with(|f| {
        if id != ID || !f.open {
            f.misuse += 1;
            return -1;
        }
        if f.is(keys::UNPLUGGED) { -1 } else { act(f) }
    })
}

impl Fake {
    fn get(&self, key: u32) -> f64 {
        self.settings[key as usize]
    }

    fn is(&self, key: u32) -> bool {
        self.get(key) != 0.0
    }

    fn drop_force(&mut self, cause: f64) {
        (self.force_on, self.wrench) = (false, [0.0; 6]);
        self.settings[keys::CAUSE as usize] = cause;
    }
}

#[unsafe(no_mangle)]
pub extern "C" fn fake_set(key: u32, value: f64) {
    with(|f| match key {
        keys::SILENCE_MS if f.watchdog_ms > 0.0 && value > f.watchdog_ms => f.drop_force(3.0),
        keys::SILENCE_MS => {}
        keys::CAUSE if value != 0.0 => f.drop_force(value),
        key => f.settings[key as usize] = value,
    });
}

#[unsafe(no_mangle)]
pub extern "C" fn fake_get(key: u32) -> f64 {
    with(|f| match key {
        keys::FORCE_X..=105 if f.force_on && !f.is(keys::UNPLUGGED) && f.is(keys::POWER) => f.wrench[(key - keys::FORCE_X) as usize],
        keys::FORCE_X..=105 => 0.0,
        keys::OPEN => f64::from(u8::from(f.open)),
        keys::FORCE_ON => f64::from(u8::from(f.force_on)),
        keys::MOVED_BY_ITSELF => f64::from(f.moved_by_itself),
        keys::MISUSE => f64::from(f.misuse),
        key => f.settings[key as usize],
    })
}

#[unsafe(no_mangle)]
pub extern "C" fn dhdGetDeviceCount() -> c_int {
    with(|f| f.get(keys::DEVICES) as c_int)
}

#[unsafe(no_mangle)]
pub extern "C" fn drdOpenID(_: c_char) -> c_int {
    with(|f| {
        if f.open || f.is(keys::BUSY) {
            return -1;
        }
        f.open = true;
        ID.into()
    })
}

#[unsafe(no_mangle)]
pub extern "C" fn drdClose(id: c_char) -> c_int {
    with(|f| {
        if id != ID || !f.open || f.force_on {
            f.misuse += 1;
        }
        (f.open, f.watchdog_ms) = (false, 0.0);
        0
    })
}

#[unsafe(no_mangle)]
pub extern "C" fn dhdGetSystemType(_: c_char) -> c_int {
    33
}

#[unsafe(no_mangle)]
pub extern "C" fn dhdGetSystemName(_: c_char) -> *const c_char {
    c"emulated omega".as_ptr()
}

#[cfg(not(old))]
#[unsafe(no_mangle)]
pub extern "C" fn dhdHasActiveWrist(_: c_char) -> u8 {
    with(|f| u8::from(f.is(keys::ACTIVE_WRIST)))
}

#[unsafe(no_mangle)]
pub extern "C" fn drdIsInitialized(_: c_char) -> u8 {
    with(|f| u8::from(f.is(keys::INITIALISED)))
}

#[unsafe(no_mangle)]
pub extern "C" fn drdAutoInit(id: c_char) -> c_int {
    call(id, |f| {
        f.moved_by_itself += 1;
        if f.is(keys::STUCK) {
            return -1;
        }
        f.settings[keys::INITIALISED as usize] = 1.0;
        0
    })
}

#[unsafe(no_mangle)]
pub extern "C" fn drdStop(_: u8, id: c_char) -> c_int {
    call(id, |_| 0)
}

#[unsafe(no_mangle)]
pub extern "C" fn dhdEnableForce(on: u8, id: c_char) -> c_int {
    call(id, |f| {
        (f.force_on, f.wrench) = (on != 0, [0.0; 6]);
        if on != 0 {
            f.settings[keys::CAUSE as usize] = 0.0;
        }
        0
    })
}

#[unsafe(no_mangle)]
pub extern "C" fn dhdSetGravityCompensation(_: c_int, id: c_char) -> c_int {
    call(id, |_| 0)
}

#[unsafe(no_mangle)]
pub extern "C" fn dhdStop(id: c_char) -> c_int {
    with(|f| f.force_on = false);
    call(id, |_| 0)
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn dhdGetPositionAndOrientationFrame(
    x: *mut f64,
    y: *mut f64,
    z: *mut f64,
    rows: *mut [[f64; 3]; 3],
    id: c_char,
) -> c_int {
    call(id, |f| {
        let (s, c) = f.get(keys::TURN_X).sin_cos();
        unsafe {
            (*x, *y, *z) = (f.get(keys::POSITION_X), f.get(keys::POSITION_Y), f.get(keys::POSITION_Z));
            *rows = [[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]];
        }
        c_int::from(f.is(keys::TOO_SOON))
    })
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn dhdGetLinearVelocity(x: *mut f64, y: *mut f64, z: *mut f64, id: c_char) -> c_int {
    call(id, |f| {
        if f.is(keys::NO_VELOCITY) {
            return -1;
        }
        unsafe { (*x, *y, *z) = (f.get(keys::VELOCITY_X), 0.0, 0.0) };
        0
    })
}

#[cfg(not(old))]
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dhdGetAngularVelocityRad(x: *mut f64, y: *mut f64, z: *mut f64, id: c_char) -> c_int {
    call(id, |_| {
        unsafe { (*x, *y, *z) = (0.0, 0.0, 2.0) };
        0
    })
}

#[unsafe(no_mangle)]
pub extern "C" fn dhdGetButtonMask(_: c_char) -> c_uint {
    with(|f| f.get(keys::BUTTONS) as c_uint)
}

#[unsafe(no_mangle)]
pub extern "C" fn dhdSetForceAndTorqueAndGripperForce(
    x: f64,
    y: f64,
    z: f64,
    a: f64,
    b: f64,
    c: f64,
    _: f64,
    id: c_char,
) -> c_int {
    call(id, |f| {
        if [x, y, z, a, b, c].iter().any(|value| !value.is_finite()) {
            f.misuse += 1;
        }
        if f.is(keys::REFUSES_FORCE) {
            f.wrench = [0.0; 6];
            return -1;
        }
        if f.force_on {
            f.wrench = [x, y, z, a, b, c];
        }
        2 // saturated, still a success
    })
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn dhdGetStatus(status: *mut c_int, id: c_char) -> c_int {
    call(id, |f| {
        let numbers = [(0, f.is(keys::POWER)), (1, true), (5, f.force_on), (6, false)];
        for (place, value) in numbers {
            unsafe { *status.add(place) = c_int::from(value) };
        }
        unsafe { *status.add(14) = f.get(keys::CAUSE) as c_int };
        0
    })
}

#[unsafe(no_mangle)]
pub extern "C" fn dhdErrorGetLastStr() -> *const c_char {
    with(|f| if f.get(keys::DEVICES) == 0.0 { c"no device found".as_ptr() } else { c"some error".as_ptr() })
}

#[unsafe(no_mangle)]
pub extern "C" fn dhdEnableExpertMode() -> c_int {
    with(|f| f.expert = true);
    0
}

#[unsafe(no_mangle)]
pub extern "C" fn dhdDisableExpertMode() -> c_int {
    with(|f| f.expert = false);
    0
}

#[unsafe(no_mangle)]
pub extern "C" fn dhdSetWatchdog(steps: u8, id: c_char) -> c_int {
    call(id, |f| {
        if !f.expert {
            f.misuse += 1;
            return -1;
        }
        if f.is(keys::NO_WATCHDOG) {
            return -1;
        }
        f.watchdog_ms = f64::from(steps) * 0.125;
        0
    })
}
