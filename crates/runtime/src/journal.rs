//! The recording thread: writes what the loops send through ring buffers, so that no loop accesses
//! a file.
//!
//! # Practice
//! The ring buffers hold 4 s of ticks; records that do not fit are counted and reported. Chunks are
//! flushed five times a second, so that a killed session loses at most the last 0.2 s. The current
//! scores are recorded as numbers once a second and at the end, for viewers of the file. A full
//! disk ends the recording, not the session.

use crate::clock::Clock;
use crate::watch::Share;
use std::time::Duration;
use trepan_link::queue::{Receiver, Sender, bounded};
use trepan_link::wire::{CollisionRecord, EventRecord, SecondRecord, SolverRecord, TickRecord};
use trepan_link::{LinkError, Recorder};
use trepan_stages::force_scale::ForceScale;
use trepan_stages::notice::{Notice, What};
use trepan_stages::score::ScoreKeeper;
use trepan_stages::solver_step::cheaper_text;

/// Capacity of a ring buffer, records.
const RING: usize = 8192;
/// Time between two flushes of the file, ms.
const FLUSH_MS: f64 = 200.0;
/// Time between two records of the current scores, ms.
const SCORES_MS: f64 = 1000.0;
/// Time between two reads of the ring buffers.
const DRAIN: Duration = Duration::from_millis(5);

/// Send ends of the ring buffers, for the loops.
pub struct JournalSenders {
    /// For the haptic loop.
    pub ticks: Sender<TickRecord>,
    /// For the haptic loop, with a second hand.
    pub second: Sender<SecondRecord>,
    /// For the haptic loop.
    pub notices: Sender<Notice>,
    /// For the collision loop.
    pub collisions: Sender<CollisionRecord>,
    /// For the solver loop.
    pub solver: Sender<SolverRecord>,
}

/// Receive ends of the ring buffers, for the recording thread.
pub struct Journal {
    ticks: Receiver<TickRecord>,
    second: Receiver<SecondRecord>,
    notices: Receiver<Notice>,
    collisions: Receiver<CollisionRecord>,
    solver: Receiver<SolverRecord>,
    /// Number and time, ms, of the newest tick.
    newest: (u64, f64),
    /// Whether a cheaper solver was met.
    is_cheaper: bool,
    /// Newtons at the hand per newton of the task, on bone.
    force_scale: ForceScale,
}

/// Result of the recording thread.
#[derive(Debug, Default)]
pub struct Written {
    /// Every notice, in order.
    pub notices: Vec<Notice>,
    /// Records that did not fit into a ring buffer.
    pub dropped: u64,
    /// Fault that ended the recording early, if any.
    pub fault: Option<LinkError>,
}

impl Written {
    /// Ends the recording with a fault and logs it; later faults are ignored.
    fn end(&mut self, fault: LinkError) {
        if self.fault.is_none() {
            tracing::error!("the recording ended early, the session goes on: {fault}");
            self.fault = Some(fault);
        }
    }
}

/// Makes the ring buffers and returns both ends.
pub fn journal(force_scale: ForceScale) -> (JournalSenders, Journal) {
    let (ticks, second, notices) = (bounded(RING), bounded(RING), bounded(RING / 8));
    let (collisions, solver) = (bounded(RING), bounded(RING));
    let newest = (0, 0.0);
    (
        JournalSenders {
            ticks: ticks.0,
            second: second.0,
            notices: notices.0,
            collisions: collisions.0,
            solver: solver.0,
        },
        Journal {
            ticks: ticks.1,
            second: second.1,
            notices: notices.1,
            collisions: collisions.1,
            solver: solver.1,
            newest,
            is_cheaper: false,
            force_scale,
        },
    )
}

impl Journal {
    /// Writes until every loop has dropped its senders and the ring buffers are empty, then closes
    /// the recording.
    pub fn write(mut self, mut recorder: Recorder, mut share: Option<Share>, clock: Clock) -> Written {
        let mut written = Written::default();
        let mut flushed_ms = 0.0;
        let mut scores = ScoreKeeper::at(self.force_scale);
        // The first record names the scores, so that also a cut file has the names.
        recorder.scores(0, 0.0, &numbers(&scores)).err().into_iter().for_each(|fault| written.end(fault));
        loop {
            let over = self.is_over();
            let drained = self.drain(&mut recorder, &mut share, &mut written, &mut scores);
            if let Err(fault) = drained.and_then(|()| self.record_teacher(&mut recorder, &mut share, clock.now_ms())) {
                written.end(fault);
                self.discard(&mut written);
            }
            if clock.now_ms() - flushed_ms >= FLUSH_MS && written.fault.is_none() {
                flushed_ms = clock.now_ms();
                recorder.flush().err().into_iter().for_each(|fault| written.end(fault));
            }
            if over {
                break;
            }
            std::thread::sleep(DRAIN);
        }
        written.dropped = self.dropped();
        if written.fault.is_none() {
            let last = recorder.scores(self.newest.0, self.newest.1, &numbers(&scores));
            last.err().into_iter().for_each(|fault| written.end(fault));
        }
        recorder.finish().err().into_iter().for_each(|fault| written.end(fault));
        written
    }

    /// Whether every loop has dropped its senders. Call it before draining, so that the last
    /// records are still written.
    fn is_over(&self) -> bool {
        self.ticks.is_abandoned() && self.collisions.is_abandoned() && self.solver.is_abandoned()
    }

    fn drain(
        &mut self,
        recorder: &mut Recorder,
        share: &mut Option<Share>,
        written: &mut Written,
        scores: &mut ScoreKeeper,
    ) -> Result<(), LinkError> {
        while let Some(record) = self.ticks.receive() {
            self.newest = (record.tick, record.time_ms);
            let before_ms = scores.time_ms();
            scores.add(&record);
            share.take_if(|share| share.ticks.send(&record).is_err());
            recorder.tick(&record)?;
            if (before_ms / SCORES_MS).floor() < (record.time_ms / SCORES_MS).floor() {
                recorder.scores(record.tick, record.time_ms, &numbers(scores))?;
            }
        }
        while let Some(record) = self.second.receive() {
            recorder.second(&record)?;
        }
        while let Some(record) = self.collisions.receive() {
            recorder.collision(&record)?;
        }
        while let Some(record) = self.solver.receive() {
            recorder.solver(&record)?;
            if record.cheaper > 0 && !std::mem::replace(&mut self.is_cheaper, true) {
                let (tick, time_ms) = self.newest;
                let text = cheaper_text(record.time_ms);
                tracing::warn!("{:7.3} s  {text}", 1e-3 * time_ms);
                recorder.event(&EventRecord { tick, time_ms, kind: "solver".into(), text })?;
            }
        }
        while let Some(notice) = self.notices.receive() {
            written.notices.push(notice);
            log(&notice);
            let (kind, text) = notice.words();
            let record = EventRecord { tick: notice.tick, time_ms: notice.time_ms, kind: kind.into(), text };
            share.take_if(|share| share.events.send(&record).is_err());
            recorder.event(&record)?;
        }
        Ok(())
    }

    /// Records the teacher's requests, at the newest tick.
    fn record_teacher(
        &mut self,
        recorder: &mut Recorder,
        share: &mut Option<Share>,
        now_ms: f64,
    ) -> Result<(), LinkError> {
        let Some(sharing) = share else { return Ok(()) };
        // Who joins late gets the header and the newest event.
        _ = sharing.headers.greet();
        _ = sharing.events.greet();
        for (begins, text) in sharing.teacher.receive(now_ms) {
            let text = format!("{}: {text}", if begins { "begins" } else { "ends" });
            tracing::info!("{:7.3} s  teacher: {text}", self.newest.1 * 1e-3);
            let record = EventRecord { tick: self.newest.0, time_ms: self.newest.1, kind: "teacher".into(), text };
            // Not sent to the watching session: it made the request.
            recorder.event(&record)?;
        }
        Ok(())
    }

    /// Empties the ring buffers after the recording failed.
    fn discard(&mut self, written: &mut Written) {
        while self.ticks.receive().is_some() {}
        while self.second.receive().is_some() {}
        while self.collisions.receive().is_some() {}
        while self.solver.receive().is_some() {}
        while let Some(notice) = self.notices.receive() {
            written.notices.push(notice);
            log(&notice);
        }
    }

    fn dropped(&self) -> u64 {
        self.ticks.dropped()
            + self.second.dropped()
            + self.collisions.dropped()
            + self.solver.dropped()
            + self.notices.dropped()
    }
}

/// Scores by name; NaN for one that is not defined yet.
fn numbers(scores: &ScoreKeeper) -> Vec<(String, f64)> {
    let all = serde_json::to_value(scores).unwrap_or_default();
    let all = all.as_object().into_iter().flatten();
    all.map(|(name, value)| (name.clone(), value.as_f64().unwrap_or(f64::NAN))).collect()
}

/// Logs a notice.
fn log(notice: &Notice) {
    let (kind, text) = notice.words();
    let seconds = notice.time_ms * 1e-3;
    match notice.what {
        What::Warning(_, true, _) => tracing::warn!("{seconds:7.3} s  {text}"),
        _ => tracing::info!("{seconds:7.3} s  {kind}: {text}"),
    }
}
