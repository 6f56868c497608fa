//! Mouse and keyboard input, converted to a camera and a target tool pose.

use super::{Leash, Playback};
use crate::{Camera, View};
use eframe::egui;
use glam::{Quat, Vec2};
use trepan_geometry::Pose;

/// The user's input, once per picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WindowInput {
    /// The tool's target pose from the mouse.
    pub world_from_tool: Pose,
    /// Whether the drill's pedal is down.
    pub pedal: bool,
    /// Whether the next tool was requested since the last picture.
    pub next_tool: bool,
    /// Whether an undo of the last stroke was requested since the last picture.
    pub undo: bool,
    /// A selected option of a panel choice: index of the choice, index of the option.
    pub chosen: Option<[usize; 2]>,
    /// The panel's actions requested since the last picture, one bit each.
    pub actions: u32,
    /// The command to the timeline.
    pub playback: Option<Playback>,
    /// The view.
    pub camera: Camera,
    /// Time since the window opened, s.
    pub seconds: f64,
}

/// Camera rotation for a drag, rad per point.
const ORBIT_RAD: f32 = 0.008;
/// Tilt of the shaft for a drag, rad per point.
const TILT_RAD: f32 = 0.006;
/// Push by the wheel, mm per point scrolled.
const PUSH_MM: f32 = 0.02;
/// Move for a key, mm.
const KEY_MM: f32 = 0.5;

/// The camera and the target tool pose, as the user moves them.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ViewAndTool {
    pub world_from_tool: Pose,
    pub camera: Camera,
}

/// Pointer input over the 3-D view since the last picture, in points.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Pointer {
    pub left: Vec2,
    pub right: Vec2,
    pub wheel: f32,
    pub tilt: bool,
    /// Zoom factor: egui computes it from the wheel with Ctrl and from two-finger gestures.
    pub zoom: f32,
}

impl Default for Pointer {
    fn default() -> Self {
        Self { left: Vec2::ZERO, right: Vec2::ZERO, wheel: 0.0, tilt: false, zoom: 1.0 }
    }
}

impl ViewAndTool {
    /// Moves tool and camera. `height` is that of the 3-D view in points.
    pub fn follow(&mut self, pointer: &Pointer, view: &View, height: f32) {
        let tip = self.world_from_tool.translation;
        let depth = (tip - view.eye).dot(view.forward).max(1.0);
        let mm = 2.0 * depth * view.half.y / height.max(1.0);
        let drag = pointer.left;
        if pointer.tilt {
            let turn = Quat::from_axis_angle(view.up, drag.x * TILT_RAD)
                * Quat::from_axis_angle(view.right, drag.y * TILT_RAD);
            self.world_from_tool.rotation = (turn * self.world_from_tool.rotation).normalize();
        } else {
            self.world_from_tool.translation += mm * (drag.x * view.right - drag.y * view.up);
        }
        self.camera.zoom(pointer.zoom.max(1e-3).recip());
        let sight = (tip - view.eye).normalize_or(view.forward);
        self.world_from_tool.translation += PUSH_MM * pointer.wheel * sight;
        self.camera.orbit(-ORBIT_RAD * pointer.right.x, ORBIT_RAD * pointer.right.y);
    }

    /// Limits the target pose to the leash.
    pub fn hold(&mut self, leash: Leash) {
        let hand = &mut self.world_from_tool.translation;
        if leash.tip.is_finite() {
            *hand = leash.tip + (*hand - leash.tip).clamp_length_max(leash.length_mm);
        }
    }

    /// Moves the tool by keys.
    pub fn keys(&mut self, input: &egui::InputState, view: &View) {
        let pressed = |key| input.num_presses(key) as f32;
        let pair = |more, less| pressed(more) - pressed(less);
        let step = pair(egui::Key::ArrowRight, egui::Key::ArrowLeft) * view.right
            + pair(egui::Key::ArrowUp, egui::Key::ArrowDown) * view.up
            + pair(egui::Key::PageUp, egui::Key::PageDown) * view.forward;
        self.world_from_tool.translation += KEY_MM * step;
        let zoom = pair(egui::Key::Minus, egui::Key::Plus) - pressed(egui::Key::Equals);
        self.camera.zoom(1.1f32.powf(zoom));
    }
}

impl Pointer {
    /// Pointer input over a widget.
    pub fn over(ui: &egui::Ui, response: &egui::Response) -> Self {
        let drag = |button| if response.dragged_by(button) { response.drag_delta() } else { egui::Vec2::ZERO };
        let (left, right) = (drag(egui::PointerButton::Primary), drag(egui::PointerButton::Secondary));
        let hovered = response.hovered();
        ui.input(|input| Self {
            left: Vec2::new(left.x, left.y),
            right: Vec2::new(right.x, right.y),
            wheel: if hovered { input.smooth_scroll_delta().y } else { 0.0 },
            tilt: input.modifiers.shift,
            zoom: if hovered { input.zoom_delta() } else { 1.0 },
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    fn hand() -> (ViewAndTool, View) {
        let camera = Camera::viewed_from(Vec3::ZERO, Vec3::Y, 200.0);
        let world_from_tool = Pose::from_translation(Vec3::new(5.0, 20.0, 3.0));
        (ViewAndTool { world_from_tool, camera }, camera.view(1.5))
    }

    #[test]
    fn a_left_drag_moves_the_tip_under_the_pointer() {
        let (mut hand, view) = hand();
        let before = view.project(hand.world_from_tool.translation).0;
        let pointer = Pointer { left: Vec2::new(30.0, -12.0), ..Default::default() };
        hand.follow(&pointer, &view, 600.0);
        let after = view.project(hand.world_from_tool.translation).0;
        let moved = (after - before) * Vec2::new(0.5 * 900.0, -0.5 * 600.0);
        assert!((moved - pointer.left).length() < 0.01, "{moved}");
    }

    #[test]
    fn the_wheel_pushes_along_the_line_of_sight_and_zooms_with_control() {
        let (mut hand, view) = hand();
        let before = hand.world_from_tool.translation;
        hand.follow(&Pointer { wheel: 50.0, ..Default::default() }, &view, 600.0);
        let pushed = hand.world_from_tool.translation - before;
        assert!((pushed.length() - 1.0).abs() < 1e-4 && pushed.dot(before - view.eye) > 0.0);
        hand.follow(&Pointer { zoom: 1.25, ..Default::default() }, &view, 600.0);
        assert!(hand.camera.distance_mm < 200.0 && hand.world_from_tool.translation == before + pushed);
    }

    #[test]
    fn a_leash_holds_the_hand_near_the_tool() {
        let (mut hand, _) = hand();
        let at = hand.world_from_tool.translation;
        hand.hold(Leash { tip: at + Vec3::X, length_mm: 2.0 });
        assert_eq!(hand.world_from_tool.translation, at);
        hand.hold(Leash { tip: at + 10.0 * Vec3::X, length_mm: 2.0 });
        assert!((hand.world_from_tool.translation - (at + 8.0 * Vec3::X)).length() < 1e-5);
        hand.hold(Leash { tip: Vec3::NAN, length_mm: 2.0 });
        assert!(hand.world_from_tool.translation.is_finite());
    }

    #[test]
    fn a_right_drag_circles_and_a_shifted_drag_tilts_about_the_tip() {
        let (mut hand, view) = hand();
        hand.follow(&Pointer { right: Vec2::new(10.0, 5.0), ..Default::default() }, &view, 600.0);
        assert!(hand.camera.azimuth_rad < std::f32::consts::FRAC_PI_2 && hand.camera.elevation_rad > 0.0);
        let tip = hand.world_from_tool.translation;
        hand.follow(&Pointer { left: Vec2::new(100.0, 0.0), tilt: true, ..Default::default() }, &view, 600.0);
        assert_eq!(hand.world_from_tool.translation, tip);
        assert!(
            hand.world_from_tool.rotation.angle_between(Quat::IDENTITY) > 0.5
                && hand.world_from_tool.rotation.is_normalized()
        );
    }

    #[test]
    fn the_wheel_with_control_zooms_through_egui_and_pushes_nothing() {
        let turned = |modifiers: egui::Modifiers| {
            let context = egui::Context::default();
            let (mut zoom, mut wheel) = (1.0, 0.0);
            for turn in [false, true, false, false, false] {
                let unit = egui::MouseWheelUnit::Line;
                let (delta, phase) = (egui::vec2(0.0, 1.0), egui::TouchPhase::Move);
                let source = egui::MouseWheelSource::Unknown;
                let turn = turn.then_some(egui::Event::MouseWheel { unit, delta, phase, source, modifiers });
                let events = [egui::Event::PointerMoved(egui::pos2(100.0, 100.0))].into_iter().chain(turn).collect();
                let screen = egui::Rect::from_min_size(egui::Pos2::ZERO, egui::vec2(400.0, 300.0));
                let input = egui::RawInput { screen_rect: Some(screen), events, ..Default::default() };
                let mut drawn = context.run_ui(input, |ui| {
                    let (_, response) = ui.allocate_exact_size(ui.available_size(), egui::Sense::click_and_drag());
                    let pointer = Pointer::over(ui, &response);
                    (zoom, wheel) = (zoom * pointer.zoom, wheel + pointer.wheel);
                });
                drawn.textures_delta.clear();
            }
            (zoom, wheel)
        };
        let (zoom, wheel) = turned(egui::Modifiers::COMMAND | egui::Modifiers::CTRL);
        assert!(zoom > 1.02 && wheel == 0.0, "{zoom} {wheel}");
        let (zoom, wheel) = turned(egui::Modifiers::NONE);
        assert!(zoom == 1.0 && wheel > 1.0, "{zoom} {wheel}");
    }

    #[test]
    fn a_drag_over_the_picture_is_noticed_through_egui() {
        let context = egui::Context::default();
        let mut seen = Pointer::default();
        let mut press = |pos: egui::Pos2, pressed: Option<bool>| {
            let mut events = vec![egui::Event::PointerMoved(pos)];
            let button = egui::PointerButton::Primary;
            events.extend(pressed.map(|pressed| egui::Event::PointerButton {
                pos,
                button,
                pressed,
                modifiers: Default::default(),
            }));
            let screen = egui::Rect::from_min_size(egui::Pos2::ZERO, egui::vec2(400.0, 300.0));
            let input = egui::RawInput { screen_rect: Some(screen), events, ..Default::default() };
            let mut drawn = context.run_ui(input, |ui| {
                let (_, response) = ui.allocate_exact_size(ui.available_size(), egui::Sense::click_and_drag());
                seen = Pointer::over(ui, &response);
            });
            drawn.textures_delta.clear();
            seen.left
        };
        assert_eq!(press(egui::pos2(100.0, 100.0), None), Vec2::ZERO);
        press(egui::pos2(100.0, 100.0), Some(true));
        assert_eq!(press(egui::pos2(130.0, 88.0), None), Vec2::new(30.0, -12.0));
        press(egui::pos2(130.0, 88.0), Some(false));
        assert_eq!(press(egui::pos2(170.0, 88.0), None), Vec2::ZERO);
    }
}
