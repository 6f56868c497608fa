//! Runs a hundred sessions of every driver against its emulator: nothing leaks and nothing hangs.
//!
//! A single test, since it counts the resources of the whole process.
#![expect(clippy::unwrap_used, reason = "a test may stop where it fails")]
#![cfg(target_os = "linux")]

use std::os::unix::net::UnixListener;
use trepan_contact::{ForceGuard, GuardConfig};
use trepan_emulators::{Library, service};
use trepan_geometry::{Pose, ToolState, Vec3, Wrench};
use trepan_haptics::script::{Script, Site};
use trepan_haptics::{
    HapticDevice, Status, ThreadedDevice, force_dimension, haply, mouse, openhaptics, simulated, spacemouse,
};

/// Descriptors, threads, and memory in kB of the process.
fn resources() -> [usize; 3] {
    let count = |folder: &str| std::fs::read_dir(folder).unwrap().count();
    let status = std::fs::read_to_string("/proc/self/status").unwrap();
    let memory = status.lines().find_map(|line| line.strip_prefix("VmRSS:")).unwrap();
    let kb = memory.trim().trim_end_matches("kB").trim().parse().unwrap();
    [count("/proc/self/fd"), count("/proc/self/task"), kb]
}

/// A session of a few ticks with force, closed twice.
fn session(mut device: Box<dyn HapticDevice>) {
    let mut guard = ForceGuard::new(GuardConfig { ramp_in_ms: 0.0, ..device.capabilities().guard_config() });
    for tick in 1..=5u32 {
        let tool = device.read(tick.into()).tool;
        let tool = ToolState { time_ms: tick.into(), ..tool };
        device.apply(guard.guard(Wrench { force: 0.3 * Vec3::X, torque: Vec3::ZERO }, &tool, 1.0));
    }
    device.close();
    device.close();
}

/// A whole session of one driver.
type Run = Box<dyn FnMut()>;

fn script() -> Box<dyn HapticDevice> {
    let site = Site { entry: Vec3::ZERO, inward: Vec3::NEG_Z, bone_mm: 6.0, brain_mm: 8.0 };
    Box::new(Script::named("craniotomy", &site, 1000.0).unwrap())
}

#[test]
fn a_hundred_sessions_of_every_driver_leave_nothing_behind() {
    let (hd, drd) = (Library::hd(), Library::drd());
    let haply = service::Service::start(service::Behaviour::default());
    let folder = tempfile::tempdir().unwrap();
    let socket = folder.path().join("spnav.sock");
    let daemon = UnixListener::bind(&socket).unwrap();
    let mut drivers: Vec<(&str, Run)> = vec![
        ("openhaptics", {
            let config = openhaptics::Config { library: Some(hd.path().into()), ..Default::default() };
            Box::new(move || session(Box::new(openhaptics::OpenHaptics::open(&config).unwrap())))
        }),
        ("force-dimension", {
            let config = force_dimension::Config { library: Some(drd.path().into()), ..Default::default() };
            Box::new(move || session(Box::new(force_dimension::ForceDimension::open(&config).unwrap())))
        }),
        ("haply", {
            let (service, events) = (haply.simulation.clone(), haply.events.clone());
            let config = haply::Config { service, events, ..Default::default() };
            Box::new(move || session(Box::new(haply::Haply::open(&config).unwrap())))
        }),
        ("spacemouse", {
            let config =
                spacemouse::Config { source: spacemouse::Source::Daemon(socket.clone()), ..Default::default() };
            Box::new(move || {
                let knob = spacemouse::SpaceMouse::open(&config).unwrap();
                let other_end = daemon.accept().unwrap();
                session(Box::new(knob));
                drop(other_end);
            })
        }),
        ("mouse", Box::new(|| session(Box::new(mouse::pair(Pose::IDENTITY).1)))),
        ("simulated", {
            Box::new(|| {
                let (config, grip) = (simulated::Config::default(), simulated::HandModel::FIRM);
                session(Box::new(simulated::Simulated::new(config, grip, script())));
            })
        }),
        ("script", Box::new(|| session(script()))),
        ("script on a thread of its own", {
            Box::new(|| {
                let mut device = ThreadedDevice::new(script());
                assert_eq!(device.read(0.0).status, Status::Stale);
                session(Box::new(device));
            })
        }),
    ];
    for (name, run) in &mut drivers {
        (0..20).for_each(|_| run());
        let before = settled(|_| true);
        (0..100).for_each(|_| run());
        let after = settled(|now| now[0] <= before[0] && now[1] <= before[1]);
        println!("{name}: descriptors, threads, kB {before:?} before and {after:?} after 100 sessions");
        assert!(after[0] <= before[0] && after[1] <= before[1], "{name}: {before:?} became {after:?}");
        assert!(after[2] <= before[2] + 2048, "{name}: {before:?} became {after:?}");
    }
}

/// The resources once `so` holds, or after two seconds: an emulator's threads end a little later.
fn settled(so: impl Fn([usize; 3]) -> bool) -> [usize; 3] {
    for _ in 0..200 {
        std::thread::sleep(std::time::Duration::from_millis(10));
        if so(resources()) {
            break;
        }
    }
    resources()
}
