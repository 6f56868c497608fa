//! Safe wrappers for the functions of libHD.
//!
//! # Sources
//! OpenHaptics programmer's guide and API reference (HDAPI 3): names, argument types and numbers
//! only.
#![expect(unsafe_code, reason = "calls into the vendor's C library")]

use super::codes;
use crate::DeviceError;
use crate::dynamic::{Loaded, functions, owned};
use std::ffi::{CString, c_char, c_ulong, c_void};
use std::path::Path;

/// Scheduler rate, Hz, numerical.
pub(super) const RATE_HZ: u32 = 1000;

const NAMES: &[&str] = if cfg!(windows) {
    &["HD.dll"]
} else if cfg!(target_os = "macos") {
    &["libHD.dylib"]
} else {
    &["libHD.so", "libHD.so.3.4", "libHD.so.3.0"]
};

const INSTALL: &str =
    "install the maker's device driver and OpenHaptics (3D Systems), and name the device in its set-up tool";

/// An entry of the error stack, returned by value.
#[repr(C)]
#[derive(Clone, Copy)]
pub(super) struct ErrorInfo {
    code: u32,
    internal: i32,
    device: u32,
}

type Callback = extern "system" fn(*mut c_void) -> u32;

functions! {
    /// libHD, with HDAPI.
    Hd {
        safe {
            hdDisableDevice(u32);
            hdMakeCurrentDevice(u32);
            hdBeginFrame(u32);
            hdEndFrame(u32);
            hdEnable(u32);
            hdDisable(u32);
            hdGetError() -> ErrorInfo;
            hdCheckCalibration() -> u32;
            hdUpdateCalibration(u32);
            hdStartScheduler();
            hdSetSchedulerRate(c_ulong);
        }
        hdInitDevice(*const c_char) -> u32;
        hdGetIntegerv(u32, *mut i32);
        hdGetDoublev(u32, *mut f64);
        hdSetDoublev(u32, *const f64);
        hdGetString(u32) -> *const c_char;
        hdGetErrorString(u32) -> *const c_char;
        hdStopScheduler();
        hdScheduleAsynchronous(Callback, *mut c_void, u16) -> c_ulong;
        hdUnschedule(c_ulong);
    }
}

/// Most errors taken from the stack at once.
pub(super) const MAX_ERRORS: usize = 64;

impl Hd {
    /// Loads the library; also returns its name.
    pub(super) fn load(path: Option<&Path>) -> Result<(Self, String), DeviceError> {
        let library = Loaded::open(path, NAMES, INSTALL)?;
        Ok((Self::of(&library)?, library.name().to_owned()))
    }

    /// Initialises the device of this name and returns its handle; `None` opens the first device.
    pub(super) fn init_device(&self, name: Option<&str>) -> Option<u32> {
        let name = name.map(CString::new).transpose().ok()?;
        let pointer = name.as_ref().map_or(std::ptr::null(), |name| name.as_ptr());
        // SAFETY: a C string that outlives the call, or null, which means the first device.
        let device = unsafe { (self.hdInitDevice)(pointer) };
        (device != codes::INVALID_HANDLE).then_some(device)
    }

    pub(super) fn integer(&self, what: u32) -> i32 {
        let mut value = [0; 16];
        // SAFETY: no parameter has more than 16 integers.
        unsafe { (self.hdGetIntegerv)(what, value.as_mut_ptr()) };
        value[0]
    }

    /// The values of a parameter; unused elements are zero.
    pub(super) fn doubles(&self, what: u32) -> [f64; 16] {
        let mut values = [0.0; 16];
        // SAFETY: no parameter has more than 16 doubles.
        unsafe { (self.hdGetDoublev)(what, values.as_mut_ptr()) };
        values
    }

    pub(super) fn set_vector(&self, what: u32, value: [f64; 3]) {
        // SAFETY: force and torque, which this is used for, have three doubles.
        unsafe { (self.hdSetDoublev)(what, value.as_ptr()) }
    }

    pub(super) fn string(&self, what: u32) -> String {
        // SAFETY: the library returns null or a C string of its own that lives as long as it does.
        unsafe { owned((self.hdGetString)(what)) }
    }

    /// Takes the newest error from the stack: its code and its device.
    pub(super) fn next_error(&self) -> Option<(u32, u32)> {
        let ErrorInfo { code, device, .. } = (self.hdGetError)();
        (code != codes::SUCCESS).then_some((code, device))
    }

    /// Empties the error stack and returns the newest code; `SUCCESS` for none.
    pub(super) fn drain_errors(&self) -> u32 {
        let mut errors = (0..MAX_ERRORS).map_while(|_| self.next_error());
        let newest = errors.next().map_or(codes::SUCCESS, |(code, _)| code);
        errors.for_each(drop);
        newest
    }

    /// The vendor's text for an error.
    pub(super) fn describe(&self, code: u32) -> String {
        // SAFETY: the library returns null or a C string of its own that lives as long as it does.
        let words = unsafe { owned((self.hdGetErrorString)(code)) };
        format!("{words} (error {code:04x})")
    }

    /// Runs `ticked` on the library's thread once per tick, from the scheduler's start until
    /// [`Hd::stop`].
    pub(super) fn schedule<T: Ticked>(&self, ticked: Box<T>) -> Scheduled<T> {
        let data = Box::into_raw(ticked);
        // SAFETY: `data` stays allocated until `stop`, which first stops the scheduler.
        let handle = unsafe { (self.hdScheduleAsynchronous)(tick::<T>, data.cast(), codes::MAX_PRIORITY) };
        Scheduled { handle, data }
    }

    /// Stops the scheduler, which waits for a running callback, and returns what it ran.
    pub(super) fn stop<T>(&self, scheduled: Scheduled<T>) -> Box<T> {
        // SAFETY: after these two calls the library does not use `data` any more; it came from a
        // box in `schedule`.
        unsafe {
            (self.hdStopScheduler)();
            (self.hdUnschedule)(scheduled.handle);
            Box::from_raw(scheduled.data)
        }
    }
}

/// What the library's scheduler calls.
pub(super) trait Ticked: Send {
    /// Runs one tick; returns whether the library should call again.
    fn tick(&mut self) -> u32;
}

/// What the scheduler runs at present.
pub(super) struct Scheduled<T> {
    handle: c_ulong,
    data: *mut T,
}

// SAFETY: the pointer is only converted back to its own box, whose content may be sent.
unsafe impl<T: Send> Send for Scheduled<T> {}

/// The callback that the library calls once per tick.
extern "system" fn tick<T: Ticked>(data: *mut c_void) -> u32 {
    // SAFETY: `data` is what was given to `schedule`; nothing else accesses it until `stop`.
    let ticked = unsafe { &mut *data.cast::<T>() };
    ticked.tick()
}
