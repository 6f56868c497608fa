//! A live session: the threads of the thesis (6.2), which exchange newest values without blocking.
//!
//! ```text
//!            tool                    contact
//!  haptic ─────────→ collision ─────────────→ simulation
//!    ↑  ↖───patch──────╯    ↖────positions──────╯
//!  device        main: picture from view, positions, bone      recording: rings → file
//! ```
//!
//! # Practice
//! Loops: `haptic_loop` at the device's rate, `collision_loop` at 1 kHz, `solver_loop` at the
//! solver's step, bound to wall time. The second hand's tick follows the first hand's in the haptic
//! loop. Real-time priority is requested from the operating system; a refusal becomes a remark. The
//! force is set to zero and the device closed in every case, also when a loop panics.

use crate::clock::{Clock, Schedule, Waits};
use crate::joining::{self, StateAsked, StateSender};
use crate::journal::{Journal, JournalSenders, journal};
use crate::stop::Stop;
use crate::{Cells, Numbered, Outcome, Patches, RenderInputs, Run, SolverOutcome, Stages, Ticks, Times, View};
use std::thread;
use thread_priority::{RealtimeThreadSchedulePolicy, ThreadPriority, ThreadSchedulePolicy};
use trepan_contact::{GuardedWrench, SurfacePatch};
use trepan_haptics::{HapticDevice, Status};
use trepan_link::cell::{Reader, Writer};
use trepan_link::queue::Sender;
use trepan_link::wire::{CollisionRecord, SecondRecord, SolverRecord, TickRecord};
use trepan_soft::Loads;
use trepan_stages::alarms;
use trepan_stages::collision_step::Wound;
use trepan_stages::haptic_tick::{HapticStage, Tick, TickInput};
use trepan_stages::second_hand::{SecondHand, SecondView};
use trepan_stages::{CollisionStage, Notice, SoftFrame, SolverStage, ToolSample};

/// Largest lag of simulated behind wall time, ms; more is skipped and lowers the real-time factor.
const LAG_MS: f64 = 40.0;
/// Time for which the pace of a second has been too slow before a cheaper solver is asked for, ms:
/// a second slow second.
const SLOW_MS: f64 = 1000.0;
/// Largest number of ticks for the force to fade at the end.
const FADE_TICKS: u64 = 200;

/// The haptic loop: read, tick, apply, publish, wait. Late ticks are counted, not made up for.
fn haptic_loop(mut hands: Hands, mut ends: HapticEnds, clock: Clock, pace: Pace, stop: &Stop) -> Outcome {
    let remarks = real_time(80, "haptic").into_iter().collect();
    let mut ticks = Ticks::default();
    let mut schedule = Schedule::new(pace.tick_ms.into(), clock.now_ms());
    let (mut waits, mut ending, mut second_place) = (Waits::default(), None, None);
    loop {
        waits.until(schedule.next_ms(), &clock);
        let now_ms = clock.now_ms();
        let reading = hands.owner.device.read(now_ms);
        let &(patch_seq, patches) = ends.patch.latest().0;
        let (patch, second_n) = (&patches[0], patches[1].force_n);
        let input = TickInput { tick: ticks.count + 1, reading, patch, patch_seq, second: second_place, second_n };
        let mut notify = |notice| {
            ticks.record(notice);
            ends.notices.send(notice);
        };
        let mut tick = hands.stage.tick(&input, &mut notify);
        hands.owner.device.apply(tick.wrench);
        let second_view = hands.second.as_mut().map(|second| second.tick(input.tick, now_ms, &patches[1], &mut notify));
        second_place = hands.second.as_ref().and_then(|second| second.stage.place());
        let done_ms = clock.now_ms();
        tick.record.compute_us = ((done_ms - now_ms) * 1e3) as f32;
        tick.record.flags |= if schedule.advance(done_ms) { TickRecord::LATE } else { 0 };
        ticks.add(&tick);
        if ending.is_none() && (reading.status == Status::Finished || now_ms >= pace.end_ms || stop.asked()) {
            hands.release();
            ending = Some(ticks.count);
        }
        let finished = ending.is_some_and(|since| hands.is_at_rest() || ticks.count - since > FADE_TICKS);
        ends.publish(&tick, ticks.view(&tick, &hands.stage, (second_view, &patches), finished));
        if finished {
            let end_force_n = if hands.stage.is_at_rest() { tick.wrench.force().length() } else { 0.0 };
            let of_stages = Outcome::of(&hands.stage, hands.second.as_ref().map(|second| &second.stage));
            return Outcome { ticks, seconds: clock.now_ms() * 1e-3, end_force_n, remarks, ..of_stages };
        }
    }
}

/// The collision loop: collides the newest tool with the newest brain at its own rate.
fn collision_loop(
    mut stage: CollisionStage,
    mut ends: CollisionEnds,
    clock: Clock,
    pace: Pace,
    stop: &Stop,
) -> (Times, Wound) {
    let _ = real_time(60, "collision");
    let mut times = Times::default();
    let mut schedule = Schedule::new(pace.collision_ms.into(), clock.now_ms());
    while !stop.asked() {
        clock.sleep_until(schedule.next_ms());
        let began_ms = clock.now_ms();
        let sample = *ends.tool.latest().0;
        let mut record = stage.step(&sample, ends.soft.latest().0);
        ends.patch.set((record.seq, *stage.patches()));
        ends.loads.write(|(seq, loads)| {
            *seq = record.seq;
            (loads.gravity, loads.fluid) = (stage.loads().gravity, stage.loads().fluid);
            loads.contacts.copy_from(&stage.loads().contacts);
            loads.fills.clone_from(&stage.loads().fills);
            loads.contact_splits = stage.loads().contact_splits;
            if loads.splits.len() != stage.loads().splits.len() {
                loads.splits.clone_from(&stage.loads().splits);
            }
        });
        ends.wound.write(|wound| wound.copy_from(stage.wound()));
        ends.asked.iter_mut().for_each(|asked| asked.answer(&stage));
        let done_ms = clock.now_ms();
        record.compute_us = ((done_ms - began_ms) * 1e3) as f32;
        times.add_us(record.compute_us);
        ends.records.send(record);
        schedule.advance(done_ms);
    }
    (times, stage.wound().clone())
}

/// The solver loop: simulated time follows wall time; a lag over [`LAG_MS`] is skipped. After two
/// slow seconds a cheaper solver goes on.
fn solver_loop(mut stage: SolverStage, mut ends: SolverEnds, clock: Clock, stop: &Stop) -> SolverOutcome {
    let _ = real_time(40, "simulation");
    let mut times = Times::default();
    let begin_ms = clock.now_ms();
    let mut skipped_ms = 0.0;
    let (mut pace, mut slow_from_ms) = (alarms::Pace::UNKNOWN, None);
    while !stop.asked() {
        let began_ms = clock.now_ms();
        if pace.follow(began_ms, stage.time_ms()) >= alarms::REAL_TIME {
            slow_from_ms = None;
        } else if began_ms - *slow_from_ms.get_or_insert(began_ms) >= SLOW_MS {
            stage.ask_for_cheaper();
        }
        let behind_ms = began_ms - begin_ms - skipped_ms - stage.time_ms();
        if behind_ms < f64::from(stage.dt_ms()) {
            clock.sleep_until(began_ms + f64::from(stage.dt_ms()) - behind_ms);
            continue;
        }
        if behind_ms > LAG_MS {
            skipped_ms += behind_ms - LAG_MS;
            thread::yield_now();
        }
        let (seq, loads) = ends.loads.latest().0;
        let record = stage.step(loads, *seq);
        stage.ask_for_splits();
        ends.soft.write(|frame| stage.publish(frame));
        let us = ((clock.now_ms() - began_ms) * 1e3) as f32;
        times.add_us(us);
        if let Some(mut record) = record {
            record.compute_us = us;
            ends.records.send(record);
            ends.shown.write(|frame| stage.publish(frame));
            ends.filmed.write(|frame| stage.publish(frame));
        }
    }
    let span_ms = (clock.now_ms() - begin_ms).max(1e-3);
    SolverOutcome { real_time_factor: stage.time_ms() / span_ms, times, ..SolverOutcome::of(&stage) }
}

/// Runs until the first device is finished, the time is over or a stop is requested. `picture` runs
/// on the calling thread.
pub fn run(run: Run<'_>, devices: Devices, pace: Pace, picture: impl FnOnce(RenderInputs)) -> Outcome {
    let Run { mut stages, start, mut recorder, mut share, watching, scene, stop } = run;
    let joined = watching.map_or(Ok(None), |watching| joining::join(&watching.name, &mut stages, stop));
    let mut written = |state: Option<_>| state.map_or(Ok(()), |state| recorder.state(&state));
    let joined = joined.and_then(|state| written(state).map_err(|fault| fault.to_string())).err();
    joined.iter().for_each(|text| tracing::warn!("{text}"));
    let clock = Clock::start();
    let mut cells = Cells::new(&stages, start);
    let (senders, receivers) = journal(stages.haptic.force_scale());
    let states = share.as_mut().and_then(|share| share.states.take());
    let states = states.map(|states| StateSender::new(states, &stages, *cells.view.1.latest().0));
    let (states, kept, asked) =
        states.map_or((None, None, None), |(states, kept, asked)| (Some(states), Some(kept), Some(asked)));
    let JournalSenders { ticks, second: seconds, notices, collisions, solver } = senders;
    let Stages { haptic, second, tissue } = stages;
    let owned = |device| HapticDeviceOwner { device, stop: stop.clone() };
    let owner = owned(devices.first);
    let second = second.zip(devices.second.map(owned));
    let second = second.map(|(stage, owner)| Second { stage, owner, records: seconds });
    let hands = Hands { stage: haptic, owner, second };
    let simulating = tissue.is_some();
    let inputs = RenderInputs {
        view: cells.view.1,
        soft: tissue.is_some().then_some(cells.shown.1),
        wound: Some(cells.wound.1),
        film: None,
    };
    thread::scope(|scope| {
        let writing = scope.spawn(move || Journal::write(receivers, recorder, share, clock));
        let (tool, view, patch) = (cells.tool.0, cells.view.0, cells.patch.1);
        let ends = HapticEnds { tool, view, filmed: cells.filmed.0, kept, patch, ticks, notices };
        let brain = simulating.then_some(cells.filmed_soft.1);
        let filming = scene.map(|(film, writer)| scope.spawn(move || film.live(writer, cells.filmed.1, brain, stop)));
        let stating = states.map(|states| scope.spawn(move || states.live(clock, stop)));
        let feeling = scope.spawn(move || haptic_loop(hands, ends, clock, pace, stop));
        let solving = tissue.map(|tissue| {
            let (tool, soft, patch, loads) = (cells.tool.1, cells.soft.1, cells.patch.0, cells.loads.0);
            let wound = cells.wound.0;
            let ends = CollisionEnds { tool, soft, patch, loads, wound, asked, records: collisions };
            let colliding = scope.spawn(move || collision_loop(tissue.collision, ends, clock, pace, stop));
            let (soft, shown, filmed) = (cells.soft.0, cells.shown.0, cells.filmed_soft.0);
            let ends = SolverEnds { loads: cells.loads.1, soft, shown, filmed, records: solver };
            (colliding, scope.spawn(move || solver_loop(tissue.solver, ends, clock, stop)))
        });
        picture(inputs);
        stop.ask();
        let panicked = || vec!["the haptic thread panicked; force set to zero, device closed".to_string()];
        let mut outcome = feeling.join().unwrap_or_else(|_| Outcome { remarks: panicked(), ..Outcome::default() });
        outcome.remarks.extend(filming.and_then(|filming| filming.join().ok().flatten()));
        outcome.remarks.extend(stating.and_then(|stating| stating.join().ok().flatten()).into_iter().chain(joined));
        let solver = solving.map(|(colliding, solving)| {
            let solver = solving.join().unwrap_or_default();
            let (collision_times, wound) = colliding.join().unwrap_or_default();
            SolverOutcome { collision_times, wound, ..solver }
        });
        Outcome { solver, written: writing.join().unwrap_or_default(), ..outcome }
    })
}

/// Periods of the loops and end of the session.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pace {
    /// Length of a haptic tick, ms.
    pub tick_ms: f32,
    /// Length of a collision step, ms.
    pub collision_ms: f32,
    /// End of the session, ms; infinite for none.
    pub end_ms: f64,
}

/// Devices of the hands.
pub struct Devices {
    /// Device of the drill; the operation ends when it is finished.
    pub first: Box<dyn HapticDevice>,
    /// Device of the aspirator, for stages with a second hand.
    pub second: Option<Box<dyn HapticDevice>>,
}

/// Owns the device; on drop it sets the force to zero, closes the device and ends the session.
pub struct HapticDeviceOwner {
    /// The device.
    pub device: Box<dyn HapticDevice>,
    /// Stop flag that is set on drop.
    pub stop: Stop,
}

impl Drop for HapticDeviceOwner {
    fn drop(&mut self) {
        self.device.apply(GuardedWrench::ZERO);
        self.device.close();
        self.stop.ask();
    }
}

/// Ends of cells and ring buffers for the haptic loop.
struct HapticEnds {
    tool: Writer<ToolSample>,
    view: Writer<View>,
    filmed: Writer<View>,
    kept: Option<Writer<View>>,
    patch: Reader<Numbered<Patches>>,
    ticks: Sender<TickRecord>,
    notices: Sender<Notice>,
}

impl HapticEnds {
    /// Sends the results of a tick to the other threads.
    fn publish(&mut self, tick: &Tick, view: View) {
        self.tool.set(tick.sample);
        self.view.set(view);
        self.filmed.set(view);
        self.kept.iter_mut().for_each(|kept| _ = kept.set(view));
        self.ticks.send(tick.record);
    }
}

/// Both hands: their stages and devices.
struct Hands {
    /// First, so that the device is closed before anything else is dropped.
    owner: HapticDeviceOwner,
    stage: HapticStage,
    second: Option<Second>,
}

impl Hands {
    /// Fades the forces to zero.
    fn release(&mut self) {
        self.stage.release();
        self.second.iter_mut().for_each(|second| second.stage.release());
    }

    /// Whether the forces are released and zero.
    fn is_at_rest(&self) -> bool {
        self.stage.is_at_rest() && self.second.as_ref().is_none_or(|second| second.stage.is_at_rest())
    }
}

/// The second hand: its stage and its device.
struct Second {
    owner: HapticDeviceOwner,
    stage: SecondHand,
    records: Sender<SecondRecord>,
}

impl Second {
    /// Reads the device, runs the tick and applies the force, after the first hand's tick of the
    /// same number.
    fn tick(&mut self, tick: u64, now_ms: f64, patch: &SurfacePatch, notify: &mut dyn FnMut(Notice)) -> SecondView {
        let reading = self.owner.device.read(now_ms);
        let (wrench, record) = self.stage.tick(tick, &reading, patch, notify);
        self.owner.device.apply(wrench);
        self.records.send(record);
        SecondView { tool: SecondHand::tool(), world_from_tool: record.proxy, force: wrench.force() }
    }
}

/// Ends of cells and ring buffers for the collision loop.
struct CollisionEnds {
    tool: Reader<ToolSample>,
    soft: Reader<SoftFrame>,
    patch: Writer<Numbered<Patches>>,
    loads: Writer<Numbered<Loads>>,
    wound: Writer<Wound>,
    asked: Option<StateAsked>,
    records: Sender<CollisionRecord>,
}

/// Ends of cells and ring buffers for the solver loop.
struct SolverEnds {
    loads: Reader<Numbered<Loads>>,
    soft: Writer<SoftFrame>,
    shown: Writer<SoftFrame>,
    filmed: Writer<SoftFrame>,
    records: Sender<SolverRecord>,
}

/// Requests a first-in-first-out priority for this thread; returns a remark when it is refused.
pub fn real_time(priority: u8, name: &str) -> Option<String> {
    let value = priority.try_into().ok().map(ThreadPriority::Crossplatform)?;
    let policy = ThreadSchedulePolicy::Realtime(RealtimeThreadSchedulePolicy::Fifo);
    let set = thread_priority::set_thread_priority_and_policy(thread_priority::thread_native_id(), value, policy);
    set.err().map(|fault| {
        format!(
            "the {name} loop runs without real-time priority ({fault:?}): ticks may be late on a busy machine; \
             allow it with `ulimit -r 80` or the CAP_SYS_NICE capability"
        )
    })
}
