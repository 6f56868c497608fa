//! Watershed: floods from markers, highest values first.
//!
//! # Sources
//! L. Vincent, P. Soille, "Watersheds in digital spaces", IEEE PAMI 13, 1991.

use std::collections::VecDeque;

/// A voxel that the flood may reach.
pub(super) const UNKNOWN: u8 = 0;
pub(super) const INSIDE: u8 = 1;
pub(super) const OUTSIDE: u8 = 2;

/// Number of levels of the flood.
const LEVELS: usize = 256;

/// Spreads the labels into unknown voxels with values over 0, highest first and nearest first on a
/// level. Values over `highest` are clamped.
pub(super) fn flood([nx, ny, nz]: [usize; 3], values: &[f32], highest: f32, labels: &mut [u8]) {
    let scale = LEVELS as f32 / highest;
    let level_of = |at: usize| ((values[at] * scale) as usize).min(LEVELS - 1);
    let mut levels: Vec<VecDeque<usize>> = vec![VecDeque::new(); LEVELS];
    let neighbours = |at: usize| {
        let (i, j, k) = (at % nx, at / nx % ny, at / (nx * ny));
        let sides = [
            (i > 0, at.wrapping_sub(1)),
            (i + 1 < nx, at + 1),
            (j > 0, at.wrapping_sub(nx)),
            (j + 1 < ny, at + nx),
            (k > 0, at.wrapping_sub(nx * ny)),
            (k + 1 < nz, at + nx * ny),
        ];
        sides.into_iter().filter(|s| s.0).map(|s| s.1)
    };
    for at in 0..labels.len() {
        if labels[at] != UNKNOWN && values[at] > 0.0 && neighbours(at).any(|n| labels[n] == UNKNOWN) {
            levels[level_of(at)].push_back(at);
        }
    }
    for level in (0..LEVELS).rev() {
        while let Some(at) = levels[level].pop_front() {
            for n in neighbours(at) {
                if labels[n] == UNKNOWN && values[n] > 0.0 {
                    labels[n] = labels[at];
                    levels[level_of(n).min(level)].push_back(n);
                }
            }
        }
    }
}
