//! The main thread of a headless run: renders pictures of the newest state with the same code as
//! the window.

use crate::SessionError;
use crate::session_setup::SessionSetup;
use crate::show::colours::Colours;
use std::path::{Path, PathBuf};
use std::time::Duration;
use trepan_geometry::Vec3;
use trepan_haptics::script::Site;
use trepan_mesh::Split;
use trepan_patient::opening::eye;
use trepan_render::{Camera, Frame, Image, Leaves, Overlay, Painter, SliceLook};
use trepan_report::page::Shot;
use trepan_report::summary::MovingSummary;
use trepan_runtime::clock::Clock;
use trepan_runtime::stop::Stop;
use trepan_runtime::{RenderInputs, Times, View};
use trepan_stages::DuraState;
use trepan_stages::collision_step::SoftFrame;
use trepan_stages::collision_step::Wound;
use trepan_window::Pace;

/// Half the height of a slice's view around the tool, mm.
const SLICE_MM: f32 = 60.0;
/// Force under which no arrow is drawn, N.
const FELT_N: f32 = 0.05;
/// Length of the arrow, mm per N.
const MM_PER_N: f32 = 12.0;
/// Pictures in the report, besides the first and the last.
const SHOTS_BETWEEN: usize = 4;

/// Results of rendering.
#[derive(Debug, Default)]
pub(crate) struct Album {
    /// The painter, for further pictures.
    pub painter: Option<Painter>,
    /// Pictures rendered.
    pub frames: u64,
    /// Time in which they were rendered, s.
    pub seconds: f64,
    /// Those of a window in which something moved.
    pub moving: Moving,
    /// Pictures for the report.
    pub shots: Vec<Shot>,
    /// Faults of rendering.
    pub faults: Vec<String>,
}

/// Intervals and detail of the pictures in which something moved.
#[derive(Clone, Debug, Default)]
pub(crate) struct Moving {
    frames: u64,
    intervals: Times,
    details: f64,
}

impl Moving {
    /// Adds a picture.
    pub fn add(&mut self, pace: &Pace) {
        self.frames += 1;
        self.intervals.add_us(1e6 * pace.interval_s as f32);
        self.details += f64::from(pace.detail);
    }

    /// Returns the summary; `None` without pictures.
    pub fn summary(&self) -> Option<MovingSummary> {
        let Self { frames, intervals, details } = self;
        let mean_detail = details / *frames as f64;
        (*frames > 0).then(|| MovingSummary { frames: *frames, interval_us: intervals.into(), mean_detail })
    }
}

impl Album {
    /// Adds a picture or its fault.
    pub fn add(&mut self, shot: Result<Shot, SessionError>) {
        match shot {
            Ok(shot) => {
                self.frames += 1;
                self.shots.push(shot);
            }
            Err(fault) => self.faults.push(format!("a picture failed: {fault}")),
        }
    }
}

/// The brain as a picture shows it.
#[derive(Default)]
pub(crate) struct Shape {
    /// Its nodes, mm; empty while it is at rest.
    pub positions: Vec<Vec3>,
    /// What is left of its tetrahedra, of 65535, and which are gone; empty where none can go.
    pub fills: Vec<u16>,
    pub gone: Vec<bool>,
    /// Splits of its nodes.
    pub splits: Vec<Split>,
    /// Its wound.
    pub wound: Wound,
}

impl Shape {
    /// Takes what solver and collision published.
    pub fn follow(&mut self, inputs: &mut RenderInputs) {
        inputs.soft.iter_mut().for_each(|soft| self.take(soft.latest().0));
        inputs.wound.iter_mut().for_each(|wound| self.wound.copy_from(wound.latest().0));
    }

    /// Takes what the solver published.
    pub fn take(&mut self, soft: &SoftFrame) {
        self.positions.clone_from(&soft.positions);
        self.fills.clone_from(&soft.fills);
        if self.splits.len() != soft.splits.len() {
            self.splits.clone_from(&soft.splits);
        }
        self.gone.clear();
        self.gone.extend(soft.fills.iter().map(|fill| *fill == 0));
    }
}

/// Returns the default camera on the site.
pub(crate) fn camera(site: &Site) -> Camera {
    Camera::viewed_from(site.entry, eye(site), 170.0)
}

/// Width of the first view of a window, mm, and its distance that gives it in a picture as high as
/// wide.
const FIRST_WIDE_MM: f32 = 80.0;

/// Returns the first camera of a window: down the approach, close enough for the opening to fill
/// the view. It is inclined as the microscope is.
pub(crate) fn first_view(site: &Site) -> Camera {
    let scope = microscope(site);
    let fov_rad = camera(site).fov_rad;
    Camera { fov_rad, distance_mm: 0.5 * FIRST_WIDE_MM / (0.5 * fov_rad).tan(), ..scope }
}

/// Returns the camera of the microscope: 250 mm from the site, with a field of some 50 mm. It is
/// inclined by 15 degrees, so that a tool along the approach does not hide its tip.
pub(crate) fn microscope(site: &Site) -> Camera {
    let outward = -site.inward;
    let side = outward.cross(Vec3::Z).normalize_or(Vec3::X);
    Camera { fov_rad: 0.2, ..Camera::viewed_from(site.entry, outward + 0.27 * side, 250.0) }
}

/// Returns a frame of a state.
pub(crate) fn frame<'a>(
    camera: Camera,
    view: &View,
    brain: &'a Shape,
    bone_shown: bool,
    colours: &'a Colours,
) -> Frame<'a> {
    Frame {
        bone_paint: colours.bone.as_ref(),
        brain_paint: colours.brain.as_ref(),
        tool: Some(view.sample.tool),
        world_from_tool: view.sample.state.world_from_tool,
        second: view.second.map(|second| (second.tool, second.world_from_tool)),
        turn_rad: if view.sample.drilling { view.time_ms as f32 * 0.7 } else { 0.0 },
        drilling: view.sample.drilling,
        overlay: Overlay { force: arrow(view), ..Overlay::default() },
        brain_positions: Some(&brain.positions[..]).filter(|positions| !positions.is_empty()),
        brain_splits: &brain.splits,
        brain_gone: Some(&brain.gone[..]).filter(|gone| !gone.is_empty()),
        brain_stains: Some(&brain.wound.bleeding.stains[..]).filter(|stains| !stains.is_empty()),
        dura: leaves(&brain.wound.dura),
        show_bone: bone_shown,
        slices: SliceLook { half_height_mm: Some(SLICE_MM), ..SliceLook::default() },
        ..Frame::of(camera)
    }
}

/// The dura as it lies; `None` without one.
pub(super) fn leaves(dura: &DuraState) -> Option<Leaves<'_>> {
    let DuraState { rest, places, triangles, .. } = dura;
    (!triangles.is_empty()).then_some(Leaves { rest, places, triangles })
}

/// Returns the arrow of the force on the hand at the tool's tip; `None` for a weak force.
fn arrow(view: &View) -> Option<[Vec3; 2]> {
    let tip = view.sample.state.tip();
    (view.force.length() > FELT_N).then(|| [tip, tip + MM_PER_N * view.force])
}

/// Waits for the end without rendering.
pub(crate) fn wait(mut inputs: RenderInputs, stop: &Stop) {
    while !stop.asked() && !inputs.view.latest().0.finished {
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// Renders `per_second` pictures a second into `folder` until the end, and one more at the end.
pub(crate) fn draw(
    mut inputs: RenderInputs,
    mut painter: Painter,
    setup: &SessionSetup,
    per_second: f64,
    folder: &Path,
    stop: &Stop,
) -> Album {
    let mut album = Album::default();
    let mut candidates: Vec<(f64, PathBuf)> = Vec::new();
    let clock = Clock::start();
    let (camera, colours, bone_shown) = (camera(&setup.scene.site), setup.colours(), setup.program.has_bone());
    let (mut next_ms, mut brain) = (0.0, Shape::default());
    loop {
        let view = *inputs.view.latest().0;
        let over = view.finished || stop.asked();
        if over || clock.now_ms() >= next_ms {
            next_ms = clock.now_ms().max(next_ms) + 1e3 / per_second.max(1e-3);
            brain.follow(&mut inputs);
            let path = folder.join(format!("frame-{:05}.png", album.frames));
            let drawn = painter.picture(&frame(camera, &view, &brain, bone_shown, &colours));
            match drawn.map_err(SessionError::from).and_then(|(image, _)| write(&image, &path)) {
                Ok(()) => {
                    album.frames += 1;
                    candidates.push((view.time_ms * 1e-3, path));
                }
                Err(fault) => {
                    album.faults.push(format!("the pictures ended: {fault}"));
                    wait(inputs, stop);
                    break;
                }
            }
        }
        if over {
            break;
        }
        std::thread::sleep(Duration::from_millis(5));
    }
    album.seconds = clock.now_ms() * 1e-3;
    album.faults.extend(painter.notice().map(String::from));
    album.shots = chosen(&candidates);
    album.painter = Some(painter);
    album
}

fn write(image: &Image, path: &Path) -> Result<(), SessionError> {
    image.write_png(path).map_err(SessionError::output(path))
}

/// Writes a picture for the report; its file is named after the caption up to a colon.
pub(crate) fn snap(image: &Image, folder: &Path, caption: &str) -> Result<Shot, SessionError> {
    let name = caption.split(':').next().unwrap_or_default().replace(' ', "-");
    let path = folder.join(format!("frame-{name}.png"));
    write(image, &path)?;
    Ok(Shot { caption: caption.into(), png: std::fs::read(&path).map_err(SessionError::output(&path))? })
}

/// Returns the first and the last picture, and some evenly spaced between.
fn chosen(candidates: &[(f64, PathBuf)]) -> Vec<Shot> {
    let last = candidates.len().saturating_sub(1);
    let mut picks: Vec<usize> = (0..=SHOTS_BETWEEN + 1).map(|i| i * last / (SHOTS_BETWEEN + 1)).collect();
    picks.dedup();
    let shot = |&at: &usize| {
        let (seconds, path) = candidates.get(at)?;
        let when = match at {
            0 => "before",
            _ if at == last => "after",
            _ => "during",
        };
        Some(Shot { caption: format!("{when}, at {seconds:.1} s"), png: std::fs::read(path).ok()? })
    };
    picks.iter().filter_map(shot).collect()
}
