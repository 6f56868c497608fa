//! How force comes back after a fault: first not at all, then slowly.

use crate::{Fault, Watch};

/// Ticks without force after a fault.
const REST_TICKS: u32 = 200;
/// Ticks from no force to full force after that, and at the start.
const RAMP_TICKS: u32 = 300;

/// The share of the force that a device gives.
#[derive(Clone, Debug)]
pub(crate) struct Ramp {
    ticks_left: u32,
    watch: Watch,
}

impl Ramp {
    /// Starts a ramp without a rest. Faults show in `watch`.
    pub(crate) fn new(watch: Watch) -> Self {
        Self { ticks_left: RAMP_TICKS, watch }
    }

    /// Cuts the force and starts the rest anew.
    pub(crate) fn cut(&mut self, fault: Fault) {
        self.ticks_left = REST_TICKS + RAMP_TICKS;
        self.watch.set(Some(fault));
    }

    /// The share for this tick, 0 to 1. A fault is over when the ramp begins.
    pub(crate) fn share(&mut self) -> f32 {
        if self.ticks_left == 0 {
            return 1.0;
        }
        self.ticks_left -= 1;
        if self.ticks_left >= RAMP_TICKS {
            return 0.0;
        }
        self.watch.set(None);
        1.0 - self.ticks_left as f32 / RAMP_TICKS as f32
    }

    /// Whether the next share begins the ramp after a rest.
    pub(crate) fn rest_ends(&self) -> bool {
        self.ticks_left == RAMP_TICKS
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_rests_then_ramps_to_one() {
        let watch = Watch::default();
        let mut ramp = Ramp::new(watch.clone());
        ramp.cut(Fault::TooFast);
        let shares: Vec<f32> = (0..REST_TICKS + RAMP_TICKS + 5).map(|_| ramp.share()).collect();
        assert!(shares[..REST_TICKS as usize].iter().all(|s| *s == 0.0));
        assert!(shares.windows(2).all(|w| w[1] >= w[0] && w[1] - w[0] < 0.004));
        assert_eq!((shares.last(), watch.fault()), (Some(&1.0), None));
    }
}
