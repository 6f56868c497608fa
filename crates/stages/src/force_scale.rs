//! Newtons of the task and newtons at the hand.
//!
//! # Theory
//! ```text
//! task = (hand - tissue) / scale + tissue
//! ```
//! People press a drill with 4 to 24 N, devices give 3 to 12 N. So the hand gets a share of the
//! force of bone, and the burr's load is the spring's force over that share. Brain forces, 0.02 to
//! 0.5 N, are sent as they are.
//!
//! # Practice
//! The share is [`ForceScale::of`] the device's greatest force unless `--force-scale` gives
//! another; it stands in the recording's header, so that a replay has the same loads. Stiffness,
//! damping and the force guard are those of the hand: the scale does not affect stability.

use trepan_link::wire::TickRecord;
use trepan_measurements::hands;

/// Newtons at the hand per newton of the task, on bone.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ForceScale(pub f32);

impl Default for ForceScale {
    fn default() -> Self {
        Self(1.0)
    }
}

impl ForceScale {
    /// Range of `--force-scale`.
    pub const RANGE: [f64; 2] = [0.01, 1.0];

    /// The scale at which the greatest published force on a drill is the greatest, N, of a device;
    /// 1 for a device that gives it.
    pub fn of(greatest_n: f32) -> Self {
        Self((greatest_n / hands::DRILLING_PEAK_GREATEST.f32()).clamp(Self::RANGE[0] as f32, 1.0))
    }

    /// Force of bone in a tick, N of the task; 0 where the tool touches none.
    pub fn bone_n(self, tick: &TickRecord) -> f32 {
        let touches = tick.depth_mm > 0.0;
        if touches { (tick.wrench.force - tick.tissue_force).length() / self.0 } else { 0.0 }
    }

    /// Force of the task in a tick, N, from the force on the hand.
    pub fn task_n(self, tick: &TickRecord) -> f32 {
        ((tick.wrench.force - tick.tissue_force) / self.0 + tick.tissue_force).length()
    }

    /// The scale in words.
    pub fn text(self) -> String {
        if self.0 == 1.0 {
            "the hand gets the newtons of the task".into()
        } else {
            format!("newtons of the task; the hand gets {:.3} of those of bone", self.0)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use trepan_geometry::{Vec3, Wrench};

    #[test]
    fn bone_is_scaled_and_tissue_is_not() {
        let wrench = Wrench { force: 2.2 * Vec3::Z, torque: Vec3::ZERO };
        let tick = TickRecord { wrench, tissue_force: 0.2 * Vec3::Z, ..TickRecord::default() };
        assert_eq!(ForceScale(0.2).bone_n(&tick), 0.0, "no bone is touched");
        assert!((ForceScale(0.2).bone_n(&TickRecord { depth_mm: 0.1, ..tick }) - 10.0).abs() < 1e-5);
        assert!(
            (ForceScale(0.2).task_n(&tick) - 10.2).abs() < 1e-5 && (ForceScale(1.0).task_n(&tick) - 2.2).abs() < 1e-6
        );
    }

    #[test]
    fn a_strong_device_needs_no_scale_and_a_weak_one_gives_its_peak_at_the_greatest_force() {
        assert_eq!(ForceScale::of(37.5), ForceScale(1.0));
        let touch = ForceScale::of(3.3);
        assert!((touch.0 * hands::DRILLING_PEAK_GREATEST.f32() - 3.3).abs() < 1e-5);
        assert_eq!(touch.0, trepan_rigid::removal::FORCE_SCALE, "that of a hand without limits");
        assert!(touch.text().contains("0.136"));
    }
}
