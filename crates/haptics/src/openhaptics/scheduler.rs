//! The single scheduler of libHD, which all its devices share.
//!
//! # Practice
//! Of two callbacks only one gets force, so one callback serves all devices in turn. Devices are
//! added and removed while the scheduler is stopped, as the maker requires. The others have no
//! force for that moment, then it ramps in again.

use super::codes;
use super::library::{Hd, RATE_HZ, Scheduled};
use super::servo::{Servo, ServoGroup};
use crate::DeviceError;
use std::sync::{Mutex, PoisonError};

/// The scheduler of each library that has a device open.
static SCHEDULERS: Mutex<Vec<Scheduler>> = Mutex::new(Vec::new());

struct Scheduler {
    library: String,
    running: Scheduled<ServoGroup>,
}

/// Opens one more device while the scheduler is stopped, then serves it; returns the result of
/// `open`. `refused` converts the error of a scheduler that does not start.
pub(super) fn add<T>(
    hd: Hd,
    library: &str,
    open: impl FnOnce() -> Result<(Servo, T), DeviceError>,
    refused: impl FnOnce(u32) -> DeviceError,
) -> Result<T, DeviceError> {
    let mut schedulers = SCHEDULERS.lock().unwrap_or_else(PoisonError::into_inner);
    let mut servos = rest(hd, library, &mut schedulers);
    let (servo, outcome) = match open() {
        Ok(opened) => opened,
        Err(error) => {
            go_on(hd, library, servos, &mut schedulers);
            return Err(error);
        }
    };
    let device = servo.device;
    servos.push(servo);
    if let Err(error) = start(hd, library, servos, &mut schedulers) {
        let words = refused(error);
        without(hd, library, device, &mut schedulers);
        return Err(words);
    }
    Ok(outcome)
}

/// Removes a device and continues to serve the others.
pub(super) fn remove(hd: Hd, library: &str, device: u32) {
    let mut schedulers = SCHEDULERS.lock().unwrap_or_else(PoisonError::into_inner);
    without(hd, library, device, &mut schedulers);
}

fn without(hd: Hd, library: &str, device: u32, schedulers: &mut Vec<Scheduler>) {
    let servos = rest(hd, library, schedulers).into_iter().filter(|servo| servo.device != device).collect();
    switch_off(hd, device);
    go_on(hd, library, servos, schedulers);
}

/// Restarts the scheduler for the others. If it fails, their missing samples show it.
fn go_on(hd: Hd, library: &str, servos: Vec<Servo>, schedulers: &mut Vec<Scheduler>) {
    let _ = start(hd, library, servos, schedulers);
}

/// Stops the library's scheduler and returns the devices that it served.
fn rest(hd: Hd, library: &str, schedulers: &mut Vec<Scheduler>) -> Vec<Servo> {
    let place = schedulers.iter().position(|scheduler| scheduler.library == library);
    place.map_or_else(Vec::new, |place| hd.stop(schedulers.swap_remove(place).running).servos)
}

/// Starts the scheduler if there are devices; the error is the library's code.
fn start(hd: Hd, library: &str, mut servos: Vec<Servo>, schedulers: &mut Vec<Scheduler>) -> Result<(), u32> {
    if servos.is_empty() {
        return Ok(());
    }
    servos.iter_mut().for_each(|servo| servo.ramp.restart());
    let running = hd.schedule(Box::new(ServoGroup { hd, servos }));
    schedulers.push(Scheduler { library: library.to_owned(), running });
    (hd.hdSetSchedulerRate)(RATE_HZ.into());
    hd.drain_errors(); // An unsupported rate leaves the default, 1 kHz.
    (hd.hdStartScheduler)();
    match hd.drain_errors() {
        codes::SUCCESS => Ok(()),
        error => Err(error),
    }
}

fn switch_off(hd: Hd, device: u32) {
    (hd.hdMakeCurrentDevice)(device);
    (hd.hdBeginFrame)(device);
    hd.set_vector(codes::CURRENT_FORCE, [0.0; 3]);
    (hd.hdEndFrame)(device);
    (hd.hdDisable)(codes::FORCE_OUTPUT);
    (hd.hdDisableDevice)(device);
    hd.drain_errors();
}
