//! Stress relaxation at constant strain: Prony series.
//!
//! # Theory
//! Term i relaxes the share g_i of the instantaneous isochoric stress S with the time constant τ_i:
//! ```text
//! S(t) - Σ_i Υ_i(t)      Υ_i' = (g_i S - Υ_i)/τ_i      Υ⁺ = e^(-dt/τ) Υ + g (1 - e^(-dt/τ)) S
//! ```
//! This is exact for a stress that is constant over the step, and stable for any dt. The material's
//! moduli are the instantaneous ones; at constant strain the isochoric stress falls to the share
//! `1 - Σ g_i`. S is in the rest frame (second Piola-Kirchhoff), so it is objective.
//!
//! # Sources
//! Taylor, Comas, Cheng, Passenger, Hawkes, Atkinson, Ourselin, Med. Image Anal. 13 (2009). Brain:
//! rows of `trepan-measurements`, named at each preset.

use trepan_measurements::{brain_relaxation as rows, fits};
use trepan_soft::BodyError;
use trepan_soft::simd::Lane;

const MS_PER_S: f32 = 1e3;

/// Number of Prony terms.
pub const PRONY_TERMS: usize = 3;

/// Prony terms, [`PRONY_TERMS`] at most; a share of 0 = no term.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Relaxation {
    /// Relaxing share g_i of the instantaneous isochoric stress, without unit; each at least 0,
    /// together below 1.
    pub share: [f32; PRONY_TERMS],
    /// Time constant τ_i, in which the share falls to 1/e, ms.
    pub time_ms: [f32; PRONY_TERMS],
}

/// Factors of one term for a step.
#[derive(Clone, Copy, Default)]
pub(crate) struct Fade {
    pub keep: f32,
    pub gain: f32,
}

impl Relaxation {
    /// No relaxation: elastic.
    pub const NONE: Self = Self { share: [0.0; PRONY_TERMS], time_ms: [1.0; PRONY_TERMS] };

    /// Swine after Miller and Chinzei 2002, from memory, uncalibrated: 45 % with a time constant of
    /// 0.5 s, 36.5 % with 50 s.
    pub const BRAIN: Self = Self {
        share: [rows::SWINE_FAST_SHARE.f32(), rows::SWINE_SLOW_SHARE.f32(), 0.0],
        time_ms: [MS_PER_S * rows::SWINE_FAST_TIME.f32(), MS_PER_S * rows::SWINE_SLOW_TIME.f32(), 1.0],
    };

    /// Brain at held strain over four minutes (Amedieu 2004). The solid's time is that of human
    /// cortex, then come pore fluid in tens of seconds and minutes.
    pub const SOLID_AND_FLUID: Self = Self {
        share: [
            fits::RELAXATION_SOLID_SHARE.f32(),
            fits::RELAXATION_FLUID_SHARE.f32(),
            fits::RELAXATION_SLOW_SHARE.f32(),
        ],
        time_ms: [
            MS_PER_S * rows::CORTEX_TIME.f32(),
            MS_PER_S * rows::FLUID_TIME.f32(),
            MS_PER_S * rows::SLOW_TIME.f32(),
        ],
    };

    /// Whether there is no relaxation.
    pub fn is_none(&self) -> bool {
        self.share == [0.0; PRONY_TERMS]
    }

    /// Rejects invalid shares and times.
    pub fn check(&self) -> Result<(), BodyError> {
        let total: f32 = self.share.iter().sum();
        let is_right = self.share.iter().all(|g| *g >= 0.0) && total < 1.0;
        BodyError::check_config(is_right, "relaxation.share", total, "each at least 0 and together below 1")?;
        let terms = self.share.iter().zip(self.time_ms).filter(|(share, _)| **share > 0.0);
        let mut times = terms.map(|(_, ms)| (ms > 0.0 && ms.is_finite(), ms));
        let (is_right, ms) = times.find(|(is_right, _)| !is_right).unwrap_or((true, 0.0));
        BodyError::check_config(is_right, "relaxation.time_ms", ms, "over 0 and finite")
    }

    /// Factors for a step of `dt_ms`; the same bits on every machine.
    pub(crate) fn fade(&self, dt_ms: f32) -> [Fade; PRONY_TERMS] {
        std::array::from_fn(|i| {
            let keep = Lane::exp2(-std::f32::consts::LOG2_E * dt_ms / self.time_ms[i].max(f32::MIN_POSITIVE));
            Fade { keep, gain: self.share[i] * (1.0 - keep) }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn invalid_terms_are_rejected() {
        let with = |share, time_ms| Relaxation { share, time_ms }.check();
        assert!(
            Relaxation::BRAIN.check().is_ok()
                && Relaxation::SOLID_AND_FLUID.check().is_ok()
                && Relaxation::NONE.check().is_ok()
                && Relaxation::default().check().is_ok()
        );
        assert!(with([0.3, 0.3, 0.4], [1.0; 3]).is_err() && with([-0.1, 0.4, 0.0], [1.0; 3]).is_err());
        assert!(with([0.1, 0.0, 0.0], [0.0; 3]).is_err() && with([f32::NAN, 0.0, 0.0], [1.0; 3]).is_err());
    }

    #[test]
    fn a_constant_stress_relaxes_to_the_remaining_share() {
        let relaxation = Relaxation { share: [0.4, 0.2, 0.1], time_ms: [10.0, 100.0, 400.0] };
        let (mut memory, dt) = ([0.0f32; PRONY_TERMS], 0.5);
        for step in 0..4000 {
            let fade = relaxation.fade(dt);
            (0..PRONY_TERMS).for_each(|i| memory[i] = fade[i].keep * memory[i] + fade[i].gain);
            let t = dt * (step + 1) as f32;
            let term = |i: usize| relaxation.share[i] * (1.0 - (-t / relaxation.time_ms[i]).exp());
            let exact: f32 = (0..PRONY_TERMS).map(term).sum();
            assert!((memory.iter().sum::<f32>() - exact).abs() < 1e-4, "{t}");
        }
    }
}
