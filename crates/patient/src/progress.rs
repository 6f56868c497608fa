//! Progress of loading a session, for other threads to read, and to cancel.

use crate::PatientError;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;
use trepan_volume::VoxelVolume;

/// A stage of loading: its name and when it began, ms since loading began.
pub type Stage = (&'static str, f64);

/// A skull that is only looked at, in coarse voxels.
#[derive(Debug)]
pub struct DraftSkull {
    /// Densities, HU.
    pub hu: VoxelVolume<i16>,
    /// Threshold of bone, HU.
    pub isovalue_hu: i16,
}

/// Progress of loading; clones share it.
#[derive(Clone, Debug)]
pub struct Progress(Arc<Shared>);

#[derive(Debug)]
struct Shared {
    watch: Stopwatch,
    stages: Mutex<Vec<Stage>>,
    cancelled: AtomicBool,
    running: AtomicBool,
    draft: Mutex<Option<Sender<DraftSkull>>>,
}

impl Default for Progress {
    fn default() -> Self {
        let (cancelled, running, draft) = Default::default();
        Self(Arc::new(Shared { watch: Stopwatch::start(), stages: Mutex::default(), cancelled, running, draft }))
    }
}

impl Progress {
    /// Begins a stage, which ends the one before; an error if loading was cancelled.
    pub fn next(&self, what: &'static str) -> Result<(), PatientError> {
        self.lock().push((what, self.0.watch.now_ms()));
        if self.0.cancelled.load(Ordering::Relaxed) { Err(PatientError::Cancelled) } else { Ok(()) }
    }

    /// Ends loading at its next stage.
    pub fn cancel(&self) {
        self.0.cancelled.store(true, Ordering::Relaxed);
    }

    /// Ends the last stage: the session runs.
    pub fn run(&self) {
        self.lock().push((RUNNING, self.0.watch.now_ms()));
        self.end_wait();
        self.0.running.store(true, Ordering::Relaxed);
    }

    /// Returns where the skull can be awaited once its CT is read. It ends without one if there is
    /// no CT, or loading ends before.
    pub fn awaits_skull(&self) -> Receiver<DraftSkull> {
        let (to, from) = channel();
        *self.0.draft.lock().unwrap_or_else(PoisonError::into_inner) = Some(to);
        from
    }

    /// Hands the skull to whoever awaits it, or ends the wait; it is made only then.
    pub fn offer_skull(&self, skull: Option<impl FnOnce() -> DraftSkull>) {
        let to = self.0.draft.lock().unwrap_or_else(PoisonError::into_inner).take();
        if let Some((to, make)) = to.zip(skull) {
            // Nobody may wait any more.
            to.send(make()).ok();
        }
    }

    /// Ends the wait for a skull: none comes any more.
    pub fn end_wait(&self) {
        self.offer_skull(None::<fn() -> DraftSkull>);
    }

    /// Whether loading is over and the session runs, or has run.
    pub fn is_running(&self) -> bool {
        self.0.running.load(Ordering::Relaxed)
    }

    /// Whether loading has ended, by itself or by the user.
    pub fn is_over(&self) -> bool {
        self.is_running() || self.0.cancelled.load(Ordering::Relaxed)
    }

    /// Returns the stages so far, and the time since loading began, ms.
    pub fn so_far(&self) -> (Vec<Stage>, f64) {
        (self.lock().clone(), self.0.watch.now_ms())
    }

    fn lock(&self) -> std::sync::MutexGuard<'_, Vec<Stage>> {
        self.0.stages.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Measures time from a start.
#[derive(Clone, Copy, Debug)]
pub struct Stopwatch(Instant);

impl Stopwatch {
    /// Starts now.
    pub fn start() -> Self {
        Self(Instant::now())
    }

    /// Time since the start, ms.
    pub fn now_ms(&self) -> f64 {
        1e3 * self.0.elapsed().as_secs_f64()
    }
}

/// Name of the last stage, in which the session runs.
pub const RUNNING: &str = "running";

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cancelled_loading_ends_at_its_next_stage() {
        let (progress, other) = {
            let progress = Progress::default();
            (progress.clone(), progress)
        };
        progress.next("reading the CT").unwrap();
        assert!(!other.is_running());
        other.cancel();
        assert!(matches!(progress.next("meshing the brain"), Err(PatientError::Cancelled)));
        progress.run();
        assert!(other.is_running());
        assert_eq!(
            other.so_far().0.iter().map(|s| s.0).collect::<Vec<_>>(),
            ["reading the CT", "meshing the brain", RUNNING]
        );
    }

    #[test]
    fn a_skull_comes_to_whoever_awaits_it_once_and_the_end_of_loading_ends_the_wait() {
        let progress = Progress::default();
        let skull = || DraftSkull { hu: VoxelVolume::isotropic([1; 3], glam::Vec3::ZERO, 1.0, 7), isovalue_hu: 300 };
        progress.offer_skull(Some(skull));
        let first = progress.awaits_skull();
        progress.offer_skull(Some(skull));
        progress.offer_skull(Some(skull));
        assert_eq!(first.recv().map(|skull| skull.hu.data).ok(), Some(vec![7]));
        assert!(first.recv().is_err());
        let second = progress.awaits_skull();
        progress.run();
        assert!(second.recv().is_err());
    }
}
