//! Progress of an import: shows the running stage, and the share of each stage at the end.

use crate::PatientError;
use crate::progress::{DraftSkull, Progress, Stopwatch};
use indicatif::{ProgressBar, ProgressStyle};
use std::fmt::Write;
use std::time::Duration;

/// Progress bar that records the duration of each stage.
pub struct ImportStages {
    bar: ProgressBar,
    progress: Progress,
    watch: Stopwatch,
    /// Name and start time of each stage, ms.
    began: Vec<(&'static str, f64)>,
}

impl ImportStages {
    /// Shows a bar for `count` stages, and reports them.
    pub fn new(count: u64, progress: &Progress) -> Self {
        let style = ProgressStyle::with_template("{spinner} [{bar:24}] {pos}/{len} {msg} {elapsed}");
        let bar = ProgressBar::new(count).with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
        bar.enable_steady_tick(Duration::from_millis(120));
        Self { bar, progress: progress.clone(), watch: Stopwatch::start(), began: Vec::new() }
    }

    /// Begins a stage, which ends the one before; an error if loading was cancelled.
    pub fn next(&mut self, what: &'static str) -> Result<(), PatientError> {
        self.began.push((what, self.watch.now_ms()));
        self.bar.inc(1);
        self.bar.set_message(what);
        self.progress.next(what)
    }

    /// Hands the skull of a CT to a window that shows it while the rest is loading.
    pub fn offer_skull(&self, skull: Option<impl FnOnce() -> DraftSkull>) {
        self.progress.offer_skull(skull);
    }

    /// Hides the bar during a call that prints.
    pub fn suspend<T>(&self, call: impl FnOnce() -> T) -> T {
        self.bar.suspend(call)
    }

    /// Ends the last stage and tells how long all took; the share of each is logged for debugging.
    pub fn finish(self) -> String {
        let end_ms = self.watch.now_ms();
        self.bar.finish_and_clear();
        tracing::debug!("import: {}", shares(&self.began, end_ms));
        format!("{:.1} s", 1e-3 * end_ms)
    }
}

fn shares(began: &[(&str, f64)], end_ms: f64) -> String {
    let mut text = format!("{:.1} s", end_ms * 1e-3);
    for (at, (what, start_ms)) in began.iter().enumerate() {
        let took_ms = began.get(at + 1).map_or(end_ms, |next| next.1) - start_ms;
        let mark = if at == 0 { ':' } else { ',' };
        _ = write!(text, "{mark} {what} {:.1} s ({:.0} %)", took_ms * 1e-3, 100.0 * took_ms / end_ms.max(1e-9));
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_stage_has_its_share() {
        let text = shares(&[("reading", 0.0), ("meshing", 1000.0)], 4000.0);
        assert_eq!(text, "4.0 s: reading 1.0 s (25 %), meshing 3.0 s (75 %)");
    }
}
