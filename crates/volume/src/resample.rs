//! Resamples an image on another grid.
//!
//! # Theory
//! A target voxel's centre is mapped by
//! `from_voxel_from_to_voxel = from.world_from_voxel⁻¹ · to.world_from_voxel` to the source's
//! continuous indices. Trilinear weights the 8 surrounding voxels, cubic is a [`Spline`] through
//! the values, nearest takes one voxel. Majority is
//! for labels: each target voxel is split into as many sub-points as source voxels fit into it
//! along each axis, each sub-point adds its trilinear weights to the surrounding labels, and the
//! label with the largest sum wins (the first met on a tie).
//!
//! # Practice
//! Points up to the outer faces of the border voxels count as inside; in the outer half voxel the
//! border value is used. Works from any affine to any affine. Slices run in parallel, with
//! bit-identical results for any number of threads. Cost per target voxel and core: about 10 ns
//! nearest, 40 ns trilinear, 60 ns cubic, 60 ns majority and more where the target is coarser.
//!
//! # When not to use it
//! Trilinear does not average over a coarser voxel: thin bone aliases at spacings far over the
//! source's.

use crate::{Sample, Spline, VoxelVolume};
use glam::{DAffine3, DVec3, UVec3, Vec3};
use rayon::prelude::*;

/// The target grid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grid {
    /// Voxels along i, j, k.
    pub dims: [usize; 3],
    /// Transform from voxel indices to RAS+ mm.
    pub world_from_voxel: DAffine3,
}

/// How to interpolate between voxel centres.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Interpolation {
    /// Weighted mean of the 8 surrounding voxels: for densities.
    Trilinear,
    /// Cubic B-spline through the values: for densities whose isosurface must be smooth. Values
    /// must be finite.
    Cubic,
    /// The voxel that contains the point: fast, for labels at a similar spacing.
    Nearest,
    /// The label with the largest share of the target voxel: for labels.
    Majority,
}

impl Grid {
    /// The grid of a volume.
    pub fn of<T>(volume: &VoxelVolume<T>) -> Self {
        Self { dims: volume.dims, world_from_voxel: volume.world_from_voxel }
    }

    /// An axis-aligned RAS grid of cubes that covers the volume to its outer faces.
    ///
    /// A volume that already has such a grid keeps it. The spacing must be over 0; check
    /// [`voxels`](Self::voxels) before using a small one.
    pub fn isotropic_over<T: Copy>(volume: &VoxelVolume<T>, spacing_mm: f32) -> Self {
        Self::aligned_over(volume, DVec3::splat(spacing_mm.into()))
    }

    /// The same with a spacing for each axis (right, front, head), mm.
    pub fn aligned_over<T: Copy>(volume: &VoxelVolume<T>, spacing_mm: DVec3) -> Self {
        let (low, high) = volume.world_corners();
        let cells = ((high - low) / spacing_mm - 1e-4).ceil().max(DVec3::ONE);
        Self {
            dims: [cells.x as usize, cells.y as usize, cells.z as usize],
            world_from_voxel: DAffine3::from_translation(low + 0.5 * spacing_mm) * DAffine3::from_scale(spacing_mm),
        }
    }

    /// Number of voxels; check it before allocating a small spacing.
    pub fn voxels(&self) -> usize {
        self.dims.iter().fold(1, |n, &d| n.saturating_mul(d))
    }

    /// Centre of the voxel at an index, RAS mm.
    pub(crate) fn place(&self, at: usize) -> DVec3 {
        let [nx, ny, _] = self.dims;
        let voxel = DVec3::new((at % nx) as f64, (at / nx % ny) as f64, (at / (nx * ny)) as f64);
        self.world_from_voxel.transform_point3(voxel)
    }

    /// Index of the voxel that holds a point in RAS mm; `None` outside the grid.
    pub(crate) fn nearest(&self, place: DVec3) -> Option<usize> {
        let voxel = self.world_from_voxel.inverse().transform_point3(place).round();
        let [nx, ny, nz] = self.dims.map(|n| n as f64);
        let held = voxel.cmpge(DVec3::ZERO).all() && voxel.cmplt(DVec3::new(nx, ny, nz)).all();
        held.then_some((voxel.x + nx * (voxel.y + ny * voxel.z)) as usize)
    }
}

/// Samples `from` on `grid`; `outside` fills points beyond it.
pub fn resample<T: Sample>(from: &VoxelVolume<T>, grid: &Grid, how: Interpolation, outside: T) -> VoxelVolume<T> {
    let mut to = VoxelVolume::filled(grid.dims, grid.world_from_voxel, outside);
    let [nx, ny, _] = grid.dims;
    if to.data.is_empty() || from.data.is_empty() {
        return to;
    }
    let source = Source::new(from, grid);
    let spline = (how == Interpolation::Cubic).then(|| Spline::through(from));
    if let (Some(spline), true) = (&spline, source.is_parallel()) {
        source.planes(spline, &mut to);
        return to;
    }
    to.data.par_chunks_mut(nx).enumerate().for_each_init(Votes::default, |votes, (row, values)| {
        let start = source.from_target.transform_point3(DVec3::new(0.0, (row % ny) as f64, (row / ny) as f64));
        for (i, value) in values.iter_mut().enumerate() {
            let point = (start + i as f64 * source.from_target.matrix3.x_axis).as_vec3();
            if source.holds(point) {
                *value = match how {
                    Interpolation::Trilinear => source.trilinear(point),
                    Interpolation::Cubic => spline.as_ref().map_or(outside, |spline| T::from_f32(spline.at(point))),
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
    /// Transform from target to source indices.
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

    /// Whether each axis of the target runs along the same axis of the source.
    fn is_parallel(&self) -> bool {
        let m = self.from_target.matrix3;
        let beside = [m.x_axis.y, m.x_axis.z, m.y_axis.x, m.y_axis.z, m.z_axis.x, m.z_axis.y];
        beside.iter().all(|&slope| slope == 0.0)
    }

    /// Fills a target that runs along the source's axes, slice by slice.
    fn planes(&self, spline: &Spline, to: &mut VoxelVolume<T>) {
        let along = |axis: usize| -> Vec<f32> {
            let (first, step) = (self.from_target.translation[axis], self.from_target.matrix3.col(axis)[axis]);
            (0..to.dims[axis]).map(|n| (first + n as f64 * step) as f32).collect()
        };
        let [xs, ys, zs] = [0, 1, 2].map(along);
        let [nx, ny, _] = to.dims;
        to.data.par_chunks_mut(nx * ny).zip(zs).for_each(|(slice, z)| {
            spline.plane(&xs, &ys, z, |row, values| {
                for ((to, &x), &value) in slice[row * nx..][..nx].iter_mut().zip(&xs).zip(values) {
                    if self.holds(Vec3::new(x, ys[row], z)) {
                        *to = T::from_f32(value);
                    }
                }
            });
        });
    }

    fn holds(&self, point: Vec3) -> bool {
        let half = Vec3::splat(0.5 + 1e-4);
        point.cmpge(-half).all() && point.cmple(self.last + half).all()
    }

    fn nearest(&self, point: Vec3) -> T {
        let voxel = (point.clamp(Vec3::ZERO, self.last) + 0.5).as_uvec3();
        self.volume.data[self.volume.index([voxel.x as usize, voxel.y as usize, voxel.z as usize])]
    }

    fn corners(&self, point: Vec3) -> [(usize, f32); 8] {
        corners(self.volume.dims, self.last, point)
    }

    fn trilinear(&self, point: Vec3) -> T {
        let corners = self.corners(point);
        let part = |&(at, weight): &(usize, f32)| weight * self.volume.data[at].to_f32();
        let sum: f32 = corners.iter().map(part).sum();
        if sum.is_nan() {
            // Voxels of zero weight are skipped, so that a NaN beside the point has no effect.
            return T::from_f32(corners.iter().filter(|(_, weight)| *weight > 0.0).map(part).sum());
        }
        T::from_f32(sum)
    }

    fn majority(&self, centre: Vec3, votes: &mut Votes<T>) -> T {
        if self.parts == UVec3::ONE {
            let around = self.corners(centre).map(|(at, _)| self.volume.data[at]);
            if around.iter().all(|label| *label == around[0]) {
                return around[0];
            }
        }
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

/// The 8 voxels around a point in continuous indices, with their weights; points are clamped to the
/// voxel centres.
pub fn corners(dims: [usize; 3], last: Vec3, point: Vec3) -> [(usize, f32); 8] {
    let p = point.clamp(Vec3::ZERO, last);
    let b = p.min((last - 1.0).max(Vec3::ZERO)).as_uvec3();
    let f = p - b.as_vec3();
    let g = 1.0 - f;
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

/// Weights of the labels, in the order met.
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

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DMat3;
    use proptest::prelude::*;

    fn oblique(dims: [usize; 3], seed: f64) -> DAffine3 {
        let turn = DMat3::from_rotation_x(seed) * DMat3::from_rotation_z(0.7 * seed);
        let scale = DMat3::from_diagonal(DVec3::new(-0.8, 1.1, 1.9));
        let middle = DVec3::from_array(dims.map(|n| 0.5 * (n as f64 - 1.0)));
        let matrix3 = turn * scale;
        DAffine3 { matrix3, translation: DVec3::new(3.0, -5.0, 2.0) - matrix3 * middle }
    }

    proptest! {
        #[test]
        fn trilinear_reproduces_linear_functions(seed in -3.0f64..3.0, slope in [-2.0f64..2.0, -2.0f64..2.0, -2.0f64..2.0]) {
            let slope = DVec3::from_array(slope);
            let dims = [14, 12, 9];
            let mut from = VoxelVolume::filled(dims, oblique(dims, seed), 0f32);
            for at in 0..from.data.len() {
                let p = from.centre_of([at % 14, at / 14 % 12, at / 168]);
                from.data[at] = (7.0 + slope.dot(p)) as f32;
            }
            let grid = Grid { dims: [5, 4, 3], world_from_voxel: oblique([5, 4, 3], 1.0 - seed) };
            let to = resample(&from, &grid, Interpolation::Trilinear, f32::NAN);
            let inner = from.world_from_voxel.inverse();
            for at in 0..to.data.len() {
                let world = to.centre_of([at % 5, at / 5 % 4, at / 20]);
                let voxel = inner.transform_point3(world);
                if voxel.cmpgt(DVec3::ZERO).all() && voxel.cmplt(DVec3::new(13.0, 11.0, 8.0)).all() {
                    prop_assert!((f64::from(to.data[at]) - 7.0 - slope.dot(world)).abs() < 1e-3);
                }
            }
        }
    }

    #[test]
    fn the_same_grid_gives_the_same_samples_and_a_mirrored_one_the_same_world() {
        let dims = [5, 4, 3];
        let mut from = VoxelVolume::filled(dims, oblique(dims, 0.0), 0i16);
        from.data.iter_mut().enumerate().for_each(|(at, v)| *v = 7 * at as i16 - 90);
        for how in [Interpolation::Trilinear, Interpolation::Cubic, Interpolation::Nearest, Interpolation::Majority] {
            assert_eq!(resample(&from, &Grid::of(&from), how, -1), from);
        }
        let over = Grid::isotropic_over(&from, 0.4);
        let there = resample(&from, &over, Interpolation::Nearest, i16::MIN);
        let back = resample(&there, &Grid::of(&from), Interpolation::Nearest, i16::MIN);
        assert_eq!(back, from);
    }

    #[test]
    fn the_isotropic_grid_covers_the_outer_faces_and_leaves_a_fitting_grid_alone() {
        let from = VoxelVolume::<u8>::filled([187, 243, 113], DAffine3::from_scale(DVec3::new(1.0, 1.0, 2.0)), 0);
        let grid = Grid::isotropic_over(&from, 1.0);
        assert_eq!((grid.dims, grid.voxels()), ([187, 243, 226], 187 * 243 * 226));
        assert_eq!(grid.world_from_voxel.translation, DVec3::new(0.0, 0.0, -0.5));
        let boxes = Grid::aligned_over(&from, DVec3::new(1.0, 3.0, 4.0));
        assert_eq!((boxes.dims, boxes.world_from_voxel.translation), ([187, 81, 57], DVec3::new(0.0, 1.0, 1.0)));
        let cubes = VoxelVolume::isotropic([9, 8, 7], Vec3::new(-3.25, 8.0, 1.5), 0.75, 0u8);
        assert_eq!(Grid::isotropic_over(&cubes, 0.75), Grid::of(&cubes));
    }

    #[test]
    fn majority_counts_what_a_coarse_voxel_covers() {
        let mut from = VoxelVolume::isotropic([6, 6, 6], Vec3::ZERO, 1.0, 2u8);
        for at in 0..216 {
            if at % 6 < 2 || at % 6 == 4 {
                from.data[at] = 9;
            }
        }
        let grid = Grid {
            dims: [2, 2, 2],
            world_from_voxel: DAffine3::from_translation(DVec3::ONE) * DAffine3::from_scale(DVec3::splat(3.0)),
        };
        let to = resample(&from, &grid, Interpolation::Majority, 0);
        assert_eq!(to.data, [9, 2, 9, 2, 9, 2, 9, 2]);
    }

    #[test]
    fn the_bytes_do_not_depend_on_the_number_of_threads() {
        let dims = [33, 21, 17];
        let mut from = VoxelVolume::filled(dims, oblique(dims, 0.3), 0f32);
        from.data.iter_mut().enumerate().for_each(|(at, v)| *v = (at as f32).sin());
        let grid = Grid::isotropic_over(&from, 0.7);
        let with = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| resample(&from, &grid, Interpolation::Trilinear, 0.0))
        };
        assert_eq!(with(1), with(3));
    }

    #[test]
    fn a_parallel_grid_has_the_values_of_points_one_by_one() {
        let mut from = VoxelVolume::isotropic([6, 5, 4], Vec3::new(3.0, -2.0, 1.0), 1.5, 0i16);
        from.data.iter_mut().enumerate().for_each(|(at, hu)| *hu = (at * at * 37 % 2003) as i16 - 900);
        let grid = Grid::isotropic_over(&from, 0.7);
        let (to, spline) = (resample(&from, &grid, Interpolation::Cubic, -1024), Spline::through(&from));
        let source = Source::new(&from, &grid);
        assert!(source.is_parallel());
        for (at, &found) in to.data.iter().enumerate() {
            let place = from.world_from_voxel.inverse().transform_point3(grid.place(at)).as_vec3();
            let expected = if source.holds(place) { i16::from_f32(spline.at(place)) } else { -1024 };
            assert!((i32::from(found) - i32::from(expected)).abs() <= 1, "{at}: {found}, {expected}");
        }
    }
}
