//! The same image on another grid.
//!
//! # Theory
//! A target voxel's centre x goes through `from_voxel_from_to_voxel = from.world_from_voxel⁻¹ · to.world_from_voxel` into the source's
//! continuous indices. Trilinear weighs the 8 voxels around it, nearest takes one. Majority lets labels vote: each target
//! voxel is split into as many sub-points as source voxels fit into it along each axis, each sub-point gives its trilinear
//! weights to the labels around it, and the label with the most wins (the first met on a tie).
//!
//! # Practice
//! A point counts as inside up to the outer faces of the border voxels; within the outer half voxel the border value
//! holds on. Any affine to any affine. Slices run in parallel and each is computed alone: the bytes do not depend on
//! the number of threads. About 10 ns per target voxel and core trilinear, 50 ns majority.
//!
//! # When not to use it
//! Trilinear takes no mean over what a coarser voxel covers: thin bone aliases at spacings far over the source's.

use crate::{Sample, VoxelVolume};
use glam::{DAffine3, DVec3, UVec3, Vec3};
use rayon::prelude::*;

/// Where samples are wanted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grid {
    /// Voxels along i, j, k.
    pub dims: [usize; 3],
    /// RAS+ mm from voxel indices.
    pub world_from_voxel: DAffine3,
}

/// How values between voxel centres come about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Interpolation {
    /// Weighted mean of the 8 voxels around: for densities.
    Trilinear,
    /// The voxel that holds the point: fast, for labels at a like spacing.
    Nearest,
    /// The label with the largest share of the target voxel: for labels.
    Majority,
}

impl Grid {
    /// The grid of a volume.
    pub fn of<T>(volume: &VoxelVolume<T>) -> Self {
        Self { dims: volume.dims, world_from_voxel: volume.world_from_voxel }
    }

    /// An axis-aligned RAS grid of cubes that covers the volume's voxels to their outer faces.
    ///
    /// A volume that already is such a grid gets its own back.
    pub fn isotropic_over<T: Copy>(volume: &VoxelVolume<T>, spacing_mm: f32) -> Self {
        let (low, high) = volume.world_corners();
        let spacing = f64::from(spacing_mm);
        let cells = ((high - low) / spacing - 1e-4).ceil().max(DVec3::ONE);
        let origin = low + 0.5 * spacing;
        Self {
            dims: [cells.x as usize, cells.y as usize, cells.z as usize],
            world_from_voxel: DAffine3::from_translation(origin) * DAffine3::from_scale(DVec3::splat(spacing)),
        }
    }

    /// How many voxels: look before a small spacing asks for more memory than there is.
    pub fn voxels(&self) -> usize {
        self.dims.iter().fold(1, |n, &d| n.saturating_mul(d))
    }
}

/// Samples `from` on `grid`; `outside` fills what lies beyond it.
pub fn resample<T: Sample>(from: &VoxelVolume<T>, grid: &Grid, how: Interpolation, outside: T) -> VoxelVolume<T> {
    let mut to = VoxelVolume::filled(grid.dims, grid.world_from_voxel, outside);
    let [nx, ny, _] = grid.dims;
    if to.data.is_empty() || from.data.is_empty() {
        return to;
    }
    let source = Source::new(from, grid);
    to.data.par_chunks_mut(nx).enumerate().for_each_init(Votes::default, |votes, (row, values)| {
        let start = source.from_target.transform_point3(DVec3::new(0.0, (row % ny) as f64, (row / ny) as f64));
        for (i, value) in values.iter_mut().enumerate() {
            let point = (start + i as f64 * source.from_target.matrix3.x_axis).as_vec3();
            if source.holds(point) {
                *value = match how {
                    Interpolation::Trilinear => source.trilinear(point),
                    Interpolation::Nearest => source.nearest(point),
                    Interpolation::Majority => source.majority(point, votes),
                };
            }
        }
    });
    to
}

struct Source<'a, T> {
    volume: &'a VoxelVolume<T>,
    /// Source indices from target indices.
    from_target: DAffine3,
    /// Index of the last voxel along each axis.
    last: Vec3,
    /// Sub-points of a target voxel along each axis.
    parts: UVec3,
}

impl<'a, T: Sample> Source<'a, T> {
    fn new(volume: &'a VoxelVolume<T>, grid: &Grid) -> Self {
        let from_target = volume.world_from_voxel.inverse() * grid.world_from_voxel;
        let m = from_target.matrix3;
        let lengths = DVec3::new(m.x_axis.length(), m.y_axis.length(), m.z_axis.length());
        let last = Vec3::from_array(volume.dims.map(|n| (n - 1) as f32));
        let parts = (lengths - 1e-6).ceil().clamp(DVec3::ONE, DVec3::splat(8.0)).as_uvec3();
        Self { volume, from_target, last, parts }
    }

    fn holds(&self, point: Vec3) -> bool {
        let half = Vec3::splat(0.5 + 1e-4);
        point.cmpge(-half).all() && point.cmple(self.last + half).all()
    }

    fn nearest(&self, point: Vec3) -> T {
        let voxel = point.clamp(Vec3::ZERO, self.last).round().as_uvec3();
        self.volume.data[self.volume.index([voxel.x as usize, voxel.y as usize, voxel.z as usize])]
    }

    fn corners(&self, point: Vec3) -> [(usize, f32); 8] {
        corners(self.volume.dims, self.last, point)
    }

    /// Voxels of no weight take no part, so that a NaN beside the point does not reach it.
    fn trilinear(&self, point: Vec3) -> T {
        let parts = self.corners(point).into_iter().filter(|&(_, weight)| weight > 0.0);
        T::from_f32(parts.map(|(at, weight)| weight * self.volume.data[at].to_f32()).sum())
    }

    fn majority(&self, centre: Vec3, votes: &mut Votes<T>) -> T {
        votes.0.clear();
        let m = self.from_target.matrix3.as_mat3();
        let step = Vec3::ONE / self.parts.as_vec3();
        for c in 0..self.parts.z {
            for b in 0..self.parts.y {
                for a in 0..self.parts.x {
                    let offset = (UVec3::new(a, b, c).as_vec3() + 0.5) * step - 0.5;
                    for (at, weight) in self.corners(centre + m * offset) {
                        votes.add(self.volume.data[at], weight);
                    }
                }
            }
        }
        votes.winner().unwrap_or(self.nearest(centre))
    }
}

/// The 8 voxels around a point in continuous indices, with their weights; the point is clamped to the voxel centres.
pub(crate) fn corners(dims: [usize; 3], last: Vec3, point: Vec3) -> [(usize, f32); 8] {
    let p = point.clamp(Vec3::ZERO, last);
    let base = p.floor().min((last - 1.0).max(Vec3::ZERO));
    let f = p - base;
    let (g, b) = (1.0 - f, base.as_uvec3());
    let step = dims.map(|n| usize::from(n > 1));
    let at = b.x as usize + dims[0] * (b.y as usize + dims[1] * b.z as usize);
    let (dx, dy, dz) = (step[0], step[1] * dims[0], step[2] * dims[0] * dims[1]);
    [
        (at, g.x * g.y * g.z),
        (at + dx, f.x * g.y * g.z),
        (at + dy, g.x * f.y * g.z),
        (at + dx + dy, f.x * f.y * g.z),
        (at + dz, g.x * g.y * f.z),
        (at + dx + dz, f.x * g.y * f.z),
        (at + dy + dz, g.x * f.y * f.z),
        (at + dx + dy + dz, f.x * f.y * f.z),
    ]
}

/// Weights of the labels that take part, in the order met.
struct Votes<T>(Vec<(T, f32)>);

impl<T> Default for Votes<T> {
    fn default() -> Self {
        Self(Vec::with_capacity(16))
    }
}

impl<T: Sample> Votes<T> {
    fn add(&mut self, label: T, weight: f32) {
        match self.0.iter_mut().find(|(l, _)| *l == label) {
            Some((_, sum)) => *sum += weight,
            None => self.0.push((label, weight)),
        }
    }

    fn winner(&self) -> Option<T> {
        let mut best: Option<(T, f32)> = None;
        for &(label, sum) in &self.0 {
            if best.is_none_or(|(_, most)| sum > most) {
                best = Some((label, sum));
            }
        }
        best.map(|(label, _)| label)
    }
}
