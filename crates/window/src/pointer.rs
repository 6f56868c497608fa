//! Pointer input over the picture.

use eframe::egui;
use glam::Vec2;
use trepan_render::View;

/// Pointer input over the 3-D view since the last picture, in points.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Pointer {
    pub left: Vec2,
    pub middle: Vec2,
    pub right: Vec2,
    /// Wheel with Shift, points: moves the tool along its shaft.
    pub wheel: f32,
    /// Whether Shift is down: the left button tilts, the right one pans.
    pub tilt: bool,
    /// Zoom factor, from the wheel and from two-finger gestures.
    pub zoom: f32,
    /// Place in the 3-D view, each coordinate from -1 (left, bottom) to 1; `None` outside it.
    pub at: Option<Vec2>,
    /// Way of the pointer without a button.
    pub moved: f32,
    /// Whether the left button was pressed over the 3-D view and is still down.
    pub held: bool,
}

#[cfg(test)]
impl Pointer {
    pub const NONE: Self = Self {
        left: Vec2::ZERO,
        middle: Vec2::ZERO,
        right: Vec2::ZERO,
        wheel: 0.0,
        tilt: false,
        zoom: 1.0,
        at: None,
        moved: 0.0,
        held: false,
    };
}

/// Zoom by the wheel: scrolled points that change the size by a factor e.
const ZOOM_POINTS: f32 = 400.0;

/// The part of a picture's area that shows the 3-D view; the slices stand to the right of it.
pub(crate) fn view_area(area: egui::Rect, view: &View) -> egui::Rect {
    let width = (area.height() * view.half.x / view.half.y).min(area.width());
    egui::Rect::from_min_size(area.min, egui::vec2(width, area.height()))
}

impl Pointer {
    /// Pointer input over the picture, of which the 3-D view is the left part. What begins over the
    /// slices does nothing here.
    pub fn over(ui: &egui::Ui, response: &egui::Response, view: &View) -> Self {
        use egui::PointerButton::{Middle, Primary, Secondary};
        let area = view_area(response.rect, view);
        let (began, now) = ui.input(|input| (input.pointer.press_origin(), input.pointer.latest_pos()));
        let begins_here = began.is_none_or(|at| area.contains(at));
        let dragged = |button| begins_here && response.dragged_by(button);
        let drag = |button| if dragged(button) { response.drag_delta() } else { egui::Vec2::ZERO };
        let [left, middle, right] = [Primary, Middle, Secondary].map(drag).map(|drag| Vec2::new(drag.x, drag.y));
        let hovered = response.hovered() && now.is_some_and(|at| area.contains(at));
        let place = |pos: egui::Pos2| {
            let off = (pos - area.min) / area.size();
            Vec2::new(2.0 * off.x - 1.0, 1.0 - 2.0 * off.y)
        };
        let held = begins_here && response.is_pointer_button_down_on();
        ui.input(|input| {
            // With Shift a wheel scrolls sideways.
            let (scrolled, shift) = (input.smooth_scroll_delta(), input.modifiers.shift);
            let zoom = input.zoom_delta() * if shift { 1.0 } else { (scrolled.y / ZOOM_POINTS).exp() };
            let at = input.pointer.latest_pos().filter(|_| hovered || held).map(place);
            let still = input.pointer.any_down() || !hovered;
            Self {
                left,
                middle,
                right,
                wheel: if hovered && shift { scrolled.x + scrolled.y } else { 0.0 },
                tilt: shift,
                zoom: if hovered { zoom } else { 1.0 },
                at: at.filter(|at| at.abs().max_element() <= 1.0),
                moved: if still { 0.0 } else { input.pointer.delta().length() },
                held: held && input.pointer.primary_down() && !input.pointer.secondary_down(),
            }
        })
    }
}
