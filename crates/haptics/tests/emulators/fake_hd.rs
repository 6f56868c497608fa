//! An emulator of libHD: the same symbols and numbers, no device, and a clock that the test turns.
//!
//! It keeps the frame rules, so that a driver which breaks them fails its test: see `MISUSE`.
#![allow(non_snake_case)]

mod keys {
    include!("hd_keys.rs");
}

use std::ffi::{CStr, c_char, c_ulong, c_void};
use std::sync::Mutex;

const INVALID: u32 = 0xFFFF_FFFF;
const DEVICE: u32 = 3;
const SETTINGS: usize = keys::TICKS as usize;

type Callback = extern "C" fn(*mut c_void) -> u32;

#[derive(Clone, Copy)]
struct Job {
    callback: Callback,
    data: usize,
}

struct Fake {
    settings: [f64; SETTINGS],
    errors: Vec<u32>,
    open: bool,
    initialised: u32,
    enabled: bool,
    running: bool,
    job: Option<Job>,
    in_frame: bool,
    pending: [f64; 6],
    applied: [f64; 6],
    misuse: u32,
}

static FAKE: Mutex<Fake> = Mutex::new(Fake {
    settings: {
        let mut settings = [0.0; SETTINGS];
        settings[keys::CALIBRATION as usize] = 0x5000 as f64;
        settings[keys::OUTPUT_DOF as usize] = 3.0;
        settings[keys::DRIFT as usize] = 1.0;
        settings
    },
    errors: Vec::new(),
    open: false,
    initialised: 0,
    enabled: false,
    running: false,
    job: None,
    in_frame: false,
    pending: [0.0; 6],
    applied: [0.0; 6],
    misuse: 0,
});

fn with<R>(act: impl FnOnce(&mut Fake) -> R) -> R {
    act(&mut FAKE.lock().unwrap())
}

impl Fake {
    fn get(&self, key: u32) -> f64 {
        self.settings[key as usize]
    }

    fn wrong(&mut self, error: u32) {
        self.misuse += 1;
        self.errors.push(error);
    }
}

#[unsafe(no_mangle)]
pub extern "C" fn fake_set(key: u32, value: f64) {
    match key {
        keys::TICKS => tick(value as u32),
        key => with(|f| f.settings[key as usize] = value),
    }
}

#[unsafe(no_mangle)]
pub extern "C" fn fake_get(key: u32) -> f64 {
    with(|f| match key {
        keys::FORCE_X..=keys::TORQUE_X if f.running && f.enabled => f.applied[(key - keys::FORCE_X) as usize],
        keys::FORCE_X..=keys::TORQUE_X => 0.0,
        keys::OPEN => f64::from(u8::from(f.open)),
        keys::RUNNING => f64::from(u8::from(f.running)),
        keys::SCHEDULED => f64::from(u8::from(f.job.is_some())),
        keys::ENABLED => f64::from(u8::from(f.enabled)),
        keys::MISUSE => f64::from(f.misuse),
        keys::INITIALISED => f64::from(f.initialised),
        key => f.settings[key as usize],
    })
}

fn tick(count: u32) {
    for _ in 0..count {
        let Some(job) = with(|f| f.job.filter(|_| f.running)) else { return };
        if (job.callback)(job.data as *mut c_void) == 0 {
            with(|f| f.job = None);
        }
    }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn hdInitDevice(name: *const c_char) -> u32 {
    let name = if name.is_null() { None } else { Some(unsafe { CStr::from_ptr(name) }.to_str().unwrap()) };
    with(|f| {
        let expected = [Some("Default Device"), Some("Left"), None][f.get(keys::NAME) as usize];
        let error = if f.get(keys::UNLICENSED) != 0.0 {
            0x0600
        } else if name != expected {
            0x0300
        } else if f.open {
            0x0301
        } else {
            (f.open, f.initialised) = (true, f.initialised + 1);
            return DEVICE;
        };
        f.errors.push(error);
        INVALID
    })
}

#[unsafe(no_mangle)]
pub extern "C" fn hdDisableDevice(device: u32) {
    with(|f| {
        if device != DEVICE || !f.open || f.running {
            f.wrong(0x0104);
        }
        (f.open, f.applied) = (false, [0.0; 6]);
    });
}

#[unsafe(no_mangle)]
pub extern "C" fn hdMakeCurrentDevice(device: u32) {
    with(|f| {
        if device != DEVICE {
            f.wrong(0x0104);
        }
    });
}

#[unsafe(no_mangle)]
pub extern "C" fn hdBeginFrame(device: u32) {
    with(|f| {
        if f.in_frame || device != DEVICE || !f.open {
            f.wrong(0x0400);
        }
        (f.in_frame, f.pending) = (true, [0.0; 6]);
    });
}

#[unsafe(no_mangle)]
pub extern "C" fn hdEndFrame(_: u32) {
    with(|f| {
        if !f.in_frame {
            f.wrong(0x0401);
        }
        f.in_frame = false;
        let error = f.get(keys::ERROR) as u32;
        if error == 0 {
            f.applied = f.pending;
        } else {
            f.errors.push(error);
            f.applied = [0.0; 6];
        }
    });
}

#[unsafe(no_mangle)]
pub extern "C" fn hdEnable(capability: u32) {
    with(|f| if capability == 0x4000 { f.enabled = true } else { f.wrong(0x0100) });
}

#[unsafe(no_mangle)]
pub extern "C" fn hdDisable(capability: u32) {
    with(|f| if capability == 0x4000 { f.enabled = false } else { f.wrong(0x0100) });
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn hdGetIntegerv(what: u32, out: *mut i32) {
    let value = with(|f| match what {
        0x2000 => f.get(keys::BUTTONS) as i32,
        0x2554 => f.get(keys::OUTPUT_DOF) as i32,
        0x2555 => 0b110,
        _ => {
            f.wrong(0x0100);
            0
        }
    });
    unsafe { *out = value };
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn hdGetDoublev(what: u32, out: *mut f64) {
    let values: Vec<f64> = with(|f| match what {
        0x2051 => vec![f.get(keys::VELOCITY_X), 0.0, 0.0],
        0x2053 => vec![0.0, 0.5, 0.0],
        0x2052 => {
            let (s, c) = f.get(keys::TURN_Y).sin_cos();
            let d = f.get(keys::DRIFT);
            let p = [keys::POSITION_X, keys::POSITION_Y, keys::POSITION_Z].map(|key| f.get(key));
            vec![c * d, 0.0, -s, 0.0, 0.0, 1.0, 0.0, 0.0, s, 0.0, c * d, 0.0, p[0], p[1], p[2], 1.0]
        }
        0x2551 => vec![-80.0, -60.0, -35.0, 80.0, 60.0, 35.0],
        0x2603 => vec![3.3],
        0x2604 => vec![0.88],
        _ => {
            f.wrong(0x0100);
            vec![]
        }
    });
    for (i, value) in values.iter().enumerate() {
        unsafe { *out.add(i) = *value };
    }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn hdSetDoublev(what: u32, values: *const f64) {
    let values = [0, 1, 2].map(|i| unsafe { *values.add(i) });
    with(|f| {
        let torque = f.get(keys::OUTPUT_DOF) >= 6.0;
        match what {
            _ if !f.in_frame => f.wrong(0x0402),
            0x2700 => f.pending[..3].copy_from_slice(&values),
            0x2701 if torque => f.pending[3..].copy_from_slice(&values),
            _ => f.wrong(0x0100),
        }
    });
}

#[unsafe(no_mangle)]
pub extern "C" fn hdGetString(_: u32) -> *const c_char {
    c"Emulated Touch".as_ptr()
}

#[repr(C)]
pub struct ErrorInfo {
    code: u32,
    internal: i32,
    device: u32,
}

#[unsafe(no_mangle)]
pub extern "C" fn hdGetError() -> ErrorInfo {
    ErrorInfo { code: with(|f| f.errors.pop().unwrap_or(0)), internal: -1, device: DEVICE }
}

#[unsafe(no_mangle)]
pub extern "C" fn hdGetErrorString(code: u32) -> *const c_char {
    match code {
        0x0300 => c"Device fault".as_ptr(),
        0x0600 => c"Invalid license".as_ptr(),
        _ => c"Some error".as_ptr(),
    }
}

#[unsafe(no_mangle)]
pub extern "C" fn hdCheckCalibration() -> u32 {
    with(|f| f.get(keys::CALIBRATION) as u32)
}

#[unsafe(no_mangle)]
pub extern "C" fn hdUpdateCalibration(style: u32) {
    with(|f| {
        if style != 0b010 || f.applied != [0.0; 6] {
            f.wrong(0x0101);
        }
        // The device now knows better where it is: its position jumps.
        f.settings[keys::POSITION_X as usize] += 30.0;
        f.settings[keys::CALIBRATION as usize] = f64::from(0x5000);
    });
}

#[unsafe(no_mangle)]
pub extern "C" fn hdStartScheduler() {
    with(|f| f.running = true);
}

#[unsafe(no_mangle)]
pub extern "C" fn hdStopScheduler() {
    with(|f| (f.running, f.applied) = (false, [0.0; 6]));
}

#[unsafe(no_mangle)]
pub extern "C" fn hdSetSchedulerRate(hz: c_ulong) {
    with(|f| if hz != 500 && hz != 1000 && hz != 2000 { f.wrong(0x0101) });
}

#[unsafe(no_mangle)]
pub extern "C" fn hdScheduleAsynchronous(callback: Callback, data: *mut c_void, _: u16) -> c_ulong {
    with(|f| f.job = Some(Job { callback, data: data as usize }));
    1
}

#[unsafe(no_mangle)]
pub extern "C" fn hdUnschedule(_: c_ulong) {
    with(|f| {
        if f.running {
            f.wrong(0x0102);
        }
        f.job = None;
    });
}
