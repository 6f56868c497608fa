//! Twin of `bricks.wgsl`: rays through the padded grid of densities.

use crate::bricks::{BLOCK, Grid, LEAP, Leaps, densities};
use crate::recast::Recast;
use crate::skull::{Followed, NOTHING};
use glam::{IVec3, Vec3};
use std::ops::Range;
use std::sync::Arc;
use trepan_volume::BoneVolume;

const NUDGE: f32 = 1e-3;
const MOST_STEPS: u32 = 8192;

/// How rays go through the bone. The default is what every picture is drawn with; the rest is there to be measured against it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Casting {
    /// Whether rays leap over bricks without bone; without, they walk every cell.
    pub leap: bool,
    /// Samples this far apart, in voxels, instead of the exact root in every cell: thin walls are lost.
    pub step_voxel: Option<f32>,
}

impl Default for Casting {
    /// Leaps and exact roots.
    fn default() -> Self {
        Self { leap: true, step_voxel: None }
    }
}

/// The skull as rays see it.
#[derive(Debug)]
pub(crate) struct Bricks {
    bone: Option<Arc<BoneVolume>>,
    pub grid: Grid,
    leaps: Leaps,
    seen: Vec<u32>,
    /// HU of the padded grid, x fastest.
    density: Vec<i16>,
    /// Share of bone in blocks, 0 to 255.
    crowd: Vec<u8>,
    pub recast: Recast,
    pub casting: Casting,
}

impl Bricks {
    pub fn of(bone: Option<Arc<BoneVolume>>) -> Self {
        let grid = Grid::of(bone.as_deref());
        let seen = bone.as_ref().map_or_else(Vec::new, |bone| bone.seen());
        let leaps = Leaps::of(bone.as_deref(), &grid);
        let density = densities(bone.as_deref(), [0; 3], grid.dims, |hu| hu);
        let crowd = grid.shares(bone.as_deref());
        Self { bone, grid, leaps, seen, density, crowd, recast: Recast::default(), casting: Casting::default() }
    }

    /// Whether there is any bone to show.
    pub fn is_some(&self) -> bool {
        self.bone.is_some()
    }

    /// Takes up to `limit` changed bricks over.
    pub fn follow(&mut self, limit: usize) -> Followed {
        let Some(bone) = self.bone.clone() else { return Followed::default() };
        let mut changed = Vec::new();
        let left = bone.changed(&mut self.seen, limit, |brick| changed.push(brick));
        changed.iter().for_each(|&brick| self.refresh(&bone, brick));
        Followed { bricks: changed.len() as u32, left: left as u32 }
    }

    fn refresh(&mut self, bone: &BoneVolume, brick: [usize; 3]) {
        let (first, size) = self.grid.voxels_of(brick);
        let values = densities(Some(bone), first, size, |hu| hu);
        for (n, row) in values.chunks_exact(size[0]).enumerate() {
            let at = self.index([first[0], first[1] + n % size[1], first[2] + n / size[1]]);
            self.density[at..at + size[0]].copy_from_slice(row);
        }
        self.leaps.follow(bone, brick);
        let [bx, by, _] = self.grid.blocks();
        for block in self.grid.blocks_of(brick) {
            self.crowd[block[0] + bx * (block[1] + by * block[2])] = self.grid.share(bone, block);
        }
        let (low, high) = self.grid.corners_of(brick);
        self.recast.note(low, high);
    }

    fn index(&self, [x, y, z]: [usize; 3]) -> usize {
        x + self.grid.dims[0] * (y + self.grid.dims[1] * z)
    }

    /// Continuous padded grid coordinates of a world point.
    pub fn grid_of(&self, point: Vec3) -> Vec3 {
        (point - self.grid.origin) / self.grid.spacing_mm
    }

    /// HU at continuous padded grid coordinates, clamped at the border.
    pub fn hu(&self, g: Vec3) -> f32 {
        trilinear(self.grid.dims, g, |at| f32::from(self.density[at]))
    }

    /// Unit normal out of the bone at a surface point that a ray `along` has met.
    pub fn outward_normal(&self, g: Vec3, along: Vec3) -> Vec3 {
        let mut gradient = Vec3::ZERO;
        for i in 0..8 {
            let corner = Vec3::new((i & 1) as f32, (i >> 1 & 1) as f32, (i >> 2) as f32) * 2.0 - 1.0;
            gradient += corner * self.hu(g + 1.6 * corner);
        }
        if gradient.length_squared() < 1e-6 { -along } else { -gradient.normalize() }
    }

    /// Ambient light that reaches a surface point: little where bone crowds in front of it.
    pub fn openness(&self, g: Vec3, normal: Vec3) -> f32 {
        let dark: f32 = (0..4)
            .map(|i| {
                let reach = 2.5 * f32::exp2(i as f32) / self.grid.spacing_mm;
                let block = (g + normal * reach + 0.5) / BLOCK as f32 - 0.5;
                trilinear(self.grid.blocks(), block, |at| f32::from(self.crowd[at]) / 255.0)
            })
            .sum();
        (-1.1 * dark).exp()
    }

    /// Whether bone stands between a surface point and the light.
    pub fn shadowed(&self, g: Vec3, normal: Vec3, towards_light: Vec3) -> bool {
        self.meet(g + 0.8 * normal, towards_light / self.grid.spacing_mm) < NOTHING
    }

    /// Distance along the ray o + t·d (padded grid coordinates, t in mm) at which bone begins, or [`NOTHING`].
    fn meet(&self, o: Vec3, d: Vec3) -> f32 {
        self.trace(o, d).0
    }

    /// The same, with the number of bricks, cells and samples looked at.
    pub fn trace(&self, o: Vec3, d: Vec3) -> (f32, u32) {
        let safe = Vec3::select(d.abs().cmplt(Vec3::splat(1e-12)), Vec3::splat(1e-12), d);
        let inverse = safe.recip();
        let dims = Vec3::from(self.grid.dims.map(|n| n as f32));
        let (low, high) = (-o * inverse, (dims - 1.0 - o) * inverse);
        let mut t = low.min(high).max_element().max(0.0);
        let end = low.max(high).min_element();
        let positive = safe.cmpgt(Vec3::ZERO);
        let ahead = Vec3::select(positive, Vec3::ONE, Vec3::ZERO);
        let nudge = NUDGE * self.grid.spacing_mm;
        let last = IVec3::from(self.leaps.bricks.map(|n| n as i32 - 1));
        let mut steps = 0;
        while t < end && steps < MOST_STEPS {
            steps += 1;
            let brick = ((o + safe * (t + nudge)) / LEAP as f32).floor().as_ivec3().clamp(IVec3::ZERO, last);
            let known = self.leaps.free[self.leaps.index(brick.to_array().map(|v| v as usize))];
            let free = if self.casting.leap { known } else { 0 };
            let reach = f32::from(free.saturating_sub(1));
            let wall = brick.as_vec3() + Vec3::select(positive, Vec3::splat(reach + 1.0), Vec3::splat(-reach));
            let leave = ((LEAP as f32 * wall - o) * inverse).min_element().max(t + nudge);
            if free == 0 {
                let until = leave.min(end);
                let hit = match self.casting.step_voxel {
                    None => self.walk(o, safe, inverse, ahead, t, until, &mut steps),
                    Some(step) => self.sample(o, safe, t..until, step * self.grid.spacing_mm, &mut steps),
                };
                if hit < NOTHING {
                    return (hit, steps);
                }
            }
            t = leave;
        }
        (NOTHING, steps)
    }

    /// Samples a part of a ray every `step` mm, and takes the density as linear between two samples.
    fn sample(&self, o: Vec3, d: Vec3, part: Range<f32>, step: f32, steps: &mut u32) -> f32 {
        let isovalue = f32::from(self.grid.isovalue);
        let (mut t, mut last) = (part.start, None);
        while *steps < MOST_STEPS {
            *steps += 1;
            let over = self.hu(o + d * t) - isovalue;
            if over >= 0.0 {
                return last.map_or(t, |(from, under): (f32, f32)| from + (t - from) * under / (under - over));
            }
            if t >= part.end {
                break;
            }
            last = Some((t, over));
            t = (t + step.max(1e-3)).min(part.end);
        }
        NOTHING
    }

    /// Walks the cells of a ray from `t` to `leave`.
    fn walk(&self, o: Vec3, d: Vec3, inverse: Vec3, ahead: Vec3, mut t: f32, leave: f32, steps: &mut u32) -> f32 {
        let last = IVec3::from(self.grid.dims.map(|n| n as i32 - 2));
        let mut cell = (o + d * (t + NUDGE * self.grid.spacing_mm)).floor().as_ivec3().clamp(IVec3::ZERO, last);
        let step = (ahead * 2.0 - 1.0).as_ivec3();
        while t < leave && *steps < MOST_STEPS {
            *steps += 1;
            let crossing = (cell.as_vec3() + ahead - o) * inverse;
            let next = crossing.min_element().max(t);
            let corners = self.corners(cell);
            if corners.iter().any(|&v| v >= 0.0) {
                let s = enter(&corners, o + d * t - cell.as_vec3(), o + d * next - cell.as_vec3());
                if s <= 1.0 {
                    return t + s * (next - t);
                }
            }
            t = next;
            cell += IVec3::select(crossing.cmple(Vec3::splat(next)), step, IVec3::ZERO);
            if cell.cmplt(IVec3::ZERO).any() || cell.cmpgt(last).any() {
                break;
            }
        }
        NOTHING
    }

    /// The corners of a cell, x fastest, less the isovalue.
    fn corners(&self, cell: IVec3) -> [f32; 8] {
        let first = self.index(cell.to_array().map(|v| v as usize));
        let (row, layer) = (self.grid.dims[0], self.grid.dims[0] * self.grid.dims[1]);
        let starts = [first, first + row, first + layer, first + layer + row];
        let isovalue = f32::from(self.grid.isovalue);
        let mut corners = [0.0; 8];
        for (pair, start) in corners.chunks_exact_mut(2).zip(starts) {
            pair[0] = f32::from(self.density[start]) - isovalue;
            pair[1] = f32::from(self.density[start + 1]) - isovalue;
        }
        corners
    }
}

/// Trilinear interpolation between values at whole coordinates, clamped at the border.
pub(crate) fn trilinear(dims: [usize; 3], at: Vec3, value: impl Fn(usize) -> f32) -> f32 {
    let most = Vec3::from(dims.map(|n| n as f32 - 1.0));
    let at = at.clamp(Vec3::ZERO, most);
    let low = at.floor().min((most - 1.0).max(Vec3::ZERO));
    let u = at - low;
    let [x, y, z] = low.to_array().map(|v| v as usize);
    let first = x + dims[0] * (y + dims[1] * z);
    // A grid of one layer has no next one.
    let next = [
        usize::from(dims[0] > 1),
        if dims[1] > 1 { dims[0] } else { 0 },
        if dims[2] > 1 { dims[0] * dims[1] } else { 0 },
    ];
    let line = |start: usize| {
        let (a, b) = (value(start), value(start + next[0]));
        a + u.x * (b - a)
    };
    let plane = |start: usize| {
        let (a, b) = (line(start), line(start + next[1]));
        a + u.y * (b - a)
    };
    let (a, b) = (plane(first), plane(first + next[2]));
    a + u.z * (b - a)
}

/// Trilinear interpolation of a cell's corners.
fn blend(corners: &[f32; 8], u: Vec3) -> f32 {
    let mix = |a: f32, b: f32, s: f32| a + s * (b - a);
    let plane = [0, 1, 2, 3].map(|n| mix(corners[n], corners[n + 4], u.z));
    mix(mix(plane[0], plane[2], u.y), mix(plane[1], plane[3], u.y), u.x)
}

/// Share of the way between two local points of a cell where bone begins, or 2.
fn enter(corners: &[f32; 8], a: Vec3, b: Vec3) -> f32 {
    let third = (b - a) / 3.0;
    first_root([a, a + third, b - third, b].map(|u| blend(corners, u)))
}

/// First root of the cubic with values `v` at 0, 1/3, 2/3, 1 that rises from below zero, or 2.
pub(crate) fn first_root(v: [f32; 4]) -> f32 {
    if v[0] >= 0.0 {
        return 0.0;
    }
    let c1 = 0.5 * (-11.0 * v[0] + 18.0 * v[1] - 9.0 * v[2] + 2.0 * v[3]);
    let c2 = 4.5 * (2.0 * v[0] - 5.0 * v[1] + 4.0 * v[2] - v[3]);
    let c3 = 4.5 * (-v[0] + 3.0 * v[1] - 3.0 * v[2] + v[3]);
    let cubic = |s: f32| v[0] + s * (c1 + s * (c2 + s * c3));
    let roots = (c2 * c2 - 3.0 * c1 * c3).max(0.0).sqrt();
    let q = -(c2 + if c2 >= 0.0 { roots } else { -roots });
    let e1 = if c3.abs() > 1e-20 { q / (3.0 * c3) } else { 2.0 };
    let e2 = if q.abs() > 1e-20 { c1 / q } else { 2.0 };
    let mut start = 0.0;
    while start < 1.0 {
        let mut to = 1.0f32;
        for extremum in [e1, e2] {
            if extremum > start && extremum < to {
                to = extremum;
            }
        }
        if cubic(to) >= 0.0 {
            let (mut low, mut high) = (start, to);
            for _ in 0..12 {
                let s = 0.5 * (low + high);
                if cubic(s) < 0.0 { low = s } else { high = s }
            }
            return high;
        }
        start = to;
    }
    2.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_first_root_is_the_first_of_a_fine_scan(v in prop::array::uniform4(-1000.0f32..1000.0)) {
            let values = v.map(f64::from);
            let lagrange = |s: f64| {
                let at = [0.0, 1.0 / 3.0, 2.0 / 3.0, 1.0];
                (0..4).map(|i| (0..4).filter(|&j| j != i).map(|j| (s - at[j]) / (at[i] - at[j])).product::<f64>() * values[i]).sum::<f64>()
            };
            let scan = (0..=4000).map(|n| f64::from(n) / 4000.0).find(|&s| lagrange(s) >= 0.0);
            let root = f64::from(first_root(v));
            match scan {
                Some(s) => prop_assert!(root <= s + 3e-4 && (root > s - 6e-4 || lagrange(root) > -0.5), "{root} for {s}"),
                // A scan may miss a peak between its points, never more than a sliver of one.
                None => prop_assert!(root == 2.0 || lagrange(root).abs() < 0.5, "{root}"),
            }
        }
    }
}
