//! SpaceMouse: a six-axis knob that sets the tool's velocity. It has no motors.
//!
//! # Theory
//! The knob reports its deflection, −1 to 1 on each axis. It springs back, so that the deflection
//! sets a velocity:
//! ```text
//! v = s |a| a     ω = r |b| b
//! position and tilt are their integrals, limited to a box and a cone
//! ```
//! The square makes small pushes fine and large ones fast.
//!
//! # Practice
//! Reads the spacenav daemon where it runs, else the system's HID reports ([`Config::source`]).
//! Both are read without waiting, at most 64 messages a tick. The knob's axes become x right, y up,
//! z to the user; [`Workspace`] maps them to world space. The first button is the pedal, the second
//! requests the next tool. A deflected knob repeats its HID reports, so that there 100 ms without
//! one count as released. By the daemon a knob of absolute axes is silent while it is held still,
//! and stays as it was until it is let go or unplugged. A lost knob is [`Status::Lost`] until it is
//! opened again. In the other hand it turns the view: [`SpaceMouse::velocity`].
//!
//! # Sources
//! spacenavd's protocol (its public documentation), the USB HID reports of 3Dconnexion's devices.
//!
//! # When not to use it
//! To judge forces: it renders none.

mod daemon;
mod hid;

use crate::mouse::rotation_vector;
use crate::{
    Capabilities, Descriptor, DeviceError, Fault, HapticDevice, Listed, Motion, OpenedDevice, Reading, Status, Watch,
    Workspace, no_argument,
};
use std::io;
use std::path::PathBuf;
use trepan_contact::GuardedWrench;
use trepan_geometry::{Buttons, Pose, Quat, ToolState, Twist, Vec3};

/// `spacemouse`: a six-axis knob without force.
pub static DEVICE: Descriptor = Descriptor {
    name: "spacemouse",
    usage: "",
    source: "spacenavd's protocol, USB HID reports",
    motion: Motion::Hardware,
    argument: no_argument,
    id: |_| "",
    probe: || link(&Source::Any).map(|(_, name)| vec![Listed::new("spacemouse", format!("ready: {name}"))]),
    open: |_, setting| {
        let config = Config { workspace: setting.workspace, ..Config::default() };
        SpaceMouse::open(&config).map(|device| OpenedDevice::watched(device.watch(), device))
    },
};

/// Count that a knob reports at full deflection.
const FULL_SCALE: f32 = 350.0;
/// Silence of HID reports after which the knob counts as released, ms.
const SILENT_MS: f64 = 100.0;
/// Longest tick that is integrated, ms.
const MAX_DT_MS: f64 = 100.0;
/// Most messages processed by one read.
const MAX_MESSAGES: usize = 64;

/// Where the knob is read, and how it moves the tool.
#[derive(Clone, Debug)]
pub struct Config {
    /// Where the knob is read.
    pub source: Source,
    /// Speed at full deflection, mm/ms.
    pub speed: f32,
    /// Rotation speed at full deflection, rad/ms.
    pub turning: f32,
    /// Largest distance of the tool from its start on each axis, mm.
    pub reach_mm: f32,
    /// Largest tilt of the tool from its start, rad.
    pub tilt: f32,
    /// How device space maps to world space.
    pub workspace: Workspace,
}

impl Default for Config {
    fn default() -> Self {
        Self {
            source: Source::Any,
            speed: 0.05,
            turning: 1e-3,
            reach_mm: 60.0,
            tilt: 1.0,
            workspace: Workspace::default(),
        }
    }
}

/// Where a knob is read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Source {
    /// The daemon at its usual socket (or at `SPNAV_SOCKET`), else the first known HID device.
    Any,
    /// The daemon's socket.
    Daemon(PathBuf),
    /// A device file with HID reports.
    Hid(PathBuf),
}

/// The last reported state of the knob.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Knob {
    /// Translation: right, up, to the user; counts.
    push: Vec3,
    /// Rotation about the same axes, right-handed; counts.
    turn: Vec3,
    buttons: u32,
}

/// A source of knob messages.
trait Link: Send {
    /// Processes the next message; `Ok(false)` when none is available.
    fn next(&mut self, knob: &mut Knob) -> io::Result<bool>;
    /// Whether a knob that is held still sends nothing.
    fn is_silent_when_held(&self) -> bool;
    /// Count at full deflection.
    fn full_scale(&self) -> f32;
}

/// An open knob.
pub struct SpaceMouse {
    link: Option<Box<dyn Link>>,
    name: &'static str,
    config: Config,
    knob: Knob,
    heard_ms: f64,
    full_scale: f32,
    last_ms: Option<f64>,
    position: Vec3,
    tilt: Vec3,
    last: ToolState,
    watch: Watch,
}

impl SpaceMouse {
    /// Opens the knob; the tool starts in the middle of its box.
    pub fn open(config: &Config) -> Result<Self, DeviceError> {
        let (link, name) = link(&config.source)?;
        Ok(Self {
            full_scale: link.full_scale(),
            link: Some(link),
            name,
            config: config.clone(),
            knob: Knob::default(),
            heard_ms: f64::NEG_INFINITY,
            last_ms: None,
            position: Vec3::ZERO,
            tilt: Vec3::ZERO,
            last: config.workspace.world(&ToolState::at(Pose::IDENTITY)),
            watch: Watch::default(),
        })
    }

    /// Returns a watch on the device's faults, usable from another thread.
    pub fn watch(&self) -> Watch {
        self.watch.clone()
    }

    /// Processes the messages received since the last read.
    fn listen(&mut self, time_ms: f64) {
        for _ in 0..MAX_MESSAGES {
            let Some(link) = &mut self.link else { return };
            match link.next(&mut self.knob) {
                Ok(true) => self.heard_ms = time_ms,
                Ok(false) => break,
                Err(_) => {
                    self.link = None;
                    self.knob = Knob::default();
                    self.watch.set(Some(Fault::Disconnected));
                }
            }
        }
        let repeats = self.link.as_ref().is_some_and(|link| !link.is_silent_when_held());
        if repeats && time_ms - self.heard_ms > SILENT_MS {
            (self.knob.push, self.knob.turn) = (Vec3::ZERO, Vec3::ZERO);
        }
    }

    /// Returns the velocity that the knob sets in device space, without moving the tool: for a view
    /// that the knob turns. Zero once the knob is lost.
    pub fn velocity(&mut self, time_ms: f64) -> Twist {
        self.listen(time_ms);
        self.set_by_knob()
    }

    fn set_by_knob(&self) -> Twist {
        let rate = |counts: Vec3| (counts / self.full_scale).clamp(-Vec3::ONE, Vec3::ONE);
        let squared = |a: Vec3| a.abs() * a;
        let linear = squared(rate(self.knob.push)) * self.config.speed;
        Twist { linear, angular: squared(rate(self.knob.turn)) * self.config.turning }
    }

    /// Integrates the knob's velocity over `dt_ms`; returns the tool in device space.
    fn moved(&mut self, dt_ms: f32) -> ToolState {
        let Config { reach_mm, tilt, .. } = self.config;
        let Twist { linear, angular } = self.set_by_knob();
        let (from, turned_from) = (self.position, Quat::from_scaled_axis(self.tilt));
        self.position = (from + dt_ms * linear).clamp(Vec3::splat(-reach_mm), Vec3::splat(reach_mm));
        self.tilt = (self.tilt + dt_ms * angular).clamp_length_max(tilt);
        let rotation = Quat::from_scaled_axis(self.tilt);
        let per_ms = if dt_ms > 0.0 { 1.0 / dt_ms } else { 0.0 };
        let angular = rotation_vector(rotation * turned_from.inverse()) * per_ms;
        ToolState {
            twist: Twist { linear: (self.position - from) * per_ms, angular },
            buttons: Buttons(self.knob.buttons),
            ..ToolState::at(Pose::from_parts(self.position, rotation))
        }
    }
}

impl HapticDevice for SpaceMouse {
    fn read(&mut self, time_ms: f64) -> Reading {
        self.listen(time_ms);
        if self.link.is_none() {
            let tool = ToolState { twist: Twist::default(), time_ms, ..self.last };
            return Reading { tool, status: Status::Lost };
        }
        let dt_ms = (time_ms - self.last_ms.unwrap_or(time_ms)).clamp(0.0, MAX_DT_MS) as f32;
        self.last_ms = Some(time_ms);
        let tool = self.moved(dt_ms);
        self.last = ToolState { time_ms, ..self.config.workspace.world(&tool) };
        Reading { tool: self.last, status: Status::Fresh }
    }

    fn apply(&mut self, _wrench: GuardedWrench) {}

    fn capabilities(&self) -> Capabilities {
        let workspace_mm = Vec3::splat(2.0 * self.config.reach_mm);
        Capabilities { workspace_mm, position_resolution_mm: 1e-3, ..Capabilities::passive(self.name) }
    }

    fn close(&mut self) {
        self.link = None;
    }
}

fn link(source: &Source) -> Result<(Box<dyn Link>, &'static str), DeviceError> {
    let daemon = |path: PathBuf| match daemon::Daemon::connect(&path) {
        Ok(link) => Ok((Box::new(link) as Box<dyn Link>, "SpaceMouse, by its daemon")),
        Err(fault) => Err(not_opened(format!("the daemon at {}: {fault}", path.display()))),
    };
    let hid = |path: PathBuf| match hid::Hid::open(&path) {
        Ok(link) => Ok((Box::new(link) as Box<dyn Link>, "SpaceMouse, by its HID reports")),
        Err(fault) => Err(not_opened(format!("{}: {fault}", path.display()))),
    };
    match source {
        Source::Daemon(path) => daemon(path.clone()),
        Source::Hid(path) => hid(path.clone()),
        Source::Any => daemon(daemon::usual_place()).or_else(|fault| hid::find().map_or(Err(fault), hid)),
    }
}

fn not_opened(reason: String) -> DeviceError {
    let remedy = "plug it in, and install and start spacenavd (`apt install spacenavd`), or let your user read its /dev/hidraw file";
    DeviceError::open(DEVICE.name, reason, remedy)
}
