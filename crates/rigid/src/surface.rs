//! The bone's surface near a point as a set of small discs.
//!
//! # Theory
//! Where a grid edge joins a bone voxel (density ≥ isovalue) to one that is not, the density,
//! linear along the edge, crosses the isovalue at `x`. There stands a disc. Its normal n starts as
//! the gradient of the density's quadratic B-spline, and is then that of the plane which fits the
//! densities h of the 27 voxels around best that lie within a voxel of n's plane:
//! ```text
//! minimise Σ w (h - iso + g·d)² ,   w = B(d) · max(0, 1 - (n·d)²)
//! d: from x to the voxel,  n = g/|g|
//! ```
//! What is further off is flat bone or flat air, and its gradient that of the grid's corners: the
//! spline alone is up to 2.6 degrees off on planes, the fit 0.3. All of it is continuous, so that
//! nothing jumps at voxel borders. The distance to a set of discs is 1-Lipschitz by construction,
//! and each disc is convex: a half-space that just leaves the disc out is a safe constraint.
//!
//! ```text
//!   ·    ·    ·    ·      · air voxel, • bone voxel
//!   ── ── ─── ──  ──      discs on the edges that cross
//!   •    •    •    •
//! ```
//!
//! A wall one voxel thick still has its crossings, which a smoothed isosurface would lose.
//!
//! # Practice
//! Lengths are voxels, in a frame shifted to a whole voxel near the tool ([`Discs::base`]). The
//! cost is one load per voxel visited, six per bone voxel, 27 per disc that the tool can reach: 3
//! to 20 us for a ball of 12 voxels. A disc that was there before keeps its normal; while density
//! goes away the discs move at each tick, and every fourth is turned. The capacity is fixed; what
//! does not fit is counted.

use crate::rows::{GridBall, rows};
use crate::shaft::Shaft;
use crate::window::Window;
use glam::IVec3;
use trepan_geometry::Vec3;
use trepan_volume::BoneVolume;

/// Density differences past this many HU from the isovalue do not bend a normal further.
const CLAMP_HU: i32 = 1000;

/// How far the rim of a disc may stand out over a surface that bends away, voxels.
const STAND_OUT: f32 = 0.05;
/// While bone goes away normals are found anew in turns of so many ticks; in so few a burr takes
/// some hundredths of a voxel.
const TURNS: u32 = 4;
/// Discs of before that are kept; a power of two.
const CACHE: usize = 4096;
/// Cosine of the most that a fit may turn the slope's own normal.
const SAME: f32 = 0.8;
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

/// Where densities are read from.
pub(crate) trait Densities {
    /// Density from which a voxel is bone, HU.
    fn isovalue(&self) -> i16;
    /// Density of a voxel, HU.
    fn hu(&self, voxel: IVec3) -> i16;
    /// Densities of a voxel and the next two along x, HU.
    fn three(&self, voxel: IVec3) -> [i16; 3] {
        core::array::from_fn(|i| self.hu(voxel.with_x(voxel.x + i as i32)))
    }
}

impl Densities for Window {
    fn isovalue(&self) -> i16 {
        self.isovalue
    }

    fn hu(&self, voxel: IVec3) -> i16 {
        Window::hu(self, voxel)
    }

    fn three(&self, voxel: IVec3) -> [i16; 3] {
        let row = self.row(voxel);
        [row.hu(voxel.x), row.hu(voxel.x + 1), row.hu(voxel.x + 2)]
    }
}

impl Densities for BoneVolume {
    fn isovalue(&self) -> i16 {
        BoneVolume::isovalue(self)
    }

    fn hu(&self, voxel: IVec3) -> i16 {
        BoneVolume::hu(self, voxel)
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
    /// Lowest and highest voxel, from [`Self::base`], at an end of a disc's edge.
    bounds: (IVec3, IVec3),
    list: Vec<Disc>,
    /// The edge on which each disc stands.
    edges: Vec<Edge>,
    /// Discs of before, by edge: a tool that moves on meets most of them again.
    before: Vec<Before>,
    /// How often discs have been refreshed.
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
        Self { bounds: (IVec3::MAX, IVec3::MIN), list, edges, before, limit, radius, ..Self::default() }
    }

    /// Drops all discs.
    pub fn forget(&mut self) {
        self.list.clear();
        self.edges.clear();
        (self.visited, self.voxels, self.overflow) = (0, 0, 0);
        self.bounds = (IVec3::MAX, IVec3::MIN);
    }

    /// The box in the grid that holds all bone and air within `margin` voxels of a disc; there must
    /// be one.
    pub fn bounds(&self, margin: i32) -> (IVec3, IVec3) {
        (self.bounds.0 + self.base - margin, self.bounds.1 + self.base + margin)
    }

    /// Drops all discs and what is remembered of earlier ones: the bone is another.
    pub fn renew(&mut self) {
        self.forget();
        self.before.fill(Before::default());
    }

    /// The discs found.
    pub fn list(&self) -> &[Disc] {
        &self.list
    }

    /// Finds the discs whose centres are at most `reach` voxels from grid point `at`. Voxels nearer
    /// than `hollow` are not looked at. The window must hold all voxels up to `reach` and two more.
    pub fn gather(&mut self, window: &Window, at: Vec3, hollow: f32, reach: f32) {
        self.forget();
        self.base = at.round().as_ivec3();
        let centre = at - self.base.as_vec3();
        // A bone voxel is up to one voxel behind its crossing.
        let (hollow, outer) = (hollow - 1.0, reach + 1.0);
        rows(GridBall { centre, radius: outer }, GridBall { centre, radius: hollow }, |start, to| {
            self.row(window, start, to, centre, reach);
        });
    }

    /// Moves the discs to where the crossings are now, and turns some to their normals. It turns
    /// one in [`TURNS`] of those with a point within `reach` of `centre`. The edges that cross must
    /// be the same as when they were gathered.
    pub fn refresh(&mut self, window: &Window, centre: Vec3, reach: f32) {
        self.visited = self.list.len() as u32;
        self.wear = self.wear.wrapping_add(1);
        for (known, edge) in self.list.iter_mut().zip(&self.edges) {
            let step = NEIGHBOURS[usize::from(edge.to)];
            let x = crossing(window, self.base, edge.voxel, step);
            let turn = (slot(key(self.base, edge)) as u32).wrapping_add(self.wear).is_multiple_of(TURNS);
            if edge.shaped && turn && x.distance_squared(centre) <= (reach + known.radius).powi(2) {
                *known = disc(window, self.base, x, step.as_vec3(), self.radius);
                keep(&mut self.before, self.base, edge, known, self.wear);
            } else {
                known.centre = x;
            }
        }
    }

    /// Computes the normals of the discs that have a point within `reach` of the tool. The tool's
    /// part nearest to a place is at `centre`, voxels from [`Self::base`]. The others are of no
    /// use.
    pub fn shape(&mut self, densities: &impl Densities, centre: impl Fn(Vec3) -> Vec3, reach: f32) {
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
                        ..disc(densities, self.base, known.centre, known.normal, self.radius)
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

    /// The voxels of one row, from `start` to x = `to`.
    fn row(&mut self, window: &Window, start: IVec3, to: i32, centre: Vec3, reach: f32) {
        let row = window.row(self.base + start);
        for i in start.x..=to {
            let hu = row.hu(self.base.x + i);
            if hu >= window.isovalue {
                let within = |x: Vec3| x.distance_squared(centre) <= reach * reach;
                self.voxel(window, start.with_x(i), within, false);
            }
        }
        self.visited += (to - start.x + 1).max(0) as u32;
    }

    /// The crossings around one bone voxel that are `within` reach of the tool.
    fn voxel(&mut self, window: &impl Densities, local: IVec3, within: impl Fn(Vec3) -> bool, shaft: bool) {
        let before = self.list.len();
        for (to, step) in (0..).zip(NEIGHBOURS) {
            if window.hu(self.base + local + step) >= window.isovalue() {
                continue;
            }
            let x = crossing(window, self.base, local, step);
            if !within(x) {
                continue;
            }
            if self.list.len() == self.limit {
                self.overflow += 1;
                continue;
            }
            self.list.push(Disc { centre: x, normal: step.as_vec3(), radius: self.radius, shaft });
            self.bounds = (self.bounds.0.min(local.min(local + step)), self.bounds.1.max(local.max(local + step)));
            self.edges.push(Edge { voxel: local, to, shaped: false });
        }
        self.voxels += u32::from(self.list.len() > before);
    }
}

/// Where the density passes the isovalue on the edge from bone voxel `local` by `step`, voxels from
/// `base`.
fn crossing(window: &impl Densities, base: IVec3, local: IVec3, step: IVec3) -> Vec3 {
    let (inside, outside) = (f32::from(window.hu(base + local)), f32::from(window.hu(base + local + step)));
    let along = (inside - f32::from(window.isovalue())) / (inside - outside);
    local.as_vec3() + along * step.as_vec3()
}

/// A disc at `x` (voxels from `base`) on an edge that leads out of the bone along `edge`.
fn disc(window: &impl Densities, base: IVec3, x: Vec3, edge: Vec3, radius: f32) -> Disc {
    let block = Block::read(window, base, x);
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
    let radius = if bend > 0.0 { (2.0 * STAND_OUT / bend).sqrt().clamp(SMALLEST.min(radius), radius) } else { radius };
    Disc { centre: x, normal, radius, shaft: false }
}

/// The densities around a place over the isovalue, HU, and where the middle one is seen from the
/// place.
struct Block {
    hu: [[[f32; 3]; 3]; 3],
    off: Vec3,
}

impl Block {
    fn read(window: &impl Densities, base: IVec3, x: Vec3) -> Self {
        let middle = x.round();
        let corner = base + middle.as_ivec3() - 1;
        let iso = i32::from(window.isovalue());
        let mut hu = [[[0.0; 3]; 3]; 3];
        for (k, layer) in (0..).zip(&mut hu) {
            for (j, cells) in (0..).zip(layer) {
                let row = window.three(corner + IVec3::new(0, j, k));
                for (hu, cell) in row.into_iter().zip(cells) {
                    *cell = (i32::from(hu) - iso).clamp(-CLAMP_HU, CLAMP_HU) as f32;
                }
            }
        }
        Self { hu, off: middle - x }
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
