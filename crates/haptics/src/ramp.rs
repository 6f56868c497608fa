//! Restores the force after a fault: zero for a while, then a linear ramp.

use crate::{Fault, Watch};

/// Time without force after a fault, ms.
const REST_MS: f32 = 200.0;
/// Time from no force to full force after that, and at the start, ms.
const RAMP_MS: f32 = 300.0;
/// Longest tick that counts, ms: a longer pause does not shorten the rest.
const MAX_DT_MS: f32 = 5.0;

/// The fraction of the force that a device applies.
#[derive(Clone, Debug)]
pub(crate) struct Ramp {
    left_ms: f32,
    watch: Watch,
}

impl Ramp {
    /// Starts a ramp without a rest; faults are shown in `watch`.
    pub(crate) fn new(watch: Watch) -> Self {
        Self { left_ms: RAMP_MS, watch }
    }

    /// Sets the force to zero and restarts the rest.
    pub(crate) fn cut(&mut self, fault: Fault) {
        self.left_ms = REST_MS + RAMP_MS;
        self.watch.set(Some(fault));
    }

    /// Sets the force to zero for the current fault, or else for a new one.
    pub(crate) fn cut_again_or(&mut self, fault: Fault) {
        self.cut(self.watch.fault().unwrap_or(fault));
    }

    /// Restarts the ramp without a fault; a rest continues.
    pub(crate) fn restart(&mut self) {
        self.left_ms = self.left_ms.max(RAMP_MS);
    }

    /// Returns the fraction for this tick of `dt_ms`, 0 to 1. A fault ends when the ramp begins.
    pub(crate) fn share(&mut self, dt_ms: f32) -> f32 {
        if self.left_ms <= 0.0 {
            return 1.0;
        }
        self.left_ms -= dt_ms.clamp(0.0, MAX_DT_MS);
        if self.left_ms >= RAMP_MS {
            return 0.0;
        }
        self.watch.set(None);
        1.0 - (self.left_ms / RAMP_MS).max(0.0)
    }

    /// Whether a tick of `dt_ms` would end the rest and begin the ramp.
    pub(crate) fn rest_ends(&self, dt_ms: f32) -> bool {
        self.left_ms >= RAMP_MS && self.left_ms - dt_ms.clamp(0.0, MAX_DT_MS) < RAMP_MS && self.watch.fault().is_some()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_rests_then_ramps_to_one() {
        let watch = Watch::default();
        let mut ramp = Ramp::new(watch.clone());
        for (dt_ms, per_ms) in [(1.0, 1), (0.25, 4)] {
            ramp.cut(Fault::TooFast);
            let shares: Vec<f32> = (0..505 * per_ms).map(|_| ramp.share(dt_ms)).collect();
            assert!(shares[..200 * per_ms].iter().all(|s| *s == 0.0) && shares[201 * per_ms] > 0.0);
            assert!(shares.windows(2).all(|w| w[1] >= w[0] && w[1] - w[0] < 0.004));
            assert_eq!((shares.last(), watch.fault()), (Some(&1.0), None));
        }
    }
}
