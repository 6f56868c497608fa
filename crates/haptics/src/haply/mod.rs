//! Haply Inverse3 with a VerseGrip, through Haply's own service on the same machine.
//!
//! # Theory
//! The service answers each message with one state, so that the sender sets the rate. A thread of
//! the driver sends and receives; the haptic loop exchanges data with it through triple buffers and
//! never waits. This costs one to two ticks of delay.
//!
//! ```text
//!   haptic loop: apply() ─command─> thread ──set_cursor_force──> service
//!                read() <──state──  thread <──state───────────── service
//! ```
//!
//! # Practice
//! The service's x right, y forward, z up (m) become x right, y up, z to the user (mm);
//! [`Workspace`] maps them to world space. Button a, or the only button of a wired grip, is the
//! pedal; b requests the next tool. Force is applied only while the service reports calibrated,
//! powered and ready, and no event reported the brakes on. Needs service 3.5 or later.
//!
//! # Sources
//! Haply Inverse SDK documentation, 3.5. The maker's Rust crate needs an asynchronous runtime; this
//! driver is 300 lines.
//!
//! # When not to use it
//! Over a network: the delay makes stiff walls unstable.

mod protocol;
mod pump;
mod websocket;

use crate::latest::Latest;
use crate::ramp::Ramp;
use crate::{
    Capabilities, Descriptor, DeviceError, HapticDevice, Listed, Motion, OpenedDevice, Reading, Status, Watch,
    Workspace,
};
use protocol::{Frame, InvalidMessage};
use pump::{Command, Flags, News, Pump};
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::thread::{self, JoinHandle};
use std::time::Duration;
use trepan_contact::GuardedWrench;
use trepan_geometry::{Pose, Quat, ToolState, Twist, Vec3};
use trepan_measurements::devices;
use triple_buffer::{Input, Output, triple_buffer};
use websocket::WebSocket;

/// `haply[:ID[+GRIP]]`: the first, or by the four hexadecimal digits of the device and of its grip.
pub static DEVICE: Descriptor = Descriptor {
    name: "haply",
    usage: "[:ID[+GRIP]]",
    source: "Haply Inverse service 3.5 (WebSocket)",
    motion: Motion::Hardware,
    argument: |_, ids| Ok(ids.map(str::to_uppercase)),
    id: |ids| ids.split('+').next().unwrap_or_default(),
    probe: || list(&Config::default()),
    open: |ids, setting| {
        let mut ids =
            ids.into_iter().flat_map(|ids| ids.split('+')).map(|id| Some(id.to_owned()).filter(|id| !id.is_empty()));
        let (device, grip) = (ids.next().flatten(), ids.next().flatten());
        let config = Config { device, grip, workspace: setting.workspace, ..Config::default() };
        Haply::open(&config).map(|device| OpenedDevice::watched(device.watch(), device))
    },
};

const PATIENCE: Duration = Duration::from_secs(1);
const RESTART: &str = "restart Haply's Inverse service";
/// Time without a state after which a device is lost, ms.
const LOST_MS: f64 = 1000.0;

/// Which device to open, and its workspace.
#[derive(Clone, Debug)]
pub struct Config {
    /// The service's simulation channel, `host:port`.
    pub service: String,
    /// The service's event channel, `host:port`.
    pub events: String,
    /// Id of the device, four hexadecimal digits; `None` takes the first.
    pub device: Option<String>,
    /// Id of the VerseGrip; `None` takes the first listed when the device is opened.
    pub grip: Option<String>,
    /// Rotation of the tool relative to the grip.
    pub grip_from_tool: Quat,
    /// How device space maps to world space.
    pub workspace: Workspace,
}

impl Default for Config {
    fn default() -> Self {
        Self {
            service: "localhost:10001".to_owned(),
            events: "localhost:10020".to_owned(),
            device: None,
            grip: None,
            grip_from_tool: Quat::IDENTITY,
            workspace: Workspace::default(),
        }
    }
}

/// An open device.
pub struct Haply {
    name: String,
    grip_from_tool: Quat,
    workspace: Workspace,
    news: Output<News>,
    commands: Input<Command>,
    flags: Arc<Flags>,
    threads: Vec<JoinHandle<()>>,
    number: u64,
    latest: Latest,
    watch: Watch,
}

impl Haply {
    /// Connects to the service and opens the device.
    pub fn open(config: &Config) -> Result<Self, DeviceError> {
        let mut socket = connect(&config.service)?;
        let (device, grip) = find(&mut socket, config.device.as_deref(), config.grip.as_deref())?;
        let events = WebSocket::connect(&config.events, PATIENCE).ok();

        let watch = Watch::default();
        let flags = Arc::new(Flags::default());
        let (news_in, news) = triple_buffer(&News::default());
        let (commands, command_output) = triple_buffer(&Command::default());
        let name = format!("Haply {device}");
        let pump = Pump {
            socket,
            device,
            grip,
            news: news_in,
            commands: command_output,
            flags: flags.clone(),
            watch: watch.clone(),
            ramp: Ramp::new(watch.clone()),
            known: Frame::default(),
            number: 0,
            garbled: 0,
        };
        let mut threads = vec![thread::spawn(move || pump.run())];
        if let Some(events) = events {
            let flags = flags.clone();
            threads.push(thread::spawn(move || pump::listen(events, &flags)));
        }
        let start = config.workspace.world(&ToolState::at(Pose::IDENTITY));
        Ok(Self {
            name,
            grip_from_tool: config.grip_from_tool,
            workspace: config.workspace,
            news,
            commands,
            flags,
            threads,
            number: 0,
            latest: Latest::new(start),
            watch,
        })
    }

    /// Returns a watch on the device's faults, usable from another thread.
    pub fn watch(&self) -> Watch {
        self.watch.clone()
    }
}

impl HapticDevice for Haply {
    fn read(&mut self, time_ms: f64) -> Reading {
        let news = *self.news.read();
        let tool = || self.workspace.world(&tool(&news.frame, self.grip_from_tool, time_ms));
        let mut reading = self.latest.read(time_ms, news.number, tool, LOST_MS);
        if self.threads.is_empty() || self.flags.lost.load(Ordering::Acquire) {
            reading.status = Status::Lost;
        }
        reading
    }

    fn apply(&mut self, wrench: GuardedWrench) {
        let Some(pump) = self.threads.first() else { return };
        self.number += 1;
        let force = services_axes(self.workspace.device_wrench(wrench.wrench()).force);
        self.commands.write(Command { number: self.number, force, pose_age_ms: self.latest.age_ms() });
        pump.thread().unpark();
    }

    fn capabilities(&self) -> Capabilities {
        Capabilities {
            name: self.name.clone(),
            peak_force_n: devices::INVERSE3_PEAK_FORCE.f32(),
            continuous_force_n: devices::INVERSE3_CONTINUOUS_FORCE.f32(),
            workspace_mm: Vec3::splat(300.0),
            axes_driven: 3,
            position_resolution_mm: 0.1,
            delay_ticks: 2,
            ..Capabilities::PASSIVE
        }
    }

    fn close(&mut self) {
        self.flags.closing.store(true, Ordering::Release);
        for thread in self.threads.drain(..) {
            thread.thread().unpark();
            // A thread that panicked applies no force: the service drops it with the connection.
            let _ = thread.join();
        }
    }
}

impl Drop for Haply {
    fn drop(&mut self) {
        self.close();
    }
}

/// The tool of a frame in device space.
fn tool(frame: &Frame, grip_from_tool: Quat, time_ms: f64) -> ToolState {
    let (position, velocity) = frame.cursor.unwrap_or_default();
    let grip = frame.orientation.unwrap_or(Quat::IDENTITY).normalize();
    let turn = axes_turn();
    let rotation = turn * grip * turn.inverse() * grip_from_tool;
    ToolState {
        world_from_tool: Pose::from_parts(axes(position) * 1e3, rotation.normalize()),
        twist: Twist { linear: axes(velocity), angular: Vec3::ZERO },
        buttons: frame.buttons.unwrap_or_default(),
        time_ms,
    }
}

/// Lists every device of a service by the name that opens it; an error says what is missing and how
/// to fix it.
pub fn list(config: &Config) -> Result<Vec<Listed>, DeviceError> {
    let mut socket = connect(&config.service)?;
    let listed = |id: String| Listed::new(format!("haply:{id}"), "ready");
    let found = devices(&mut socket, None).map(|(ids, _)| ids.into_iter().map(listed).collect());
    socket.close();
    found
}

fn connect(service: &str) -> Result<WebSocket, DeviceError> {
    WebSocket::connect(service, PATIENCE)
        .map_err(|error| not_opened(error.to_string(), "install and start Haply's Inverse service"))
}

/// Registers with the wanted device, or the first; returns its id and that of the grip.
fn find(
    socket: &mut WebSocket,
    wanted: Option<&str>,
    grip: Option<&str>,
) -> Result<(String, Option<String>), DeviceError> {
    let (mut devices, inventory) = devices(socket, wanted)?;
    let (device, grip) = (devices.swap_remove(0), protocol::grip(&inventory, grip));
    socket.send(&protocol::hello(&device)).map_err(broken)?;
    socket.receive(PATIENCE).map_err(broken)?;
    Ok((device, grip))
}

fn broken(error: std::io::Error) -> DeviceError {
    not_opened(error.to_string(), RESTART)
}

/// Reads the inventory: its text and the ids of the devices that match `wanted`, at least one.
fn devices(socket: &mut WebSocket, wanted: Option<&str>) -> Result<(Vec<String>, String), DeviceError> {
    let Some(inventory) = socket.receive(PATIENCE).map_err(broken)? else {
        return Err(not_opened("the service does not say which devices it has", RESTART));
    };
    match protocol::devices(&inventory, wanted) {
        Ok(devices) if !devices.is_empty() => Ok((devices, inventory)),
        Ok(_) => {
            let reason = wanted
                .map_or_else(|| "no Inverse3 is connected".to_owned(), |id| format!("no Inverse3 {id} is connected"));
            Err(not_opened(reason, "plug it in, switch it on and see whether Haply Hub finds it"))
        }
        Err(InvalidMessage::TooOld) => {
            Err(not_opened("its service is older than 3.5", "update Haply's Inverse service"))
        }
        Err(InvalidMessage::NotJson) => {
            Err(not_opened("what answers is not Haply's service", "see which program has its port"))
        }
    }
}

fn not_opened(reason: impl Into<String>, remedy: &'static str) -> DeviceError {
    DeviceError::open(DEVICE.name, reason, remedy)
}

/// Converts the service's axes (x right, y forward, z up) to x right, y up, z to the user.
fn axes(v: Vec3) -> Vec3 {
    Vec3::new(v.x, v.z, -v.y)
}

fn services_axes(v: Vec3) -> Vec3 {
    Vec3::new(v.x, -v.z, v.y)
}

/// [`axes`] as a rotation: −90° about x.
fn axes_turn() -> Quat {
    Quat::from_rotation_x(-core::f32::consts::FRAC_PI_2)
}
