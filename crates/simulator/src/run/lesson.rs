//! What a teacher asks of a running session: a ghost of the tool, a marker, a pause, trouble with
//! the drill or the patient.
//!
//! # Theory
//! A pause is a button that the teacher holds: it comes into the hand's reading before the tick
//! sees it, and so into the recording. The tick lets the force go at the guard's pace, and no other
//! button counts. A drill without power is a pedal that does nothing.
//!
//! ```text
//!  teacher's window ──shared memory──> recording thread ──cells──┬─> the hand's device: pause, no pedal
//!                                          │                     └─> the window: ghost, marker, what is told
//!                                          └──> recording: event `teacher`
//! ```
//!
//! # Practice
//! The haptic loop reads one cell a tick, some ns, and waits for nobody. A teacher that is silent
//! for three seconds has gone: everything that was asked for ends. A replay needs no teacher: the
//! readings hold what was asked.

use crate::run::watch::Watching;
use trepan_contact::GuardedWrench;
use trepan_geometry::{Buttons, Pose, Vec3};
use trepan_haptics::{Capabilities, HapticDevice, Reading};
use trepan_link::cell::{Reader, Writer, cell};
use trepan_link::topics::{Publisher, Session, Subscriber, TopicError};
use trepan_link::wire::TeacherRecord;

/// Silence after which a teacher has gone, ms.
pub const GONE_MS: f64 = 3000.0;

/// What can be asked for, and what the trainee reads.
pub const ASKED: [(u32, &str); 3] = [
    (TeacherRecord::PAUSE, "the teacher pauses the operation"),
    (TeacherRecord::NO_POWER, "the drill has no power"),
    (TeacherRecord::BLEEDING, "the patient bleeds from the bone's edge"),
];

/// The listening end, for the recording thread.
pub struct Listener {
    teacher: Subscriber<TeacherRecord>,
    newest: TeacherRecord,
    heard_ms: f64,
    tell: Vec<Writer<TeacherRecord>>,
}

impl Listener {
    /// Listens in a session; tells as many others as there are readers.
    pub fn join<const N: usize>(session: &Session) -> Result<(Self, [Reader<TeacherRecord>; N]), TopicError> {
        let teacher = session.subscriber()?;
        let mut tell = Vec::new();
        let readers = std::array::from_fn(|_| {
            let (writer, reader) = cell(TeacherRecord::default());
            tell.push(writer);
            reader
        });
        Ok((Self { teacher, newest: TeacherRecord::default(), heard_ms: 0.0, tell }, readers))
    }

    /// Listens, and tells what is new; gives what began (`true`) or ended.
    pub fn hear(&mut self, now_ms: f64) -> impl Iterator<Item = (bool, &'static str)> + use<> {
        let before = self.newest.flags;
        match self.teacher.newest() {
            Ok(Some(record)) => (self.newest, self.heard_ms) = (record, now_ms),
            _ if now_ms - self.heard_ms > GONE_MS => self.newest.flags = 0,
            _ => {}
        }
        let now = self.newest.flags;
        for writer in &mut self.tell {
            writer.set(self.newest);
        }
        ASKED
            .into_iter()
            .filter(move |(bit, _)| (before ^ now) & bit != 0)
            .map(move |(bit, text)| (now & bit != 0, text))
    }
}

/// A device whose buttons the teacher has a say in.
pub struct Taught {
    device: Box<dyn HapticDevice>,
    teacher: Reader<TeacherRecord>,
}

impl Taught {
    /// The device under the teacher's eyes.
    pub fn new(device: Box<dyn HapticDevice>, teacher: Reader<TeacherRecord>) -> Self {
        Self { device, teacher }
    }
}

/// The buttons that count while the teacher asks for something.
fn allowed(buttons: Buttons, flags: u32) -> Buttons {
    let own = Buttons(buttons.0 & !Buttons::PAUSE.0);
    match () {
        () if flags & TeacherRecord::PAUSE != 0 => Buttons::PAUSE,
        () if flags & TeacherRecord::NO_POWER != 0 => Buttons(own.0 & !Buttons::PEDAL.0),
        () => own,
    }
}

impl HapticDevice for Taught {
    fn read(&mut self, time_ms: f64) -> Reading {
        let mut reading = self.device.read(time_ms);
        reading.tool.buttons = allowed(reading.tool.buttons, self.teacher.latest().0.flags);
        reading
    }

    fn apply(&mut self, wrench: GuardedWrench) {
        self.device.apply(wrench);
    }

    fn capabilities(&self) -> Capabilities {
        self.device.capabilities()
    }

    fn close(&mut self) {
        self.device.close();
    }
}

/// The teacher's end, for the window of a session that watches.
pub struct Teacher {
    trainee: Publisher<TeacherRecord>,
    record: TeacherRecord,
    _session: Session,
}

impl Teacher {
    /// Sits down beside the trainee of a session.
    pub fn join(name: &str) -> Result<Self, TopicError> {
        let session = Session::join(name)?;
        Ok(Self { trainee: session.publisher()?, record: TeacherRecord::default(), _session: session })
    }

    /// Asks for something that is not asked for, or no longer for what is.
    pub fn switch(&mut self, bit: u32) {
        self.record.flags ^= bit;
    }

    /// Marks a place, or moves the mark there.
    pub fn mark(&mut self, place: Vec3) {
        self.record.flags |= TeacherRecord::MARKER;
        self.record.marker = place;
    }

    /// What is asked for now.
    pub fn asks(&self) -> &TeacherRecord {
        &self.record
    }

    /// Tells the trainee, and where the teacher holds the ghost of the tool; often, since silence
    /// ends everything.
    pub fn tell(&mut self, ghost: Pose) {
        self.record.seq += 1;
        self.record.ghost = ghost;
        // Shared memory that is full or gone is like a trainee who does not listen.
        _ = self.trainee.send(&self.record);
    }
}

/// Who else looks into the window.
#[derive(Default)]
pub struct Company {
    /// What a teacher asks of this session's trainee.
    pub asked: Option<Reader<TeacherRecord>>,
    /// The end by which this session teaches another's trainee.
    pub teacher: Option<Teacher>,
    /// The session that is watched.
    pub watching: Option<Watching>,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::run::watch::Watched;
    use trepan_geometry::{Quat, ToolState};
    use trepan_haptics::Status;

    /// A hand that presses everything.
    struct Greedy;

    impl HapticDevice for Greedy {
        fn read(&mut self, time_ms: f64) -> Reading {
            let buttons = Buttons(u32::MAX);
            let tool = ToolState { buttons, time_ms, ..ToolState::at(Pose::from_translation(Vec3::ONE)) };
            Reading { tool, status: Status::Fresh }
        }

        fn apply(&mut self, _wrench: GuardedWrench) {}

        fn capabilities(&self) -> Capabilities {
            Capabilities { name: "greedy".into(), ..Watched::CAPABILITIES }
        }

        fn close(&mut self) {}
    }

    fn name(test: &str) -> String {
        format!("lesson-{test}-{}", std::process::id())
    }

    #[test]
    fn a_pause_leaves_no_other_button_and_no_device_can_ask_for_one() {
        let (mut writer, reader) = cell(TeacherRecord::default());
        let mut hand = Taught::new(Box::new(Greedy), reader);
        let mut pressed = |flags| {
            writer.set(TeacherRecord { flags, ..TeacherRecord::default() });
            hand.read(1.0).tool.buttons
        };
        let free = pressed(0);
        assert!(free.has(Buttons::PEDAL) && !free.has(Buttons::PAUSE));
        assert_eq!(pressed(TeacherRecord::PAUSE | TeacherRecord::NO_POWER), Buttons::PAUSE);
        let weak = pressed(TeacherRecord::NO_POWER);
        assert!(!weak.has(Buttons::PEDAL) && weak.has(Buttons::UNDO));
        assert_eq!(pressed(TeacherRecord::BLEEDING), free);
        assert_eq!(hand.capabilities().name, "greedy");
    }

    #[test]
    fn what_a_teacher_asks_arrives_and_ends_with_her_silence() {
        let name = name("asks");
        let session = Session::join(&name).unwrap();
        let (mut listener, [mut hand, mut window]) = Listener::join::<2>(&session).unwrap();
        let mut teacher = Teacher::join(&name).unwrap();
        assert_eq!(listener.hear(0.0).count(), 0);
        let place = Vec3::new(1.0, 2.0, 3.0);
        teacher.switch(TeacherRecord::PAUSE);
        teacher.mark(place);
        teacher.tell(Pose::from_parts(place, Quat::from_rotation_x(0.5)));
        assert_eq!(listener.hear(100.0).collect::<Vec<_>>(), [(true, ASKED[0].1)]);
        assert_eq!((hand.latest().0.marker, window.latest().0.ghost.translation), (place, place));
        assert_eq!(listener.hear(100.0 + GONE_MS).count(), 0, "not yet");
        assert_eq!(listener.hear(101.0 + GONE_MS).collect::<Vec<_>>(), [(false, ASKED[0].1)]);
        assert_eq!((hand.latest().0.flags, window.latest().0.flags), (0, 0));
        teacher.tell(Pose::IDENTITY);
        assert_eq!(listener.hear(9000.0).collect::<Vec<_>>(), [(true, ASKED[0].1)], "she is back");
        teacher.switch(TeacherRecord::PAUSE);
        teacher.switch(TeacherRecord::NO_POWER);
        teacher.tell(Pose::IDENTITY);
        assert_eq!(listener.hear(9001.0).collect::<Vec<_>>(), [(false, ASKED[0].1), (true, ASKED[1].1)]);
    }

    #[test]
    fn a_session_that_nobody_teaches_hears_nothing() {
        let session = Session::join(&name("quiet")).unwrap();
        let (mut listener, [mut hand]) = Listener::join::<1>(&session).unwrap();
        assert!((0..10).all(|at| listener.hear(f64::from(at) * 1000.0).next().is_none()));
        assert_eq!(hand.latest().0.flags, 0);
    }
}
