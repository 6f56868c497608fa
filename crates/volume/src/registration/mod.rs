//! Rigid registration of two images of a patient by mutual information.
//!
//! # Theory
//! Two scanners map tissue to grey values in unrelated ways, but at the right pose one image's
//! value predicts the other's. With H(F, M) the entropy of the joint histogram at common points and
//! H(F), H(M) its marginal entropies, the pose that maximises (H(F) + H(M)) / H(F, M) is sought.
//! Unlike H(F) + H(M) - H(F, M), this quotient does not grow with the overlap alone. Powell's
//! method maximises it on an image pyramid from several initial rotations, to avoid local maxima.
//!
//! # Practice
//! Captures motions of up to about 20° and 30 mm; larger ones where the heads' centres and tilt
//! give a good start. A constant region at the image border is padding or cleared air; both are
//! tried. The confidence is
//!
//! ```text
//! l / (l + 0.003) · 1 / (1 + (h / 10 mm)²)
//! ```
//!
//! l is the normalised information lost 10 mm beside the result (rotations at 80 mm from the
//! centre) in the least certain of the six directions; a ball, whose rotation is undetermined, has
//! confidence 0. h is the disagreement of the left, right, back, front, lower and upper half of the
//! fixed image, each registered alone; a false edge such as padding affects one half only. For the
//! motions of a real CT and MRI listed in the README, no result at or over 0.6 (the default) had an
//! error of 3 mm or 3°. Results under it are rejected and returned with the error. Work is split in
//! fixed parts, so that results are bit-identical for any number of threads. It takes about 3 s a
//! head on one core, twice that with padding.
//!
//! # Sources
//! Viola and Wells 1997 and Collignon 1995 (mutual information), Studholme, Hill and Hawkes 1999
//! (the quotient), Powell 1964.
//!
//! # When not to use it
//! For two patients, after brain shift, or where the images share only a thin slab.

mod information;
mod powell;
mod pyramid;
mod trust;

use crate::padding::Padding;
use crate::{Sample, VoxelVolume};
use glam::{DAffine3, DQuat, DVec3};
use information::{Pair, Shared};
use powell::{Climb, Pose, climb};
use pyramid::{Level, middle, range, reduced};
use rayon::prelude::*;

/// Length that a rotation of one radian counts as, mm.
const RADIUS_MM: f64 = 80.0;

/// Disagreement of the halves at which the confidence is halved, mm.
const CHANCE_MM: f64 = 10.0;

/// How to register.
#[derive(Clone, Debug, PartialEq)]
pub struct RegistrationConfig {
    /// Spacing of the finest level, mm, 0.5 to 8: finer is slower and hardly more accurate.
    pub work_mm: f64,
    /// Grey-value bins of each image, 8 to 128: fewer are smoother, more resolve thin contrasts.
    pub bins: usize,
    /// Sample points at the finest level, from 1000: more are slower and more stable.
    pub points: usize,
    /// Smallest fraction of the fixed image's points that must lie in the moving image, 0 to 1.
    pub least_overlap: f64,
    /// Results under this confidence are rejected, 0 to 1.
    pub least_confidence: f64,
}

impl Default for RegistrationConfig {
    fn default() -> Self {
        Self { work_mm: 2.0, bins: 32, points: 100_000, least_overlap: 0.25, least_confidence: 0.6 }
    }
}

/// The pose of the moving image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Registration {
    /// Rigid transform; multiplied with the moving image's `world_from_voxel` it maps to fixed
    /// space.
    pub fixed_from_moving: DAffine3,
    /// Normalised mutual information at the result, 1 (independent) to 2 (fully dependent).
    pub metric: f64,
    /// The same at the headers' poses; under 1 where they overlap too little.
    pub start_metric: f64,
    /// Confidence, 0 (none) to 1; see the module.
    pub confidence: f64,
    /// Share of the fixed image that lies in the moving image.
    pub overlap_share: f64,
    /// Disagreement of the results for the fixed image's six halves, root mean square over shift
    /// and rotation at 80 mm, mm.
    pub halves_mm: f64,
}

/// Why registration failed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RegistrationError {
    /// A number of the configuration is out of its range.
    #[error("registration: {field} is {found}, but must be {right}")]
    Config {
        /// The field.
        field: &'static str,
        /// Its value.
        found: f64,
        /// The range.
        right: &'static str,
    },
    /// An image has no contrast.
    #[error(
        "registration: the {image} image has no contrast to register by; give the image itself, not a mask or a blank one"
    )]
    Flat {
        /// Fixed or moving.
        image: &'static str,
    },
    /// The images overlap too little.
    #[error(
        "registration: only {:.0} % of the fixed image lies in the moving one, under the least of {:.0} %; give images that \
         show the same part of one patient, or crop the larger one", 100.0 * share, 100.0 * least
    )]
    Overlap {
        /// The share found.
        share: f64,
        /// The smallest allowed.
        least: f64,
    },
    /// The result is ambiguous.
    #[error(
        "registration: the confidence of {:.2} is under the least of {:.2} (shared information {:.3}); are both images of one \
         patient? Crop what only one of them shows, or register them by hand elsewhere and give files that agree", found.confidence, least, found.metric
    )]
    Doubtful {
        /// The rejected result.
        found: Box<Registration>,
        /// The smallest allowed confidence.
        least: f64,
    },
}

/// Finds the rigid transform that maps `moving` to the space of `fixed`.
///
/// A constant region around an image is ignored (padding) and, in a second try, used as air; the
/// result with the higher confidence is returned.
pub fn register<F: Sample, M: Sample>(
    fixed: &VoxelVolume<F>,
    moving: &VoxelVolume<M>,
    config: &RegistrationConfig,
) -> Result<Registration, RegistrationError> {
    check(config)?;
    let outer = (Padding::of(fixed), Padding::of(moving));
    let with = |fixed_unseen: &Padding, moving_unseen: &Padding| {
        let mm = config.work_mm;
        Search::new(&reduced(fixed, fixed_unseen, mm), &reduced(moving, moving_unseen, mm), config)?.run()
    };
    let unseen = with(&outer.0, &outer.1);
    if outer.0.is_empty() && outer.1.is_empty() {
        return unseen;
    }
    let air = with(&Padding::none(), &Padding::none());
    if surety(&air) > surety(&unseen) { air } else { unseen }
}

fn surety(answer: &Result<Registration, RegistrationError>) -> f64 {
    match answer {
        Ok(found) => found.confidence,
        Err(RegistrationError::Doubtful { found, .. }) => found.confidence,
        Err(_) => -1.0,
    }
}

fn check(config: &RegistrationConfig) -> Result<(), RegistrationError> {
    let wrong = |field, found, right| Err(RegistrationError::Config { field, found, right });
    match config {
        c if !(0.5..=8.0).contains(&c.work_mm) => wrong("work_mm", c.work_mm, "0.5 to 8 mm"),
        c if !(8..=128).contains(&c.bins) => wrong("bins", c.bins as f64, "8 to 128"),
        c if c.points < 1000 => wrong("points", c.points as f64, "1000 or more"),
        c if !(0.01..=1.0).contains(&c.least_overlap) => wrong("least_overlap", c.least_overlap, "0.01 to 1"),
        c if !(0.0..=1.0).contains(&c.least_confidence) => wrong("least_confidence", c.least_confidence, "0 to 1"),
        _ => Ok(()),
    }
}

/// A start pose: the six numbers add a rotation and a shift to it.
#[derive(Clone, Copy)]
struct Start {
    turn: DQuat,
    shift: DVec3,
}

struct Search<'a> {
    config: &'a RegistrationConfig,
    /// Coarsest first.
    levels: Vec<(Level, Level)>,
    /// Rotation centre in the fixed image.
    centre: DVec3,
    /// From the fixed image's centre to the moving one's.
    between: DVec3,
}

impl<'a> Search<'a> {
    fn new(
        fixed: &VoxelVolume<f32>,
        moving: &VoxelVolume<f32>,
        config: &'a RegistrationConfig,
    ) -> Result<Self, RegistrationError> {
        let fixed_range = range(fixed).ok_or(RegistrationError::Flat { image: "fixed" })?;
        let moving_range = range(moving).ok_or(RegistrationError::Flat { image: "moving" })?;
        let level = |part: f64| {
            let mm = part * config.work_mm;
            (Level::new(fixed, mm, fixed_range, config.bins), Level::new(moving, mm, moving_range, config.bins))
        };
        let levels: Vec<_> = [4.0, 2.0, 1.0].into_iter().map(level).collect();
        let (centre, other) = (middle(&levels[0].0), middle(&levels[0].1));
        Ok(Self { config, levels, centre, between: other - centre })
    }

    /// The best pose, if its confidence suffices.
    fn run(&self) -> Result<Registration, RegistrationError> {
        let best = self.best();
        let found = self.judged(best);
        let (share, least) = (found.overlap_share, self.config.least_overlap);
        if share < least {
            return Err(RegistrationError::Overlap { share, least });
        }
        match found.confidence >= self.config.least_confidence {
            true => Ok(found),
            false => Err(RegistrationError::Doubtful { found: Box::new(found), least: self.config.least_confidence }),
        }
    }

    fn best(&self) -> Start {
        let rough = Climb { step: 10.0, tolerance: 1.0, sweeps: 3 };
        let candidates = self.climb_all(0, 8_000, &self.starts(), rough, 6);
        let candidates = self.climb_all(0, 30_000, &candidates, Climb { step: 4.0, tolerance: 0.4, sweeps: 8 }, 3);
        let candidates = self.climb_all(1, 60_000, &candidates, Climb { step: 1.5, tolerance: 0.1, sweeps: 8 }, 3);
        let fine = Climb { step: 0.5, tolerance: 0.05, sweeps: 8 };
        self.climb_all(2, self.config.points, &candidates, fine, 1)[0]
    }

    fn judged(&self, best: Start) -> Registration {
        let header = Start { turn: DQuat::IDENTITY, shift: DVec3::ZERO };
        self.with(2, self.config.points, |pair| {
            let Shared { normalised, overlap } = pair.at(self.moving_from_fixed(best, &[0.0; 6]));
            let halves_mm = self.halves_mm(best);
            Registration {
                fixed_from_moving: self.moving_from_fixed(best, &[0.0; 6]).inverse(),
                metric: normalised,
                start_metric: pair.at(self.moving_from_fixed(header, &[0.0; 6])).normalised,
                confidence: self.sharpness(pair, best, normalised) / (1.0 + (halves_mm / CHANCE_MM).powi(2)),
                halves_mm,
                overlap_share: overlap,
            }
        })
    }

    /// Start poses: the headers', aligned centres, and rotations of both about the axes and the
    /// diagonals.
    fn starts(&self) -> Vec<Start> {
        let axes = [DVec3::X, DVec3::Y, DVec3::Z, -DVec3::X, -DVec3::Y, -DVec3::Z].map(|a| a * 14f64.to_radians());
        let corner = |n: usize| {
            let side = |bit: usize| if n >> bit & 1 == 0 { -1.0 } else { 1.0 };
            DVec3::new(side(0), side(1), side(2)) * 9f64.to_radians()
        };
        let turns = std::iter::once(DVec3::ZERO).chain(axes).chain((0..8).map(corner));
        let shifts = [DVec3::ZERO, self.between];
        turns.flat_map(|t| shifts.map(|shift| Start { turn: DQuat::from_scaled_axis(t), shift })).collect()
    }

    /// Optimises from every start on one level; returns the best few, best first.
    fn climb_all(&self, level: usize, points: usize, starts: &[Start], how: Climb, keep: usize) -> Vec<Start> {
        let mut ends: Vec<(Start, f64)> = self.with(level, points, |pair| {
            let from = |&start: &Start| {
                let height = |pose: &Pose| pair.at(self.moving_from_fixed(start, pose)).normalised;
                let (pose, top) = climb(&height, [0.0; 6], how);
                (start.moved(&pose), top)
            };
            starts.par_iter().map(from).collect()
        });
        ends.sort_by(|a, b| b.1.total_cmp(&a.1));
        let mut kept: Vec<Start> = Vec::new();
        for (end, _) in ends {
            if kept.len() < keep && kept.iter().all(|k| k.distance_mm(end) > 3.0) {
                kept.push(end);
            }
        }
        kept
    }

    fn with<T>(&self, level: usize, points: usize, then: impl FnOnce(&Pair) -> T) -> T {
        let (fixed, moving) = &self.levels[level];
        let points = fixed.points(points);
        let (bins, least_overlap) = (self.config.bins, self.config.least_overlap);
        then(&Pair { points: &points, moving, bins, least_overlap })
    }

    fn moving_from_fixed(&self, start: Start, pose: &Pose) -> DAffine3 {
        let Start { turn, shift } = start.moved(pose);
        DAffine3::from_translation(self.centre + shift)
            * DAffine3::from_quat(turn)
            * DAffine3::from_translation(-self.centre)
    }
}

impl Start {
    fn moved(self, pose: &Pose) -> Self {
        let turn = DQuat::from_scaled_axis(DVec3::new(pose[3], pose[4], pose[5]) / RADIUS_MM);
        Self { turn: (turn * self.turn).normalize(), shift: self.shift + DVec3::new(pose[0], pose[1], pose[2]) }
    }

    fn distance_mm(self, other: Self) -> f64 {
        self.shift.distance(other.shift) + RADIUS_MM * self.turn.angle_between(other.turn)
    }
}

#[cfg(test)]
mod tests;
