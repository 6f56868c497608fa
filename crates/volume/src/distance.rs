//! Signed distance to the surface of a mask or of a density level.
//!
//! # Theory
//! The surface points are the crossings of grid edges: between an inside voxel a and an outside
//! voxel b at the fraction `t = (v_a - level) / (v_a - v_b)` of the edge (1/2 for a mask). The
//! field is the exact Euclidean distance to the nearest crossing, `D(p) = min_s |p - s|`, negative
//! inside. Squared distances separate by axis, and each axis is a lower envelope of parabolas
//! (Felzenszwalb and Huttenlocher 2012), here with vertices at fractional positions along the
//! edge's own axis:
//!
//! ```text
//! D² = min( Z·Y·X̂, Z·X·Ŷ, Y·X·Ẑ )
//! X̂: parabolas at the crossings of x-edges; X: envelope over x of the previous result
//! ```
//!
//! Between the crossings the surface is nearer than the crossings. So each voxel whose edges cross
//! it at distances aᵢ along the axes adds the foot point on the plane through these crossings,
//! `n / |n|²` with `nᵢ = ± 1/aᵢ`, for the voxels within two of it.
//!
//! # Practice
//! Grids of cubes or boxes in any orientation, with orthogonal axes. Cost is linear in voxels:
//! about 0.2 µs per voxel and core; 4 bytes per voxel kept, 16 while building. Slices run in
//! parallel with bit-identical results for any number of threads. Beyond the grid's border nothing
//! is known: a mask that touches it has no surface there.
//!
//! Where voxels change, [`update`](DistanceField::update) recomputes a box: a 2 mm cut in a skull
//! of 0.5 mm voxels with a reach of 5 mm costs three thousandths of the whole.
//!
//! # Sources
//! P. Felzenszwalb, D. Huttenlocher, "Distance transforms of sampled functions", Theory of
//! Computing 8, 2012.
//!
//! # When not to use it
//! For single queries near a surface: checking the surrounding voxels is cheaper. On sheared grids
//! the distances are approximate.

use crate::resample::corners;
use crate::{Sample, VoxelVolume};
use glam::{DAffine3, DVec3};
use rayon::prelude::*;
use trepan_geometry::{Mat3, Vec3};

/// Signed distances in mm on a grid, negative inside, interpolated at any world point.
#[derive(Clone, Debug)]
pub struct DistanceField {
    values: VoxelVolume<f32>,
    voxel_from_world: DAffine3,
    last: Vec3,
    /// Transform from the slopes along i, j, k to the world gradient.
    world_from_slope: Mat3,
}

impl DistanceField {
    /// The distance to a mask (nonzero voxels), with its surface halfway between voxel centres.
    ///
    /// An empty mask gives [`FAR_MM`] everywhere, a full one minus that.
    pub fn of_mask(mask: &VoxelVolume<u8>) -> Self {
        Self::of_mask_within(mask, FAR_MM)
    }

    /// The same for distances up to a reach; larger ones are at least that. A short reach costs
    /// less.
    pub fn of_mask_within(mask: &VoxelVolume<u8>, reach_mm: f32) -> Self {
        Self::of(mask, |at| if mask.data[at] != 0 { 1.0 } else { -1.0 }, reach_mm)
    }

    /// The distance to the isosurface at `level`, with sub-voxel accuracy; inside is at or over it.
    pub fn of_level<T: Sample>(volume: &VoxelVolume<T>, level: f32) -> Self {
        Self::of(volume, |at| volume.data[at].to_f32() - level, FAR_MM)
    }

    /// `inside` returns a voxel's value above the level.
    fn of<T: Sample>(grid: &VoxelVolume<T>, inside: impl Fn(usize) -> f32 + Sync, reach_mm: f32) -> Self {
        let data = signed(grid.dims, grid.spacing_mm(), inside, reach_mm);
        Self::from_values(VoxelVolume { dims: grid.dims, data, world_from_voxel: grid.world_from_voxel })
    }

    /// Updates the field after voxels from `changed[0]` to `changed[1]`, inclusive, changed, such
    /// as by drilling.
    ///
    /// `inside` returns a voxel's present value above the level. Afterwards signs equal those of a
    /// full computation, and so do all distances up to `reach_mm`; larger ones are at least that.
    /// The cost is that of the box extended by twice the reach.
    pub fn update(&mut self, inside: impl Fn([usize; 3]) -> f32 + Sync, changed: [[usize; 3]; 2], reach_mm: f32) {
        let (dims, spacing) = (self.values.dims, self.values.spacing_mm());
        let reach = |axis: usize| (f64::from(reach_mm.clamp(0.0, FAR_MM)) / spacing[axis]).ceil().min(1e9) as usize;
        // An edge's crossing moves with either end, and a foot point affects voxels within two of
        // its own.
        let around = |more: &dyn Fn(usize) -> usize| -> [std::ops::Range<usize>; 3] {
            std::array::from_fn(|a| {
                let end = changed[1][a].saturating_add(more(a) + 1).min(dims[a]);
                changed[0][a].saturating_sub(more(a)).min(end)..end
            })
        };
        let (set, seen) = (around(&|a| reach(a) + 3), around(&|a| 2 * reach(a) + 7));
        let size = [0, 1, 2].map(|a| seen[a].len());
        let place = |at: usize| {
            [
                seen[0].start + at % size[0],
                seen[1].start + at / size[0] % size[1],
                seen[2].start + at / (size[0] * size[1]),
            ]
        };
        let fresh = signed(size, spacing, |at| inside(place(at)), FAR_MM);
        for k in set[2].clone() {
            for j in set[1].clone() {
                let from = set[0].start - seen[0].start + size[0] * (j - seen[1].start + size[1] * (k - seen[2].start));
                let to = self.values.index([set[0].start, j, k]);
                self.values.data[to..to + set[0].len()].copy_from_slice(&fresh[from..from + set[0].len()]);
            }
        }
    }

    fn from_values(values: VoxelVolume<f32>) -> Self {
        let m = values.world_from_voxel.matrix3;
        Self {
            voxel_from_world: values.world_from_voxel.inverse(),
            last: Vec3::from_array(values.dims.map(|n| n.saturating_sub(1) as f32)),
            world_from_slope: m.inverse().transpose().as_mat3(),
            values,
        }
    }

    /// The distances at the voxel centres, mm.
    pub fn values(&self) -> &VoxelVolume<f32> {
        &self.values
    }

    /// The distances without what finds them at a point.
    pub fn into_values(self) -> VoxelVolume<f32> {
        self.values
    }

    /// The distance at a world point, mm: trilinear, clamped to the grid's border outside.
    pub fn sample(&self, world: Vec3) -> f32 {
        self.at(self.voxel_of(world))
    }

    /// The gradient at a world point by central differences over one voxel: about unit length,
    /// pointing outwards.
    ///
    /// It is shorter where the nearest surface changes, and outside the grid, where the field is
    /// constant.
    pub fn gradient(&self, world: Vec3) -> Vec3 {
        let p = self.voxel_of(world);
        let slope = |step: Vec3| self.at(p + step) - self.at(p - step);
        self.world_from_slope * Vec3::new(slope(0.5 * Vec3::X), slope(0.5 * Vec3::Y), slope(0.5 * Vec3::Z))
    }

    fn voxel_of(&self, world: Vec3) -> Vec3 {
        self.voxel_from_world.transform_point3(world.as_dvec3()).as_vec3()
    }

    fn at(&self, voxel: Vec3) -> f32 {
        if self.values.data.is_empty() {
            return FAR_MM;
        }
        corners(self.values.dims, self.last, voxel).iter().map(|&(at, w)| w * self.values.data[at]).sum()
    }
}

/// The distance if there is no surface, mm.
pub const FAR_MM: f32 = 1e6;

/// Distances at the voxels, negative where `inside` is 0 or more, mm; exact up to a reach.
fn signed(dims: [usize; 3], spacing: DVec3, inside: impl Fn(usize) -> f32 + Sync, reach_mm: f32) -> Vec<f32> {
    let mut data = squared_distances(dims, spacing, &inside, reach_mm);
    let (feet, slice) = (feet(dims, spacing, &inside), (dims[0] * dims[1]).max(1));
    data.par_chunks_mut(slice).enumerate().for_each(|(k, squared)| {
        let first = feet.partition_point(|(at, _)| at / slice + 2 < k);
        let near = feet[first..].iter().take_while(|(at, _)| at / slice <= k + 2);
        near.for_each(|&(at, foot)| splat(dims, spacing, (at, foot), k, squared));
    });
    data.par_iter_mut().enumerate().for_each(|(at, d)| {
        let far = d.sqrt().min(FAR_MM);
        *d = if inside(at) >= 0.0 { -far } else { far };
    });
    data
}

/// Foot points of all voxels with an edge that crosses the surface, from the centre, mm.
fn feet(dims: [usize; 3], spacing: DVec3, inside: &(impl Fn(usize) -> f32 + Sync)) -> Vec<(usize, DVec3)> {
    let steps = [1, dims[0], dims[0] * dims[1]];
    let foot = |at: usize, place: [usize; 3]| {
        let own = inside(at);
        let mut n = DVec3::ZERO;
        for axis in 0..3 {
            let before = (place[axis] > 0).then(|| (-1.0, inside(at - steps[axis])));
            let after = (place[axis] + 1 < dims[axis]).then(|| (1.0, inside(at + steps[axis])));
            for (side, other) in [before, after].into_iter().flatten() {
                if (other >= 0.0) == (own >= 0.0) {
                    continue;
                }
                let part = f64::from(own / (own - other)).max(1e-6);
                if part.is_finite() && (part * spacing[axis]).recip() > n[axis].abs() {
                    n[axis] = side / (part * spacing[axis]);
                }
            }
        }
        (n != DVec3::ZERO).then(|| (at, n / n.length_squared()))
    };
    let row = |row: usize| {
        let [j, k] = [row % dims[1], row / dims[1]];
        (0..dims[0]).filter_map(move |i| foot(row * dims[0] + i, [i, j, k])).collect::<Vec<_>>()
    };
    (0..dims[1] * dims[2]).into_par_iter().flat_map_iter(row).collect()
}

/// Lowers the squared distances of the voxels of slice `k` within two of a foot point to the
/// distance to it.
fn splat(dims: [usize; 3], spacing: DVec3, (at, foot): (usize, DVec3), k: usize, squared: &mut [f32]) {
    let place = [at % dims[0], at / dims[0] % dims[1], at / (dims[0] * dims[1])];
    let range = |axis: usize| place[axis].saturating_sub(2)..(place[axis] + 3).min(dims[axis]);
    let away = |axis: usize, n: usize| ((n as f64 - place[axis] as f64) * spacing[axis] - foot[axis]).powi(2);
    for j in range(1) {
        let row = away(2, k) + away(1, j);
        for i in range(0) {
            let to = &mut squared[i + dims[0] * j];
            *to = to.min((row + away(0, i)) as f32);
        }
    }
}

/// Squared distances to the nearest crossing, mm²; what is beyond the reach is not followed.
fn squared_distances(
    dims: [usize; 3],
    spacing: DVec3,
    inside: &(impl Fn(usize) -> f32 + Sync),
    reach_mm: f32,
) -> Vec<f32> {
    // No part of a sum of squares exceeds it.
    let most = reach_mm * reach_mm;
    let crossings = |axis: usize| {
        along(dims, axis, |line, envelope, out| {
            envelope.clear();
            let mut before = inside(line.at(0));
            for n in 1..line.length {
                let after = inside(line.at(n));
                if (before >= 0.0) != (after >= 0.0) {
                    let part = Some(before / (before - after)).filter(|t| t.is_finite()).unwrap_or(0.5);
                    envelope.add(((n - 1) as f64 + f64::from(part)) * spacing[axis], 0.0);
                }
                before = after;
            }
            envelope.read(spacing[axis], out);
        })
    };
    let spread = |axis: usize, field: Vec<f32>| {
        along(dims, axis, |line, envelope, out| {
            envelope.clear();
            for n in 0..line.length {
                let height = field[line.at(n)];
                if height <= most {
                    envelope.add(n as f64 * spacing[axis], height);
                }
            }
            envelope.read(spacing[axis], out);
        })
    };
    let xy = least(spread(1, crossings(0)), &spread(0, crossings(1)));
    least(spread(2, xy), &spread(1, spread(0, crossings(2))))
}

fn least(mut a: Vec<f32>, b: &[f32]) -> Vec<f32> {
    a.par_iter_mut().zip(b).for_each(|(a, b)| *a = a.min(*b));
    a
}

/// A row of voxels along one axis.
#[derive(Clone, Copy)]
struct Line {
    start: usize,
    step: usize,
    length: usize,
}

impl Line {
    fn at(self, n: usize) -> usize {
        self.start + n * self.step
    }
}

/// Planes across y that are held in memory beside the volume.
const PLANES: usize = 32;

/// Processes every line along `axis` and stores the results in the volume's order.
fn along([nx, ny, nz]: [usize; 3], axis: usize, line: impl Fn(Line, &mut Envelope, &mut [f32]) + Sync) -> Vec<f32> {
    let slice = nx * ny;
    let mut all = vec![0.0; slice * nz];
    if all.is_empty() {
        return all;
    }
    match axis {
        0 => all.par_chunks_mut(nx).enumerate().for_each_init(Envelope::default, |envelope, (row, out)| {
            line(Line { start: row * nx, step: 1, length: nx }, envelope, out);
        }),
        1 => all.par_chunks_mut(slice).enumerate().for_each_init(Envelope::default, |envelope, (k, out)| {
            plane(nx, ny, out, |i, column| line(Line { start: k * slice + i, step: nx, length: ny }, envelope, column));
        }),
        _ => {
            let plane_at = |envelope: &mut Envelope, j: usize| {
                let mut out = vec![0.0; nx * nz];
                plane(nx, nz, &mut out, |i, column| {
                    line(Line { start: j * nx + i, step: slice, length: nz }, envelope, column);
                });
                out
            };
            for first in (0..ny).step_by(PLANES) {
                let some = (first..ny.min(first + PLANES)).into_par_iter();
                let planes: Vec<Vec<f32>> = some.map_init(Envelope::default, plane_at).collect();
                all.par_chunks_mut(slice).enumerate().for_each(|(k, out)| {
                    for (row, plane) in out[first * nx..].chunks_mut(nx).zip(&planes) {
                        row.copy_from_slice(&plane[k * nx..(k + 1) * nx]);
                    }
                });
            }
        }
    }
    all
}

/// Fills a plane of `width` columns, x fastest, column by column.
fn plane(width: usize, height: usize, out: &mut [f32], mut column: impl FnMut(usize, &mut [f32])) {
    let mut values = vec![0.0; height];
    for i in 0..width {
        column(i, &mut values);
        for (j, &value) in values.iter().enumerate() {
            out[i + j * width] = value;
        }
    }
}

/// Lower envelope of parabolas `(x - vertex)² + height`; vertices are added in rising order.
#[derive(Default)]
struct Envelope {
    /// Vertex, height and the start of each parabola's interval.
    parabolas: Vec<(f64, f64, f64)>,
}

impl Envelope {
    fn clear(&mut self) {
        self.parabolas.clear();
    }

    fn add(&mut self, vertex: f64, height: f32) {
        if !height.is_finite() {
            return;
        }
        let height = f64::from(height);
        let mut from = f64::NEG_INFINITY;
        while let Some(&(v, h, start)) = self.parabolas.last() {
            from = match vertex > v {
                true => 0.5 * ((height - h) / (vertex - v) + vertex + v),
                false if height < h => f64::NEG_INFINITY,
                false => return,
            };
            if from > start {
                break;
            }
            self.parabolas.pop();
            from = f64::NEG_INFINITY;
        }
        self.parabolas.push((vertex, height, from));
    }

    /// Samples the envelope at multiples of `step`, from 0.
    fn read(&self, step: f64, out: &mut [f32]) {
        if self.parabolas.is_empty() {
            return out.fill(f32::INFINITY);
        }
        let mut at = 0;
        for (n, out) in out.iter_mut().enumerate() {
            let x = n as f64 * step;
            while at + 1 < self.parabolas.len() && self.parabolas[at + 1].2 <= x {
                at += 1;
            }
            let (v, h, _) = self.parabolas[at];
            *out = ((x - v) * (x - v) + h) as f32;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{DMat3, DVec3};
    use proptest::prelude::*;

    /// Brute-force distance to the nearest crossing of any grid edge, or foot point within two
    /// voxels.
    fn slow(levels: &VoxelVolume<f32>, from: [usize; 3]) -> f64 {
        let mut best = f64::INFINITY;
        let here = levels.centre_of(from);
        let [nx, ny, nz] = levels.dims;
        for at in 0..nx * ny * nz {
            let p = [at % nx, at / nx % ny, at / (nx * ny)];
            let a = levels.data[at];
            let mut n = DVec3::ZERO;
            for axis in 0..3 {
                let mut nearest = f64::INFINITY;
                for side in [p[axis].wrapping_sub(1), p[axis] + 1] {
                    let mut q = p;
                    q[axis] = side;
                    let Some(b) = levels.get(q).filter(|&b| (a >= 0.0) != (b >= 0.0)) else { continue };
                    let part = f64::from(a / (a - b)).max(1e-6);
                    let way = (levels.centre_of(q) - levels.centre_of(p)) * part;
                    best = best.min((levels.centre_of(p) + way).distance(here));
                    if part < nearest {
                        nearest = part;
                        n += way / way.length_squared() - n.project_onto(way);
                    }
                }
            }
            if n != DVec3::ZERO && (0..3).all(|axis| p[axis].abs_diff(from[axis]) <= 2) {
                best = best.min((levels.centre_of(p) + n / n.length_squared()).distance(here));
            }
        }
        best
    }

    proptest! {
        #[test]
        fn distances_equal_brute_force(
            dims in [1usize..7, 1usize..7, 1usize..7],
            values in prop::collection::vec(-9i8..9, 216),
            spacing in [0.5f64..2.0, 0.5f64..2.0, 0.5f64..2.0],
        ) {
            let turn = DMat3::from_rotation_y(0.4) * DMat3::from_rotation_z(1.1);
            let affine = DAffine3::from_mat3(turn * DMat3::from_diagonal(DVec3::from_array(spacing)));
            let data = values[..dims.iter().product()].iter().map(|&v| f32::from(v)).collect();
            let levels = VoxelVolume { dims, data, world_from_voxel: affine };
            let field = DistanceField::of_level(&levels, 0.0);
            for at in 0..levels.data.len() {
                let p = [at % dims[0], at / dims[0] % dims[1], at / (dims[0] * dims[1])];
                let truth = slow(&levels, p).min(f64::from(FAR_MM));
                let found = f64::from(field.values().data[at]);
                prop_assert!((found.abs() - truth).abs() < 1e-4 * (1.0 + truth.abs()), "{found} for {truth}");
                let inside = levels.data[at] >= 0.0;
                prop_assert!(found == 0.0 || inside == (found < 0.0));
            }
        }
    }

    proptest! {
        #[test]
        fn an_update_is_a_full_computation_up_to_its_reach(
            seed in 0u64..1000,
            holes in prop::collection::vec(([0usize..24, 0usize..20, 0usize..18], 0usize..4), 1..4),
            reach in 0.0f32..9.0,
        ) {
            let dims = [24, 20, 18];
            let affine = DAffine3::from_scale(DVec3::new(0.8, 1.0, 1.3));
            let mut levels = VoxelVolume::filled(dims, affine, 0f32);
            for at in 0..levels.data.len() {
                let p = levels.centre_of([at % 24, at / 24 % 20, at / 480]);
                levels.data[at] = 7.0 - p.distance(DVec3::splat(9.0)) as f32 + ((at as u64 * 31 + seed) % 17) as f32 / 17.0;
            }
            let mut field = DistanceField::of_level(&levels, 0.0);
            for (centre, radius) in holes {
                let low = centre.map(|c| c.saturating_sub(radius));
                let high: [usize; 3] = std::array::from_fn(|a| (centre[a] + radius).min(dims[a] - 1));
                for at in 0..levels.data.len() {
                    let p = [at % 24, at / 24 % 20, at / 480];
                    if (0..3).all(|a| (low[a]..=high[a]).contains(&p[a])) {
                        levels.data[at] = -5.0;
                    }
                }
                field.update(|p| levels.data[levels.index(p)], [low, high], reach);
                let whole = DistanceField::of_level(&levels, 0.0);
                for (found, truth) in field.values().data.iter().zip(&whole.values().data) {
                    let near = truth.clamp(-reach, reach);
                    prop_assert!((found.clamp(-reach, reach) - near).abs() < 1e-4, "{found} for {truth}");
                    prop_assert_eq!(found.is_sign_negative(), truth.is_sign_negative());
                }
            }
        }
    }

    #[test]
    fn a_ball_has_its_closed_form_and_its_gradient_points_outwards() {
        let centre = Vec3::new(1.0, -2.0, 3.0);
        let mut ball = VoxelVolume::isotropic([41, 41, 41], centre - 20.0, 1.0, 0f32);
        for at in 0..ball.data.len() {
            let p = ball.centre_of([at % 41, at / 41 % 41, at / 1681]).as_vec3();
            ball.data[at] = 11.3 - p.distance(centre);
        }
        let fine = DistanceField::of_level(&ball, 0.0);
        let coarse = DistanceField::of_mask(&ball.map(|v| u8::from(v >= 0.0)));
        let (mut worst_fine, mut worst_coarse) = (0.0f32, 0.0f32);
        for n in 0..200 {
            let direction = Vec3::new((n as f32).sin(), (1.7 * n as f32).cos(), (0.3 * n as f32).sin()).normalize();
            let radius = 5.0 + 0.05 * n as f32;
            let p = centre + radius * direction;
            worst_fine = worst_fine.max((fine.sample(p) - (radius - 11.3)).abs());
            worst_coarse = worst_coarse.max((coarse.sample(p) - (radius - 11.3)).abs());
            let slope = fine.gradient(p);
            assert!(
                slope.normalize().dot(direction) > 0.98 && (0.8..1.2).contains(&slope.length()),
                "{slope} along {direction} at {radius}"
            );
        }
        assert!(worst_fine < 0.15 && worst_coarse < 0.6, "{worst_fine} {worst_coarse}");
    }

    #[test]
    fn a_wall_is_exact_and_what_has_no_surface_is_far() {
        let mut wall = VoxelVolume::isotropic([12, 4, 4], Vec3::ZERO, 0.5, 0u8);
        assert_eq!(DistanceField::of_mask(&wall).sample(Vec3::ONE), FAR_MM);
        for at in 0..wall.data.len() {
            wall.data[at] = u8::from(at % 12 < 6);
        }
        let field = DistanceField::of_mask(&wall);
        assert!((field.sample(Vec3::new(4.0, 0.7, 0.6)) - 1.25).abs() < 1e-6);
        assert!((field.sample(Vec3::new(1.1, 0.7, 0.6)) + 1.65).abs() < 1e-6);
        assert!(field.gradient(Vec3::new(3.0, 0.7, 0.6)).distance(Vec3::X) < 1e-6);
        assert_eq!(field.sample(Vec3::new(99.0, 0.0, 0.0)), field.sample(Vec3::new(5.5, 0.0, 0.0)));
    }

    #[test]
    fn a_reach_changes_only_what_is_beyond_it() {
        let mut mask = VoxelVolume::isotropic([40, 31, 27], Vec3::ZERO, 0.7, 0u8);
        for at in 0..mask.data.len() {
            let p = mask.centre_of([at % 40, at / 40 % 31, at / 1240]).as_vec3();
            mask.data[at] = u8::from((0.6 * p.x).sin() + (0.5 * p.y).cos() > 0.3 && p.z < 12.0 && p.x < 20.0);
        }
        let whole = DistanceField::of_mask(&mask);
        for reach in [0.5, 2.0, 5.5] {
            let near = DistanceField::of_mask_within(&mask, reach);
            for (a, b) in near.values.data.iter().zip(&whole.values.data) {
                let same = a.to_bits() == b.to_bits();
                assert!(same || b.abs() > reach && a.abs() > reach && (*a < 0.0) == (*b < 0.0), "{reach}: {a}, {b}");
            }
        }
    }
}
