//! Player of a recorded session in the window: run, pause, seek.
//!
//! # Practice
//! Pose, tool, forces and depths are those of the recorded tick, at any time at once. Skull and
//! brain are the session's film ([`trepan_runtime::film`]), read from its file or made while it is
//! shown; then the window says how far it is. Seeking writes the voxels and nodes that changed
//! in between, some 20 ns each, at most [`MAX_VOXELS`] per picture: a longer jump takes more.
//! The brain's nodes are interpolated between the shots that hold them; resected tetrahedra come
//! back.

use crate::show::notice_text::NEWS_MS;
use crate::show::picture::{Album, Shape};
use crate::show::window::{self, SessionView, ViewState};
use std::sync::Arc;
use std::sync::mpsc::Receiver;
use trepan_bone::BoneVolume;
use trepan_geometry::Vec3;
use trepan_link::Recording;
use trepan_link::wire::{EventRecord, SecondRecord};
use trepan_render::{Camera, Frame, Image, Painter};
use trepan_report::printable::capital;
use trepan_runtime::film::{Shot, position, split_rest};
use trepan_runtime::lockstep::up_to;
use trepan_runtime::stop::Stop;
use trepan_runtime::{View, arms};
use trepan_stages::program::Program;
use trepan_stages::second_hand::{SecondHand, SecondView};
use trepan_window::{Capture, Mark, Panel, Playback, Session, Timeline, WindowInput};

/// Largest number of voxels and nodes written per picture: some 10 ms.
const MAX_VOXELS: usize = 500_000;
/// Time by which the film may be behind without a word, s.
const BEHIND_S: f64 = 0.2;
/// Kinds of events without marks on the time bar: they come many times a second.
const STREAMED: [&str; 1] = ["score"];

/// Hint for a replay.
const HINT: &str = "a recorded session: Space runs it, the bar goes to any time";

/// The film and its present shot.
struct Film {
    shots: Vec<Shot>,
    coming: Receiver<Shot>,
    bone: Option<Arc<BoneVolume>>,
    /// Index of the present shot.
    at: usize,
    /// Positions of the brain's nodes at rest, mm.
    rest: Vec<Vec3>,
    brain: Shape,
}

impl Film {
    fn time_ms(&self, shot: usize) -> f64 {
        self.shots.get(shot).map_or(0.0, |shot| shot.view.time_ms)
    }

    /// Returns the time up to which the film is made, ms.
    fn ready_ms(&self) -> f64 {
        self.time_ms(self.shots.len().saturating_sub(1))
    }

    /// Takes the shots made since the last picture.
    fn grow(&mut self) {
        self.shots.extend(self.coming.try_iter());
    }

    /// Moves to the last shot up to a time, ms, by at most [`MAX_VOXELS`] voxels.
    fn go_to(&mut self, time_ms: f64) {
        let target = self.shots.partition_point(|shot| shot.view.time_ms <= time_ms).saturating_sub(1);
        let mut written = 0;
        while self.at < target && written < MAX_VOXELS {
            self.at += 1;
            written += self.write(self.at, true);
        }
        while self.at > target && written < MAX_VOXELS {
            written += self.write(self.at, false);
            self.at -= 1;
        }
        self.place_brain();
    }

    /// Writes the changes of a shot into skull and brain; returns their number in the skull.
    fn write(&mut self, shot: usize, forwards: bool) -> usize {
        let Some(shot) = self.shots.get(shot) else { return 0 };
        for tet in shot.gone.iter().map(|tet| *tet as usize) {
            self.brain.gone.resize(self.brain.gone.len().max(tet + 1), false);
            self.brain.fills.resize(self.brain.gone.len(), u16::MAX);
            (self.brain.gone[tet], self.brain.fills[tet]) = (forwards, if forwards { 0 } else { u16::MAX });
        }
        if forwards {
            self.brain.splits.extend(&shot.splits);
            split_rest(&mut self.rest, &shot.splits);
        } else if let Some(first) = shot.splits.first() {
            self.brain.splits.truncate(self.brain.splits.len() - shot.splits.len());
            self.rest.truncate(first.node as usize);
        }
        self.bone.as_ref().map_or(0, |bone| shot.write(bone, forwards))
    }

    /// Interpolates the brain's nodes between the nearest shots that hold them.
    fn place_brain(&mut self) {
        let kept = |(at, shot): (usize, &Shot)| shot.nodes.is_some().then_some(at);
        let before = self.shots.iter().enumerate().take(self.at + 1).rev().find_map(kept);
        let after = self.shots.iter().enumerate().skip(self.at + 1).find_map(kept);
        let nodes = |at: usize| self.shots.get(at).and_then(|shot| shot.nodes.as_ref());
        let Some(from) = before.and_then(nodes).filter(|from| from.len() == self.rest.len()) else { return };
        let (to, share) = match (before, after, after.and_then(nodes)) {
            (Some(before), Some(after), Some(to)) => {
                let span_ms = self.time_ms(after) - self.time_ms(before);
                (to, ((self.time_ms(self.at) - self.time_ms(before)) / span_ms.max(1e-9)) as f32)
            }
            _ => (from, 0.0),
        };
        let node = |(rest, (from, to)): (&Vec3, (&[i16; 3], &[i16; 3]))| {
            position(*rest, *from).lerp(position(*rest, *to), share)
        };
        self.brain.positions.clear();
        self.brain.positions.extend(self.rest.iter().zip(from.iter().zip(to)).map(node));
    }
}

/// A replay in the window.
struct Player {
    film: Film,
    timeline: Timeline,
    now_s: Option<f64>,
    first: View,
    recording: Arc<Recording>,
    /// What an arm holds, from times on, ms.
    arms: Vec<(f64, Option<SecondView>)>,
    program: Program,
    shown: ViewState,
    hint: String,
    /// Time at which the window closes, s.
    until_s: f64,
}

/// Shows a replay until the window is closed, or for `until_s`.
pub(crate) fn show(
    first: View,
    coming: Receiver<Shot>,
    painter: Painter,
    opened: &SessionView<'_>,
    recording: &Arc<Recording>,
    until_s: f64,
    stop: &Stop,
) -> Album {
    let bone = opened.table.scene.bone.clone().filter(|_| opened.table.program.has_bone());
    let rest = opened.table.scene.brain.as_ref().map(|brain| brain.mesh.positions.clone()).unwrap_or_default();
    let player = Player {
        timeline: timeline(recording, until_s),
        now_s: None,
        first,
        recording: recording.clone(),
        arms: arms(&recording.ticks, opened.table.program.tray()),
        program: opened.table.program,
        shown: ViewState::of(opened, bone.is_some(), stop),
        hint: recording.losses().map_or_else(|| HINT.into(), |losses| format!("not a whole recording: {losses}")),
        until_s,
        film: Film { shots: Vec::new(), coming, bone, at: 0, rest, brain: Shape::default() },
    };
    let (player, album) = window::run(player, painter, opened, first);
    player.shown.finish(album)
}

/// Makes the timeline of a recording up to a time, s, with its events as marks.
fn timeline(recording: &Recording, until_s: f64) -> Timeline {
    let marked =
        recording.events.iter().filter(|event| event.kind != "cleared" && !STREAMED.contains(&event.kind.as_str()));
    let mark = |event: &EventRecord| Mark {
        at_s: event.time_ms * 1e-3,
        text: event.text.clone(),
        warning: event.kind == "warning",
    };
    let length_s = up_to(recording, 1e3 * until_s).last().map_or(0.0, |tick| tick.time_ms * 1e-3);
    let marks = marked.map(mark).filter(|mark| mark.at_s <= until_s).collect();
    Timeline { at_s: 0.0, length_s, ready_s: 0.0, running: true, speed: 1.0, marks }
}

/// Applies the user's input, then advances by the time since the last picture, s.
fn advance(timeline: &mut Timeline, input: Option<Playback>, passed_s: f64) {
    match input {
        Some(Playback::Run(running)) => {
            timeline.running = running;
            if running && timeline.at_s >= timeline.length_s {
                timeline.at_s = 0.0;
            }
        }
        Some(Playback::Speed(speed)) => timeline.speed = speed,
        Some(Playback::Seek(at_s)) => timeline.at_s = at_s.clamp(0.0, timeline.length_s),
        None => {}
    }
    if timeline.running {
        // Playing does not run past the part of the film that is made.
        let next_s = (timeline.at_s + passed_s * f64::from(timeline.speed)).min(timeline.ready_s);
        timeline.at_s = timeline.at_s.max(next_s);
        timeline.running = timeline.at_s < timeline.length_s;
    }
}

impl Session for Player {
    fn update(&mut self, input: &WindowInput) -> Panel {
        self.film.grow();
        self.timeline.ready_s = self.film.ready_ms() * 1e-3;
        let passed_s = input.seconds - self.now_s.replace(input.seconds).unwrap_or(input.seconds);
        advance(&mut self.timeline, input.playback, passed_s);
        self.film.go_to(self.timeline.at_s * 1e3);
        let mut panel = self.shown.panel(&self.view(), &self.film.brain, false);
        panel.news.extend(self.news());
        let finished = self.shown.stop.asked() || input.seconds > self.until_s;
        Panel { hint: self.hint.clone(), timeline: Some(self.timeline.clone()), finished, ..panel }
    }

    fn frame(&self, camera: Camera) -> Frame<'_> {
        self.shown.frame(camera, &self.view(), &self.film.brain)
    }

    fn capture(&mut self, what: Capture, picture: Image) {
        self.shown.keep(what, picture);
    }
}

impl Player {
    /// What the recorded tick felt, over the skull and the brain of the film.
    fn view(&self) -> View {
        let of_film = self.film.shots.get(self.film.at).map_or(self.first, |shot| shot.view);
        let (ticks, at_ms) = (&self.recording.ticks, 1e3 * self.timeline.at_s);
        let tick = ticks.partition_point(|tick| tick.time_ms <= at_ms).checked_sub(1).and_then(|at| ticks.get(at));
        let view = tick.map_or(of_film, |tick| View { news: None, ..of_film.on(tick, self.program) });
        let seconds = &self.recording.second;
        let second =
            seconds.partition_point(|tick| tick.time_ms <= at_ms).checked_sub(1).and_then(|at| seconds.get(at));
        let held = |tick: &SecondRecord| SecondView {
            tool: SecondHand::tool(),
            world_from_tool: tick.proxy,
            force: tick.wrench.force,
        };
        let arm = self.arms.partition_point(|(from_ms, _)| *from_ms <= at_ms).checked_sub(1);
        let in_arm = arm.and_then(|at| self.arms[at].1);
        View { second: second.map(held).or(in_arm).or(view.second), ..view }
    }

    /// The newest event while it is recent, and how far the film is if it is behind.
    fn news(&self) -> Vec<String> {
        let Timeline { at_s, ready_s, length_s, .. } = self.timeline;
        let events = self.recording.events.iter();
        let is_shown = |event: &&EventRecord| {
            let age_ms = 1e3 * at_s - event.time_ms;
            (0.0..NEWS_MS).contains(&age_ms) && !["warning", "cleared"].contains(&&*event.kind)
        };
        let event = events.filter(|event| !STREAMED.contains(&&*event.kind)).rfind(is_shown);
        let behind = at_s > ready_s + BEHIND_S;
        let behind = behind.then(|| format!("skull and brain are computed: {ready_s:.0} s of {length_s:.0} s"));
        behind.into_iter().chain(event.map(|event| capital(&event.text))).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::IVec3;
    use std::sync::mpsc::channel;
    use trepan_geometry::{Pose, ToolState};
    use trepan_link::SceneChange;
    use trepan_link::wire::TickRecord;
    use trepan_mesh::Split;
    use trepan_runtime::film::displacements;
    use trepan_stages::haptic_tick::ToolSample;
    use trepan_volume::VoxelVolume;

    /// View of a tool at the origin.
    fn view(time_ms: f64) -> View {
        let tool = Program::Craniotomy.tray()[0];
        let sample = ToolSample {
            tick: 0,
            state: ToolState::at(Pose::IDENTITY),
            tool,
            slot: 0,
            drilling: false,
            second: None,
            idle: false,
        };
        View { time_ms, ..View::at(sample, 1.0) }
    }

    /// Makes a film of `count` shots, 10 ms apart. Shot n removes voxel n; every other shot holds
    /// the brain's nodes.
    fn film(count: usize) -> Film {
        let bone = VoxelVolume::isotropic([40, 40, 4], Vec3::ZERO, 1.0, 900i16);
        let bone = Some(Arc::new(BoneVolume::new(&bone, 400).unwrap()));
        let (sender, coming) = channel();
        for n in 0..count {
            let at = [n % 40, n / 40, 1].map(|n| n as u16);
            let voxels = vec![SceneChange { at, before: 900, after: -1000 }];
            let many = if n < 100 { 1 } else { 2 };
            let nodes = displacements(&vec![Vec3::X * 0.25 * n as f32; many], &[Vec3::ZERO; 2]);
            let nodes = (n % 2 == 0).then_some(nodes);
            let gone = vec![n as u32];
            let splits = (n == 100).then_some(Split { corner: 0, from: 0, node: 1 }).into_iter().collect();
            sender.send(Shot { view: view(10.0 * n as f64), voxels, cuts: Vec::new(), nodes, gone, splits }).unwrap();
        }
        let (shots, rest, brain) = (Vec::new(), vec![Vec3::ZERO], Shape::default());
        let mut film = Film { shots, coming, bone, at: 0, rest, brain };
        film.grow();
        film.write(0, true);
        film
    }

    #[test]
    fn seeking_restores_skull_and_brain_at_any_time() {
        let mut film = film(200);
        let bone = film.bone.clone().unwrap();
        let gone = || (0..200).filter(|n| !bone.is_bone(IVec3::new(n % 40, n / 40, 1))).count();
        for (time_ms, shot) in [(995.0, 99), (0.0, 0), (1990.0, 199), (501.0, 50), (500.0, 50), (-5.0, 0), (1e9, 199)] {
            film.go_to(time_ms);
            assert_eq!((film.at, gone()), (shot, shot + 1), "at {time_ms} ms");
            let cut = usize::from(shot >= 100);
            assert_eq!([film.brain.splits.len(), film.brain.positions.len()], [cut, 1 + cut], "at {time_ms} ms");
            assert_eq!(film.brain.gone.iter().filter(|gone| **gone).count(), shot + 1, "resected, at {time_ms} ms");
            assert!(
                (4.0 * film.brain.positions[0].x - shot as f32).abs() < 1.0 + 1e-3,
                "{}",
                film.brain.positions[0].x
            );
        }
        film.go_to(510.0);
        assert_eq!(4.0 * film.brain.positions[0].x, 51.0, "between the brains of shots 50 and 52");
    }

    #[test]
    fn time_runs_waits_for_the_film_and_stops_at_its_end() {
        let marks = [].into();
        let mut t = Timeline { at_s: 0.0, length_s: 10.0, ready_s: 1.0, running: true, speed: 2.0, marks };
        advance(&mut t, None, 0.25);
        assert_eq!(t.at_s, 0.5);
        advance(&mut t, None, 1.0);
        assert_eq!((t.at_s, t.running), (1.0, true));
        t.ready_s = 10.0;
        advance(&mut t, Some(Playback::Seek(20.0)), 0.0);
        assert_eq!((t.at_s, t.running), (10.0, false));
        advance(&mut t, Some(Playback::Run(true)), 0.5);
        assert_eq!((t.at_s, t.running), (1.0, true), "from the start again");
        advance(&mut t, Some(Playback::Run(false)), 0.5);
        advance(&mut t, Some(Playback::Speed(0.25)), 0.5);
        assert_eq!((t.at_s, t.speed), (1.0, 0.25));
    }

    #[test]
    fn marks_are_events_without_streamed_ones() {
        let event = |kind: &str, text: &str| EventRecord {
            kind: kind.into(),
            text: text.into(),
            time_ms: 1500.0,
            ..Default::default()
        };
        let events =
            vec![event("score", "{}"), event("warning", "near"), event("cleared", "near"), event("phase", "brain")];
        let tick = |time_ms| TickRecord { time_ms, ..TickRecord::default() };
        let recording =
            Recording { events, ticks: vec![tick(500.0), tick(1000.0), tick(3000.0)], ..Recording::default() };
        assert_eq!((timeline(&recording, 1.0).length_s, timeline(&recording, 1.0).marks.len()), (1.0, 0));
        let marks = timeline(&recording, f64::INFINITY).marks;
        let texts: Vec<_> = marks.iter().map(|mark| (mark.text.as_str(), mark.warning, mark.at_s)).collect();
        assert_eq!(texts, [("near", true, 1.5), ("brain", false, 1.5)]);
    }
}
