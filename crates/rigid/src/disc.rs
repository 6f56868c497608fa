//! One disc of the bone's surface: its place, normal and size.

use crate::solid::{Field, Solid, cubic, slope};
use glam::IVec3;
use trepan_geometry::Vec3;

/// Density differences past this many HU from the isovalue do not bend a normal further.
const CLAMP_HU: f32 = 1000.0;
/// How far the rim of a disc may stand out over a surface that bends away, voxels.
const STAND_OUT: f32 = 0.05;
/// Cosine of the most that a fit may turn the slope's own normal.
const SAME: f32 = 0.8;
/// Radius of a disc on the cut, cells. A wider one, a little tilted, would stand out in a hollow.
const CUT_DISC: f32 = 0.1;
/// Density over the isovalue at which the surface is further than a disc reaches, HU.
const FAR_HU: f32 = 800.0;
/// Smallest disc, voxels.
const SMALLEST: f32 = 0.2;

/// A piece of surface.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Disc {
    /// Its centre, voxels from [`Discs::base`](crate::surface::Discs::base).
    pub centre: Vec3,
    /// Unit normal out of the bone.
    pub normal: Vec3,
    /// Radius, voxels: less where the surface bends away.
    pub radius: f32,
    /// Whether it is the shaft that it stands against, not the ball.
    pub shaft: bool,
}

/// A disc at `x` (voxels from `base`), where `field` ends the bone on an edge that leads out of it
/// along `edge`.
pub(crate) fn disc<S: Solid>(solid: &S, base: IVec3, (x, field): (Vec3, Field), edge: Vec3, radius: f32) -> Disc {
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
