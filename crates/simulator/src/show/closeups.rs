//! Sharp pictures for the report: the opening at the end, and the tool at the faults.
//!
//! # Practice
//! Bone and wound are drawn as they are at the end of the session, the brain's shape as at rest:
//! none is kept for the time of a fault, the tool's pose is. Each picture takes up to a second on a
//! processor.

use crate::error::SessionError;
use crate::session_setup::SessionSetup;
use crate::show::picture::{leaves, microscope, snap};
use std::path::Path;
use trepan_geometry::Vec3;
use trepan_link::Recording;
use trepan_link::wire::{EventRecord, TickRecord};
use trepan_render::{Camera, Frame, Painter, SliceLook};
use trepan_report::page::Shot;
use trepan_runtime::SolverOutcome;

/// Field of view, which shows 35 mm from 250 mm, rad.
const CLOSE_RAD: f32 = 0.14;
/// Most pictures of faults.
const MOST_FAULTS: usize = 4;
/// Faults by the beginning of their text, the gravest first; others come after them.
const GRAVE: [&str; 4] = ["brain-touched", "brain-pressed", "forbidden-near", "break-through"];

impl SessionSetup {
    /// Draws the opening, and the tool at the first warning of each kind, the gravest kinds. The
    /// wound is that of the end: its blood, its dura, and no tetrahedra of which nothing is left.
    pub fn close_pictures(
        &self,
        painter: &mut Painter,
        recording: &Recording,
        end: &SolverOutcome,
        folder: &Path,
    ) -> Vec<Result<Shot, SessionError>> {
        let shown = self.program.has_bone();
        let gone: Vec<bool> = end.fills.iter().map(|fill| *fill == 0).collect();
        let plain = |camera: Camera| Frame {
            show_bone: shown,
            brain_gone: Some(&gone[..]).filter(|gone| !gone.is_empty()),
            brain_splits: &end.splits,
            brain_stains: Some(&end.wound.bleeding.stains[..]).filter(|stains| !stains.is_empty()),
            dura: leaves(&end.wound.dura),
            slices: SliceLook { shown: false, ..SliceLook::default() },
            ..Frame::of(camera)
        };
        let above = Camera { fov_rad: CLOSE_RAD + self.plan.flap_mm / 125.0, ..microscope(&self.plan.site) };
        let mut draw = |caption: &str, frame: Frame| {
            painter.picture(&frame)?;
            while painter.refine(&frame)? {}
            snap(&painter.image()?, folder, caption)
        };
        let caption = if shown { "the opening: from 25 cm, at the end" } else { "the brain: from 25 cm, at rest" };
        let opening = draw(caption, plain(above));
        let mut all = vec![opening];
        for (number, (event, tick)) in faults(recording).into_iter().enumerate() {
            let Some(&tool) = self.program.tray().get(usize::from(tick.tool)) else { continue };
            let frame =
                Frame { tool: Some(tool), world_from_tool: tick.proxy, ..plain(beside(tick, -self.plan.site.inward)) };
            let seconds = 1e-3 * event.time_ms;
            let caption =
                format!("fault {}: {}, at {seconds:.1} s; bone as at the end, brain at rest", number + 1, event.text);
            all.push(draw(&caption, frame));
        }
        all
    }
}

/// Camera on the tool's tip, from outside and beside its shaft.
fn beside(tick: &TickRecord, outward: Vec3) -> Camera {
    let shaft = tick.proxy.rotation * Vec3::Z;
    let side = shaft.cross(outward).try_normalize().unwrap_or_else(|| shaft.any_orthonormal_vector());
    Camera { fov_rad: CLOSE_RAD, ..Camera::viewed_from(tick.proxy.translation, outward + 0.6 * side, 250.0) }
}

/// The first warning of each kind with its tick, the gravest kinds.
fn faults(recording: &Recording) -> Vec<(&EventRecord, &TickRecord)> {
    let kind = |event: &EventRecord| event.text.split(':').next().unwrap_or_default().to_string();
    let mut first: Vec<&EventRecord> = Vec::new();
    for event in recording.events.iter().filter(|event| event.kind == "warning") {
        if !first.iter().any(|known| kind(known) == kind(event)) {
            first.push(event);
        }
    }
    let rank = |event: &&EventRecord| GRAVE.iter().position(|name| event.text.starts_with(name)).unwrap_or(GRAVE.len());
    first.retain(|event| rank(event) < GRAVE.len());
    first.sort_by_key(rank);
    first.truncate(MOST_FAULTS);
    let tick = |event: &EventRecord| {
        let at = recording.ticks.partition_point(|tick| tick.time_ms < event.time_ms);
        recording.ticks.get(at).or(recording.ticks.last())
    };
    first.into_iter().filter_map(|event| Some((event, tick(event)?))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_gravest_faults_come_first_with_the_tool_as_it_was() {
        let event = |time_ms: f64, kind: &str, text: &str| EventRecord {
            time_ms,
            kind: kind.into(),
            text: text.into(),
            ..EventRecord::default()
        };
        let tick = |n: u32| TickRecord { tick: n.into(), time_ms: f64::from(n), ..TickRecord::default() };
        let recording = Recording {
            ticks: (0..100).map(tick).collect(),
            events: vec![
                event(5.0, "warning", "break-through: soon"),
                event(6.0, "cleared", "brain-touched: over"),
                event(20.0, "warning", "brain-touched: 0.3 mm"),
                event(30.0, "warning", "brain-touched: 2 mm"),
                event(40.0, "warning", "force-limit: at the limit"),
            ],
            ..Recording::default()
        };
        let found: Vec<_> = faults(&recording).into_iter().map(|(event, tick)| (event.time_ms, tick.tick)).collect();
        assert_eq!(found, [(20.0, 20), (5.0, 5)]);
    }
}
