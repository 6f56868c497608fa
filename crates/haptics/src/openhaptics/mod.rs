//! 3D Systems Touch, Touch X and Premium (once Phantom, Omni) through the maker's libHD, loaded
//! when the device is opened.
//!
//! # Theory
//! libHD owns the servo thread. Its callback publishes samples and applies the haptic loop's latest
//! command, both through triple buffers, so that neither thread waits for the other. This costs up
//! to one tick of delay. All devices share one callback, which finishes the first device's frame
//! before it begins the second's.
//!
//! ```text
//!   haptic loop: read() <──sample── callback, 1 kHz
//!                                   each device: begin frame, sense, command, end frame
//!                apply() ──command─>
//! ```
//!
//! # Practice
//! The device's axes are x right, y up, z towards the user, mm; [`Workspace`] maps them to world
//! space. Button 1 is the pedal, button 2 requests the next tool. Force is off until the device is
//! calibrated. `read` is [`Status::Lost`] after a link fault or 50 ms without a sample. While a
//! second device is opened or closed the first has no force for a moment, then its force ramps in.
//! While libHD does not call, its last force stays on the motors; at its next call the force is
//! zero. This crate contains no code of the maker.
//!
//! # Sources
//! OpenHaptics API reference and programmer's guide (3D Systems).

mod codes;
mod library;
mod scheduler;
mod servo;

use crate::latest::Latest;
use crate::ramp::Ramp;
use crate::{
    Capabilities, Descriptor, DeviceError, Fault, HapticDevice, Listed, Motion, OpenedDevice, Reading, Status, Watch,
    Workspace,
};
use library::Hd;
use servo::{Command, Sample, Servo};
use std::path::PathBuf;
use trepan_contact::GuardedWrench;
use trepan_geometry::{Buttons, Mat3, Pose, Quat, ToolState, Twist, Vec3};
use trepan_measurements::devices;
use triple_buffer::{Input, Output, triple_buffer};

/// `openhaptics[:NAME]`: by the name in the maker's set-up tool. The list only says whether the
/// library is installed.
pub static DEVICE: Descriptor = Descriptor {
    name: "openhaptics",
    usage: "[:NAME]",
    source: "OpenHaptics HDAPI 3 (libHD)",
    motion: Motion::Hardware,
    argument: |_, name| Ok(name.map(str::to_owned)),
    id: |name| name,
    probe: || {
        let installed = |name| format!("{name} is installed; the device is looked for when it is opened");
        Hd::load(None).map(|(_, library)| vec![Listed::new("openhaptics", installed(library))])
    },
    open: |device, setting| {
        let config = Config { device: device.map(str::to_owned), workspace: setting.workspace, ..Config::default() };
        OpenHaptics::open(&config).map(|device| OpenedDevice::watched(device.watch(), device))
    },
};

/// Time without a sample after which a device is lost, ms.
const LOST_MS: f64 = 50.0;
/// Names that the maker's set-up tools give the first device.
const DEFAULT_NAMES: [Option<&str>; 4] =
    [Some("Default Device"), Some("Default PHANToM"), Some("Default PHANTOM"), None];

/// Which device to open, and its workspace.
#[derive(Clone, Debug, Default)]
pub struct Config {
    /// Name given in the maker's set-up tool; `None` tries the usual names.
    pub device: Option<String>,
    /// The library's file; `None` uses the system's search path.
    pub library: Option<PathBuf>,
    /// How device space maps to world space.
    pub workspace: Workspace,
}

/// An open device.
pub struct OpenHaptics {
    hd: Hd,
    device: u32,
    library: String,
    open: bool,
    samples: Output<Sample>,
    commands: Input<Command>,
    number: u64,
    latest: Latest,
    workspace: Workspace,
    capabilities: Capabilities,
    watch: Watch,
}

impl OpenHaptics {
    /// Loads the library, opens the device and starts its servo loop.
    pub fn open(config: &Config) -> Result<Self, DeviceError> {
        let (hd, library) = Hd::load(config.library.as_deref())?;
        let wanted = config.device.as_deref();
        let watch = Watch::default();
        let (sample_in, samples) = triple_buffer(&Sample::default());
        let (commands, command_out) = triple_buffer(&Command::default());
        let open = || {
            let device = init(&hd, wanted)?;
            (hd.hdMakeCurrentDevice)(device);
            let drives_torque = hd.integer(codes::OUTPUT_DOF) >= 6;
            let capabilities = capabilities(&hd, drives_torque);
            let calibration_style = lowest_bit(hd.integer(codes::CALIBRATION_STYLE));
            (hd.hdEnable)(codes::FORCE_OUTPUT);
            let ramp = Ramp::new(watch.clone());
            let servo = Servo::new(device, drives_torque, calibration_style, sample_in, command_out, ramp);
            Ok((servo, (device, capabilities)))
        };
        let refused = |error| not_opened(wanted, hd.describe(error));
        let (device, capabilities) = scheduler::add(hd, &library, open, refused)?;
        let start = config.workspace.world(&ToolState::at(Pose::IDENTITY));
        Ok(Self {
            hd,
            device,
            library,
            open: true,
            samples,
            commands,
            number: 0,
            latest: Latest::new(start),
            workspace: config.workspace,
            capabilities,
            watch,
        })
    }

    /// Returns a watch on the device's faults, usable from another thread.
    pub fn watch(&self) -> Watch {
        self.watch.clone()
    }
}

impl HapticDevice for OpenHaptics {
    fn read(&mut self, time_ms: f64) -> Reading {
        let sample = *self.samples.read();
        let tool = || self.workspace.world(&tool(&sample, time_ms));
        let mut reading = self.latest.read(time_ms, sample.number, tool, LOST_MS);
        if !self.open || matches!(self.watch.fault(), Some(Fault::Disconnected | Fault::Stopped)) {
            reading.status = Status::Lost;
        }
        reading
    }

    fn apply(&mut self, wrench: GuardedWrench) {
        if self.open {
            self.number += 1;
            let wrench = self.workspace.device_wrench(wrench.wrench());
            self.commands.write(Command { number: self.number, wrench, pose_age_ms: self.latest.age_ms() });
        }
    }

    fn capabilities(&self) -> Capabilities {
        self.capabilities.clone()
    }

    fn close(&mut self) {
        if std::mem::take(&mut self.open) {
            scheduler::remove(self.hd, &self.library, self.device);
        }
    }
}

impl Drop for OpenHaptics {
    fn drop(&mut self) {
        self.close();
    }
}

/// Converts a sample to a tool in device space. The transform's columns drift from orthonormal and
/// are re-orthonormalised.
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
            Some(device) => (hd.hdDisableDevice)(device),
            None => {}
        }
        reason = hd.describe(error);
        if error == codes::DEVICE_ALREADY_INITIATED {
            break;
        }
    }
    Err(not_opened(wanted, reason))
}

fn not_opened(wanted: Option<&str>, reason: String) -> DeviceError {
    DeviceError::open(
        wanted.map_or_else(|| "openhaptics".to_owned(), |name| format!("openhaptics:{name}")),
        reason,
        "give the name that the maker's set-up tool shows, close other programs, and see whether its diagnostic program finds the device",
    )
}

fn capabilities(hd: &Hd, drives_torque: bool) -> Capabilities {
    let box_mm = hd.doubles(codes::USABLE_WORKSPACE_DIMENSIONS).map(|value| value as f32);
    let capabilities = Capabilities {
        name: hd.string(codes::DEVICE_MODEL_TYPE),
        peak_force_n: hd.doubles(codes::NOMINAL_MAX_FORCE)[0] as f32,
        continuous_force_n: hd.doubles(codes::NOMINAL_MAX_CONTINUOUS_FORCE)[0] as f32,
        rate_hz: library::RATE_HZ as f32,
        workspace_mm: Vec3::new(box_mm[3] - box_mm[0], box_mm[4] - box_mm[1], box_mm[5] - box_mm[2]),
        axes_driven: if drives_torque { 6 } else { 3 },
        position_resolution_mm: 0.055,
        delay_ticks: 1,
        // The lightest device of the family.
        moving_mass_g: devices::TOUCH_MASS.f32(),
        damping: devices::TOUCH_DAMPING.f32(),
    };
    hd.drain_errors();
    capabilities
}

/// The first calibration style in the mask.
fn lowest_bit(mask: i32) -> u32 {
    let mask = mask.cast_unsigned();
    mask & mask.wrapping_neg()
}
