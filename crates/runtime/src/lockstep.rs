//! Replays a recorded session: runs the same stages in the recorded order, on one thread.
//!
//! # Theory
//! In a live session three loops run concurrently, and each result depends only on which results of
//! the other loops were read. The recording holds their numbers: for a tick its patch, for a
//! collision step its tick and its solver step, for a solver step its contact. Any order that
//! respects these numbers gives every stage the same inputs, so all results are equal bit for bit:
//!
//! ```text
//! tick t      ← patch p                          collisions up to p first
//! collision c ← tool of tick t, brain of step s  solver up to s first
//! step n      ← contact c                        c came before n's positions were used
//! ```
//!
//! # Practice
//! With other methods, meshes or a GPU solver the same path gives other forces; the outcome holds
//! the largest difference. Steps of another length are matched by simulated time. The replay runs
//! as fast as it can; for a window with a time bar it also makes a film (`run/film.rs`).

use crate::Patches;
use crate::clock::Clock;
use crate::film::{Filming, Shot};
use crate::joining;
use crate::journal::{Journal, JournalSenders, journal};
use crate::{Cells, Numbered, Outcome, RenderInputs, Replayed, Run, SolverOutcome, Stages, Ticks, Times, Tissue, View};
use std::collections::VecDeque;
use std::sync::mpsc::channel;
use std::thread;
use trepan_contact::SurfacePatch;
use trepan_geometry::{Buttons, ToolState, Wrench};
use trepan_haptics::{Reading, Status};
use trepan_link::Recording;
use trepan_link::wire::{CollisionRecord, SecondRecord, SolverRecord, TickRecord};
use trepan_soft::Loads;
use trepan_stages::collision_step::SoftFrame;
use trepan_stages::haptic_tick::{HapticStage, TickInput, ToolSample};
use trepan_stages::second_hand::{SecondHand, SecondView};

/// Number of past tools, patches and loads that are kept for steps that refer to them.
const MEMORY: usize = 16_384;

/// Returns the ticks up to a time, ms, and those right after it in which the force faded out.
pub fn up_to(recording: &Recording, end_ms: f64) -> &[TickRecord] {
    let ticks = &recording.ticks;
    let until = ticks.iter().position(|tick| tick.time_ms >= end_ms).map_or(ticks.len(), |at| at + 1);
    let fading = ticks[until..].iter().take_while(|tick| tick.has(TickRecord::RELEASED)).count();
    &ticks[..until + fading]
}

/// Replays a recording up to a time, ms. Requests a stop at the end, unless a film is made: its
/// window stays open.
pub fn run(
    run: Run<'_>,
    (recording, end_ms): (&Recording, f64),
    film: Option<Filming>,
    picture: impl FnOnce(RenderInputs),
) -> Outcome {
    let Run { stages, start, mut recorder, share, stop, .. } = run;
    let copied = recording.state.as_ref().map_or(Ok(()), |state| recorder.state(state));
    let clock = Clock::start();
    let cells = Cells::new(&stages, start);
    let (senders, receivers) = journal(stages.haptic.force_scale());
    let (sender, shots) = channel::<Shot>();
    let shots = film.is_some().then_some(shots);
    let mut film = film;
    let soft = stages.tissue.is_some().then_some(cells.shown.1);
    let inputs = RenderInputs { view: cells.view.1, soft, wound: Some(cells.wound.1), film: shots };
    thread::scope(|scope| {
        let writing = scope.spawn(move || Journal::write(receivers, recorder, share, clock));
        let (mut view, mut shown, mut wound) = (cells.view.0, cells.shown.0, cells.wound.0);
        let replaying = scope.spawn(move || {
            let mut replay = Replay::new(stages, recording, senders, start);
            let ticks = up_to(recording, end_ms);
            let last = ticks.last().map(|record| record.tick);
            for record in ticks {
                if stop.asked() {
                    break;
                }
                let now = replay.tick(record, &clock);
                view.set(now);
                let solver = replay.tissue.as_ref().map(|tissue| &tissue.solver);
                let brain = || solver.map(|solver| (solver.positions(), solver.fills(), solver.splits()));
                let shot = film.as_mut().and_then(|film| film.tick(now, last == Some(record.tick), brain));
                // Nobody looks any more.
                film.take_if(|_| shot.is_some_and(|shot| sender.send(shot).is_err()));
                if let Some(tissue) = replay.tissue.as_ref().filter(|_| film.is_none()) {
                    shown.write(|frame| tissue.solver.publish(frame));
                    wound.write(|wound| wound.copy_from(tissue.collision.wound()));
                }
            }
            if film.is_none() {
                stop.ask();
            }
            replay.outcome()
        });
        picture(inputs);
        let outcome = replaying.join().unwrap_or_default();
        let remarks = outcome.remarks.iter().cloned().chain(copied.err().map(|fault| fault.to_string())).collect();
        Outcome { written: writing.join().unwrap_or_default(), remarks, ..outcome }
    })
}

/// Replays every tick of a recording, without a journal or a picture, and compares the forces.
pub fn compare(stages: Stages, recording: &Recording, start: ToolSample) -> Outcome {
    let (senders, _receivers) = journal(stages.haptic.force_scale());
    let mut replay = Replay::new(stages, recording, senders, start);
    let clock = Clock::start();
    recording.ticks.iter().for_each(|record| _ = replay.tick(record, &clock));
    replay.outcome()
}

/// State of a replay.
struct Replay<'a> {
    haptic: HapticStage,
    second: Option<SecondHand>,
    seconds: std::slice::Iter<'a, SecondRecord>,
    /// The second hand's tool after the last tick.
    second_place: Option<ToolState>,
    tissue: Option<Tissue>,
    collisions: VecDeque<CollisionRecord>,
    switches: VecDeque<SolverRecord>,
    senders: JournalSenders,
    ticks: Ticks,
    tools: VecDeque<ToolSample>,
    patches: VecDeque<Numbered<Patches>>,
    loads: VecDeque<Numbered<Loads>>,
    load: Numbered<Loads>,
    frame: SoftFrame,
    step_times: Times,
    collision_times: Times,
    replayed: Replayed,
    last: Option<TickRecord>,
    /// Why it could not begin as the session did.
    remark: Option<String>,
    /// Solver records of the recording, by step.
    recorded: &'a [SolverRecord],
    /// Whether steps are matched by time, because this solver's differ from the recorded ones.
    by_time: bool,
}

impl<'a> Replay<'a> {
    fn new(mut stages: Stages, recording: &'a Recording, senders: JournalSenders, start: ToolSample) -> Self {
        let begins = recording.state.as_ref().map_or(Ok(()), |state| joining::begin(state, &mut stages));
        Self {
            remark: begins.err().map(|why| format!("the recording began within another session: {why}")),
            recorded: &recording.solver,
            by_time: false,
            haptic: stages.haptic,
            second: stages.second,
            seconds: recording.second.iter(),
            second_place: None,
            tissue: stages.tissue,
            collisions: recording.collisions.iter().copied().collect(),
            switches: recording.solver.iter().copied().collect(),
            senders,
            ticks: Ticks::default(),
            tools: VecDeque::from([start]),
            patches: VecDeque::from([(0, Patches::default())]),
            loads: VecDeque::from([(0, Loads::default())]),
            load: (0, Loads::default()),
            frame: SoftFrame::default(),
            step_times: Times::default(),
            collision_times: Times::default(),
            replayed: Replayed {
                recorded: recording.promised_ticks(),
                losses: recording.losses(),
                ..Replayed::default()
            },
            last: None,
        }
    }

    /// Replays one tick and returns its view.
    fn tick(&mut self, record: &TickRecord, clock: &Clock) -> View {
        self.collide_up_to(record.patch_seq, clock);
        let known = self.patches.iter().rev().find(|(seq, _)| *seq <= record.patch_seq);
        let (patch_seq, patches) = known.copied().unwrap_or_default();
        let (patch, second_n) = (&patches[0], patches[1].force_n);
        let &TickRecord { tick, device, twist, buttons, time_ms, flags, .. } = record;
        let tool = ToolState { world_from_tool: device, twist, buttons: Buttons(buttons), time_ms };
        let reading = reading(tool, flags);
        let input = TickInput { tick, reading, patch, patch_seq, second: self.second_place, second_n };
        if record.has(TickRecord::RELEASED) {
            self.haptic.release();
        }
        let began_ms = clock.now_ms();
        let (notices, ticks) = (&mut self.senders.notices, &mut self.ticks);
        let mut tick = self.haptic.tick(&input, &mut |notice| {
            ticks.record(notice);
            notices.send(notice);
        });
        let second = self.second_tick(record.tick, &patches[1]);
        self.second_place = self.second.as_ref().and_then(SecondHand::place);
        tick.record.compute_us = ((clock.now_ms() - began_ms) * 1e3) as f32;
        self.ticks.add(&tick);
        let same = self.same(record.wrench, tick.record.wrench) & second.is_none_or(|(_, same)| same);
        self.last = Some(*record);
        self.replayed.ticks += 1;
        self.replayed.identical += u64::from(same);
        remember(&mut self.tools, tick.sample);
        while !self.senders.ticks.send(tick.record) {
            thread::yield_now();
        }
        self.ticks.view(&tick, &self.haptic, (second.map(|(view, _)| view), &patches), false)
    }

    /// Replays the second hand's tick of this number, if it was recorded; also returns whether its
    /// force equals the recorded one.
    fn second_tick(&mut self, number: u64, patch: &SurfacePatch) -> Option<(SecondView, bool)> {
        let record = self.seconds.as_slice().first().filter(|record| record.tick <= number)?;
        self.seconds.next();
        let stage = self.second.as_mut()?;
        if record.has(TickRecord::RELEASED) {
            stage.release();
        }
        let (notices, ticks) = (&mut self.senders.notices, &mut self.ticks);
        let &SecondRecord { device, twist, buttons, time_ms, flags, .. } = record;
        let tool = ToolState { world_from_tool: device, twist, buttons: Buttons(buttons), time_ms };
        let (wrench, again) = stage.tick(record.tick, &reading(tool, flags), patch, &mut |notice| {
            ticks.record(notice);
            notices.send(notice);
        });
        while !self.senders.second.send(again) {
            thread::yield_now();
        }
        let same = self.same(record.wrench, again.wrench);
        let view = SecondView { tool: SecondHand::tool(), world_from_tool: again.proxy, force: wrench.force() };
        Some((view, same))
    }

    /// Runs every collision step up to a number, each with its recorded tool and brain state.
    fn collide_up_to(&mut self, seq: u64, clock: &Clock) {
        while let Some(next) = self.collisions.front().copied().filter(|c| c.seq <= seq) {
            self.collisions.pop_front();
            self.solve_up_to(next.solver_step, clock);
            let Some(tissue) = &mut self.tissue else { return };
            let Some(&tool) = self.tools.iter().rev().find(|t| t.tick <= next.tick) else { return };
            tissue.solver.publish(&mut self.frame);
            let began_ms = clock.now_ms();
            let mut record = tissue.collision.step(&tool, &self.frame);
            record.compute_us = ((clock.now_ms() - began_ms) * 1e3) as f32;
            self.collision_times.add_us(record.compute_us);
            remember(&mut self.patches, (record.seq, *tissue.collision.patches()));
            remember(&mut self.loads, (record.seq, tissue.collision.loads().clone()));
            self.senders.collisions.send(record);
        }
    }

    /// Whether the solver is at a recorded step after `more` further steps, or past it.
    fn reaches(&self, step: u64, more: u64) -> bool {
        let Some(solver) = self.tissue.as_ref().map(|tissue| &tissue.solver) else { return true };
        if self.by_time {
            let further = (more as f64 + 0.5) * f64::from(solver.dt_ms());
            solver.time_ms() + further > time_of(self.recorded, step)
        } else {
            solver.steps() + more >= step
        }
    }

    /// Runs every solver step up to a recorded number, each with its recorded contact.
    fn solve_up_to(&mut self, step: u64, clock: &Clock) {
        while !self.reaches(step, 0) {
            self.solve(clock);
        }
    }

    /// Runs a solver step. A step that ends at another time than the recorded one of this number
    /// shows that the solver is another, by its mesh or its element.
    fn solve(&mut self, clock: &Clock) {
        let mut last = None;
        while let Some(switch) = self.switches.front().copied().filter(|s| self.reaches(s.step, 1)) {
            self.switches.pop_front();
            last = Some(switch);
            while self.loads.front().is_some_and(|(seq, _)| *seq < switch.contact_seq) {
                self.loads.pop_front();
            }
            if let Some(load) = self.loads.front().filter(|(seq, _)| *seq == switch.contact_seq) {
                self.load.clone_from(load);
            }
        }
        let Some(tissue) = &mut self.tissue else { return };
        if last.is_some_and(|last| last.cheaper > 0) {
            tissue.solver.wait_for_cheaper();
        }
        if let Some(last) = last.filter(|last| last.splits > 0) {
            // Another mesh has splits of its own.
            let wanted = if self.by_time { self.load.1.splits.len() } else { last.splits as usize };
            if wanted > tissue.solver.splits().len() {
                tissue.solver.wait_for_splits(&self.load.1, wanted);
            }
        }
        let began_ms = clock.now_ms();
        let record = tissue.solver.step(&self.load.1, self.load.0);
        let us = ((clock.now_ms() - began_ms) * 1e3) as f32;
        self.step_times.add_us(us);
        let (steps, time_ms) = (tissue.solver.steps(), tissue.solver.time_ms());
        self.by_time |= last.is_some_and(|last: SolverRecord| last.step == steps && last.time_ms != time_ms);
        if let Some(mut record) = record {
            record.compute_us = us;
            self.senders.solver.send(record);
        }
    }

    /// Returns whether two forces are equal bit for bit; updates the largest difference.
    fn same(&mut self, was: Wrench, is: Wrench) -> bool {
        let bits = |wrench: Wrench| wrench.force.to_array().map(f32::to_bits);
        self.replayed.max_difference_n = self.replayed.max_difference_n.max((was.force - is.force).length());
        bits(was) == bits(is)
    }

    fn outcome(self) -> Outcome {
        let last = self.last;
        let solver = self.tissue.as_ref().map(|tissue| SolverOutcome {
            times: self.step_times,
            collision_times: self.collision_times,
            wound: tissue.collision.wound().clone(),
            real_time_factor: last.map_or(0.0, |t| tissue.solver.time_ms() / t.time_ms.max(1e-3)),
            ..SolverOutcome::of(&tissue.solver)
        });
        let whole = Outcome::of(&self.haptic, self.second.as_ref());
        Outcome {
            remarks: whole.remarks.iter().cloned().chain(self.remark).collect(),
            ticks: self.ticks,
            seconds: last.map_or(0.0, |tick| tick.time_ms * 1e-3),
            solver,
            end_force_n: last.map_or(0.0, |tick| tick.wrench.force.length()),
            replayed: Some(self.replayed),
            ..whole
        }
    }
}

/// Returns the end of a recorded step, ms; between two records and after the last one from steps
/// of one length.
fn time_of(records: &[SolverRecord], step: u64) -> f64 {
    let after = records.partition_point(|record| record.step < step).min(records.len().saturating_sub(1));
    let at = |record: &SolverRecord| (record.step as f64, record.time_ms);
    let Some((last, last_ms)) = records.get(after).map(at) else { return 0.0 };
    let (first, first_ms) = after.checked_sub(1).map_or((0.0, 0.0), |before| at(&records[before]));
    first_ms + (last_ms - first_ms) * (step as f64 - first) / (last - first).max(1.0)
}

/// Restores the device's reading at a recorded tick.
fn reading(tool: ToolState, flags: u32) -> Reading {
    let status = match (flags & TickRecord::LOST != 0, flags & TickRecord::STALE != 0) {
        (true, _) => Status::Lost,
        (false, true) => Status::Stale,
        (false, false) => Status::Fresh,
    };
    Reading { tool, status }
}

fn remember<T>(memory: &mut VecDeque<T>, item: T) {
    if memory.len() == MEMORY {
        memory.pop_front();
    }
    memory.push_back(item);
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Arc;
    use trepan_bone::BoneVolume;
    use trepan_geometry::{Pose, Vec3};
    use trepan_stages::force_scale::ForceScale;
    use trepan_stages::haptic_config::HapticConfig;
    use trepan_stages::notice::{Hindrance, What};
    use trepan_stages::program::Program;
    use trepan_volume::VoxelVolume;

    #[test]
    fn the_time_of_a_recorded_step_lies_between_its_records() {
        let record = |step, time_ms| SolverRecord { step, time_ms, ..SolverRecord::default() };
        let records = [record(2, 1.0), record(4, 2.0), record(8, 3.0)];
        let times = [0, 1, 2, 3, 4, 6, 8, 12].map(|step| time_of(&records, step));
        assert_eq!(times, [0.0, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 4.0]);
        assert_eq!(time_of(&[], 5), 0.0);
    }

    fn at(z: f32, buttons: Buttons) -> ToolState {
        ToolState { buttons, ..ToolState::at(Pose::from_translation(Vec3::new(0.3, -0.2, z))) }
    }

    /// Makes a slab of bone from z = -6 to 0 mm and the stages of both hands above it.
    fn both_hands() -> (Arc<BoneVolume>, Stages) {
        let mut ct = VoxelVolume::isotropic([32; 3], Vec3::new(-15.5, -15.5, -18.5), 1.0, -1000i16);
        (32 * 32 * 12..32 * 32 * 19).for_each(|voxel| ct.data[voxel] = 1200);
        let bone = Arc::new(BoneVolume::new(&ct, 400).expect("there is bone"));
        let config = HapticConfig::usual(Program::Craniotomy);
        let haptic = HapticStage::new(config.clone(), Some(bone.clone()), None, at(20.0, Buttons(0)));
        let second = Some(SecondHand::new(config, Some(bone.clone()), None));
        (bone, Stages { haptic, second, tissue: None })
    }

    /// Returns both readings at a tick: a stroke through the bone, undo requests, a lost device,
    /// renewed pressing.
    fn hands(tick: u32) -> [Reading; 2] {
        let way =
            |from: f32, to: f32, since: u32, ticks: f32| from + (to - from) * ((tick - since) as f32 / ticks).min(1.0);
        let undo = if tick % 400 > 350 { Buttons::UNDO } else { Buttons(0) };
        let first = match tick {
            0..1500 => at(way(6.0, -4.0, 0, 1400.0), Buttons::PEDAL),
            1500..2000 => at(-2.0, undo),
            2000..3300 => at(way(-2.0, 12.0, 2000, 300.0), undo),
            _ => at(way(12.0, 2.0, 3300, 200.0), if tick > 3900 { Buttons::FLAP } else { Buttons(0) }),
        };
        let second_z = way(12.0, if (1200..2600).contains(&tick) { -1.0 } else { 12.0 }, tick.min(1200), 300.0);
        let gone = if (3600..3640).contains(&tick) { Status::Lost } else { Status::Fresh };
        let time_ms = f64::from(tick);
        let reading = |tool: ToolState, status| Reading { tool: ToolState { time_ms, ..tool }, status };
        [reading(first, gone), reading(at(second_z, Buttons(0)), Status::Fresh)]
    }

    #[test]
    fn undone_strokes_and_lost_devices_replay_bit_for_bit() {
        let (bone, Stages { mut haptic, second, .. }) = both_hands();
        let mut second = second.expect("a second hand");
        let (mut recording, mut raised, mut second_place) = (Recording::default(), Vec::new(), None);
        for tick in 1..4400u32 {
            let [first, other] = hands(tick);
            let input = TickInput {
                tick: tick.into(),
                reading: first,
                patch: &SurfacePatch::default(),
                patch_seq: 0,
                second: second_place,
                second_n: 0.0,
            };
            recording.ticks.push(haptic.tick(&input, &mut |notice| raised.push(notice)).record);
            let free = SurfacePatch::default();
            recording.second.push(second.tick(tick.into(), &other, &free, &mut |notice| raised.push(notice)).1);
            second_place = second.place();
        }
        let undo = |what: &What| matches!(what, What::Undone(_) | What::NotUndone(_));
        let undos: Vec<What> = raised.iter().map(|notice| notice.what).filter(undo).collect();
        let refused = |why| What::NotUndone(why);
        assert!(
            undos.starts_with(&[refused(Hindrance::Tool)]) && undos.contains(&refused(Hindrance::SecondTool)),
            "{undos:?}"
        );
        assert!(undos.iter().any(|what| matches!(what, What::Undone(mm3) if *mm3 > 1.0)), "{undos:?}");
        assert!(raised.iter().any(|notice| matches!(notice.what, What::Force { waits: false, .. })));
        let (again, stages) = both_hands();
        let (senders, _pages) = journal(ForceScale::default());
        let tool = Program::Craniotomy.tray()[0];
        let start = ToolSample {
            tick: 0,
            state: at(20.0, Buttons(0)),
            tool,
            slot: 0,
            drilling: false,
            second: None,
            idle: false,
        };
        let mut replay = Replay::new(stages, &recording, senders, start);
        recording.ticks.iter().for_each(|record| _ = replay.tick(record, &Clock::start()));
        assert_eq!((replay.replayed.identical, replay.replayed.ticks), (4399, 4399));
        assert!(again.snapshot() == bone.snapshot());
    }

    #[test]
    fn a_partial_replay_ends_with_the_recorded_fading_of_the_force() {
        let tick = |n: u64| TickRecord {
            tick: n,
            time_ms: n as f64 + 0.5,
            flags: if n > 6 { TickRecord::RELEASED } else { 0 },
            ..TickRecord::default()
        };
        let recording = Recording { ticks: (1..=9).map(tick).collect(), ..Recording::default() };
        let last = |end_ms| up_to(&recording, end_ms).last().map(|tick| tick.tick);
        assert_eq!([3.0, 3.5, 3.6, 6.0, 20.0, f64::INFINITY].map(last), [3, 3, 4, 9, 9, 9].map(Some));
        assert!(up_to(&Recording::default(), 1.0).is_empty());
    }

    #[test]
    fn a_partial_replay_is_described_as_such() {
        let whole = Replayed { ticks: 9, recorded: 9, identical: 9, ..Replayed::default() };
        assert!(whole.describe().starts_with("9 of 9 ticks gave the same force"));
        let part = Replayed { recorded: 100, ..whole.clone() };
        assert!(part.describe().starts_with("a part only, 9 of 100 ticks"), "{}", part.describe());
        let cut = Replayed { losses: Some("cut".into()), ..whole };
        assert!(cut.describe().starts_with("a part only, 9 of at least 9 ticks"), "{}", cut.describe());
    }
}
