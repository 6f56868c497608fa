//! Watching from a second process: a session publishes its ticks in shared memory, the watcher
//! follows them with its own scene.
//!
//! # Theory
//! The watcher is an ordinary session whose device is the other session: it reads the poses of the
//! trainee's device and simulates its own bone, brain and picture. A lost tick only lowers the
//! watcher's accuracy. Records from the watcher's window to the trainee are a
//! [lesson](super::lesson).
//!
//! ```text
//!  trainee: before the first tick ──header──> shared memory ──> watcher: its models
//!           recording thread ──tick, event──>               ──> pump thread ──────────┐
//!                            <────teacher────               <── watcher's window      │
//!                                                               haptic loop <── cell <┘
//! ```
//!
//! # Practice
//! Sending and receiving cost the recording thread a few µs a tick; the haptic loop is not
//! involved. The watcher is given the same images, and takes models and settings from the trainee's
//! header: nothing is measured or chosen twice, and a prepared case comes from the cache. Who joins
//! late begins with the trainee's bone, tissue and blood ([`joining`](crate::joining)); a state
//! that does not fit is refused with a remark. The second hand is not seen. Watching ends three
//! seconds after the last tick.
//!
//! # When not to use it
//! Alone, between machines: shared memory is local to a machine. Run iceoryx2's tunnel
//! (`iox2 tunnel zenoh`, of its command line tools) on both machines to forward the topics
//! `trepan/NAME/...`; nothing changes here.

use crate::clock::Clock;
use crate::lesson::{Listener, Teacher};
use crate::stop::Stop;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use trepan_contact::GuardedWrench;
use trepan_geometry::{Buttons, ToolState};
use trepan_haptics::{Capabilities, HapticDevice, Reading, Status};
use trepan_link::cell::{Reader, cell};
use trepan_link::topics::{Publisher, Session, Subscriber, Topic, TopicError};
use trepan_link::wire::{EventRecord, SessionHeader, StateRecord, TeacherRecord, TickRecord};

/// Session that cannot be shared or watched, with the flag and the remedy.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct WatchError(String);

/// Time without a new tick after which a reading is stale, ms.
const STALE_MS: f64 = 100.0;
/// Time without a new tick after which the other session counts as ended, ms.
const ENDED_MS: f64 = 3000.0;
/// Longest wait of a watcher for the other session, s: it may still be reading its images.
const TIMEOUT_S: f64 = 40.0;
/// Time between two polls of the shared memory.
const POLL_INTERVAL: Duration = Duration::from_millis(1);

/// Send end of a shared session, for the recording thread.
pub struct Share {
    /// Publishes ticks.
    pub(crate) ticks: Publisher<TickRecord>,
    /// Publishes events.
    pub(crate) events: Publisher<EventRecord>,
    /// Publishes the header.
    pub(crate) headers: Publisher<SessionHeader>,
    /// Publishes the state, until a live session takes it for a thread of its own.
    pub(crate) states: Option<Publisher<StateRecord>>,
    /// Receives the teacher's requests.
    pub(crate) teacher: Listener,
    _session: Session,
}

/// Readers of the teacher's requests: first hand, second hand, window.
pub type TeacherRequests = [Reader<TeacherRecord>; 3];

impl Share {
    /// Shares a session under a name; returns also the readers of the teacher's requests.
    pub fn open(name: &str, header: &SessionHeader) -> Result<(Self, TeacherRequests), WatchError> {
        let open = || -> Result<(Self, TeacherRequests), TopicError> {
            let session = Session::join(name)?;
            let (teacher, readers) = Listener::join(&session)?;
            let (ticks, events, mut headers) = (session.publisher()?, session.publisher()?, session.publisher()?);
            headers.send(header)?;
            let states = Some(session.publisher()?);
            Ok((Self { ticks, events, headers, states, teacher, _session: session }, readers))
        };
        open().map_err(|fault| WatchError(format!("--share {name}: {fault}")))
    }
}

/// Another session as a device: receive end of a watcher.
pub struct Watched {
    newest: Reader<TickRecord>,
    seen: u64,
    received_ms: Option<f64>,
    tool: ToolState,
    reads: u64,
    open: Arc<AtomicBool>,
    over: Arc<AtomicBool>,
}

/// Name of the watched session, and whether it has ended.
#[derive(Clone)]
pub struct Watching {
    pub(crate) name: String,
    over: Arc<AtomicBool>,
}

impl Watching {
    /// Returns a text once the watched session has ended.
    pub fn ended(&self) -> Option<String> {
        self.over.load(Ordering::Relaxed).then(|| format!("the watched session {} has ended", self.name))
    }
}

/// Waits for the header of the session of a name, until it is `over`.
pub fn header(name: &str, over: impl Fn() -> bool) -> Result<SessionHeader, WatchError> {
    let fault = |fault: TopicError| WatchError(format!("--watch {name}: {fault}"));
    let session = Session::join(name).map_err(fault)?;
    let mut headers: Subscriber<SessionHeader> = session.subscriber().map_err(fault)?;
    first(name, &mut headers, over)
}

/// Waits for the first record of a topic, until it is `over`, and logs the wait.
fn first<T: Topic>(name: &str, topic: &mut Subscriber<T>, over: impl Fn() -> bool) -> Result<T, WatchError> {
    let (clock, mut logged) = (Clock::start(), false);
    while clock.now_ms() < 1e3 * TIMEOUT_S && !over() {
        if let Ok(Some(record)) = topic.newest() {
            return Ok(record);
        }
        if !std::mem::replace(&mut logged, true) {
            tracing::info!("waiting for the session {name}, at most {TIMEOUT_S} s");
        }
        std::thread::sleep(POLL_INTERVAL);
    }
    Err(WatchError(format!(
        "--watch {name}: no session of this name is there: start one on this machine with --share {name}, then watch it"
    )))
}

impl Watched {
    /// Connects to the session of a name and waits for its first tick; the tool begins at `start`.
    pub fn open(name: &str, start: ToolState, stop: &Stop) -> Result<(Self, Watching), WatchError> {
        let fault = |fault: TopicError| WatchError(format!("--watch {name}: {fault}"));
        let session = Session::join(name).map_err(fault)?;
        let mut ticks: Subscriber<TickRecord> = session.subscriber().map_err(fault)?;
        let (mut writer, newest) = cell(TickRecord::default());
        writer.set(first(name, &mut ticks, || stop.asked())?);
        let open = Arc::new(AtomicBool::new(true));
        let watching = Watching { name: name.into(), over: Arc::default() };
        let over = Arc::clone(&watching.over);
        let pumping = Arc::clone(&open);
        std::thread::spawn(move || {
            let _session = session;
            while pumping.load(Ordering::Relaxed) {
                if let Ok(Some(record)) = ticks.newest() {
                    writer.set(record);
                }
                std::thread::sleep(POLL_INTERVAL);
            }
        });
        Ok((Self { newest, seen: 0, received_ms: None, tool: start, reads: 0, open, over }, watching))
    }
}

impl HapticDevice for Watched {
    fn read(&mut self, time_ms: f64) -> Reading {
        let (record, sequence) = self.newest.latest();
        if sequence != self.seen {
            self.seen = sequence;
            self.received_ms = Some(time_ms);
            // A watcher that joins late takes the tool that the trainee already holds; an arm takes
            // the one of before.
            let buttons = Buttons(record.buttons);
            let is_arms = buttons.has(Buttons::ARM);
            let buttons = if is_arms { buttons } else { buttons | Buttons::slot(record.tool.into()) };
            self.tool = ToolState { world_from_tool: record.device, twist: record.twist, buttons, time_ms };
        }
        self.reads += 1;
        self.tool.time_ms = time_ms;
        let silent_ms = self.received_ms.map_or(0.0, |received| time_ms - received);
        let status = match silent_ms {
            ms if ms > ENDED_MS => {
                self.over.store(true, Ordering::Relaxed);
                Status::Finished
            }
            ms if ms > STALE_MS => Status::Stale,
            _ => Status::Fresh,
        };
        Reading { tool: self.tool, status }
    }

    fn apply(&mut self, _wrench: GuardedWrench) {}

    fn capabilities(&self) -> Capabilities {
        Capabilities::PASSIVE
    }

    fn close(&mut self) {
        self.open.store(false, Ordering::Relaxed);
    }
}

/// Connections of a session's window to other sessions.
#[derive(Default)]
pub struct PeerSession {
    /// Requests of a teacher to this session's trainee.
    pub asked: Option<Reader<TeacherRecord>>,
    /// Send end, where this session teaches the trainee of another.
    pub teacher: Option<Teacher>,
    /// The session that is watched.
    pub watching: Option<Watching>,
}

#[cfg(test)]
mod tests {
    use super::*;
    use trepan_geometry::Pose;

    /// Connects a watcher to a session that sends ticks only until the watcher is connected.
    fn connected(name: &str) -> (Watched, Watching) {
        let trainee = Session::join(name).unwrap();
        let mut ticks = trainee.publisher::<TickRecord>().unwrap();
        let connected = AtomicBool::new(false);
        std::thread::scope(|scope| {
            scope.spawn(|| {
                while !connected.load(Ordering::Relaxed) {
                    ticks.send(&TickRecord { tick: 1, ..TickRecord::default() }).unwrap();
                    std::thread::sleep(POLL_INTERVAL);
                }
            });
            let opened = Watched::open(name, ToolState::at(Pose::IDENTITY), &Stop::default());
            connected.store(true, Ordering::Relaxed);
            opened.unwrap()
        })
    }

    #[test]
    fn a_watched_session_without_new_ticks_has_ended() {
        let name = format!("watched-{}", std::process::id());
        let (mut watched, watching) = connected(&name);
        // Lets the pump thread read the last ticks.
        std::thread::sleep(Duration::from_millis(200));
        assert_eq!((watched.read(0.0).status, watched.read(ENDED_MS).status), (Status::Fresh, Status::Stale));
        assert_eq!(watching.ended(), None);
        assert_eq!(watched.read(ENDED_MS + 1.0).status, Status::Finished);
        assert_eq!(watching.ended().unwrap(), format!("the watched session {name} has ended"));
        watched.close();
    }

    #[test]
    fn watching_an_unknown_session_is_refused() {
        let stop = Stop::default();
        stop.ask();
        let fault = Watched::open("nobody-at-all", ToolState::at(Pose::IDENTITY), &stop).err().unwrap().to_string();
        assert!(fault.contains("nobody-at-all") && fault.contains("--share"), "{fault}");
    }
}
