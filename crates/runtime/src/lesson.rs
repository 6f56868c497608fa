//! A teacher's requests to a running session: a ghost of the tool, a marker, a pause, a drill
//! without power, bleeding.
//!
//! # Theory
//! A pause is a virtual button pressed by the teacher. It is added to the device's reading before
//! the tick, and is therefore recorded. During a pause the tick fades the force at the guard's rate
//! and ignores all other buttons. Without drill power the pedal is ignored.
//!
//! ```text
//!  teacher's window ──shared memory──> recording thread ──cells──┬─> device: pause, no pedal
//!                                          │                     └─> window: ghost, marker, texts
//!                                          └──> recording: event `teacher`
//! ```
//!
//! # Practice
//! The haptic loop reads one cell a tick (some ns) and never blocks. All requests end when the
//! teacher has sent nothing for six seconds. A replay needs no teacher: the recorded readings
//! hold the requests.

use trepan_contact::GuardedWrench;
use trepan_geometry::{Buttons, Pose, Vec3};
use trepan_haptics::{Capabilities, HapticDevice, Reading};
use trepan_link::cell::{Reader, Writer, cell};
use trepan_link::topics::{Publisher, Session, Subscriber, TopicError};
use trepan_link::wire::TeacherRecord;

/// Time without a record after which all of the teacher's requests end, ms. A slow picture of a
/// busy watcher takes less, so that a pause holds until it is taken back.
pub const GONE_MS: f64 = 6000.0;

/// Bit of each request, and the text that the trainee reads.
pub const TEACHER_REQUESTS: [(u32, &str); 3] = [
    (TeacherRecord::PAUSE, "the teacher pauses the operation"),
    (TeacherRecord::NO_POWER, "the drill has no power"),
    (TeacherRecord::BLEEDING, "the patient bleeds from the bone's edge"),
];

/// Receive end, for the recording thread.
pub struct Listener {
    teacher: Subscriber<TeacherRecord>,
    newest: TeacherRecord,
    received_ms: f64,
    writers: Vec<Writer<TeacherRecord>>,
}

impl Listener {
    /// Joins a session; returns also `N` readers that get each received record.
    pub fn join<const N: usize>(session: &Session) -> Result<(Self, [Reader<TeacherRecord>; N]), TopicError> {
        let teacher = session.subscriber()?;
        let mut writers = Vec::new();
        let readers = std::array::from_fn(|_| {
            let (writer, reader) = cell(TeacherRecord::default());
            writers.push(writer);
            reader
        });
        Ok((Self { teacher, newest: TeacherRecord::default(), received_ms: 0.0, writers }, readers))
    }

    /// Receives the newest record and passes it to the readers. Returns the requests that began
    /// (`true`) or ended.
    pub fn receive(&mut self, now_ms: f64) -> impl Iterator<Item = (bool, &'static str)> + use<> {
        let before = self.newest.flags;
        match self.teacher.newest() {
            Ok(Some(record)) => (self.newest, self.received_ms) = (record, now_ms),
            _ if now_ms - self.received_ms > GONE_MS => self.newest.flags = 0,
            _ => {}
        }
        let now = self.newest.flags;
        for writer in &mut self.writers {
            writer.set(self.newest);
        }
        TEACHER_REQUESTS
            .into_iter()
            .filter(move |(bit, _)| (before ^ now) & bit != 0)
            .map(move |(bit, text)| (now & bit != 0, text))
    }
}

/// A device whose buttons are changed by the teacher's requests.
pub struct TeacherButtons {
    device: Box<dyn HapticDevice>,
    teacher: Reader<TeacherRecord>,
}

impl TeacherButtons {
    /// Wraps a device.
    pub fn new(device: Box<dyn HapticDevice>, teacher: Reader<TeacherRecord>) -> Self {
        Self { device, teacher }
    }
}

/// Returns the buttons that remain under the teacher's requests.
fn allowed(buttons: Buttons, flags: u32) -> Buttons {
    let pressed = Buttons(buttons.0 & !Buttons::PAUSE.0);
    if flags & TeacherRecord::PAUSE != 0 {
        Buttons::PAUSE
    } else if flags & TeacherRecord::NO_POWER != 0 {
        Buttons(pressed.0 & !Buttons::PEDAL.0)
    } else {
        pressed
    }
}

impl HapticDevice for TeacherButtons {
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

/// Send end, for the window of a watching session.
pub struct Teacher {
    trainee: Publisher<TeacherRecord>,
    record: TeacherRecord,
    _session: Session,
}

impl Teacher {
    /// Joins the trainee's session.
    pub fn join(name: &str) -> Result<Self, TopicError> {
        let session = Session::join(name)?;
        Ok(Self { trainee: session.publisher()?, record: TeacherRecord::default(), _session: session })
    }

    /// Switches a request on or off.
    pub fn switch(&mut self, bit: u32) {
        self.record.flags ^= bit;
    }

    /// Sets the marker to a place, mm.
    pub fn mark(&mut self, place: Vec3) {
        self.record.flags |= TeacherRecord::MARKER;
        self.record.marker = place;
    }

    /// Returns the present requests.
    pub fn requests(&self) -> &TeacherRecord {
        &self.record
    }

    /// Sends the requests and the pose of the ghost tool. Call it often: without records all
    /// requests end after [`GONE_MS`].
    pub fn send(&mut self, ghost: Pose) {
        self.record.seq += 1;
        self.record.ghost = ghost;
        // Shared memory that is full or gone is no fault here: the record is lost.
        _ = self.trainee.send(&self.record);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use trepan_geometry::{Quat, ToolState};
    use trepan_haptics::Status;

    /// A device with all buttons pressed.
    struct AllPressed;

    impl HapticDevice for AllPressed {
        fn read(&mut self, time_ms: f64) -> Reading {
            let buttons = Buttons(u32::MAX);
            let tool = ToolState { buttons, time_ms, ..ToolState::at(Pose::from_translation(Vec3::ONE)) };
            Reading { tool, status: Status::Fresh }
        }

        fn apply(&mut self, _wrench: GuardedWrench) {}

        fn capabilities(&self) -> Capabilities {
            Capabilities::passive("all pressed")
        }

        fn close(&mut self) {}
    }

    fn name(test: &str) -> String {
        format!("lesson-{test}-{}", std::process::id())
    }

    #[test]
    fn a_pause_suppresses_all_other_buttons_and_no_device_can_request_one() {
        let (mut writer, reader) = cell(TeacherRecord::default());
        let mut hand = TeacherButtons::new(Box::new(AllPressed), reader);
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
        assert_eq!(hand.capabilities().name, "all pressed");
    }

    #[test]
    fn a_teachers_requests_arrive_and_end_without_records() {
        let name = name("asks");
        let session = Session::join(&name).unwrap();
        let (mut listener, [mut hand, mut window]) = Listener::join::<2>(&session).unwrap();
        let mut teacher = Teacher::join(&name).unwrap();
        assert_eq!(listener.receive(0.0).count(), 0);
        let place = Vec3::new(1.0, 2.0, 3.0);
        teacher.switch(TeacherRecord::PAUSE);
        teacher.mark(place);
        teacher.send(Pose::from_parts(place, Quat::from_rotation_x(0.5)));
        assert_eq!(listener.receive(100.0).collect::<Vec<_>>(), [(true, TEACHER_REQUESTS[0].1)]);
        assert_eq!((hand.latest().0.marker, window.latest().0.ghost.translation), (place, place));
        assert_eq!(listener.receive(100.0 + GONE_MS).count(), 0, "not yet");
        assert_eq!(listener.receive(101.0 + GONE_MS).collect::<Vec<_>>(), [(false, TEACHER_REQUESTS[0].1)]);
        assert_eq!((hand.latest().0.flags, window.latest().0.flags), (0, 0));
        teacher.send(Pose::IDENTITY);
        assert_eq!(listener.receive(9000.0).collect::<Vec<_>>(), [(true, TEACHER_REQUESTS[0].1)], "she is back");
        teacher.switch(TeacherRecord::PAUSE);
        teacher.switch(TeacherRecord::NO_POWER);
        teacher.send(Pose::IDENTITY);
        assert_eq!(
            listener.receive(9001.0).collect::<Vec<_>>(),
            [(false, TEACHER_REQUESTS[0].1), (true, TEACHER_REQUESTS[1].1)]
        );
    }

    #[test]
    fn a_session_without_a_teacher_receives_no_requests() {
        let session = Session::join(&name("quiet")).unwrap();
        let (mut listener, [mut hand]) = Listener::join::<1>(&session).unwrap();
        assert!((0..10).all(|at| listener.receive(f64::from(at) * 1000.0).next().is_none()));
        assert_eq!(hand.latest().0.flags, 0);
    }
}
