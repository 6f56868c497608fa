//! A driver template: an imaginary device that speaks UDP, compiled and tested like the others.
//!
//! # The guide
//! 1. **Copy** this file and `tests/template.rs` under your device's name; put `pub mod` into
//!    `lib.rs`.
//! 2. **Write down the protocol first**, as the table below, with its units. Only two functions use
//!    it: `command` and `State::parse`. They are pure, so that they can be tested with known bytes
//!    before there is a device.
//! 3. **Convert units and axes in these functions**: elsewhere use mm, ms, N, rad; x right, y up, z
//!    to the user. [`Workspace`] then maps that to world space.
//! 4. **Never wait in `read`.** Set a socket or a file non-blocking; a library that waits longer
//!    than a quarter tick gets a thread (see `haply`), one with its own loop gets triple buffers
//!    (see `openhaptics`).
//! 5. **Send every fault to `Ramp::cut`**, in the tick in which it is detected: the force is zero
//!    at once, stays zero for a while, and ramps in again. The message of a [`Fault`] says what the
//!    user must do. A dead loop must leave no force: give the device a watchdog.
//! 6. **State true values in [`Capabilities`]**: the guard takes peak and continuous force, delay
//!    and encoder step from it.
//! 7. **Emulate the device in a test** with all faults: silence, invalid data, old counters,
//!    faults, unplugging, a hundred sessions.
//! 8. **Describe it** in a [`Descriptor`] in the same file, and name that in `list.rs`: a line,
//!    from which command lines, help and lists follow. `device test NAME` then tests the real one.
//!
//! # The imaginary protocol
//! One datagram each way per tick, little-endian. The device drops its force 10 ms after the last
//! command. The axes are x to the user, y right, z up.
//! ```text
//! to the device     b"TD"  counter u32  force 3 x f32                                   N
//! from the device   b"td"  counter u32  position 3 x f32  velocity 3 x f32  flags u32   m, m/s
//! flags             bits 0..8 buttons, bit 8 motors too warm, bit 9 not calibrated
//! ```
//!
//! # When not to use it
//! To drive hardware: no such device is sold.

use crate::ramp::Ramp;
use crate::{
    Capabilities, Descriptor, DeviceError, Fault, HapticDevice, Motion, NameError, OpenedDevice, Reading, Status,
    Watch, Workspace,
};
use std::io::{self, ErrorKind};
use std::net::{Ipv4Addr, SocketAddr, UdpSocket};
use trepan_contact::GuardedWrench;
use trepan_geometry::{Buttons, Pose, ToolState, Twist, Vec3};

/// `template:ADDRESS`. It is not in `list.rs`, since there is no such device.
pub static DEVICE: Descriptor = Descriptor {
    name: "template",
    usage: ":ADDRESS",
    source: "imaginary protocol over UDP",
    motion: Motion::Hardware,
    argument: |name, address| match address {
        None => Err(NameError::lacks(name, "address", "192.168.0.7:9000")),
        Some(address) => Ok(Some(address.to_owned())),
    },
    id: |address| address,
    probe: || Ok(Vec::new()),
    open: |address, setting| {
        let address = address.unwrap_or_default().parse::<SocketAddr>();
        let address = address.map_err(|fault| DeviceError::open(DEVICE.name, fault.to_string(), REMEDY))?;
        let config = Config { address, workspace: setting.workspace };
        Template::open(&config).map(|device| OpenedDevice::watched(device.watch(), device))
    },
};

const REMEDY: &str = "switch it on and give the address that it shows";
/// The device's tick, ms.
const TICK_MS: f32 = 1.0;
/// Ticks of silence after which the force is cut.
const SILENT_TICKS: u32 = 10;
/// Ticks of silence after which the device is lost.
const LOST_TICKS: u32 = 500;
/// Most datagrams processed by one read.
const MAX_DATAGRAMS: usize = 16;
const TOO_WARM: u32 = 1 << 8;
const NOT_CALIBRATED: u32 = 1 << 9;

/// Which device to open, and its workspace.
#[derive(Clone, Copy, Debug)]
pub struct Config {
    /// The device's network address.
    pub address: SocketAddr,
    /// How device space maps to world space.
    pub workspace: Workspace,
}

/// An open device.
pub struct Template {
    socket: Option<UdpSocket>,
    workspace: Workspace,
    counter: u32,
    last_counter: u32,
    silent_ticks: u32,
    last: ToolState,
    ramp: Ramp,
    watch: Watch,
}

impl Template {
    /// Opens the device.
    pub fn open(config: &Config) -> Result<Self, DeviceError> {
        let watch = Watch::default();
        Ok(Self {
            socket: Some(connected(config.address).map_err(|fault| not_opened(config.address, &fault))?),
            workspace: config.workspace,
            counter: 0,
            last_counter: 0,
            silent_ticks: 0,
            last: config.workspace.world(&ToolState::at(Pose::IDENTITY)),
            ramp: Ramp::new(watch.clone()),
            watch,
        })
    }

    /// Returns a watch on the device's faults, usable from another thread.
    pub fn watch(&self) -> Watch {
        self.watch.clone()
    }

    /// Returns the newest state received since the last read; datagrams that arrive out of order
    /// are ignored.
    fn newest(&mut self) -> io::Result<Option<State>> {
        let (Some(socket), mut newest) = (&self.socket, None) else { return Err(ErrorKind::NotConnected.into()) };
        for _ in 0..MAX_DATAGRAMS {
            let mut bytes = [0; 64];
            match socket.recv(&mut bytes) {
                Ok(count) => match State::parse(&bytes[..count]) {
                    Some(state) if state.counter > self.last_counter => {
                        self.last_counter = state.counter;
                        newest = Some(state);
                    }
                    Some(_) => {}
                    None => self.ramp.cut(Fault::InvalidMessage),
                },
                Err(fault) if fault.kind() == ErrorKind::WouldBlock => break,
                Err(fault) => return Err(fault),
            }
        }
        Ok(newest)
    }

    /// Repeats the last tool, as stale or lost.
    fn last_reading(&mut self, time_ms: f64) -> Reading {
        self.silent_ticks = self.silent_ticks.saturating_add(1);
        if self.silent_ticks == SILENT_TICKS {
            self.ramp.cut(Fault::ServiceSilent);
        }
        if self.silent_ticks >= LOST_TICKS && self.socket.is_some() {
            self.lose();
        }
        let status = if self.socket.is_some() { Status::Stale } else { Status::Lost };
        Reading { tool: ToolState { time_ms, ..self.last }, status }
    }

    fn lose(&mut self) {
        self.socket = None;
        self.ramp.cut(Fault::Disconnected);
    }

    fn send(&mut self, force: Vec3) {
        self.counter += 1;
        let bytes = command(self.counter, force);
        if self.socket.as_ref().is_some_and(|socket| socket.send(&bytes).is_err()) {
            self.lose();
        }
    }
}

impl HapticDevice for Template {
    fn read(&mut self, time_ms: f64) -> Reading {
        let state = match self.newest() {
            Ok(Some(state)) => state,
            Ok(None) => return self.last_reading(time_ms),
            Err(_) => {
                if self.socket.is_some() {
                    self.lose();
                }
                return self.last_reading(time_ms);
            }
        };
        self.silent_ticks = 0;
        match state.flags {
            flags if flags & TOO_WARM != 0 => self.ramp.cut(Fault::Overheated),
            flags if flags & NOT_CALIBRATED != 0 => self.ramp.cut(Fault::NotCalibrated),
            _ => {}
        }
        self.last = self.workspace.world(&state.tool(time_ms));
        Reading { tool: self.last, status: Status::Fresh }
    }

    fn apply(&mut self, wrench: GuardedWrench) {
        let force = self.workspace.device_wrench(wrench.wrench()).force * self.ramp.share(TICK_MS);
        self.send(if self.silent_ticks >= SILENT_TICKS { Vec3::ZERO } else { force });
    }

    fn capabilities(&self) -> Capabilities {
        Capabilities {
            name: "template".to_owned(),
            peak_force_n: 3.0, // numerical: an example
            continuous_force_n: 1.0,
            workspace_mm: Vec3::splat(100.0),
            axes_driven: 3,
            position_resolution_mm: 0.01,
            delay_ticks: 1,
            ..Capabilities::PASSIVE
        }
    }

    fn close(&mut self) {
        self.send(Vec3::ZERO);
        self.socket = None;
    }
}

impl Drop for Template {
    fn drop(&mut self) {
        self.close();
    }
}

/// One state from the device.
#[derive(Clone, Copy, Debug, PartialEq)]
struct State {
    counter: u32,
    /// Position, m, maker's axes.
    position: Vec3,
    /// Velocity, m/s, maker's axes.
    velocity: Vec3,
    flags: u32,
}

impl State {
    /// Parses a datagram; `None` when it is invalid.
    fn parse(bytes: &[u8]) -> Option<Self> {
        let (head, body) = bytes.split_at_checked(2)?;
        let words: &[[u8; 4]; 8] = body.as_chunks().0.try_into().ok()?;
        let vector = |at: usize| Vec3::from([0, 1, 2].map(|axis| f32::from_le_bytes(words[at + axis])));
        let number = |at: usize| u32::from_le_bytes(words[at]);
        let state = Self { counter: number(0), position: vector(1), velocity: vector(4), flags: number(7) };
        (head == b"td" && body.len() == 32 && state.position.is_finite() && state.velocity.is_finite()).then_some(state)
    }

    /// Converts to a tool in device space: mm, mm/ms.
    fn tool(&self, time_ms: f64) -> ToolState {
        ToolState {
            twist: Twist { linear: axes(self.velocity), angular: Vec3::ZERO },
            buttons: Buttons(self.flags & 0xff),
            time_ms,
            ..ToolState::at(Pose::from_translation(axes(self.position) * 1e3))
        }
    }
}

/// The datagram that commands a force, N, device space.
fn command(counter: u32, force: Vec3) -> [u8; 18] {
    let mut bytes = [0; 18];
    bytes[..2].copy_from_slice(b"TD");
    bytes[2..6].copy_from_slice(&counter.to_le_bytes());
    let makers = [force.z, force.x, force.y];
    bytes[6..].as_chunks_mut().0.iter_mut().zip(makers).for_each(|(to, n): (&mut [u8; 4], f32)| *to = n.to_le_bytes());
    bytes
}

/// Converts the maker's axes (x to the user, y right, z up) to x right, y up, z to the user.
fn axes(v: Vec3) -> Vec3 {
    Vec3::new(v.y, v.z, v.x)
}

fn connected(address: SocketAddr) -> io::Result<UdpSocket> {
    let socket = UdpSocket::bind((Ipv4Addr::UNSPECIFIED, 0))?;
    socket.connect(address)?;
    socket.set_nonblocking(true)?;
    Ok(socket)
}

fn not_opened(address: SocketAddr, fault: &io::Error) -> DeviceError {
    DeviceError::open(format!("template at {address}"), fault.to_string(), REMEDY)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_command_is_the_stated_bytes() {
        let bytes = command(0x0102, Vec3::new(1.0, 2.0, -0.5));
        assert_eq!(bytes[..6], [b'T', b'D', 2, 1, 0, 0]);
        let numbers: Vec<f32> = bytes[6..].as_chunks().0.iter().map(|n| f32::from_le_bytes(*n)).collect();
        assert_eq!(numbers, [-0.5, 1.0, 2.0], "to the user, right, up");
    }

    proptest! {
        #[test]
        fn any_bytes_are_a_finite_state_or_none(bytes in prop::collection::vec(any::<u8>(), 0..64)) {
            prop_assert!(State::parse(&bytes).is_none_or(|state| state.tool(0.0).is_finite()));
        }
    }
}
