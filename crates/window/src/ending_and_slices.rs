//! Tests of what must not surprise: the end of a session, and the mouse over its slices.

use crate::tests::Bench;
use crate::{Panel, Timeline};
use eframe::egui::{self, Event, Key, PointerButton};

#[test]
fn ending_asks_once_and_can_be_taken_back() {
    let mut bench = Bench::in_hand();
    bench.press(Key::Q);
    assert!(bench.shows("End the operation?") && !bench.closes());
    bench.press(Key::Escape);
    bench.window.run_steps(2);
    assert!(!bench.shows("End the operation?") && !bench.closes(), "taken back");
    bench.click("End the operation");
    bench.click("Go on operating (Esc)");
    assert!(!bench.closes());
    bench.press(Key::Q);
    bench.window.key_down(Key::Enter);
    bench.window.step();
    assert!(bench.closes());
    let timeline = Timeline { at_s: 0.0, length_s: 1.0, ready_s: 1.0, running: false, speed: 1.0, marks: [].into() };
    let mut replay = Bench::with(Panel { timeline: Some(timeline), ..Panel::default() });
    replay.window.key_down(Key::Q);
    replay.window.step();
    assert!(replay.closes(), "closing a replay loses nothing");
}

#[test]
fn a_click_on_a_slice_moves_the_slices_and_never_the_tool() {
    let mut bench = Bench::in_hand();
    bench.window.run_steps(2);
    let before = bench.last_input().world_from_tool;
    let button = |pos, pressed| Event::PointerButton {
        pos,
        button: PointerButton::Primary,
        pressed,
        modifiers: Default::default(),
    };
    // The middle of the axial slice, beside a view as wide as it is high.
    let at = egui::pos2(955.0, 150.0);
    bench.window.event(Event::PointerMoved(at));
    bench.window.step();
    let before_press = bench.last_input().world_from_tool;
    bench.window.event(button(at, true));
    bench.window.run_steps(8);
    let held = bench.last_input();
    assert!(!held.pedal && held.world_from_tool == before_press, "{before:?} {held:?}");
    let through = bench.last_request().slices.through.expect("the click chose a point");
    bench.window.event(Event::PointerMoved(at + egui::vec2(20.0, 0.0)));
    bench.window.run_steps(2);
    let dragged = bench.last_request().slices.through.unwrap();
    assert!((dragged - through).length() > 0.1 && !bench.last_input().pedal);
    bench.window.event(button(at, false));
    bench.window.step();
    let (unit, delta, phase) = (egui::MouseWheelUnit::Line, egui::vec2(0.0, 3.0), egui::TouchPhase::Move);
    let source = egui::MouseWheelSource::Unknown;
    bench.window.event(Event::MouseWheel { unit, delta, phase, source, modifiers: Default::default() });
    let camera = bench.last_request().camera;
    bench.window.run_steps(6);
    let request = bench.last_request();
    let paged = request.slices.through.unwrap() - dragged;
    assert!(paged.z.abs() > 0.5 && paged.x.abs() + paged.y.abs() < 1e-3 && request.camera == camera, "{paged}");
    bench.click("Slices follow the tool again");
    assert_eq!(bench.last_request().slices.through, None);
}
