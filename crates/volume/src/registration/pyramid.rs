//! One level of an image pyramid in grey-value bins, and the sample points for the comparison.

use crate::component::Components;
use crate::padding::Padding;
use crate::resample::corners;
use crate::{Sample, VoxelVolume};
use glam::{DAffine3, DVec3, Vec3};
use rayon::prelude::*;

/// An image in bin units, 0 to bins - 1; NaN where the image is undefined.
pub(super) struct Level {
    pub binned: VoxelVolume<f32>,
    pub voxel_from_world: DAffine3,
    last: Vec3,
}

/// A point in the fixed image and its bin.
#[derive(Clone, Copy)]
pub(super) struct Point {
    pub world: DVec3,
    pub bin: u8,
}

/// Averages voxels until they are about `mm` long; padding and its averages become NaN.
pub(super) fn reduced<T: Sample>(image: &VoxelVolume<T>, padding: &Padding, mm: f64) -> VoxelVolume<f32> {
    let value = |at: usize| if padding.holds(at) { f32::NAN } else { image.data[at].to_f32() };
    let grid = VoxelVolume { dims: image.dims, data: Vec::<T>::new(), world_from_voxel: image.world_from_voxel };
    let mut merged = halved(&grid, mm, value).unwrap_or_else(|| VoxelVolume {
        dims: image.dims,
        data: (0..image.data.len()).map(value).collect(),
        world_from_voxel: image.world_from_voxel,
    });
    while let Some(smaller) = halved(&merged, mm, |at| merged.data[at]) {
        merged = smaller;
    }
    merged
}

impl Level {
    /// Reduces an image further until its voxels are about `mm` long.
    pub fn new(image: &VoxelVolume<f32>, mm: f64, range: (f32, f32), bins: usize) -> Self {
        let mut merged = image.clone();
        while let Some(smaller) = halved(&merged, mm, |at| merged.data[at]) {
            merged = smaller;
        }
        let scale = (bins - 1) as f32 / (range.1 - range.0);
        merged.data.par_iter_mut().for_each(|v| *v = (v.clamp(range.0, range.1) - range.0) * scale);
        Self {
            voxel_from_world: merged.world_from_voxel.inverse(),
            last: Vec3::from_array(merged.dims.map(|n| (n - 1) as f32)),
            binned: merged,
        }
    }

    /// Value at voxel coordinates; `None` outside the voxel centres and next to a NaN.
    pub fn at(&self, voxel: Vec3) -> Option<f32> {
        if !(voxel.cmpge(Vec3::ZERO).all() && voxel.cmple(self.last).all()) {
            return None;
        }
        let value: f32 =
            corners(self.binned.dims, self.last, voxel).iter().map(|&(at, w)| w * self.binned.data[at]).sum();
        (!value.is_nan()).then_some(value)
    }

    /// At most `most` points spread over the image, each jittered within its voxel.
    /// The jitter avoids false peaks where the voxels of two grids of similar spacing coincide.
    pub fn points(&self, most: usize) -> Vec<Point> {
        let [nx, ny, _] = self.binned.dims;
        let known: Vec<u32> =
            (0..self.binned.data.len() as u32).filter(|&at| !self.binned.data[at as usize].is_nan()).collect();
        let stride = (known.len() as f64 / most as f64).max(1.0);
        let count = (known.len() as f64 / stride) as usize;
        let point = |n: usize| {
            let mut random = fraction(n as u64);
            let at = known[((n as f64 + random() * (1.0 - 1.0 / stride)) * stride) as usize] as usize;
            let centre = DVec3::new((at % nx) as f64, (at / nx % ny) as f64, (at / (nx * ny)) as f64);
            let voxel = centre + DVec3::new(random(), random(), random()) - 0.5;
            let bin = (self.at(voxel.as_vec3())? + 0.5) as u8;
            Some(Point { world: self.binned.world_from_voxel.transform_point3(voxel), bin })
        };
        (0..count).into_par_iter().filter_map(point).collect()
    }
}

/// Pseudo-random numbers in 0..1 from a seed (splitmix64, Steele 2014).
fn fraction(seed: u64) -> impl FnMut() -> f64 {
    let mut state = seed.wrapping_mul(0xD134_2543_DE82_EF95);
    move || {
        state = state.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = state;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }
}

/// Averages pairs of voxels along each axis that is finer than `mm`; `None` when there is none.
fn halved<T: Copy + Sync>(
    image: &VoxelVolume<T>,
    mm: f64,
    value_of: impl Fn(usize) -> f32 + Sync,
) -> Option<VoxelVolume<f32>> {
    let spacing = image.spacing_mm();
    let step: [usize; 3] = std::array::from_fn(|a| if 1.5 * spacing[a] <= mm && image.dims[a] > 3 { 2 } else { 1 });
    if step == [1; 3] {
        return None;
    }
    let dims: [usize; 3] = std::array::from_fn(|a| image.dims[a] / step[a]);
    let step_mm = DVec3::from_array(step.map(|s| s as f64));
    let into = DAffine3::from_translation(0.5 * (step_mm - 1.0)) * DAffine3::from_scale(step_mm);
    let mut out = VoxelVolume::filled(dims, image.world_from_voxel * into, 0f32);
    let share = 1.0 / (step[0] * step[1] * step[2]) as f32;
    out.data.par_chunks_mut(dims[0]).enumerate().for_each(|(row, values)| {
        let (j, k) = (row % dims[1] * step[1], row / dims[1] * step[2]);
        for n in 0..step[1] * step[2] {
            let start = image.index([0, j + n % step[1], k + n / step[1]]);
            for (i, value) in values.iter_mut().enumerate() {
                let from = start + i * step[0];
                *value += share * (from..from + step[0]).map(&value_of).sum::<f32>();
            }
        }
    });
    Some(out)
}

/// The 0.5th and 99.5th percentile of the image; `None` without contrast.
pub(super) fn range(image: &VoxelVolume<f32>) -> Option<(f32, f32)> {
    let stride = image.data.len().div_ceil(400_000).max(1);
    let mut values: Vec<f32> = image.data.iter().step_by(stride).copied().filter(|v| v.is_finite()).collect();
    values.sort_unstable_by(f32::total_cmp);
    let low = *values.get(values.len() / 200)?;
    let high = values[values.len() - 1 - values.len() / 200];
    (high > low && (high - low).is_finite()).then_some((low, high))
}

/// Centre of the largest piece brighter than the mean, world mm: the head without table and frame.
pub(super) fn middle(level: &Level) -> DVec3 {
    let image = &level.binned;
    let known = || image.data.iter().copied().filter(|v| !v.is_nan());
    let mean = known().map(f64::from).sum::<f64>() / known().count().max(1) as f64;
    let bright = Components::of(image.dims, |at| f64::from(image.data[at]) > mean);
    let [nx, ny, _] = image.dims;
    let (mut sum, mut count) = (DVec3::ZERO, 0.0);
    if let Some(head) = bright.largest() {
        bright.each_run(head, |run| {
            for at in run {
                sum += DVec3::new((at % nx) as f64, (at / nx % ny) as f64, (at / (nx * ny)) as f64);
                count += 1.0;
            }
        });
    }
    image.world_from_voxel.transform_point3(sum / f64::max(count, 1.0))
}
