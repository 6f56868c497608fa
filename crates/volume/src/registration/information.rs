//! Normalised mutual information of the joint histogram of two images at a pose.

use super::pyramid::{Level, Point};
use glam::DAffine3;
use rayon::prelude::*;

/// Points that one thread processes at a time; it alone determines the order of summation, so
/// results are bit-identical.
const CHUNK: usize = 16_384;

/// Two images at one level of the pyramid.
pub(super) struct Pair<'a> {
    pub points: &'a [Point],
    pub moving: &'a Level,
    pub bins: usize,
    pub least_overlap: f64,
}

/// The similarity of two images at a pose.
#[derive(Clone, Copy, Debug)]
pub(super) struct Shared {
    /// (H(F) + H(M)) / H(F, M), 1 to 2; under 1 where too few points overlap.
    pub normalised: f64,
    /// Share of the fixed image's points that lie in the moving image.
    pub overlap: f64,
}

impl Pair<'_> {
    /// Computes the similarity at a pose.
    pub fn at(&self, moving_from_fixed: DAffine3) -> Shared {
        let voxel_from_fixed = self.moving.voxel_from_world * moving_from_fixed;
        let part = |points: &[Point]| self.histogram(voxel_from_fixed, points);
        let parts: Vec<Vec<f32>> = match self.points.len() {
            0..=CHUNK => vec![part(self.points)],
            _ => self.points.par_chunks(CHUNK).map(part).collect(),
        };
        let mut joint = vec![0f64; self.bins * self.bins];
        for part in parts {
            joint.iter_mut().zip(part).for_each(|(sum, n)| *sum += f64::from(n));
        }
        let total: f64 = joint.iter().sum();
        let overlap = total / self.points.len().max(1) as f64;
        if overlap < self.least_overlap || total == 0.0 {
            return Shared { normalised: overlap - self.least_overlap, overlap };
        }
        Shared { normalised: normalised(&joint, self.bins, total), overlap }
    }

    /// Joint histogram; a moving value is shared linearly between its two nearest bins.
    fn histogram(&self, voxel_from_fixed: DAffine3, points: &[Point]) -> Vec<f32> {
        let mut joint = vec![0f32; self.bins * self.bins];
        for point in points {
            let Some(value) = self.moving.at(voxel_from_fixed.transform_point3(point.world).as_vec3()) else {
                continue;
            };
            let below = (value as usize).min(self.bins - 2);
            let part = value - below as f32;
            let row = &mut joint[usize::from(point.bin) * self.bins + below..][..2];
            row[0] += 1.0 - part;
            row[1] += part;
        }
        joint
    }
}

fn normalised(joint: &[f64], bins: usize, total: f64) -> f64 {
    let plogp = |n: f64| if n > 0.0 { -(n / total) * (n / total).ln() } else { 0.0 };
    let both: f64 = joint.iter().map(|&n| plogp(n)).sum();
    let fixed: f64 = joint.chunks_exact(bins).map(|row| plogp(row.iter().sum())).sum();
    let moving: f64 = (0..bins).map(|m| plogp(joint.iter().skip(m).step_by(bins).sum())).sum();
    if both > 1e-12 { (fixed + moving) / both } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mutual_information_matches_closed_forms() {
        assert!((normalised(&[5.0, 0.0, 0.0, 5.0], 2, 10.0) - 2.0).abs() < 1e-12);
        assert!((normalised(&[1.0, 3.0, 2.0, 6.0], 2, 12.0) - 1.0).abs() < 1e-12);
        assert_eq!(normalised(&[7.0, 0.0, 0.0, 0.0], 2, 7.0), 1.0);
    }
}
