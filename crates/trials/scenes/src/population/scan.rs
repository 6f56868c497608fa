//! Simulated scanners: the voxel grids and the contents of CT and MRI.

use super::base::BaseHead;
use super::lesion::Tumour;
use super::metal::{Metal, USUAL_HU};
use super::recipe::{HeadRecipe, Spacing, random_of};
use super::spline::Spline;
use super::warp::{Place, Warp};
use glam::{Affine3A, DAffine3, DMat3, DVec3, Vec3};
use rayon::prelude::*;
use trepan_volume::{AIR_HU, Grid, Sample, VoxelVolume};

/// Largest number of voxels of an image; pixels are enlarged to stay below it.
pub const MOST_VOXELS: usize = 40_000_000;
/// Air margin around the head, mm.
const MARGIN_MM: f64 = 6.0;
/// Largest thickness of the sublayers that a slice averages, mm.
const PART_MM: f64 = 1.3;
/// CT value of cerebrospinal fluid, HU.
const FLUID_HU: f32 = 8.0;
/// CT value of a tumour above the brain's, HU.
const TUMOUR_HU: f64 = 20.0;
/// Spacing of the bias field's control points, mm.
const BIAS_MM: f64 = 90.0;

/// CT grid: slices tilted towards the front, stacked along the table.
pub fn ct_grid(recipe: &HeadRecipe, warp: &Warp, base: &BaseHead) -> Grid {
    let (sin, cos) = recipe.tilt_degrees.to_radians().sin_cos();
    let axes = DMat3::from_cols(DVec3::X, DVec3::new(0.0, cos, sin), DVec3::Z);
    stack(axes, recipe.ct_spacing, warp, base)
}

/// MRI grid.
pub fn mri_grid(recipe: &HeadRecipe, warp: &Warp, base: &BaseHead) -> Grid {
    let axes = [1, 2, 3].map(|n| DVec3::AXES[(recipe.mri_slice_axis + n) % 3]);
    stack(DMat3::from_cols(axes[0], axes[1], axes[2]), recipe.mri_spacing, warp, base)
}

/// Stack of slices around the head, with enlarged pixels if it has too many voxels.
fn stack(axes: DMat3, spacing: Spacing, warp: &Warp, base: &BaseHead) -> Grid {
    let along = DAffine3::from_mat3(axes.inverse()) * warp.head_from_base();
    let points = base.anatomy.head.iter().map(|p| along.transform_point3(*p));
    let (low, high) = points.fold((DVec3::MAX, DVec3::MIN), |(low, high), p| (low.min(p), high.max(p)));
    let (low, high) = (low - MARGIN_MM, high + MARGIN_MM);
    let mut pixel = spacing.pixel_mm;
    loop {
        let edges = DVec3::new(pixel, pixel, spacing.slice_mm);
        let dims = ((high - low) / edges).ceil().as_uvec3().to_array().map(|n| n as usize);
        let grid = Grid {
            dims,
            world_from_voxel: DAffine3 { matrix3: axes * DMat3::from_diagonal(edges), translation: axes * low },
        };
        if grid.voxels() <= MOST_VOXELS {
            return grid;
        }
        pixel *= 1.02;
    }
}

/// Head before scanning.
pub struct Patient<'a> {
    pub recipe: &'a HeadRecipe,
    pub base: &'a BaseHead,
    pub warp: &'a Warp,
    pub tumour: Option<Tumour>,
}

impl Patient<'_> {
    /// Scans the CT, HU.
    pub fn ct(&self, grid: &Grid) -> VoxelVolume<i16> {
        let metal = Metal::of(self.recipe, self.warp, self.base);
        let from = Source::new(&self.base.ct, AIR_HU.into());
        let look = |place: Place| if self.is_fluid(place) { FLUID_HU } else { from.at(place.base) };
        let noise = self.recipe.ct_noise_hu as f32;
        self.scanned(grid, look, |[j, k], sums, row| {
            let start = grid.world_from_voxel.transform_point3(DVec3::new(0.0, j as f64, k as f64));
            let mut random = random_of(self.recipe.seed, 1000 + (j + grid.dims[1] * k) as u64);
            for (i, hu) in sums.iter_mut().enumerate() {
                *hu += (TUMOUR_HU * self.tumour_share(start + i as f64 * grid.world_from_voxel.x_axis)) as f32;
                *hu = (*hu + noise * normal(&mut random)).min(USUAL_HU);
            }
            metal.iter().for_each(|piece| piece.cast(&grid.world_from_voxel, [j, k], sums));
            row.iter_mut().zip(sums).for_each(|(to, hu)| *to = i16::from_f32(hu.max(-1024.0)));
        })
    }

    /// Scans the MRI.
    pub fn mri(&self, grid: &Grid) -> VoxelVolume<f32> {
        let anatomy = &self.base.anatomy;
        let from = Source::new(&self.base.mri, 0.0);
        let look = |place: Place| if self.is_fluid(place) { anatomy.fluid } else { from.at(place.base) };
        let mut random = random_of(self.recipe.seed, 5);
        let bias = Spline::random(self.warp.corners(), BIAS_MM, self.recipe.mri_bias, &mut random);
        let ill = self.tumour.as_ref().map_or(0.0, |tumour| tumour.brightness) * f64::from(anatomy.tissue);
        let step = grid.world_from_voxel.x_axis;
        self.scanned(grid, look, |[j, k], sums, row| {
            let start = grid.world_from_voxel.transform_point3(DVec3::new(0.0, j as f64, k as f64));
            // The field varies over centimetres.
            let field: Vec<f64> =
                (0..=row.len() / 8 + 1).map(|n| 1.0 + bias.at(start + (8 * n) as f64 * step).x).collect();
            for (i, (to, sum)) in row.iter_mut().zip(sums).enumerate() {
                let share = self.tumour_share(start + i as f64 * step);
                let value = f64::from(*sum) * (1.0 - share) + ill * share;
                let part = (i % 8) as f64 / 8.0;
                *to = (value * (field[i / 8] * (1.0 - part) + field[i / 8 + 1] * part)) as f32;
            }
        })
    }

    /// Brain mask, 0 or 1, by voxel centres.
    pub fn brain(&self, grid: &Grid) -> VoxelVolume<u8> {
        let truth = &self.base.anatomy.truth;
        let mut mask = VoxelVolume::filled(grid.dims, grid.world_from_voxel, 0);
        let (nx, ny) = (grid.dims[0], grid.dims[1]);
        mask.data.par_chunks_mut(nx).enumerate().for_each(|(row, values)| {
            let start = DVec3::new(0.0, (row % ny) as f64, (row / ny) as f64);
            let start = grid.world_from_voxel.transform_point3(start);
            self.warp.along(start, grid.world_from_voxel.x_axis, nx, |i, place| {
                values[i] = u8::from(truth.sample(place.base) < 0.0);
            });
        });
        mask
    }

    /// FreeSurfer labels on the brain's grid, by voxel centres; 0 outside the brain.
    pub fn labels(&self, brain: &VoxelVolume<u8>) -> VoxelVolume<u16> {
        let of_base = &self.base.labels;
        let voxel_from_world = of_base.world_from_voxel.inverse();
        let mut labels = brain.map(u16::from);
        let [nx, ny, _] = labels.dims;
        let to_world = labels.world_from_voxel;
        labels.data.par_chunks_mut(nx).enumerate().for_each(|(row, values)| {
            let start = to_world.transform_point3(DVec3::new(0.0, (row % ny) as f64, (row / ny) as f64));
            self.warp.along(start, to_world.x_axis, nx, |i, place| {
                let at = voxel_from_world.transform_point3(place.base.as_dvec3()).round();
                let at = at.cmpge(DVec3::ZERO).all().then(|| at.to_array().map(|n| n as usize));
                values[i] *= at.and_then(|at| of_base.get(at)).unwrap_or_default();
            });
        });
        labels
    }

    /// Tumour mask on the brain's grid: 1 where a brain voxel is more than half tumour.
    pub fn tumour_labels(&self, brain: &VoxelVolume<u8>) -> Option<VoxelVolume<u8>> {
        let tumour = self.tumour.as_ref()?;
        let [nx, ny, _] = brain.dims;
        let mut labels = brain.clone();
        labels.data.par_chunks_mut(nx).enumerate().for_each(|(row, values)| {
            for (i, value) in values.iter_mut().enumerate().filter(|(_, v)| **v != 0) {
                *value = u8::from(tumour.share(brain.centre_of([i, row % ny, row / ny])) > 0.5);
            }
        });
        Some(labels)
    }

    fn tumour_share(&self, point: DVec3) -> f64 {
        self.tumour.as_ref().map_or(0.0, |tumour| tumour.share(point))
    }

    /// Whether atrophy replaced the brain by fluid here.
    fn is_fluid(&self, place: Place) -> bool {
        self.recipe.atrophy_mm > 0.0 && place.intact < 0.0 && self.base.anatomy.truth.sample(place.base) >= 0.0
    }

    /// Scans an image: averages each row over the slice thickness and converts it with `finish`.
    fn scanned<T: Sample>(
        &self,
        grid: &Grid,
        look: impl Fn(Place) -> f32 + Sync,
        finish: impl Fn([usize; 2], &mut [f32], &mut [T]) + Sync,
    ) -> VoxelVolume<T> {
        let world = grid.world_from_voxel;
        let parts = (world.z_axis.length() / PART_MM).ceil().max(1.0) as usize;
        let mut image = VoxelVolume::filled(grid.dims, world, T::from_f32(0.0));
        let (nx, ny) = (grid.dims[0], grid.dims[1]);
        image.data.par_chunks_mut(nx).enumerate().for_each_init(
            || vec![0f32; nx],
            |sums, (row, values)| {
                let (j, k) = (row % ny, row / ny);
                sums.fill(0.0);
                for part in 0..parts {
                    let depth = (part as f64 + 0.5) / parts as f64 - 0.5;
                    let start = world.transform_point3(DVec3::new(0.0, j as f64, k as f64 + depth));
                    self.warp.along(start, world.x_axis, nx, |i, place| sums[i] += look(place));
                }
                sums.iter_mut().for_each(|sum| *sum /= parts as f32);
                finish([j, k], sums, values);
            },
        );
        image
    }
}

/// Image sampled at world points.
///
/// Below it, the neck continues its lowest slice; elsewhere outside there is air.
struct Source<'a, T> {
    volume: &'a VoxelVolume<T>,
    voxel_from_world: Affine3A,
    last: Vec3,
    middle_z: f32,
    air: f32,
}

impl<'a, T: Sample> Source<'a, T> {
    fn new(volume: &'a VoxelVolume<T>, air: f32) -> Self {
        let inverse = volume.world_from_voxel.inverse();
        let voxel_from_world =
            Affine3A::from_mat3_translation(inverse.matrix3.as_mat3(), inverse.translation.as_vec3());
        let last = Vec3::from_array(volume.dims.map(|n| (n - 1) as f32));
        Self { volume, voxel_from_world, last, middle_z: volume.world_box().centre().z, air }
    }

    fn at(&self, point: Vec3) -> f32 {
        let p = self.voxel_from_world.transform_point3(point);
        let inside = p.clamp(Vec3::ZERO, self.last);
        if point.z > self.middle_z && (p - inside).abs().max_element() > 0.5 {
            return self.air;
        }
        let at = inside.min(self.last - 1.0).as_uvec3();
        let f = inside - at.as_vec3();
        let [nx, ny, _] = self.volume.dims;
        let first = at.x as usize + nx * (at.y as usize + ny * at.z as usize);
        let value = |at: usize| self.volume.data[at].to_f32();
        let line = |from: usize| value(from) + f.x * (value(from + 1) - value(from));
        let plane = |from: usize| line(from) + f.y * (line(from + nx) - line(from));
        plane(first) + f.z * (plane(first + nx * ny) - plane(first))
    }
}

/// Approximately normal deviate: sum of four uniform ones, with a standard deviation of 1.
fn normal(random: &mut fastrand::Rng) -> f32 {
    let bits = random.u64(..);
    let sum: f32 = [0, 16, 32, 48].map(|shift| (bits >> shift & 0xffff) as f32).iter().sum();
    (sum / 65536.0 - 2.0) * 3f32.sqrt()
}
