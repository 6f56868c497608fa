//! Map from a new head to its base, tabulated on a grid of nodes.

use super::base::BaseHead;
use super::local::{Local, between};
use super::recipe::{HeadRecipe, random_of};
use super::spline::Spline;
use glam::{DAffine3, DMat3, DQuat, DVec3, Vec3, Vec4};
use rayon::prelude::*;
use trepan_volume::VoxelVolume;

/// Spacing of the nodes, mm.
const NODE_MM: f64 = 2.0;
/// Spacing of the spline's control points, mm.
const CONTROL_MM: f64 = 30.0;
/// Margin around the head, mm: larger than any displacement.
const MARGIN_MM: f64 = 10.0;
/// Smallest relative volume to which the map may shrink a cell.
const LEAST_JACOBIAN: f64 = 0.02;
/// Factor on the displacements for each retry after folding.
const WEAKER: f64 = 0.9;

/// Position of a head's point in the base.
#[derive(Clone, Copy)]
pub struct Place {
    /// Point in the base, mm.
    pub base: Vec3,
    /// Distance to the brain before atrophy, mm; 0 without atrophy.
    pub intact: f32,
}

/// Map from a new head to its base.
pub struct Warp {
    base_from_head: DAffine3,
    head_from_base: DAffine3,
    /// For each node, the displacement after the affine part, mm, and the intact brain's distance.
    nodes: VoxelVolume<Vec4>,
    /// Share of the displacements that was kept to prevent folding.
    pub share: f64,
}

impl Warp {
    /// Creates the map of a recipe, with displacements weakened until it does not fold.
    pub fn new(recipe: &HeadRecipe, base: &BaseHead) -> Self {
        let head_from_base = affine(recipe, base.anatomy.middle);
        let box_of = |points: &mut dyn Iterator<Item = DVec3>| {
            points.fold((DVec3::MAX, DVec3::MIN), |(low, high), p| (low.min(p), high.max(p)))
        };
        let (low, high) = box_of(&mut base.anatomy.head.iter().map(|p| head_from_base.transform_point3(*p)));
        let cells = ((high - low + 2.0 * MARGIN_MM) / NODE_MM).ceil().as_uvec3().to_array();
        let origin = (low - MARGIN_MM).as_vec3();
        let nodes = VoxelVolume::isotropic(cells.map(|n| n as usize + 1), origin, NODE_MM as f32, Vec4::ZERO);
        let mut warp = Self { base_from_head: head_from_base.inverse(), head_from_base, nodes, share: 1.0 };
        let mut random = random_of(recipe.seed, 2);
        let spline = Spline::random(base.ct.world_corners(), CONTROL_MM, recipe.warp_mm, &mut random);
        loop {
            warp.set(base, recipe, &spline);
            if warp.least_jacobian() >= LEAST_JACOBIAN {
                return warp;
            }
            warp.share *= WEAKER;
        }
    }

    fn set(&mut self, base: &BaseHead, recipe: &HeadRecipe, spline: &Spline) {
        let Self { base_from_head, share, .. } = *self;
        let local = Local::new(&base.anatomy, recipe, share);
        let ([nx, ny, _], world) = (self.nodes.dims, self.nodes.world_from_voxel);
        self.nodes.data.par_chunks_mut(nx).enumerate().for_each(|(row, nodes)| {
            for (i, node) in nodes.iter_mut().enumerate() {
                let point = world.transform_point3(DVec3::new(i as f64, (row % ny) as f64, (row / ny) as f64));
                let affine = base_from_head.transform_point3(point);
                let bent = affine + share * spline.at(affine);
                let place = local.place(bent);
                let intact = place.intact.map_or(0.0, |intact| base.anatomy.truth.sample(intact));
                *node = (place.base.as_dvec3() - affine).as_vec3().extend(intact);
            }
        });
    }

    /// Affine part: maps a point of the base to the new head.
    pub fn head_from_base(&self) -> DAffine3 {
        self.head_from_base
    }

    /// Lowest and highest corner of the node grid, mm.
    pub fn corners(&self) -> (DVec3, DVec3) {
        (self.nodes.centre_of([0; 3]), self.nodes.centre_of(self.nodes.dims.map(|n| n - 1)))
    }

    /// Maps a point of the head to the base.
    pub fn place(&self, point: DVec3) -> Place {
        let node = self.node(point);
        Place {
            base: (self.base_from_head.transform_point3(point) + node.truncate().as_dvec3()).as_vec3(),
            intact: node.w,
        }
    }

    /// Visits points on a line, `step` apart; exact every 2 mm or less, interpolated between.
    pub fn along(&self, start: DVec3, step: DVec3, count: usize, mut visit: impl FnMut(usize, Place)) {
        let stride = ((NODE_MM / step.length()) as usize).clamp(1, 8);
        let at = |i: usize| {
            let place = self.place(start + i as f64 * step);
            place.base.extend(place.intact)
        };
        let mut left = at(0);
        for first in (0..count).step_by(stride) {
            let right = at(first + stride);
            let slope = (right - left) / stride as f32;
            for i in first..(first + stride).min(count) {
                let here = left + (i - first) as f32 * slope;
                visit(i, Place { base: here.truncate(), intact: here.w });
            }
            left = right;
        }
    }

    /// Point of the new head that maps closest to a point of the base, to 2 mm.
    pub fn nearest_to(&self, base: DVec3) -> DVec3 {
        let guess = self.head_from_base.transform_point3(base);
        // The map is close to its affine part: the residual more than halves each time.
        (0..12).fold(guess, |point, _| {
            let left = base - self.place(point).base.as_dvec3();
            point + self.head_from_base.transform_vector3(left)
        })
    }

    /// Smallest determinant of the map's Jacobian relative to the affine part; if positive, the map
    /// does not fold.
    pub fn least_jacobian(&self) -> f64 {
        let [nx, ny, nz] = self.nodes.dims;
        let whole = self.base_from_head.matrix3.determinant();
        let edges = self.base_from_head.matrix3 * NODE_MM;
        let slices = (0..nz - 1).into_par_iter().map(|k| {
            let mut least = f64::MAX;
            for j in 0..ny - 1 {
                for i in 0..nx - 1 {
                    least = least.min(self.corners_of_cell([i, j, k], &edges));
                }
            }
            least
        });
        slices.reduce(|| f64::MAX, f64::min) / (whole * NODE_MM.powi(3))
    }

    /// Smallest determinant at the corners of a cell, a bound for its inside.
    fn corners_of_cell(&self, cell: [usize; 3], edges: &DMat3) -> f64 {
        let at = |bits: usize| {
            let node = [0, 1, 2].map(|axis| cell[axis] + (bits >> axis & 1));
            self.nodes.data[self.nodes.index(node)].truncate().as_dvec3()
        };
        let moved: [DVec3; 8] = std::array::from_fn(at);
        let edge = |corner: usize, axis: usize| {
            let (from, to) = (corner & !(1 << axis), corner | 1 << axis);
            edges.col(axis) + moved[to] - moved[from]
        };
        let determinant = |c: usize| DMat3::from_cols(edge(c, 0), edge(c, 1), edge(c, 2)).determinant();
        (0..8).map(determinant).fold(f64::MAX, f64::min)
    }

    fn node(&self, point: DVec3) -> Vec4 {
        between(&self.nodes, ((point - self.nodes.world_from_voxel.translation) / NODE_MM).as_vec3())
    }
}

/// Affine map from the base to the new head, about the brain's centre.
fn affine(recipe: &HeadRecipe, middle: DVec3) -> DAffine3 {
    let [xy, xz, yz] = recipe.shear;
    let shear = DMat3::from_cols(DVec3::X, DVec3::new(xy, 1.0, 0.0), DVec3::new(xz, yz, 1.0));
    let turn = DQuat::from_scaled_axis(DVec3::from_array(recipe.turn_degrees.map(f64::to_radians)));
    let matrix3 = DMat3::from_quat(turn) * shear * DMat3::from_diagonal(DVec3::from_array(recipe.scale));
    let translation = middle + DVec3::from_array(recipe.shift_mm) - matrix3 * middle;
    DAffine3 { matrix3, translation }
}
