//! Pointer input over the picture.

use crate::View;
use eframe::egui;
use glam::Vec2;

/// Pointer input over the 3-D view since the last picture, in points.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Pointer {
    pub left: Vec2,
    pub middle: Vec2,
    pub right: Vec2,
    pub wheel: f32,
    /// Whether Shift is down: the left button tilts, the right one pans.
    pub tilt: bool,
    /// Zoom factor: egui computes it from the wheel with Ctrl and from two-finger gestures.
    pub zoom: f32,
    /// Place in the 3-D view, each coordinate from -1 (left, bottom) to 1; `None` outside it.
    pub at: Option<Vec2>,
    /// Way of the pointer without a button.
    pub moved: f32,
    /// Whether the left button was pressed over the picture and is still down.
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

impl Pointer {
    /// Pointer input over the picture, of which the 3-D view is the left part.
    pub fn over(ui: &egui::Ui, response: &egui::Response, view: &View) -> Self {
        use egui::PointerButton::{Middle, Primary, Secondary};
        let drag = |button| if response.dragged_by(button) { response.drag_delta() } else { egui::Vec2::ZERO };
        let [left, middle, right] = [Primary, Middle, Secondary].map(drag).map(|drag| Vec2::new(drag.x, drag.y));
        let (hovered, area) = (response.hovered(), response.rect);
        let width = (area.height() * view.half.x / view.half.y).min(area.width());
        let place = |pos: egui::Pos2| {
            let off = (pos - area.min) / egui::vec2(width, area.height());
            Vec2::new(2.0 * off.x - 1.0, 1.0 - 2.0 * off.y)
        };
        let held = response.is_pointer_button_down_on();
        ui.input(|input| {
            let at = input.pointer.latest_pos().filter(|_| hovered || held).map(place);
            let still = input.pointer.any_down() || !hovered;
            Self {
                left,
                middle,
                right,
                wheel: if hovered { input.smooth_scroll_delta().y } else { 0.0 },
                tilt: input.modifiers.shift,
                zoom: if hovered { input.zoom_delta() } else { 1.0 },
                at: at.filter(|at| at.abs().max_element() <= 1.0),
                moved: if still { 0.0 } else { input.pointer.delta().length() },
                held: held && input.pointer.primary_down() && !input.pointer.secondary_down(),
            }
        })
    }
}
