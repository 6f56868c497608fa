//! The bone's surface near a point as a set of small discs.
//!
//! # Theory
//! Where a grid edge joins a cell of bone to one that is not, a field ends the bone at `x`: the
//! density, linear along the edge, falls under the isovalue, or the cut, a cubic along the edge,
//! rises over its surface. There stands a disc. The normal n of one on the density starts as the
//! gradient of the density's quadratic B-spline, and is then that of the plane which fits the
//! densities h of the 27 cells around best that lie within a cell of n's plane:
//! ```text
//! minimise Σ w (h - iso + g·d)² ,   w = B(d) · max(0, 1 - (n·d)²)
//! d: from x to the cell,  n = g/|g|
//! ```
//! What is further off is flat bone or flat air, and its gradient that of the grid's corners: the
//! spline alone is up to 2.6 degrees off on planes, the fit 0.3. The cut is a distance: the normal
//! is its slope. In a hole of 3 mm on nodes of 0.5 mm the discs lie within 0.5 um of the ball that
//! cut it. All of it is continuous, so that nothing jumps at borders of cells. The distance to a
//! set of discs is 1-Lipschitz by construction, and each disc is convex: a half-space that just
//! leaves the disc out is a safe constraint.
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
//! found 8 cells at once; a disc costs some 30 ns. One that was there before keeps its normal;
//! while bone goes away, for a few ticks. The capacity is fixed; what does not fit is counted.

use crate::rows::{GridBall, rows};
use crate::shaft::Shaft;
use crate::window::Window;
use glam::IVec3;
use trepan_geometry::Vec3;
use trepan_volume::BoneVolume;
use wide::i16x8;

/// Density differences past this many HU from the isovalue do not bend a normal further.
const CLAMP_HU: f32 = 1000.0;

/// How far the rim of a disc may stand out over a surface that bends away, voxels.
const STAND_OUT: f32 = 0.05;
/// While bone goes away normals are found anew in turns of so many ticks; in so few a burr takes
/// some hundredths of a voxel.
const TURNS: u32 = 4;
/// Discs of before that are kept; a power of two.
const CACHE: usize = 4096;
/// Cosine of the most that a fit may turn the slope's own normal.
const SAME: f32 = 0.8;
/// Fall of the cut along an edge under which a steeper edge is nearby, HU. The cosine of a
/// surface's angle with one of the axes is at least 0.58.
const GRAZED: f32 = 500.0;
/// Widest disc that does not stand out over a cut which ends over two nodes away, cells.
const WIDEST: f32 = 1.2;
/// Slope of the cut along an edge that counts as steep, HU a cell.
const STEEP: f32 = -300.0;
/// Radius of a disc on the cut, cells. A wider one, a little tilted, would stand out in a hollow.
const CUT_DISC: f32 = 0.1;
/// Density over the isovalue at which the surface is further than a disc reaches, HU.
const FAR_HU: f32 = 800.0;
/// Smallest disc, voxels.
const SMALLEST: f32 = 0.2;

/// The ways from a voxel to those that share a face with it.
pub(crate) const NEIGHBOURS: [IVec3; 6] = [IVec3::X, IVec3::NEG_X, IVec3::Y, IVec3::NEG_Y, IVec3::Z, IVec3::NEG_Z];

/// A piece of surface.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Disc {
    /// Its centre, voxels from [`Discs::base`].
    pub centre: Vec3,
    /// Unit normal out of the bone.
    pub normal: Vec3,
    /// Radius, voxels: less where the surface bends away.
    pub radius: f32,
    /// Whether it is the shaft that it stands against, not the ball.
    pub shaft: bool,
}

/// Where the surface is read from: one or two fields on the cells of a grid, bone where all of
/// them are over their borders.
pub(crate) trait Solid {
    /// How far a cell is over the border of bone in a field, HU or 1000 a node.
    fn over(&self, field: Field, cell: IVec3) -> f32;
    /// Whether a cell is bone.
    fn is_bone(&self, cell: IVec3) -> bool;
    /// One bit for each of `count` cells along x from `start` that is bone, at most 128.
    fn bone_bits(&self, start: IVec3, count: i32) -> u128 {
        (0..count).fold(0, |bits, i| bits | u128::from(self.is_bone(start.with_x(start.x + i))) << i)
    }
    /// Whether there is a cut beside the densities.
    const CUT: bool = false;
    /// Cells from one voxel to the next where the edge by `step` lies far from all cuts, else 1.
    /// Far from cuts the surface is looked for on the edges between voxels alone.
    fn stride(&self, _cell: IVec3, _step: IVec3) -> i32 {
        1
    }
    /// Widest disc, cells.
    fn widest(&self) -> f32 {
        f32::MAX
    }
}

/// Which field bounds the bone.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Field {
    /// The CT.
    #[default]
    Density,
    /// What tools have cut.
    Cut,
}

/// CT and cut on the nodes of the cut.
pub(crate) struct Fine<'a> {
    pub density: &'a Window,
    pub cut: &'a Window,
    /// Nodes from one voxel to the next.
    pub stride: i32,
    /// Whether anything was cut nearby.
    pub near: bool,
}

impl Solid for Fine<'_> {
    const CUT: bool = true;

    fn stride(&self, cell: IVec3, step: IVec3) -> i32 {
        if self.cut.at(cell) == 0 && self.cut.at(cell + step) == 0 { self.stride } else { 1 }
    }

    fn widest(&self) -> f32 {
        if self.near { WIDEST } else { f32::MAX }
    }

    fn over(&self, field: Field, cell: IVec3) -> f32 {
        match field {
            Field::Density => self.density.over(cell),
            Field::Cut => self.cut.over(cell),
        }
    }

    fn is_bone(&self, cell: IVec3) -> bool {
        self.cut.at(cell) < self.cut.border() && self.density.at(cell) >= self.density.border()
    }

    fn bone_bits(&self, start: IVec3, count: i32) -> u128 {
        let [cut, density] = [self.cut, self.density].map(|window| i16x8::splat(window.border()));
        let dense = self.density.bits(start, count, |cells| !cells.simd_lt(density));
        if dense == 0 || !self.near { dense } else { dense & self.cut.bits(start, count, |cells| cells.simd_lt(cut)) }
    }
}

/// The voxels with what was cut from them.
impl Solid for BoneVolume {
    fn over(&self, _: Field, cell: IVec3) -> f32 {
        f32::from(self.hu(cell)) - f32::from(self.isovalue())
    }

    fn is_bone(&self, cell: IVec3) -> bool {
        BoneVolume::is_bone(self, cell)
    }
}

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
    /// Discs of before, by edge: a tool that moves on meets most of them again.
    before: Vec<Before>,
    /// Bone in the rows around the tool, a bit a cell.
    bones: Vec<u128>,
    /// How often bone has gone away.
    wear: u32,
    limit: usize,
    radius: f32,
}

/// A grid edge out of the bone.
#[derive(Clone, Copy, Debug)]
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

/// A disc of before.
#[derive(Clone, Copy, Debug, Default)]
struct Before {
    /// Which edge; 0 for none.
    key: u64,
    normal: Vec3,
    radius: f32,
    /// The value of [`Discs::wear`] when its normal was found.
    wear: u32,
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

fn keep(before: &mut [Before], base: IVec3, edge: &Edge, disc: &Disc, wear: u32) {
    let key = key(base, edge);
    before[slot(key)] = Before { key, normal: disc.normal, radius: disc.radius, wear };
}

impl Discs {
    /// Room for `limit` discs, each of at most `radius` voxels.
    pub fn new(limit: usize, radius: f32) -> Self {
        let (list, edges, before) =
            (Vec::with_capacity(limit), Vec::with_capacity(limit), vec![Before::default(); CACHE]);
        let bones = Vec::with_capacity(1 << 14);
        Self { bones, list, edges, before, limit, radius, ..Self::default() }
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
        self.before.fill(Before::default());
    }

    /// Bone has gone away.
    pub fn wear(&mut self) {
        self.wear = self.wear.wrapping_add(1);
    }

    /// The discs found.
    pub fn list(&self) -> &[Disc] {
        &self.list
    }

    /// Finds the discs whose centres are at most `reach` voxels from grid point `at`. Voxels nearer
    /// than `hollow` are not looked at. The window must hold all voxels up to `reach` and two more.
    pub fn gather(&mut self, solid: &impl Solid, at: Vec3, hollow: f32, reach: f32) {
        self.forget();
        self.base = at.round().as_ivec3();
        let centre = at - self.base.as_vec3();
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
                bones.push(if near { solid.bone_bits(self.base + IVec3::new(low, j, k), count) } else { 0 });
            }
        }
        let at = |j: i32, k: i32| ((k - low) * count + (j - low)) as usize;
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
                    let within = |x: Vec3| x.distance_squared(centre) <= reach * reach;
                    self.edge(solid, local, to, within, false);
                }
            }
        });
        self.bones = bones;
    }

    /// Moves the discs to where the crossings are now, and turns some to their normals. It turns
    /// one in [`TURNS`] of those with a point within `reach` of `centre`. The edges that cross must
    /// be the same as when they were gathered.
    pub fn refresh(&mut self, solid: &impl Solid, centre: Vec3, reach: f32) {
        self.visited = self.list.len() as u32;
        for (known, edge) in self.list.iter_mut().zip(&mut self.edges) {
            let step = NEIGHBOURS[usize::from(edge.to)];
            let (x, field) = crossing(solid, self.base, edge.voxel, step);
            edge.field = field;
            let turn = (slot(key(self.base, edge)) as u32).wrapping_add(self.wear).is_multiple_of(TURNS);
            if edge.shaped && turn && x.distance_squared(centre) <= (reach + known.radius).powi(2) {
                *known = disc(solid, self.base, (x, field), step.as_vec3(), self.radius);
                keep(&mut self.before, self.base, edge, known, self.wear);
            } else {
                known.centre = x;
            }
        }
    }

    /// Computes the normals of the discs that have a point within `reach` of the tool. The tool's
    /// part nearest to a place is at `centre`, voxels from [`Self::base`]. The others are of no
    /// use.
    pub fn shape(&mut self, solid: &impl Solid, centre: impl Fn(Vec3) -> Vec3, reach: f32) {
        for (known, edge) in self.list.iter_mut().zip(&mut self.edges) {
            let apart = known.centre.distance_squared(centre(known.centre));
            if !edge.shaped && apart <= (reach + known.radius).powi(2) {
                let key = key(self.base, edge);
                let was = &self.before[slot(key)];
                if was.key == key && self.wear.wrapping_sub(was.wear) < TURNS {
                    (known.normal, known.radius) = (was.normal, was.radius);
                } else {
                    *known = Disc {
                        shaft: known.shaft,
                        ..disc(solid, self.base, (known.centre, edge.field), known.normal, self.radius)
                    };
                    keep(&mut self.before, self.base, edge, known, self.wear);
                }
                edge.shaped = true;
            }
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
            if !solid.is_bone(self.base + local + step) {
                self.edge(solid, local, to, &within, shaft);
            }
        }
    }

    /// The crossing from a bone voxel to its neighbour `to`, if it is `within` reach of the tool.
    fn edge<S: Solid>(&mut self, solid: &S, local: IVec3, to: u8, within: impl Fn(Vec3) -> bool, shaft: bool) {
        let (cell, step) = (self.base + local, NEIGHBOURS[usize::from(to)]);
        let stride = solid.stride(cell, step);
        if (cell % stride * (1 - step * step)) != IVec3::ZERO {
            return;
        }
        if S::CUT && is_grazed(solid, cell, step) {
            return;
        }
        let (x, field) = crossing(solid, self.base, local, step);
        if !within(x) {
            return;
        }
        if self.list.len() == self.limit {
            self.overflow += 1;
            return;
        }
        let radius = stride as f32 * self.radius;
        self.list.push(Disc { centre: x, normal: step.as_vec3(), radius, shaft });
        self.voxels += u32::from(self.edges.last().is_none_or(|edge: &Edge| edge.voxel != local));
        self.edges.push(Edge { voxel: local, to, field, shaped: false });
    }
}

/// Whether the cut passes an edge at so little an angle that it passes a steeper one nearby.
fn is_grazed(solid: &impl Solid, cell: IVec3, step: IVec3) -> bool {
    let beyond = solid.over(Field::Cut, cell + step);
    beyond <= 0.0 && solid.over(Field::Cut, cell) - beyond < GRAZED && solid.over(Field::Density, cell + step) >= 0.0
}

/// Where bone ends on the edge from bone voxel `local` by `step`, voxels from `base`, and what ends
/// it.
fn crossing<S: Solid>(solid: &S, base: IVec3, local: IVec3, step: IVec3) -> (Vec3, Field) {
    let of = |field| {
        let over = |n: i32| solid.over(field, base + local + n * step);
        let (here, after) = (over(0), over(1));
        match field {
            _ if after >= 0.0 => 1.0,
            Field::Density => here / (here - after),
            Field::Cut => end_of_bone([over(-1), here, after, over(2)]),
        }
    };
    let mut found = (of(Field::Density), Field::Density);
    if S::CUT {
        let cut = of(Field::Cut);
        // On equal terms it is the cut: a density on its border is bone, a cut is not.
        found = if cut <= found.0 { (cut, Field::Cut) } else { found };
    }
    (local.as_vec3() + found.0 * step.as_vec3(), found.1)
}

/// Where the cubic of [`cubic`] passes 0.
fn end_of_bone([a, b, c, d]: [f32; 4]) -> f32 {
    let [one, two, three] = coefficients([a, b, c, d]);
    let value = |t: f32| b + t * (one + t * (two + t * three));
    let slope = |t: f32| one + t * (2.0 * two + 3.0 * t * three);
    // Two of Newton's steps from the line between the ends: exact to 1e-4 where the cubic is steep.
    let line = b / (b - c);
    let near = line - value(line) / slope(line);
    let found = near - value(near) / slope(near);
    if slope(line) < STEEP && slope(near) < STEEP && (0.0..=1.0).contains(&found) {
        return found;
    }
    let (mut low, mut high, mut t) = (0.0, 1.0, line);
    for _ in 0..10 {
        (low, high) = if value(t) >= 0.0 { (t, high) } else { (low, t) };
        let next = t - value(t) / slope(t);
        // Newton's step, or half way where that leads out.
        let next = if next > low && next < high { next } else { 0.5 * (low + high) };
        if (next - t).abs() < 3e-4 {
            return next;
        }
        t = next;
    }
    t
}

/// A disc at `x` (voxels from `base`), where `field` ends the bone on an edge that leads out of it
/// along `edge`.
fn disc<S: Solid>(solid: &S, base: IVec3, (x, field): (Vec3, Field), edge: Vec3, radius: f32) -> Disc {
    // Where the other field ends the bone nearby the disc must not stand out over that edge.
    let (step, along) = (edge.as_ivec3(), x.dot(edge));
    let cell = base + x.round().as_ivec3() + (along.floor() - along.round()) as i32 * step;
    let stride = solid.stride(cell, step);
    let mut radius = match field {
        Field::Cut => CUT_DISC.min(radius),
        Field::Density => (stride as f32 * radius).min(solid.widest()),
    };
    if S::CUT && stride == 1 {
        // Where the other field ends the bone nearby the disc must not stand out over that edge.
        radius = radius.min(to_edge(solid, field, base, x, edge).max(0.0));
    }
    if field == Field::Cut {
        // A distance: its slope at the ends of the edge says it all.
        let slope = slope(solid, field, cell).lerp(slope(solid, field, cell + step), along - along.floor());
        let normal = (-slope).normalize_or(edge);
        return Disc { centre: x, normal, radius, shaft: false };
    }
    let block = Block::read(solid, stride, base, x);
    let shape = Shape::of(&block);
    let size = shape.slope.length();
    // Against the edge, or without slope, the smoothed density is of no use: a wall thinner than
    // its kernel.
    if size < 1.0 || -shape.slope.dot(edge) < -0.5 * size {
        return Disc { centre: x, normal: edge, radius: SMALLEST.min(radius), shaft: false };
    }
    let rough = -shape.slope / size;
    let normal = block.fitted(rough).unwrap_or(rough);
    let bend = shape.bend(normal) / size;
    let flat = stride as f32 * (2.0 * STAND_OUT / bend.max(1e-9)).sqrt();
    let radius = if bend > 0.0 { flat.clamp(SMALLEST.min(radius), radius) } else { radius };
    Disc { centre: x, normal, radius, shaft: false }
}

/// How far `x` on an edge along `edge` is from where the field that does not end the bone there
/// would end it, cells.
fn to_edge(solid: &impl Solid, field: Field, base: IVec3, x: Vec3, edge: Vec3) -> f32 {
    let other = if field == Field::Cut { Field::Density } else { Field::Cut };
    let (step, along) = (edge.as_ivec3(), x.dot(edge));
    let cell = base + x.round().as_ivec3() + (along.floor() - along.round()) as i32 * step;
    let over = cubic([-1, 0, 1, 2].map(|n| solid.over(other, cell + n * step)), along - along.floor());
    if field == Field::Density {
        // The cut rises by so much a node, wherever.
        return over * 1e-3;
    }
    if over > FAR_HU {
        return f32::MAX;
    }
    over / slope(solid, other, cell).length().max(1.0)
}

/// The slope of a field at a cell, HU a cell.
fn slope(solid: &impl Solid, field: Field, cell: IVec3) -> Vec3 {
    let near = |step: IVec3| solid.over(field, cell + step);
    0.5 * Vec3::new(
        near(IVec3::X) - near(IVec3::NEG_X),
        near(IVec3::Y) - near(IVec3::NEG_Y),
        near(IVec3::Z) - near(IVec3::NEG_Z),
    )
}

/// The Catmull-Rom cubic through `b` at 0 and `c` at 1, with `a` and `d` before and after, at `t`.
fn cubic([a, b, c, d]: [f32; 4], t: f32) -> f32 {
    let [one, two, three] = coefficients([a, b, c, d]);
    b + t * (one + t * (two + t * three))
}

/// Its coefficients of t, t² and t³.
fn coefficients([a, b, c, d]: [f32; 4]) -> [f32; 3] {
    [0.5 * (c - a), 0.5 * (2.0 * a - 5.0 * b + 4.0 * c - d), 0.5 * (3.0 * (b - c) + d - a)]
}

/// The densities around a place over the isovalue, HU, and where the middle one is seen from the
/// place.
struct Block {
    hu: [[[f32; 3]; 3]; 3],
    off: Vec3,
}

impl Block {
    fn read(solid: &impl Solid, stride: i32, base: IVec3, x: Vec3) -> Self {
        // The nearest voxel, where only those count.
        let all = base.as_vec3() + x;
        let middle = stride as f32 * (all / stride as f32).round() - base.as_vec3();
        let centre = base + middle.as_ivec3();
        let over = |i: usize, j: usize, k: usize| {
            let step = IVec3::new(i as i32, j as i32, k as i32) - 1;
            solid.over(Field::Density, centre + stride * step).clamp(-CLAMP_HU, CLAMP_HU)
        };
        let hu = core::array::from_fn(|k| core::array::from_fn(|j| core::array::from_fn(|i| over(i, j, k))));
        Self { hu, off: (middle - x) / stride as f32 }
    }

    fn taps(&self) -> [[[f32; 3]; 3]; 3] {
        [taps(-self.off.x), taps(-self.off.y), taps(-self.off.z)]
    }

    /// The normal of the plane through the place that best fits the densities near it. Those within
    /// a voxel of the plane of `normal` count; `None` when they do not determine it. A scanner's
    /// density rises for a voxel or so about a surface and is flat beyond: what is flat would bend
    /// the slope.
    fn fitted(&self, normal: Vec3) -> Option<Vec3> {
        let [tx, ty, tz] = self.taps();
        let (mut square, mut mixed, mut moment) = (Vec3::ZERO, Vec3::ZERO, Vec3::ZERO);
        for k in 0..3 {
            for j in 0..3 {
                let (y, z) = (self.off.y + j as f32 - 1.0, self.off.z + k as f32 - 1.0);
                let (across, share) = (normal.y * y + normal.z * z, ty[j][0] * tz[k][0]);
                for i in 0..3 {
                    let x = self.off.x + i as f32 - 1.0;
                    let height = normal.x * x + across;
                    let w = tx[i][0] * share * (1.0 - height * height).max(0.0);
                    square += w * Vec3::new(x * x, y * y, z * z);
                    mixed += w * Vec3::new(y * z, x * z, x * y);
                    moment -= w * self.hu[k][j][i] * Vec3::new(x, y, z);
                }
            }
        }
        // The inverse of a symmetric matrix but for its determinant, by cofactors: only the
        // direction counts.
        let straight = Vec3::new(square.y * square.z, square.x * square.z, square.x * square.y) - mixed * mixed;
        let crossed = Vec3::new(mixed.y * mixed.z, mixed.x * mixed.z, mixed.x * mixed.y) - square * mixed;
        times(straight, crossed, moment).try_normalize().filter(|found| found.dot(normal) > SAME)
    }
}

/// A symmetric matrix of `straight` xx, yy, zz and `mixed` yz, xz, xy, times `v`.
fn times(straight: Vec3, mixed: Vec3, v: Vec3) -> Vec3 {
    straight * v
        + Vec3::new(mixed.z * v.y + mixed.y * v.z, mixed.z * v.x + mixed.x * v.z, mixed.y * v.x + mixed.x * v.y)
}

/// Slope and bending of the quadratic B-spline of the density, HU per voxel and per voxel².
struct Shape {
    slope: Vec3,
    /// Second derivatives xx, yy, zz.
    straight: Vec3,
    /// Second derivatives yz, xz, xy.
    mixed: Vec3,
}

impl Shape {
    fn of(block: &Block) -> Self {
        let [tx, ty, tz] = block.taps();
        let mut shape = Self { slope: Vec3::ZERO, straight: Vec3::ZERO, mixed: Vec3::ZERO };
        for (layer, z) in block.hu.iter().zip(tz) {
            for (row, y) in layer.iter().zip(ty) {
                let sum = |n: usize| row[0] * tx[0][n] + row[1] * tx[1][n] + row[2] * tx[2][n];
                let (even, steep, bent) = (sum(0), sum(1), sum(2));
                shape.slope += Vec3::new(steep * y[0] * z[0], even * y[1] * z[0], even * y[0] * z[1]);
                shape.straight += Vec3::new(bent * y[0] * z[0], even * y[2] * z[0], even * y[0] * z[2]);
                shape.mixed += Vec3::new(even * y[1] * z[1], steep * y[0] * z[1], steep * y[1] * z[0]);
            }
        }
        shape
    }

    /// How much the surface bends away from `normal` where it bends most, times the slope; negative
    /// where it bends up everywhere.
    fn bend(&self, normal: Vec3) -> f32 {
        let times = |v: Vec3| times(self.straight, self.mixed, v);
        let (u, v) = normal.any_orthonormal_pair();
        let (uu, uv, vv) = (u.dot(times(u)), u.dot(times(v)), v.dot(times(v)));
        let (mean, half) = (0.5 * (uu + vv), 0.5 * (uu - vv));
        (half * half + uv * uv).sqrt() - mean
    }
}

/// Weight, slope and bending of the three taps of a quadratic B-spline, `f` off the middle one.
fn taps(f: f32) -> [[f32; 3]; 3] {
    let (below, above) = (0.5 - f, 0.5 + f);
    [[0.5 * below * below, -below, 1.0], [0.75 - f * f, -2.0 * f, -2.0], [0.5 * above * above, above, 1.0]]
}
