//! Aids over the 3-D view: distance line and drop shadow of the tool, and the pressure at its tip.

use crate::Panel;
use crate::guide::Around;
use crate::palette::{GREEN, ORANGE, SKY, VERMILION};
use eframe::egui::{self, Align2, Color32, FontId, Pos2, Rect, Shape, Stroke};
use glam::Vec3;
use trepan_render::View;

/// Distance under which no line is drawn, mm.
const TOUCH_MM: f32 = 0.5;
/// Largest distance to a surface below the tool, mm.
const FAR_MM: f32 = 200.0;
/// Distance of bars and numbers from the tool, points.
const BESIDE: f32 = 22.0;
/// Corners of the drop shadow.
const CORNERS: usize = 24;
/// Shares of the largest force from which the pressure is shown as high, and as too high.
const HIGH: [f32; 2] = [0.5, 0.85];

/// Draws the aids of a tool over the picture's area.
pub(crate) fn show(ui: &egui::Ui, area: Rect, around: &Around<'_>, panel: &Panel, pressed: bool) {
    if !panel.by_hand {
        return;
    }
    let width = area.height() * around.view.half.x / around.view.half.y;
    let view_area = Rect::from_min_size(area.min, egui::vec2(width.min(area.width()), area.height()));
    let painter = ui.painter().with_clip_rect(view_area);
    let tip = around.world_from_tool.translation;
    let down = around.world_from_tool.rotation * Vec3::NEG_Z;
    let radius_mm = around.tool.tip_radius_mm;
    let on_screen = |point: Vec3| place(around.view, view_area, point);
    if let Some(hit) = around.surfaces.ahead(tip, down, FAR_MM) {
        let (point, gap) = (tip + hit.distance_mm * down, hit.distance_mm - radius_mm);
        if let (true, Some(from), Some(to)) = (gap > TOUCH_MM, on_screen(tip), on_screen(point)) {
            let (right, up) = hit.normal.any_orthonormal_pair();
            let corner = |n: usize| {
                let (sin, cos) = (n as f32 / CORNERS as f32 * std::f32::consts::TAU).sin_cos();
                on_screen(point + radius_mm * (cos * right + sin * up) + 0.1 * hit.normal)
            };
            let shadow: Vec<Pos2> = (0..CORNERS).filter_map(corner).collect();
            // A ring, not a disc: what lies under it counts.
            let beside = shadow.iter().map(|at| at.x).fold(to.x, f32::max) + BESIDE;
            painter.add(Shape::closed_line(shadow, Stroke::new(1.5, SKY)));
            painter.line_segment([from, to], Stroke::new(1.5, SKY));
            label(&painter, egui::pos2(beside, to.y + 4.0), &format!("{gap:.1} mm"), SKY);
        }
    }
    if let Some(at) = on_screen(tip).filter(|_| pressed && panel.force_n > 0.0) {
        let edge = on_screen(tip + radius_mm * around.view.right).map_or(0.0, |edge| edge.x - at.x);
        pressure(&painter, at + egui::vec2(edge.max(0.0) + BESIDE, 0.0), panel);
    }
}

/// The force at the tip as a bar with its value.
fn pressure(painter: &egui::Painter, at: Pos2, panel: &Panel) {
    let share = (panel.force_n / panel.force_limit_n.max(1e-3)).clamp(0.0, 1.0);
    let colour = if share > HIGH[1] {
        VERMILION
    } else if share > HIGH[0] {
        ORANGE
    } else {
        GREEN
    };
    let frame = Rect::from_min_size(at + egui::vec2(0.0, -36.0), egui::vec2(10.0, 72.0));
    painter.rect_filled(frame, 2.0, Color32::from_black_alpha(170));
    let filled = Rect::from_min_max(egui::pos2(frame.left(), frame.bottom() - share * frame.height()), frame.max);
    painter.rect_filled(filled, 2.0, colour);
    label(painter, frame.right_center() + egui::vec2(6.0, -8.0), &format!("{:.2} N", panel.force_n), colour);
}

fn label(painter: &egui::Painter, at: Pos2, text: &str, colour: Color32) {
    let galley = painter.layout_no_wrap(text.into(), FontId::proportional(15.0), colour);
    let back = Rect::from_min_size(at, galley.size()).expand(3.0);
    painter.rect_filled(back, 3.0, Color32::from_black_alpha(170));
    painter.text(at, Align2::LEFT_TOP, text, FontId::proportional(15.0), colour);
}

/// Place of a world point on the screen; `None` behind the eye.
fn place(view: &View, area: Rect, point: Vec3) -> Option<Pos2> {
    let (at, depth) = view.project(point);
    let at = egui::vec2(0.5 + 0.5 * at.x, 0.5 - 0.5 * at.y) * area.size();
    (depth > 1.0).then(|| area.min + at)
}
