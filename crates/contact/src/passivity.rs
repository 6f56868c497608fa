//! Passivity observer and controller: the virtual wall must not give out more energy than the hand has put in.
//!
//! # Theory
//! With F the force on the hand, held between two ticks, and x the tip, the energy that the scene has taken up is
//! ```text
//! E(n) = E(n-1) - F(n-1)·(x(n) - x(n-1))                     exact for a held force
//! ```
//! E < 0 means that the wall has made energy. The controller then asks for a damping force `-α v`, with
//! `α = -E / (v² T)`, cut at a limit: a damper that is too strong is itself unstable on a sampled device.
//!
//! # Practice
//! Energy in N mm (= mJ). What the user has put in is credited up to `max_stored_nmm` only, since a long quiet history would
//! hide a fresh oscillation (Ryu's problem of the full tank). Under `min_speed` nothing is done: the division would blow noise up.
//!
//! # Sources
//! B. Hannaford, J.-H. Ryu, *Time-domain passivity control of haptic interfaces*, IEEE Trans. Robotics and Automation 18 (2002).
//!
//! # When not to use it
//! As a replacement for a stable wall: it answers one tick late, and it cannot know what the hand does in the tick to come.

use trepan_geometry::Vec3;

/// Limits of the controller.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PassivityConfig {
    /// Largest damping that the controller injects, N ms/mm. 10 holds a 2 N/mm wall on a Touch; 0 only observes.
    pub max_damping: f32,
    /// Most energy that the wall may owe the hand, N mm. A spring of k at the force limit F stores F²/2k: 18 N mm for 0.3 N/mm.
    pub max_stored_nmm: f32,
    /// Speed under which the controller rests, mm/ms.
    pub min_speed: f32,
}

impl Default for PassivityConfig {
    fn default() -> Self {
        Self { max_damping: 10.0, max_stored_nmm: 20.0, min_speed: 1e-3 }
    }
}

/// The energy account of one hand.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PassivityObserver {
    energy_nmm: f64,
    lowest_nmm: f64,
}

impl PassivityObserver {
    /// Books the tick that has passed: the held `force` (N, on the hand) moved along by `motion` (mm).
    pub fn book(&mut self, force: Vec3, motion: Vec3, config: &PassivityConfig) {
        let taken = -force.as_dvec3().dot(motion.as_dvec3());
        if taken.is_finite() {
            self.energy_nmm = (self.energy_nmm + taken).min(f64::from(config.max_stored_nmm));
            self.lowest_nmm = self.lowest_nmm.min(self.energy_nmm);
        }
    }

    /// The damping force, N, that gets back what the wall gave away; zero while the account is positive.
    pub fn damping(&self, velocity: Vec3, dt_ms: f32, config: &PassivityConfig) -> Vec3 {
        let speed2 = velocity.length_squared();
        if self.energy_nmm >= 0.0 || speed2.is_nan() || speed2 < config.min_speed * config.min_speed {
            return Vec3::ZERO;
        }
        let alpha = (-self.energy_nmm as f32 / (speed2 * dt_ms)).min(config.max_damping);
        -alpha * velocity
    }

    /// Energy that the wall holds for the hand, N mm; negative when it gave out more than it got.
    pub fn energy_nmm(&self) -> f64 {
        self.energy_nmm
    }

    /// The lowest that the account has been, N mm.
    pub fn lowest_nmm(&self) -> f64 {
        self.lowest_nmm
    }

    /// Starts a new account.
    pub fn reset(&mut self) {
        *self = Self::default();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_spring_pressed_and_released_costs_nothing_and_a_kick_is_noticed() {
        let config = PassivityConfig::default();
        let mut observer = PassivityObserver::default();
        observer.book(Vec3::Z, Vec3::NEG_Z * 0.5, &config);
        assert_eq!(observer.energy_nmm(), 0.5);
        assert_eq!(observer.damping(Vec3::Z, 1.0, &config), Vec3::ZERO);
        observer.book(Vec3::Z, Vec3::Z * 0.75, &config);
        assert_eq!(observer.energy_nmm(), -0.25);
        let damping = observer.damping(Vec3::Z * 0.5, 1.0, &config);
        assert!((damping + Vec3::Z * 0.5).length() < 1e-6, "pays 0.25 N mm back over the next 0.5 mm: {damping}");
    }

    #[test]
    fn damping_and_credit_are_bounded_and_nan_is_not_booked() {
        let config = PassivityConfig::default();
        let mut observer = PassivityObserver::default();
        observer.book(Vec3::Z, Vec3::NEG_Z * 1e6, &config);
        assert_eq!(observer.energy_nmm(), 20.0);
        observer.book(Vec3::NAN, Vec3::ONE, &config);
        observer.book(Vec3::Z, Vec3::Z * 1e6, &config);
        assert!(observer.damping(Vec3::X * 0.1, 1.0, &config).length() <= 1.0 + 1e-6);
        assert_eq!(observer.damping(Vec3::NAN, 1.0, &config), Vec3::ZERO);
        assert_eq!(observer.damping(Vec3::X * 1e-4, 1.0, &config), Vec3::ZERO);
    }
}
