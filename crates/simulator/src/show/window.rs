//! A session in the window: renders the newest state and passes on user input.
//!
//! # Practice
//! Window and loops never wait for each other. With the mouse as device, the haptic loop reads the
//! mouse pose at its own rate. Closing the window ends the session.

use crate::SessionError;
use crate::session_setup::SessionSetup;
use crate::show::colours::Colours;
use crate::show::keep::Keeper;
use crate::show::notice_text;
use crate::show::picture::{Album, Moving, Shape, first_view, frame, microscope, snap};
use crate::show::raycast::Raycast;
use std::path::Path;
use trepan_geometry::{Buttons, Pose, ToolKind, Vec3};
use trepan_haptics::mouse::MouseHandle;
use trepan_haptics::spacemouse::{self, SpaceMouse};
use trepan_link::wire::TeacherRecord;
use trepan_measurements::bleeding;
use trepan_patient::progress::Progress;
use trepan_render::{Camera, Frame, Image, Overlay, Painter, SliceLook};
use trepan_report::page::Shot;
use trepan_report::training::Guide;
use trepan_runtime::lesson::{TEACHER_REQUESTS, Teacher};
use trepan_runtime::stop::Stop;
use trepan_runtime::watch::{PeerSession, Watching};
use trepan_runtime::{RenderInputs, View};
use trepan_stages::Bleeding;
use trepan_stages::collision_step::Wound;
use trepan_stages::haptic_tick::is_held_by_arms;
use trepan_stages::notice::Notice;
use trepan_stages::program::Program;
use trepan_window::{self as window, Action, Capture, Leash, Panel, Ray, Stage, Start, SurfaceHit, WindowInput};

/// Largest depth of a mouse-driven pose past a surface, mm: a little over the depth of the device's
/// largest force at 2 N/mm.
const LEASH_MM: f32 = 2.0;
/// Distance from the opening within which the slices follow the tool, mm.
const NEAR_MM: f32 = 25.0;
/// Duration of a request, s: long enough that no tick misses it.
const REQUEST_S: f64 = 0.1;

/// Session data for the window.
pub(crate) struct SessionView<'a> {
    /// The window.
    pub stage: &'a Stage,
    /// Progress of loading, which ends when the session is in the window.
    pub progress: &'a Progress,
    /// Patient, plan and program.
    pub table: &'a SessionSetup,
    /// Name of the case, without the patient's name.
    pub case: &'a str,
    /// Output folder.
    pub out: &'a Path,
    /// Requested rate of the haptic loop, Hz.
    pub rate_hz: f32,
    /// Place in the tray of the tool that a hand with the mouse begins with.
    pub slot: usize,
    /// The lesson, if there is one.
    pub guide: Option<Guide>,
    /// Whether a 3-D mouse turns the view, since it holds no tool.
    pub knob: bool,
}

/// What a live session and a replay show alike.
pub(super) struct ViewState {
    case: String,
    program: Program,
    /// Whether bone is shown.
    pub bone: bool,
    colours: Colours,
    /// Why the aspirator takes nothing here.
    no_aspiration: Option<String>,
    /// Volume of each tetrahedron of the brain, mm³.
    volumes_mm3: Vec<f32>,
    /// The place of the opening, RAS mm.
    entry: Vec3,
    keeper: Keeper,
    /// Ends the session.
    pub stop: Stop,
}

impl ViewState {
    /// Prepares what is shown of a session.
    pub fn of(opened: &SessionView<'_>, bone: bool, stop: &Stop) -> Self {
        let brain = opened.table.scene.brain.as_ref().map(|brain| &brain.mesh);
        Self {
            case: opened.case.into(),
            program: opened.table.program,
            bone,
            colours: opened.table.colours(),
            volumes_mm3: brain
                .map(|mesh| (0..mesh.tets.len()).map(|tet| mesh.volume_mm3(tet) as f32).collect())
                .unwrap_or_default(),
            no_aspiration: opened.table.no_aspiration(),
            entry: opened.table.scene.site.entry,
            keeper: Keeper::into_folder(&opened.out.join("window")),
            stop: stop.clone(),
        }
    }

    /// Returns the panel of a state; without `by_hand` no tool can be chosen.
    pub fn panel(&self, view: &View, brain: &Shape, by_hand: bool) -> Panel {
        let mut panel = notice_text::panel(&self.case, self.program, view);
        for choice in &mut panel.choices {
            let tools = choice.tools.iter().zip(&mut choice.options);
            let taking = tools.filter(|(tool, _)| matches!(tool.kind, ToolKind::Aspirator | ToolKind::Scissors));
            taking.for_each(|(_, (_, why_not))| *why_not = why_not.take().or(self.no_aspiration.clone()));
        }
        let taken_ml = self.taken_ml(brain);
        if taken_ml > 0.0 || view.sample.tool.kind == ToolKind::Aspirator {
            panel.task.push(("tissue taken".into(), format!("{taken_ml:.2} ml")));
        }
        let Bleeding { bled_ml, rate_ml_per_min, .. } = brain.wound.bleeding;
        if bled_ml > 0.0 {
            panel.task.push(("blood lost".into(), format!("{bled_ml:.1} ml, {rate_ml_per_min:.1} ml/min")));
        }
        if rate_ml_per_min >= bleeding::VESSEL_RATE.f32() {
            panel.warnings.push("the wound bleeds fast: suck it dry, and coagulate where it comes from".into());
        }
        let dura = &brain.wound.dura;
        if !dura.triangles.is_empty() {
            let incised = if dura.opened_s.is_some() { "open" } else { "closed: incise it with the scalpel" };
            panel.task.push(("dura".into(), incised.into()));
        }
        if !by_hand {
            let options = panel.choices.iter_mut().flat_map(|choice| &mut choice.options);
            options.for_each(|(_, why_not)| *why_not = Some(NOT_IN_HAND.into()));
        }
        panel
    }

    /// The operation's own actions: name, key, button.
    fn actions(&self) -> Vec<(&'static str, char, Buttons)> {
        let flap = self.bone.then_some(("Lift the flap, or put it back", 'f', Buttons::FLAP));
        let arm = self.program.has_tissue().then_some((ARM, 'a', Buttons::ARM));
        flap.into_iter().chain(arm).collect()
    }

    /// Tissue that is gone, ml.
    fn taken_ml(&self, brain: &Shape) -> f64 {
        let taken = |(fill, mm3): (&u16, &f32)| f64::from(u16::MAX - *fill) / f64::from(u16::MAX) * f64::from(*mm3);
        1e-3 * brain.fills.iter().zip(&self.volumes_mm3).map(taken).sum::<f64>()
    }

    /// Returns the frame of a state, with the brain as it lies.
    pub fn frame<'a>(&'a self, camera: Camera, view: &View, brain: &'a Shape) -> Frame<'a> {
        let frame = frame(camera, view, brain, self.bone, &self.colours);
        // A tool that is still on its way shows air.
        let far = view.sample.state.tip().distance(self.entry) > NEAR_MM;
        Frame { slices: SliceLook { through: far.then_some(self.entry), ..frame.slices }, ..frame }
    }

    /// Keeps a picture of the window.
    pub fn keep(&mut self, what: Capture, picture: Image) {
        self.keeper.keep(what, picture);
    }

    /// Ends the session, and adds the faults of saving its pictures to the album.
    pub fn finish(self, mut album: Album) -> Album {
        self.stop.ask();
        album.faults.extend(self.keeper.finish());
        album
    }
}

/// What the action of the arm is called.
pub(crate) const ARM: &str = "Leave the tool with an arm, or take the arm away";

/// A live session in the window.
struct Show {
    inputs: RenderInputs,
    view: View,
    brain: Shape,
    shown: ViewState,
    wanted_rate_hz: f32,
    pointer: Option<MouseHandle>,
    company: PeerSession,
    /// Markers on the anatomy, mm.
    markers: Vec<Vec3>,
    /// Pose of the teacher's ghost tool.
    ghost: Option<Pose>,
    requests: Requests,
    rate: Rate,
    raycast: Raycast,
    /// Whether there is no bone to lift.
    no_flap: bool,
    guide: Option<Guide>,
    /// A 3-D mouse in the other hand.
    knob: Option<SpaceMouse>,
}

/// Recent requests, each with the time at which it expires, s.
#[derive(Default)]
struct Requests(Vec<(Buttons, f64)>);

impl Requests {
    /// Requests the first tool; the one in the hand already needs no request.
    fn first(slot: usize) -> Self {
        Self((slot > 0).then(|| (Buttons::slot(slot), f64::INFINITY)).into_iter().collect())
    }

    /// Drops the request of the first tool once it is in the hand.
    fn settle(&mut self, slot: usize) {
        self.0.retain(|(button, until)| until.is_finite() || *button != Buttons::slot(slot));
    }

    /// Adds new requests and returns all that are active at a time, s.
    fn at(&mut self, seconds: f64, new: impl Iterator<Item = Buttons>) -> Buttons {
        self.0.retain(|(_, until)| seconds < *until);
        self.0.extend(new.map(|button| (button, seconds + REQUEST_S)));
        self.0.iter().fold(Buttons(0), |all, (button, _)| all | *button)
    }
}

/// Rate of the haptic loop, Hz, measured over about a second.
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
pub(crate) fn show(
    mut inputs: RenderInputs,
    painter: Painter,
    opened: &SessionView<'_>,
    pointer: Option<MouseHandle>,
    company: PeerSession,
    stop: &Stop,
) -> Album {
    let view = *inputs.view.latest().0;
    let show = Show {
        inputs,
        view,
        brain: Shape::default(),
        shown: ViewState::of(opened, opened.table.bone().is_some(), stop),
        wanted_rate_hz: opened.rate_hz,
        pointer,
        company,
        markers: Vec::new(),
        ghost: None,
        requests: Requests::first(opened.slot),
        rate: Rate::default(),
        raycast: Raycast::of(opened.table),
        no_flap: opened.table.bone().is_none(),
        guide: opened.guide.clone(),
        knob: opened.knob.then(|| SpaceMouse::open(&spacemouse::Config::default()).ok()).flatten(),
    };
    let (show, album) = run(show, painter, opened, view);
    show.shown.finish(album)
}

/// Runs a session in a window, with a picture before and one after it.
pub(crate) fn run<S: window::Session + Send>(
    session: S,
    mut painter: Painter,
    opened: &SessionView<'_>,
    at: View,
) -> (S, Album) {
    let (mut album, folder) = (Album::default(), opened.out.join("frames"));
    let eye = first_view(&opened.table.scene.site);
    album.add(shot(&mut painter, &session.frame(eye), &folder, "before"));
    let start = Start::with(eye, at.sample.state.world_from_tool);
    let detail = opened.table.models.setup.picture.detail as f32;
    let start = Start { microscope: Some(microscope(&opened.table.scene.site)), detail, ..start };
    let counted = Counted { session, pictures: 0, seconds: [0.0; 2], moving: Moving::default() };
    opened.progress.run();
    let closed = opened.stage.run(painter, counted, start);
    let (mut painter, Counted { session, pictures, seconds: [from, to], moving }) = (closed.renderer, closed.session);
    (album.frames, album.seconds, album.moving) = (album.frames + pictures, to - from, moving);
    album.add(shot(&mut painter, &session.frame(eye), &folder, "after"));
    if let Err(fault) = closed.result {
        tracing::error!("{fault}");
        album.faults.push(fault.to_string());
    }
    album.painter = Some(painter);
    (session, album)
}

/// A session in the window that counts its pictures.
struct Counted<S> {
    session: S,
    pictures: u64,
    /// Times of the first and the newest picture, s.
    seconds: [f64; 2],
    moving: Moving,
}

impl<S: window::Session> window::Session for Counted<S> {
    fn update(&mut self, input: &WindowInput) -> Panel {
        let first = if self.pictures == 0 { input.seconds } else { self.seconds[0] };
        self.seconds = [first, input.seconds];
        self.pictures += 1;
        input.pace.iter().for_each(|pace| self.moving.add(pace));
        self.session.update(input)
    }

    fn frame(&self, camera: Camera) -> Frame<'_> {
        self.session.frame(camera)
    }

    fn surface(&self, ray: &Ray) -> Option<SurfaceHit> {
        self.session.surface(ray)
    }

    fn capture(&mut self, what: Capture, picture: Image) {
        self.session.capture(what, picture);
    }
}

fn shot(painter: &mut Painter, frame: &Frame<'_>, folder: &Path, caption: &str) -> Result<Shot, SessionError> {
    let (image, _) = painter.picture(frame)?;
    snap(&image, folder, caption)
}

impl window::Session for Show {
    fn update(&mut self, input: &WindowInput) -> Panel {
        self.view = *self.inputs.view.latest().0;
        self.brain.follow(&mut self.inputs);
        self.requests.settle(self.view.sample.slot);
        self.raycast.follow(&self.brain, self.view.sample.state.tip());
        self.send_pose(input);
        let lesson = self.exchange_requests(input);
        let view = &self.view;
        let (by_hand, teaches) = (self.pointer.is_some(), self.company.teacher.is_some());
        let step = self.guide.as_mut().map(|guide| {
            let Wound { bleeding, dura, .. } = &self.brain.wound;
            let taken_ml = self.shown.taken_ml(&self.brain);
            guide.follow(view, [taken_ml, bleeding.rate_ml_per_min.into(), dura.incised_mm.into()])
        });
        let usual = || if teaches { TEACH } else { notice_text::hint(&view.sample.tool, by_hand) }.into();
        let hint = step.unwrap_or_else(usual);
        let no_flap = self.no_flap.then(|| Notice::NO_FLAP.to_string());
        let action = |(name, key, button): (&str, char, Buttons)| Action {
            name: name.into(),
            key: Some(key),
            why_not: no_flap.clone().filter(|_| button == Buttons::FLAP),
            on: button == Buttons::ARM && view.second.is_some_and(|second| is_held_by_arms(second.tool.kind)),
        };
        let own = if by_hand { self.shown.actions() } else { Vec::new() };
        let mut panel = self.shown.panel(view, &self.brain, by_hand);
        panel.warnings.extend(lesson.warnings);
        self.raycast.describe(view, &mut panel);
        // A watcher reads that the other session has ended, and closes the window herself.
        let over = self.company.watching.as_ref().and_then(Watching::ended);
        let finished = match over {
            Some(_) => self.shown.stop.signal().is_some(),
            None => view.finished || self.shown.stop.asked(),
        };
        if let Some(text) = over {
            panel.warnings.clear();
            panel.news = vec![format!("{text}: close the window (Q)")];
        }
        Panel {
            hint,
            by_hand,
            rate_hz: self.rate.follow(view.time_ms, view.counts[0]) as f32,
            wanted_rate_hz: self.wanted_rate_hz,
            actions: own.into_iter().map(action).chain(lesson.actions).collect(),
            knob: self.knob.as_mut().map(|knob| knob.velocity(1e3 * input.seconds)).unwrap_or_default(),
            leash: by_hand.then(|| Leash { tip: view.sample.state.tip(), length_mm: LEASH_MM }),
            finished,
            ..panel
        }
    }

    fn frame(&self, camera: Camera) -> Frame<'_> {
        let frame = self.shown.frame(camera, &self.view, &self.brain);
        let ghost = self.ghost.map(|pose| (self.view.sample.tool, pose));
        Frame { overlay: Overlay { ghost, markers: &self.markers, ..frame.overlay }, ..frame }
    }

    fn surface(&self, ray: &Ray) -> Option<SurfaceHit> {
        self.raycast.cast(ray, &self.brain)
    }

    fn capture(&mut self, what: Capture, picture: Image) {
        self.shown.keep(what, picture);
    }
}

impl Show {
    /// Passes mouse pose, pedal and requests to the haptic loop.
    fn send_pose(&mut self, input: &WindowInput) {
        let Some(pointer) = &mut self.pointer else { return };
        let buttons = [
            input.next_tool.then_some(Buttons::NEXT_TOOL),
            input.undo.then_some(Buttons::UNDO),
            input.redo.then_some(Buttons::REDO),
            input.chosen.map(|[_, slot]| Buttons::slot(slot)),
        ];
        let own = self.shown.actions().into_iter().enumerate();
        let own = own.filter_map(|(at, (.., button))| (input.actions >> at & 1 != 0).then_some(button));
        let active = self.requests.at(input.seconds, buttons.into_iter().flatten().chain(own));
        let pedal = if input.pedal { Buttons::PEDAL } else { Buttons(0) };
        pointer.set(input.world_from_tool, active | pedal);
    }

    /// Exchanges the teacher's requests for this picture; updates ghost and markers.
    fn exchange_requests(&mut self, input: &WindowInput) -> Lesson {
        let (lesson, requests) = match &mut self.company {
            PeerSession { teacher: Some(teacher), .. } => (teach(teacher, input), *teacher.requests()),
            PeerSession { asked: Some(asked), .. } => {
                let requests = *asked.latest().0;
                (Lesson::requested(requests.flags), requests)
            }
            _ => return Lesson::default(),
        };
        let shows = |bit| requests.flags & bit != 0;
        self.ghost = shows(TeacherRecord::GHOST).then_some(requests.ghost);
        self.markers.clear();
        self.markers.extend(shows(TeacherRecord::MARKER).then_some(requests.marker));
        lesson
    }
}

/// Additions of a lesson to the panel.
#[derive(Default)]
struct Lesson {
    warnings: Vec<String>,
    actions: Vec<Action>,
}

impl Lesson {
    /// Warnings to the trainee; the panel itself reports a pause.
    fn requested(flags: u32) -> Self {
        let trouble = TEACHER_REQUESTS.into_iter().filter(|(bit, _)| flags & bit & !TeacherRecord::PAUSE != 0);
        Self { warnings: trouble.map(|(_, text)| text.into()).collect(), ..Self::default() }
    }
}

/// Why no tool can be taken here.
pub(crate) const NOT_IN_HAND: &str = "another device, a script or a recording moves the tool";

/// Hint for a teacher.
pub(crate) const TEACH: &str = "you watch; your mouse and keys hold a ghost of the tool";

/// A teacher's switches: text, key and bit.
pub(crate) const SWITCHES: [(&str, char, u32); 5] = [
    ("Show the trainee my tool", 'g', TeacherRecord::GHOST),
    ("Mark the place of my tool", 'k', TeacherRecord::MARKER),
    ("Pause the trainee", 'j', TeacherRecord::PAUSE),
    ("Take the drill's power", 'a', TeacherRecord::NO_POWER),
    ("Let the patient bleed", 'h', TeacherRecord::BLEEDING),
];

/// Applies the teacher's input, sends the requests to the trainee, and returns the switches.
fn teach(teacher: &mut Teacher, input: &WindowInput) -> Lesson {
    for (at, (.., bit)) in SWITCHES.into_iter().enumerate().filter(|(at, _)| input.actions >> at & 1 != 0) {
        if at == 1 && teacher.requests().flags & bit == 0 {
            teacher.mark(input.world_from_tool.translation);
        } else {
            teacher.switch(bit);
        }
    }
    teacher.send(input.world_from_tool);
    let flags = teacher.requests().flags;
    let switch = |(name, key, bit): (&str, char, u32)| Action {
        name: name.into(),
        key: Some(key),
        on: flags & bit != 0,
        why_not: None,
    };
    Lesson { actions: SWITCHES.map(switch).into(), ..Lesson::default() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::{AtomicBool, Ordering};
    use trepan_geometry::ToolState;
    use trepan_haptics::HapticDevice;
    use trepan_link::{cell::cell, topics, wire::TickRecord};
    use trepan_runtime::watch::Watched;
    use trepan_stages::haptic_tick::ToolSample;
    use trepan_window::Pace;

    #[test]
    fn a_trainee_reads_the_requests() {
        let lesson = Lesson::requested(TeacherRecord::PAUSE | TeacherRecord::BLEEDING | TeacherRecord::GHOST);
        assert_eq!(lesson.warnings, [TEACHER_REQUESTS[2].1]);
    }

    /// Connects a watcher to a session that sends ticks only until the watcher is connected.
    fn connected(name: &str) -> (Watched, Watching) {
        let trainee = topics::Session::join(name).unwrap();
        let mut ticks = trainee.publisher::<TickRecord>().unwrap();
        let connected = AtomicBool::new(false);
        std::thread::scope(|scope| {
            scope.spawn(|| {
                while !connected.load(Ordering::Relaxed) {
                    ticks.send(&TickRecord { tick: 1, ..TickRecord::default() }).unwrap();
                    std::thread::sleep(std::time::Duration::from_millis(1));
                }
            });
            let opened = Watched::open(name, ToolState::at(Pose::IDENTITY), &Stop::default());
            connected.store(true, Ordering::Relaxed);
            opened.unwrap()
        })
    }

    #[test]
    fn a_window_on_an_ended_session_reports_it_and_stays_open() {
        let (mut watched, watching) = connected(&format!("ended-{}", std::process::id()));
        std::thread::sleep(std::time::Duration::from_millis(200));
        let start = ToolState::at(Pose::IDENTITY);
        let sample = ToolSample {
            tick: 0,
            state: start,
            tool: Program::Brain.tray()[0],
            slot: 0,
            drilling: false,
            second: None,
            idle: false,
        };
        let (mut writer, view) = cell(View::at(sample, 1.0));
        let mut show = Show {
            view: View::at(sample, 1.0),
            inputs: RenderInputs { view, soft: None, wound: None, film: None },
            brain: Shape::default(),
            shown: ViewState {
                case: "case".into(),
                program: Program::Brain,
                bone: false,
                colours: Colours::default(),
                no_aspiration: None,
                volumes_mm3: Vec::new(),
                entry: Vec3::ZERO,
                keeper: Keeper::into_folder(Path::new("nowhere")),
                stop: Stop::default(),
            },
            wanted_rate_hz: 1000.0,
            pointer: None,
            company: PeerSession { watching: Some(watching), ..PeerSession::default() },
            markers: Vec::new(),
            ghost: None,
            requests: Requests::default(),
            rate: Rate::default(),
            raycast: Raycast::default(),
            no_flap: true,
            guide: None,
            knob: None,
        };
        let input = input();
        assert!(window::Session::update(&mut show, &input).news.is_empty());
        watched.read(0.0);
        watched.read(1e4);
        writer.set(View { finished: true, ..show.view });
        show.shown.stop.ask();
        let panel = window::Session::update(&mut show, &input);
        assert!(!panel.finished && panel.news[0].contains("has ended"), "{:?}", panel.news);
        show.company.watching = None;
        assert!(window::Session::update(&mut show, &input).finished, "a session of one's own closes");
    }

    fn input() -> WindowInput {
        WindowInput {
            world_from_tool: Pose::IDENTITY,
            pedal: false,
            next_tool: false,
            undo: false,
            redo: false,
            chosen: None,
            actions: 0,
            playback: None,
            camera: Camera::viewed_from(Vec3::ZERO, Vec3::Y, 200.0),
            seconds: 0.0,
            pace: None,
        }
    }

    /// A session that shows nothing.
    struct Blank;

    impl window::Session for Blank {
        fn update(&mut self, _: &WindowInput) -> Panel {
            Panel::default()
        }

        fn frame(&self, _: Camera) -> Frame<'_> {
            unreachable!("nothing is drawn here")
        }

        fn capture(&mut self, _: Capture, _: Image) {}
    }

    #[test]
    fn pictures_are_counted_with_the_time_from_the_first_to_the_newest() {
        let mut counted = Counted { session: Blank, pictures: 0, seconds: [0.0; 2], moving: Moving::default() };
        for picture in 0..=20 {
            let pace = (picture % 2 == 1).then_some(Pace { interval_s: 0.05, detail: 0.4 });
            let input = WindowInput { seconds: 5.0 + 0.1 * f64::from(picture), pace, ..input() };
            window::Session::update(&mut counted, &input);
        }
        assert_eq!((counted.pictures, counted.seconds), (21, [5.0, 7.0]));
        let moving = counted.moving.summary().expect("ten pictures moved");
        assert_eq!(moving.frames, 10);
        assert!((moving.interval_us.p50 - 5e4).abs() < 100.0 && (moving.mean_detail - 0.4).abs() < 1e-6, "{moving:?}");
    }

    #[test]
    fn a_request_is_active_for_a_tenth_of_a_second() {
        let mut requests = Requests::default();
        let active = requests.at(1.0, [Buttons::UNDO, Buttons::slot(2)].into_iter());
        assert!(active.has(Buttons::UNDO) && active.in_slot() == Some(2));
        assert_eq!(requests.at(1.09, std::iter::empty()), active);
        assert_eq!(requests.at(1.11, [Buttons::FLAP].into_iter()), Buttons::FLAP);
    }
}
