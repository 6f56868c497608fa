//! Tests the template driver against an emulator of its imaginary device: units, axes, and faults.
#![expect(clippy::unwrap_used, reason = "a test may stop where it fails")]

mod common;

use common::guarded;
use std::net::{SocketAddr, UdpSocket};
use trepan_contact::GuardedWrench;
use trepan_geometry::{Buttons, Vec3};
use trepan_haptics::script::ScriptError;
use trepan_haptics::template::{self, Config, Template};
use trepan_haptics::{DeviceName, Fault, HapticDevice, Reading, Setting, Status, Workspace};

/// The emulated device and its driver. Loopback delivers a datagram before `send` returns, so
/// nothing waits.
struct Bench {
    socket: UdpSocket,
    driver: Template,
    peer: Option<SocketAddr>,
    counter: u32,
    flags: u32,
    received_force: Vec3,
    time_ms: f64,
}

impl Bench {
    fn new() -> Self {
        let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
        socket.set_nonblocking(true).unwrap();
        let config = Config { address: socket.local_addr().unwrap(), workspace: Workspace::default() };
        let driver = Template::open(&config).unwrap();
        let mut bench =
            Self { socket, driver, peer: None, counter: 0, flags: 0, received_force: Vec3::ZERO, time_ms: 0.0 };
        bench.tick(false);
        bench
    }

    /// One tick of loop and device; the device answers or stays silent.
    fn tick(&mut self, answers: bool) -> Reading {
        self.time_ms += 1.0;
        let reading = self.driver.read(self.time_ms);
        self.driver.apply(one_newton());
        self.listen();
        if answers {
            self.counter += 1;
            let state = self.state(self.counter);
            self.send(&state);
        }
        reading
    }

    fn run(&mut self, ticks: u32) -> Reading {
        (0..ticks).map(|_| self.tick(true)).last().unwrap()
    }

    fn state(&self, counter: u32) -> Vec<u8> {
        let numbers = [0.01f32, 0.02, 0.03, 0.1, 0.2, 0.3];
        let mut bytes = b"td".to_vec();
        bytes.extend(counter.to_le_bytes());
        bytes.extend(numbers.iter().flat_map(|n| n.to_le_bytes()));
        bytes.extend(self.flags.to_le_bytes());
        bytes
    }

    fn send(&self, bytes: &[u8]) {
        self.socket.send_to(bytes, self.peer.unwrap()).unwrap();
    }

    /// Receives the commands, in the maker's axes.
    fn listen(&mut self) {
        let mut bytes = [0; 64];
        while let Ok((18, peer)) = self.socket.recv_from(&mut bytes) {
            assert_eq!(&bytes[..2], b"TD");
            let number = |at: usize| f32::from_le_bytes(bytes[at..at + 4].try_into().unwrap());
            (self.peer, self.received_force) = (Some(peer), Vec3::new(number(6), number(10), number(14)));
        }
    }
}

/// A guarded force of 1 N to the right.
fn one_newton() -> GuardedWrench {
    guarded(Vec3::X, Vec3::ZERO)
}

#[test]
fn pose_velocity_buttons_and_force_have_the_right_axes_and_units() {
    let mut bench = Bench::new();
    bench.flags = 2;
    let reading = bench.run(400);
    assert_eq!((reading.status, reading.tool.buttons), (Status::Fresh, Buttons::NEXT_TOOL));
    // Device: x to the user, y right, z up. Driver: x right, y up, z to the user.
    assert!((reading.tool.tip() - Vec3::new(20.0, 30.0, 10.0)).length() < 1e-4);
    assert!((reading.tool.twist.linear - Vec3::new(0.2, 0.3, 0.1)).length() < 1e-6);
    assert!((bench.received_force - Vec3::Y).length() < 1e-6, "{}", bench.received_force);
}

#[test]
fn every_fault_ends_in_no_force_at_once_and_comes_back_slowly() {
    for (flag, fault) in [(1 << 8, Fault::Overheated), (1 << 9, Fault::NotCalibrated)] {
        let mut bench = Bench::new();
        bench.run(400);
        bench.flags = flag;
        bench.run(2);
        assert_eq!((bench.received_force, bench.driver.watch().fault()), (Vec3::ZERO, Some(fault)));
        bench.flags = 0;
        bench.run(100);
        assert_eq!(bench.received_force, Vec3::ZERO, "it rests");
        bench.run(500);
        assert_eq!((bench.received_force, bench.driver.watch().fault()), (Vec3::Y, None));
    }
}

#[test]
fn a_silent_device_is_stale_without_force_then_lost() {
    let mut bench = Bench::new();
    bench.run(400);
    bench.tick(false);
    let stale = (0..10).map(|_| bench.tick(false)).last().unwrap();
    assert_eq!((stale.status, bench.received_force), (Status::Stale, Vec3::ZERO), "within ten ticks");
    assert_eq!(bench.driver.watch().fault(), Some(Fault::ServiceSilent));
    let lost = (0..500).map(|_| bench.tick(false)).last().unwrap();
    assert_eq!((lost.status, bench.driver.watch().fault()), (Status::Lost, Some(Fault::Disconnected)));
}

#[test]
fn invalid_data_cut_the_force_and_old_states_are_skipped() {
    let mut bench = Bench::new();
    bench.run(400);
    bench.send(b"what?");
    bench.run(1);
    assert_eq!((bench.received_force, bench.driver.watch().fault()), (Vec3::ZERO, Some(Fault::InvalidMessage)));
    let old = bench.state(1);
    bench.tick(false);
    bench.send(&old);
    assert_eq!(bench.tick(false).status, Status::Stale);
}

#[test]
fn a_device_that_is_unplugged_is_lost() {
    let mut bench = Bench::new();
    bench.run(10);
    bench.socket = UdpSocket::bind("127.0.0.1:0").unwrap();
    let statuses: Vec<Status> = (0..5)
        .map(|_| {
            bench.driver.apply(one_newton());
            bench.driver.read(0.0).status
        })
        .collect();
    assert_eq!((statuses[4], bench.driver.watch().fault()), (Status::Lost, Some(Fault::Disconnected)));
}

#[test]
fn a_hundred_sessions_end_without_force() {
    for _ in 0..100 {
        let mut bench = Bench::new();
        bench.run(50);
        assert!(bench.received_force.y > 0.1);
        bench.driver.close();
        bench.driver.close();
        bench.listen();
        assert_eq!((bench.received_force, bench.driver.read(0.0).status), (Vec3::ZERO, Status::Lost));
    }
}

#[test]
fn it_is_opened_by_its_name() {
    let named = |text: &str| DeviceName::among(&[&template::DEVICE], text);
    let script = |name: Option<&str>| Err(ScriptError::UnknownName { name: name.unwrap_or_default().to_owned() });
    let setting = Setting { workspace: Workspace::default(), script: &script };
    assert!(named("template:127.0.0.1:9").unwrap().open(&setting).unwrap().watch.is_some());
    assert!(named("template:attic").unwrap().open(&setting).is_err_and(|fault| fault.to_string().contains("address")));
    assert!(named("template").unwrap_err().to_string().contains("write template:192"));
}
