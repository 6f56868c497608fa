//! How far one run of the operation is from the finest one.

use super::ride::{LOOK_MS, PLACE_MM, Ride};

/// A force under this is no contact, N.
const FELT_N: f32 = 0.02;

/// What differs.
pub struct Errors {
    /// Force while the burr is in the hand and one of the two feels bone, N: root mean square, and what 95 of 100 ticks stay under.
    pub bone_rms_n: f64,
    /// See above.
    pub bone_p95_n: f64,
    /// The same while the probe is in the hand.
    pub tissue_rms_n: f64,
    /// See above.
    pub tissue_p95_n: f64,
    /// Between the brain as it is shown at the opening, and the finest, while the probe is in the hand, mm.
    pub shown_mean_mm: f64,
    /// See above: what 95 of 100 places and looks stay under.
    pub shown_p95_mm: f64,
    /// The same of its motion alone: from where it was in the first look.
    pub moved_p95_mm: f64,
    /// Bone that is gone in one run only, mm³.
    pub bone_mm3: f64,
    /// Overlap of the bone that is gone (Dice 1945).
    pub bone_dice: f64,
}

impl Errors {
    /// Of a run from the finest one along the same path.
    pub fn between(ride: &Ride, truth: &Ride) -> Self {
        let felt = |probing: bool| {
            let ticks = ride.forces.iter().zip(&truth.forces).zip(&truth.probing).filter(|(_, p)| **p == probing);
            let felt = ticks.filter(|((a, b), _)| a.length() > FELT_N || b.length() > FELT_N);
            felt.map(|((a, b), _)| f64::from(a.distance(*b))).collect::<Vec<_>>()
        };
        let (bone, tissue) = (felt(false), felt(true));
        let (shown, moved) = surfaces(ride, truth);
        let both = ride.removed.iter().zip(&truth.removed);
        let count = |wanted: fn(bool, bool) -> bool| both.clone().filter(|(a, b)| wanted(**a, **b)).count() as f64;
        let (common, apart) = (count(|a, b| a && b), count(|a, b| a != b));
        Self {
            bone_rms_n: rms(&bone),
            bone_p95_n: p95(&bone),
            tissue_rms_n: rms(&tissue),
            tissue_p95_n: p95(&tissue),
            shown_mean_mm: shown.iter().sum::<f64>() / shown.len() as f64,
            shown_p95_mm: p95(&shown),
            moved_p95_mm: p95(&moved),
            bone_mm3: apart * f64::from(PLACE_MM.powi(3)),
            bone_dice: 2.0 * common / (2.0 * common + apart),
        }
    }

    /// By their names with units.
    pub fn named(&self) -> [(&'static str, f64); 9] {
        [
            ("bone_force_error_rms_n", self.bone_rms_n),
            ("bone_force_error_p95_n", self.bone_p95_n),
            ("tissue_force_error_rms_n", self.tissue_rms_n),
            ("tissue_force_error_p95_n", self.tissue_p95_n),
            ("shown_error_mean_mm", self.shown_mean_mm),
            ("shown_error_p95_mm", self.shown_p95_mm),
            ("motion_error_p95_mm", self.moved_p95_mm),
            ("bone_error_mm3", self.bone_mm3),
            ("bone_dice", self.bone_dice),
        ]
    }
}

/// Differences of the surface, and of its motion, at every place and look while the brain is probed.
fn surfaces(ride: &Ride, truth: &Ride) -> (Vec<f64>, Vec<f64>) {
    let probing = |look: usize| truth.probing[((look + 1) * LOOK_MS as usize - 1).min(truth.probing.len() - 1)];
    let (mut shown, mut moved) = (Vec::new(), Vec::new());
    for look in (0..truth.looks.len().min(ride.looks.len())).filter(|&look| probing(look)) {
        for place in 0..truth.looks[look].len() {
            let [is, was] = [look, 0].map(|look| [ride.looks[look][place], truth.looks[look][place]].map(f64::from));
            shown.push((is[0] - is[1]).abs());
            moved.push(((is[0] - was[0]) - (is[1] - was[1])).abs());
        }
    }
    shown.retain(|error| error.is_finite());
    moved.retain(|error| error.is_finite());
    (shown, moved)
}

fn rms(errors: &[f64]) -> f64 {
    (errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64).sqrt()
}

/// What 95 of 100 stay under; NaN without any.
fn p95(errors: &[f64]) -> f64 {
    let mut sorted = errors.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted.get((sorted.len() * 95 / 100).min(sorted.len().saturating_sub(1))).copied().unwrap_or(f64::NAN)
}

#[cfg(test)]
mod tests {
    use super::*;
    use trepan_geometry::Vec3;
    use trepan_haptics::script::Site;

    fn ride(newtons: f32, depth_mm: f32, dip_mm: f32, gone: usize) -> Ride {
        let ticks = 4 * LOOK_MS as usize;
        Ride {
            setup: String::new(),
            site: Site { entry: Vec3::ZERO, inward: Vec3::NEG_Z, bone_mm: 6.0, brain_mm: 8.0 },
            forces: vec![Vec3::X * newtons; ticks],
            probing: (0..ticks).map(|tick| tick >= ticks / 2).collect(),
            looks: [0.0, 0.0, dip_mm, dip_mm].map(|dip| vec![depth_mm + dip, f32::NAN]).to_vec(),
            removed: (0..100).map(|place| place < gone).collect(),
            cpu_s: [0.0; 3],
            steps: 0,
            seconds: 1.0,
            memory_mb: 0.0,
        }
    }

    /// By hand: 0.3 N everywhere; surface off by 0.5 mm at rest and 0.2 mm of motion; 60 against 80 places gone.
    #[test]
    fn errors_are_those_of_hand_made_runs() {
        let errors = Errors::between(&ride(1.3, 8.5, 1.2, 60), &ride(1.0, 8.0, 1.0, 80));
        let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-5, "{a} and {b}");
        [errors.bone_rms_n, errors.bone_p95_n, errors.tissue_rms_n, errors.tissue_p95_n].map(|e| near(e, 0.3));
        near(errors.shown_p95_mm, 0.7);
        near(errors.shown_mean_mm, 0.7);
        near(errors.moved_p95_mm, 0.2);
        near(errors.bone_mm3, 20.0 * 0.125);
        near(errors.bone_dice, 120.0 / 140.0);
        let same = Errors::between(&ride(1.0, 8.0, 1.0, 80), &ride(1.0, 8.0, 1.0, 80));
        assert_eq!((same.bone_rms_n, same.shown_p95_mm, same.bone_dice), (0.0, 0.0, 1.0));
    }
}
