//! Tests the Haply driver against an emulator of its service: units, axes, protocol, and faults.
#![expect(clippy::unwrap_used, reason = "a test may stop where it fails")]

mod common;

use common::guarded;
use std::time::Duration;
use trepan_emulators::service::{self, Behaviour, Service};
use trepan_geometry::{Buttons, Vec3};
use trepan_haptics::haply::{Config, Haply};
use trepan_haptics::{Fault, HapticDevice, Reading, Status};

fn open(service: &Service) -> Result<Haply, trepan_haptics::DeviceError> {
    Haply::open(&Config { service: service.simulation.clone(), events: service.events.clone(), ..Config::default() })
}

/// Runs the haptic loop until a condition holds; panics only after a generous timeout.
fn run_until(
    device: &mut Haply,
    service: &Service,
    force: Vec3,
    mut done: impl FnMut(&Reading, Vec3) -> bool,
) -> Reading {
    for tick in 0..20_000 {
        let reading = device.read(f64::from(tick) * 0.01);
        device.apply(guarded(force, Vec3::ZERO));
        if done(&reading, told_force(service)) {
            return reading;
        }
        std::thread::sleep(Duration::from_micros(500));
    }
    panic!("it never happened: {:?}, {:?}", device.watch().fault(), service.received());
}

fn told_force(service: &Service) -> Vec3 {
    Vec3::from(service.received().force.unwrap_or_default().map(|f| f as f32))
}

fn error(behaviour: Behaviour) -> String {
    open(&Service::start(behaviour)).err().unwrap().to_string()
}

#[test]
fn pose_velocity_buttons_and_force_have_the_right_axes_and_units() {
    let service =
        Service::start(Behaviour { position: [0.01, 0.02, 0.03], velocity: [0.1, 0.2, 0.3], ..Behaviour::default() });
    let mut device = open(&service).unwrap();
    let force = Vec3::new(0.1, 0.2, 0.3);
    // Service: x right, y forward, z up. Driver: x right, y up, z to the user.
    let reading =
        run_until(&mut device, &service, force, |_, received| (received - Vec3::new(0.1, -0.3, 0.2)).length() < 1e-6);
    assert!((reading.tool.tip() - Vec3::new(10.0, 30.0, -20.0)).length() < 1e-4, "{}", reading.tool.tip());
    assert!((reading.tool.twist.linear - Vec3::new(0.1, 0.3, -0.2)).length() < 1e-6);
    assert_eq!(reading.tool.buttons, Buttons::PEDAL);
    // A rotation about the service's z (up) is one about the driver's y (up).
    let (axis, angle) = reading.tool.world_from_tool.rotation.to_axis_angle();
    assert!((axis - Vec3::Y).length() < 1e-4 && (angle - 2.0 * 0.6f32.asin()).abs() < 1e-4, "{axis} {angle}");
    device.close();
    let received = service.received();
    assert_eq!((received.profile.as_deref(), received.probes, received.misuse), (Some("trepan"), 1, 0));
    assert_eq!(received.force, Some([0.0; 3]), "closing leaves no force");
}

#[test]
fn services_that_cannot_serve_say_what_to_do() {
    let nobody =
        Haply::open(&Config { service: "127.0.0.1:1".to_owned(), ..Config::default() }).err().unwrap().to_string();
    assert!(nobody.contains("install and start Haply's Inverse service"), "{nobody}");
    assert!(
        error(Behaviour { unplugged: true, ..Behaviour::default() }).contains("no Inverse3 is connected; plug it in")
    );
    let old = r#"{"inverse3":{"049D":{}}}"#.to_owned();
    assert!(error(Behaviour { inventory: Some(old), ..Behaviour::default() }).contains("older than 3.5; update"));
    assert!(
        error(Behaviour { inventory: Some("hello".to_owned()), ..Behaviour::default() })
            .contains("not Haply's service")
    );
}

#[test]
fn fragments_pings_and_split_packets_are_put_together() {
    let service = Service::start(Behaviour { fragmented: true, ..Behaviour::default() });
    let mut device = open(&service).unwrap();
    run_until(&mut device, &service, Vec3::X * 0.5, |_, received| received.x > 0.49);
    assert!(service.received().pongs > 10);
}

#[test]
fn every_state_that_forbids_force_cuts_it_and_says_why() {
    let service = Service::start(Behaviour::default());
    let mut device = open(&service).unwrap();
    let watch = device.watch();
    for (status, fault) in [
        (r#"{"calibrated":false,"power_supply":true,"ready":true}"#, Fault::NotCalibrated),
        (r#"{"calibrated":true,"power_supply":false,"ready":true}"#, Fault::NoPower),
        (r#"{"calibrated":true,"power_supply":true,"ready":false}"#, Fault::Braked),
    ] {
        service.behave(|b| b.status = service::READY.to_owned());
        run_until(&mut device, &service, Vec3::X, |_, received| received.x > 0.99);
        service.behave(|b| b.status = status.to_owned());
        run_until(&mut device, &service, Vec3::X, |_, received| received == Vec3::ZERO && watch.fault() == Some(fault));
    }
}

#[test]
fn invalid_and_late_replies_cut_the_force_until_they_end() {
    let service = Service::start(Behaviour::default());
    let mut device = open(&service).unwrap();
    let watch = device.watch();
    let mut cut_and_back = |misbehave: fn(&mut Behaviour), fault: Fault| {
        run_until(&mut device, &service, Vec3::X, |_, received| received.x > 0.99);
        service.behave(misbehave);
        run_until(&mut device, &service, Vec3::X, |_, _| watch.fault() == Some(fault));
        service.behave(|b| (b.garbage, b.late_ms) = (None, 0));
        run_until(&mut device, &service, Vec3::X, |_, received| received == Vec3::ZERO);
        run_until(&mut device, &service, Vec3::X, |_, received| received.x > 0.99);
    };
    cut_and_back(|b| b.late_ms = 60, Fault::ServiceSilent);
    cut_and_back(|b| b.garbage = Some("{\"inverse3\": [".to_owned()), Fault::InvalidMessage);
}

#[test]
fn a_loop_that_stops_gets_no_force() {
    let service = Service::start(Behaviour::default());
    let mut device = open(&service).unwrap();
    run_until(&mut device, &service, Vec3::X, |_, received| received.x > 0.99);
    for _ in 0..2000 {
        std::thread::sleep(Duration::from_millis(1));
        if told_force(&service) == Vec3::ZERO && device.watch().fault() == Some(Fault::LoopSilent) {
            return;
        }
    }
    panic!("the last force stays on");
}

#[test]
fn brake_events_cut_and_restore_the_force() {
    let service = Service::start(Behaviour::default());
    let mut device = open(&service).unwrap();
    run_until(&mut device, &service, Vec3::X, |_, received| received.x > 0.99);
    let event = |kind: &str| {
        format!(r#"{{"name":"device-safety-triggered","level":"warning","data":{{"safety_type":"{kind}"}}}}"#)
    };
    service.behave(|b| b.event = Some(event("ebrake_triggered")));
    let watch = device.watch();
    run_until(&mut device, &service, Vec3::X, |_, received| {
        received == Vec3::ZERO && watch.fault() == Some(Fault::Braked)
    });
    service.behave(|b| b.event = Some(event("ebrake_released")));
    run_until(&mut device, &service, Vec3::X, |_, received| received.x > 0.99);
    service.behave(|b| b.event = Some(event("stall_detected")));
    run_until(&mut device, &service, Vec3::X, |_, received| received == Vec3::ZERO);
    run_until(&mut device, &service, Vec3::X, |_, received| received.x > 0.99);
}

#[test]
fn a_device_that_vanishes_or_a_service_that_hangs_up_is_lost() {
    type Misbehave = fn(&mut Behaviour);
    let misbehaviours: [(Misbehave, Fault); 4] = [
        (|b| b.unplugged = true, Fault::Disconnected),
        (|b| b.hang_up = true, Fault::Disconnected),
        (|b| b.mute = true, Fault::ServiceSilent),
        (|b| b.garbage = Some("?".to_owned()), Fault::InvalidMessage),
    ];
    for (misbehave, fault) in misbehaviours {
        let service = Service::start(Behaviour::default());
        let mut device = open(&service).unwrap();
        run_until(&mut device, &service, Vec3::X * 0.2, |reading, _| reading.status == Status::Fresh);
        service.behave(misbehave);
        run_until(&mut device, &service, Vec3::X * 0.2, |reading, _| reading.status == Status::Lost);
        assert_eq!(device.watch().fault(), Some(fault));
        device.close();
    }
}

#[test]
fn a_silent_service_gets_zero_force_before_it_is_lost() {
    let service = Service::start(Behaviour::default());
    let mut device = open(&service).unwrap();
    run_until(&mut device, &service, Vec3::X, |_, received| received.x > 0.99);
    service.behave(|b| b.mute = true);
    let cut = |reading: &Reading, received| reading.status == Status::Lost || received == Vec3::ZERO;
    let reading = run_until(&mut device, &service, Vec3::X, cut);
    assert_ne!(reading.status, Status::Lost);
    assert_eq!((told_force(&service), device.watch().fault()), (Vec3::ZERO, Some(Fault::ServiceSilent)));
}

#[test]
fn every_device_of_the_service_is_listed_by_the_name_that_opens_it() {
    let service = Service::start(Behaviour::default());
    let config = Config { service: service.simulation.clone(), ..Config::default() };
    let names: Vec<String> = trepan_haptics::haply::list(&config).unwrap().into_iter().map(|d| d.name).collect();
    assert_eq!(names, ["haply:049D"]);
    assert!(names[0].parse::<trepan_haptics::DeviceName>().is_ok());
}

#[test]
fn many_sessions_end_with_a_closing_frame() {
    let service = Service::start(Behaviour::default());
    for session in 1..=20 {
        let mut device = open(&service).unwrap();
        run_until(&mut device, &service, Vec3::X, |reading, _| reading.status == Status::Fresh);
        device.close();
        device.close();
        assert_eq!(device.read(0.0).status, Status::Lost);
        for _ in 0..2000 {
            if service.received().goodbyes >= session {
                break;
            }
            std::thread::sleep(Duration::from_millis(1));
        }
        assert!(service.received().goodbyes >= session);
        assert_eq!(service.received().force, Some([0.0; 3]));
    }
}
