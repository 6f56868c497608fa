//! A second process that watches: the running session tells its ticks through shared memory, the
//! watcher follows with its own scene.
//!
//! # Theory
//! The watcher is an ordinary session whose device is the other session's hand: it reads where the
//! trainee's hand is and runs its own bone, brain and picture. So a lost tick costs the watcher
//! sharpness, nothing else. What a watcher's window sends back is a [lesson](super::lesson).
//!
//! ```text
//!  trainee: recording thread ──tick, event──> shared memory ──> watcher: pump thread → cell → haptic loop
//!                            <────teacher────               <── watcher's window
//! ```
//!
//! # Practice
//! Telling and listening cost the recording thread a few µs a tick; the haptic loop knows nothing
//! of it. What was drilled before the watcher came is not seen. Three seconds of silence end the
//! watching.
//!
//! # When not to use it
//! As it is, between machines: shared memory ends at the machine. iceoryx2's own tunnel
//! (`iox2 tunnel zenoh`, of its command line tools) on both carries the topics `trepan/NAME/...`
//! from one to the other; nothing changes here.

use crate::error::SessionError;
use crate::run::clock::Clock;
use crate::run::lesson::Listener;
use crate::run::stop::Stop;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use trepan_contact::GuardedWrench;
use trepan_geometry::{Buttons, ToolState, Vec3};
use trepan_haptics::{Capabilities, HapticDevice, Reading, Status};
use trepan_link::cell::{Reader, cell};
use trepan_link::topics::{Publisher, Session, Subscriber, TopicError};
use trepan_link::wire::{EventRecord, TeacherRecord, TickRecord};

/// Silence after which a tick counts as old, ms.
const STALE_MS: f64 = 100.0;
/// Silence after which the other session counts as over, ms.
const OVER_MS: f64 = 3000.0;
/// How long a watcher waits for the first tick, s: the other session may still be reading its
/// images.
const PATIENCE_S: f64 = 20.0;
/// Pause of the pump between two looks.
const LOOK: Duration = Duration::from_millis(1);

/// The telling end, for the recording thread.
pub struct Share {
    ticks: Publisher<TickRecord>,
    events: Publisher<EventRecord>,
    teacher: Listener,
    _session: Session,
}

/// Where a session reads what its teacher asks: either hand, and the window.
pub type Asked = [Reader<TeacherRecord>; 3];

impl Share {
    /// Tells, and listens to a teacher, under a name.
    pub fn open(name: &str) -> Result<(Self, Asked), SessionError> {
        let open = || -> Result<(Self, Asked), TopicError> {
            let session = Session::join(name)?;
            let (teacher, asked) = Listener::join(&session)?;
            Ok((Self { ticks: session.publisher()?, events: session.publisher()?, teacher, _session: session }, asked))
        };
        open().map_err(|fault| SessionError::Usage(format!("--share {name}: {fault}")))
    }

    /// Listens to the teacher; gives what began (`true`) or ended.
    pub fn hear(&mut self, now_ms: f64) -> impl Iterator<Item = (bool, &'static str)> + use<> {
        self.teacher.hear(now_ms)
    }

    /// Tells a tick; false when nobody can be told any more.
    pub fn tick(&mut self, record: &TickRecord) -> bool {
        self.ticks.send(record).is_ok()
    }

    /// Tells an event; false when nobody can be told any more.
    pub fn event(&mut self, record: &EventRecord) -> bool {
        self.events.send(record).is_ok()
    }
}

/// The watching end: another session's hand as a device.
pub struct Watched {
    newest: Reader<TickRecord>,
    seen: u64,
    heard_ms: Option<f64>,
    tool: ToolState,
    reads: u64,
    open: Arc<AtomicBool>,
    over: Arc<AtomicBool>,
}

/// Which session is watched, and whether it is over.
#[derive(Clone)]
pub struct Watching {
    name: String,
    over: Arc<AtomicBool>,
}

impl Watching {
    /// What to tell once the session is over.
    pub fn ended(&self) -> Option<String> {
        self.over.load(Ordering::Relaxed).then(|| format!("the watched session {} has ended", self.name))
    }
}

/// Waits for a first tick, and says so.
fn first_tick(name: &str, ticks: &mut Subscriber<TickRecord>, stop: &Stop) -> Result<TickRecord, SessionError> {
    let (clock, mut told) = (Clock::start(), false);
    while clock.now_ms() < 1e3 * PATIENCE_S && !stop.asked() {
        if let Ok(Some(record)) = ticks.newest() {
            return Ok(record);
        }
        if !std::mem::replace(&mut told, true) {
            tracing::info!("waiting for the session {name}, at most {PATIENCE_S} s");
        }
        std::thread::sleep(LOOK);
    }
    Err(SessionError::Usage(format!(
        "--watch {name}: no session of this name is heard: start one on this machine with --share {name}, then watch it"
    )))
}

impl Watched {
    /// A device without motors or limits.
    pub const CAPABILITIES: Capabilities = Capabilities {
        name: String::new(),
        peak_force_n: 0.0,
        continuous_force_n: 0.0,
        rate_hz: 1000.0,
        workspace_mm: Vec3::INFINITY,
        axes_driven: 0,
        position_resolution_mm: 0.0,
        delay_ticks: 0,
        moving_mass_g: 0.0,
        damping: 0.0,
    };

    /// Watches the session of a name, once a tick of it is heard; the tool waits at `start`.
    pub fn open(name: &str, start: ToolState, stop: &Stop) -> Result<(Self, Watching), SessionError> {
        let fault = |fault: TopicError| SessionError::Usage(format!("--watch {name}: {fault}"));
        let session = Session::join(name).map_err(fault)?;
        let mut ticks: Subscriber<TickRecord> = session.subscriber().map_err(fault)?;
        let (mut writer, newest) = cell(TickRecord::default());
        writer.set(first_tick(name, &mut ticks, stop)?);
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
                std::thread::sleep(LOOK);
            }
        });
        Ok((Self { newest, seen: 0, heard_ms: None, tool: start, reads: 0, open, over }, watching))
    }
}

impl HapticDevice for Watched {
    fn read(&mut self, time_ms: f64) -> Reading {
        let (record, sequence) = self.newest.latest();
        if sequence != self.seen {
            self.seen = sequence;
            self.heard_ms = Some(time_ms);
            // A watcher that comes late takes the tool that is already in the hand.
            let buttons = Buttons(record.buttons) | Buttons::slot(record.tool.into());
            self.tool = ToolState { world_from_tool: record.device, twist: record.twist, buttons, time_ms };
        }
        self.reads += 1;
        self.tool.time_ms = time_ms;
        let silent_ms = self.heard_ms.map_or(0.0, |heard| time_ms - heard);
        let status = match silent_ms {
            ms if ms > OVER_MS => {
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
        Self::CAPABILITIES
    }

    fn close(&mut self) {
        self.open.store(false, Ordering::Relaxed);
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use trepan_geometry::Pose;

    /// A watcher of a session that was shared until it was heard.
    pub(crate) fn heard(name: &str) -> (Watched, Watching) {
        let trainee = Session::join(name).unwrap();
        let mut ticks = trainee.publisher::<TickRecord>().unwrap();
        let heard = AtomicBool::new(false);
        std::thread::scope(|scope| {
            scope.spawn(|| {
                while !heard.load(Ordering::Relaxed) {
                    ticks.send(&TickRecord { tick: 1, ..TickRecord::default() }).unwrap();
                    std::thread::sleep(LOOK);
                }
            });
            let opened = Watched::open(name, ToolState::at(Pose::IDENTITY), &Stop::default());
            heard.store(true, Ordering::Relaxed);
            opened.unwrap()
        })
    }

    #[test]
    fn a_watched_session_that_falls_silent_has_ended() {
        let name = format!("watched-{}", std::process::id());
        let (mut watched, watching) = heard(&name);
        // The pump takes in what was still on its way.
        std::thread::sleep(Duration::from_millis(200));
        assert_eq!((watched.read(0.0).status, watched.read(OVER_MS).status), (Status::Fresh, Status::Stale));
        assert_eq!(watching.ended(), None);
        assert_eq!(watched.read(OVER_MS + 1.0).status, Status::Finished);
        assert_eq!(watching.ended().unwrap(), format!("the watched session {name} has ended"));
        watched.close();
    }

    #[test]
    fn nobody_is_not_watched() {
        let stop = Stop::default();
        stop.ask();
        let fault = Watched::open("nobody-at-all", ToolState::at(Pose::IDENTITY), &stop).err().unwrap().to_string();
        assert!(fault.contains("nobody-at-all") && fault.contains("--share"), "{fault}");
    }
}
