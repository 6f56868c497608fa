//! Confidence of a brain mask.
//!
//! # Theory
//! Each part is a score from 0 to 1; the confidence is their product.
//!
//! ```text
//! volume   1 within 900 to 1900 ml, 0 at a third beyond
//! border   share of the surface that has a dark layer outside; 1 from 95 %, 0 at 50 %
//! shape    sphericity, surface of a ball of that volume over the mask's; 1 from 0.55, 0 at 0.3
//! slices   1 up to slices of 3 mm, half at 9 mm
//! inside   with a CT, the lesser of the share of the mask in the skull (1 from 98 %, 0 at 80 %)
//!          and of the skull's inside in the mask (1 from 75 %, 0 at 50 %)
//! ```
//!
//! A mask that leaks along muscle or into an orbit lacks the dark layer there.
//!
//! # When not to use it
//! As a probability: the scores rank masks and were not calibrated to error rates.

use super::{BrainConfig, Levels, millilitres};
use crate::VoxelVolume;
use std::fmt;

/// Below this confidence a mask should be inspected or replaced by labels.
const DOUBT: f64 = 0.6;

/// The confidence of a brain mask and its components, each from 0 to 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BrainConfidence {
    /// The product of the components.
    pub value: f64,
    /// Volume of the mask, ml.
    pub found_ml: f64,
    /// Thickness of the MRI's slices, mm.
    pub slice_mm: f64,
    /// Score for the volume of an adult brain.
    pub volume: f64,
    /// Score for a dark layer around it.
    pub border: f64,
    /// Score for compactness.
    pub shape: f64,
    /// Score for slices thin enough to resolve a surface between them.
    pub slices: f64,
    /// Score for filling the inside of the skull and no more; `None` without a CT.
    pub inside: Option<f64>,
}

impl BrainConfidence {
    /// Computes the confidence of a mask on a grid of cubes, with the MRI on the same grid.
    pub(super) fn of(
        brain: &VoxelVolume<u8>,
        mri: &VoxelVolume<f32>,
        levels: Levels,
        room: Option<&VoxelVolume<u8>>,
        slice_mm: f64,
        config: &BrainConfig,
    ) -> Self {
        let found_ml = millilitres(brain);
        let surface = Surface::of(brain, mri, levels.least);
        let third = 1.0 / 3.0;
        let volume = rising(found_ml, config.least_ml * (1.0 - third), config.least_ml)
            .min(1.0 - rising(found_ml, config.greatest_ml, config.greatest_ml * (1.0 + third)));
        let border = rising(surface.dark, 0.5, 0.95);
        let sphericity = (36.0 * std::f64::consts::PI * (1e3 * found_ml).powi(2)).cbrt() / surface.mm2.max(1.0);
        let shape = rising(sphericity, 0.3, 0.55);
        let slices = 1.0 - 0.5 * rising(slice_mm, 3.0, 9.0);
        let inside = room.map(|room| {
            let both = brain.data.iter().zip(&room.data).filter(|&(&b, &r)| b != 0 && r != 0).count() as f64;
            let both_ml = both * brain.voxel_mm3() * 1e-3;
            rising(both_ml / found_ml, 0.8, 0.98).min(rising(both_ml / millilitres(room), 0.5, 0.75))
        });
        let value = volume * border * shape * slices * inside.unwrap_or(1.0);
        Self { value, found_ml, slice_mm, volume, border, shape, slices, inside }
    }

    /// Whether the mask should be inspected or replaced by labels.
    pub fn is_doubtful(&self) -> bool {
        self.value.is_nan() || self.value < DOUBT
    }
}

impl fmt::Display for BrainConfidence {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { value, found_ml, slice_mm, volume, border, shape, slices, inside } = self;
        write!(
            f,
            "{found_ml:.0} ml, confidence {value:.2} (volume {volume:.2}, dark layer around it {border:.2}, shape {shape:.2}, slices of {slice_mm:.1} mm {slices:.2}"
        )?;
        match inside {
            Some(inside) => write!(f, ", inside the skull {inside:.2})"),
            None => write!(f, "; without a CT)"),
        }
    }
}

/// Linear from 0 at `low` to 1 at `high`, clamped.
fn rising(value: f64, low: f64, high: f64) -> f64 {
    ((value - low) / (high - low)).clamp(0.0, 1.0)
}

/// The surface of a mask.
struct Surface {
    mm2: f64,
    /// Fraction of it with a value under brain's within two voxels.
    dark: f64,
}

impl Surface {
    fn of(mask: &VoxelVolume<u8>, mri: &VoxelVolume<f32>, least: f32) -> Self {
        let [nx, ny, nz] = mask.dims;
        let (mut faces, mut places, mut dark) = ([0usize; 3], 0usize, 0usize);
        let steps = [1, nx, nx * ny];
        for at in 0..mask.data.len() {
            let voxel = [at % nx, at / nx % ny, at / (nx * ny)];
            let inner = (0..3).all(|axis| voxel[axis] > 0 && voxel[axis] + 1 < [nx, ny, nz][axis]);
            if mask.data[at] == 0 || !inner {
                continue;
            }
            let mut outside = [at; 6];
            let mut count = 0;
            for (axis, step) in steps.into_iter().enumerate() {
                for n in [at - step, at + step].into_iter().filter(|&n| mask.data[n] == 0) {
                    faces[axis] += 1;
                    outside[count] = n;
                    count += 1;
                }
            }
            if count > 0 {
                places += 1;
                let low = outside[..count].iter().chain([&at]).map(|&n| mri.data[n]).fold(f32::MAX, f32::min);
                dark += usize::from(low < least);
            }
        }
        // The faces of cubes overestimate a smooth surface by half (the mean of |cos| over its
        // directions).
        let edge = mask.spacing_mm().element_product().cbrt();
        let mm2 = faces.iter().sum::<usize>() as f64 * edge * edge / 1.5;
        Self { mm2, dark: dark as f64 / (places as f64).max(1.0) }
    }
}
