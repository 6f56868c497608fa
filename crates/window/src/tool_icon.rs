//! A button with a tool's silhouette, its number key and its name.

use crate::palette::SKY;
use crate::words::tr;
use eframe::egui::{self, Color32, Sense, Stroke, TextStyle, WidgetInfo};
use trepan_geometry::{Tool, ToolKind};

/// Width of the silhouette, points.
const ICON: f32 = 34.0;
/// Height of a button, points.
const HEIGHT: f32 = 26.0;
/// Points per mm of a silhouette.
const SCALE: f32 = 1.6;

/// Shows the button of a tool; returns whether it was clicked. `state`: why it cannot be taken, and
/// whether it is in the hand.
pub(crate) fn show(ui: &mut egui::Ui, tool: &Tool, number: usize, name: &str, state: (Option<&str>, bool)) -> bool {
    let ((why_not, chosen), open) = (state, state.0.is_none());
    let size = egui::vec2(ui.available_width().max(ICON), HEIGHT);
    let sense = if open { Sense::click() } else { Sense::hover() };
    let (area, response) = ui.allocate_exact_size(size, sense);
    let label = format!("{number}  {}", tr(name));
    response.widget_info(|| WidgetInfo::selected(egui::Role::Button, open, chosen, &label));
    let visuals = ui.style().interact_selectable(&response, chosen);
    let ink = if open { visuals.text_color() } else { ui.visuals().weak_text_color() };
    let back = if chosen { SKY } else { visuals.weak_bg_fill };
    let ink = if chosen { Color32::BLACK } else { ink };
    ui.painter().rect_filled(area, visuals.corner_radius, back);
    silhouette(ui.painter(), egui::Rect::from_min_size(area.min, egui::vec2(ICON, HEIGHT)), tool, ink);
    let at = egui::pos2(area.left() + ICON + 4.0, area.center().y);
    let font = TextStyle::Button.resolve(ui.style());
    ui.painter().with_clip_rect(area).text(at, egui::Align2::LEFT_CENTER, label, font, ink);
    let hint = why_not.map_or_else(|| format!("{} ({} {number})", tr(use_of(tool.kind)), tr("key")), tr);
    response.on_hover_text(hint).clicked()
}

fn silhouette(painter: &egui::Painter, area: egui::Rect, tool: &Tool, ink: Color32) {
    let tip = egui::pos2(area.left() + 9.0, area.center().y);
    let end = egui::pos2(area.right() - 2.0, tip.y);
    if tool.kind == ToolKind::Bipolar {
        for apart in [-6.0, 6.0] {
            painter.line_segment([tip, end + egui::vec2(0.0, apart)], Stroke::new(2.0, ink));
        }
        return;
    }
    if tool.kind == ToolKind::Scissors {
        for side in [-1.0, 1.0] {
            let (pivot, ring) = (tip + egui::vec2(13.0, 0.0), end + egui::vec2(-2.0, -5.0 * side));
            painter.line_segment([tip + egui::vec2(0.0, 3.0 * side), pivot], Stroke::new(2.0, ink));
            painter.line_segment([pivot, ring], Stroke::new(1.5, ink));
            painter.circle_stroke(ring, 2.5, Stroke::new(1.5, ink));
        }
        return;
    }
    if tool.kind == ToolKind::Scalpel {
        let blade = vec![tip, tip + egui::vec2(14.0, -4.0), tip + egui::vec2(14.0, 1.0)];
        painter.add(egui::Shape::convex_polygon(blade, ink, Stroke::NONE));
        painter.line_segment([tip + egui::vec2(14.0, -1.5), end], Stroke::new(4.0, ink));
        return;
    }
    painter.line_segment([tip, end], Stroke::new((2.0 * SCALE * tool.shaft_radius_mm).max(2.0), ink));
    painter.circle_filled(tip, (SCALE * tool.tip_radius_mm).max(2.5), ink);
    if tool.cutting_mm > 0.0 {
        let foot = [tip - egui::vec2(0.0, 6.0), tip + egui::vec2(0.0, 6.0)];
        painter.line_segment(foot, Stroke::new(2.5, ink));
    }
}

/// What a kind of tool is for.
fn use_of(kind: ToolKind) -> &'static str {
    match kind {
        ToolKind::Burr => "Drills bone with its ball",
        ToolKind::Perforator => "Drills a burr hole; its clutch lets go at the inner table",
        ToolKind::Craniotome => "Cuts bone with its side, from a burr hole; its foot protects the dura",
        ToolKind::Probe => "Presses the brain",
        ToolKind::Spatula => "Retracts the brain",
        ToolKind::Aspirator => "Takes brain tissue away while its pedal is down",
        ToolKind::Bipolar => "Coagulates bleeding tissue while its pedal is down, and rinses",
        ToolKind::Scalpel => "Incises the dura while its pedal is down",
        ToolKind::Scissors => "Cut the brain each time that the pedal goes down",
    }
}
