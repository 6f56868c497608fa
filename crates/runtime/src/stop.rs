//! The stop flag of a session: set at its end, by the window, by Ctrl-C or by SIGTERM.

use signal_hook::consts::{SIGINT, SIGTERM};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

/// Stop flag that all threads share; set once, never cleared.
#[derive(Clone, Debug, Default)]
pub struct Stop {
    requested: Arc<AtomicBool>,
    signal: Arc<AtomicUsize>,
}

impl Stop {
    /// Makes a flag that SIGINT and SIGTERM set too; a second signal ends the process at once.
    pub fn on_signals() -> std::io::Result<Self> {
        let stop = Self::default();
        for signal in [SIGINT, SIGTERM] {
            signal_hook::flag::register_conditional_shutdown(signal, 128 + signal, Arc::clone(&stop.requested))?;
            signal_hook::flag::register(signal, Arc::clone(&stop.requested))?;
            signal_hook::flag::register_usize(signal, Arc::clone(&stop.signal), signal as usize)?;
        }
        Ok(stop)
    }

    /// Requests every thread to end.
    pub fn ask(&self) {
        self.requested.store(true, Ordering::Relaxed);
    }

    /// Whether the end was requested.
    pub fn asked(&self) -> bool {
        self.requested.load(Ordering::Relaxed)
    }

    /// The signal that ended the session, if one did.
    pub fn signal(&self) -> Option<i32> {
        let signal = self.signal.load(Ordering::Relaxed);
        (signal != 0).then_some(signal as i32)
    }
}
