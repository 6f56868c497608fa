//! How far one run of the operation is from the finest one.

use crate::scripted::{FELT_N, PLACE_MM, Ride, surfaces};
use trepan_budget::{Scene, TissueForce};
use trepan_geometry::quantile;

/// What differs.
pub struct Errors {
    /// Error of the force while the probe touches no bone, root mean square, N. It counts where one
    /// of the two feels something.
    pub tissue_rms_n: f64,
    /// The same: what 95 of 100 ticks stay under.
    pub tissue_p95_n: f64,
    /// The same over what the default tolerances allow of the force at each tick.
    pub tissue_over: f64,
    /// Error of the brain's surface at the opening, mm, while the probe is in the hand. It is the
    /// distance from where the finest run shows it to the nearest place of this run's brain.
    pub shown_mean_mm: f64,
    /// See above: what 95 of 100 places and looks stay under.
    pub shown_p95_mm: f64,
    /// The same before anything has touched the brain: what the coarser shape alone does.
    pub rest_p95_mm: f64,
    /// From this run's brain at rest at the opening to the surface of the mask that both were made
    /// of, mm.
    pub mask_p95_mm: f64,
    /// Bone that is gone in one run only, mm³.
    pub bone_mm3: f64,
    /// Overlap of the bone that is gone (Dice 1945).
    pub bone_dice: f64,
}

impl Errors {
    /// Of a run from the finest one along the same path.
    pub fn between(ride: &Ride, truth: &Ride) -> Self {
        let on_tissue = |tick: &usize| truth.probing[*tick] && !ride.on_bone[*tick] && !truth.on_bone[*tick];
        let scene = Scene::default();
        let apart = |tick: usize| {
            let (a, b) = (ride.forces[tick], truth.forces[tick]);
            let force = TissueForce { error_n: a.distance(b).into(), force_n: b.length().into() };
            (a.length() > FELT_N || b.length() > FELT_N).then_some(force)
        };
        let felt: Vec<TissueForce> = (0..truth.forces.len()).filter(on_tissue).filter_map(apart).collect();
        let mut tissue: Vec<f64> = felt.iter().map(|force| force.error_n).collect();
        let mut over: Vec<f64> = felt.iter().map(|force| force.error_n / force.allowed_n(&scene)).collect();
        let (mut rest, mut shown) = surfaces(ride, truth);
        let both = ride.removed.iter().zip(&truth.removed);
        let count = |wanted: fn(bool, bool) -> bool| both.clone().filter(|(a, b)| wanted(**a, **b)).count() as f64;
        let (common, apart) = (count(|a, b| a && b), count(|a, b| a != b));
        Self {
            tissue_rms_n: rms(&tissue),
            tissue_p95_n: quantile(&mut tissue, 0.95),
            tissue_over: quantile(&mut over, 0.95),
            shown_mean_mm: shown.iter().sum::<f64>() / shown.len() as f64,
            shown_p95_mm: quantile(&mut shown, 0.95),
            rest_p95_mm: quantile(&mut rest, 0.95),
            mask_p95_mm: quantile(&mut ride.from_mask_mm.iter().copied().map(f64::from).collect::<Vec<_>>(), 0.95),
            bone_mm3: apart * f64::from(PLACE_MM.powi(3)),
            bone_dice: 2.0 * common / (2.0 * common + apart),
        }
    }

    /// By their names with units.
    pub fn named(&self) -> [(&'static str, f64); 9] {
        [
            ("tissue_force_error_rms_n", self.tissue_rms_n),
            ("tissue_force_error_p95_n", self.tissue_p95_n),
            ("tissue_force_error_over_tolerance", self.tissue_over),
            ("shown_error_mean_mm", self.shown_mean_mm),
            ("shown_error_p95_mm", self.shown_p95_mm),
            ("rest_error_p95_mm", self.rest_p95_mm),
            ("rest_from_mask_p95_mm", self.mask_p95_mm),
            ("bone_error_mm3", self.bone_mm3),
            ("bone_dice", self.bone_dice),
        ]
    }
}

fn rms(errors: &[f64]) -> f64 {
    (errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scripted::tests::hand_made as ride;

    /// By hand: 0.3 N everywhere; surface off by 0.5 mm at rest and 0.7 mm when it is pressed; 60
    /// against 80 places gone.
    #[test]
    fn errors_are_those_of_hand_made_runs() {
        let errors = Errors::between(&ride(1.3, 8.5, 1.2, 60), &ride(1.0, 8.0, 1.0, 80));
        let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-5, "{a} and {b}");
        [errors.tissue_rms_n, errors.tissue_p95_n].into_iter().for_each(|e| near(e, 0.3));
        near(errors.shown_p95_mm, 0.7);
        near(errors.shown_mean_mm, 0.7);
        near(errors.rest_p95_mm, 0.5);
        near(errors.mask_p95_mm, 0.25);
        near(errors.bone_mm3, 20.0 * 0.125);
        near(errors.bone_dice, 120.0 / 140.0);
        let same = Errors::between(&ride(1.0, 8.0, 1.0, 80), &ride(1.0, 8.0, 1.0, 80));
        assert_eq!((same.tissue_rms_n, same.shown_p95_mm, same.bone_dice), (0.0, 0.0, 1.0));
    }
}
