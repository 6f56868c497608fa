//! The bone's surface near a point as a set of small discs.
//!
//! # Theory
//! Where a grid edge joins a bone voxel (density ≥ isovalue) to one that is not, the density, linear along the edge, crosses the isovalue
//! at `x`. There stands a disc with the normal of the smoothed density: the gradient of its quadratic B-spline,
//! which is continuous, so that nothing jumps at voxel borders. The distance to a set of discs is 1-Lipschitz by
//! construction, and each disc is convex: a half-space that just leaves the disc out is a safe constraint.
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
//! Lengths are voxels, in a frame shifted to a whole voxel near the tool ([`Discs::base`]). The cost is one load per voxel
//! visited, six per bone voxel, 27 per disc: 3 to 20 us for a ball of 12 voxels. The capacity is fixed; what does not fit is counted.

use crate::rows::{GridBall, rows};
use crate::window::Window;
use glam::IVec3;
use trepan_geometry::Vec3;

/// Density differences past this many HU from the isovalue do not bend a normal further.
const CLAMP_HU: i32 = 1000;

/// How far the rim of a disc may stand out over a surface that bends away, voxels.
const STAND_OUT: f32 = 0.05;
/// Smallest disc, voxels.
const SMALLEST: f32 = 0.2;

const NEIGHBOURS: [IVec3; 6] = [IVec3::X, IVec3::NEG_X, IVec3::Y, IVec3::NEG_Y, IVec3::Z, IVec3::NEG_Z];

/// A piece of surface.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Disc {
    /// Its centre, voxels from [`Discs::base`].
    pub centre: Vec3,
    /// Unit normal out of the bone.
    pub normal: Vec3,
    /// Radius, voxels: less where the surface bends away.
    pub radius: f32,
}

/// The discs near a point, gathered anew for each place of the tool.
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
    limit: usize,
    radius: f32,
}

impl Discs {
    /// Room for `limit` discs, each of at most `radius` voxels.
    pub fn new(limit: usize, radius: f32) -> Self {
        let list = Vec::with_capacity(limit);
        Self { base: IVec3::ZERO, visited: 0, voxels: 0, overflow: 0, list, limit, radius }
    }

    /// Drops all discs.
    pub fn forget(&mut self) {
        self.list.clear();
        (self.visited, self.voxels, self.overflow) = (0, 0, 0);
    }

    /// The discs found.
    pub fn list(&self) -> &[Disc] {
        &self.list
    }

    /// Finds the discs whose centres are at most `reach` voxels from grid point `at`. Voxels nearer than `hollow` are not looked at.
    /// The window must hold all voxels up to `reach` and two more.
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

    /// The voxels of one row, from `start` to x = `to`.
    fn row(&mut self, window: &Window, start: IVec3, to: i32, centre: Vec3, reach: f32) {
        let row = window.row(self.base + start);
        for i in start.x..=to {
            let hu = row.hu(self.base.x + i);
            if hu >= window.isovalue {
                self.voxel(window, start.with_x(i), hu, centre, reach);
            }
        }
        self.visited += (to - start.x + 1).max(0) as u32;
    }

    /// The crossings around one bone voxel.
    fn voxel(&mut self, window: &Window, local: IVec3, hu: i16, centre: Vec3, reach: f32) {
        let before = self.list.len();
        let iso = window.isovalue;
        for step in NEIGHBOURS {
            let outside = window.hu(self.base + local + step);
            if outside >= iso {
                continue;
            }
            let along = (f32::from(hu) - f32::from(iso)) / (f32::from(hu) - f32::from(outside));
            let x = local.as_vec3() + along * step.as_vec3();
            if x.distance_squared(centre) > reach * reach {
                continue;
            }
            if self.list.len() == self.limit {
                self.overflow += 1;
                continue;
            }
            self.list.push(disc(window, self.base, x, step.as_vec3(), self.radius));
        }
        self.voxels += u32::from(self.list.len() > before);
    }
}

/// A disc at `x` (voxels from `base`) on an edge that leads out of the bone along `edge`.
fn disc(window: &Window, base: IVec3, x: Vec3, edge: Vec3, radius: f32) -> Disc {
    let shape = Shape::at(window, base, x);
    let size = shape.slope.length();
    // Against the edge, or without slope, the smoothed density is of no use: a wall thinner than its kernel.
    if size < 1.0 || -shape.slope.dot(edge) < -0.5 * size {
        return Disc { centre: x, normal: edge, radius: SMALLEST.min(radius) };
    }
    let normal = -shape.slope / size;
    let bend = shape.bend(normal) / size;
    let radius = if bend > 0.0 { (2.0 * STAND_OUT / bend).sqrt().clamp(SMALLEST.min(radius), radius) } else { radius };
    Disc { centre: x, normal, radius }
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
    fn at(window: &Window, base: IVec3, x: Vec3) -> Self {
        let middle = x.round();
        let (tx, ty, tz) = (taps(x.x - middle.x), taps(x.y - middle.y), taps(x.z - middle.z));
        let corner = base + middle.as_ivec3() - 1;
        let iso = i32::from(window.isovalue);
        let mut shape = Self { slope: Vec3::ZERO, straight: Vec3::ZERO, mixed: Vec3::ZERO };
        for (k, z) in (0..).zip(tz) {
            for (j, y) in (0..).zip(ty) {
                let (mut even, mut steep, mut bent) = (0.0, 0.0, 0.0);
                let row = window.row(corner + IVec3::new(0, j, k));
                for (i, x) in (corner.x..).zip(tx) {
                    let hu = i32::from(row.hu(i));
                    let value = (hu - iso).clamp(-CLAMP_HU, CLAMP_HU) as f32;
                    (even, steep, bent) = (even + value * x[0], steep + value * x[1], bent + value * x[2]);
                }
                shape.slope += Vec3::new(steep * y[0] * z[0], even * y[1] * z[0], even * y[0] * z[1]);
                shape.straight += Vec3::new(bent * y[0] * z[0], even * y[2] * z[0], even * y[0] * z[2]);
                shape.mixed += Vec3::new(even * y[1] * z[1], steep * y[0] * z[1], steep * y[1] * z[0]);
            }
        }
        shape
    }

    /// How much the surface bends away from `normal` where it bends most, times the slope; negative where it bends up everywhere.
    fn bend(&self, normal: Vec3) -> f32 {
        let (s, m) = (self.straight, self.mixed);
        let times = |v: Vec3| {
            Vec3::new(
                s.x * v.x + m.z * v.y + m.y * v.z,
                m.z * v.x + s.y * v.y + m.x * v.z,
                m.y * v.x + m.x * v.y + s.z * v.z,
            )
        };
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
