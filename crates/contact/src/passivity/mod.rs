//! Passivity observer and controller: the virtual wall must not give out more energy than the hand
//! has put in.
//!
//! # Theory
//! With F the force on the hand, held between two ticks, and x the tip, the energy that the scene
//! has taken up is
//! ```text
//! E(n) = E(n-1) - F(n-1)·(x(n) - x(n-1))                     exact for a held force and an exact x
//! ```
//! E < 0 means that the wall has made energy: a sampled spring of stiffness k makes
//! `k v² T (T/2 + d)` a tick when the force is d late. Three answers, from the gentlest on:
//! ```text
//! 1 damp     F ← F (1 - clamp(α v·n/|F|, ±1)),  n = F/|F|
//!            along the force alone; it never pulls and never more than doubles F
//!            α grows by the energy made, stays while in contact, fades in free motion
//! 2 bound    |F| d ≤ E + ε,   d = (v·n + margin) T
//!            d: the way that the hand may go along F in the coming tick
//! 3 restart  a force limited for a stated time while the scene still asks for it:
//!            account and force begin anew, counted
//! ```
//! A damper cannot undo what a held force is about to give, hence the bound (the energy bounding of
//! Kim and Ryu). A damper that stops as soon as E ≥ 0 lets the oscillation come back at once, hence
//! the memory. A hand at rest gets no power whatever the force, so the bound is exactly silent
//! there; and a wall that has lost its force inside the hand's reach could never earn it back at
//! F = 0, hence the restart.
//!
//! **Encoder steps.** A staircase spring is conservative, but each trembling across one edge would
//! book `k Δ²`. So E is booked by the sure way of the hand ([`track`]), which is right to `|F| Δ`.
//! The damper learns from a second account by positions as read, which doubts too much rather than
//! too little: damping costs no force at rest.
//!
//! # Practice
//! Energy in N mm (= mJ). What the user has put in is credited up to `max_stored_nmm`, and until
//! the contact ends: a long quiet history would hide a fresh oscillation (Ryu's problem of the full
//! tank). While the hand rests a negative account fades in `recovery_ms`. A device that applies
//! forces late is told by `delay_ticks`: the account then books the force that the hand feels.
//!
//! # Limits
//! The motors give out at most 0.1 mJ more than they got with exact positions, delays to 2 ticks
//! and walls to 2 N/mm, over any number of contacts and over each by itself, as long as nothing is
//! restarted or fades. A restart may give up to `max_stored_nmm`. With encoder steps add what they
//! hide, `|F| Δ`; an oscillation within one step is not seen at all. It is stilled by the device's
//! own friction if that is at least `k Δ/2` (Abbott and Okamura), else it stays at about one step.
//! A delay that is declared too small leaks `k v² T` a tick for each.
//!
//! # Sources
//! B. Hannaford, J.-H. Ryu, *Time-domain passivity control of haptic interfaces*, IEEE Trans.
//! Robotics and Automation 18 (2002); J.-P. Kim, J. Ryu, *Robustly stable haptic interaction
//! control using an energy-bounding algorithm*, Int. J. Robotics Research 29 (2010); J. J. Abbott,
//! A. M. Okamura, *Effects of position quantization and sampling rate on virtual-wall passivity*,
//! IEEE Trans. Robotics 21 (2005).
//!
//! # When not to use it
//! As a replacement for a stable wall: it answers one tick late, and it can only guess what the
//! hand does in the tick to come.

mod track;

use track::Track;
use trepan_geometry::Vec3;

/// Most ticks between a force and the hand.
const MAX_DELAY: usize = 4;
/// A numerical parameter: damping for each N mm that was made, N ms/mm, full damping at half of the
/// usual advance.
const DAMPING_PER_NMM: f64 = 400.0;
/// Part of the hand's way that the next tick may add to it.
const SURPRISE: f32 = 0.2;
/// A force under this share of what is wanted is held short.
const SHORT: f32 = 0.9;
/// A force held short for more than this share of the time restarts; held back at each step
/// outwards, it comes and goes.
const SHORT_OF_TIME: f32 = 0.2;
/// Most times that the wait for a restart doubles.
const MAX_DOUBLINGS: u32 = 5;

/// Limits of the controller.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PassivityConfig {
    /// Largest damping that the controller injects, N ms/mm. 10 holds a 2 N/mm wall on a Touch; 0
    /// only observes.
    pub max_damping: f32,
    /// Time in which learnt damping fades while nothing is touched, ms. In contact it stays: else
    /// the oscillation would come back.
    pub damping_memory_ms: f32,
    /// Most energy that the wall may owe the hand, N mm. A spring of k at the force limit F stores
    /// F²/2k: 18 N mm for 0.3 N/mm.
    pub max_stored_nmm: f32,
    /// Energy that may be given out in advance, N mm: what the bound starts from. 0.05 is half of
    /// what a hand could ever notice.
    pub advance_nmm: f32,
    /// Time in which a negative account fades while the hand rests, and the first wait before a
    /// force that is held short restarts, ms. Each further restart within one contact waits twice
    /// as long.
    pub recovery_ms: f32,
    /// Speed under which the hand rests and the damper too, mm/ms.
    pub min_speed: f32,
    /// Encoder step Δ, mm; 0 for exact positions. 0.055 is the Touch's.
    pub quantum_mm: f32,
    /// Ticks between a force and its application by the device: 0 or 1 for a driver, 1 or 2 across
    /// a socket; at most 4.
    pub delay_ticks: u8,
}

impl PassivityConfig {
    /// For a Touch whose driver applies each force at once: numerical parameters of the controller.
    pub const TOUCH: Self = Self {
        max_damping: 10.0,
        damping_memory_ms: 3000.0,
        max_stored_nmm: 20.0,
        advance_nmm: 0.05,
        recovery_ms: 300.0,
        min_speed: 1e-3,
        quantum_mm: 0.055,
        delay_ticks: 0,
    };
}

impl Default for PassivityConfig {
    fn default() -> Self {
        Self::TOUCH
    }
}

/// The energy account of one hand.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PassivityObserver {
    energy_nmm: f64,
    lowest_nmm: f64,
    /// The account by positions as read; it fades in free motion.
    doubted_nmm: f64,
    damping: f32,
    track: Track,
    /// Forces sent, newest first.
    sent: [Vec3; MAX_DELAY + 1],
    short_ms: f32,
    restarts: u32,
}

impl PassivityObserver {
    /// Books the tick that has passed: the tip is now read at `tip`, under the force that was sent
    /// `delay_ticks` before the last one. `touching`: the scene wants a force.
    pub fn book(&mut self, tip: Vec3, touching: bool, dt_ms: f32, config: &PassivityConfig) {
        let moved = self.track.follow(tip, config.quantum_mm);
        let felt = self.sent[late(config)].as_dvec3();
        let (sure, seen) = (-felt.dot(moved.sure.as_dvec3()), -felt.dot(moved.seen.as_dvec3()));
        if !sure.is_finite() || !seen.is_finite() {
            return;
        }
        let most = f64::from(config.max_stored_nmm);
        self.energy_nmm = (self.energy_nmm + sure).min(most);
        self.lowest_nmm = self.lowest_nmm.min(self.energy_nmm);
        if self.energy_nmm < 0.0 && self.speed(dt_ms) < config.min_speed {
            self.energy_nmm *= 1.0 - f64::from(share(dt_ms, config.recovery_ms));
        }
        self.doubted_nmm = (self.doubted_nmm + seen).min(most);
        if !touching && self.sent[..=late(config)].iter().all(|force| *force == Vec3::ZERO) {
            // The wall holds nothing: what an earlier contact put in pays for no later one.
            self.energy_nmm = self.energy_nmm.min(0.0);
        }
        if !touching {
            self.doubted_nmm *= 1.0 - f64::from(share(dt_ms, config.recovery_ms));
        }
        self.learn(touching, dt_ms, config);
    }

    /// The tip has jumped or was lost: the next position starts a new track.
    pub fn lose_track(&mut self) {
        self.track.lose();
    }

    /// Notes the force that goes to the device now, N.
    pub fn send(&mut self, force: Vec3) {
        self.sent.rotate_right(1);
        self.sent[0] = force;
    }

    /// `force` with the controller's damping along it, N.
    pub fn damped(&self, force: Vec3, dt_ms: f32, config: &PassivityConfig) -> Vec3 {
        let size = force.length();
        if self.damping <= 0.0 || size <= 0.0 || !size.is_finite() || self.speed(dt_ms) < config.min_speed {
            return force;
        }
        let along = self.track.motion().dot(force / size) / dt_ms;
        force * (1.0 - (self.damping * along / size).clamp(-1.0, 1.0))
    }

    /// The share of `force` that the account can pay for in the coming tick, 0 to 1; always 1 for a
    /// hand at rest.
    pub fn affordable(&self, force: Vec3, config: &PassivityConfig) -> f32 {
        let late = late(config);
        let motion = self.track.motion();
        // Between encoder steps a change of motion is not known; with exact positions it is the
        // best guess of the next one.
        let change = if config.quantum_mm > 0.0 { 0.0 } else { self.track.unevenness() };
        let surprise = SURPRISE * motion.length() + change;
        let way = |force: Vec3| motion.dot(force) + surprise * force.length();
        // What is on its way to the hand already will be paid first.
        let promised: f32 = self.sent[..late].iter().map(|&f| way(f).max(0.0)).sum();
        let funds = self.energy_nmm as f32 + config.advance_nmm - promised;
        let price = way(force) + late as f32 * surprise * force.length();
        if !(price > 0.0 && price > funds) { 1.0 } else { (funds / price).max(0.0) }
    }

    /// Whether the force has been held short for so long that it shall begin anew; the account then
    /// already has.
    pub fn restarts(&mut self, wanted: Vec3, given: Vec3, dt_ms: f32, config: &PassivityConfig) -> bool {
        if wanted == Vec3::ZERO {
            (self.short_ms, self.restarts) = (0.0, 0);
            return false;
        }
        let short = given.length() < SHORT * wanted.length();
        self.short_ms = (self.short_ms + dt_ms * (f32::from(u8::from(short)) - SHORT_OF_TIME)).max(0.0);
        if self.short_ms < config.recovery_ms * 2f32.powi(self.restarts.min(MAX_DOUBLINGS) as i32) {
            return false;
        }
        self.restarts += 1;
        (self.short_ms, self.doubted_nmm) = (0.0, 0.0);
        self.energy_nmm = f64::from(config.max_stored_nmm);
        true
    }

    /// Energy that the wall holds for the hand, N mm; negative when it gave out more than it got.
    pub fn energy_nmm(&self) -> f64 {
        self.energy_nmm
    }

    /// The lowest that the account has been, N mm.
    pub fn lowest_nmm(&self) -> f64 {
        self.lowest_nmm
    }

    /// Damping learnt, N ms/mm.
    pub fn damping(&self) -> f32 {
        self.damping
    }

    /// Starts a new account.
    pub fn reset(&mut self) {
        *self = Self::default();
    }

    fn speed(&self, dt_ms: f32) -> f32 {
        self.track.motion().length() / dt_ms
    }

    fn learn(&mut self, touching: bool, dt_ms: f32, config: &PassivityConfig) {
        if !touching {
            self.damping *= 1.0 - share(dt_ms, config.damping_memory_ms);
            return;
        }
        let made = (-self.energy_nmm.min(self.doubted_nmm)).max(0.0);
        let needed = (DAMPING_PER_NMM * made) as f32;
        self.damping = self.damping.max(needed.min(config.max_damping));
    }
}

/// Ticks between a force and the hand.
fn late(config: &PassivityConfig) -> usize {
    usize::from(config.delay_ticks).min(MAX_DELAY)
}

/// The part of `whole_ms` that `dt_ms` is, 0 to 1.
fn share(dt_ms: f32, whole_ms: f32) -> f32 {
    if whole_ms > dt_ms { dt_ms / whole_ms } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    const EXACT: PassivityConfig = PassivityConfig { quantum_mm: 0.0, ..PassivityConfig::TOUCH };

    /// An observer whose tip is somewhere, and a way to move it.
    struct Hand(PassivityObserver, Vec3);

    impl Hand {
        fn new() -> Self {
            let mut observer = PassivityObserver::default();
            observer.book(Vec3::ZERO, true, 1.0, &EXACT);
            Self(observer, Vec3::ZERO)
        }

        /// One tick: `force` is sent, then the tip moves.
        fn tick(&mut self, force: Vec3, motion: Vec3) -> &mut PassivityObserver {
            self.1 += motion;
            self.0.send(force);
            self.0.book(self.1, force != Vec3::ZERO, 1.0, &EXACT);
            &mut self.0
        }
    }

    #[test]
    fn a_spring_pressed_and_released_costs_nothing_and_a_kick_is_noticed() {
        let mut hand = Hand::new();
        assert_eq!(hand.tick(Vec3::Z, Vec3::NEG_Z * 0.5).energy_nmm(), 0.5);
        assert_eq!(hand.0.damped(Vec3::Z, 1.0, &EXACT), Vec3::Z);
        assert_eq!(hand.tick(Vec3::Z, Vec3::Z * 0.75).energy_nmm(), -0.25);
        assert_eq!(hand.0.damping(), 10.0);
        hand.tick(Vec3::Z, Vec3::Z * 0.05);
        assert!((hand.0.damped(Vec3::Z, 1.0, &EXACT) - Vec3::Z * 0.5).length() < 1e-5, "10 N ms/mm at 0.05 mm/ms");
    }

    #[test]
    fn damping_acts_along_the_force_never_pulls_and_at_most_doubles() {
        let mut hand = Hand::new();
        hand.tick(Vec3::Z, Vec3::Z);
        for (motion, share) in [(Vec3::Z, 0.0), (Vec3::NEG_Z, 2.0), (Vec3::X, 1.0)] {
            hand.tick(Vec3::ZERO, motion);
            assert!((hand.0.damped(Vec3::Z * 0.3, 1.0, &EXACT) - Vec3::Z * 0.3 * share).length() < 1e-6, "{motion}");
        }
        assert_eq!(hand.0.damped(Vec3::ZERO, 1.0, &EXACT), Vec3::ZERO);
    }

    #[test]
    fn damping_stays_in_contact_and_fades_outside() {
        let mut hand = Hand::new();
        hand.tick(Vec3::Z, Vec3::Z);
        for _ in 0..5000 {
            hand.tick(Vec3::Z * 1e-3, Vec3::ZERO);
        }
        assert_eq!(hand.0.damping(), 10.0);
        for _ in 0..3000 {
            hand.tick(Vec3::ZERO, Vec3::ZERO);
        }
        assert!((hand.0.damping() - 10.0 / std::f32::consts::E).abs() < 0.1, "{}", hand.0.damping());
    }

    #[test]
    fn what_one_contact_put_in_pays_for_no_later_one() {
        let mut hand = Hand::new();
        assert_eq!(hand.tick(Vec3::Z, Vec3::NEG_Z * 0.5).energy_nmm(), 0.5);
        assert_eq!(hand.tick(Vec3::ZERO, Vec3::ZERO).energy_nmm(), 0.0);
        hand.tick(Vec3::Z, Vec3::Z * 0.25);
        assert_eq!(hand.tick(Vec3::ZERO, Vec3::Z).energy_nmm(), -0.25, "a debt stays");
    }

    #[test]
    fn credit_is_bounded_and_nan_is_not_booked() {
        let mut hand = Hand::new();
        assert_eq!(hand.tick(Vec3::Z, Vec3::NEG_Z * 1e6).energy_nmm(), 20.0);
        assert_eq!(hand.tick(Vec3::NAN, Vec3::ONE).energy_nmm(), 20.0);
    }

    #[test]
    fn a_hand_at_rest_gets_all_and_its_debt_fades() {
        let mut hand = Hand::new();
        hand.tick(Vec3::Z, Vec3::Z * 2.0);
        assert_eq!(hand.0.affordable(Vec3::Z * 3.0, &EXACT), 0.0, "it is leaving, and nothing is there to pay");
        for _ in 0..310 {
            hand.tick(Vec3::Z, Vec3::ZERO);
        }
        assert_eq!(hand.0.affordable(Vec3::Z * 3.0, &EXACT), 1.0);
        assert!(hand.0.energy_nmm() > -2.0 / std::f64::consts::E, "{}", hand.0.energy_nmm());
    }

    #[test]
    fn a_hand_that_leaves_fast_gets_what_it_paid_and_one_that_presses_gets_all() {
        let mut hand = Hand::new();
        hand.tick(Vec3::Z, Vec3::NEG_Z * 0.2);
        hand.tick(Vec3::Z, Vec3::NEG_Z * 0.2);
        assert_eq!(hand.0.affordable(Vec3::Z * 3.0, &EXACT), 1.0, "pressing");
        hand.tick(Vec3::Z, Vec3::Z * 0.2);
        hand.tick(Vec3::Z, Vec3::Z * 0.2);
        let share = hand.0.affordable(Vec3::Z * 2.0, &EXACT);
        assert!(share * 2.0 * 0.2 <= 0.05 + 1e-6 && share > 0.0, "{share}");
    }

    #[test]
    fn a_force_held_short_restarts_and_each_time_waits_longer() {
        let mut observer = PassivityObserver::default();
        let restarts: Vec<u32> = (1..4000).filter(|_| observer.restarts(Vec3::Z, Vec3::ZERO, 1.0, &EXACT)).collect();
        let near = |found: u32, expected: u32| found.abs_diff(expected) <= 3;
        let as_stated = restarts.iter().zip([375, 1125, 2625]).all(|(&found, expected)| near(found, expected));
        assert!(as_stated && restarts.len() == 3, "1, 2 and 4 times 300 ms at a weight of 1 - 0.2: {restarts:?}");
        assert_eq!(observer.energy_nmm(), 20.0);
        assert!(!observer.restarts(Vec3::ZERO, Vec3::ZERO, 1.0, &EXACT));
        let again = (1..=400).find(|_| observer.restarts(Vec3::Z, Vec3::ZERO, 1.0, &EXACT));
        assert!(again.is_some_and(|again| near(again, 375)), "contact was left: {again:?}");
        observer.restarts(Vec3::ZERO, Vec3::ZERO, 1.0, &EXACT);
        assert!((0..5000).all(|t| !observer.restarts(Vec3::Z, Vec3::Z * f32::from(t % 6 != 0), 1.0, &EXACT)));
    }
}
