//! The main thread of a session with a window: newest state in, what the user does out.
//!
//! # Practice
//! The window never waits for a loop and no loop waits for it. With the mouse as a device the pose goes to the haptic loop, which
//! reads it at its own rate; closing the window ends the session.

use crate::case::scene::Scene;
use crate::program::{Phase, Program, called};
use crate::report::page::Shot;
use crate::run::stop::Stop;
use crate::run::{Eyes, View};
use crate::show::picture::{Album, camera, frame, snap};
use crate::stages::notice::Warning;
use std::path::Path;
use trepan_geometry::{Buttons, Vec3};
use trepan_haptics::mouse::MouseHandle;
use trepan_render::window::{self, Leash, Panel, Start, WindowInput};
use trepan_render::{Camera, Frame, Painter};

/// How far a mouse may press past a surface, mm: a little over what the device's largest force stands for at 2 N/mm.
const LEASH_MM: f32 = 2.0;

/// Whether a window can be opened here.
pub fn has_display() -> bool {
    window::display().is_ok()
}

/// What the window shows and drives.
struct Show {
    eyes: Eyes,
    view: View,
    positions: Vec<Vec3>,
    bone_shown: bool,
    pointer: Option<MouseHandle>,
    next_until_s: f64,
    undo_until_s: f64,
    rate: Rate,
    stop: Stop,
}

/// Ticks a second, measured over about a second.
#[derive(Default)]
struct Rate {
    since: (f64, u64),
    hz: f64,
}

impl Rate {
    fn follow(&mut self, time_ms: f64, ticks: u64) -> f64 {
        if time_ms - self.since.0 >= 1000.0 {
            self.hz = (ticks - self.since.1) as f64 / (time_ms - self.since.0) * 1e3;
            self.since = (time_ms, ticks);
        }
        self.hz
    }
}

/// Shows the session until it ends or the window is closed.
pub fn show(
    mut eyes: Eyes,
    mut painter: Painter,
    scene: &Scene,
    program: Program,
    pointer: Option<MouseHandle>,
    folder: &Path,
    stop: &Stop,
) -> Album {
    let mut album = Album::default();
    let view = *eyes.view.latest().0;
    let eye = camera(&scene.site);
    let bone_shown = scene.bone.is_some() && program.has_bone();
    album.add(shot(&mut painter, &frame(eye, &view, None, bone_shown), folder, "before"));
    let start = Start::with(eye, view.sample.state.world_from_tool);
    let (positions, rate) = (Vec::new(), Rate::default());
    let show = Show {
        eyes,
        view,
        positions,
        bone_shown,
        pointer,
        next_until_s: 0.0,
        undo_until_s: 0.0,
        rate,
        stop: stop.clone(),
    };
    let closed = window::run(&format!("Trepan {}", program.name()), painter, show, start);
    stop.ask();
    let (mut painter, show) = (closed.renderer, closed.session);
    album.add(shot(&mut painter, &window::Session::frame(&show, eye), folder, "after"));
    if let Err(fault) = closed.result {
        tracing::error!("{fault}");
        album.faults.push(fault.to_string());
    }
    album
}

fn shot(painter: &mut Painter, frame: &Frame<'_>, folder: &Path, caption: &str) -> Result<Shot, String> {
    let (image, _) = painter.picture(frame).map_err(|fault| fault.to_string())?;
    snap(&image, folder, caption)
}

impl window::Session for Show {
    fn update(&mut self, input: &WindowInput) -> Panel {
        self.view = *self.eyes.view.latest().0;
        if let Some(soft) = &mut self.eyes.soft {
            self.positions.clone_from(&soft.latest().0.positions);
        }
        self.pass_on(input);
        let view = &self.view;
        let [ticks, late, held] = view.counts;
        let rate_hz = self.rate.follow(view.time_ms, ticks);
        let value = |name: &str, value: String| (name.to_string(), value);
        Panel {
            phase: view.sample.phase().name().into(),
            hint: hint(view.sample.phase(), self.pointer.is_some()).into(),
            tool: called(&view.sample.tool),
            drilling: view.sample.drilling,
            force_n: view.force.length(),
            force_limit_n: view.force_limit_n,
            values: [
                value("haptic rate", format!("{rate_hz:.0} Hz")),
                value("late / held ticks", format!("{late} / {held}")),
                value("depth in bone", format!("{:.2} mm", view.depth_mm[0])),
                value("depth in tissue", format!("{:.2} mm", view.depth_mm[1])),
                value("tool to brain", format!("{:.1} mm", view.brain_distance_mm)),
                value("bone removed", format!("{:.0} mm³", view.removed_mm3)),
                value("time", format!("{:.1} s", view.time_ms * 1e-3)),
            ]
            .into_iter()
            .chain(view.second.map(|second| value("second hand", format!("{:.2} N", second.force.length()))))
            .collect(),
            warnings: warnings(view.warnings),
            leash: self.pointer.as_ref().map(|_| Leash { tip: view.sample.state.tip(), length_mm: LEASH_MM }),
            finished: view.finished || self.stop.asked(),
        }
    }

    fn frame(&self, camera: Camera) -> Frame<'_> {
        let positions = Some(self.positions.as_slice()).filter(|p| !p.is_empty());
        frame(camera, &self.view, positions, self.bone_shown)
    }
}

impl Show {
    /// The user's hand for the haptic loop. A request is held for a tenth of a second, so that no tick misses it.
    fn pass_on(&mut self, input: &WindowInput) {
        let Some(pointer) = &mut self.pointer else { return };
        if input.next_tool {
            self.next_until_s = input.seconds + 0.1;
        }
        if input.undo {
            self.undo_until_s = input.seconds + 0.1;
        }
        let pedal = if input.pedal { Buttons::PEDAL.0 } else { 0 };
        let next = if input.seconds < self.next_until_s { Buttons::NEXT_TOOL.0 } else { 0 };
        let undo = if input.seconds < self.undo_until_s { Buttons::UNDO.0 } else { 0 };
        pointer.set(input.world_from_tool, Buttons(pedal | next | undo));
    }
}

fn warnings(bits: u32) -> Vec<String> {
    let standing = Warning::ALL.iter().enumerate().filter(|(at, _)| bits & (1 << at) != 0);
    standing.map(|(_, warning)| warning.text().to_string()).collect()
}

fn hint(phase: Phase, mouse: bool) -> &'static str {
    match (phase, mouse) {
        (_, false) => "the operation runs by itself",
        (Phase::Craniotomy, true) => {
            "drag the burr to the skull, hold Space to drill, turn the wheel to push; U undoes the last stroke, N takes the probe"
        }
        (Phase::Brain, true) => "press the probe on the brain: drag it, turn the wheel to push",
    }
}
