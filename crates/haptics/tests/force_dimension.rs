//! Tests the Force Dimension driver against an emulator of libdrd: units, axes, and faults.
#![expect(clippy::unwrap_used, reason = "a test may stop where it fails")]

mod common;

use common::guarded;
use trepan_emulators::{Library as Emulator, drd as keys};
use trepan_geometry::{Buttons, Pose, Quat, Vec3};
use trepan_haptics::force_dimension::{Config, ForceDimension};
use trepan_haptics::{Fault, HapticDevice, Status, Workspace};

/// Ticks after which the force is at full size.
const SETTLED: u32 = 600;

fn emulator() -> Emulator {
    Emulator::drd()
}

fn config(emulator: &Emulator) -> Config {
    Config { library: Some(emulator.path().to_owned()), ..Config::default() }
}

fn error(emulator: &Emulator) -> String {
    ForceDimension::open(&config(emulator)).err().unwrap().to_string()
}

/// Runs the loop; returns the force on the motors at the end, in the maker's axes.
fn run(device: &mut ForceDimension, emulator: &Emulator, from: u32, ticks: u32, force: Vec3) -> Vec3 {
    for tick in from..from + ticks {
        device.read(f64::from(tick));
        device.apply(guarded(force, Vec3::X * 50.0));
    }
    motors(emulator)
}

fn motors(emulator: &Emulator) -> Vec3 {
    Vec3::from([keys::FORCE_X, keys::FORCE_Y, keys::FORCE_Z].map(|key| emulator.get(key) as f32))
}

#[test]
fn pose_velocity_buttons_and_force_have_the_right_axes_and_units() {
    let emulator = emulator();
    let mut device = ForceDimension::open(&config(&emulator)).unwrap();
    // The maker's x is to the user (our z), y is right (our x), z is up (our y).
    for (key, value) in [
        (keys::POSITION_X, 0.001),
        (keys::POSITION_Y, 0.002),
        (keys::POSITION_Z, 0.003),
        (keys::VELOCITY_X, 0.25),
        (keys::BUTTONS, 1.0),
        (keys::TURN_X, 0.5),
    ] {
        emulator.set(key, value);
    }
    let reading = device.read(3.0);
    assert_eq!((reading.status, reading.tool.time_ms), (Status::Fresh, 3.0));
    assert!((reading.tool.tip() - Vec3::new(2.0, 3.0, 1.0)).length() < 1e-5, "{}", reading.tool.tip());
    assert!((reading.tool.twist.linear - Vec3::Z * 0.25).length() < 1e-6);
    assert!((reading.tool.twist.angular - Vec3::Y * 2e-3).length() < 1e-8);
    assert!(reading.tool.world_from_tool.rotation.angle_between(Quat::from_rotation_z(0.5)) < 1e-3);
    assert!(reading.tool.buttons.has(Buttons::PEDAL));
    let force = run(&mut device, &emulator, 4, SETTLED, Vec3::new(0.1, 0.2, 0.3));
    assert!((force - Vec3::new(0.3, 0.1, 0.2)).length() < 1e-6, "{force}");
    assert_eq!(emulator.get(keys::TORQUE_X), 0.0);
}

#[test]
fn a_driven_wrist_gets_torque_in_newton_metres() {
    let emulator = emulator();
    emulator.set(keys::ACTIVE_WRIST, 1.0);
    let axes = Workspace {
        world_from_device: Pose::from_rotation(Quat::from_rotation_y(-core::f32::consts::FRAC_PI_2)),
        scale: 1.0,
    };
    let mut device = ForceDimension::open(&Config { workspace: axes, ..config(&emulator) }).unwrap();
    assert_eq!(device.capabilities().axes_driven, 6);
    run(&mut device, &emulator, 0, SETTLED, Vec3::ZERO);
    // World x is device z, which the maker calls x: 50 N mm are 0.05 N m.
    let torque = emulator.get(keys::TORQUE_X);
    assert!((torque.abs() - 0.05).abs() < 1e-6, "{torque}");
}

#[test]
fn devices_that_cannot_be_opened_say_what_to_do() {
    let emulator = emulator();
    emulator.set(keys::DEVICES, 0.0);
    assert!(error(&emulator).contains("no device found; plug it in"), "{}", error(&emulator));
    emulator.set(keys::DEVICES, 1.0);
    emulator.set(keys::BUSY, 1.0);
    assert!(error(&emulator).contains("close other programs"));
    emulator.set(keys::BUSY, 0.0);
    emulator.set(keys::INITIALISED, 0.0);
    assert!(error(&emulator).contains("take your hands off"));
    assert_eq!((emulator.get(keys::OPEN), emulator.get(keys::MOVED_BY_ITSELF)), (0.0, 0.0));
}

#[test]
fn it_moves_by_itself_only_when_allowed() {
    let emulator = emulator();
    emulator.set(keys::INITIALISED, 0.0);
    emulator.set(keys::STUCK, 1.0);
    let allowed = Config { auto_init: true, ..config(&emulator) };
    assert!(ForceDimension::open(&allowed).is_err());
    emulator.set(keys::STUCK, 0.0);
    assert!(ForceDimension::open(&allowed).is_ok());
    assert_eq!((emulator.get(keys::MOVED_BY_ITSELF), emulator.get(keys::OPEN)), (2.0, 0.0));
}

#[test]
fn a_dead_loop_is_cut_by_the_firmware_and_a_living_one_comes_back_slowly() {
    let emulator = emulator();
    let mut device = ForceDimension::open(&config(&emulator)).unwrap();
    assert!(run(&mut device, &emulator, 0, SETTLED, Vec3::X).y > 0.99);
    emulator.set(keys::SILENCE_MS, 9.0);
    assert!(motors(&emulator).y > 0.99);
    emulator.set(keys::SILENCE_MS, 10.0);
    assert_eq!(motors(&emulator), Vec3::ZERO);
    assert_eq!(run(&mut device, &emulator, 1000, 100, Vec3::X), Vec3::ZERO);
    assert_eq!(device.watch().fault(), Some(Fault::LoopSilent));
    let mut last = 0.0;
    for tick in 0..500 {
        let force = run(&mut device, &emulator, 1100 + tick, 1, Vec3::X).y;
        assert!(force >= last && force - last < 0.004, "{last} to {force}");
        last = force;
    }
    assert!(last > 0.99 && device.watch().fault().is_none());
}

#[test]
fn device_cuts_are_reported_and_user_cuts_persist() {
    for (cause, fault, back) in [(2.0, Fault::TooFast, true), (1.0, Fault::Braked, false), (6.0, Fault::Braked, false)]
    {
        let emulator = emulator();
        let mut device = ForceDimension::open(&config(&emulator)).unwrap();
        run(&mut device, &emulator, 0, SETTLED, Vec3::X);
        emulator.set(keys::CAUSE, cause);
        assert_eq!(run(&mut device, &emulator, 1000, 8, Vec3::X), Vec3::ZERO);
        assert_eq!(device.watch().fault(), Some(fault));
        let later = run(&mut device, &emulator, 1008, 2 * SETTLED, Vec3::X).y;
        assert_eq!(later > 0.99, back, "cause {cause}: {later} N");
    }
}

#[test]
fn without_power_there_is_a_message() {
    let emulator = emulator();
    let mut device = ForceDimension::open(&config(&emulator)).unwrap();
    emulator.set(keys::POWER, 0.0);
    assert_eq!(run(&mut device, &emulator, 0, SETTLED, Vec3::X), Vec3::ZERO);
    assert_eq!(device.watch().fault(), Some(Fault::NoPower));
}

#[test]
fn an_unplugged_device_is_lost_until_it_is_opened_again() {
    let emulator = emulator();
    let mut device = ForceDimension::open(&config(&emulator)).unwrap();
    let before = device.read(0.0).tool.tip();
    emulator.set(keys::UNPLUGGED, 1.0);
    let reading = device.read(1.0);
    assert_eq!((reading.status, reading.tool.tip()), (Status::Lost, before));
    emulator.set(keys::UNPLUGGED, 0.0);
    assert_eq!(device.read(2.0).status, Status::Lost);
    assert_eq!(run(&mut device, &emulator, 3, SETTLED, Vec3::X), Vec3::ZERO);
    assert_eq!(device.watch().fault(), Some(Fault::Disconnected));
    device.close();
    assert!(ForceDimension::open(&config(&emulator)).is_ok());
}

#[test]
fn a_read_too_soon_is_stale() {
    let emulator = emulator();
    let mut device = ForceDimension::open(&config(&emulator)).unwrap();
    emulator.set(keys::TOO_SOON, 1.0);
    assert_eq!(device.read(0.0).status, Status::Stale);
}

#[test]
fn positions_that_stay_away_for_longer_than_five_milliseconds_cut_the_force() {
    let emulator = emulator();
    let mut device = ForceDimension::open(&config(&emulator)).unwrap();
    run(&mut device, &emulator, 0, SETTLED, Vec3::X);
    emulator.set(keys::TOO_SOON, 1.0);
    assert!(run(&mut device, &emulator, 600, 5, Vec3::X).y > 0.99);
    assert_eq!(run(&mut device, &emulator, 605, 1, Vec3::X), Vec3::ZERO);
    assert_eq!(device.watch().fault(), Some(Fault::Stale));
    emulator.set(keys::TOO_SOON, 0.0);
    assert!(run(&mut device, &emulator, 606, SETTLED, Vec3::X).y > 0.99 && device.watch().fault().is_none());
}

#[test]
fn a_device_that_refuses_forces_is_lost_and_one_without_velocity_is_not() {
    let emulator = emulator();
    let mut device = ForceDimension::open(&config(&emulator)).unwrap();
    emulator.set(keys::NO_VELOCITY, 1.0);
    assert!(run(&mut device, &emulator, 0, SETTLED, Vec3::X).y > 0.99);
    assert_eq!(device.read(600.0).tool.twist.linear, Vec3::ZERO);
    emulator.set(keys::REFUSES_FORCE, 1.0);
    assert_eq!(run(&mut device, &emulator, 601, 1, Vec3::X), Vec3::ZERO);
    assert_eq!((device.read(602.0).status, device.watch().fault()), (Status::Lost, Some(Fault::Disconnected)));
}

#[test]
fn firmware_without_a_watchdog_is_refused() {
    let emulator = emulator();
    emulator.set(keys::NO_WATCHDOG, 1.0);
    assert!(error(&emulator).contains("update the device's firmware"));
    assert_eq!((emulator.get(keys::OPEN), emulator.get(keys::FORCE_ON)), (0.0, 0.0));
}

#[test]
fn an_old_library_does_without_what_it_lacks() {
    let emulator = Emulator::old_drd();
    let mut device = ForceDimension::open(&config(&emulator)).unwrap();
    assert_eq!((device.read(0.0).tool.twist.angular, device.capabilities().axes_driven), (Vec3::ZERO, 3));
}

#[test]
fn a_hundred_sessions_leave_nothing_behind() {
    let emulator = emulator();
    for _ in 0..100 {
        let mut device = ForceDimension::open(&config(&emulator)).unwrap();
        run(&mut device, &emulator, 0, 400, Vec3::X);
        device.close();
        device.apply(guarded(Vec3::X, Vec3::ZERO));
        assert_eq!(device.read(10.0).status, Status::Lost);
        drop(device);
        for key in [keys::OPEN, keys::FORCE_ON, keys::MISUSE, keys::FORCE_Y] {
            assert_eq!(emulator.get(key), 0.0, "key {key}");
        }
    }
}
