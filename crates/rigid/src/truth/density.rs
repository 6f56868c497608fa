//! Bone before it is cut: closed forms, and a CT between its voxels.
//!
//! # Theory
//! Between its voxels a CT is the cubic B-spline through them: value, gradient and curvature are
//! continuous. Its coefficients come from a tridiagonal system, with nothing of the code that
//! resamples a CT for a session.

use glam::{DAffine3, DVec3};
use trepan_volume::VoxelVolume;

/// Where bone is, and how dense.
pub trait Density: Send + Sync {
    /// Density at a place, HU.
    fn hu(&self, place: DVec3) -> f64;
    /// How far a place is over the border of bone, in any unit; continuous, negative outside.
    fn within(&self, place: DVec3) -> f64;
    /// Most that [`within`](Self::within) changes in a mm.
    fn steepest(&self) -> f64;
}

/// A solid of a signed distance.
pub struct ClosedForm<D, H> {
    /// Distance to the surface, mm, negative in bone; it changes by at most 1 in a mm.
    pub distance: D,
    /// Density at a distance, HU.
    pub hu: H,
}

impl<D: Fn(DVec3) -> f64 + Send + Sync, H: Fn(f64) -> f64 + Send + Sync> Density for ClosedForm<D, H> {
    fn hu(&self, place: DVec3) -> f64 {
        (self.hu)((self.distance)(place))
    }

    fn within(&self, place: DVec3) -> f64 {
        -(self.distance)(place)
    }

    fn steepest(&self) -> f64 {
        1.0
    }
}

/// A block of a CT, a cubic B-spline through its voxels, on its own grid, in f64. Beyond the block
/// goes on what its outermost voxels hold.
pub struct Scan {
    dims: [usize; 3],
    coefficients: Vec<f64>,
    from_world: DAffine3,
    isovalue: f64,
    steepest: f64,
}

/// Voxels around the block that the spline's coefficients depend on.
const MARGIN: f64 = 12.0;

impl Scan {
    /// The voxels within `reach_mm` of a place, along each axis of the grid.
    pub fn around(ct: &VoxelVolume<i16>, isovalue: i16, place: DVec3, reach_mm: f64) -> Self {
        let from_world = ct.world_from_voxel.inverse();
        let middle = from_world.transform_point3(place);
        let last = DVec3::from(ct.dims.map(|n| n as f64 - 1.0));
        let reach = reach_mm / ct.spacing_mm() + MARGIN;
        let [low, high] =
            [(middle - reach).floor(), (middle + reach).ceil()].map(|at| at.clamp(DVec3::ZERO, last).as_usizevec3());
        let dims = (high - low + 1).to_array();
        let voxel = |at: usize| {
            let [i, j, k] = [at % dims[0], at / dims[0] % dims[1], at / (dims[0] * dims[1])];
            f64::from(ct.data[ct.index([low.x + i, low.y + j, low.z + k])])
        };
        let mut coefficients: Vec<f64> = (0..dims.iter().product()).map(voxel).collect();
        let steps = [1, dims[0], dims[0] * dims[1]];
        for axis in 0..3 {
            for start in (0..coefficients.len()).filter(|at| at / steps[axis] % dims[axis] == 0) {
                solve(&mut coefficients, start, steps[axis], dims[axis]);
            }
        }
        // The slope of a spline is a mean of the differences of its coefficients.
        let most = |axis: usize| {
            let inner = |at: &usize| at / steps[axis] % dims[axis] + 1 < dims[axis];
            let apart = (0..coefficients.len()).filter(inner);
            apart.map(|at| (coefficients[at + steps[axis]] - coefficients[at]).abs()).fold(0.0, f64::max)
                / ct.spacing_mm()[axis]
        };
        let steepest = DVec3::new(most(0), most(1), most(2)).length().max(1.0);
        let from_world = DAffine3::from_translation(-low.as_dvec3()) * from_world;
        Self { dims, coefficients, from_world, isovalue: isovalue.into(), steepest }
    }
}

/// Solves for the coefficients along one line, mirrored at both ends (Thomas's algorithm).
///
/// The value of a voxel is `(c₋₁ + 4 c₀ + c₊₁) / 6`.
fn solve(values: &mut [f64], start: usize, step: usize, count: usize) {
    if count < 2 {
        return;
    }
    let mut upper = vec![0.0; count];
    for n in 0..count {
        let at = start + n * step;
        let below = if n == 0 {
            0.0
        } else if n + 1 == count {
            2.0
        } else {
            1.0
        };
        let above = if n == 0 { 2.0 } else { 1.0 };
        let (before, value) = if n == 0 { (0.0, 0.0) } else { (upper[n - 1], values[at - step]) };
        let pivot = 4.0 - below * before;
        upper[n] = above / pivot;
        values[at] = (6.0 * values[at] - below * value) / pivot;
    }
    for n in (0..count - 1).rev() {
        values[start + n * step] -= upper[n] * values[start + (n + 1) * step];
    }
}

impl Density for Scan {
    fn hu(&self, place: DVec3) -> f64 {
        let last = DVec3::from(self.dims.map(|n| n as f64 - 1.0));
        let at = self.from_world.transform_point3(place).clamp(DVec3::ZERO, last);
        let low = at.min((last - 1.0).max(DVec3::ZERO)).floor();
        let part = at - low;
        let steps = [1, self.dims[0], self.dims[0] * self.dims[1]];
        let taps = |axis: usize| {
            let (last, first) = (self.dims[axis] as i64 - 1, low[axis] as i64 - 1);
            let (t, s) = (part[axis], 1.0 - part[axis]);
            let weights = [
                s.powi(3),
                3.0 * t.powi(3) - 6.0 * t.powi(2) + 4.0,
                3.0 * s.powi(3) - 6.0 * s.powi(2) + 4.0,
                t.powi(3),
            ];
            core::array::from_fn::<_, 4, _>(|n| {
                let at = (first + n as i64).abs();
                ((if at > last { (2 * last - at).max(0) } else { at }) as usize * steps[axis], weights[n] / 6.0)
            })
        };
        let [x, y, z] = [taps(0), taps(1), taps(2)];
        let line = |row: usize| x.iter().map(|(at, weight)| weight * self.coefficients[row + at]).sum::<f64>();
        let plane = |slice: usize| y.iter().map(|(at, weight)| weight * line(slice + at)).sum::<f64>();
        z.iter().map(|(at, weight)| weight * plane(*at)).sum()
    }

    fn within(&self, place: DVec3) -> f64 {
        self.hu(place) - self.isovalue
    }

    fn steepest(&self) -> f64 {
        self.steepest
    }
}
