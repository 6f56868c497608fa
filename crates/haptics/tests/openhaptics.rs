//! Tests the OpenHaptics driver against an emulator of libHD: units, axes, frame rules, and faults.
#![expect(clippy::unwrap_used, reason = "a test may stop where it fails")]

mod common;

use common::guarded;
use trepan_emulators::{Library as Emulator, hd as keys};
use trepan_geometry::{Buttons, Quat, Vec3};
use trepan_haptics::openhaptics::{Config, OpenHaptics};
use trepan_haptics::{DeviceError, Fault, HapticDevice, Status, Workspace};

/// Ticks after which the force is at full size: 200 of rest and 300 of ramp.
const SETTLED: u32 = 600;

fn emulator() -> Emulator {
    Emulator::hd()
}

fn config(emulator: &Emulator) -> Config {
    Config { library: Some(emulator.path().to_owned()), ..Config::default() }
}

/// Alternates loop and servo; returns the force on the motors at the end.
fn run(device: &mut OpenHaptics, emulator: &Emulator, from: u32, ticks: u32, force: Vec3) -> Vec3 {
    for tick in from..from + ticks {
        device.read(f64::from(tick));
        device.apply(guarded(force, Vec3::ZERO));
        emulator.set(keys::TICKS, 1.0);
    }
    motors(emulator)
}

/// An open device with a full force of 1 N along x on its motors.
fn settled() -> (Emulator, OpenHaptics) {
    let emulator = emulator();
    let mut device = OpenHaptics::open(&config(&emulator)).unwrap();
    assert!(run(&mut device, &emulator, 0, SETTLED, Vec3::X).x > 0.99);
    (emulator, device)
}

fn motors(emulator: &Emulator) -> Vec3 {
    Vec3::from([keys::FORCE_X, keys::FORCE_Y, keys::FORCE_Z].map(|key| emulator.get(key) as f32))
}

#[test]
fn pose_velocity_buttons_and_force_have_the_right_axes_and_units() {
    let emulator = emulator();
    // Device x lies along world y, device y along world z, device z along world x, at (5, 6, 7),
    // twice as large.
    let axes = Workspace::facing(Vec3::new(5.0, 6.0, 7.0), Vec3::NEG_X, Vec3::Z, 2.0);
    let mut device = OpenHaptics::open(&Config { workspace: axes, ..config(&emulator) }).unwrap();
    for (key, value) in [
        (keys::POSITION_X, 1.0),
        (keys::POSITION_Y, 2.0),
        (keys::POSITION_Z, 3.0),
        (keys::VELOCITY_X, 40.0),
        (keys::BUTTONS, 3.0),
        (keys::DRIFT, 1.001),
    ] {
        emulator.set(key, value);
    }
    let force = run(&mut device, &emulator, 0, SETTLED, Vec3::new(0.1, 0.2, 0.3));
    assert!((force - Vec3::new(0.2, 0.3, 0.1)).length() < 1e-6, "{force}");

    let reading = device.read(f64::from(SETTLED));
    assert_eq!(reading.status, Status::Fresh);
    assert!((reading.tool.tip() - Vec3::new(11.0, 8.0, 11.0)).length() < 1e-5, "{}", reading.tool.tip());
    assert!((reading.tool.twist.linear - Vec3::Y * 0.08).length() < 1e-6, "{}", reading.tool.twist.linear);
    assert!((reading.tool.twist.angular - Vec3::Z * 5e-4).length() < 1e-9);
    assert!(reading.tool.buttons.has(Buttons::PEDAL) && reading.tool.buttons.has(Buttons::NEXT_TOOL));
    assert!(reading.tool.is_finite());
    device.close();
    assert_eq!(emulator.get(keys::MISUSE), 0.0);
}

#[test]
fn the_shaft_turns_with_the_stylus() {
    let emulator = emulator();
    emulator.set(keys::TURN_Y, 0.7);
    let mut device = OpenHaptics::open(&config(&emulator)).unwrap();
    emulator.set(keys::TICKS, 1.0);
    let rotation = device.read(0.0).tool.world_from_tool.rotation;
    assert!(rotation.angle_between(Quat::from_rotation_y(0.7)) < 1e-3);
}

#[test]
fn only_six_axis_devices_get_torque() {
    for (axes, torque) in [(3.0, 0.0), (6.0, 50.0)] {
        let emulator = emulator();
        emulator.set(keys::OUTPUT_DOF, axes);
        let mut device = OpenHaptics::open(&config(&emulator)).unwrap();
        for _ in 0..SETTLED {
            device.apply(guarded(Vec3::ZERO, Vec3::X * 50.0));
            emulator.set(keys::TICKS, 1.0);
        }
        assert!((emulator.get(keys::TORQUE_X) - torque).abs() < 1e-4);
        assert_eq!(f64::from(device.capabilities().axes_driven), axes);
        assert_eq!(emulator.get(keys::MISUSE), 0.0);
    }
}

#[test]
fn capabilities_are_the_devices_own() {
    let emulator = emulator();
    let able = OpenHaptics::open(&config(&emulator)).unwrap().capabilities();
    assert_eq!((able.name.as_str(), able.workspace_mm), ("Emulated Touch", Vec3::new(160.0, 120.0, 70.0)));
    assert!((able.peak_force_n - 3.3).abs() < 1e-6 && (able.continuous_force_n - 0.88).abs() < 1e-6);
}

#[test]
fn the_device_is_found_by_name_and_by_its_usual_names() {
    for (index, name, found) in [
        (0.0, None, true),
        (2.0, None, true),
        (1.0, Some("Left"), true),
        (1.0, None, false),
        (0.0, Some("Right"), false),
    ] {
        let emulator = emulator();
        emulator.set(keys::NAME, index);
        let opened = OpenHaptics::open(&Config { device: name.map(str::to_owned), ..config(&emulator) });
        match opened {
            Ok(_) => assert!(found, "{name:?}"),
            Err(DeviceError::Open { reason, remedy, .. }) => {
                assert!(!found && reason == "Device fault (error 0300)" && remedy.contains("set-up tool"), "{reason}");
            }
            Err(other) => panic!("{other}"),
        }
    }
}

#[test]
fn a_missing_licence_is_reported_with_the_vendors_text() {
    let emulator = emulator();
    emulator.set(keys::UNLICENSED, 1.0);
    let error = OpenHaptics::open(&config(&emulator)).err().unwrap().to_string();
    assert!(error.contains("Invalid license (error 0600)"), "{error}");
}

/// A library with two devices, both opened.
fn two() -> (Emulator, OpenHaptics, OpenHaptics) {
    let emulator = emulator();
    emulator.set(keys::NAME, 1.0);
    emulator.set(keys::of_second(keys::NAME), 3.0);
    let open = |name: &str| OpenHaptics::open(&Config { device: Some(name.to_owned()), ..config(&emulator) }).unwrap();
    let (left, right) = (open("Left"), open("Right"));
    (emulator, left, right)
}

/// Alternates both loops and the servo; returns the forces on both motors along x.
fn run_two(emulator: &Emulator, hands: &mut [(&mut OpenHaptics, f32)], from: u32, ticks: u32) -> [f32; 2] {
    for tick in from..from + ticks {
        for (device, newtons) in hands.iter_mut() {
            device.read(f64::from(tick));
            device.apply(guarded(Vec3::X * *newtons, Vec3::ZERO));
        }
        emulator.set(keys::TICKS, 1.0);
    }
    [keys::FORCE_X, keys::of_second(keys::FORCE_X)].map(|key| emulator.get(key) as f32)
}

#[test]
fn two_devices_have_their_own_poses_forces_and_faults() {
    let (emulator, mut left, mut right) = two();
    emulator.set(keys::POSITION_X, 10.0);
    emulator.set(keys::of_second(keys::POSITION_X), -20.0);
    let [one, other] = run_two(&emulator, &mut [(&mut left, 0.5), (&mut right, -1.0)], 0, SETTLED);
    assert!((one - 0.5).abs() < 1e-6 && (other + 1.0).abs() < 1e-6, "{one} {other}");
    let tips = [left.read(700.0).tool.tip().x, right.read(700.0).tool.tip().x];
    assert!((tips[0] - 10.0).abs() < 1e-5 && (tips[1] + 20.0).abs() < 1e-5, "{tips:?}");

    // Overheating of one device does not affect the other.
    emulator.set(keys::of_second(keys::ERROR), f64::from(0x0200));
    assert_eq!(run_two(&emulator, &mut [(&mut left, 0.5), (&mut right, -1.0)], 701, 5), [one, 0.0]);
    assert_eq!((left.watch().fault(), right.watch().fault()), (None, Some(Fault::Overheated)));
    // Nor does its silence.
    emulator.set(keys::of_second(keys::ERROR), 0.0);
    run_two(&emulator, &mut [(&mut left, 0.5), (&mut right, -1.0)], 706, SETTLED);
    assert_eq!(run_two(&emulator, &mut [(&mut left, 0.5)], 1400, 10), [one, 0.0]);
    assert_eq!((left.watch().fault(), right.watch().fault()), (None, Some(Fault::LoopSilent)));
    assert_eq!(emulator.get(keys::MISUSE), 0.0);
}

#[test]
fn one_lost_device_leaves_the_other_and_is_opened_again_beside_it() {
    let (emulator, mut left, mut right) = two();
    run_two(&emulator, &mut [(&mut left, 0.5), (&mut right, -1.0)], 0, SETTLED);
    emulator.set(keys::ERROR, f64::from(0x0302));
    let forces = run_two(&emulator, &mut [(&mut left, 0.5), (&mut right, -1.0)], 700, 1);
    assert_eq!(forces[0], 0.0);
    assert!(forces[1] < -0.99, "{forces:?}");
    run_two(&emulator, &mut [(&mut left, 0.5), (&mut right, -1.0)], 701, 20);
    assert_eq!((left.read(721.0).status, left.watch().fault()), (Status::Lost, Some(Fault::Disconnected)));
    assert_ne!(right.read(721.0).status, Status::Lost);
    assert_eq!((emulator.get(keys::ENABLED), emulator.get(keys::of_second(keys::ENABLED))), (0.0, 1.0));

    left.close();
    emulator.set(keys::ERROR, 0.0);
    let mut left = OpenHaptics::open(&Config { device: Some("Left".to_owned()), ..config(&emulator) }).unwrap();
    let forces = run_two(&emulator, &mut [(&mut left, 0.5), (&mut right, -1.0)], 800, SETTLED);
    assert!(forces[0] > 0.49 && forces[1] < -0.99, "{forces:?}");
    assert_eq!(emulator.get(keys::MISUSE), 0.0);
}

#[test]
fn closing_one_device_leaves_the_other_its_force_which_ramps_in() {
    let (emulator, mut left, mut right) = two();
    run_two(&emulator, &mut [(&mut left, 0.5), (&mut right, -1.0)], 0, SETTLED);
    left.close();
    assert_eq!((emulator.get(keys::OPEN), emulator.get(keys::of_second(keys::OPEN))), (0.0, 1.0));
    assert_eq!(emulator.get(keys::RUNNING), 1.0);
    let mut last = 0.0;
    for tick in 0..400 {
        let [closed, force] = run_two(&emulator, &mut [(&mut right, -1.0)], 700 + tick, 1);
        assert!(closed == 0.0 && force <= last && last - force < 0.004, "{last} to {force}");
        last = force;
    }
    assert!(last < -0.99 && right.watch().fault().is_none(), "{last}");
    right.close();
    for key in [keys::of_second(keys::OPEN), keys::RUNNING, keys::SCHEDULED, keys::MISUSE] {
        assert_eq!(emulator.get(key), 0.0, "key {key}");
    }
}

#[test]
fn a_second_device_that_cannot_be_opened_leaves_the_first_alone() {
    let emulator = emulator();
    let mut first = OpenHaptics::open(&config(&emulator)).unwrap();
    for (name, words) in [(None, "Device already initiated (error 0301)"), (Some("Right"), "Device fault (error 0300)")]
    {
        let second = OpenHaptics::open(&Config { device: name.map(str::to_owned), ..config(&emulator) });
        let error = second.err().unwrap().to_string();
        assert!(error.contains(words) && error.contains("close other programs"), "{error}");
        assert!(run(&mut first, &emulator, 0, SETTLED, Vec3::X).x > 0.99);
    }
    assert_eq!(emulator.get(keys::MISUSE), 0.0);
}

#[test]
fn a_scheduler_that_does_not_start_is_reported_and_closes_the_device() {
    let emulator = emulator();
    emulator.set(keys::STUCK, 1.0);
    let error = OpenHaptics::open(&config(&emulator)).err().unwrap().to_string();
    assert!(error.contains("Timer error (error 0304)"), "{error}");
    assert_eq!((emulator.get(keys::OPEN), emulator.get(keys::SCHEDULED)), (0.0, 0.0));
    emulator.set(keys::STUCK, 0.0);
    assert!(OpenHaptics::open(&config(&emulator)).is_ok());
}

#[test]
fn closing_waits_for_a_running_callback() {
    let emulator = emulator();
    for _ in 0..20 {
        let mut device = OpenHaptics::open(&config(&emulator)).unwrap();
        std::thread::scope(|scope| {
            let ticking = scope.spawn(|| emulator.set(keys::TICKS, 2000.0));
            device.close();
            ticking.join().unwrap();
        });
        assert_eq!((emulator.get(keys::MISUSE), emulator.get(keys::OPEN)), (0.0, 0.0));
    }
}

#[test]
fn after_a_pause_of_the_library_no_old_force_comes_back() {
    let (emulator, mut device) = settled();
    for tick in 1000..1200 {
        device.read(f64::from(tick));
        device.apply(guarded(Vec3::X, Vec3::ZERO));
    }
    emulator.set(keys::TICKS, 1.0);
    assert_eq!((motors(&emulator), device.watch().fault()), (Vec3::ZERO, Some(Fault::Stale)));
    assert!(run(&mut device, &emulator, 1200, SETTLED, Vec3::X).x > 0.99);
}

#[test]
fn faults_cut_the_force_at_once_and_it_comes_back_slowly() {
    for (error, fault) in [
        (0x0200, Fault::Overheated),
        (0x0203, Fault::TooFast),
        (0x0201, Fault::ForceRefused),
        (0x0204, Fault::ForceRefused),
    ] {
        let (emulator, mut device) = settled();
        let watch = device.watch();
        emulator.set(keys::ERROR, f64::from(error));
        assert_eq!(run(&mut device, &emulator, 1000, 1, Vec3::X), Vec3::ZERO);
        assert_eq!((watch.fault(), watch.count()), (Some(fault), 1));
        emulator.set(keys::ERROR, 0.0);
        assert_eq!(run(&mut device, &emulator, 1001, 150, Vec3::X), Vec3::ZERO);
        let mut last = 0.0;
        for tick in 0..400 {
            let force = run(&mut device, &emulator, 1200 + tick, 1, Vec3::X).x;
            assert!(force >= last && force - last < 0.004, "{last} to {force}");
            last = force;
        }
        assert!(last > 0.99 && watch.fault().is_none());
    }
}

#[test]
fn an_unplugged_device_is_lost_and_without_force() {
    let emulator = emulator();
    let mut device = OpenHaptics::open(&config(&emulator)).unwrap();
    run(&mut device, &emulator, 0, SETTLED, Vec3::X);
    emulator.set(keys::ERROR, f64::from(0x0302));
    assert_eq!(run(&mut device, &emulator, 1000, 1, Vec3::X), Vec3::ZERO);
    assert_eq!(device.read(1001.0).status, Status::Lost);
    assert_eq!(device.watch().fault(), Some(Fault::Disconnected));
    assert_eq!((emulator.get(keys::SCHEDULED), emulator.get(keys::ENABLED)), (0.0, 0.0));
}

#[test]
fn a_silent_loop_loses_its_force_within_ten_milliseconds() {
    let (emulator, device) = settled();
    emulator.set(keys::TICKS, 9.0);
    assert!(motors(&emulator).x > 0.99);
    emulator.set(keys::TICKS, 1.0);
    assert_eq!((motors(&emulator), device.watch().fault()), (Vec3::ZERO, Some(Fault::LoopSilent)));
}

#[test]
fn a_silent_servo_makes_stale_then_lost_readings() {
    let emulator = emulator();
    let mut device = OpenHaptics::open(&config(&emulator)).unwrap();
    emulator.set(keys::TICKS, 1.0);
    let statuses = [0.0, 1.0, 50.0, 51.0].map(|time_ms| device.read(time_ms).status);
    assert_eq!(statuses, [Status::Fresh, Status::Stale, Status::Stale, Status::Lost]);
}

#[test]
fn there_is_no_force_before_the_device_is_calibrated() {
    let emulator = emulator();
    emulator.set(keys::CALIBRATION, f64::from(0x5002));
    let mut device = OpenHaptics::open(&config(&emulator)).unwrap();
    assert_eq!(run(&mut device, &emulator, 0, 1000, Vec3::X), Vec3::ZERO);
    assert_eq!(device.watch().fault(), Some(Fault::NotCalibrated));
    emulator.set(keys::CALIBRATION, f64::from(0x5001));
    assert_eq!(run(&mut device, &emulator, 1000, 200, Vec3::X), Vec3::ZERO);
    assert!((device.read(1200.0).tool.tip().x - 30.0).abs() < 1e-5);
    assert!(run(&mut device, &emulator, 1201, SETTLED, Vec3::X).x > 0.99);
    assert_eq!((device.watch().fault(), emulator.get(keys::MISUSE)), (None, 0.0));
}

#[test]
fn a_hundred_sessions_leave_nothing_behind() {
    let emulator = emulator();
    for session in 1..=100 {
        let mut device = OpenHaptics::open(&config(&emulator)).unwrap();
        run(&mut device, &emulator, 0, 5, Vec3::X);
        device.close();
        device.apply(guarded(Vec3::X, Vec3::ZERO));
        assert_eq!(device.read(10.0).status, Status::Lost);
        device.close();
        for key in [keys::OPEN, keys::RUNNING, keys::SCHEDULED, keys::ENABLED, keys::MISUSE, keys::FORCE_X] {
            assert_eq!(emulator.get(key), 0.0, "key {key} after session {session}");
        }
        assert_eq!(emulator.get(keys::INITIALISED), f64::from(session));
    }
}

#[test]
fn a_library_without_a_needed_function_names_it() {
    let emulator = Emulator::nothing();
    let error = OpenHaptics::open(&config(&emulator)).err().unwrap().to_string();
    assert!(error.contains("hdInitDevice") && error.contains("install"), "{error}");
}
