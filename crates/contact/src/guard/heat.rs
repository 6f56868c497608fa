//! What warm motors bear.
//!
//! # Theory
//! Heat goes with the square of a motor's current, and so of the force: θ = 1 is what the
//! continuous force Fc heats to in the end. The peak Fp is given until θ = 0.9, then the limit
//! falls towards Fc, which it reaches as θ reaches 1, and never passes.
//! ```text
//! θ̇ = ((F/Fc)² - θ)/τ      F² ≤ Fc² + (Fp² - Fc²) min((1 - θ)/0.1, 1)
//! ```

use super::GuardConfig;

/// Share of the heat in which the limit falls from peak to continuous force.
const WARM: f32 = 0.1;

/// Heat θ of the motors; 1 is what they bear for any time.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Heat(pub f32);

impl Heat {
    /// Books the force that was given, N, and says what the motors bear now; `None` where the peak
    /// is for any time.
    pub(super) fn bearable_n(&mut self, given_n: f32, dt_ms: f32, config: &GuardConfig) -> Option<f32> {
        let (peak, steady) = (config.max_force_n, config.continuous_force_n);
        if steady >= peak {
            return None;
        }
        let load = if steady > 0.0 { (given_n / steady).powi(2) } else { 1.0 };
        self.0 += (load - self.0) * (dt_ms / config.heat_ms).clamp(0.0, 1.0);
        let spare = ((1.0 - self.0) / WARM).clamp(0.0, 1.0);
        Some((steady * steady + (peak * peak - steady * steady) * spare).sqrt())
    }
}
