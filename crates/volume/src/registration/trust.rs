//! Confidence of a pose: sharpness of its peak, and agreement of the results for image halves.

use super::information::Pair;
use super::powell::{Climb, Pose, climb};
use super::{Search, Start};

/// Distance from the peak at which its sharpness is measured, mm.
const BESIDE_MM: f64 = 10.0;

/// Loss of normalised information at which the confidence is halved; one noise image lost a third
/// of it.
const CHANCE: f64 = 0.003;

impl Search<'_> {
    /// Loss beside the peak in the least certain direction, relative to the loss by chance: 0 to 1.
    pub(super) fn sharpness(&self, pair: &Pair, best: Start, top: f64) -> f64 {
        let lost = |axis: usize| {
            let beside = |side: f64| {
                let pose: Pose = std::array::from_fn(|a| if a == axis { side * BESIDE_MM } else { 0.0 });
                pair.at(self.moving_from_fixed(best, &pose)).normalised.max(1.0)
            };
            top - 0.5 * (beside(-1.0) + beside(1.0))
        };
        let least = (0..6).map(lost).fold(f64::INFINITY, f64::min).max(0.0);
        least / (least + CHANCE)
    }

    /// Root mean square distance from `best` of the results for the fixed image's six halves, mm.
    pub(super) fn halves_mm(&self, best: Start) -> f64 {
        let (fixed, moving) = &self.levels[1];
        let there = moving.voxel_from_world * self.moving_from_fixed(best, &[0.0; 6]);
        let mut points = fixed.points(60_000);
        points.retain(|p| moving.at(there.transform_point3(p.world).as_vec3()).is_some());
        let away = |half: usize| {
            let mut places: Vec<f64> = points.iter().map(|p| p.world[half / 2]).collect();
            let at = places.len() / 2;
            let middle = if places.is_empty() { 0.0 } else { *places.select_nth_unstable_by(at, f64::total_cmp).1 };
            let points: Vec<_> =
                points.iter().filter(|p| (p.world[half / 2] < middle) == half.is_multiple_of(2)).copied().collect();
            let (bins, least_overlap) = (self.config.bins, self.config.least_overlap);
            let pair = Pair { points: &points, moving, bins, least_overlap };
            let height = |pose: &Pose| pair.at(self.moving_from_fixed(best, pose)).normalised;
            let (pose, _) = climb(&height, [0.0; 6], Climb { step: 3.0, tolerance: 0.3, sweeps: 5 });
            best.moved(&pose).distance_mm(best)
        };
        ((0..6).map(|half| away(half).powi(2)).sum::<f64>() / 6.0).sqrt()
    }
}
