//! Detects padding: the single value that fills an image from its border inwards.
//!
//! # Theory
//! Resampling, cropping and round fields of view leave a constant around the image. If taken for
//! air it is a false edge for mutual information. Padding is the region connected to the border
//! through faces whose voxels equal the border's most common value, if that value makes up a
//! twentieth of the border.

use crate::component::Components;
use crate::{Sample, VoxelVolume};
use std::collections::HashMap;

/// A numerical parameter: smallest fraction of the border that counts as padding.
const LEAST_SHARE: f64 = 0.05;

/// Padding flag of each voxel, one bit each.
pub(crate) struct Padding(Vec<u64>);

impl Padding {
    /// Detects padding.
    pub fn of<T: Sample>(image: &VoxelVolume<T>) -> Self {
        let Some(value) = border_value(image) else { return Self::none() };
        let pieces = Components::of(image.dims, |at| image.data[at].to_f32() == value);
        let [nx, ny, nz] = image.dims;
        let on_border = |run: &std::ops::Range<usize>| {
            let (j, k) = (run.start / nx % ny, run.start / (nx * ny));
            run.start.is_multiple_of(nx) || run.end.is_multiple_of(nx) || j == 0 || j + 1 == ny || k == 0 || k + 1 == nz
        };
        let mut outer = HashMap::new();
        pieces.every_run(|piece, run| *outer.entry(piece).or_insert(false) |= on_border(&run));
        let mut bits = vec![0u64; image.data.len().div_ceil(64)];
        pieces.every_run(|piece, run| {
            if outer.get(&piece) == Some(&true) {
                run.for_each(|at| bits[at / 64] |= 1 << (at % 64));
            }
        });
        Self(bits)
    }

    /// No padding: all voxels count.
    pub fn none() -> Self {
        Self(Vec::new())
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Whether a voxel is padding.
    pub fn holds(&self, at: usize) -> bool {
        self.0.get(at / 64).is_some_and(|word| word >> (at % 64) & 1 == 1)
    }
}

/// The most common value on the faces of the image, if common enough.
pub(crate) fn border_value<T: Sample>(image: &VoxelVolume<T>) -> Option<f32> {
    let [nx, ny, nz] = image.dims;
    let mut counts: HashMap<u32, usize> = HashMap::new();
    let mut total = 0;
    let mut count = |at: usize| {
        let value = image.data[at].to_f32();
        *counts.entry((value + 0.0).to_bits()).or_insert(0) += 1;
        total += 1;
    };
    for k in 0..nz {
        for j in 0..ny {
            let row = nx * (j + ny * k);
            match j == 0 || j + 1 == ny || k == 0 || k + 1 == nz {
                true => (row..row + nx).for_each(&mut count),
                false => [row, row + nx - 1].into_iter().for_each(&mut count),
            }
        }
    }
    let (bits, most) = counts.into_iter().max_by_key(|&(bits, n)| (n, bits))?;
    (most as f64 >= LEAST_SHARE * f64::from(total)).then(|| f32::from_bits(bits))
}

#[cfg(test)]
mod tests {
    use super::*;
    use trepan_geometry::Vec3;

    #[test]
    fn only_the_constant_connected_to_the_border_is_padding() {
        let mut image = VoxelVolume::isotropic([9, 9, 9], Vec3::ZERO, 1.0, 0i16);
        for at in 0..729 {
            let p = [at % 9, at / 9 % 9, at / 81];
            if p.iter().all(|v| (2..7).contains(v)) && p != [4, 4, 4] {
                image.data[at] = 1 + at as i16;
            }
        }
        let padding = Padding::of(&image);
        let count = (0..729).filter(|&at| padding.holds(at)).count();
        assert_eq!(count, 729 - 125);
        assert!(!padding.holds(4 + 9 * (4 + 9 * 4)), "a hole inside is no padding");
        image.data.iter_mut().enumerate().for_each(|(at, v)| *v = at as i16);
        assert!((0..729).all(|at| !Padding::of(&image).holds(at)), "noise on the border is no padding");
    }
}
