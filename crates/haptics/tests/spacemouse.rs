//! Tests the SpaceMouse driver against emulators of its daemon and device file: axes, units,
//! limits, disconnection.
#![expect(clippy::unwrap_used, reason = "a test may stop where it fails")]

use std::io::{Read, Write};
use std::os::unix::net::{UnixListener, UnixStream};
use trepan_geometry::{Buttons, Vec3};
use trepan_haptics::spacemouse::{Config, Source, SpaceMouse};
use trepan_haptics::{Fault, HapticDevice, Reading, Status, Workspace};

/// The emulated daemon, and the knob connected to it.
struct Bench {
    daemon: UnixStream,
    knob: SpaceMouse,
    time_ms: f64,
    _folder: tempfile::TempDir,
}

impl Bench {
    fn with(config: Config) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("spnav.sock");
        let listener = UnixListener::bind(&path).unwrap();
        let knob = SpaceMouse::open(&Config { source: Source::Daemon(path), ..config }).unwrap();
        let (daemon, _) = listener.accept().unwrap();
        Self { daemon, knob, time_ms: 0.0, _folder: folder }
    }

    fn new() -> Self {
        Self::with(Config::default())
    }

    fn send(&mut self, message: [i32; 8]) {
        let bytes: Vec<u8> = message.iter().flat_map(|number| number.to_ne_bytes()).collect();
        self.daemon.write_all(&bytes).unwrap();
    }

    /// Reads for some ticks while the knob repeats its message, as a deflected one does.
    fn read_while(&mut self, message: [i32; 8], ticks: u32) -> Reading {
        for tick in 0..ticks {
            if tick % 10 == 0 {
                self.send(message);
            }
            self.read();
        }
        self.read()
    }

    fn read(&mut self) -> Reading {
        self.time_ms += 1.0;
        self.knob.read(self.time_ms)
    }
}

const REST: [i32; 8] = [0; 8];

#[test]
fn pushes_are_speeds_to_the_right_up_and_to_the_user() {
    // The daemon's third axis points away from the user.
    for (push, axis) in [([350, 0, 0], Vec3::X), ([0, 350, 0], Vec3::Y), ([0, 0, -350], Vec3::Z)] {
        let mut bench = Bench::new();
        bench.read();
        let reading = bench.read_while([0, push[0], push[1], push[2], 0, 0, 0, 8], 100);
        assert_eq!(reading.status, Status::Fresh);
        assert!((reading.tool.twist.linear - axis * 0.05).length() < 1e-5, "{}", reading.tool.twist.linear);
        assert!((reading.tool.tip() - axis * 5.05).length() < 0.06, "{}: 0.05 mm/ms for 101 ms", reading.tool.tip());
    }
}

#[test]
fn half_a_push_is_a_quarter_of_the_speed_and_more_than_all_is_all() {
    for (counts, speed) in [(175, 0.0125), (-175, -0.0125), (350, 0.05), (100_000, 0.05)] {
        let mut bench = Bench::new();
        let reading = bench.read_while([0, counts, 0, 0, 0, 0, 0, 8], 5);
        assert!((reading.tool.twist.linear.x - speed).abs() < 1e-5, "{counts}: {}", reading.tool.twist.linear);
    }
}

#[test]
fn a_knob_for_the_view_has_a_velocity_without_an_end_of_its_way() {
    let mut bench = Bench::new();
    for tick in 1..400 {
        bench.send([0, 350, 0, 0, 0, 350, 0, 8]);
        let twist = bench.knob.velocity(50.0 * f64::from(tick));
        assert!((twist.linear - 0.05 * Vec3::X).length() < 1e-6 && twist.angular.y.abs() > 9e-4, "{twist:?}");
    }
    assert!(bench.knob.velocity(30_000.0).linear.x > 0.04, "held still, the daemon is silent");
    bench.send(REST);
    assert_eq!(bench.knob.velocity(30_001.0).linear, Vec3::ZERO, "released");
}

#[test]
fn turns_tilt_the_shaft_and_end_at_the_cone() {
    for (turn, axis) in [([350, 0, 0], Vec3::X), ([0, 350, 0], Vec3::Y), ([0, 0, -350], Vec3::Z)] {
        let mut bench = Bench::new();
        let message = [0, 0, 0, 0, turn[0], turn[1], turn[2], 8];
        let reading = bench.read_while(message, 100);
        assert!((reading.tool.twist.angular - axis * 1e-3).length() < 1e-5, "{}", reading.tool.twist.angular);
        let far = bench.read_while(message, 3000).tool;
        let (about, angle) = far.world_from_tool.rotation.to_axis_angle();
        assert!((about - axis).length() < 1e-3 && (angle - 1.0).abs() < 1e-3, "{about} {angle}");
        assert!(far.twist.angular.length() < 1e-6);
    }
}

#[test]
fn the_tool_stays_in_its_box_and_its_velocity_says_so() {
    let mut bench = Bench::new();
    let tool = bench.read_while([0, 350, 350, -350, 0, 0, 0, 8], 1500).tool;
    assert_eq!((tool.tip(), tool.twist.linear), (Vec3::splat(60.0), Vec3::ZERO));
    assert_eq!(bench.knob.capabilities().workspace_mm, Vec3::splat(120.0));
}

#[test]
fn buttons_are_the_pedal_and_the_next_tool() {
    let mut bench = Bench::new();
    bench.send([1, 0, 0, 0, 0, 0, 0, 0]);
    assert_eq!(bench.read().tool.buttons, Buttons::PEDAL);
    bench.send([1, 1, 0, 0, 0, 0, 0, 0]);
    bench.send([2, 0, 0, 0, 0, 0, 0, 0]);
    assert_eq!(bench.read().tool.buttons, Buttons::NEXT_TOOL);
    bench.send([1, 99, 0, 0, 0, 0, 0, 0]);
    assert_eq!(bench.read().tool.buttons, Buttons::NEXT_TOOL, "a button that no mask holds");
}

#[test]
fn a_knob_held_still_moves_on_until_it_is_let_go_or_unplugged() {
    let mut bench = Bench::new();
    let pushed = bench.read_while([0, 350, 0, 0, 0, 0, 0, 8], 50).tool;
    bench.send(REST);
    let still = bench.read().tool;
    assert_eq!((still.twist.linear, still.tip()), (Vec3::ZERO, pushed.tip()));
    bench.send([0, -300, 0, 0, 0, 0, 0, 16]);
    let from = bench.read().tool.tip().x;
    let held = (0..1000).map(|_| bench.read().tool).last().unwrap();
    let speed = 0.05 * (300.0f32 / 350.0).powi(2);
    assert!((from - held.tip().x - 1000.0 * speed).abs() < 0.1, "{}", held.tip());
    bench.send([3, 0, 1, 0, 0, 0, 0, 0]);
    assert!(bench.read().tool.twist.linear.x < 0.0, "another knob was plugged in");
    bench.send([3, 1, 0, 0, 0, 0, 0, 0]);
    assert_eq!(bench.read().tool.twist.linear, Vec3::ZERO, "unplugged");
}

#[test]
fn the_answer_about_the_version_is_no_message() {
    let mut bench = Bench::new();
    let mut asked = [0; 4];
    bench.daemon.read_exact(&mut asked).unwrap();
    bench.daemon.write_all(&asked).unwrap();
    bench.send([0, 350, 0, 0, 0, 0, 0, 8]);
    bench.read();
    assert!((bench.read().tool.twist.linear.x - 0.05).abs() < 1e-5);
}

#[test]
fn split_and_unknown_messages_are_no_matter() {
    let mut bench = Bench::new();
    bench.send([4, 7, 7, 7, 7, 7, 7, 7]);
    bench.send([-5, i32::MIN, 0, 0, 0, 0, 0, 0]);
    let bytes: Vec<u8> = [0i32, 350, 0, 0, 0, 0, 0, 8].iter().flat_map(|n| n.to_ne_bytes()).collect();
    bench.daemon.write_all(&bytes[..13]).unwrap();
    bench.read();
    assert_eq!(bench.read().tool.twist.linear, Vec3::ZERO);
    bench.daemon.write_all(&bytes[13..]).unwrap();
    assert!((bench.read().tool.twist.linear.x - 0.05).abs() < 1e-5);
}

#[test]
fn a_daemon_that_ends_is_reported_and_the_tool_stays() {
    let mut bench = Bench::new();
    let place = bench.read_while([0, 350, 0, 0, 0, 0, 0, 8], 50).tool.tip();
    bench.daemon.shutdown(std::net::Shutdown::Both).unwrap();
    let reading = bench.read();
    assert_eq!((reading.status, reading.tool.twist.linear), (Status::Lost, Vec3::ZERO));
    assert_eq!((reading.tool.tip(), bench.knob.watch().fault()), (place, Some(Fault::Disconnected)));
    assert_eq!(bench.read().status, Status::Lost);
}

#[test]
fn the_workspace_maps_to_the_patient() {
    let workspace = Workspace::facing(Vec3::new(10.0, 20.0, 30.0), Vec3::NEG_Y, Vec3::Z, 2.0);
    let mut bench = Bench::with(Config { workspace, ..Config::default() });
    assert_eq!(bench.read().tool.tip(), Vec3::new(10.0, 20.0, 30.0));
    let tool = bench.read_while([0, 0, 350, 0, 0, 0, 0, 8], 100).tool;
    assert!((tool.twist.linear - Vec3::Z * 0.1).length() < 1e-5, "up, twice as fast: {}", tool.twist.linear);
}

#[test]
fn the_device_file_is_read_where_there_is_no_daemon() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("hidraw7");
    std::fs::write(&path, [1, 0x5e, 1, 0, 0, 0, 0]).unwrap();
    let mut knob = SpaceMouse::open(&Config { source: Source::Hid(path), ..Config::default() }).unwrap();
    // A plain file ends where a device would continue: its reports are used, then the knob is lost.
    assert_eq!(knob.read(0.0).status, Status::Lost);
    assert_eq!(knob.watch().fault(), Some(Fault::Disconnected));
}

#[test]
fn missing_devices_are_reported() {
    let nowhere = || std::path::PathBuf::from("/nonexistent/knob");
    for source in [Source::Daemon(nowhere()), Source::Hid(nowhere())] {
        let error = SpaceMouse::open(&Config { source, ..Config::default() }).err().unwrap().to_string();
        assert!(error.contains("/nonexistent/knob") && error.contains("spacenavd"), "{error}");
    }
}

#[test]
fn a_hundred_sessions_leave_nothing_behind() {
    let open = || std::fs::read_dir("/proc/self/fd").map_or(0, Iterator::count);
    let before = open();
    for _ in 0..100 {
        let mut bench = Bench::new();
        assert_eq!(bench.read_while([0, 350, 0, 0, 0, 0, 0, 8], 5).status, Status::Fresh);
        bench.knob.close();
        bench.knob.close();
        assert_eq!(bench.read().status, Status::Lost);
    }
    assert!(open() < before + 50, "{} files are open, {before} before", open());
}
