//! A session on its own thread: it loads, runs in the window and writes its files.

use crate::error::SessionError;
use crate::session::{Place, SessionResult};
use crate::settings::Settings;
use std::thread::JoinHandle;
use trepan_patient::Case;
use trepan_patient::progress::{Progress, RUNNING, Stage};

/// What a job came to.
pub(crate) enum Done {
    /// A session.
    Session(Box<SessionResult>),
    /// A recording that was looked at.
    Viewed,
    /// A case that is to be looked at.
    Case(Box<Case>),
    /// A batch of replays: how many failed, how many there were.
    Batch([usize; 2]),
}

/// What a job does in its place.
pub(crate) type Work = Box<dyn FnOnce(Place) -> Result<Done, SessionError> + Send>;

/// A session on its own thread.
pub(crate) struct Job {
    progress: Progress,
    thread: JoinHandle<Result<Done, SessionError>>,
    /// Whether the case was built before.
    again: bool,
}

/// Seconds of each stage of loading where nothing was measured yet, numerical: for a case of a head
/// on two cores.
pub(super) const USUAL_S: [(&str, f64); 13] = [
    ("looking at the images", 0.5),
    ("reading the CT", 1.0),
    ("reading the MRI", 1.0),
    ("registering the MRI to the CT", 0.0),
    ("segmenting the brain", 3.0),
    ("measuring model errors in this case", 20.0),
    ("resampling the skull", 1.0),
    ("planning the opening", 3.0),
    ("meshing the brain", 6.0),
    ("caching the case", 1.0),
    ("preparing the operation", 2.0),
    ("preparing contact and tissue", 2.0),
    ("preparing the picture", 2.0),
];
/// Stages of a case that was built before.
const AGAIN: [&str; 4] =
    ["looking at the images", "preparing the operation", "preparing contact and tissue", "preparing the picture"];

impl Job {
    /// Starts the work on a thread.
    pub fn start(work: Work, place: Place, again: bool) -> Self {
        let progress = place.progress.clone();
        Self { progress, thread: std::thread::spawn(move || work(place)), again }
    }

    /// Ends loading at its next stage; a running session goes on.
    pub fn cancel(&self) {
        self.progress.cancel();
    }

    /// Whether the session runs, or has run.
    pub fn is_running(&self) -> bool {
        self.progress.is_running()
    }

    /// Whether the thread has ended.
    pub fn is_done(&self) -> bool {
        self.thread.is_finished()
    }

    /// Returns the share of loading that is done, and a line on it with the time left.
    pub fn loaded(&self, settings: &Settings) -> (f32, String) {
        let (stages, now_ms) = self.progress.so_far();
        let (share, left_s) = left(&stages, now_ms, |name| expected(settings, self.again, name));
        let what = stages.last().map_or("starting", |stage| stage.0);
        (share, format!("{what}, about {left_s:.0} s left"))
    }

    /// Waits for the end. Keeps how long each stage took.
    pub fn end(self, settings: &mut Settings) -> Result<Done, SessionError> {
        self.progress.end_wait();
        let (stages, _) = self.progress.so_far();
        for pair in stages.windows(2).filter(|_| self.is_running()) {
            let seconds = (pair[1].1 - pair[0].1) * 1e-3;
            settings.seconds.insert(key(self.again, pair[0].0), seconds);
        }
        let panicked = |_| Err(SessionError::Internal("the session's thread panicked; its report says more".into()));
        self.thread.join().unwrap_or_else(panicked)
    }
}

fn key(again: bool, stage: &str) -> String {
    format!("{} {stage}", if again { "again" } else { "first" })
}

/// Returns how long a stage is expected to take, s.
fn expected(settings: &Settings, again: bool, stage: &str) -> f64 {
    let usual = USUAL_S.iter().find(|(name, _)| *name == stage && (!again || AGAIN.contains(name)));
    settings.seconds.get(&key(again, stage)).copied().unwrap_or(usual.map_or(0.0, |usual| usual.1))
}

/// Share of the time spent in a late stage that is still expected of it, numerical.
const LATE: f64 = 0.25;
/// Expected time of the ended stages from which they tell how fast the machine is, s, numerical.
const TELLING_S: f64 = 1.0;

/// Returns the share of loading that is done, and the time left, s. Where the stages so far took
/// longer than expected, the others will too; in a late stage the time left grows.
fn left(stages: &[Stage], now_ms: f64, expected: impl Fn(&str) -> f64) -> (f32, f64) {
    if stages.last().is_some_and(|last| last.0 == RUNNING) {
        return (1.0, 0.0);
    }
    let at = stages.last().and_then(|last| USUAL_S.iter().position(|(name, _)| *name == last.0));
    let later: f64 = USUAL_S.iter().skip(at.map_or(0, |at| at + 1)).map(|(name, _)| expected(name)).sum();
    let ended = &stages[..stages.len().saturating_sub(1)];
    let (was_s, began_s) =
        (ended.iter().map(|stage| expected(stage.0)).sum::<f64>(), stages.last().map_or(0.0, |s| 1e-3 * s.1));
    let slower = if was_s > TELLING_S { (began_s / was_s).max(1.0) } else { 1.0 };
    let spent_s = stages.last().map_or(0.0, |last| (now_ms - last.1) * 1e-3);
    let of_this = at.map_or(0.0, |at| (slower * expected(USUAL_S[at].0) - spent_s).max(LATE * spent_s));
    let (done_s, left_s) = (now_ms * 1e-3, slower * later + of_this);
    ((done_s / (done_s + left_s).max(1e-3)) as f32, left_s)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_time_left_falls_and_grows_where_a_stage_is_late() {
        let of = |name: &str| if name == "meshing the brain" { 4.0 } else { 1.0 };
        let stages = [("looking at the images", 0.0), ("meshing the brain", 500.0)];
        let (share, left_s) = left(&stages, 1500.0, of);
        assert_eq!(left_s, 3.0 + 4.0);
        assert!((share - 1.5 / 8.5).abs() < 1e-6);
        let [late, later] = [20_500.0, 40_500.0].map(|ms| left(&stages, ms, of).1);
        assert!((late - 9.0).abs() < 1e-9 && later > late, "{late} {later}");
        let slow = [("resampling the skull", 0.0), ("planning the opening", 6000.0), ("meshing the brain", 12_000.0)];
        let six = |name: &str| if name == "meshing the brain" { 4.0 } else { 1.0 };
        assert_eq!(left(&slow, 12_000.0, six).1, 6.0 * (4.0 + 4.0), "a machine that is six times slower");
        assert_eq!(left(&[("meshing the brain", 0.0), (RUNNING, 1.0)], 5.0, of), (1.0, 0.0));
    }

    #[test]
    fn measured_times_replace_the_usual_ones() {
        let mut settings = Settings::default();
        assert_eq!(expected(&settings, true, "meshing the brain"), 0.0, "it is in the cache");
        settings.seconds.insert("first meshing the brain".into(), 2.5);
        assert_eq!(expected(&settings, false, "meshing the brain"), 2.5);
    }
}
