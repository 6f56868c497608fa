//! Progress of loading a session, for other threads to read, and to cancel.

use crate::error::SessionError;
use crate::run::clock::Clock;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

/// A stage of loading: its name and when it began, ms since loading began.
pub(crate) type Stage = (&'static str, f64);

/// Progress of loading; clones share it.
#[derive(Clone, Debug)]
pub(crate) struct Progress(Arc<Shared>);

#[derive(Debug)]
struct Shared {
    clock: Clock,
    stages: Mutex<Vec<Stage>>,
    cancelled: AtomicBool,
    running: AtomicBool,
}

impl Default for Progress {
    fn default() -> Self {
        let (cancelled, running) = Default::default();
        Self(Arc::new(Shared { clock: Clock::start(), stages: Mutex::default(), cancelled, running }))
    }
}

impl Progress {
    /// Begins a stage, which ends the one before; an error if loading was cancelled.
    pub fn next(&self, what: &'static str) -> Result<(), SessionError> {
        self.lock().push((what, self.0.clock.now_ms()));
        if self.0.cancelled.load(Ordering::Relaxed) { Err(SessionError::Cancelled) } else { Ok(()) }
    }

    /// Ends loading at its next stage.
    pub fn cancel(&self) {
        self.0.cancelled.store(true, Ordering::Relaxed);
    }

    /// Ends the last stage: the session runs.
    pub fn run(&self) {
        self.lock().push((RUNNING, self.0.clock.now_ms()));
        self.0.running.store(true, Ordering::Relaxed);
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
        (self.lock().clone(), self.0.clock.now_ms())
    }

    fn lock(&self) -> std::sync::MutexGuard<'_, Vec<Stage>> {
        self.0.stages.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Name of the last stage, in which the session runs.
pub(crate) const RUNNING: &str = "running";

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
        assert!(matches!(progress.next("meshing the brain"), Err(SessionError::Cancelled)));
        progress.run();
        assert!(other.is_running());
        assert_eq!(
            other.so_far().0.iter().map(|s| s.0).collect::<Vec<_>>(),
            ["reading the CT", "meshing the brain", RUNNING]
        );
    }
}
