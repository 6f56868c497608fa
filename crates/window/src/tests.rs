//! Tests of the window through its accessible names, mouse and keys, with pictures drawn by the
//! processor.

use crate::app::Window;
use crate::*;
use eframe::egui::{self, Color32, Event, Key, PointerButton, ViewportCommand};
use egui_kittest::kittest::Queryable;
use egui_kittest::{Harness, LazyRenderer};
use glam::Vec3;
use std::borrow::Cow;
use std::sync::Arc;
use trepan_bone::BoneVolume;
use trepan_geometry::{Aabb, Tool};
use trepan_gpu::{GpuError, Texture};
use trepan_render::{Painter, RenderError, SceneData, SliceLook, View};
use trepan_volume::VoxelVolume;

/// A session that returns a given panel and stores its inputs.
#[derive(Default)]
pub(crate) struct TestSession {
    panel: Panel,
    inputs: Vec<WindowInput>,
    captures: Vec<(Capture, [u32; 2])>,
}

impl Session for TestSession {
    fn update(&mut self, input: &WindowInput) -> Panel {
        self.inputs.push(*input);
        self.panel.clone()
    }

    fn frame(&self, camera: Camera) -> Frame<'_> {
        Frame::of(camera)
    }

    fn capture(&mut self, what: Capture, picture: Image) {
        self.captures.push((what, [picture.width, picture.height]));
    }
}

/// The parameters of a requested picture.
pub(crate) struct Requested {
    bone: bool,
    brain: bool,
    pub slices: SliceLook,
    pub camera: Camera,
    size: [u32; 2],
}

/// Draws by the processor and stores the requested parameters.
pub(crate) struct TestPainter(Painter, Option<Requested>);

impl Draws for TestPainter {
    fn device(&self) -> Option<&Gpu> {
        None
    }

    fn draw(&mut self, frame: &Frame, size: [u32; 2], detail: f32) -> Result<View, RenderError> {
        Draws::draw(&mut self.0, frame, size, detail)
    }

    fn texture(&self) -> Option<&Texture> {
        None
    }

    fn bounds(&self) -> Aabb {
        self.0.bounds()
    }

    fn picture(&mut self, frame: &Frame, size: [u32; 2], detail: f32) -> Result<(View, Cow<'_, Image>), RenderError> {
        let &Frame { show_bone: bone, show_brain: brain, slices, camera, .. } = frame;
        self.1 = Some(Requested { bone, brain, slices, camera, size });
        Draws::picture(&mut self.0, frame, [160, 120], detail)
    }
}

pub(crate) struct Bench {
    pub window: Harness<'static, Window<TestSession, TestPainter>>,
    lent: SharedCell<TestSession, TestPainter>,
}

impl Bench {
    pub fn with(panel: Panel) -> Self {
        let bone = VoxelVolume::isotropic([12; 3], Vec3::splat(-5.5), 1.0, 900i16);
        let bone = Some(Arc::new(BoneVolume::new(&bone, 400).unwrap()));
        let data = SceneData { bone, brain: None, mri: None, tint: None, cortex: None };
        let painter = TestPainter(Painter::on(Err(GpuError::NoAdapter), &data, [160, 120]).unwrap(), None);
        let session = TestSession { panel, ..TestSession::default() };
        let shared = Shared { session, renderer: painter, shown: false, fault: None };
        let lent: SharedCell<TestSession, TestPainter> = Rc::new(RefCell::new(Some(shared)));
        let camera = Camera::viewed_from(Vec3::ZERO, Vec3::Y, 60.0);
        let microscope = Some(Camera { fov_rad: 0.2, ..Camera::viewed_from(Vec3::ZERO, Vec3::Z, 300.0) });
        let start = Start { microscope, ..Start::with(camera, Pose::from_translation(Vec3::new(0.0, 8.0, 0.0))) };
        let window = Window::new(lent.clone(), start, true);
        // Nothing is rendered, also where another crate asks for the harness's renderer.
        let none = LazyRenderer::Uninitialized { textures_delta: Default::default(), builder: None };
        let harness = Harness::builder().with_size(egui::vec2(1280.0, 900.0)).renderer(none);
        let show = |ui: &mut egui::Ui, window: &mut Window<TestSession, TestPainter>| window.show(ui, None);
        let mut bench = Self { window: harness.build_ui_state(show, window), lent };
        bench.window.run_steps(3);
        bench
    }

    pub fn in_hand() -> Self {
        Self::with(Panel { by_hand: true, ..Panel::default() })
    }

    /// Presses a key; returns the session's next input.
    pub fn press(&mut self, key: Key) -> WindowInput {
        self.window.key_down(key);
        self.window.step();
        let input = self.last_input();
        self.window.key_up(key);
        self.window.step();
        input
    }

    /// Clicks the widget of this name; returns the session's next input.
    pub fn click(&mut self, name: &str) -> WindowInput {
        self.window.get_by_label(name).click();
        self.window.step();
        self.window.step();
        self.last_input()
    }

    fn slider<'a>(&'a self, name: &'a str) -> egui_kittest::Node<'a> {
        self.window.get_by_role_and_label(egui::accesskit::Role::Slider, name)
    }

    pub fn last_input(&self) -> WindowInput {
        *self.lent.borrow().as_ref().unwrap().session.inputs.last().unwrap()
    }

    pub fn last_request(&self) -> Requested {
        self.lent.borrow_mut().as_mut().unwrap().renderer.1.take().unwrap()
    }

    fn set_panel(&mut self, change: impl FnOnce(&mut Panel)) {
        change(&mut self.lent.borrow_mut().as_mut().unwrap().session.panel);
        self.window.run_steps(2);
    }

    pub fn shows(&self, words: &str) -> bool {
        self.window.query_all_by_label_contains(words).next().is_some()
    }

    fn commands(&self) -> Vec<ViewportCommand> {
        self.window.output().viewport_output.values().flat_map(|viewport| viewport.commands.clone()).collect()
    }

    pub fn closes(&self) -> bool {
        self.window.state().is_over()
    }
}

#[test]
fn the_panel_shows_the_sessions_data() {
    let values = vec![("late / held ticks".into(), "3 / 4".into())];
    let panel = Panel {
        case: "composite".into(),
        phase: "Craniotomy".into(),
        hint: "drag the burr".into(),
        force_n: 1.25,
        force_limit_n: 3.3,
        rate_hz: 999.0,
        wanted_rate_hz: 1000.0,
        values,
        task: vec![("bone left".into(), "4.2 mm".into())],
        ..Panel::default()
    };
    let mut bench = Bench::with(panel);
    let words = ["case composite", "Craniotomy", "Drag the burr", "Force  1.25 N", "limit 3.3 N", "4.2 mm"];
    assert!(words.iter().all(|words| bench.shows(words)));
    assert!(!bench.shows("Rate  999 Hz") && !bench.shows("3 / 4"), "folded away");
    bench.click("Engineering");
    bench.window.run_steps(20);
    assert!(bench.shows("Rate  999 Hz") && bench.shows("3 / 4"));
    assert!(!bench.shows("Hold to drill") && !bench.shows("Next tool"), "nobody's hand is on it");
}

#[test]
fn a_warning_is_a_wide_vermilion_banner_and_goes_when_it_is_over() {
    let wide = |bench: &Bench| {
        bench.window.output().shapes.iter().any(|clipped| match &clipped.shape {
            egui::Shape::Rect(rect) => rect.fill == palette::VERMILION && rect.rect.width() > 980.0,
            _ => false,
        })
    };
    let mut bench = Bench::with(Panel::default());
    assert!(!bench.shows("WARNING") && !wide(&bench));
    bench.set_panel(|panel| panel.warnings = vec!["The dura is 1 mm away".into(), "Force is clamped".into()]);
    assert!(bench.shows("WARNING   The dura is 1 mm away") && wide(&bench));
    assert!(!bench.shows("Force is clamped"), "the most urgent stands alone");
    bench.set_panel(|panel| panel.technical = vec!["The device is warm".into()]);
    let letters = bench.window.get_by_label_contains("The dura is 1 mm away").rect();
    assert!(letters.height() > 20.0 && letters.top() < 40.0, "{letters}");
    bench.set_panel(|panel| (panel.warnings, panel.news) = (Vec::new(), vec!["The teacher pauses".into()]));
    assert!(!bench.shows("WARNING") && bench.shows("The teacher pauses") && !wide(&bench));
}

#[test]
fn keys_and_buttons_give_the_same_input_once() {
    let mut bench = Bench::in_hand();
    assert!(bench.press(Key::U).undo && !bench.last_input().undo);
    assert!(bench.press(Key::N).next_tool && !bench.last_input().next_tool);
    assert!(bench.click("Undo the last stroke (U)").undo);
    assert!(!bench.last_input().next_tool);
    bench.window.step();
    assert!(!bench.last_input().undo);
    bench.set_panel(|panel| panel.tool = "probe".into());
    assert!(bench.click("Next tool (N)").next_tool);
}

#[test]
fn the_pedal_is_down_as_long_as_it_is_held() {
    let mut bench = Bench::in_hand();
    bench.window.key_down(Key::Space);
    bench.window.run_steps(4);
    assert!(bench.last_input().pedal);
    bench.window.key_up(Key::Space);
    bench.window.run_steps(2);
    assert!(!bench.last_input().pedal);
    let pos = bench.window.get_by_label("Hold to drill (Space)").rect().center();
    let button =
        |pressed| Event::PointerButton { pos, button: PointerButton::Primary, pressed, modifiers: Default::default() };
    bench.window.event(Event::PointerMoved(pos));
    bench.window.event(button(true));
    bench.window.step();
    bench.window.run_steps(12);
    assert!(bench.last_input().pedal, "held for 3 s");
    bench.set_panel(|panel| panel.drilling = true);
    assert!(bench.shows("Drilling (Space)") && bench.last_input().pedal);
    bench.window.event(button(false));
    bench.window.step();
    bench.window.run_steps(2);
    assert!(!bench.last_input().pedal);
}

#[test]
fn hidden_parts_are_not_drawn() {
    let mut bench = Bench::with(Panel::default());
    let all = bench.last_request();
    assert!(all.bone && all.brain && all.slices.shown);
    bench.press(Key::B);
    assert!(!bench.last_request().bone);
    bench.click("Skull (B)");
    assert!(bench.last_request().bone);
    bench.press(Key::T);
    bench.press(Key::S);
    let some = bench.last_request();
    assert!(some.bone && !some.brain && !some.slices.shown);
    bench.press(Key::S);
    bench.slider("level, HU").set_value_accesskit(120.0);
    bench.window.step();
    bench.slider("MRI over CT").set_value_accesskit(0.25);
    bench.window.step();
    let slices = bench.last_request().slices;
    assert_eq!((slices.level_hu, slices.mri_share, slices.shown), (120.0, 0.25, true));
}

#[test]
fn slices_get_a_window_of_their_own_and_the_view_the_whole_of_the_first() {
    let mut bench = Bench::in_hand();
    let [width, height] = bench.last_request().size;
    bench.press(Key::W);
    let apart = bench.last_request().size;
    assert_eq!(apart, [width + height / 3, height]);
    bench.press(Key::W);
    assert_eq!(bench.last_request().size, [width, height]);
    bench.press(Key::S);
    bench.press(Key::W);
    assert_eq!(bench.last_request().size, [width, height], "there are no slices to set apart");
    assert!(bench.shows("the slices are switched off"));
}

#[test]
fn the_microscope_looks_straight_down_and_back_again() {
    let mut bench = Bench::with(Panel::default());
    let orbit = bench.last_request().camera;
    bench.press(Key::M);
    let scope = bench.last_request().camera;
    assert!(scope.fov_rad == 0.2 && scope.elevation_rad > 1.5);
    bench.press(Key::Plus);
    assert!(bench.last_request().camera.distance_mm < scope.distance_mm);
    bench.click("Reset the view (R)");
    assert_eq!(bench.last_request().camera, scope);
    bench.click("Microscope (M)");
    assert_eq!(bench.last_request().camera, orbit);
}

#[test]
fn an_open_option_is_chosen_and_a_closed_one_is_not() {
    let options = [("burr 4 mm", None), ("burr 6 mm", None), ("perforator", Some("not now"))];
    let options = options.map(|(name, why_not)| (name.to_string(), why_not.map(String::from)));
    let choice = Choice { name: "Tool".into(), options: options.into(), ..Choice::default() };
    let mut bench = Bench::with(Panel { choices: vec![Choice::default(), choice], ..Panel::default() });
    assert_eq!(bench.click("burr 6 mm").chosen, Some([1, 1]));
    bench.window.step();
    assert_eq!(bench.last_input().chosen, None);
    assert_eq!(bench.click("perforator").chosen, None);
    assert_eq!(bench.click("burr 4 mm").chosen, None, "it is chosen already");
}

#[test]
fn the_sessions_own_actions_have_buttons_and_keys() {
    let action = |name: &str, key| Action { name: name.into(), key: Some(key), ..Action::default() };
    let actions = vec![action("Show my tool", 'g'), action("Pause the trainee", 'j')];
    let mut bench = Bench::with(Panel { actions, ..Panel::default() });
    assert_eq!(bench.press(Key::J).actions, 2);
    assert_eq!(bench.last_input().actions, 0);
    assert_eq!(bench.click("Show my tool (G)").actions, 1);
    bench.press(Key::F1);
    assert!(bench.window.query_all_by_label("Pause the trainee").count() > 0, "on the page of keys");
}

#[test]
fn large_type_makes_everything_larger_and_nothing_is_lost() {
    let mut bench = Bench::in_hand();
    let height = |bench: &Bench| {
        bench.window.get_by_label("Hold to drill (Space)").rect().height() * bench.window.ctx.zoom_factor()
    };
    let before = height(&bench);
    bench.click("Large type (L)");
    bench.window.run_steps(2);
    assert!(height(&bench) > 1.3 * before, "{} {before}", height(&bench));
    assert!(bench.shows("Reset the view (R)") && bench.shows("Keys (F1)"));
    bench.press(Key::L);
    bench.window.run_steps(2);
    assert!((height(&bench) - before).abs() < 0.1);
}

#[test]
fn the_page_of_keys_opens_and_escape_closes_it_and_never_the_window() {
    let mut bench = Bench::with(Panel::default());
    assert!(!bench.shows("Keys and mouse"));
    bench.press(Key::Questionmark);
    bench.window.run_steps(2);
    assert!(bench.shows("Keys and mouse") && bench.shows("Save every picture of the window"));
    bench.press(Key::Escape);
    assert!(!bench.shows("Keys and mouse") && !bench.closes());
    (0..3).for_each(|_| _ = bench.press(Key::Escape));
    assert!(!bench.closes());
}

#[test]
fn a_session_that_is_finished_or_cannot_be_drawn_closes_the_window() {
    let mut bench = Bench::with(Panel::default());
    assert!(!bench.closes());
    bench.set_panel(|panel| panel.finished = true);
    assert!(bench.closes());
}

/// Takes the requested screenshots, as the windowing system does after a picture.
fn take_pictures(bench: &mut Bench) -> usize {
    let taken = Arc::new(egui::ColorImage::filled([4, 3], Color32::RED));
    let requests = bench.commands().into_iter().filter_map(|command| match command {
        ViewportCommand::Screenshot(callback) => Some(callback),
        _ => None,
    });
    let requests: Vec<_> = requests.collect();
    let count = requests.len();
    requests.into_iter().for_each(|callback| callback.complete(taken.clone()));
    bench.window.step();
    count
}

#[test]
fn pictures_of_the_window_reach_the_session() {
    let mut bench = Bench::with(Panel::default());
    assert_eq!(take_pictures(&mut bench), 0);
    bench.press(Key::P);
    assert_eq!(take_pictures(&mut bench), 1);
    let captures = |bench: &Bench| bench.lent.borrow().as_ref().unwrap().session.captures.clone();
    let kinds: Vec<Capture> = captures(&bench).into_iter().map(|(what, _)| what).collect();
    assert_eq!(kinds, [Capture::Picture]);
    bench.press(Key::V);
    assert!(bench.shows("every picture of the window is saved"));
    let taken: usize = (0..5).map(|_| take_pictures(&mut bench)).sum();
    bench.press(Key::V);
    take_pictures(&mut bench);
    assert_eq!((taken, take_pictures(&mut bench)), (5, 0));
    let films = captures(&bench).into_iter().filter_map(|(what, _)| match what {
        Capture::Film(ms) => Some(ms),
        Capture::Picture => None,
    });
    let films: Vec<u64> = films.collect();
    assert!(films.len() >= 5 && films.is_sorted_by(|a, b| a < b), "{films:?}");
}

#[test]
fn a_timeline_runs_goes_to_events_and_is_dragged() {
    let marks = [(2.0, "burr near the brain", true), (6.0, "brain begins", false)];
    let marks = marks.map(|(at_s, text, warning)| Mark { at_s, text: text.into(), warning }).into();
    let timeline = Timeline { at_s: 3.0123, length_s: 10.0, ready_s: 5.0, running: false, speed: 1.0, marks };
    let mut bench = Bench::with(Panel { timeline: Some(timeline), ..Panel::default() });
    assert!(bench.lent.borrow().as_ref().unwrap().session.inputs.iter().all(|input| input.playback.is_none()));
    assert!(bench.shows("3.0 / 10.0 s") && bench.shows("50 % made") && bench.shows("burr near the brain"));
    assert_eq!(bench.click("Run (Space)").playback, Some(Playback::Run(true)));
    bench.window.run_steps(2);
    assert_eq!(bench.last_input().playback, None);
    let run_requests = |bench: &Bench| {
        let lent = bench.lent.borrow();
        let inputs = &lent.as_ref().unwrap().session.inputs;
        inputs.iter().filter(|input| input.playback == Some(Playback::Run(true))).count()
    };
    let before = run_requests(&bench);
    bench.press(Key::Space);
    bench.window.run_steps(2);
    assert_eq!(run_requests(&bench), before + 1, "Space says it once");
    assert_eq!(bench.click("Event before ([)").playback, Some(Playback::Seek(2.0)));
    bench.press(Key::CloseBracket);
    assert_eq!(bench.last_input().playback, Some(Playback::Seek(6.0)));
    assert_eq!(bench.click("0.25x").playback, Some(Playback::Speed(0.25)));
    bench.slider("time, s").set_value_accesskit(7.5);
    bench.window.step();
    bench.window.step();
    assert_eq!(bench.last_input().playback, Some(Playback::Seek(7.5)));
    bench.set_panel(|panel| panel.timeline.iter_mut().for_each(|timeline| timeline.running = true));
    assert_eq!(bench.click("Pause (Space)").playback, Some(Playback::Run(false)));
}

#[test]
fn arrow_keys_move_the_tool_unless_a_slider_has_them() {
    let mut bench = Bench::in_hand();
    let at = bench.last_input().world_from_tool.translation;
    bench.press(Key::ArrowUp);
    bench.window.step();
    let moved = bench.last_input().world_from_tool.translation;
    assert!((moved - at - 0.5 * Vec3::Z).length() < 1e-4, "{moved}");
    bench.slider("level, HU").focus();
    bench.window.step();
    let level = bench.last_request().slices.level_hu;
    bench.press(Key::ArrowRight);
    bench.window.step();
    assert_eq!(bench.last_input().world_from_tool.translation, moved);
    assert!(bench.last_request().slices.level_hu > level);
}

#[test]
fn every_key_answers_on_screen_whether_it_applies_or_not() {
    let tools = vec![Tool::burr(3.0), Tool::probe(2.0)];
    let options = vec![("burr".into(), None), ("probe".into(), Some("the bone is not open".into()))];
    let choice = Choice { name: "Tool".into(), options, chosen: 0, tools };
    let flap = Action { name: "Lift".into(), key: Some('f'), why_not: Some("no flap".into()), ..Action::default() };
    let refused = Some("nothing yet".to_string());
    let by_hand = Panel {
        by_hand: true,
        choices: vec![choice.clone()],
        actions: vec![flap],
        no_undo: refused.clone(),
        no_redo: refused.clone(),
        no_drill: refused,
        ..Panel::default()
    };
    // Keys that move tool or view at once, belong to the focused control, or only modify others.
    let moves = "ArrowDown ArrowLeft ArrowRight ArrowUp PageUp PageDown Plus Minus Equals Tab Enter Home End \
                 ShiftLeft ShiftRight ControlLeft ControlRight AltLeft AltRight SuperLeft SuperRight CapsLock";
    for panel in [by_hand, Panel { choices: vec![choice], ..Panel::default() }] {
        let mut bench = Bench::with(panel);
        for &key in Key::ALL {
            if moves.split(' ').any(|name| key == Key::from_name(name).unwrap()) {
                continue;
            }
            bench.window.state_mut().answers = Default::default();
            bench.press(key);
            let now = bench.window.state().drawn_at;
            let answer = bench.window.state().answers.standing(now).map(String::from);
            assert!(answer.as_ref().is_some_and(|text| bench.shows(text)), "{key:?} does not answer: {answer:?}");
        }
    }
}

#[test]
fn what_cannot_be_used_is_grey_and_does_nothing() {
    let panel = Panel { by_hand: true, no_undo: Some("no stroke".into()), ..Panel::default() };
    let mut bench = Bench::with(panel);
    assert!(!bench.click("Undo the last stroke (U)").undo && !bench.press(Key::U).undo);
    assert!(bench.shows("Undo the last stroke: no stroke"));
    bench.set_panel(|panel| panel.no_undo = None);
    assert!(bench.click("Undo the last stroke (U)").undo && bench.press(Key::Y).redo);
}

#[test]
fn number_keys_take_tools() {
    let tools = vec![Tool::burr(3.0), Tool::craniotome(), Tool::probe(2.0)];
    let options = ["burr", "craniotome", "probe"].map(|name| (name.to_string(), None)).into();
    let choices = vec![Choice { name: "Tool".into(), options, chosen: 0, tools }];
    let mut bench = Bench::with(Panel { by_hand: true, choices, ..Panel::default() });
    assert_eq!(bench.press(Key::Num2).chosen, Some([0, 1]));
    assert_eq!(bench.press(Key::Num1).chosen, None);
    assert!(bench.shows("it is in the hand: burr"));
    assert_eq!(bench.click("3  probe").chosen, Some([0, 2]));
    bench.press(Key::Num7);
    assert!(bench.shows("there is no tool number 7"));
}

#[test]
fn no_control_is_out_of_reach_on_small_and_large_screens() {
    let marks =
        [(2.0, "burr near the brain", true)].map(|(at_s, text, warning)| Mark { at_s, text: text.into(), warning });
    let timeline =
        Timeline { at_s: 3.0, length_s: 10.0, ready_s: 5.0, running: false, speed: 1.0, marks: marks.into() };
    let tools = vec![Tool::burr(3.0), Tool::craniotome(), Tool::perforator()];
    let options = ["burr 6 mm", "craniotome", "perforator 11 mm"].map(|name| (name.to_string(), None)).into();
    let choices = vec![Choice { name: "Tool".into(), options, chosen: 0, tools }];
    let full = Panel { by_hand: true, choices, timeline: Some(timeline), ..Panel::default() };
    for (size, scale) in [
        ([1024.0, 700.0], 1.0),
        ([1024.0, 700.0], 2.0),
        ([1280.0, 800.0], 1.5),
        ([3840.0, 2160.0], 1.0),
        ([3840.0, 2160.0], 2.0),
    ] {
        let mut bench = Bench::with(full.clone());
        let points = egui::vec2(size[0], size[1]) / scale;
        bench.window.set_size(points);
        bench.window.run_steps(6);
        let screen = egui::Rect::from_min_size(egui::Pos2::ZERO, points);
        use egui::accesskit::Role;
        let controls = [Role::Button, Role::CheckBox, Role::Slider];
        for role in controls {
            for node in bench.window.query_all_by_role(role) {
                let rect = node.rect();
                let reached = rect.left() >= -1.0 && rect.right() <= screen.right() + 1.0 && rect.width() > 4.0;
                assert!(reached, "{node:?} at {rect:?} of {screen:?}");
            }
        }
        bench.window.event(Event::PointerMoved(egui::pos2(points.x - 40.0, 0.4 * points.y)));
        for _ in 0..60 {
            let (unit, phase, source) =
                (egui::MouseWheelUnit::Point, egui::TouchPhase::Move, egui::MouseWheelSource::Unknown);
            let (delta, modifiers) = (egui::vec2(0.0, -200.0), Default::default());
            bench.window.event(Event::MouseWheel { unit, delta, phase, source, modifiers });
            bench.window.step();
        }
        bench.window.run_steps(10);
        for name in ["Keys (F1)", "Close the replay"] {
            let last = bench.window.get_by_label(name).rect();
            assert!(screen.contains_rect(last), "{name} is at {last:?} of {screen:?}");
        }
    }
}

/// Actions of a page under test, by the name of its control.
fn page() -> Page<&'static str> {
    let choosable = |name: &str, open| Choosable { name: name.into(), hint: "why".into(), open };
    let amount = Amount { name: "flap, mm".into(), value: 10.0, range: [0.0, 90.0], step: 1.0 };
    let image = Arc::new(Image { width: 2, height: 2, rgba: vec![90; 16] });
    let picture = Picture {
        name: "head".into(),
        image,
        height: 200.0,
        letters: vec![([0.1, 0.5], "R".into())],
        clicked: Some(|_| "clicked"),
        dragged: None,
        scrolled: None,
    };
    let many = (0..30).map(|n| Item::button(format!("case {n}"), "a case", "case")).collect();
    Page {
        title: "Title".into(),
        columns: vec![
            many,
            vec![
                Item::Choice(
                    "Device".into(),
                    vec![choosable("mouse", true), choosable("haply", false)],
                    1,
                    |_| "device",
                ),
                Item::Field("Name".into(), String::new(), "nobody".into(), |_| "name"),
                Item::Amount(amount, |_| "flap"),
                Item::Curve("curve".into(), vec![1.0, 3.0, 2.0]),
            ],
            vec![
                Item::Picture(picture),
                Item::Alert("careful".into()),
                Item::Table(vec![vec!["a".into(), "b".into()]]),
            ],
        ],
        foot: vec![Item::main("Start", "begins", "start"), Item::closed("Check", "open a CT first")],
        escape: Some("back"),
        ..Page::default()
    }
}

/// A page in a window of some size: its harness gathers the actions.
fn shown(size: [f32; 2], scale: f32) -> Harness<'static, Vec<&'static str>> {
    let mut textures = page::Textures::default();
    let show = move |ui: &mut egui::Ui, done: &mut Vec<&'static str>| {
        let drawn = egui::CentralPanel::default().show(ui, |ui| page::show(ui, &page(), &mut textures));
        done.extend(drawn.inner);
    };
    let size = egui::vec2(size[0], size[1]) / scale;
    let mut harness = Harness::builder().with_size(size).with_pixels_per_point(scale).build_ui_state(show, Vec::new());
    harness.run_steps(3);
    harness
}

#[test]
fn the_controls_of_a_page_do_what_they_say_and_closed_ones_nothing() {
    let mut harness = shown([1280.0, 800.0], 1.0);
    for name in ["Start", "Check", "mouse", "haply", "case 3"] {
        harness.get_by_label(name).click();
        harness.run_steps(2);
    }
    assert_eq!(*harness.state(), ["start", "device", "case"]);
    harness.key_press(Key::Escape);
    harness.run_steps(2);
    assert_eq!(harness.state().last(), Some(&"back"));
}

#[test]
fn no_control_of_a_page_is_cut_off_beside_the_window() {
    for (size, scale) in
        [([1024.0, 700.0], 1.0), ([1280.0, 800.0], 1.0), ([1920.0, 1080.0], 1.0), ([1280.0, 800.0], 2.0)]
    {
        let harness = shown(size, scale);
        let width = size[0] / scale;
        for name in ["case 0", "case 29", "mouse", "haply", "Start", "Check", "careful"] {
            let area = harness.get_by_label(name).rect();
            assert!(area.left() >= 0.0 && area.right() <= width, "{name} at {size:?} and scale {scale}: {area}");
        }
        let foot = harness.get_by_label("Start").rect();
        assert!(foot.bottom() <= size[1] / scale, "the foot stays in view: {foot}");
    }
}

#[test]
fn a_drag_over_a_picture_keeps_every_place_while_the_page_changes() {
    let page = |drags: &Vec<Drag>| {
        let image = Arc::new(Image { width: 2, height: 2, rgba: vec![90; 16] });
        let (letters, clicked, scrolled) = (Vec::new(), None, None);
        let dragged: Option<fn(Drag) -> Drag> = Some(|d| d);
        let picture = Picture { name: "head".into(), image, height: 200.0, letters, clicked, dragged, scrolled };
        // Its height grows past the window, so that its parts are laid out another way.
        let notes = (0..40 * drags.len().min(1)).map(|n| Item::Note(format!("note {n}")));
        let column = [Item::Picture(picture)].into_iter().chain(notes).collect();
        Page { title: "Title".into(), columns: vec![column], foot: vec![Item::Note("foot".into())], ..Page::default() }
    };
    let mut textures = page::Textures::default();
    let app = move |ui: &mut egui::Ui, drags: &mut Vec<Drag>| {
        let done = page::show(ui, &page(drags), &mut textures);
        drags.extend(done);
    };
    let mut harness = Harness::builder().with_size(egui::vec2(800.0, 400.0)).build_ui_state(app, Vec::new());
    harness.run_steps(3);
    let area = harness.get_by_label("head").rect();
    let place = |n: usize| area.lerp_inside(egui::vec2(0.2 + 0.02 * n as f32, 0.5));
    let button = |pressed| Event::PointerButton {
        pos: place(if pressed { 0 } else { 20 }),
        button: PointerButton::Primary,
        pressed,
        modifiers: Default::default(),
    };
    harness.event(Event::PointerMoved(place(0)));
    harness.step();
    harness.event(button(true));
    harness.step();
    for steps in [1..8, 8..14, 14..21] {
        steps.for_each(|n| harness.input_mut().events.push(Event::PointerMoved(place(n))));
        harness.step();
    }
    harness.event(button(false));
    harness.step();
    let drags = harness.state();
    assert!(drags[0].begins && drags.last().is_some_and(|last| last.ends), "{drags:?}");
    for n in 0..=20 {
        let at = 0.2 + 0.02 * n as f32;
        assert!(drags.iter().any(|drag| (drag.at[0] - at).abs() < 1e-3), "place {n} of {drags:?}");
    }
}
