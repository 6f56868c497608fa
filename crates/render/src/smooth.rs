//! The CT smoothed by a Gaussian on a coarse lattice: the normals of the picture come from it.
//!
//! # Theory
//! A voxel of a scanner is the mean over its box, and whole slices are 1 to 2 mm thick. A curved
//! surface then rises in steps, which a gradient over a voxel or two shows as terraces. A Gaussian
//! of 1.25 mm spans the steps. Where bone begins is not smoothed: rays, contact and the exported
//! surface end it at the same place, and no thin wall is lost. As in contact, densities far from
//! the isovalue bend a normal no further.
//!
//! # Practice
//! On a lattice of up to 1 mm, 2 bytes a point; on the densities of a head in voxels of 0.5 mm a
//! quarter more memory. The normal of a ball scanned in voxels of 1 x 1 x 2 mm deviates by 0.8 to
//! 0.9 degrees (`tests/scanned.rs`); without smoothing by 5 to 10.
//!
//! # When not to use it
//! For what was cut: its surface is smooth already (`drilled.rs`).

use crate::bricks::Grid;
use glam::{IVec3, Vec3};
use trepan_bone::{BRICK, BoneVolume};

/// A numerical parameter: standard deviation of the Gaussian, mm; at least a voxel.
const SIGMA_MM: f32 = 1.25;
/// A numerical parameter: half the edge of the cube whose differences are the gradient, mm. At
/// least half a voxel; `REACH_MM` in `skull.wgsl`.
const REACH_MM: f32 = 0.5;
/// A numerical parameter: density differences past this many HU from the isovalue do not bend a
/// normal further; the same as in contact.
const CLAMP_HU: f32 = 1000.0;
/// Standard deviations after which the Gaussian is cut off.
const TAILS: f32 = 2.5;

/// The smoothed CT.
#[derive(Clone, Debug)]
pub(crate) struct Smooth {
    /// Voxels from one point of the lattice to the next.
    pub step: usize,
    /// Points along x, y, z; the first is the padded voxel (0, 0, 0).
    pub dims: [usize; 3],
    /// HU, x fastest.
    pub values: Vec<i16>,
    /// Weights of the Gaussian, from its one end to its other.
    weights: Vec<f32>,
    /// Versions of the bricks of densities.
    seen: Vec<u32>,
}

impl Smooth {
    /// Smooths a whole volume; without bone, empty.
    pub fn of(bone: Option<&BoneVolume>, grid: &Grid) -> Self {
        let step = grid.smooth_step;
        let sigma = (SIGMA_MM / grid.spacing_mm).max(1.0);
        let reach = (TAILS * sigma).ceil() as i32;
        let weight = |n: i32| (-0.5 * (n as f32 / sigma).powi(2)).exp();
        let sum: f32 = (-reach..=reach).map(weight).sum();
        let weights = (-reach..=reach).map(|n| weight(n) / sum).collect();
        let mut smooth = Self { step, dims: [2; 3], values: vec![0; 8], weights, seen: Vec::new() };
        let Some(bone) = bone else { return smooth };
        smooth.dims = grid.dims.map(|n| (n - 1).div_ceil(step) + 1);
        smooth.seen = bricks(bone).map(|brick| bone.ct_version(brick)).collect();
        smooth.values = smooth.made_whole(bone);
        smooth
    }

    /// Half the edge of the cube whose differences are the gradient, voxels.
    pub fn reach(&self, grid: &Grid) -> f32 {
        (REACH_MM / grid.spacing_mm).max(0.5)
    }

    /// All values, by as many threads as there are processors.
    fn made_whole(&self, bone: &BoneVolume) -> Vec<i16> {
        let [nx, ny, nz] = self.dims;
        let mut values = vec![0; nx * ny * nz];
        let threads = std::thread::available_parallelism().map_or(1, usize::from);
        let layers = nz.div_ceil(threads);
        std::thread::scope(|scope| {
            for (n, part) in values.chunks_mut(layers * nx * ny).enumerate() {
                let size = [nx, ny, part.len() / (nx * ny)];
                scope.spawn(move || part.copy_from_slice(&self.made(bone, [0, 0, n * layers], size)));
            }
        });
        values
    }

    /// The values of a box of `size` points from `first`.
    fn made(&self, bone: &BoneVolume, first: [usize; 3], size: [usize; 3]) -> Vec<i16> {
        let (step, reach) = (self.step as i32, self.weights.len() as i32 / 2);
        let isovalue = f32::from(bone.isovalue());
        // The first voxel that counts; a point of the lattice is at a multiple of the step, less
        // the padding.
        let low = step * IVec3::from(first.map(|n| n as i32)) - 1 - reach;
        let [wide, deep, high] = size.map(|n| self.step * (n - 1) + self.weights.len());
        let [nx, ny, nz] = size;
        let mut sums = vec![0.0f32; nx * ny * nz];
        let (mut line, mut rows, mut layer) = (vec![0.0f32; wide], vec![0.0f32; nx * deep], vec![0.0f32; nx * ny]);
        let mut read = vec![0i16; wide];
        for k in 0..high {
            for (j, row) in rows.chunks_exact_mut(nx).enumerate() {
                bone.read_ct(low + IVec3::new(0, j as i32, k as i32), &mut read);
                for (to, hu) in line.iter_mut().zip(&read) {
                    *to = f32::from(*hu).clamp(isovalue - CLAMP_HU, isovalue + CLAMP_HU);
                }
                for (i, to) in row.iter_mut().enumerate() {
                    let near = &line[i * self.step..];
                    *to = self.weights.iter().zip(near).map(|(w, v)| w * v).sum();
                }
            }
            layer.fill(0.0);
            for (j, to) in layer.chunks_exact_mut(nx).enumerate() {
                let near = rows[j * self.step * nx..].chunks_exact(nx);
                self.weights.iter().zip(near).for_each(|(w, row)| add(to, *w, row));
            }
            for (n, to) in sums.chunks_exact_mut(nx * ny).enumerate() {
                if let Some(w) = k.checked_sub(n * self.step).and_then(|at| self.weights.get(at)) {
                    add(to, *w, &layer);
                }
            }
        }
        sums.into_iter().map(|sum| sum.round() as i16).collect()
    }

    /// Smooths anew around those of the changed bricks whose CT changed; returns the boxes of
    /// points that did, first and size.
    pub fn follow(&mut self, bone: &BoneVolume, changed: &[[usize; 3]]) -> Vec<[[usize; 3]; 2]> {
        let [bx, by, _] = bone.bricks();
        let mut boxes = Vec::new();
        for brick in changed {
            let seen = &mut self.seen[brick[0] + bx * (brick[1] + by * brick[2])];
            let now = bone.ct_version(IVec3::from(brick.map(|b| b as i32)));
            if std::mem::replace(seen, now) == now {
                continue;
            }
            let reach = self.weights.len() / 2;
            let first = brick.map(|b| (b * BRICK + 1).saturating_sub(reach).div_ceil(self.step));
            let last = [0, 1, 2].map(|a| ((brick[a] * BRICK + BRICK + reach) / self.step).min(self.dims[a] - 1));
            let size = [0, 1, 2].map(|a| last[a] + 1 - first[a]);
            let values = self.made(bone, first, size);
            for (n, row) in values.chunks_exact(size[0]).enumerate() {
                let (y, z) = (first[1] + n % size[1], first[2] + n / size[1]);
                let at = first[0] + self.dims[0] * (y + self.dims[1] * z);
                self.values[at..at + size[0]].copy_from_slice(row);
            }
            boxes.push([first, size]);
        }
        boxes
    }

    /// The values of a box, x fastest.
    pub fn part([first, size]: [[usize; 3]; 2], of: &Self) -> Vec<i16> {
        let rows = (0..size[1] * size[2]).flat_map(|n| {
            let (y, z) = (first[1] + n % size[1], first[2] + n / size[1]);
            let at = first[0] + of.dims[0] * (y + of.dims[1] * z);
            &of.values[at..at + size[0]]
        });
        rows.copied().collect()
    }
}

/// All bricks of voxels, x fastest.
fn bricks(bone: &BoneVolume) -> impl Iterator<Item = IVec3> {
    let [bx, by, bz] = bone.bricks().map(|n| n as i32);
    (0..bx * by * bz).map(move |at| IVec3::new(at % bx, at / bx % by, at / (bx * by)))
}

fn add(to: &mut [f32], weight: f32, from: &[f32]) {
    to.iter_mut().zip(from).for_each(|(to, v)| *to += weight * v);
}

/// Turns a smoothed normal towards the eye: a wall thinner than the Gaussian may show its far
/// side's.
#[inline(always)]
pub(crate) fn towards_eye(normal: Vec3, along: Vec3) -> Vec3 {
    normal - 2.0 * normal.dot(along).max(0.0) * along
}

#[cfg(test)]
mod tests {
    use super::*;
    use trepan_volume::{AIR_HU, VoxelVolume};

    fn wavy() -> BoneVolume {
        let mut ct = VoxelVolume::isotropic([20, 21, 22], Vec3::ZERO, 0.5, AIR_HU);
        ct.data.iter_mut().enumerate().for_each(|(at, hu)| *hu = (at * 7919 % 2000) as i16 - 900);
        BoneVolume::new(&ct, 400).unwrap()
    }

    #[test]
    fn each_point_is_the_weighted_mean_around_it() {
        let bone = wavy();
        let grid = Grid::of(Some(&bone));
        let smooth = Smooth::of(Some(&bone), &grid);
        assert_eq!((smooth.step, smooth.dims), (2, [12, 12, 13]));
        for point in [IVec3::new(0, 3, 4), IVec3::new(11, 11, 12), IVec3::new(5, 6, 7)] {
            let mut mean = 0.0;
            let mut sum = 0.0;
            for n in 0..15i32.pow(3) {
                let off = IVec3::new(n % 15, n / 15 % 15, n / 225) - 7;
                let weight = (-0.5 * f64::from(off.length_squared()) / 6.25).exp();
                mean += weight * f64::from(bone.ct(2 * point - 1 + off)).clamp(-600.0, 1400.0);
                sum += weight;
            }
            let at = point.x + 12 * (point.y + 12 * point.z);
            let found = f64::from(smooth.values[at as usize]);
            assert!((found - mean / sum).abs() < 0.6, "{point}: {found} for {}", mean / sum);
        }
    }

    #[test]
    fn what_changes_is_smoothed_as_if_it_had_always_been_so() {
        let bone = wavy();
        let grid = Grid::of(Some(&bone));
        let mut smooth = Smooth::of(Some(&bone), &grid);
        let mut seen = bone.seen();
        for voxel in [IVec3::new(7, 8, 9), IVec3::new(19, 0, 21)] {
            bone.set_hu(voxel, 3000);
        }
        let mut changed = Vec::new();
        bone.changed(&mut seen, 99, |brick| changed.push(brick));
        let before = smooth.values.clone();
        assert_eq!(smooth.follow(&bone, &changed).len(), 2);
        assert_ne!(smooth.values, before);
        assert_eq!(smooth.values, Smooth::of(Some(&bone), &grid).values);
        assert!(smooth.follow(&bone, &changed).is_empty(), "nothing has changed since");
    }
}
