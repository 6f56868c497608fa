//! Mouse and keyboard input, converted to a camera and a target tool pose.

use crate::guide::Guide;
use crate::pointer::Pointer;
use crate::surface::Surfaces;
use crate::{Leash, Playback};
use eframe::egui;
use glam::{Quat, Vec2, Vec3};
use trepan_geometry::{Pose, Twist};
use trepan_render::{Camera, View};

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
    /// Whether a redo of the stroke undone last was requested since the last picture.
    pub redo: bool,
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
    /// The last picture, if something moved in it and in the one before.
    pub pace: Option<Pace>,
}

/// What a picture cost while something moved.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pace {
    /// Time since the picture before, s.
    pub interval_s: f64,
    /// Fraction of the 3-D view's pixels along an edge.
    pub detail: f32,
}

/// Camera rotation for a drag, rad per point.
const ORBIT_RAD: f32 = 0.008;
/// Tilt of the shaft for a drag, rad per point.
const TILT_RAD: f32 = 0.006;
/// Push of a 3-D mouse that doubles the size of the picture, mm.
const DOUBLES_MM: f32 = 70.0;
/// Distance of the eye at which a 3-D mouse moves the head as far as its push says, mm.
const NATURAL_MM: f32 = 300.0;
/// Move for a key, mm.
const KEY_MM: f32 = 0.5;

/// The camera and the target tool pose, as the user moves them.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ViewAndTool {
    pub world_from_tool: Pose,
    pub camera: Camera,
    pub guide: Guide,
}

impl ViewAndTool {
    /// Moves the camera and tilts the tool. `height` is that of the 3-D view in points.
    pub fn follow(&mut self, pointer: &Pointer, view: &View, height: f32) {
        if pointer.tilt && pointer.left != Vec2::ZERO {
            let turn = Quat::from_axis_angle(view.up, pointer.left.x * TILT_RAD)
                * Quat::from_axis_angle(view.right, pointer.left.y * TILT_RAD);
            self.world_from_tool.rotation = (turn * self.world_from_tool.rotation).normalize();
            self.guide.tilt(true);
        }
        let factor = pointer.zoom.max(1e-3).recip();
        self.camera.zoom_at(factor, pointer.at.unwrap_or(Vec2::ZERO), view.half.x / view.half.y);
        let (pans, turns) =
            if pointer.tilt { (pointer.middle + pointer.right, Vec2::ZERO) } else { (pointer.middle, pointer.right) };
        let mm = 2.0 * self.camera.distance_mm * view.half.y / height.max(1.0);
        self.camera.pan(-mm * pans.x, mm * pans.y);
        self.camera.orbit(-ORBIT_RAD * turns.x, ORBIT_RAD * turns.y);
    }

    /// Moves the camera as if a 3-D mouse held the head; `ms` is the time since the last picture.
    pub fn turn_view(&mut self, knob: &Twist, ms: f32) {
        let (push, turn) = (ms * knob.linear, ms * knob.angular);
        let scale = self.camera.distance_mm / NATURAL_MM;
        self.camera.pan(-scale * push.x, -scale * push.y);
        self.camera.zoom((-push.z / DOUBLES_MM).exp2());
        self.camera.orbit(-turn.y, turn.x);
    }

    /// Limits the target pose to the leash. In free air the hand leads as far as the air reaches,
    /// past a surface by the leash's length at most.
    pub fn hold(&mut self, leash: Leash, surfaces: &Surfaces<'_>, radius_mm: f32) {
        let hand = &mut self.world_from_tool.translation;
        if !leash.tip.is_finite() {
            return;
        }
        let way = *hand - leash.tip;
        let free = || match way.try_normalize() {
            Some(along) => surfaces.ahead(leash.tip, along, way.length() + radius_mm),
            None => None,
        };
        let longest = free().map_or(f32::INFINITY, |hit| leash.length_mm.max(hit.distance_mm - radius_mm));
        *hand = leash.tip + way.clamp_length_max(longest);
    }

    /// Moves the tool by keys.
    pub fn keys(&mut self, input: &egui::InputState, view: &View) {
        let pressed = |key| input.num_presses(key) as f32;
        let pair = |more, less| pressed(more) - pressed(less);
        let step = pair(egui::Key::ArrowRight, egui::Key::ArrowLeft) * view.right
            + pair(egui::Key::ArrowUp, egui::Key::ArrowDown) * view.up
            + pair(egui::Key::PageUp, egui::Key::PageDown) * view.forward;
        if step != Vec3::ZERO {
            self.world_from_tool.translation += KEY_MM * step;
            self.guide.stay();
        }
        let zoom = pair(egui::Key::Minus, egui::Key::Plus) - pressed(egui::Key::Equals);
        self.camera.zoom(1.1f32.powf(zoom));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::surface::tests::slab;

    fn hand() -> (ViewAndTool, View) {
        let camera = Camera::viewed_from(Vec3::ZERO, Vec3::Y, 200.0);
        let world_from_tool = Pose::from_translation(Vec3::new(5.0, 20.0, 3.0));
        (ViewAndTool { world_from_tool, camera, guide: Guide::default() }, camera.view(1.5))
    }

    #[test]
    fn a_leash_holds_the_hand_near_a_surface_and_lets_it_fly_in_air() {
        let (mut hand, _) = hand();
        let surfaces = Surfaces::new(&slab, [true; 2], None);
        let tip = Vec3::new(20.0, 0.0, 3.0);
        let leash = Leash { tip, length_mm: 2.0 };
        hand.world_from_tool.translation = tip + Vec3::X;
        hand.hold(leash, &surfaces, 3.0);
        assert_eq!(hand.world_from_tool.translation, tip + Vec3::X);
        hand.world_from_tool.translation = tip - 10.0 * Vec3::Z;
        hand.hold(leash, &surfaces, 3.0);
        assert!((hand.world_from_tool.translation - (tip - 2.0 * Vec3::Z)).length() < 1e-5, "it touches");
        let high = Leash { tip: tip + 9.0 * Vec3::Z, ..leash };
        hand.world_from_tool.translation = tip - 10.0 * Vec3::Z;
        hand.hold(high, &surfaces, 3.0);
        assert!((hand.world_from_tool.translation - tip).length() < 1e-4, "to the surface, not into it");
        hand.world_from_tool.translation = tip + 50.0 * Vec3::Z;
        hand.hold(leash, &surfaces, 3.0);
        assert_eq!(hand.world_from_tool.translation, tip + 50.0 * Vec3::Z);
        hand.hold(Leash { tip: Vec3::NAN, length_mm: 2.0 }, &surfaces, 3.0);
        assert!(hand.world_from_tool.translation.is_finite());
    }

    #[test]
    fn a_three_d_mouse_moves_the_head_as_the_knob_goes_and_the_tool_not_at_all() {
        let (mut hand, view) = hand();
        let (tool, head) = (hand.world_from_tool, Vec3::new(0.0, 90.0, 0.0));
        let at = |hand: &ViewAndTool| hand.camera.view(1.5).project(head);
        let before = at(&hand);
        let knob = |linear, angular| Twist { linear, angular };
        hand.turn_view(&knob(0.05 * Vec3::X, Vec3::ZERO), 100.0);
        assert!(at(&hand).0.x > before.0.x + 0.01, "to the right");
        hand.turn_view(&knob(-0.05 * Vec3::X + 0.05 * Vec3::Z, Vec3::ZERO), 100.0);
        assert!(at(&hand).1 < before.1 - 5.0, "to the user: {} of {}", at(&hand).1, before.1);
        hand.turn_view(&knob(-0.05 * Vec3::Z, 1e-3 * Vec3::Y), 100.0);
        assert!(at(&hand).0.x > before.0.x + 0.01, "the front of the head turns to the right");
        hand.turn_view(&knob(Vec3::ZERO, 1e-3 * (Vec3::X - Vec3::Y)), 100.0);
        assert!(at(&hand).0.y < before.0.y - 0.01, "the front goes down as the top comes to the user");
        hand.turn_view(&Twist::default(), 1000.0);
        assert!(view.eye.is_finite() && hand.world_from_tool == tool);
    }

    #[test]
    fn a_right_drag_circles_and_a_shifted_drag_tilts_about_the_tip() {
        let (mut hand, view) = hand();
        hand.follow(&Pointer { right: Vec2::new(10.0, 5.0), ..Pointer::NONE }, &view, 600.0);
        assert!(hand.camera.azimuth_rad < std::f32::consts::FRAC_PI_2 && hand.camera.elevation_rad > 0.0);
        let turned = hand.camera;
        hand.follow(&Pointer { middle: Vec2::new(60.0, 0.0), ..Pointer::NONE }, &view, 600.0);
        hand.follow(&Pointer { right: Vec2::new(-60.0, 0.0), tilt: true, ..Pointer::NONE }, &view, 600.0);
        assert!((hand.camera.target - turned.target).length() < 1e-4, "panned there and back");
        assert_eq!((hand.camera.azimuth_rad, hand.camera.elevation_rad), (turned.azimuth_rad, turned.elevation_rad));
        let tip = hand.world_from_tool.translation;
        hand.follow(&Pointer { left: Vec2::new(100.0, 0.0), tilt: true, ..Pointer::NONE }, &view, 600.0);
        assert_eq!(hand.world_from_tool.translation, tip);
        assert!(
            hand.world_from_tool.rotation.angle_between(Quat::IDENTITY) > 0.5
                && hand.world_from_tool.rotation.is_normalized()
        );
    }

    #[test]
    fn the_wheel_zooms_and_pushes_the_tool_only_with_shift() {
        let turned = |modifiers: egui::Modifiers| {
            let context = egui::Context::default();
            let (mut zoom, mut wheel) = (1.0, 0.0);
            for turn in [false, true, false, false, false] {
                let unit = egui::MouseWheelUnit::Line;
                let (delta, phase) = (egui::vec2(0.0, 1.0), egui::TouchPhase::Move);
                let source = egui::MouseWheelSource::Unknown;
                let turn = turn.then_some(egui::Event::MouseWheel { unit, delta, phase, source, modifiers });
                let held = egui::Event::ModifiersChanged(modifiers);
                let moved = egui::Event::PointerMoved(egui::pos2(100.0, 100.0));
                let events = [held, moved].into_iter().chain(turn).collect();
                let screen = egui::Rect::from_min_size(egui::Pos2::ZERO, egui::vec2(400.0, 300.0));
                let input = egui::RawInput { screen_rect: Some(screen), events, ..Default::default() };
                let mut drawn = context.run_ui(input, |ui| {
                    let (_, response) = ui.allocate_exact_size(ui.available_size(), egui::Sense::click_and_drag());
                    let pointer =
                        Pointer::over(ui, &response, &Camera::viewed_from(Vec3::ZERO, Vec3::Y, 60.0).view(1.0));
                    (zoom, wheel) = (zoom * pointer.zoom, wheel + pointer.wheel);
                });
                drawn.textures_delta.clear();
            }
            (zoom, wheel)
        };
        for modifiers in [egui::Modifiers::NONE, egui::Modifiers::COMMAND | egui::Modifiers::CTRL] {
            let (zoom, wheel) = turned(modifiers);
            assert!(zoom > 1.02 && wheel == 0.0, "{zoom} {wheel}");
        }
        let (zoom, wheel) = turned(egui::Modifiers::SHIFT);
        assert!(zoom == 1.0 && wheel > 1.0, "{zoom} {wheel}");
    }

    #[test]
    fn a_drag_over_the_picture_is_noticed_through_egui() {
        let context = egui::Context::default();
        let mut seen = Pointer::NONE;
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
                seen = Pointer::over(ui, &response, &Camera::viewed_from(Vec3::ZERO, Vec3::Y, 60.0).view(4.0 / 3.0));
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
