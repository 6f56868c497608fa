//! Requirements on every device, checked on each of them.
#![expect(clippy::unwrap_used, reason = "a test may stop where it fails")]

mod common;

use common::guarded;
use trepan_contact::GuardedWrench;
use trepan_geometry::{Pose, Vec3, Wrench};
use trepan_haptics::mouse::{self, MouseHandle};
use trepan_haptics::replay::Replay;
use trepan_haptics::script::{self, Script, Site};
use trepan_haptics::simulated::{Config, HandModel, Simulated};
use trepan_haptics::{HapticDevice, Status};

fn site() -> Site {
    Site { entry: Vec3::new(20.0, 30.0, 80.0), inward: Vec3::NEG_Z, bone_mm: 5.0, brain_mm: 7.0 }
}

fn script(name: &str) -> Script {
    Script::named(name, &site(), 300.0).unwrap()
}

fn mouse_pair() -> (MouseHandle, mouse::Mouse) {
    mouse::pair(Pose::from_translation(Vec3::new(1.0, 2.0, 3.0)))
}

fn simulated(delay_ticks: usize) -> Simulated {
    Simulated::new(Config { delay_ticks, ..Config::default() }, HandModel::LIGHT, Box::new(script("craniotomy")))
}

fn replay() -> Replay {
    let original = script("craniotomy-and-probe");
    Replay::new((0..200).map(|tick| original.at(f64::from(tick))).collect())
}

/// Every device, with its name.
fn devices() -> Vec<(Box<dyn HapticDevice>, &'static str)> {
    let mut devices: Vec<(Box<dyn HapticDevice>, &'static str)> =
        script::NAMES.map(|name| (Box::new(script(name)) as Box<dyn HapticDevice>, name)).into();
    devices.push((Box::new(replay()), "replay"));
    devices.push((Box::new(mouse_pair().1), "mouse"));
    devices.push((Box::new(simulated(2)), "simulated"));
    devices
}

/// A guarded wrench of one newton.
fn one_newton() -> GuardedWrench {
    let wrench = guarded(Vec3::X, Vec3::ZERO);
    assert_eq!(wrench.force(), Vec3::X);
    wrench
}

#[test]
fn readings_are_finite_and_stamped_and_repeat() {
    for ((mut one, name), (mut two, _)) in devices().into_iter().zip(devices()) {
        for tick in 0..400 {
            let (a, b) = (one.read(f64::from(tick)), two.read(f64::from(tick)));
            assert!(a.tool.is_finite() && a.tool.time_ms == f64::from(tick), "{name} at {tick}");
            assert_eq!(a.tool.world_from_tool, b.tool.world_from_tool, "{name} at {tick}");
            assert_eq!((a.tool.twist, a.status), (b.tool.twist, b.status), "{name} at {tick}");
            one.apply(one_newton());
            two.apply(one_newton());
        }
    }
}

#[test]
fn scripts_and_replays_end_and_the_others_do_not() {
    for (mut device, name) in devices() {
        let last = (0..400).map(|tick| device.read(f64::from(tick)).status).last().unwrap();
        assert_eq!(last == Status::Finished, name != "mouse", "{name}: {last:?}");
    }
}

#[test]
fn capabilities_are_usable() {
    for (device, name) in devices() {
        let able = device.capabilities();
        assert!(!able.name.is_empty() && able.rate_hz >= 1000.0, "{name}");
        assert!(able.continuous_force_n <= able.peak_force_n, "{name}");
        assert!(able.axes_driven > 0 || able.peak_force_n == 0.0, "{name}");
    }
}

#[test]
fn closing_leaves_no_force_and_stays_closed() {
    let (mut scripted, mut replayed) = (script("probe"), replay());
    for device in [&mut scripted as &mut dyn HapticDevice, &mut replayed] {
        device.apply(one_newton());
        device.close();
        device.apply(one_newton());
        device.close();
    }
    assert_eq!((scripted.applied(), replayed.applied()), (Wrench::ZERO, Wrench::ZERO));

    let (mut handle, mut mouse) = mouse_pair();
    mouse.apply(one_newton());
    assert_eq!(handle.wrench().force, Vec3::X);
    mouse.close();
    mouse.apply(one_newton());
    assert_eq!(handle.wrench(), Wrench::ZERO);

    let mut device = simulated(0);
    device.apply(one_newton());
    assert_eq!(device.motor_force(), Vec3::X);
    device.close();
    device.apply(one_newton());
    assert_eq!(device.motor_force(), Vec3::ZERO);
}
