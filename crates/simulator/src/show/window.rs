//! The main thread of a session with a window: newest state in, what the user does out.
//!
//! # Practice
//! The window never waits for a loop and no loop waits for it. With the mouse as a device the pose
//! goes to the haptic loop, which reads it at its own rate; closing the window ends the session.

use crate::program::Program;
use crate::report::page::Shot;
use crate::run::lesson::{ASKED, Company, Teacher};
use crate::run::stop::Stop;
use crate::run::watch::Watching;
use crate::run::{RenderInputs, View};
use crate::session_setup::SessionSetup;
use crate::show::colours::Colours;
use crate::show::keep::Keeper;
use crate::show::notice_text;
use crate::show::picture::{Album, camera, frame, microscope, snap};
use std::path::Path;
use trepan_geometry::{Buttons, Pose, Vec3};
use trepan_haptics::mouse::MouseHandle;
use trepan_link::wire::TeacherRecord;
use trepan_render::window::{self, Action, Capture, Leash, Panel, Start, WindowInput};
use trepan_render::{Camera, Frame, Image, Overlay, Painter};

/// How far a mouse may press past a surface, mm: a little over what the device's largest force
/// stands for at 2 N/mm.
const LEASH_MM: f32 = 2.0;
/// A request is held so long that no tick misses it, s.
const REQUEST_S: f64 = 0.1;

/// Whether a window can be opened here.
pub fn has_display() -> bool {
    window::display().is_ok()
}

/// What the window is opened on.
pub struct Opened<'a> {
    /// The patient, the plan, which simulator.
    pub table: &'a SessionSetup,
    /// A name for the case that anybody may read.
    pub case: &'a str,
    /// Where pictures go.
    pub out: &'a Path,
    /// What the tick's rate should be, Hz.
    pub rate_hz: f32,
}

/// What the window shows and drives.
struct Show {
    eyes: RenderInputs,
    view: View,
    positions: Vec<Vec3>,
    case: String,
    program: Program,
    wanted_rate_hz: f32,
    bone_shown: bool,
    colours: Colours,
    pointer: Option<MouseHandle>,
    company: Company,
    /// What is marked on the anatomy, mm.
    markers: Vec<Vec3>,
    /// A tool that is only shown.
    ghost: Option<Pose>,
    requests: Requests,
    rate: Rate,
    keeper: Keeper,
    stop: Stop,
}

/// What was asked for lately, and until when it counts, s.
#[derive(Default)]
struct Requests(Vec<(Buttons, f64)>);

impl Requests {
    /// Everything that is asked for at a time, with what is new.
    fn at(&mut self, seconds: f64, new: impl Iterator<Item = Buttons>) -> Buttons {
        self.0.retain(|(_, until)| seconds < *until);
        self.0.extend(new.map(|asked| (asked, seconds + REQUEST_S)));
        self.0.iter().fold(Buttons(0), |all, (asked, _)| all | *asked)
    }
}

/// Ticks a second, measured over about a second.
#[derive(Default)]
struct Rate {
    since: (f64, u64),
    hz: f64,
}

impl Rate {
    fn follow(&mut self, time_ms: f64, ticks: u64) -> f64 {
        if time_ms - self.since.0 >= 1000.0 {
            self.hz = (ticks - self.since.1) as f64 / (time_ms - self.since.0) * 1e3;
            self.since = (time_ms, ticks);
        }
        self.hz
    }
}

/// Shows the session until it ends or the window is closed.
pub fn show(
    mut eyes: RenderInputs,
    painter: Painter,
    opened: &Opened<'_>,
    pointer: Option<MouseHandle>,
    company: Company,
    stop: &Stop,
) -> Album {
    let view = *eyes.view.latest().0;
    let show = Show {
        eyes,
        view,
        positions: Vec::new(),
        case: opened.case.into(),
        program: opened.table.program,
        wanted_rate_hz: opened.rate_hz,
        bone_shown: opened.table.bone().is_some(),
        colours: opened.table.colours(),
        pointer,
        company,
        markers: Vec::new(),
        ghost: None,
        requests: Requests::default(),
        rate: Rate::default(),
        keeper: Keeper::into_folder(&opened.out.join("window")),
        stop: stop.clone(),
    };
    let (show, mut album) = run(show, painter, opened, view);
    stop.ask();
    album.faults.extend(show.keeper.finish());
    album
}

/// Opens the window on a session, with a picture before and one after.
pub fn run<S: window::Session + 'static>(
    session: S,
    mut painter: Painter,
    opened: &Opened<'_>,
    at: View,
) -> (S, Album) {
    let (mut album, folder) = (Album::default(), opened.out.join("frames"));
    let eye = camera(&opened.table.scene.site);
    album.add(shot(&mut painter, &session.frame(eye), &folder, "before"));
    let start = Start::with(eye, at.sample.state.world_from_tool);
    let detail = opened.table.models.setup.picture.detail as f32;
    let start = Start { microscope: Some(microscope(&opened.table.scene.site)), detail, ..start };
    let counted = Counted { session, pictures: 0, seconds: [0.0; 2] };
    let closed = window::run(&format!("Trepan {}", opened.table.program.name()), painter, counted, start);
    let (mut painter, Counted { session, pictures, seconds: [from, to] }) = (closed.renderer, closed.session);
    (album.frames, album.seconds) = (album.frames + pictures, to - from);
    album.add(shot(&mut painter, &session.frame(eye), &folder, "after"));
    if let Err(fault) = closed.result {
        tracing::error!("{fault}");
        album.faults.push(fault.to_string());
    }
    album.painter = Some(painter);
    (session, album)
}

/// A session whose pictures in the window are counted.
struct Counted<S> {
    session: S,
    pictures: u64,
    /// When the first and the newest of them were drawn, s.
    seconds: [f64; 2],
}

impl<S: window::Session> window::Session for Counted<S> {
    fn update(&mut self, input: &WindowInput) -> Panel {
        let first = if self.pictures == 0 { input.seconds } else { self.seconds[0] };
        self.seconds = [first, input.seconds];
        self.pictures += 1;
        self.session.update(input)
    }

    fn frame(&self, camera: Camera) -> Frame<'_> {
        self.session.frame(camera)
    }

    fn capture(&mut self, what: Capture, picture: Image) {
        self.session.capture(what, picture);
    }
}

fn shot(painter: &mut Painter, frame: &Frame<'_>, folder: &Path, caption: &str) -> Result<Shot, String> {
    let (image, _) = painter.picture(frame).map_err(|fault| fault.to_string())?;
    snap(&image, folder, caption)
}

impl window::Session for Show {
    fn update(&mut self, input: &WindowInput) -> Panel {
        self.view = *self.eyes.view.latest().0;
        if let Some(soft) = &mut self.eyes.soft {
            self.positions.clone_from(&soft.latest().0.positions);
        }
        self.pass_on(input);
        let lesson = self.listen(input);
        let view = &self.view;
        let (by_hand, teaches) = (self.pointer.is_some(), self.company.teacher.is_some());
        let flap = || Action { name: "Lift the flap, or put it back".into(), key: Some('f'), on: false };
        let mut panel = notice_text::panel(&self.case, self.program, view);
        panel.warnings.extend(lesson.warnings);
        // Who watches reads that the other session is over, and closes the window in her own time.
        let over = self.company.watching.as_ref().and_then(Watching::ended);
        let finished = match over {
            Some(_) => self.stop.signal().is_some(),
            None => view.finished || self.stop.asked(),
        };
        if let Some(text) = over {
            panel.warnings.clear();
            panel.news = vec![format!("{text}: close the window (Q)")];
        }
        if !by_hand {
            panel.choices.iter_mut().flat_map(|choice| &mut choice.options).for_each(|(_, open)| *open = false);
        }
        Panel {
            hint: if teaches { TEACH } else { notice_text::hint(view.sample.phase(), by_hand) }.into(),
            by_hand,
            rate_hz: self.rate.follow(view.time_ms, view.counts[0]) as f32,
            wanted_rate_hz: self.wanted_rate_hz,
            actions: (by_hand && self.bone_shown).then(flap).into_iter().chain(lesson.actions).collect(),
            leash: by_hand.then(|| Leash { tip: view.sample.state.tip(), length_mm: LEASH_MM }),
            finished,
            ..panel
        }
    }

    fn frame(&self, camera: Camera) -> Frame<'_> {
        let positions = Some(self.positions.as_slice()).filter(|p| !p.is_empty());
        let frame = frame(camera, &self.view, positions, self.bone_shown, &self.colours);
        let ghost = self.ghost.map(|pose| (self.view.sample.tool, pose));
        Frame { overlay: Overlay { ghost, markers: &self.markers, ..frame.overlay }, ..frame }
    }

    fn capture(&mut self, what: Capture, picture: Image) {
        self.keeper.keep(what, picture);
    }
}

impl Show {
    /// The user's hand for the haptic loop.
    fn pass_on(&mut self, input: &WindowInput) {
        let Some(pointer) = &mut self.pointer else { return };
        let asked = [
            input.next_tool.then_some(Buttons::NEXT_TOOL),
            input.undo.then_some(Buttons::UNDO),
            (input.actions & 1 != 0).then_some(Buttons::FLAP),
            input.chosen.map(|[_, slot]| Buttons::slot(slot)),
        ];
        let asked = self.requests.at(input.seconds, asked.into_iter().flatten());
        let pedal = if input.pedal { Buttons::PEDAL } else { Buttons(0) };
        pointer.set(input.world_from_tool, asked | pedal);
    }
}

impl Show {
    /// What passes between a teacher and a trainee in this picture.
    fn listen(&mut self, input: &WindowInput) -> Lesson {
        let (lesson, asks) = match &mut self.company {
            Company { teacher: Some(teacher), .. } => (taught(teacher, input), *teacher.asks()),
            Company { asked: Some(asked), .. } => {
                let asks = *asked.latest().0;
                (Lesson::asked(asks.flags), asks)
            }
            _ => return Lesson::default(),
        };
        let shows = |bit| asks.flags & bit != 0;
        self.ghost = shows(TeacherRecord::GHOST).then_some(asks.ghost);
        self.markers.clear();
        self.markers.extend(shows(TeacherRecord::MARKER).then_some(asks.marker));
        lesson
    }
}

/// What a lesson adds to the panel.
#[derive(Default)]
struct Lesson {
    warnings: Vec<String>,
    actions: Vec<Action>,
}

impl Lesson {
    /// What a trainee is told; of a pause the panel tells by itself.
    fn asked(flags: u32) -> Self {
        let trouble = ASKED.into_iter().filter(|(bit, _)| flags & bit & !TeacherRecord::PAUSE != 0);
        Self { warnings: trouble.map(|(_, text)| text.into()).collect(), ..Self::default() }
    }
}

const TEACH: &str = "you watch; your mouse and keys hold a ghost of the tool";

/// A teacher's switches: what they do, their key, and their bit.
const SWITCHES: [(&str, char, u32); 5] = [
    ("Show the trainee my tool", 'g', TeacherRecord::GHOST),
    ("Mark the place of my tool", 'k', TeacherRecord::MARKER),
    ("Pause the trainee", 'j', TeacherRecord::PAUSE),
    ("Take the drill's power", 'w', TeacherRecord::NO_POWER),
    ("Let the patient bleed", 'h', TeacherRecord::BLEEDING),
];

/// Does what the teacher asks for, tells the trainee, and gives the switches as they are then.
fn taught(teacher: &mut Teacher, input: &WindowInput) -> Lesson {
    for (at, (.., bit)) in SWITCHES.into_iter().enumerate().filter(|(at, _)| input.actions >> at & 1 != 0) {
        if at == 1 && teacher.asks().flags & bit == 0 {
            teacher.mark(input.world_from_tool.translation);
        } else {
            teacher.switch(bit);
        }
    }
    teacher.tell(input.world_from_tool);
    let flags = teacher.asks().flags;
    let switch =
        |(name, key, bit): (&str, char, u32)| Action { name: name.into(), key: Some(key), on: flags & bit != 0 };
    Lesson { actions: SWITCHES.map(switch).into(), ..Lesson::default() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::run::watch::tests::heard;
    use crate::stages::haptic_tick::ToolSample;
    use trepan_geometry::ToolState;
    use trepan_haptics::HapticDevice;
    use trepan_link::cell::cell;

    #[test]
    fn a_trainee_reads_what_is_asked() {
        let lesson = Lesson::asked(TeacherRecord::PAUSE | TeacherRecord::BLEEDING | TeacherRecord::GHOST);
        assert_eq!(lesson.warnings, [ASKED[2].1]);
    }

    #[test]
    fn a_window_on_a_session_that_has_ended_says_so_and_stays() {
        let (mut watched, watching) = heard(&format!("ended-{}", std::process::id()));
        std::thread::sleep(std::time::Duration::from_millis(200));
        let start = ToolState::at(Pose::IDENTITY);
        let sample = ToolSample { tick: 0, state: start, tool: Program::Brain.tray()[0], slot: 0, drilling: false };
        let (mut writer, view) = cell(View::at(sample, 1.0));
        let mut show = Show {
            view: View::at(sample, 1.0),
            eyes: RenderInputs { view, soft: None, film: None },
            positions: Vec::new(),
            case: "case".into(),
            program: Program::Brain,
            wanted_rate_hz: 1000.0,
            bone_shown: false,
            colours: Colours::default(),
            pointer: None,
            company: Company { watching: Some(watching), ..Company::default() },
            markers: Vec::new(),
            ghost: None,
            requests: Requests::default(),
            rate: Rate::default(),
            keeper: Keeper::into_folder(Path::new("nowhere")),
            stop: Stop::default(),
        };
        let input = WindowInput {
            world_from_tool: Pose::IDENTITY,
            pedal: false,
            next_tool: false,
            undo: false,
            chosen: None,
            actions: 0,
            playback: None,
            camera: Camera::viewed_from(Vec3::ZERO, Vec3::Y, 200.0),
            seconds: 0.0,
        };
        assert!(window::Session::update(&mut show, &input).news.is_empty());
        watched.read(0.0);
        watched.read(1e4);
        writer.set(View { finished: true, ..show.view });
        show.stop.ask();
        let panel = window::Session::update(&mut show, &input);
        assert!(!panel.finished && panel.news[0].contains("has ended"), "{:?}", panel.news);
        show.company.watching = None;
        assert!(window::Session::update(&mut show, &input).finished, "a session of one's own closes");
    }

    #[test]
    fn a_request_is_held_for_a_tenth_of_a_second() {
        let mut requests = Requests::default();
        let asked = requests.at(1.0, [Buttons::UNDO, Buttons::slot(2)].into_iter());
        assert!(asked.has(Buttons::UNDO) && asked.in_slot() == Some(2));
        assert_eq!(requests.at(1.09, std::iter::empty()), asked);
        assert_eq!(requests.at(1.11, [Buttons::FLAP].into_iter()), Buttons::FLAP);
    }
}
