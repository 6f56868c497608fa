//! CPU version of `drilled.wgsl`: where rays meet the bone that tools have left.

use super::bricks::{Bricks, Line};
use super::root::{blend, first_of_both, first_root};
use crate::bricks::LEAP;
use crate::drilled::FAR;
use crate::mix::{least, trilinear};
use glam::{IVec3, Vec3, Vec3A, Vec4};
use trepan_volume::CUT_STEPS;

/// Steepness with which a cut lowers the density that is shown, HU a node.
const RAMP_HU: f32 = 1000.0;

/// A surface at a hit.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Surface {
    /// Unit normal, outwards.
    pub normal: Vec3,
    /// Height over the surface at which shadow rays start, voxels.
    pub lift: f32,
}

impl Bricks {
    /// How deep a place lies in what was cut, nodes; [`FAR`] far from all cuts.
    #[inline(always)]
    pub fn depth(&self, g: Vec3) -> f32 {
        let brick = self.brick_in(g);
        let Some(depths) = self.leaps.drilled.brick(self.leaps.index(brick)) else { return FAR };
        let low = Vec3::from(brick.map(|b| (b * LEAP) as f32));
        let edge = self.leaps.drilled.edge;
        trilinear([edge; 3], (g - low) * self.grid.steps as f32, |at| f32::from(depths[at])) / CUT_STEPS
    }

    /// HU with what was cut, at continuous padded grid coordinates: under a ramp at the cut.
    #[inline(always)]
    pub fn shown_hu(&self, g: Vec3) -> f32 {
        let most = f32::from(self.grid.isovalue) - RAMP_HU * self.depth(g);
        self.hu(g).min(most.max(f32::from(trepan_volume::AIR_HU)))
    }

    /// Fraction of the segment between two local points of a cell at which bone begins that was not
    /// cut, or 2. The CT reaches the isovalue at the fraction `s`.
    pub fn enter_drilled(&self, cell: IVec3, corners: &[f32; 8], [a, b]: [Vec3A; 2], mut s: f32) -> f32 {
        let brick = cell.to_array().map(|c| c as usize / LEAP);
        let Some(depths) = self.leaps.drilled.brick(self.leaps.index(brick)) else { return s };
        let (steps, edge) = (self.grid.steps as f32, self.leaps.drilled.edge);
        // The segment on the lattice of the brick.
        let low = steps * (cell - (LEAP as i32) * IVec3::from(brick.map(|b| b as i32))).as_vec3a();
        let ray = Line::of((low + steps * a).into(), (steps * (b - a)).into());
        let last = low + steps - 1.0;
        for _ in 0..3 * self.grid.steps + 3 {
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

    /// The surface of the cut at a hit, where it bounds the bone and not the CT, which falls by
    /// `slope`, HU a voxel.
    #[inline(always)]
    pub fn bore(&self, g: Vec3, slope: f32) -> Option<Surface> {
        let depth = self.depth(g);
        if depth == FAR {
            return None;
        }
        let over = (self.hu(g) - f32::from(self.grid.isovalue)).abs();
        // A node is two steps.
        let node = 2.0 / self.grid.steps as f32;
        if depth.abs() * node * slope > over {
            return None;
        }
        let half = 0.5 * node;
        let along = |axis: Vec3| self.depth(g + half * axis) - self.depth(g - half * axis);
        let normal = Vec3::from(Vec3::AXES.map(along)).try_normalize()?;
        Some(Surface { normal, lift: 0.2 * node })
    }

    fn brick_in(&self, g: Vec3) -> [usize; 3] {
        let last = IVec3::from(self.grid.dims.map(|n| n as i32 - 2));
        g.as_ivec3().clamp(IVec3::ZERO, last).to_array().map(|c| c as usize / LEAP)
    }
}
