//! Mouse and marks over the slices: a click sets the point through which they pass, the wheel turns
//! pages. Nothing here moves the tool.

use crate::words::tr;
use eframe::egui::{self, Align2, Color32, FontId, Pos2, Rect, Shape, Stroke};
use glam::{Vec2, Vec3};
use trepan_render::OUTLINE;
use trepan_render::Plane;

/// Way of a page for a notch of the wheel, mm.
const PAGE_MM: f32 = 1.0;
/// Points scrolled per notch of the wheel.
const NOTCH: f32 = 40.0;
/// Half the gap in the middle of the crosshair, points.
const GAP: f32 = 6.0;

/// Returns the slice under a position and the place in it, each coordinate from -1 to 1.
fn under(column: Rect, at: Pos2) -> Option<(usize, Vec2)> {
    let share = (at - column.min) / column.size();
    let inside = column.contains(at) && share.y < 1.0;
    let row = ((3.0 * share.y) as usize).min(2);
    inside.then(|| (row, Vec2::new(2.0 * share.x - 1.0, 1.0 - 2.0 * (3.0 * share.y - row as f32))))
}

/// Returns the point that a press or the wheel over the slices chooses; `None` leaves it.
///
/// `column` holds the three slices from top to bottom; a press counts if it began there.
pub(crate) fn chosen(ui: &egui::Ui, column: Rect, planes: &[Plane; 3]) -> Option<Vec3> {
    ui.input(|input| {
        let pressed = input.pointer.primary_down().then(|| input.pointer.press_origin()).flatten();
        if let (Some((row, _)), Some(now)) = (pressed.and_then(|from| under(column, from)), input.pointer.latest_pos())
        {
            let (_, at) = under(column, now).filter(|(here, _)| *here == row)?;
            return Some(planes[row].point(at));
        }
        let (row, _) = under(column, input.pointer.hover_pos()?)?;
        let notches = input.smooth_scroll_delta().y / NOTCH;
        let Plane { right, up, .. } = planes[row];
        (notches != 0.0).then(|| planes[0].through + PAGE_MM * notches * right.cross(up))
    })
}

/// Draws a crosshair through the chosen point, and what the coloured line means.
pub(crate) fn marks(ui: &egui::Ui, column: Rect, planes: &[Plane; 3], chosen: bool, brain: bool) {
    let painter = ui.painter().with_clip_rect(column);
    let (size, stroke) = (egui::vec2(column.width(), column.height() / 3.0), Stroke::new(1.0, Color32::from_gray(210)));
    for (row, plane) in planes.iter().enumerate().filter(|_| chosen) {
        let area = Rect::from_min_size(column.min + egui::vec2(0.0, row as f32 * size.y), size);
        let at = plane.at(plane.through);
        let at = area.center() + 0.5 * egui::vec2(at.x, -at.y) * size;
        for side in [egui::vec2(1.0, 0.0), egui::vec2(-1.0, 0.0), egui::vec2(0.0, 1.0), egui::vec2(0.0, -1.0)] {
            let clip = painter.with_clip_rect(area);
            clip.add(Shape::line_segment([at + GAP * side, at + column.height() * side], stroke));
        }
    }
    if brain {
        let at = column.left_bottom() + egui::vec2(6.0, -26.0);
        let [red, green, blue] = (255.0 * OUTLINE).to_array().map(|share| share as u8);
        let outline = Color32::from_rgb(red, green, blue);
        let text = format!("— {}", tr("outline of the cortex (MRI)"));
        let galley = painter.layout_no_wrap(text, FontId::proportional(12.0), outline);
        let area = Align2::LEFT_BOTTOM.anchor_size(at, galley.size());
        painter.rect_filled(area.expand(2.0), 2.0, Color32::from_black_alpha(200));
        painter.galley(area.min, galley, outline);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use trepan_geometry::Aabb;

    #[test]
    fn a_place_in_a_slice_is_the_point_that_is_drawn_there() {
        let bounds = Aabb { min: Vec3::splat(-50.0), max: Vec3::splat(50.0) };
        let focus = Vec3::new(10.0, -20.0, 30.0);
        let planes = Plane::three(focus, bounds, Some(40.0), &[[0, 0, 100, 100]; 3]);
        let column = Rect::from_min_size(egui::pos2(500.0, 0.0), egui::vec2(100.0, 300.0));
        for (row, plane) in planes.iter().enumerate() {
            let middle = egui::pos2(550.0, 50.0 + 100.0 * row as f32);
            let (found, at) = under(column, middle + egui::vec2(25.0, -10.0)).unwrap();
            assert_eq!(found, row);
            let point = plane.point(at);
            let way = point - focus;
            assert!((way - (20.0 * plane.right + 8.0 * plane.up)).length() < 1e-3, "slice {row}: {way}");
            assert!((plane.at(point) - at).length() < 1e-5);
        }
        assert_eq!(under(column, egui::pos2(499.0, 10.0)), None);
    }
}
