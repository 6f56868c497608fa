//! Tests topics between two processes: messages arrive, and a dead process does not affect the
//! other.
#![cfg(feature = "topics")]
#![expect(clippy::unwrap_used, reason = "a test may stop where it fails")]

use std::process::{Child, Command, Stdio};
use std::time::Duration;
use trepan_geometry::Vec3;
use trepan_link::topics::{MAX_MESSAGE_BYTES, Session, TopicError};
use trepan_link::wire::{EventRecord, SessionHeader, StateRecord, TeacherRecord, TickRecord};

const ROLE: &str = "TREPAN_TEST_ROLE";

fn session_name(test: &str) -> String {
    format!("test-{test}-{}", std::process::id())
}

/// Starts this test binary as another process that runs only [`other_process`].
fn start(role: &str, session: &str) -> Child {
    Command::new(std::env::current_exe().unwrap())
        .args(["--exact", "other_process", "--nocapture"])
        .env(ROLE, format!("{role} {session}"))
        .stdout(Stdio::null())
        .spawn()
        .unwrap()
}

/// Retries until there is a result, or panics after a timeout.
fn wait_for<R>(mut attempt: impl FnMut() -> Option<R>) -> R {
    for _ in 0..10_000 {
        if let Some(result) = attempt() {
            return result;
        }
        std::thread::sleep(Duration::from_millis(1));
    }
    panic!("nothing came");
}

/// The other process's part; does nothing in an ordinary test run.
#[test]
fn other_process() {
    let Ok(role) = std::env::var(ROLE) else { return };
    let (role, name) = role.split_once(' ').unwrap();
    let session = Session::join(name).unwrap();
    match role {
        "simulator" => {
            let mut ticks = session.publisher::<TickRecord>().unwrap();
            for tick in 1.. {
                ticks.send(&TickRecord { tick, depth_mm: 0.1 * tick as f32, ..TickRecord::default() }).unwrap();
                std::thread::sleep(Duration::from_millis(1));
            }
        }
        _ => {
            let mut ticks = session.subscriber::<TickRecord>().unwrap();
            let mut teacher = session.publisher::<TeacherRecord>().unwrap();
            loop {
                if let Some(tick) = ticks.newest().unwrap() {
                    let marker = Vec3::new(tick.depth_mm, 0.0, 0.0);
                    let flags = TeacherRecord::MARKER;
                    teacher.send(&TeacherRecord { seq: tick.tick, marker, flags, ..TeacherRecord::default() }).unwrap();
                }
                std::thread::sleep(Duration::from_millis(1));
            }
        }
    }
}

#[test]
fn a_watcher_sees_the_simulator_and_survives_its_death() {
    let name = session_name("watch");
    let session = Session::join(&name).unwrap();
    let mut ticks = session.subscriber::<TickRecord>().unwrap();
    for _ in 0..2 {
        let mut simulator = start("simulator", &name);
        let first = wait_for(|| ticks.newest().unwrap());
        let later = wait_for(|| ticks.newest().unwrap().filter(|t| t.tick > first.tick + 5));
        assert_eq!(later.depth_mm.to_bits(), (0.1 * later.tick as f32).to_bits());
        simulator.kill().unwrap();
        simulator.wait().unwrap();
        wait_for(|| ticks.newest().unwrap().is_none().then_some(()));
    }
}

#[test]
fn a_simulator_receives_the_teacher_and_survives_its_death() {
    let name = session_name("teach");
    let session = Session::join(&name).unwrap();
    let mut ticks = session.publisher::<TickRecord>().unwrap();
    let mut teacher = session.subscriber::<TeacherRecord>().unwrap();
    let mut watcher = start("watcher", &name);
    let mut tick = 0;
    let mut publish = || {
        tick += 1;
        ticks.send(&TickRecord { tick, depth_mm: tick as f32, ..TickRecord::default() }).unwrap();
    };
    let shown = wait_for(|| {
        publish();
        teacher.newest().unwrap()
    });
    assert_eq!((shown.marker.x, shown.flags), (shown.seq as f32, TeacherRecord::MARKER));
    watcher.kill().unwrap();
    watcher.wait().unwrap();
    (0..2000).for_each(|_| publish());
}

#[test]
fn a_slow_subscriber_loses_the_oldest_and_keeps_the_order() {
    let session = Session::join(&session_name("slow")).unwrap();
    let mut subscriber = session.subscriber::<TickRecord>().unwrap();
    let mut publisher = session.publisher::<TickRecord>().unwrap();
    for tick in 0..1000 {
        publisher.send(&TickRecord { tick, ..TickRecord::default() }).unwrap();
    }
    let received: Vec<u64> = std::iter::from_fn(|| subscriber.receive().unwrap()).map(|t| t.tick).collect();
    assert!(received.is_sorted() && received.last() == Some(&999) && received.len() >= 256, "{}", received.len());
    assert_eq!(subscriber.garbled(), 0);
}

#[test]
fn names_and_lengths_are_checked() {
    for name in ["", "a/b", "ü", &"x".repeat(101)] {
        assert!(matches!(Session::join(name), Err(TopicError::Name { .. })), "{name}");
    }
    let session = Session::join(&session_name("long")).unwrap();
    let mut events = session.publisher::<EventRecord>().unwrap();
    let mut received = session.subscriber::<EventRecord>().unwrap();
    let long = EventRecord { text: "x".repeat(MAX_MESSAGE_BYTES), ..EventRecord::default() };
    assert!(matches!(events.send(&long), Err(TopicError::TooLong { .. })));
    let event = EventRecord { tick: 1, time_ms: 2.0, kind: "marker".into(), text: "½ mm".into() };
    events.send(&event).unwrap();
    assert_eq!(received.receive().unwrap(), Some(event));
}

#[test]
fn a_late_subscriber_gets_the_newest_message_when_it_is_greeted() {
    let session = Session::join(&session_name("late")).unwrap();
    let mut events = session.publisher::<EventRecord>().unwrap();
    let event = |tick| EventRecord { tick, kind: "marker".into(), ..EventRecord::default() };
    let mut early = session.subscriber::<EventRecord>().unwrap();
    (1..=3).for_each(|tick| events.send(&event(tick)).unwrap());
    let mut late = session.subscriber::<EventRecord>().unwrap();
    events.greet().unwrap();
    assert_eq!((late.newest().unwrap(), early.newest().unwrap()), (Some(event(3)), Some(event(3))));
    events.greet().unwrap();
    assert_eq!((late.newest().unwrap(), early.newest().unwrap()), (None, None));
}

#[test]
fn the_newest_of_two_publishers_is_the_one_sent_last() {
    let session = Session::join(&session_name("two")).unwrap();
    let mut watcher = session.subscriber::<TickRecord>().unwrap();
    let mut publishers = [0, 1].map(|_| session.publisher::<TickRecord>().unwrap());
    for (tick, by) in [(1, 0), (2, 1), (3, 0), (4, 1), (5, 0)] {
        publishers[by].send(&TickRecord { tick, ..TickRecord::default() }).unwrap();
        std::thread::sleep(Duration::from_millis(1));
    }
    assert_eq!(watcher.newest().unwrap().map(|t| t.tick), Some(5));
    for tick in 6..600 {
        publishers[tick as usize % 2].send(&TickRecord { tick, ..TickRecord::default() }).unwrap();
    }
    assert_eq!(watcher.newest().unwrap().map(|t| t.tick), Some(599));
    assert!(watcher.newest().unwrap().is_none(), "all messages of both are taken");
}

#[test]
fn who_joins_late_gets_the_header_as_it_was_written() {
    let session = Session::join(&session_name("header")).unwrap();
    let mut publisher = session.publisher::<SessionHeader>().unwrap();
    let line = "-12.345678 3.25 80.125,".repeat(1000);
    let config = [("flap_line".to_string(), line), ("tets".into(), "12000".into())].into();
    let header = SessionHeader { app: "integrated".into(), config, ..SessionHeader::default() };
    publisher.send(&header).unwrap();
    let mut late = session.subscriber::<SessionHeader>().unwrap();
    let received = wait_for(|| {
        publisher.greet().unwrap();
        late.newest().unwrap()
    });
    assert_eq!(received, header);
}

#[test]
fn who_joins_late_gets_the_newest_state_whole_at_any_size() {
    let session = Session::join(&session_name("state")).unwrap();
    let mut publisher = session.publisher::<StateRecord>().unwrap();
    for size in [0, 400_000, 3_000_000, 7] {
        let words: Vec<u64> = (0..size).map(|n: u64| n.wrapping_mul(0x9e37_79b9_7f4a_7c15)).collect();
        let state = StateRecord { tick: 7, time_ms: 0.5, checksum: StateRecord::sum(&words), words };
        publisher.send(&state).unwrap();
        let mut late = session.subscriber::<StateRecord>().unwrap();
        publisher.greet().unwrap();
        let received = late.newest().unwrap().unwrap();
        assert!(received == state && received.checksum == StateRecord::sum(&received.words), "{size} words");
    }
    let long = StateRecord { words: vec![0; 5_000_000], ..StateRecord::default() };
    assert!(matches!(publisher.send(&long), Err(TopicError::TooLong { .. })));
}
