//! An emulator of libHD: the same symbols and numbers, up to two devices, one scheduler, and a
//! clock that the test advances.
//!
//! It enforces the library's rules, so that a driver that breaks them fails its test: see `MISUSE`.
//! Frames and values belong to the current device. A frame begins once per device and tick. Devices
//! are added and removed while the scheduler is stopped. One callback serves all: of two, one would
//! get no force.
#![allow(non_snake_case)]

#[path = "hd_keys.rs"]
mod keys;

use std::ffi::{CStr, c_char, c_ulong, c_void};
use std::sync::Mutex;

const INVALID: u32 = 0xFFFF_FFFF;
/// Handle of the first device.
const FIRST: u32 = 3;
const DEVICES: usize = 2;
const SETTINGS: usize = keys::TAKEN as usize + 1;
const FASTEST_MM_PER_S: f64 = 1000.0;

type Callback = extern "C" fn(*mut c_void) -> u32;

#[derive(Clone, Copy)]
struct Job {
    callback: Callback,
    data: usize,
}

#[derive(Clone, Copy)]
struct Device {
    settings: [f64; SETTINGS],
    open: bool,
    enabled: bool,
    in_frame: bool,
    framed: bool,
    pending: [f64; 6],
    applied: [f64; 6],
    heat: f64,
}

struct Fake {
    devices: [Device; DEVICES],
    current: usize,
    errors: Vec<(u32, u32)>,
    unlicensed: bool,
    stuck: bool,
    initialised: u32,
    running: bool,
    job: Option<Job>,
    misuse: u32,
}

const fn device(name: f64) -> Device {
    let mut settings = [0.0; SETTINGS];
    settings[keys::CALIBRATION as usize] = 0x5000 as f64;
    settings[keys::OUTPUT_DOF as usize] = 3.0;
    settings[keys::DRIFT as usize] = 1.0;
    settings[keys::NAME as usize] = name;
    Device {
        settings,
        open: false,
        enabled: false,
        in_frame: false,
        framed: false,
        pending: [0.0; 6],
        applied: [0.0; 6],
        heat: 0.0,
    }
}

static FAKE: Mutex<Fake> = Mutex::new(Fake {
    devices: [device(0.0), device(-1.0)],
    current: 0,
    errors: Vec::new(),
    unlicensed: false,
    stuck: false,
    initialised: 0,
    running: false,
    job: None,
    misuse: 0,
});

/// Locked while a callback runs: stopping the scheduler waits for it.
static TICKING: Mutex<()> = Mutex::new(());

fn with<R>(act: impl FnOnce(&mut Fake) -> R) -> R {
    act(&mut FAKE.lock().unwrap())
}

impl Device {
    fn get(&self, key: u32) -> f64 {
        self.settings[key as usize]
    }

    /// The error that prevents force on this device.
    fn trouble(&self) -> u32 {
        match self.get(keys::ERROR) as u32 {
            0 if self.get(keys::VELOCITY_X).abs() > FASTEST_MM_PER_S => 0x0203,
            0 if self.heat > 1.0 => 0x0200,
            error => error,
        }
    }
}

impl Fake {
    fn wrong(&mut self, error: u32) {
        self.misuse += 1;
        self.errors.push((error, FIRST + self.current as u32));
    }

    /// Index of an open device; any other handle counts as misuse.
    fn place(&mut self, handle: u32) -> Option<usize> {
        let place = handle.wrapping_sub(FIRST) as usize;
        let known = self.devices.get(place).is_some_and(|device| device.open);
        if !known {
            self.wrong(0x0104);
        }
        known.then_some(place)
    }

    fn now(&mut self) -> &mut Device {
        &mut self.devices[self.current]
    }
}

/// Splits a test's key into device and key.
fn split(key: u32) -> (usize, u32) {
    ((key / 1000) as usize, key % 1000)
}

#[unsafe(no_mangle)]
pub extern "C" fn fake_set(key: u32, value: f64) {
    let (place, key) = split(key);
    match key {
        keys::TICKS => tick(value as u32),
        keys::UNLICENSED => with(|f| f.unlicensed = value != 0.0),
        keys::STUCK => with(|f| f.stuck = value != 0.0),
        key => with(|f| f.devices[place].settings[key as usize] = value),
    }
}

#[unsafe(no_mangle)]
pub extern "C" fn fake_get(key: u32) -> f64 {
    let (place, key) = split(key);
    let truth = |value: bool| f64::from(u8::from(value));
    with(|f| {
        let device = &f.devices[place];
        match key {
            keys::FORCE_X..=105 if f.running && device.enabled => device.applied[(key - keys::FORCE_X) as usize],
            keys::FORCE_X..=105 => 0.0,
            keys::OPEN => truth(device.open),
            keys::ENABLED => truth(device.enabled),
            keys::RUNNING => truth(f.running),
            keys::SCHEDULED => truth(f.job.is_some()),
            keys::MISUSE => f64::from(f.misuse),
            keys::INITIALISED => f64::from(f.initialised),
            key => device.settings[key as usize],
        }
    })
}

fn tick(count: u32) {
    for _ in 0..count {
        let _ticking = TICKING.lock().unwrap();
        let job = with(|f| {
            f.devices.iter_mut().for_each(|device| device.framed = false);
            f.job.filter(|_| f.running)
        });
        let Some(job) = job else { return };
        if (job.callback)(job.data as *mut c_void) == 0 {
            with(|f| f.job = None);
        }
    }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn hdInitDevice(name: *const c_char) -> u32 {
    let name = if name.is_null() { None } else { Some(unsafe { CStr::from_ptr(name) }.to_str().unwrap()) };
    with(|f| {
        if f.running {
            f.wrong(0x0102);
        }
        let names = [Some("Default Device"), Some("Left"), None, Some("Right")];
        let place = f.devices.iter().position(|d| names.get(d.get(keys::NAME) as usize) == Some(&name) && d.get(keys::NAME) >= 0.0);
        let error = match place {
            _ if f.unlicensed => 0x0600,
            None => 0x0300,
            Some(place) if f.devices[place].open || f.devices[place].get(keys::TAKEN) != 0.0 => 0x0301,
            Some(place) => {
                (f.devices[place].open, f.current, f.initialised) = (true, place, f.initialised + 1);
                return FIRST + place as u32;
            }
        };
        f.errors.push((error, INVALID));
        INVALID
    })
}

#[unsafe(no_mangle)]
pub extern "C" fn hdDisableDevice(handle: u32) {
    with(|f| {
        if f.running {
            f.wrong(0x0102);
        }
        if let Some(place) = f.place(handle) {
            (f.devices[place].open, f.devices[place].applied) = (false, [0.0; 6]);
        }
    });
}

#[unsafe(no_mangle)]
pub extern "C" fn hdMakeCurrentDevice(handle: u32) {
    with(|f| f.current = f.place(handle).unwrap_or(f.current));
}

#[unsafe(no_mangle)]
pub extern "C" fn hdBeginFrame(handle: u32) {
    with(|f| {
        let Some(place) = f.place(handle) else { return };
        f.current = place;
        if f.now().in_frame || (f.running && f.now().framed) {
            f.wrong(0x0400);
        }
        let device = f.now();
        (device.in_frame, device.framed, device.pending) = (true, true, [0.0; 6]);
    });
}

#[unsafe(no_mangle)]
pub extern "C" fn hdEndFrame(handle: u32) {
    with(|f| {
        let Some(place) = f.place(handle) else { return };
        if !f.devices[place].in_frame {
            f.wrong(0x0401);
        }
        let device = &mut f.devices[place];
        device.in_frame = false;
        let error = device.trouble();
        device.applied = if error == 0 { device.pending } else { [0.0; 6] };
        let force: f64 = device.applied[..3].iter().map(|n| n * n).sum();
        device.heat = 0.999 * device.heat + device.get(keys::HEATING) * force;
        if error != 0 {
            f.errors.push((error, handle));
        }
    });
}

fn switch(capability: u32, on: bool) {
    with(|f| if capability == 0x4000 { f.now().enabled = on } else { f.wrong(0x0100) });
}

#[unsafe(no_mangle)]
pub extern "C" fn hdEnable(capability: u32) {
    switch(capability, true);
}

#[unsafe(no_mangle)]
pub extern "C" fn hdDisable(capability: u32) {
    switch(capability, false);
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn hdGetIntegerv(what: u32, out: *mut i32) {
    let value = with(|f| match what {
        0x2000 => f.now().get(keys::BUTTONS) as i32,
        0x2554 => f.now().get(keys::OUTPUT_DOF) as i32,
        0x2555 => 0b110,
        0x2002 => {
            f.wrong(0x0103);
            0
        }
        _ => {
            f.wrong(0x0100);
            0
        }
    });
    unsafe { *out = value };
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn hdGetDoublev(what: u32, out: *mut f64) {
    let values: Vec<f64> = with(|f| {
        let device = *f.now();
        match what {
            0x2051 => vec![device.get(keys::VELOCITY_X), 0.0, 0.0],
            0x2053 => vec![0.0, 0.5, 0.0],
            0x2052 => {
                let (s, c) = device.get(keys::TURN_Y).sin_cos();
                let d = device.get(keys::DRIFT);
                let p = [keys::POSITION_X, keys::POSITION_Y, keys::POSITION_Z].map(|key| device.get(key));
                vec![c * d, 0.0, -s, 0.0, 0.0, 1.0, 0.0, 0.0, s, 0.0, c * d, 0.0, p[0], p[1], p[2], 1.0]
            }
            0x2551 => vec![-80.0, -60.0, -35.0, 80.0, 60.0, 35.0],
            0x2603 => vec![3.3],
            0x2604 => vec![0.88],
            _ => {
                f.wrong(0x0100);
                vec![]
            }
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
        let torque = f.now().get(keys::OUTPUT_DOF) >= 6.0;
        match what {
            _ if !f.now().in_frame => f.wrong(0x0402),
            _ if values.iter().any(|value| !value.is_finite()) => f.wrong(0x0101),
            0x2700 => f.now().pending[..3].copy_from_slice(&values),
            0x2701 if torque => f.now().pending[3..].copy_from_slice(&values),
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
    let (code, device) = with(|f| f.errors.pop().unwrap_or((0, INVALID)));
    ErrorInfo { code, internal: -1, device }
}

#[unsafe(no_mangle)]
pub extern "C" fn hdGetErrorString(code: u32) -> *const c_char {
    match code {
        0x0300 => c"Device fault".as_ptr(),
        0x0301 => c"Device already initiated".as_ptr(),
        0x0304 => c"Timer error".as_ptr(),
        0x0600 => c"Invalid license".as_ptr(),
        _ => c"Some error".as_ptr(),
    }
}

#[unsafe(no_mangle)]
pub extern "C" fn hdCheckCalibration() -> u32 {
    with(|f| f.now().get(keys::CALIBRATION) as u32)
}

#[unsafe(no_mangle)]
pub extern "C" fn hdUpdateCalibration(style: u32) {
    with(|f| {
        if style != 0b010 || f.now().applied != [0.0; 6] {
            f.wrong(0x0101);
        }
        // The calibration corrects the position, which jumps.
        f.now().settings[keys::POSITION_X as usize] += 30.0;
        f.now().settings[keys::CALIBRATION as usize] = f64::from(0x5000);
    });
}

#[unsafe(no_mangle)]
pub extern "C" fn hdStartScheduler() {
    with(|f| {
        if f.stuck {
            f.errors.push((0x0304, INVALID));
        } else {
            f.running = true;
        }
    });
}

#[unsafe(no_mangle)]
pub extern "C" fn hdStopScheduler() {
    let _between_ticks = TICKING.lock().unwrap();
    with(|f| {
        f.running = false;
        f.devices.iter_mut().for_each(|device| device.applied = [0.0; 6]);
    });
}

#[unsafe(no_mangle)]
pub extern "C" fn hdSetSchedulerRate(hz: c_ulong) {
    with(|f| if hz != 500 && hz != 1000 && hz != 2000 { f.wrong(0x0101) });
}

#[unsafe(no_mangle)]
pub extern "C" fn hdScheduleAsynchronous(callback: Callback, data: *mut c_void, _: u16) -> c_ulong {
    with(|f| {
        if f.job.is_some() {
            f.wrong(0x0501);
        }
        f.job = Some(Job { callback, data: data as usize });
    });
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
