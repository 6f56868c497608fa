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
//! visited, six per bone voxel, 27 per disc. The capacity is fixed; what does not fit is counted.

use glam::IVec3;
use trepan_geometry::Vec3;
use trepan_volume::BoneVolume;

/// Density differences past this many HU from the isovalue do not bend a normal further.
const CLAMP_HU: i32 = 1000;

const NEIGHBOURS: [IVec3; 6] = [IVec3::X, IVec3::NEG_X, IVec3::Y, IVec3::NEG_Y, IVec3::Z, IVec3::NEG_Z];

/// A piece of surface.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Disc {
    /// Its centre, voxels from [`Discs::base`].
    pub centre: Vec3,
    /// Unit normal out of the bone.
    pub normal: Vec3,
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
}

impl Discs {
    /// Room for `limit` discs.
    pub fn with_limit(limit: usize) -> Self {
        let list = Vec::with_capacity(limit);
        Self { base: IVec3::ZERO, visited: 0, voxels: 0, overflow: 0, list, limit }
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
    pub fn gather(&mut self, bone: &BoneVolume, at: Vec3, hollow: f32, reach: f32) {
        self.forget();
        self.base = at.round().as_ivec3();
        let centre = at - self.base.as_vec3();
        // A bone voxel is up to one voxel behind its crossing.
        let (hollow, outer) = ((hollow - 1.0).max(0.0), reach + 1.0);
        let n = outer.ceil() as i32;
        for k in -n..=n {
            for j in -n..=n {
                let across = (j as f32 - centre.y).powi(2) + (k as f32 - centre.z).powi(2);
                let half = outer * outer - across;
                if half < 0.0 {
                    continue;
                }
                let half = half.sqrt();
                let hole = (hollow * hollow - across).max(0.0).sqrt();
                let (from, to) = ((centre.x - half).ceil() as i32, (centre.x + half).floor() as i32);
                let (skip_from, skip_to) = ((centre.x - hole).ceil() as i32, (centre.x + hole).floor() as i32);
                if hole > 0.0 && skip_from <= skip_to {
                    self.row(bone, IVec3::new(from, j, k), skip_from - 1, centre, reach);
                    self.row(bone, IVec3::new(skip_to + 1, j, k), to, centre, reach);
                } else {
                    self.row(bone, IVec3::new(from, j, k), to, centre, reach);
                }
            }
        }
    }

    /// The voxels of one row, from `start` to x = `to`.
    fn row(&mut self, bone: &BoneVolume, start: IVec3, to: i32, centre: Vec3, reach: f32) {
        for i in start.x..=to {
            let local = IVec3::new(i, start.y, start.z);
            let hu = bone.hu(self.base + local);
            if hu >= bone.isovalue() {
                self.voxel(bone, local, hu, centre, reach);
            }
        }
        self.visited += (to - start.x + 1).max(0) as u32;
    }

    /// The crossings around one bone voxel.
    fn voxel(&mut self, bone: &BoneVolume, local: IVec3, hu: i16, centre: Vec3, reach: f32) {
        let before = self.list.len();
        let iso = bone.isovalue();
        for step in NEIGHBOURS {
            let outside = bone.hu(self.base + local + step);
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
            self.list.push(Disc { centre: x, normal: normal(bone, self.base, x, step.as_vec3()) });
        }
        self.voxels += u32::from(self.list.len() > before);
    }
}

/// Unit normal out of the bone at `x` (voxels from `base`): down the smoothed density; `edge` where that is of no use.
fn normal(bone: &BoneVolume, base: IVec3, x: Vec3, edge: Vec3) -> Vec3 {
    let down = -gradient(bone, base, x);
    let size = down.length();
    if size < 1.0 || down.dot(edge) < 0.05 * size { edge } else { down / size }
}

/// Gradient of the quadratic B-spline of the density, HU per voxel.
pub(crate) fn gradient(bone: &BoneVolume, base: IVec3, x: Vec3) -> Vec3 {
    let middle = x.round();
    let f = x - middle;
    let weight = |f: f32| [0.5 * (0.5 - f) * (0.5 - f), 0.75 - f * f, 0.5 * (0.5 + f) * (0.5 + f)];
    let slope = |f: f32| [f - 0.5, -2.0 * f, f + 0.5];
    let (wx, wy, wz) = (weight(f.x), weight(f.y), weight(f.z));
    let (sx, sy, sz) = (slope(f.x), slope(f.y), slope(f.z));
    let corner = base + middle.as_ivec3() - 1;
    let iso = i32::from(bone.isovalue());
    let mut sum = Vec3::ZERO;
    for k in 0..3 {
        for j in 0..3 {
            let mut row = [0.0f32; 3];
            for (i, value) in row.iter_mut().enumerate() {
                let hu = i32::from(bone.hu(corner + IVec3::new(i as i32, j as i32, k as i32)));
                *value = (hu - iso).clamp(-CLAMP_HU, CLAMP_HU) as f32;
            }
            let smooth = row[0] * wx[0] + row[1] * wx[1] + row[2] * wx[2];
            let steep = row[0] * sx[0] + row[1] * sx[1] + row[2] * sx[2];
            sum += Vec3::new(steep * wy[j] * wz[k], smooth * sy[j] * wz[k], smooth * wy[j] * sz[k]);
        }
    }
    sum
}
