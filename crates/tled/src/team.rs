//! Work on the parts, alone or with more threads.
//!
//! # Theory
//! Parts are claimed one after the other from a counter, by the caller and by its workers alike. A worker that is not running costs nothing:
//! the caller then claims every part itself, and waits only for parts that someone is in the middle of. So a loaded machine falls back to the speed
//! of one thread and never stalls. Who computed a part leaves no trace in the result.
//!
//! # Practice
//! Workers spin for a few microseconds after a round, then yield, then sleep. Without workers nothing is locked, copied or waited for.

use crate::block::Quad;
use crate::kernel::Kernel;
use crate::part::{Now, Part, Work};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError, RwLock};
use std::thread::JoinHandle;

const SPINS: u32 = 4000;
const YIELDS: u32 = 64;

/// The parts and who works on them.
pub(crate) struct Team {
    shared: Arc<Shared>,
    workers: Vec<JoinHandle<()>>,
}

struct Shared {
    parts: Vec<Mutex<Part>>,
    job: RwLock<Job>,
    /// Number of the next part to be claimed; past the end when none is left.
    next: AtomicUsize,
    /// Parts finished in this round.
    done: AtomicUsize,
    round: AtomicUsize,
    asleep: AtomicUsize,
    sleeping: Mutex<()>,
    wake: Condvar,
    quit: AtomicBool,
}

struct Job {
    u: Vec<Quad>,
    swelling: Vec<f32>,
    kernel: Kernel,
    work: Work,
}

/// Counts a part as finished, even one that panicked.
struct Finished<'a>(&'a AtomicUsize);

impl Drop for Finished<'_> {
    fn drop(&mut self) {
        self.0.fetch_add(1, Ordering::Release);
    }
}

impl Team {
    /// A team of `threads`, the caller among them. A thread that cannot be started is done without.
    pub fn of(parts: Vec<Part>, nodes: usize, seats: usize, threads: usize) -> Self {
        let (u, swelling) = (vec![[0.0; 4]; nodes], vec![0.0; seats]);
        let job = Job { u, swelling, kernel: Kernel::Scalar, work: Work::Volumes };
        let shared = Arc::new(Shared {
            next: AtomicUsize::new(parts.len()),
            parts: parts.into_iter().map(Mutex::new).collect(),
            job: RwLock::new(job),
            done: AtomicUsize::new(0),
            round: AtomicUsize::new(0),
            asleep: AtomicUsize::new(0),
            sleeping: Mutex::new(()),
            wake: Condvar::new(),
            quit: AtomicBool::new(false),
        });
        let start = |number: usize| {
            let shared = Arc::clone(&shared);
            std::thread::Builder::new().name(format!("tled-{number}")).spawn(move || shared.serve()).ok()
        };
        let workers = (1..threads).filter_map(start).collect();
        Self { shared, workers }
    }

    /// Does some work on every part.
    pub fn compute(&mut self, kernel: Kernel, work: Work, now: Now<'_>) {
        if let Some(shared) = Arc::get_mut(&mut self.shared) {
            for part in &mut shared.parts {
                part.get_mut().unwrap_or_else(PoisonError::into_inner).compute(kernel, work, now);
            }
            return;
        }
        self.shared.announce(kernel, work, now);
        self.shared.work();
        let mut waited = 0;
        while self.shared.done.load(Ordering::Acquire) < self.shared.parts.len() {
            pause(&mut waited);
        }
    }

    /// Calls `each` with every part, in order.
    pub fn each(&mut self, mut each: impl FnMut(&mut Part)) {
        match Arc::get_mut(&mut self.shared) {
            Some(shared) => {
                shared.parts.iter_mut().for_each(|part| each(part.get_mut().unwrap_or_else(PoisonError::into_inner)));
            }
            None => self.shared.parts.iter().for_each(|part| each(&mut lock(part))),
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
    fn announce(&self, kernel: Kernel, work: Work, now: Now<'_>) {
        {
            let mut job = self.job.write().unwrap_or_else(PoisonError::into_inner);
            job.u.copy_from_slice(now.u);
            job.swelling.copy_from_slice(now.swelling);
            (job.kernel, job.work) = (kernel, work);
        }
        self.done.store(0, Ordering::Release);
        self.next.store(0, Ordering::Release);
        self.start_round();
    }

    fn start_round(&self) {
        self.round.fetch_add(1, Ordering::SeqCst);
        if self.asleep.load(Ordering::SeqCst) > 0 {
            let _awake = lock(&self.sleeping);
            self.wake.notify_all();
        }
    }

    /// Claims and computes parts until none is left.
    fn work(&self) {
        while let Some(part) = self.parts.get(self.next.fetch_add(1, Ordering::AcqRel)) {
            let _finished = Finished(&self.done);
            let job = self.job.read().unwrap_or_else(PoisonError::into_inner);
            lock(part).compute(job.kernel, job.work, Now { u: &job.u, swelling: &job.swelling });
        }
    }

    /// A worker's life.
    fn serve(&self) {
        let mut seen = 0;
        while !self.quit.load(Ordering::SeqCst) {
            self.work();
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

/// Spins at first, then lets others run.
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
