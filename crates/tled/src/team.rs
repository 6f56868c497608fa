//! Distributes the work on elements and nodes over one or more threads.
//!
//! # Theory
//! A round of work is divided into tasks: a part of the elements or a run of the nodes each. The
//! caller and every second worker claim tasks from the first on, the other workers from the last
//! on, so that a thread tends to get the same elements in every round and has them in its cache. A
//! worker that is not scheduled costs nothing: the caller then claims every task itself, and waits
//! only for tasks already claimed. So on a loaded machine the speed falls to that of one thread,
//! and the step never stalls. The result does not depend on which thread did a task.
//!
//! # Practice
//! Workers spin for a few microseconds after a round, then yield, then sleep.

use crate::dynamic_scaling::Added;
use crate::fill::{Filling, PartIndex};
use crate::force_slots::ForceSlots;
use crate::nodes::{Nodes, Update};
use crate::part::{Forcing, Part, Quiet};
use std::ops::Range;
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError, RwLock};
use std::thread::JoinHandle;
use trepan_soft::Body;
use trepan_soft::simd::Kernel;
use trepan_soft::simd::PassReport;

const SPINS: u32 = 4000;
const YIELDS: u32 = 64;
/// Nodes or node groups per task.
const RUN: usize = 256;

/// The parts, the nodes and the worker threads.
pub(crate) struct Team {
    shared: Arc<Shared>,
    workers: Vec<JoinHandle<()>>,
}

/// A round of work.
#[derive(Clone, Copy)]
pub(crate) enum Work {
    /// Volume changes of the elements.
    Volumes(Quiet),
    /// Mean volume change of the node groups.
    Average,
    /// Element forces.
    Forces(Forcing),
    /// Velocity changes of a substep before they are averaged.
    Predict(Update),
    /// Forces that average the velocity changes.
    Oppose(Update),
    /// Motion of the nodes.
    Update(Update),
}

struct Shared {
    parts: Vec<Mutex<Part>>,
    nodes: Nodes,
    force_slots: ForceSlots,
    kernel: Kernel,
    work: RwLock<Work>,
    claims: Claims,
    /// Tasks finished in this round.
    done: AtomicUsize,
    round: AtomicUsize,
    asleep: AtomicUsize,
    sleeping: Mutex<()>,
    wake: Condvar,
    quit: AtomicBool,
}

/// Task counters of a round, 20 bits each: all, claimed from the last on, claimed from the first
/// on. They share one atomic number, so that a thread never sees half of a new round.
struct Claims(AtomicU64);

/// Largest number of tasks in a round: a thousand million elements, 270 million nodes.
const MOST: u64 = (1 << 20) - 1;

impl Claims {
    /// Starts a round of `tasks` tasks.
    fn start(&self, tasks: usize) {
        self.0.store((tasks as u64).min(MOST) << 40, Ordering::Release);
    }

    /// Claims a task and returns its number; `None` when all are claimed.
    fn next(&self, from_last: bool) -> Option<usize> {
        let all = self.0.fetch_add(if from_last { 1 << 20 } else { 1 }, Ordering::AcqRel);
        let [count, last, first] = [all >> 40, all >> 20 & MOST, all & MOST];
        (first + last < count).then_some(if from_last { count - 1 - last } else { first } as usize)
    }
}

/// Counts a task as finished, even one that panicked.
struct Finished<'a>(&'a AtomicUsize);

impl Drop for Finished<'_> {
    fn drop(&mut self) {
        self.0.fetch_add(1, Ordering::Release);
    }
}

impl Team {
    /// Creates a team of `threads`, including the caller. Threads that fail to start are ignored.
    pub fn of(parts: Vec<Part>, nodes: Nodes, force_slots: ForceSlots, kernel: Kernel, threads: usize) -> Self {
        let shared = Arc::new(Shared {
            parts: parts.into_iter().map(Mutex::new).collect(),
            nodes,
            force_slots,
            kernel,
            work: RwLock::new(Work::Average),
            claims: Claims(AtomicU64::new(0)),
            done: AtomicUsize::new(0),
            round: AtomicUsize::new(0),
            asleep: AtomicUsize::new(0),
            sleeping: Mutex::new(()),
            wake: Condvar::new(),
            quit: AtomicBool::new(false),
        });
        let start = |number: usize| {
            let shared = Arc::clone(&shared);
            std::thread::Builder::new().name(format!("tled-{number}")).spawn(move || shared.serve(number % 2 == 1)).ok()
        };
        let workers = (1..threads).filter_map(start).collect();
        Self { shared, workers }
    }

    /// Changes the fill of a tetrahedron, or of a triangle of a membrane, between rounds.
    pub fn fill(&self, at: PartIndex, body: &Body, number: u32, filling: Filling) {
        lock(&self.shared.parts[at.part as usize]).fill(at.index as usize, body, number, filling);
    }

    /// The nodes.
    pub fn nodes(&self) -> &Nodes {
        &self.shared.nodes
    }

    /// The slots that the parts write their forces to.
    pub fn force_slots(&self) -> &ForceSlots {
        &self.shared.force_slots
    }

    /// Does a round of work.
    pub fn compute(&mut self, work: Work) {
        let tasks = self.shared.tasks(work);
        self.shared.announce(work, tasks);
        self.shared.work(false);
        let mut waited = 0;
        while self.shared.done.load(Ordering::Acquire) < tasks {
            pause(&mut waited);
        }
    }

    /// Combined reports of the parts in the last force pass.
    pub fn report(&self) -> PassReport {
        let add = |all: PassReport, part: &Mutex<Part>| {
            let report = lock(part).report;
            PassReport { inverted: all.inverted + report.inverted, growth: all.growth.max(report.growth) }
        };
        self.shared.parts.iter().fold(PassReport::default(), add)
    }

    /// Adds the mass for stiffened elements to their nodes, or takes it away again.
    pub fn weigh(&self, adds: bool) {
        for part in &self.shared.parts {
            lock(part).added().flatten().filter(|a| a.grams > 0.0).for_each(|Added { node, grams, .. }| match adds {
                true => self.nodes().add_mass(node as usize, grams),
                false => self.nodes().take_mass(node as usize),
            });
        }
    }

    /// Forces that average the velocity changes over the elements, stiffened ones included.
    pub fn oppose(&mut self, update: Update) {
        self.compute(Work::Predict(update));
        self.compute(Work::Oppose(update));
        for part in &self.shared.parts {
            lock(part).added().for_each(|added| self.nodes().oppose_added(added, &update));
        }
        self.nodes().count_opposed();
    }

    /// Number of elements, and number of awake elements.
    pub fn awake(&self) -> [usize; 2] {
        let add = |[a, b]: [usize; 2], [x, y]: [usize; 2]| [a + x, b + y];
        self.shared.parts.iter().map(|part| lock(part).awake()).fold([0; 2], add)
    }

    /// Wakes every part.
    pub fn wake(&mut self) {
        self.shared.parts.iter().for_each(|part| lock(part).wake());
    }

    /// Clears the stress memory.
    pub fn forget(&mut self) {
        self.shared.parts.iter().for_each(|part| lock(part).forget());
    }

    /// Exchanges the stress memory part by part; clears it in parts of other elements.
    pub fn take_memory(&mut self, from: &mut Self) {
        let mut theirs = from.shared.parts.iter();
        for part in &self.shared.parts {
            lock(part).take_memory(theirs.next().map(lock).as_deref_mut());
        }
    }
}

impl Drop for Team {
    fn drop(&mut self) {
        self.shared.quit.store(true, Ordering::SeqCst);
        self.shared.start_round();
        self.workers.drain(..).for_each(|worker| _ = worker.join());
    }
}

impl Shared {
    fn tasks(&self, work: Work) -> usize {
        match work {
            Work::Volumes(_) | Work::Forces(_) => self.parts.len(),
            Work::Average => self.force_slots.node_groups().div_ceil(RUN),
            Work::Predict(_) | Work::Oppose(_) | Work::Update(_) => self.nodes.u.len().div_ceil(RUN),
        }
    }

    /// Starts a round; no task may be running.
    fn announce(&self, work: Work, tasks: usize) {
        *self.work.write().unwrap_or_else(PoisonError::into_inner) = work;
        self.done.store(0, Ordering::Release);
        self.claims.start(tasks);
        self.start_round();
    }

    fn start_round(&self) {
        self.round.fetch_add(1, Ordering::SeqCst);
        if self.asleep.load(Ordering::SeqCst) > 0 {
            let _awake = lock(&self.sleeping);
            self.wake.notify_all();
        }
    }

    /// Claims and does tasks until none is left.
    fn work(&self, from_last: bool) {
        while let Some(number) = self.claims.next(from_last) {
            let _finished = Finished(&self.done);
            let work = *self.work.read().unwrap_or_else(PoisonError::into_inner);
            self.task(number, work);
        }
    }

    fn task(&self, number: usize, work: Work) {
        let (nodes, force_slots, kernel) = (&self.nodes, &self.force_slots, self.kernel);
        match work {
            Work::Volumes(quiet) => lock(&self.parts[number]).volumes(kernel, quiet, nodes, force_slots),
            Work::Average => force_slots.average(run(number, force_slots.node_groups())),
            Work::Forces(how) => lock(&self.parts[number]).forces(kernel, &how, nodes, force_slots),
            Work::Predict(update) => nodes.predict(run(number, nodes.u.len()), force_slots, &update),
            Work::Oppose(update) => nodes.oppose(run(number, nodes.u.len()), &update),
            Work::Update(update) => nodes.update(run(number, nodes.u.len()), force_slots, &update),
        }
    }

    /// Main loop of a worker.
    fn serve(&self, from_last: bool) {
        let mut seen = 0;
        while !self.quit.load(Ordering::SeqCst) {
            self.work(from_last);
            seen = self.wait_for_round_after(seen);
        }
    }

    fn wait_for_round_after(&self, seen: usize) -> usize {
        let mut waited = 0;
        while waited < SPINS + YIELDS {
            let round = self.round.load(Ordering::SeqCst);
            if round != seen {
                return round;
            }
            pause(&mut waited);
        }
        self.asleep.fetch_add(1, Ordering::SeqCst);
        let mut sleeping = lock(&self.sleeping);
        while self.round.load(Ordering::SeqCst) == seen {
            sleeping = self.wake.wait(sleeping).unwrap_or_else(PoisonError::into_inner);
        }
        self.asleep.fetch_sub(1, Ordering::SeqCst);
        self.round.load(Ordering::SeqCst)
    }
}

/// Range of items of a task, out of `count`.
fn run(number: usize, count: usize) -> Range<usize> {
    number * RUN..((number + 1) * RUN).min(count)
}

/// Spins at first, then yields to other threads.
fn pause(waited: &mut u32) {
    if *waited < SPINS {
        std::hint::spin_loop()
    } else {
        std::thread::yield_now()
    }
    *waited = waited.saturating_add(1);
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_task_is_claimed_once_from_whichever_end() {
        let claims = Claims(AtomicU64::new(0));
        assert_eq!((claims.next(true), claims.next(false)), (None, None));
        for tasks in [0usize, 1, 2, 7, 100] {
            claims.start(tasks);
            let claimed = |from_last: bool| std::iter::from_fn(|| claims.next(from_last)).collect::<Vec<_>>();
            let mut all = std::thread::scope(|scope| {
                let workers: Vec<_> = [true, false, true].map(|end| scope.spawn(move || claimed(end))).into();
                workers.into_iter().flat_map(|worker| worker.join().unwrap()).collect::<Vec<_>>()
            });
            all.sort_unstable();
            assert!(all.into_iter().eq(0..tasks));
        }
    }
}
