//! CPU version of `drilled.wgsl`: where rays meet the bone that tools have left.

use super::line::Line;
use super::root::{blend, first_of_both, first_root};
use crate::bricks::{Grid, SkipDistances};
use crate::drilled::{FAR, LEAP};
use crate::mix::{least, trilinear};
use glam::{IVec3, Vec3, Vec3A, Vec4};
use trepan_bone::CUT_STEPS;
use trepan_volume::AIR_HU;

/// Steepness with which a cut lowers the density that is shown, HU a node.
const RAMP_HU: f32 = 1000.0;

/// A numerical parameter: height over the CT's surface at which shadow rays start, mm and voxels,
/// whichever is more. Over the steps that thick slices leave.
const LIFT: f32 = 0.8;

/// Height over the CT's surface at which shadow rays start, voxels.
pub(crate) fn lift(grid: &Grid) -> f32 {
    LIFT * (1.0 / grid.spacing_mm).max(1.0)
}

/// A surface at a hit.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Surface {
    /// Unit normal, outwards.
    pub normal: Vec3,
    /// Height over the surface at which shadow rays start, voxels.
    pub lift: f32,
}

/// A density with what was cut at a depth, HU: under a ramp at the cut.
pub(crate) fn shown_hu(grid: &Grid, hu: f32, depth: f32) -> f32 {
    hu.min((f32::from(grid.isovalue) - RAMP_HU * depth).max(f32::from(AIR_HU)))
}

impl SkipDistances {
    /// How deep a place lies in what was cut, nodes; [`FAR`] far from all cuts.
    #[inline(always)]
    pub fn depth(&self, grid: &Grid, g: Vec3) -> f32 {
        let last = IVec3::from(grid.dims.map(|n| n as i32 - 2));
        let brick = g.as_ivec3().clamp(IVec3::ZERO, last).to_array().map(|c| c as usize / LEAP);
        let Some(depths) = self.drilled.brick(self.index(brick)) else { return FAR };
        let low = Vec3::from(brick.map(|b| (b * LEAP) as f32));
        let edge = self.drilled.edge;
        trilinear([edge; 3], (g - low) * grid.steps as f32, |at| f32::from(depths[at])) / CUT_STEPS
    }

    /// Fraction of the segment between two local points of a cell at which bone begins that was not
    /// cut, or 2. The CT reaches the isovalue at the fraction `s`.
    pub fn enter_drilled(&self, cell: IVec3, corners: &[f32; 8], [a, b]: [Vec3A; 2], mut s: f32) -> f32 {
        let brick = cell.to_array().map(|c| c as usize / LEAP);
        let Some(depths) = self.drilled.brick(self.index(brick)) else { return s };
        let edge = self.drilled.edge;
        let count = (edge - 1) / LEAP;
        let steps = count as f32;
        // The segment on the lattice of the brick.
        let low = steps * (cell - (LEAP as i32) * IVec3::from(brick.map(|b| b as i32))).as_vec3a();
        let ray = Line::of((low + steps * a).into(), (steps * (b - a)).into());
        let last = low + steps - 1.0;
        for _ in 0..3 * count + 3 {
            let step = ray.at(s + 1e-4).floor().clamp(low, last);
            let first = step.x as usize + edge * (step.y as usize + edge * step.z as usize);
            let pair = |at: usize| [depths[at], depths[at + 1]];
            let [[c0, c1], [c2, c3]] = [pair(first), pair(first + edge)];
            let [[c4, c5], [c6, c7]] = [pair(first + edge * edge), pair(first + edge * edge + edge)];
            let left = [c0, c1, c2, c3, c4, c5, c6, c7].map(|depth| -f32::from(depth));
            let next = least((step + ray.ahead - ray.o) * ray.inverse).clamp(s, 1.0);
            if left.iter().any(|&left| left > 0.0) {
                let part = s + (next - s) * Vec4::new(0.0, 1.0 / 3.0, 2.0 / 3.0, 1.0);
                let ct = blend(corners, [0, 1, 2].map(|n| a[n] + part * (b[n] - a[n]))).to_array();
                let left = blend(&left, [0, 1, 2].map(|n| ray.o[n] + part * ray.d[n] - step[n])).to_array();
                // Where the CT was entered it may be a little under the isovalue, by rounding.
                let root = if ct.iter().all(|&over| over >= 0.0) {
                    first_root(left)
                } else {
                    first_of_both(ct.map(|over| over + 0.01), left)
                };
                if root <= 1.0 {
                    return s + root * (next - s);
                }
            }
            if next >= 1.0 {
                break;
            }
            s = next;
        }
        2.0
    }

    /// The surface of the cut at a hit, where it and not the CT bounds the bone. The CT is `over`
    /// the isovalue, HU, and falls by `slope`, HU a voxel.
    #[inline(always)]
    pub fn bore(&self, grid: &Grid, g: Vec3, over: f32, slope: f32) -> Option<Surface> {
        let depth = self.depth(grid, g);
        if depth == FAR {
            return None;
        }
        // A node is two steps.
        let node = 2.0 / grid.steps as f32;
        if depth.abs() * node * slope > over.abs() {
            return None;
        }
        let half = 0.5 * node;
        let along = |axis: Vec3| self.depth(grid, g + half * axis) - self.depth(grid, g - half * axis);
        let normal = Vec3::from(Vec3::AXES.map(along)).try_normalize()?;
        Some(Surface { normal, lift: 0.2 * node })
    }
}
