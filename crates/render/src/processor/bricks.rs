//! CPU version of `bricks.wgsl`: rays through the padded density grid.

use super::drilled::{Surface, lift, shown_hu};
use super::line::Line;
use super::root::enter;
use crate::bricks::{BLOCK, Followed, Grid, NOTHING, SkipDistances, densities};
use crate::cut::height;
use crate::drilled::LEAP;
use crate::mix::{between, greater, greatest, least, lesser, mixed, trilinear};
use crate::scene::Scene;
use crate::smooth::{Smooth, towards_eye};

use glam::{BVec3A, IVec3, Vec3, Vec3A, Vec4};
use std::array;
use std::ops::Range;
use std::sync::Arc;
use trepan_bone::BoneVolume;

const NUDGE: f32 = 1e-3;
const MOST_STEPS: u32 = 8192;
/// Step below which a beam counts as near bone, voxels.
const LEAST_LEAP: f32 = 0.5;

/// How rays are cast through bone. The default is used for every picture; the alternatives are for
/// comparison measurements.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Casting {
    /// Whether rays skip bricks without bone; otherwise they visit every cell.
    pub leap: bool,
    /// Sampling distance in voxels instead of exact roots in every cell; misses thin walls.
    pub step_voxel: Option<f32>,
    /// Whether to cast every second ray along both axes, and the others only where bone is not
    /// smooth. Twice as fast, for a moving camera.
    pub sparse: bool,
}

impl Default for Casting {
    /// Empty-space skipping, exact roots, and a ray for every pixel.
    fn default() -> Self {
        Self { leap: true, step_voxel: None, sparse: false }
    }
}

/// The skull's data for ray casting.
#[derive(Debug)]
pub(crate) struct Bricks {
    bone: Option<Arc<BoneVolume>>,
    pub grid: Grid,
    pub leaps: SkipDistances,
    seen: Vec<u32>,
    /// HU of the padded grid as scanned, x fastest.
    density: Vec<i16>,
    smooth: Smooth,
    /// Bone fraction of blocks, 0 to 255.
    crowd: Vec<u8>,
    pub casting: Casting,
}

impl Bricks {
    pub fn of(bone: Option<Arc<BoneVolume>>) -> Self {
        let grid = Grid::of(bone.as_deref());
        let seen = bone.as_ref().map_or_else(Vec::new, |bone| bone.seen());
        let leaps = SkipDistances::of(bone.as_deref(), &grid);
        let density = densities(bone.as_deref(), [0; 3], grid.dims, |hu| hu);
        let (smooth, crowd) = (Smooth::of(bone.as_deref(), &grid), grid.shares(bone.as_deref()));
        Self { bone, grid, leaps, seen, density, smooth, crowd, casting: Casting::default() }
    }

    /// Whether there is any bone to show.
    pub fn is_some(&self) -> bool {
        self.bone.is_some()
    }

    /// Copies up to `limit` changed bricks.
    pub fn follow(&mut self, limit: usize) -> Followed {
        let Some(bone) = self.bone.clone() else { return Followed::default() };
        let mut changed = Vec::new();
        let left = bone.changed(&mut self.seen, limit, |brick| changed.push(brick));
        changed.iter().for_each(|&brick| self.refresh(&bone, brick));
        self.smooth.follow(&bone, &changed);
        self.leaps.follow(&bone, &changed);
        self.leaps.settle();
        Followed::of(&self.grid, &changed, left)
    }

    /// Whether there are changes to follow.
    pub fn is_stale(&mut self) -> bool {
        self.bone.as_ref().is_some_and(|bone| bone.changed(&mut self.seen, 0, |_| ()) > 0)
    }

    fn refresh(&mut self, bone: &BoneVolume, brick: [usize; 3]) {
        let (first, size) = self.grid.voxels_of(brick);
        let values = densities(Some(bone), first, size, |hu| hu);
        for (n, row) in values.chunks_exact(size[0]).enumerate() {
            let at = self.index([first[0], first[1] + n % size[1], first[2] + n / size[1]]);
            self.density[at..at + size[0]].copy_from_slice(row);
        }
        let [bx, by, _] = self.grid.blocks();
        for block in self.grid.blocks_of(brick) {
            self.crowd[block[0] + bx * (block[1] + by * block[2])] = self.grid.share(bone, block);
        }
    }

    fn index(&self, [x, y, z]: [usize; 3]) -> usize {
        x + self.grid.dims[0] * (y + self.grid.dims[1] * z)
    }

    /// Continuous padded grid coordinates of a world point.
    #[inline(always)]
    pub fn grid_of(&self, point: Vec3) -> Vec3 {
        (point - self.grid.origin) / self.grid.spacing_mm
    }

    /// World point of continuous padded grid coordinates.
    fn world_of(&self, g: Vec3) -> Vec3 {
        self.grid.origin + self.grid.spacing_mm * g
    }

    /// HU of the CT at continuous padded grid coordinates, clamped at the border.
    #[inline(always)]
    pub fn hu(&self, g: Vec3) -> f32 {
        trilinear(self.grid.dims, g, |at| f32::from(self.density[at]))
    }

    /// HU with what was cut, at continuous padded grid coordinates.
    pub fn shown_hu(&self, g: Vec3) -> f32 {
        shown_hu(&self.grid, self.hu(g), self.leaps.depth(&self.grid, g))
    }

    /// The surface at a point hit by a ray `along`: that of the CT or of the cut.
    #[inline(always)]
    pub fn surface(&self, g: Vec3, along: Vec3) -> Surface {
        let Smooth { dims, values, step, .. } = &self.smooth;
        let strides = [1, dims[0], dims[0] * dims[1]];
        let (reach, share) = (self.smooth.reach(&self.grid), 1.0 / *step as f32);
        // Eight points, but only two indices along each axis.
        let pairs: [[(usize, f32); 2]; 3] =
            array::from_fn(|n| [-reach, reach].map(|by| between(share * (g[n] + by), dims[n], strides[n])));
        let mut gradient = Vec3::ZERO;
        for i in 0..8 {
            let place = [pairs[0][i & 1], pairs[1][i >> 1 & 1], pairs[2][i >> 2]];
            let corner = Vec3::new((i & 1) as f32, (i >> 1 & 1) as f32, (i >> 2) as f32) * 2.0 - 1.0;
            gradient += corner * mixed(place, strides, |at| f32::from(values[at]));
        }
        // Eight differences over the cube, two of which go by each edge.
        let over = self.hu(g) - f32::from(self.grid.isovalue);
        if let Some(bore) = self.leaps.bore(&self.grid, g, over, gradient.length() / (8.0 * reach)) {
            return bore;
        }
        let flat = gradient.length_squared() < 1e-6;
        let normal = if flat { -along } else { towards_eye(-gradient.normalize(), along) };
        Surface { normal, lift: lift(&self.grid) }
    }

    /// Index offsets to the next value along each axis.
    #[inline(always)]
    fn strides(&self) -> [usize; 3] {
        let [x, y, _] = self.grid.dims;
        [1, x, x * y]
    }

    /// Fraction of ambient light at a surface point: small where bone in front of it is dense.
    #[inline(always)]
    pub fn openness(&self, g: Vec3, normal: Vec3, bone_cut: Vec4) -> f32 {
        let there = (0..4).map(|i| g + normal * (2.5 * f32::exp2(i as f32) / self.grid.spacing_mm));
        let crowd = |there: Vec3| {
            let block = (there + 0.5) / BLOCK as f32 - 0.5;
            trilinear(self.grid.blocks(), block, |at| f32::from(self.crowd[at]) / 255.0)
        };
        let dark: f32 = there.filter(|&g| height(bone_cut, self.world_of(g)) <= 0.0).map(crowd).sum();
        (-1.1 * dark).exp()
    }

    /// Whether bone is between a surface point and the light.
    #[inline(always)]
    pub fn shadowed(&self, g: Vec3, surface: Surface, scene: &Scene) -> bool {
        let (from, light) = (g + surface.lift * surface.normal, scene.light.truncate());
        let [near, far] = under(scene.bone_cut, self.world_of(from), light);
        self.trace(from, light / self.grid.spacing_mm, near, far).0 < NOTHING
    }

    /// Distance to which the beam o + t·d' is free of bone, for all d' within `spread` of d;
    /// [`NOTHING`] if it never hits.
    ///
    /// From a brick the beam advances to where its edges, o + t·(d ± spread), leave the free cube
    /// around the brick; the outside of the grid is free too.
    pub fn clear(&self, o: Vec3, d: Vec3, spread: f32) -> f32 {
        if !self.casting.leap {
            return 0.0;
        }
        let (o, d) = (Vec3A::from(o), Vec3A::from(d));
        let count = Vec3A::from(self.leaps.bricks.map(|n| n as f32));
        let last = IVec3::from(self.leaps.bricks.map(|n| n as i32 - 1));
        let (up, down) = (d + spread, d - spread);
        // Intersections of the edges with planes; the beam crosses no plane behind it.
        let reach = |at: Vec3A, edge: Vec3A, passes: BVec3A| {
            Vec3A::select(passes, (LEAP as f32 * at - o) / edge, Vec3A::splat(NOTHING))
        };
        let end = reach(count, down, down.cmpgt(Vec3A::ZERO)).min(reach(Vec3A::ZERO, up, up.cmplt(Vec3A::ZERO)));
        let (end, mut t) = (end.min_element(), 0.0);
        for _ in 0..MOST_STEPS {
            let brick = cell_in((o + d * t) * (1.0 / LEAP as f32), last);
            // Edge rays may leave the octant of the centre ray, so the all-direction distance
            // applies.
            let free = self.leaps.free(self.leaps.index(brick.to_array().map(|v| v as usize)));
            let (low, high) = (brick.as_vec3a() + 1.0 - f32::from(free), brick.as_vec3a() + f32::from(free));
            let over = reach(high, up, up.cmpgt(Vec3A::ZERO) & high.cmplt(count));
            let under = reach(low, down, down.cmplt(Vec3A::ZERO) & low.cmpgt(Vec3A::ZERO));
            let leave = over.min(under).min_element();
            if free == 0 || leave < t + LEAST_LEAP * self.grid.spacing_mm {
                return t;
            }
            if leave >= end {
                return NOTHING;
            }
            t = leave * (1.0 - 1e-5);
        }
        t
    }

    /// Distance along the ray o + t·d at which bone begins, or [`NOTHING`], and the number of
    /// bricks, cells and samples visited.
    /// The ray is in padded grid coordinates, t in mm. Bone is searched between `from` and `until`
    /// only.
    #[inline(always)]
    pub fn trace(&self, o: Vec3, d: Vec3, from: f32, until: f32) -> (f32, u32) {
        let ray = Line::of(o, d);
        let dims = Vec3A::from(self.grid.dims.map(|n| n as f32));
        let (low, high) = (-ray.o * ray.inverse, (dims - 1.0 - ray.o) * ray.inverse);
        let mut t = greater(greatest(low.min(high)), from);
        let end = lesser(least(low.max(high)), until);
        let nudge = NUDGE * self.grid.spacing_mm;
        let last = IVec3::from(self.leaps.bricks.map(|n| n as i32 - 1));
        let mut steps = 0;
        while t < end && steps < MOST_STEPS {
            steps += 1;
            let brick = cell_in(ray.at(t + nudge) * (1.0 / LEAP as f32), last);
            let at = self.leaps.index(brick.to_array().map(|v| v as usize));
            let (free, cells) = if self.casting.leap {
                (self.leaps.octants[at][ray.octant], self.leaps.cells[at])
            } else {
                (0, u64::MAX)
            };
            let reach = f32::from(free.saturating_sub(1));
            // The brick's upper wall where the ray ascends, plus `reach` bricks in its direction.
            let wall = brick.as_vec3a() + ray.ahead + reach * ray.side;
            let leave = greater(least((LEAP as f32 * wall - ray.o) * ray.inverse), t + nudge);
            if free == 0 {
                let until = lesser(leave, end);
                let hit = match self.casting.step_voxel {
                    None => self.walk(&ray, t, until, brick * LEAP as i32, cells, &mut steps),
                    Some(step) => self.sample(o, d, t..until, step * self.grid.spacing_mm, &mut steps),
                };
                if hit < NOTHING {
                    return (if hit <= end { hit } else { NOTHING }, steps);
                }
            }
            t = leave;
        }
        (NOTHING, steps)
    }

    /// Samples part of a ray every `step` mm, with linear density between two samples.
    fn sample(&self, o: Vec3, d: Vec3, part: Range<f32>, step: f32, steps: &mut u32) -> f32 {
        let isovalue = f32::from(self.grid.isovalue);
        let (mut t, mut last) = (part.start, None);
        while *steps < MOST_STEPS {
            *steps += 1;
            let over = self.shown_hu(o + d * t) - isovalue;
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

    /// Visits the occupied cells of a ray from `t` to `leave` in one brick (Amanatides and Woo
    /// 1987). `first` is the brick's first cell, `cells` its occupancy bits.
    #[inline(always)]
    fn walk(&self, ray: &Line, mut t: f32, leave: f32, first: IVec3, cells: u64, steps: &mut u32) -> f32 {
        let last = IVec3::from(self.grid.dims.map(|n| n as i32 - 2));
        let mut cell = cell_in(ray.at(t + NUDGE * self.grid.spacing_mm), last);
        let mut crossing = (cell.as_vec3a() + ray.ahead - ray.o) * ray.inverse;
        let across = ray.inverse.abs();
        while t < leave && *steps < MOST_STEPS {
            *steps += 1;
            let next = greater(least(crossing), t);
            let local = cell - first;
            // A cell outside the brick, by rounding, is tested directly.
            let beside = (local.x | local.y | local.z) as u32 >= LEAP as u32;
            let bit = (local.x + LEAP as i32 * (local.y + LEAP as i32 * local.z)) as u32;
            let may = beside || cells >> (bit & 63) & 1 == 1;
            if may && let Some(corners) = self.corners(cell) {
                let low = cell.as_vec3a();
                let [a, b] = [ray.at(t) - low, ray.at(next) - low];
                let mut s = enter(&corners, a, b);
                if s <= 1.0 {
                    s = self.leaps.enter_drilled(cell, &corners, [a, b], s);
                }
                if s <= 1.0 {
                    return t + s * (next - t);
                }
            }
            let passed = crossing.cmple(Vec3A::splat(next));
            crossing += Vec3A::select(passed, across, Vec3A::ZERO);
            let on = passed.bitmask() as i32;
            cell += ray.step * IVec3::new(on & 1, on >> 1 & 1, on >> 2);
            if cell.cmplt(IVec3::ZERO).any() || cell.cmpgt(last).any() {
                break;
            }
            t = next;
        }
        NOTHING
    }

    /// The corners of a cell, x fastest, less the isovalue; `None` if none is bone.
    #[inline(always)]
    fn corners(&self, cell: IVec3) -> Option<[f32; 8]> {
        let [_, row, layer] = self.strides();
        let first = self.index(cell.to_array().map(|v| v as usize));
        let pair = |at: usize| [self.density[at], self.density[at + 1]];
        let [[a, b], [c, d]] = [pair(first), pair(first + row)];
        let [[e, f], [g, h]] = [pair(first + layer), pair(first + layer + row)];
        let values = [a, b, c, d, e, f, g, h];
        let most = a.max(b).max(c.max(d)).max(e.max(f).max(g.max(h)));
        let isovalue = f32::from(self.grid.isovalue);
        (most >= self.grid.isovalue).then(|| values.map(|v| f32::from(v) - isovalue))
    }
}

/// The part of a ray on the kept side of a plane, mm: its start and its end.
#[inline(always)]
pub(crate) fn under(cut: Vec4, point: Vec3, along: Vec3) -> [f32; 2] {
    let (over, rising) = (height(cut, point), cut.truncate().dot(along));
    let meets = -over / rising;
    match rising {
        r if r < 0.0 => [greater(meets, 0.0), NOTHING],
        r if r > 0.0 => [0.0, meets],
        _ => [0.0, if over > 0.0 { 0.0 } else { NOTHING }],
    }
}

/// Integer parts, clamped to a box from 0; negative values become 0, so that truncation equals
/// rounding down.
#[inline(always)]
fn cell_in(at: Vec3A, last: IVec3) -> IVec3 {
    at.as_ivec3().clamp(IVec3::ZERO, last)
}
