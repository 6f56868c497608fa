//! Prepares an MRI as it is given: background at zero, or already stripped to the brain.
//!
//! # Theory
//! A z-scored MRI has a negative background; the median of the image's faces is taken as zero. An
//! image is stripped if one value fills it from its border inwards and the rest is one piece of a
//! brain's volume that hardly touches the border.

use super::BrainConfig;
use super::morphology::filled;
use crate::component::Components;
use crate::padding::Padding;
use crate::{DistanceField, FAR_MM, Grid, Interpolation, VoxelVolume, resample};

/// Smallest share of a stripped image that is background.
const LEAST_BACKGROUND: f64 = 0.3;
/// Smallest share of what is not background that the largest piece of a stripped image holds.
const LEAST_PIECE: f64 = 0.95;
/// Largest share of a stripped brain's faces that lie on the image's border: a head is cut there.
const MOST_CUT: f64 = 0.3;

/// An MRI on a grid of cubes.
pub(super) struct Given {
    /// Grey values; the background is 0.
    pub coarse: VoxelVolume<f32>,
    /// The brain, if the MRI shows nothing else.
    pub stripped: Option<VoxelVolume<u8>>,
}

impl Given {
    /// Resamples an MRI to a grid of cubes.
    pub fn of(mri: &VoxelVolume<f32>, grid: &Grid) -> Self {
        let stripped = stripped(mri);
        let zero = zero(mri, stripped.as_ref());
        let mut coarse = resample(mri, grid, Interpolation::Trilinear, zero);
        coarse.data.iter_mut().for_each(|v| *v -= zero);
        let on_grid = |mask: VoxelVolume<u8>| {
            let field = DistanceField::of_mask_within(&mask, 2.0 * mask.spacing_mm().length() as f32);
            let field = resample(field.values(), grid, Interpolation::Trilinear, FAR_MM);
            field.map(|d| u8::from(d < 0.0))
        };
        let stripped = stripped.map(on_grid);
        if let Some(brain) = &stripped {
            coarse.data.iter_mut().zip(&brain.data).for_each(|(v, &inside)| *v *= f32::from(inside));
        }
        Self { coarse, stripped }
    }
}

/// The grey value that stands for nothing: 0 unless the image goes below.
fn zero(mri: &VoxelVolume<f32>, stripped: Option<&VoxelVolume<u8>>) -> f32 {
    let least = mri.data.iter().copied().fold(f32::MAX, f32::min);
    if least >= 0.0 {
        return 0.0;
    }
    if stripped.is_some() {
        return least;
    }
    let [nx, ny, nz] = mri.dims;
    let outer = |at: &usize| {
        let [i, j, k] = [at % nx, at / nx % ny, at / (nx * ny)];
        i == 0 || i + 1 == nx || j == 0 || j + 1 == ny || k == 0 || k + 1 == nz
    };
    let mut faces: Vec<f32> = (0..mri.data.len()).filter(outer).map(|at| mri.data[at]).collect();
    let middle = faces.len() / 2;
    let background = *faces.select_nth_unstable_by(middle, f32::total_cmp).1;
    let darker = mri.data.iter().filter(|&&v| v < background).count();
    if 2 * darker < mri.data.len() { background } else { least }
}

/// The brain of an MRI that shows nothing else, on its grid; `None` if it shows a head.
pub(super) fn stripped(mri: &VoxelVolume<f32>) -> Option<VoxelVolume<u8>> {
    let padding = Padding::of(mri);
    let background = (0..mri.data.len()).filter(|&at| padding.holds(at)).count();
    if (background as f64) < LEAST_BACKGROUND * mri.data.len() as f64 {
        return None;
    }
    let pieces = Components::of(mri.dims, |at| !padding.holds(at));
    let [largest, _] = pieces.two_largest();
    let config = BrainConfig::default();
    let ml = largest as f64 * mri.voxel_mm3() * 1e-3;
    let one = largest as f64 >= LEAST_PIECE * (mri.data.len() - background) as f64;
    if !one || !(config.least_ml..=config.greatest_ml).contains(&ml) {
        return None;
    }
    let mut mask = VoxelVolume::filled(mri.dims, mri.world_from_voxel, 0);
    pieces.each_run(pieces.largest()?, |run| mask.data[run].fill(1));
    let mask = filled(&mask);
    (cut_share(&mask) < MOST_CUT).then_some(mask)
}

/// Share of a mask's faces, by count, that lie on the border of the image.
fn cut_share(mask: &VoxelVolume<u8>) -> f64 {
    let [nx, ny, nz] = mask.dims;
    let (mut cut, mut free) = (0usize, 0usize);
    for at in (0..mask.data.len()).filter(|&at| mask.data[at] != 0) {
        for (n, count, step) in [(at % nx, nx, 1), (at / nx % ny, ny, nx), (at / (nx * ny), nz, nx * ny)] {
            for (on_border, beside) in [(n == 0, at.wrapping_sub(step)), (n + 1 == count, at + step)] {
                cut += usize::from(on_border);
                free += usize::from(!on_border && mask.data[beside] == 0);
            }
        }
    }
    cut as f64 / (cut + free).max(1) as f64
}
