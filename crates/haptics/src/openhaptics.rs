//! 3D Systems Touch, Touch X and Premium (once Phantom, Omni) through the maker's libHD, loaded when the device is opened.
//!
//! # Theory
//! libHD owns the servo thread. Its callback publishes what it senses and applies what the haptic loop last asked for;
//! both pass through triple buffers, so that neither thread waits for the other. That costs up to one tick of delay.
//!
//! ```text
//!   haptic loop: read() <──sample── callback, 1 kHz: begin frame, sense, command, end frame
//!                apply() ──command─>
//! ```
//!
//! # Practice
//! The device's axes are x right, y up, z towards the user, mm; [`Workspace`] lays them into the patient. Button 1 is the
//! pedal, button 2 asks for the next tool. Force is off until the device is calibrated. One device at a time. `read` is
//! [`Status::Lost`] after a fault of the link or 50 ms without a sample. Nothing of the maker's is part of this crate.
//!
//! # Sources
//! OpenHaptics API reference and programmer's guide (3D Systems).
//!
//! # When not to use it
//! For two devices at once: their callbacks would have to be one.

mod codes;
mod library;
mod servo;

use crate::ramp::Ramp;
use crate::{Capabilities, DeviceError, Fault, HapticDevice, Reading, Status, Watch, Workspace};
use library::{Hd, Scheduled};
use servo::{Command, Sample, Servo};
use std::path::PathBuf;
use std::sync::Mutex;
use trepan_contact::GuardedWrench;
use trepan_geometry::{Buttons, Mat3, Pose, Quat, ToolState, Twist, Vec3};
use triple_buffer::{Input, Output, triple_buffer};

/// A device without a sample for this long is lost, ms.
const LOST_MS: f64 = 50.0;
const RATE_HZ: u32 = 1000;
/// Names that the maker's set-up tools give the first device.
const DEFAULT_NAMES: [Option<&str>; 4] =
    [Some("Default Device"), Some("Default PHANToM"), Some("Default PHANTOM"), None];

/// Libraries that have a device open.
static IN_USE: Mutex<Vec<String>> = Mutex::new(Vec::new());

/// Which device, and where it stands.
#[derive(Clone, Debug, Default)]
pub struct Config {
    /// Name given in the maker's set-up tool; `None` tries the usual names.
    pub device: Option<String>,
    /// The library's file; `None` lets the system search for it.
    pub library: Option<PathBuf>,
    /// How device space lies in the patient.
    pub workspace: Workspace,
}

/// An open device.
pub struct OpenHaptics {
    hd: Hd,
    device: u32,
    library: String,
    scheduled: Option<Scheduled>,
    samples: Output<Sample>,
    commands: Input<Command>,
    number: u64,
    last: Reading,
    last_sample: u64,
    fresh_ms: f64,
    workspace: Workspace,
    capabilities: Capabilities,
    watch: Watch,
}

impl OpenHaptics {
    /// Loads the library, opens the device and starts its servo loop.
    pub fn open(config: &Config) -> Result<Self, DeviceError> {
        let (hd, library) = Hd::load(config.library.as_deref())?;
        claim(&library)?;
        let opened = Self::start(hd, &library, config);
        if opened.is_err() {
            release(&library);
        }
        opened
    }

    /// Shows what is wrong with the device while another thread uses it.
    pub fn watch(&self) -> Watch {
        self.watch.clone()
    }

    fn start(hd: Hd, library: &str, config: &Config) -> Result<Self, DeviceError> {
        let device = init(&hd, config.device.as_deref())?;
        hd.make_current(device);
        let drives_torque = hd.integer(codes::OUTPUT_DOF) >= 6;
        let capabilities = capabilities(&hd, drives_torque);
        hd.enable(codes::FORCE_OUTPUT);

        let watch = Watch::default();
        let (sample_in, samples) = triple_buffer(&Sample::default());
        let (commands, command_out) = triple_buffer(&Command::default());
        let scheduled = hd.schedule(Box::new(Servo {
            hd,
            device,
            drives_torque,
            calibration_style: lowest_bit(hd.integer(codes::CALIBRATION_STYLE)),
            samples: sample_in,
            commands: command_out,
            ramp: Ramp::new(watch.clone()),
            number: 0,
            last_command: 0,
            silent_ticks: 0,
        }));
        hd.set_scheduler_rate(RATE_HZ);
        hd.drain_errors(); // A rate that the link cannot have leaves the default, which is 1 kHz.
        hd.start_scheduler();
        let error = hd.drain_errors();
        if error != codes::SUCCESS {
            hd.stop(scheduled);
            hd.disable_device(device);
            return Err(not_opened(config.device.as_deref(), hd.describe(error)));
        }
        let workspace = config.workspace;
        let last = Reading { tool: workspace.world(&ToolState::at(Pose::IDENTITY)), status: Status::Stale };
        let library = library.to_owned();
        let scheduled = Some(scheduled);
        Ok(Self {
            hd,
            device,
            library,
            scheduled,
            samples,
            commands,
            number: 0,
            last,
            last_sample: 0,
            fresh_ms: f64::NAN,
            workspace,
            capabilities,
            watch,
        })
    }
}

impl HapticDevice for OpenHaptics {
    fn read(&mut self, time_ms: f64) -> Reading {
        if self.fresh_ms.is_nan() {
            self.fresh_ms = time_ms;
        }
        let sample = *self.samples.read();
        if sample.number != self.last_sample {
            (self.last_sample, self.fresh_ms) = (sample.number, time_ms);
            let tool = self.workspace.world(&tool(&sample, time_ms));
            if tool.is_finite() {
                self.last = Reading { tool, status: Status::Fresh };
            } else {
                self.last.status = Status::Stale;
            }
        } else {
            self.last.status = Status::Stale;
        }
        let lost = self.scheduled.is_none()
            || self.watch.fault() == Some(Fault::Disconnected)
            || time_ms - self.fresh_ms > LOST_MS;
        if lost {
            self.last.status = Status::Lost;
        }
        self.last
    }

    fn apply(&mut self, wrench: GuardedWrench) {
        if self.scheduled.is_some() {
            self.number += 1;
            let wrench = self.workspace.device_wrench(wrench.wrench());
            self.commands.write(Command { number: self.number, wrench });
        }
    }

    fn capabilities(&self) -> Capabilities {
        self.capabilities.clone()
    }

    fn close(&mut self) {
        if let Some(scheduled) = self.scheduled.take() {
            self.hd.stop(scheduled);
            self.hd.make_current(self.device);
            self.hd.begin_frame(self.device);
            self.hd.set_vector(codes::CURRENT_FORCE, [0.0; 3]);
            self.hd.end_frame(self.device);
            self.hd.disable(codes::FORCE_OUTPUT);
            self.hd.disable_device(self.device);
            self.hd.drain_errors();
            release(&self.library);
        }
    }
}

impl Drop for OpenHaptics {
    fn drop(&mut self) {
        self.close();
    }
}

/// Whether the library is there.
pub(crate) fn probe() -> Result<String, DeviceError> {
    Hd::load(None).map(|(_, library)| format!("{library} is installed; the device is looked for when it is opened"))
}

/// A sample as a tool in device space. The transform's columns drift from orthonormal: they are made so again.
fn tool(sample: &Sample, time_ms: f64) -> ToolState {
    let m = sample.transform.map(|value| value as f32);
    let z = Vec3::new(m[8], m[9], m[10]).normalize_or(Vec3::Z);
    let x =
        (Vec3::new(m[0], m[1], m[2]) - z * z.dot(Vec3::new(m[0], m[1], m[2]))).normalize_or(z.any_orthonormal_vector());
    let rotation = Quat::from_mat3(&Mat3::from_cols(x, z.cross(x), z)).normalize();
    let vector = |values: [f64; 3]| Vec3::from(values.map(|value| value as f32));
    ToolState {
        world_from_tool: Pose::from_parts(Vec3::new(m[12], m[13], m[14]), rotation),
        twist: Twist { linear: vector(sample.linear), angular: vector(sample.angular) },
        buttons: Buttons(sample.buttons),
        time_ms,
    }
}

fn init(hd: &Hd, wanted: Option<&str>) -> Result<u32, DeviceError> {
    let names = if wanted.is_some() { &[wanted][..] } else { &DEFAULT_NAMES[..] };
    let mut reason = String::new();
    for name in names {
        let device = hd.init_device(*name);
        let error = hd.drain_errors();
        match device {
            Some(device) if error == codes::SUCCESS => return Ok(device),
            Some(device) => hd.disable_device(device),
            None => {}
        }
        reason = hd.describe(error);
    }
    Err(not_opened(wanted, reason))
}

fn not_opened(wanted: Option<&str>, reason: String) -> DeviceError {
    DeviceError::Open {
        device: wanted.map_or_else(|| "openhaptics".to_owned(), |name| format!("openhaptics:{name}")),
        reason,
        remedy: "give the name that the maker's set-up tool shows, and see whether its diagnostic program finds the device",
    }
}

fn capabilities(hd: &Hd, drives_torque: bool) -> Capabilities {
    let box_mm = hd.doubles(codes::USABLE_WORKSPACE_DIMENSIONS).map(|value| value as f32);
    let capabilities = Capabilities {
        name: hd.string(codes::DEVICE_MODEL_TYPE),
        peak_force_n: hd.doubles(codes::NOMINAL_MAX_FORCE)[0] as f32,
        continuous_force_n: hd.doubles(codes::NOMINAL_MAX_CONTINUOUS_FORCE)[0] as f32,
        rate_hz: RATE_HZ as f32,
        workspace_mm: Vec3::new(box_mm[3] - box_mm[0], box_mm[4] - box_mm[1], box_mm[5] - box_mm[2]),
        axes_driven: if drives_torque { 6 } else { 3 },
        position_resolution_mm: 0.055,
        delay_ticks: 1,
        // The lightest of the family.
        moving_mass_g: 45.0,
        damping: 0.1,
    };
    hd.drain_errors();
    capabilities
}

/// The first of the calibration styles that the device has.
fn lowest_bit(mask: i32) -> u32 {
    let mask = mask.cast_unsigned();
    mask & mask.wrapping_neg()
}

fn claim(library: &str) -> Result<(), DeviceError> {
    let mut in_use = IN_USE.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
    if in_use.iter().any(|used| used == library) {
        return Err(DeviceError::Open {
            device: "openhaptics".to_owned(),
            reason: "this program already has a device of this library open".to_owned(),
            remedy: "close that one first",
        });
    }
    in_use.push(library.to_owned());
    Ok(())
}

fn release(library: &str) {
    IN_USE.lock().unwrap_or_else(std::sync::PoisonError::into_inner).retain(|used| used != library);
}
