//! Force Dimension omega, delta, sigma and lambda, and the Falcon, through the maker's libdrd,
//! loaded when the device is opened.
//!
//! # Theory
//! The library is driven by calls: a read fetches the pose over USB, an apply sends the force. The
//! firmware's watchdog is set to 9.5 ms, so that a dead haptic loop leaves no force.
//!
//! # Practice
//! `read` and `apply` each wait for one USB transfer, about 0.1 to 0.25 ms: the device limits the
//! loop's rate, up to 4 kHz according to the maker (the Falcon 1 kHz). The maker's axes (x to the
//! user, y right, z up; m, N m) become x right, y up, z to the user; mm, N mm. [`Workspace`] maps
//! them to world space. Button 1 is the pedal, button 2 requests the next tool; devices with one
//! button have a pedal only. The maker's velocity limit is not changed. After a fault the force is
//! zero for a while, then ramps in; a device whose link failed is lost until it is opened again.
//!
//! # Sources
//! Force Dimension SDK 3 reference.
//!
//! # When not to use it
//! With [`Config::auto_init`] while a hand touches the device: it moves by itself.

mod library;

use crate::ramp::Ramp;
use crate::{
    Capabilities, Descriptor, DeviceError, Fault, HapticDevice, Listed, Motion, NameError, OpenedDevice, Reading,
    STALE_MS, Status, Watch, Workspace,
};
use library::{Drd, Outcome};
use std::path::PathBuf;
use trepan_contact::GuardedWrench;
use trepan_geometry::{Buttons, Mat3, Pose, Quat, ToolState, Twist, Vec3, Wrench};

/// `force-dimension[:N]`: the first, or by number from 0.
pub static DEVICE: Descriptor = Descriptor {
    name: "force-dimension",
    usage: "[:N]",
    source: "Force Dimension SDK 3 (libdrd)",
    motion: Motion::Hardware,
    argument: |name, text| {
        let number = |text: &str| match text.parse::<u8>() {
            Ok(number) if number < 128 => Ok(number.to_string()),
            _ => {
                let remedy = format!("write {name}:N with N from 0 to 127, as --list-devices does");
                Err(NameError::Argument(format!("{name}:{text} goes by a number; {remedy}")))
            }
        };
        text.map(number).transpose()
    },
    id: |number| number,
    probe: || Drd::load(None).map(|drd| found(&drd)),
    open: |number, setting| {
        let index = number.and_then(|number| number.parse().ok()).unwrap_or(0);
        let config = Config { index, workspace: setting.workspace, ..Config::default() };
        ForceDimension::open(&config).map(|device| OpenedDevice::watched(device.watch(), device))
    },
};

/// Watchdog of 9.5 ms in the firmware's steps of 125 µs, so that force ends within 10 ms.
const WATCHDOG_STEPS: u8 = 76;
/// Reads between two checks of the status.
const STATUS_PERIOD: u32 = 8;

// Indices in the status.
const POWER: usize = 0;
const FORCE: usize = 5;
const BRAKE: usize = 6;
const FORCE_OFF_CAUSE: usize = 14;

/// Which device to open, and its workspace.
#[derive(Clone, Debug, Default)]
pub struct Config {
    /// Number of the device, from 0.
    pub index: i8,
    /// Whether an uninitialised device may find its zero by itself. **It then moves**: hands off.
    pub auto_init: bool,
    /// The library's file; `None` uses the system's search path.
    pub library: Option<PathBuf>,
    /// How device space maps to world space.
    pub workspace: Workspace,
}

/// An open device.
pub struct ForceDimension {
    drd: Drd,
    id: Option<i8>,
    workspace: Workspace,
    capabilities: Capabilities,
    last: Reading,
    reads: u32,
    fresh_ms: f64,
    time_ms: f64,
    dt_ms: f32,
    lost: bool,
    ramp: Ramp,
    watch: Watch,
}

impl ForceDimension {
    /// Loads the library, opens the device and enables its force, at zero.
    pub fn open(config: &Config) -> Result<Self, DeviceError> {
        let drd = Drd::load(config.library.as_deref())?;
        if drd.device_count() <= i32::from(config.index) {
            return Err(not_opened(&drd, "plug it in and switch it on; on Linux install the SDK's udev rule"));
        }
        let Some(id) = drd.open(config.index) else {
            return Err(not_opened(&drd, "close other programs that use it"));
        };
        if let Err(error) = prepare(&drd, id, config.auto_init) {
            drd.stop(id);
            drd.close(id);
            return Err(error);
        }
        let watch = Watch::default();
        let start = config.workspace.world(&ToolState::at(Pose::IDENTITY));
        Ok(Self {
            drd,
            id: Some(id),
            workspace: config.workspace,
            capabilities: capabilities(&drd, id),
            last: Reading { tool: start, status: Status::Stale },
            reads: 0,
            fresh_ms: f64::NAN,
            time_ms: f64::NAN,
            dt_ms: 1.0,
            lost: false,
            ramp: Ramp::new(watch.clone()),
            watch,
        })
    }

    /// Returns a watch on the device's faults, usable from another thread.
    pub fn watch(&self) -> Watch {
        self.watch.clone()
    }

    fn lose(&mut self) {
        self.lost = true;
        self.ramp.cut(Fault::Disconnected);
    }

    /// Checks every few reads whether the force is still on, and if not, why.
    fn look_at_status(&mut self, id: i8) {
        let Some(status) = self.drd.status(id) else { return self.lose() };
        let fault = match status[FORCE_OFF_CAUSE] {
            _ if status[POWER] == 0 => Some(Fault::NoPower),
            2 => Some(Fault::TooFast),
            3 => Some(Fault::LoopSilent),
            5 => return self.lose(),
            1 | 6 => Some(Fault::Braked),
            _ if status[FORCE] == 0 || status[BRAKE] != 0 => Some(Fault::Braked),
            _ => None,
        };
        let resting = self.watch.fault();
        match fault {
            // Only cuts by the device's own limits are re-enabled, after the rest.
            Some(Fault::TooFast | Fault::LoopSilent) if resting.is_some() => {}
            Some(fault) => self.ramp.cut(fault),
            None => {}
        }
    }
}

impl HapticDevice for ForceDimension {
    fn read(&mut self, time_ms: f64) -> Reading {
        let Some(id) = self.id.filter(|_| !self.lost) else {
            self.last.status = Status::Lost;
            return self.last;
        };
        let (outcome, position, rows) = self.drd.pose(id);
        if outcome == Outcome::Failed {
            self.lose();
            self.last.status = Status::Lost;
            return self.last;
        }
        let twist =
            Twist { linear: axes(self.drd.linear_velocity(id)), angular: axes(self.drd.angular_velocity(id)) * 1e-3 };
        let buttons = Buttons(self.drd.buttons(id));
        let world_from_tool = Pose::from_parts(axes(position) * 1e3, rotation(rows));
        let tool = self.workspace.world(&ToolState { world_from_tool, twist, buttons, time_ms });
        let fresh = outcome == Outcome::Done && tool.is_finite();
        self.dt_ms = if self.time_ms.is_nan() { 1.0 } else { (time_ms - self.time_ms) as f32 };
        self.time_ms = time_ms;
        if fresh || self.fresh_ms.is_nan() {
            self.fresh_ms = time_ms;
        }
        if fresh {
            self.last.tool = tool;
        }
        self.last.status = if fresh { Status::Fresh } else { Status::Stale };

        self.reads = self.reads.wrapping_add(1);
        if self.reads.is_multiple_of(STATUS_PERIOD) {
            self.look_at_status(id);
        }
        self.last
    }

    fn apply(&mut self, wrench: GuardedWrench) {
        let Some(id) = self.id.filter(|_| !self.lost) else { return };
        if self.ramp.rest_ends(self.dt_ms) && self.drd.enable_force(id, true) == Outcome::Failed {
            return self.lose();
        }
        if self.time_ms - self.fresh_ms > STALE_MS {
            self.ramp.cut_again_or(Fault::Stale);
        }
        let share = self.ramp.share(self.dt_ms);
        let Wrench { force, torque } = self.workspace.device_wrench(wrench.wrench());
        let torque = if self.capabilities.axes_driven == 6 { torque } else { Vec3::ZERO };
        let outcome = self.drd.set_wrench(id, makers_axes(force * share), makers_axes(torque * (share * 1e-3)));
        if outcome == Outcome::Failed {
            self.lose();
        }
    }

    fn capabilities(&self) -> Capabilities {
        self.capabilities.clone()
    }

    fn close(&mut self) {
        if let Some(id) = self.id.take() {
            self.drd.set_wrench(id, [0.0; 3], [0.0; 3]);
            self.drd.enable_force(id, false);
            self.drd.stop(id);
            self.drd.close(id);
        }
    }
}

impl Drop for ForceDimension {
    fn drop(&mut self) {
        self.close();
    }
}

/// Lists every device that the library finds.
fn found(drd: &Drd) -> Vec<Listed> {
    match drd.device_count() {
        count @ 1.. => (0..count).map(|number| Listed::new(format!("force-dimension:{number}"), "ready")).collect(),
        _ => vec![Listed::new("force-dimension", "its library is installed; no device is connected")],
    }
}

fn prepare(drd: &Drd, id: i8, auto_init: bool) -> Result<(), DeviceError> {
    if !drd.is_initialised(id) {
        if !auto_init {
            return Err(DeviceError::open(
                DEVICE.name,
                "the device does not know its zero",
                "take your hands off and run the maker's initialisation program, or allow the device to initialise itself",
            ));
        }
        done(drd, drd.auto_init(id), "take your hands off the device and try again")?;
        done(drd, drd.stop_regulation(id), "try again")?;
    }
    done(drd, drd.set_watchdog(id, WATCHDOG_STEPS), "update the device's firmware: it needs a watchdog")?;
    done(drd, drd.enable_force(id, true), "release the emergency stop and press the force button")?;
    done(drd, drd.compensate_gravity(id), "update the SDK")
}

fn done(drd: &Drd, outcome: Outcome, remedy: &'static str) -> Result<(), DeviceError> {
    if outcome == Outcome::Failed { Err(not_opened(drd, remedy)) } else { Ok(()) }
}

fn not_opened(drd: &Drd, remedy: &'static str) -> DeviceError {
    DeviceError::open(DEVICE.name, drd.last_error(), remedy)
}

/// Converts the maker's axes (x to the user, y right, z up) to x right, y up, z to the user.
fn axes(v: [f64; 3]) -> Vec3 {
    Vec3::new(v[1] as f32, v[2] as f32, v[0] as f32)
}

fn makers_axes(v: Vec3) -> [f64; 3] {
    [v.z, v.x, v.y].map(f64::from)
}

/// Converts the maker's orientation to these axes: at rest the shaft points to the user.
fn rotation(rows: [[f64; 3]; 3]) -> Quat {
    Quat::from_mat3(&Mat3::from_cols(axes(rows[1]), axes(rows[2]), axes(rows[0])).transpose()).normalize()
}

/// Capabilities from the data sheet, by system type.
fn capabilities(drd: &Drd, id: i8) -> Capabilities {
    let (force_n, workspace_mm, resolution_mm, rate_hz) = match drd.system_type(id) {
        63 => (20.0, Vec3::new(400.0, 400.0, 260.0), 0.02, 4000.0),
        104 | 105 | 206 => (20.0, Vec3::new(190.0, 190.0, 130.0), 0.0015, 4000.0),
        // The Falcon's serial link carries one packet each way in a USB frame.
        60 => (8.0, Vec3::new(100.0, 100.0, 100.0), 0.06, 1000.0),
        _ => (12.0, Vec3::new(160.0, 160.0, 110.0), 0.01, 4000.0),
    };
    Capabilities {
        name: drd.system_name(id),
        peak_force_n: force_n,
        continuous_force_n: force_n,
        rate_hz,
        workspace_mm: Vec3::new(workspace_mm.y, workspace_mm.z, workspace_mm.x),
        axes_driven: if drd.has_active_wrist(id) { 6 } else { 3 },
        position_resolution_mm: resolution_mm,
        ..Capabilities::PASSIVE
    }
}
