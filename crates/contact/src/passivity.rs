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
//! A damper cannot undo what a held force is about to give: so the force is also bounded (the energy bounding of Kim and Ryu),
//! ```text
//! |F| d ≤ E + ε ,   d = (v·F/|F| + margin) T                  d the way that the hand may go along F in the coming tick
//! ```
//! the margin being what the hand's last change of velocity lets one expect. A spring that is let go has `E = F²/2k`, so the bound is felt
//! in the last ticks before it leaves, or where energy has been made.
//!
//! # Practice
//! Energy in N mm (= mJ). What the user has put in is credited up to `max_stored_nmm` only, since a long quiet history would
//! hide a fresh oscillation (Ryu's problem of the full tank). Under `min_speed` nothing is damped: the division would blow noise up.
//! A device that applies forces late is told by `delay_ticks`: the account then books the force that the hand feels.
//!
//! # Sources
//! B. Hannaford, J.-H. Ryu, *Time-domain passivity control of haptic interfaces*, IEEE Trans. Robotics and Automation 18 (2002); J.-P. Kim, J. Ryu,
//! *Robustly stable haptic interaction control using an energy-bounding algorithm*, Int. J. Robotics Research 29 (2010).
//!
//! # When not to use it
//! As a replacement for a stable wall: it answers one tick late, and it can only guess what the hand does in the tick to come.

use trepan_geometry::Vec3;

/// Most ticks between a force and the hand.
const MAX_DELAY: usize = 4;

/// Limits of the controller.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PassivityConfig {
    /// Largest damping that the controller injects, N ms/mm. 10 holds a 2 N/mm wall on a Touch; 0 only observes.
    pub max_damping: f32,
    /// Most energy that the wall may owe the hand, N mm. A spring of k at the force limit F stores F²/2k: 18 N mm for 0.3 N/mm.
    pub max_stored_nmm: f32,
    /// Energy that may be given out in advance, N mm: what the bound starts from. 0.05 is half of what a hand could ever notice.
    pub advance_nmm: f32,
    /// Speed under which the controller rests, mm/ms.
    pub min_speed: f32,
    /// Ticks between a force and the moment when the device applies it: 0 or 1 for a driver, 1 or 2 across a socket; at most 4.
    pub delay_ticks: u8,
}

impl Default for PassivityConfig {
    fn default() -> Self {
        Self { max_damping: 10.0, max_stored_nmm: 20.0, advance_nmm: 0.05, min_speed: 1e-3, delay_ticks: 0 }
    }
}

/// The energy account of one hand.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PassivityObserver {
    energy_nmm: f64,
    lowest_nmm: f64,
    /// Forces sent, newest first.
    sent: [Vec3; MAX_DELAY + 1],
    /// Motion of the tick that has passed and of the one before, mm.
    motion: [Vec3; 2],
}

impl PassivityObserver {
    /// Books the tick that has passed: the tip moved by `motion` (mm) under the force that was sent `delay_ticks` before the last one.
    pub fn book(&mut self, motion: Vec3, config: &PassivityConfig) {
        let felt = self.sent[usize::from(config.delay_ticks).min(MAX_DELAY)];
        let taken = -felt.as_dvec3().dot(motion.as_dvec3());
        if !taken.is_finite() {
            return;
        }
        self.energy_nmm = (self.energy_nmm + taken).min(f64::from(config.max_stored_nmm));
        self.lowest_nmm = self.lowest_nmm.min(self.energy_nmm);
        self.motion = [motion, self.motion[0]];
    }

    /// Notes the force that goes to the device now, N.
    pub fn send(&mut self, force: Vec3) {
        self.sent.rotate_right(1);
        self.sent[0] = force;
    }

    /// The damping force, N, that gets back what the wall gave away; zero while the account is positive.
    pub fn damping(&self, dt_ms: f32, config: &PassivityConfig) -> Vec3 {
        let velocity = self.motion[0] / dt_ms;
        let speed2 = velocity.length_squared();
        if self.energy_nmm >= 0.0 || !speed2.is_finite() || speed2 < config.min_speed * config.min_speed {
            return Vec3::ZERO;
        }
        let alpha = (-self.energy_nmm as f32 / (speed2 * dt_ms)).min(config.max_damping);
        -alpha * velocity
    }

    /// The share of `force` that the account can pay for in the coming tick, 0 to 1.
    pub fn affordable(&self, force: Vec3, config: &PassivityConfig) -> f32 {
        let late = usize::from(config.delay_ticks).min(MAX_DELAY);
        let [now, before] = self.motion;
        let surprise = 2.0 * now.distance(before) + 2e-3;
        let way = |force: Vec3| now.dot(force) + surprise * force.length();
        // What is on its way to the hand already will be paid first.
        let promised: f32 = self.sent[..late].iter().map(|&f| way(f).max(0.0)).sum();
        let funds = self.energy_nmm as f32 + config.advance_nmm - promised;
        let price = way(force) + late as f32 * surprise * force.length();
        if !(price > 0.0 && price > funds) { 1.0 } else { (funds / price).max(0.0) }
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

    /// One tick: `force` is sent, then the tip moves.
    fn tick(observer: &mut PassivityObserver, force: Vec3, motion: Vec3) {
        observer.send(force);
        observer.book(motion, &PassivityConfig::default());
    }

    #[test]
    fn a_spring_pressed_and_released_costs_nothing_and_a_kick_is_noticed() {
        let config = PassivityConfig::default();
        let mut observer = PassivityObserver::default();
        tick(&mut observer, Vec3::Z, Vec3::NEG_Z * 0.5);
        assert_eq!(observer.energy_nmm(), 0.5);
        assert_eq!(observer.damping(1.0, &config), Vec3::ZERO);
        tick(&mut observer, Vec3::Z, Vec3::Z * 0.75);
        assert_eq!(observer.energy_nmm(), -0.25);
        tick(&mut observer, Vec3::ZERO, Vec3::Z * 0.5);
        let damping = observer.damping(1.0, &config);
        assert!((damping + Vec3::Z * 0.5).length() < 1e-6, "pays 0.25 N mm back over the next 0.5 mm: {damping}");
    }

    #[test]
    fn damping_and_credit_are_bounded_and_nan_is_not_booked() {
        let config = PassivityConfig::default();
        let mut observer = PassivityObserver::default();
        tick(&mut observer, Vec3::Z, Vec3::NEG_Z * 1e6);
        assert_eq!(observer.energy_nmm(), 20.0);
        tick(&mut observer, Vec3::NAN, Vec3::ONE);
        tick(&mut observer, Vec3::Z, Vec3::Z * 1e6);
        tick(&mut observer, Vec3::ZERO, Vec3::X * 0.1);
        assert!(observer.damping(1.0, &config).length() <= 1.0 + 1e-6);
        tick(&mut observer, Vec3::ZERO, Vec3::X * 1e-4);
        assert_eq!(observer.damping(1.0, &config), Vec3::ZERO);
    }

    #[test]
    fn a_hand_that_leaves_fast_gets_what_it_paid_and_one_that_presses_gets_all() {
        let config = PassivityConfig::default();
        let mut observer = PassivityObserver::default();
        tick(&mut observer, Vec3::Z, Vec3::NEG_Z * 0.2);
        tick(&mut observer, Vec3::Z, Vec3::NEG_Z * 0.2);
        assert_eq!(observer.affordable(Vec3::Z * 3.0, &config), 1.0, "pressing");
        tick(&mut observer, Vec3::Z, Vec3::Z * 0.2);
        tick(&mut observer, Vec3::Z, Vec3::Z * 0.2);
        let share = observer.affordable(Vec3::Z * 2.0, &config);
        assert!(share * 2.0 * 0.2 <= 0.05 + 1e-6 && share > 0.0, "{share}");
    }
}
