//! The bone's surface near a point as a set of small discs.
//!
//! # Theory
//! Where a grid edge joins a cell of bone to one that is not, a field ends the bone at `x`: the
//! density, linear along the edge, falls under the isovalue, or the cut, a cubic along the edge,
//! rises over its surface. There stands a disc, bent like the surface (`disc.rs`). All of it is
//! continuous, so that nothing jumps at borders of cells. Flat and convex discs are safe: a
//! half-space that just leaves one out keeps the ball out of it. Over a hollow one the ball may
//! sink while it moves, by half the curvature times the square of the move, and is lifted again.
//!
//! ```text
//!   ·    ·    ·    ·      · air, • bone
//!   ── ── ─── ──  ──      discs on the edges that cross
//!   •    •    •    •
//! ```
//!
//! A disc ends where the other field ends the bone, so that none stands out over the rim of a hole.
//! Edges that a cut only grazes have none: there is a steeper edge nearby. A wall one voxel thick
//! still has its crossings, which a smoothed isosurface would lose.
//!
//! # Practice
//! Lengths are cells, in a frame shifted to a whole cell near the tool ([`Discs::base`]). Bone is
//! found 8 cells at once; a disc costs 30 ns on the cut, 300 ns on voxels. One that was there
//! before keeps its normal; while bone goes away, for a few ticks. The capacity is fixed; what does
//! not fit is counted.

use crate::cut_discs::{EDGES, Way, ends, shapes};
use crate::disc::{Disc, to_edge};
use crate::rows::{GridBall, rows};
use crate::shaft::Shaft;
use crate::solid::{Field, Fine, Solid, crossing, is_grazed};
use glam::IVec3;
use trepan_bone::BoneVolume;
use trepan_geometry::Vec3;

/// While bone goes away normals are found anew in turns of so many ticks; in so few a burr takes
/// some hundredths of a voxel.
const TURNS: u32 = 4;
/// Discs of before that are kept; a power of two.
const CACHE: usize = 4096;

/// The ways from a voxel to those that share a face with it.
pub const NEIGHBOURS: [IVec3; 6] = [IVec3::X, IVec3::NEG_X, IVec3::Y, IVec3::NEG_Y, IVec3::Z, IVec3::NEG_Z];

/// The discs near a point, gathered anew for each place of the tool.
#[derive(Default)]
pub(crate) struct Discs {
    /// Voxel at the origin of the discs' frame.
    pub base: IVec3,
    /// Voxels looked at by the last gathering.
    pub visited: u32,
    /// Bone voxels that own a disc.
    pub voxels: u32,
    /// Discs that did not fit.
    pub overflow: u32,
    list: Vec<Disc>,
    /// The edge on which each disc stands.
    edges: Vec<Edge>,
    kept: DiscCache,
    /// Bone in the rows around the tool, a bit a cell.
    bones: Vec<u128>,
    /// Where discs were gathered, from [`Discs::base`], and how far from there they may be.
    around: (Vec3, f32),
    limit: usize,
}

/// A grid edge out of the bone.
#[derive(Clone, Copy, Debug, Default)]
struct Edge {
    /// The bone voxel, from [`Discs::base`].
    voxel: IVec3,
    /// Which of its neighbours.
    to: u8,
    /// What bounds the bone there.
    field: Field,
    /// Whether the disc has its normal yet.
    shaped: bool,
}

impl Edge {
    fn step(&self) -> IVec3 {
        NEIGHBOURS[usize::from(self.to)]
    }

    /// Cells from one crossing to the next.
    fn stride(&self, solid: &impl Solid, base: IVec3) -> i32 {
        solid.stride(base + self.voxel, self.step())
    }

    fn way(&self, base: IVec3) -> Way {
        Way { from: base + self.voxel, step: self.step() }
    }
}

/// A disc of before.
#[derive(Clone, Copy, Debug, Default)]
struct Before {
    /// Which edge; 0 for none.
    key: u64,
    field: Field,
    /// Cells from one crossing to the next.
    stride: i32,
    disc: Disc,
    /// The value of [`DiscCache::wear`] when its normal was found.
    wear: u32,
}

/// Discs of before, by edge: a tool that moves on meets most of them again.
#[derive(Default)]
struct DiscCache {
    before: Vec<Before>,
    /// How often bone has gone away.
    wear: u32,
    /// Largest radius of a disc, voxels.
    radius: f32,
}

/// One number for an edge of the grid, never 0.
fn key(base: IVec3, edge: &Edge) -> u64 {
    let part = |x: i32| u64::from(x as u32 & 0xF_FFFF);
    let v = base + edge.voxel;
    1 << 63 | part(v.x) << 43 | part(v.y) << 23 | part(v.z) << 3 | u64::from(edge.to)
}

/// Place of a key among the discs of before.
fn slot(key: u64) -> usize {
    (key.wrapping_mul(0x9E37_79B9_7F4A_7C15) >> (64 - CACHE.trailing_zeros())) as usize
}

/// Up to eight edges that are to get a disc.
#[derive(Default)]
struct Next {
    edges: [Edge; EDGES],
    count: usize,
}

/// Whether a disc may stand on the edge by `step` from a cell of bone to one of none.
fn may_stand<S: Solid>(solid: &S, cell: IVec3, step: IVec3) -> bool {
    let stride = solid.stride(cell, step);
    (stride == 1 || cell % stride * (1 - step * step) == IVec3::ZERO) && !(S::CUT && is_grazed(solid, cell, step))
}

/// The places of up to eight discs in the list.
#[derive(Clone, Copy, Debug, Default)]
struct Eight {
    at: [usize; EDGES],
    count: usize,
}

impl Eight {
    fn push(&mut self, at: usize) {
        self.at[self.count] = at;
        self.count += 1;
    }

    fn is_full(&self) -> bool {
        self.count == EDGES
    }

    fn list(&self) -> &[usize] {
        &self.at[..self.count]
    }

    /// Eight places, the first in place of those that there are not.
    fn filled(&self) -> [usize; EDGES] {
        core::array::from_fn(|n| if n < self.count { self.at[n] } else { self.at[0] })
    }
}

impl DiscCache {
    /// The normal, curvature and size of before where they still hold. Those of a cut are found
    /// `anew` or after some ticks; those of the density do not change.
    fn known(&self, solid: &impl Solid, base: IVec3, edge: &Edge, anew: bool) -> Option<&Disc> {
        let key = key(base, edge);
        let was = &self.before[slot(key)];
        let holds = edge.field == Field::Density || !anew && self.wear.wrapping_sub(was.wear) < TURNS;
        let same = holds && (was.key, was.field) == (key, edge.field);
        (same && was.stride == edge.stride(solid, base)).then_some(&was.disc)
    }

    /// Keeps the shape of a disc that was found now.
    fn keep(&mut self, solid: &impl Solid, base: IVec3, edge: &Edge, disc: Disc) {
        let (key, stride) = (key(base, edge), edge.stride(solid, base));
        self.before[slot(key)] = Before { key, field: edge.field, stride, disc, wear: self.wear };
    }

    /// Gives a disc its normal, curvature and size, of before or new ones.
    fn shape(&mut self, solid: &impl Solid, base: IVec3, edge: &mut Edge, disc: &mut Disc, anew: bool) {
        let found = self.known(solid, base, edge, anew).copied().unwrap_or_else(|| {
            let found = Disc::of(solid, base, (disc.centre, edge.field), edge.step().as_vec3(), self.radius);
            self.keep(solid, base, edge, found);
            found
        });
        Self::give(solid, base, edge, disc, found);
    }

    /// Gives a disc the shape that was `found`.
    fn give<S: Solid>(solid: &S, base: IVec3, edge: &mut Edge, disc: &mut Disc, found: Disc) {
        let step = edge.step();
        *disc = Disc { centre: disc.centre, shaft: disc.shaft, ..found };
        if S::CUT && edge.stride(solid, base) == 1 {
            // Where the other field ends the bone nearby the disc must not stand out over that
            // edge.
            disc.radius = disc.radius.min(to_edge(solid, edge.field, base, disc.centre, step.as_vec3()));
        }
        edge.shaped = true;
    }
}

impl Discs {
    /// Room for `limit` discs, each of at most `radius` voxels.
    pub fn new(limit: usize, radius: f32) -> Self {
        let (list, edges) = (Vec::with_capacity(limit), Vec::with_capacity(limit));
        let kept = DiscCache { before: vec![Before::default(); CACHE], wear: 0, radius };
        Self { bones: Vec::with_capacity(1 << 14), list, edges, kept, limit, ..Self::default() }
    }

    /// Drops all discs.
    pub fn forget(&mut self) {
        self.list.clear();
        self.edges.clear();
        (self.visited, self.voxels, self.overflow) = (0, 0, 0);
    }

    /// Drops all discs and what is remembered of earlier ones: the bone is another.
    pub fn renew(&mut self) {
        self.forget();
        self.kept.before.fill(Before::default());
    }

    /// Bone has gone away.
    pub fn wear(&mut self) {
        self.kept.wear = self.kept.wear.wrapping_add(1);
    }

    /// The discs found.
    pub fn list(&self) -> &[Disc] {
        &self.list
    }

    /// Finds the discs whose centres are at most `reach` voxels from grid point `at`. Voxels nearer
    /// than `hollow` are not looked at. The window must hold all voxels up to `reach` and two more.
    pub fn gather(&mut self, fine: &Fine, at: Vec3, hollow: f32, reach: f32) {
        self.forget();
        self.base = at.round().as_ivec3();
        let centre = at - self.base.as_vec3();
        self.around = (centre, reach);
        // A bone voxel is up to one voxel behind its crossing.
        let (hollow, outer) = (hollow - 1.0, reach + 1.0);
        let edge = (outer + 1.5).ceil() as i32;
        let (low, count) = (-edge, 2 * edge + 1);
        let mut bones = core::mem::take(&mut self.bones);
        bones.clear();
        for k in low..=edge {
            for j in low..=edge {
                let across = (j as f32 - centre.y).powi(2) + (k as f32 - centre.z).powi(2);
                let near = across <= (outer + 1.5) * (outer + 1.5);
                bones.push(if near { fine.bone_bits(self.base + IVec3::new(low, j, k), count) } else { 0 });
            }
        }
        let at = |j: i32, k: i32| ((k - low) * count + (j - low)) as usize;
        let mut next = Next::default();
        rows(GridBall { centre, radius: outer }, GridBall { centre, radius: hollow }, |start, to| {
            self.visited += (to - start.x + 1).max(0) as u32;
            let here = at(start.y, start.z);
            let span = !(!0u128 << (to - start.x + 1).max(0)) << (start.x - low);
            let bone = bones[here];
            let own = bone & span;
            if own == 0 {
                return;
            }
            let air = [
                bone >> 1,
                bone << 1,
                bones[here + 1],
                bones[here - 1],
                bones[here + count as usize],
                bones[here - count as usize],
            ];
            for (to, beside) in (0..).zip(air) {
                let mut ends = own & !beside;
                while ends != 0 {
                    let local = start.with_x(low + ends.trailing_zeros() as i32);
                    ends &= ends - 1;
                    self.find(fine, local, to, &mut next);
                }
            }
        });
        self.add(fine, &next);
        self.bones = bones;
    }

    /// Replaces the discs of edges that crossed before some cells `opened` by those of edges that
    /// cross now. Whether other edges are grazed is not looked at anew.
    pub fn open(&mut self, fine: &Fine, opened: &[IVec3]) {
        let mut at = 0;
        while let Some(edge) = self.edges.get(at) {
            if fine.is_bone(self.base + edge.voxel) {
                at += 1;
            } else {
                self.edges.swap_remove(at);
                self.list.swap_remove(at);
            }
        }
        let mut next = Next::default();
        for cell in opened {
            for (to, step) in (0..).zip(NEIGHBOURS) {
                let owner = *cell - step;
                if fine.is_bone(owner) {
                    self.find(fine, owner - self.base, to, &mut next);
                }
            }
        }
        self.add(fine, &next);
    }

    /// Adds the edge from a bone node to its neighbour `to` to those that come next, if a disc may
    /// stand there.
    fn find(&mut self, fine: &Fine, local: IVec3, to: u8, next: &mut Next) {
        if may_stand(fine, self.base + local, NEIGHBOURS[usize::from(to)]) {
            next.edges[next.count] = Edge { voxel: local, to, ..Edge::default() };
            next.count += 1;
            if next.count == EDGES {
                self.add(fine, next);
                next.count = 0;
            }
        }
    }

    /// Adds the discs of the edges that come next, where they are within reach.
    fn add(&mut self, fine: &Fine, next: &Next) {
        if next.count == 0 {
            return;
        }
        let edges: [&Edge; EDGES] = core::array::from_fn(|n| &next.edges[if n < next.count { n } else { 0 }]);
        let (found, (centre, reach)) = (ends(fine, &edges.map(|edge| edge.way(self.base))), self.around);
        for (lane, edge) in edges.into_iter().enumerate().take(next.count) {
            let x = edge.voxel.as_vec3() + found.share[lane] * edge.step().as_vec3();
            if x.distance_squared(centre) <= reach * reach {
                let field = if found.by_cut >> lane & 1 == 1 { Field::Cut } else { Field::Density };
                let stride = edge.stride(fine, self.base);
                self.push(Edge { field, ..*edge }, x, stride, false);
            }
        }
    }

    fn push(&mut self, edge: Edge, x: Vec3, stride: i32, shaft: bool) {
        if self.list.len() == self.limit {
            self.overflow += 1;
            return;
        }
        let (normal, radius) = (edge.step().as_vec3(), stride as f32 * self.kept.radius);
        self.list.push(Disc { centre: x, normal, radius, shaft, ..Disc::default() });
        self.voxels += u32::from(self.edges.last().is_none_or(|last: &Edge| last.voxel != edge.voxel));
        self.edges.push(edge);
    }

    /// Moves the discs to where the crossings are now, and turns some to their normals. It turns
    /// one in [`TURNS`] of those with a point within `reach` of `centre`. The edges that cross must
    /// be the same as when they were gathered.
    pub fn refresh(&mut self, fine: &Fine, centre: Vec3, reach: f32) {
        self.visited = self.list.len() as u32;
        let (mut moved, mut turned) = (Eight::default(), Eight::default());
        for at in 0..self.list.len() {
            let edge = &self.edges[at];
            if !fine.is_far(self.base + edge.voxel, edge.step()) {
                moved.push(at);
            }
            if moved.count > 0 && (moved.is_full() || at + 1 == self.list.len()) {
                let others = self.put(fine, &moved);
                for (lane, &at) in moved.list().iter().enumerate() {
                    let edge = &self.edges[at];
                    let turn = (slot(key(self.base, edge)) as u32).wrapping_add(self.kept.wear).is_multiple_of(TURNS);
                    let anew = turn || others >> lane & 1 == 1;
                    if edge.shaped && anew && self.list[at].least_distance(centre) <= reach {
                        self.shape_one(fine, at, true, &mut turned);
                    }
                }
                moved = Eight::default();
            }
        }
        self.shape_eight(fine, &turned);
    }

    /// Puts discs to where their edges leave the bone. Returns a bit for each that another field
    /// ends than before.
    fn put(&mut self, fine: &Fine, eight: &Eight) -> u32 {
        let found = ends(fine, &eight.filled().map(|at| self.edges[at].way(self.base)));
        let mut others = 0;
        for (lane, &at) in eight.list().iter().enumerate() {
            let (edge, by_cut) = (&mut self.edges[at], found.by_cut >> lane & 1 == 1);
            let field = if by_cut { Field::Cut } else { Field::Density };
            others |= u32::from(field != edge.field) << lane;
            edge.field = field;
            self.list[at].centre = edge.voxel.as_vec3() + found.share[lane] * edge.step().as_vec3();
        }
        others
    }

    /// Computes the normals of the discs that have a point within `reach` of the tool. The tool's
    /// part nearest to a place is at `centre`, voxels from [`Self::base`]. The others are of no
    /// use.
    pub fn shape(&mut self, solid: &impl Solid, centre: impl Fn(Vec3) -> Vec3, reach: f32) {
        let mut new = Eight::default();
        for at in 0..self.list.len() {
            let known = &self.list[at];
            if !self.edges[at].shaped && known.least_distance(centre(known.centre)) <= reach {
                self.shape_one(solid, at, false, &mut new);
            }
        }
        if let Some(fine) = solid.fine() {
            self.shape_eight(fine, &new);
        }
    }

    /// Shapes a disc, or adds it to the `next` eight that are shaped together.
    fn shape_one(&mut self, solid: &impl Solid, at: usize, anew: bool, next: &mut Eight) {
        let (edge, disc) = (&mut self.edges[at], &mut self.list[at]);
        match solid.fine() {
            Some(fine) if edge.field == Field::Cut && self.kept.known(fine, self.base, edge, anew).is_none() => {
                next.push(at);
                if next.is_full() {
                    self.shape_eight(fine, next);
                    *next = Eight::default();
                }
            }
            _ => self.kept.shape(solid, self.base, edge, disc, anew),
        }
    }

    fn shape_eight(&mut self, fine: &Fine, eight: &Eight) {
        if eight.count == 0 {
            return;
        }
        let at = eight.filled();
        let (ways, places) = (at.map(|at| self.edges[at].way(self.base)), at.map(|at| self.list[at].centre));
        let discs = shapes(fine, self.base, &ways, &places, self.kept.radius);
        for (&at, found) in eight.list().iter().zip(discs) {
            let (edge, disc) = (&mut self.edges[at], &mut self.list[at]);
            self.kept.keep(fine, self.base, edge, found);
            DiscCache::give(fine, self.base, edge, disc, found);
        }
    }

    /// Finds the discs whose centres are at most `reach` voxels from the axis of a shaft, in grid
    /// coordinates.
    pub fn gather_along(&mut self, bone: &BoneVolume, shaft: &Shaft, reach: f32) {
        self.forget();
        self.base = shaft.start.round().as_ivec3();
        let shift = self.base.as_vec3();
        self.visited = shaft.around(bone, reach + 1.0, |voxel| {
            let within = |x: Vec3| shaft.at(shaft.along(x + shift)).distance_squared(x + shift) <= reach * reach;
            self.voxel(bone, voxel - self.base, within, true);
        });
    }

    /// The crossings around one bone voxel that are `within` reach of the tool.
    fn voxel(&mut self, solid: &impl Solid, local: IVec3, within: impl Fn(Vec3) -> bool, shaft: bool) {
        for (to, step) in (0..).zip(NEIGHBOURS) {
            let cell = self.base + local;
            if !solid.is_bone(cell + step) && may_stand(solid, cell, step) {
                let (x, field) = crossing(solid, self.base, local, step);
                if within(x) {
                    self.push(Edge { voxel: local, to, field, shaped: false }, x, solid.stride(cell, step), shaft);
                }
            }
        }
    }
}
