//! A simulated hand on a device, pressing a wall through the guard: what comes out must not be more
//! than what went in.

use trepan_contact::{
    Contact, ContactManifold, ForceGuard, ForceModel, GuardConfig, GuardCounters, PassivityConfig, Viscoelastic,
};
use trepan_geometry::{Pose, ToolState, Twist, Vec3};

/// Device and hand: a mass on a spring and damper whose rest the mind moves. Semi-implicit Euler at
/// 20 us.
#[derive(Clone, Copy)]
struct Hand {
    mass_g: f32,
    stiffness: f32,
    damping: f32,
    rest: f32,
    x: f32,
    v: f32,
}

impl Hand {
    /// A firm grip, a light one, and a device that flies free against a soft stop at 3 mm.
    const ALL: [Self; 3] = [Self::grip(195.0, 0.4, 5.0), Self::grip(95.0, 0.15, 2.0), Self::grip(45.0, 0.0, 0.0)];
    /// Viscous friction of the device, N ms/mm.
    const FRICTION: f32 = 0.1;

    const fn grip(mass_g: f32, stiffness: f32, damping: f32) -> Self {
        Self { mass_g, stiffness, damping, rest: 1.0, x: 1.0, v: -0.1 }
    }

    /// One tick of 1 ms under a held `force`, N.
    fn tick(&mut self, force: f32, aim: f32) {
        for _ in 0..50 {
            self.rest += (aim - self.rest) * 0.002;
            let stop = -0.1 * (self.x - 3.0).max(0.0);
            let hand = self.stiffness * (self.rest - self.x) - (self.damping + Self::FRICTION) * self.v + stop;
            self.v += (force + hand) / self.mass_g * 0.02;
            self.x += self.v * 0.02;
        }
    }
}

struct Wall {
    stiffness: f32,
    delay: usize,
    passivity: Option<PassivityConfig>,
}

/// The most that the wall has given out above what it got, N mm, in `ticks`.
fn leak(wall: &Wall, mut hand: Hand, ticks: u32) -> (f64, GuardCounters) {
    let config = GuardConfig { ramp_in_ms: 0.0, passivity: wall.passivity, ..GuardConfig::default() };
    let (mut guard, mut model) = (ForceGuard::new(config), Viscoelastic { stiffness: wall.stiffness, damping: 1.0 });
    let (mut random, mut aim, mut energy, mut lowest) = (1u32, -4.0, 0.0f64, 0.0f64);
    let (mut on_its_way, mut last_x) = ([0.0f32; 4], hand.x);
    for t in 0..ticks {
        random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        if random >> 24 < 2 {
            aim = (random >> 8 & 0xffff) as f32 / 65536.0 * 12.0 - 9.0;
        }
        let tool = ToolState {
            time_ms: f64::from(t + 1),
            twist: Twist { linear: Vec3::Z * (hand.x - last_x), angular: Vec3::ZERO },
            ..ToolState::at(Pose::from_translation(Vec3::Z * hand.x))
        };
        let mut touch = ContactManifold::default();
        if hand.x < 0.0 {
            touch.set_single(Contact { point: Vec3::ZERO, normal: Vec3::Z, depth_mm: -hand.x });
        }
        on_its_way.rotate_right(1);
        on_its_way[0] = guard.guard(model.wrench(&tool, &touch, 1.0), &tool, 1.0).force().z;
        last_x = hand.x;
        hand.tick(on_its_way[wall.delay], aim);
        energy -= f64::from(on_its_way[wall.delay]) * f64::from(hand.x - last_x);
        lowest = lowest.min(energy);
    }
    (-lowest, guard.counters())
}

/// The controller for positions that are exact.
fn exact(delay: usize) -> PassivityConfig {
    PassivityConfig { delay_ticks: delay as u8, quantum_mm: 0.0, ..PassivityConfig::default() }
}

#[test]
fn the_wall_never_gives_out_a_tenth_of_a_millijoule_more_than_it_got() {
    let mut worst_without = 0.0f64;
    for stiffness in [0.3, 1.0, 2.0] {
        for delay in [0, 1, 2] {
            for hand in Hand::ALL {
                let (with, counters) = leak(&Wall { stiffness, delay, passivity: Some(exact(delay)) }, hand, 40_000);
                let (without, _) = leak(&Wall { stiffness, delay, passivity: None }, hand, 15_000);
                println!(
                    "k {stiffness} delay {delay} {:>3} g: with {with:.4} without {without:.3} {counters:?}",
                    hand.mass_g
                );
                worst_without = worst_without.max(without);
                assert_eq!(counters.restarted, 0);
                assert!(with <= 0.1, "k {stiffness} delay {delay} mass {}: {with} N mm", hand.mass_g);
            }
        }
    }
    assert!(worst_without > 10.0, "the unguarded wall must show the fault: {worst_without} N mm");
}

#[test]
fn a_stable_wall_is_left_alone() {
    let wall = Wall { stiffness: 1.0, delay: 0, passivity: Some(exact(0)) };
    let (_, counters) = leak(&wall, Hand::ALL[0], 20_000);
    assert_eq!((counters.bounded, counters.passivity, counters.restarted), (0, 0, 0));
}
