//! Couplings of a device, a hand and a wall, and their theoretical stability bounds.

use super::{Scope, at};
use trepan_contact::Viscoelastic;
use trepan_haptics::HapticDevice;
use trepan_haptics::replay::Replay;
use trepan_haptics::simulated::{Config, HandModel, Simulated};

/// Devices: name, friction, encoder step, length of a tick.
const DEVICES: [(&str, f32, f32, f32); 6] = [
    ("Touch", 0.26, 0.055, 1.0),
    ("exact positions, no friction", 0.0, 0.0, 1.0),
    ("10 µm steps, no friction", 0.0, 0.01, 1.0),
    ("55 µm steps, no friction", 0.0, 0.055, 1.0),
    ("Touch at 4 kHz", 0.26, 0.055, 0.25),
    ("exact positions, no friction, 4 kHz", 0.0, 0.0, 0.25),
];

/// Hands: light, firm, and a finger with little damping.
const HANDS: [(&str, HandModel); 3] = [
    ("light grip", HandModel::LIGHT),
    ("firm grip", HandModel::FIRM),
    ("loose finger", HandModel { mass_g: 10.0, damping: 0.1, stiffness: 0.1 }),
];

/// Device, hand and wall in one loop.
#[derive(Clone, Copy)]
pub struct Coupling {
    /// Names of device and hand.
    pub names: [&'static str; 2],
    pub device: Config,
    pub hand: HandModel,
    pub wall: Viscoelastic,
    pub tick_ms: f32,
}

impl Coupling {
    /// Whether the acceptance limits apply to it.
    pub fn declared(&self) -> bool {
        let device = &self.device;
        let grip = self.hand.damping >= HandModel::LIGHT.damping;
        let seen = 0.5 * self.wall.stiffness * device.quantum_mm <= device.friction_n;
        grip && seen && self.wall.stiffness <= 2.0 && device.delay_ticks <= 2
    }

    /// The coupling with the wall stiffness that a session would use on this device.
    pub fn limited(&self) -> Self {
        let device = Simulated::new(self.device, self.hand, Box::new(Replay::new(vec![at(0.0)])));
        Self { wall: device.capabilities().coupled(self.wall, self.tick_ms), ..*self }
    }

    fn late_ms(&self) -> f32 {
        (0.5 + self.device.delay_ticks as f32) * self.tick_ms
    }

    pub fn ticks(&self, time_ms: f32) -> usize {
        (time_ms / self.tick_ms).ceil() as usize
    }

    pub fn gil(&self) -> f32 {
        (self.device.damping + self.hand.damping + self.wall.damping) / self.late_ms()
    }

    pub fn colgate(&self) -> f32 {
        (self.device.damping - self.wall.damping).max(0.0) / self.late_ms()
    }
}

/// The wall of a session on a Touch.
pub const MILLION: Coupling = Coupling {
    names: ["Touch", "light grip"],
    device: Config::TOUCH,
    hand: HandModel::LIGHT,
    wall: Viscoelastic { stiffness: 2.0, damping: 0.5 },
    tick_ms: 1.0,
};

/// All couplings, each with its scene name.
pub fn all(scope: Scope) -> Vec<(String, Coupling)> {
    let stiffnesses = scope.pick(&[0.3f32, 0.8, 2.0, 5.0][..], &[0.1, 0.3, 0.5, 0.8, 1.2, 2.0, 3.0, 5.0][..]);
    let dampings = scope.pick(&[0.0f32, 0.5][..], &[0.0, 0.5, 1.0, 2.0][..]);
    let mut found = Vec::new();
    for (name, friction_n, quantum_mm, tick_ms) in DEVICES {
        // 4 kHz has four times the ticks: it is run only where it matters.
        let (hands, delays, dampings) = if tick_ms < 1.0 {
            (&HANDS[..1], &[1, 2][..], &[0.5f32][..])
        } else {
            (&HANDS[..], &[0, 1, 2][..], dampings)
        };
        for &(grip, hand) in hands {
            for &delay_ticks in delays {
                for &stiffness in stiffnesses {
                    for &damping in dampings {
                        let device = Config { friction_n, quantum_mm, delay_ticks, ..Config::default() };
                        let wall = Viscoelastic { stiffness, damping };
                        let coupling = Coupling { names: [name, grip], device, hand, wall, tick_ms };
                        found.push((format!("{name}, {grip}, {delay_ticks} ticks late"), coupling));
                    }
                }
            }
        }
    }
    found
}

#[cfg(test)]
pub mod tests {
    use super::*;

    pub fn coupling(stiffness: f32, delay_ticks: usize) -> Coupling {
        let device = Config { friction_n: 0.0, quantum_mm: 0.0, delay_ticks, ..Config::default() };
        let wall = Viscoelastic { stiffness, damping: 0.0 };
        Coupling { names: ["bench", "light grip"], device, hand: HandModel::LIGHT, wall, tick_ms: 1.0 }
    }

    #[test]
    fn the_bounds_are_the_papers() {
        let touch = coupling(1.0, 1);
        assert!((touch.gil() - 1.4).abs() < 1e-6 && (touch.colgate() - 0.1 / 1.5).abs() < 1e-6);
        assert!(touch.declared() && !coupling(2.1, 1).declared() && !coupling(1.0, 3).declared());
        let coarse = Config { quantum_mm: 0.055, ..touch.device };
        assert!(!Coupling { device: coarse, ..touch }.declared());
        assert!(Coupling { device: Config { friction_n: 0.26, ..coarse }, ..touch }.declared());
    }
}
