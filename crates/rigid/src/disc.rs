//! One disc of the bone's surface: its place, normal, curvature and size.
//!
//! # Theory
//! A disc is bent like the surface under it. With the principal directions e₁ and e₂ of its plane
//! and the curvatures k₁ and k₂ it is
//! ```text
//! z = z₀ + ½ (k₁ a² + k₂ b²) ,   a² + b² ≤ radius²        k > 0: hollow
//! ```
//! Slope and curvature of the cut, which is a distance, are those of its quadratic B-spline. Those
//! of the density are from the quadric that fits best what lies within a voxel of the tangent
//! plane:
//! ```text
//! minimise Σ w (h - iso + c₀ + g·d + ½ (c₁ a² + 2 c₂ a b + c₃ b²))²
//! w = B(d) · max(0, 1 - (n·d)²)        d = (a, b, n·d): from x to the voxel,  n = g/|g|
//! ```
//! What is further off is flat bone or flat air, and its slope that of the grid's corners: the
//! spline alone is up to 2.6 degrees off on planes, the fit 0.1. A density is linear along an edge,
//! a bent surface's is not: z₀ = -½ t (1 - t) k at t between the voxels, k along the edge. Near a
//! cut discs stand between voxels, where the density is linear and bends nothing: they are flat and
//! their normal that of a fitted plane.
//!
//! The point of a disc that is nearest to one at (a₀, b₀, h) has `a = a₀ / (1 - (h - z) k₁)`, and
//! so b; two steps find z. Neighbours differ by a third power of their distance, so places, normals
//! and forces are of second order in the voxel (`validate rigid` gives the orders). Past the rim
//! the way turns to that from the rim little by little: of two discs of nearly the same height
//! either may touch, and both then push the same way.
//!
//! # Sources
//! Curvature from a fitted quadric: D. S. Meek, D. J. Walton, *On surface normal and Gaussian
//! curvature approximations given data sampled from a smooth surface*, Comput. Aided Geom. Des. 17
//! (2000).

use crate::eight::Vec3x8;
use crate::solid::{Field, Solid, cubic, slope};
use glam::IVec3;
use nalgebra::{SMatrix, SVector};
use trepan_geometry::Vec3;
use wide::f32x8;

/// A numerical parameter: density differences past this many HU from the isovalue do not bend a
/// normal further.
const CLAMP_HU: f32 = 1000.0;
/// How far the rim of a disc may stand out over a surface that bends away, voxels.
pub(crate) const STAND_OUT: f32 = 0.05;
/// Cosine of the most that a fit may turn the slope's own normal.
const SAME: f32 = 0.8;
/// Radius of a disc on the cut, cells.
pub(crate) const CUT_DISC: f32 = 0.5;
/// A numerical parameter: density over the isovalue at which the surface is further than a disc
/// reaches, HU.
const FAR_HU: f32 = 800.0;
/// Weight of flatness in the fit of a quadric, beside weights of the densities of about 1.
const RIDGE: f32 = 1e-4;
/// Smallest disc, voxels.
pub(crate) const SMALLEST: f32 = 0.2;
/// Largest curvature of a disc, 1/voxel.
pub(crate) const MAX_CURVATURE: f32 = 0.6;
/// How far a bent disc reaches from its centre, in radii: its rim is up to a quarter of the radius
/// off the plane.
pub(crate) const EXTENT: f32 = 1.04;
/// Width of the band around a disc in which directions turn to those from the rim, radii.
const BLEND: f32 = 0.7;
/// `1 - h k` under which only a part of a hollow disc counts, and the least part.
const SPREAD: f32 = 0.3;
const LEAST_PART: f32 = 0.2;
/// Least of `1 - h k`: nearer to the middle of a hollow every point of it is as near.
const FOCUS: f32 = 0.25;

/// A piece of surface.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Disc {
    /// Its centre, voxels from [`Discs::base`](crate::surface::Discs::base).
    pub centre: Vec3,
    /// Unit normal out of the bone.
    pub normal: Vec3,
    /// Radius, voxels: less where the surface bends away more than the disc.
    pub radius: f32,
    pub bend: Bend,
    /// Whether it is the shaft that it stands against, not the ball.
    pub shaft: bool,
}

/// The curvature of a disc.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Bend {
    /// First principal direction, a unit vector in the disc's plane; zero for a flat disc.
    along: Vec3,
    /// Principal curvatures, 1/voxel, positive where the surface is hollow.
    curvatures: [f32; 2],
    /// Height over the disc's centre, voxels.
    rise: f32,
}

impl Bend {
    /// With a first principal direction and the principal curvatures, 1/node.
    pub fn new(along: Vec3, curvatures: [f32; 2]) -> Self {
        Self { along, curvatures, rise: 0.0 }
    }

    /// Of a surface that rises by `½ (uu a² + 2 uv a b + vv b²)` over its plane of `u` and `v`.
    fn of(u: Vec3, v: Vec3, [uu, uv, vv]: [f32; 3]) -> Self {
        let (mean, half) = (0.5 * (uu + vv), 0.5 * (uu - vv));
        let root = (half * half + uv * uv).sqrt();
        // The cosine of twice the angle of the first direction with u.
        let cosine = half / root.max(1e-9);
        let (cos, sin) = ((0.5 + 0.5 * cosine).max(0.0).sqrt(), (0.5 - 0.5 * cosine).max(0.0).sqrt().copysign(uv));
        Self { along: cos * u + sin * v, curvatures: [mean + root, mean - root], rise: 0.0 }
    }

    /// The second derivative of the height on a line along `edge`, where `normal` is across.
    fn along(&self, edge: Vec3, normal: Vec3) -> f32 {
        let (a, b) = (edge.dot(self.along), edge.dot(normal.cross(self.along)));
        self.curvatures[0] * a * a + self.curvatures[1] * b * b
    }

    /// The same with its direction turned into the plane across `normal`.
    fn in_plane_of(self, normal: Vec3) -> Self {
        Self { along: self.along.reject_from_normalized(normal).normalize_or(normal.any_orthonormal_vector()), ..self }
    }

    /// The same, but bent by no more than a disc may be.
    fn limited(self) -> Self {
        Self { curvatures: self.curvatures.map(|k| k.clamp(-MAX_CURVATURE, MAX_CURVATURE)), ..self }
    }

    /// The same in cells of which a cell of before has `times`.
    fn scaled(self, times: f32) -> Self {
        Self { curvatures: self.curvatures.map(|k| k / times), rise: times * self.rise, ..self }
    }
}

impl Disc {
    /// A disc at `x` (voxels from `base`), where `field` ends the bone on an edge that leads out of
    /// it along `edge`.
    pub fn of(solid: &impl Solid, base: IVec3, (x, field): (Vec3, Field), edge: Vec3, radius: f32) -> Self {
        let (step, along) = (edge.as_ivec3(), x.dot(edge));
        let cell = base + x.round().as_ivec3() + (along.floor() - along.round()) as i32 * step;
        let stride = solid.stride(cell, step);
        let radius = match field {
            Field::Cut => CUT_DISC.min(radius),
            Field::Density => (stride as f32 * radius).min(solid.widest()),
        };
        let block = Block::read(solid, field, stride, base, x);
        let shape = Shape::of(&block);
        let size = shape.slope.length();
        // Against the edge, or without slope, the smoothed density is of no use: a wall thinner
        // than its kernel.
        if size < 1.0 || -shape.slope.dot(edge) < -0.5 * size {
            return Self { centre: x, normal: edge, radius: SMALLEST.min(radius), ..Self::default() };
        }
        let rough = -shape.slope / size;
        let bent = match field {
            // A distance: its spline says it all.
            Field::Cut => Some((rough, shape.bend(rough, size))),
            Field::Density if stride == solid.voxel() => {
                // From the voxel before on the edge.
                let before = cell.dot(step).rem_euclid(stride);
                let share = (before as f32 + along - along.floor()) / stride as f32;
                let fit = fitted_quadric(solid, cell - before * step, step, share, rough);
                // Between voxels the density is a parabola with the curvature along the edge.
                let rise = |bend: &Bend, normal| -0.5 * share * (1.0 - share) * bend.along(edge, normal);
                fit.map(|(normal, bend)| (normal, Bend { rise: rise(&bend.limited(), normal), ..bend }))
            }
            // Between voxels the density is linear and says nothing of how the surface bends.
            Field::Density => None,
        };
        let Some((normal, bend)) = bent else {
            let normal = block.fitted(rough).unwrap_or(rough);
            let radius = stood_out(-shape.bend(normal, size).curvatures[1], stride, radius);
            return Self { centre: x, normal, radius, ..Self::default() };
        };
        // What bends away more than the disc may.
        let radius = stood_out(-bend.curvatures[1] - MAX_CURVATURE, stride, radius);
        Self { centre: x, normal, radius, bend: bend.limited().scaled(stride as f32), shaft: false }
    }

    /// The same, but bent so in some direction.
    #[cfg(test)]
    pub fn bent(self, curvatures: [f32; 2], rise: f32) -> Self {
        Self { bend: Bend { along: self.normal.any_orthonormal_vector(), curvatures, rise }, ..self }
    }

    /// The same in cells of which a cell of before has `times`.
    pub fn scaled(self, times: f32) -> Self {
        let (centre, radius) = (times * self.centre, times * self.radius);
        Self { centre, radius, bend: self.bend.scaled(times), ..self }
    }

    /// No point of it is nearer to `place` than this, voxels.
    #[inline]
    pub fn least_distance(&self, place: Vec3) -> f32 {
        self.centre.distance(place) - EXTENT * self.radius
    }

    /// The way from its nearest point to the place `from` its centre, and the way to push there.
    /// Past the rim that is at first the way from the surface that the disc is a part of.
    #[inline(always)]
    pub fn way_to(&self, from: Vec3) -> (Vec3, Vec3) {
        let height = from.dot(self.normal);
        let Bend { along, curvatures: [first, second], rise } = self.bend;
        if along == Vec3::ZERO {
            let sideways = from - height * self.normal;
            let way = from - sideways * (self.radius / sideways.length().max(self.radius));
            return (way, way);
        }
        let across = self.normal.cross(along);
        let (a0, b0) = (from.dot(along), from.dot(across));
        let nearest = |height: f32| (a0 / (1.0 - height * first).max(FOCUS), b0 / (1.0 - height * second).max(FOCUS));
        let z = |a: f32, b: f32| rise + 0.5 * (first * a * a + second * b * b);
        let (a, b) = nearest(height);
        let (a, b) = nearest(height - z(a, b));
        let way = |a: f32, b: f32| from - a * along - b * across - z(a, b) * self.normal;
        let off = (a * a + b * b).sqrt();
        // Where the hollow is about as wide as the ball all of it is as near, and the centre is
        // best known.
        let radius = self.radius * ((1.0 - height * first) / SPREAD).clamp(LEAST_PART, 1.0);
        if off <= radius {
            let way = way(a, b);
            return (way, way);
        }
        let within = radius / off;
        let rim = way(within * a, within * b);
        let share = ((off - radius) / (BLEND * radius)).min(1.0);
        let share = share * share * (3.0 - 2.0 * share);
        (rim, way(a, b).lerp(rim, share))
    }

    /// The ways of [`way_to`](Self::way_to) of eight discs to one `place`, with the same bits.
    #[inline]
    pub fn ways_to(discs: [&Self; 8], place: Vec3) -> (Vec3x8, Vec3x8) {
        let vectors = |of: fn(&Self) -> Vec3| Vec3x8::new(discs.map(of));
        let numbers = |of: fn(&Self) -> f32| f32x8::new(discs.map(of));
        let (normal, along) = (vectors(|disc| disc.normal), vectors(|disc| disc.bend.along));
        let (from, size) = (Vec3x8::new([place; 8]) - vectors(|disc| disc.centre), numbers(|disc| disc.radius));
        let height = from.dot(normal);
        let sideways = from - normal * height;
        let flat = from - sideways * (size / sideways.length().fast_max(size));
        let zero = f32x8::ZERO;
        let is_flat = along.x.simd_eq(zero) & along.y.simd_eq(zero) & along.z.simd_eq(zero);
        if is_flat.all() {
            return (flat, flat);
        }
        let first = numbers(|disc| disc.bend.curvatures[0]);
        let second = numbers(|disc| disc.bend.curvatures[1]);
        let rise = numbers(|disc| disc.bend.rise);
        let across = normal.cross(along);
        let (a0, b0, focus) = (from.dot(along), from.dot(across), f32x8::splat(FOCUS));
        let nearest =
            |height: f32x8| (a0 / (1.0 - height * first).fast_max(focus), b0 / (1.0 - height * second).fast_max(focus));
        let z = |a: f32x8, b: f32x8| rise + 0.5 * (first * a * a + second * b * b);
        let (a, b) = nearest(height);
        let (a, b) = nearest(height - z(a, b));
        let way = |a, b| from - along * a - across * b - normal * z(a, b);
        let off = (a * a + b * b).sqrt();
        let part = (1.0 - height * first) / f32x8::splat(SPREAD);
        let radius = size * part.fast_max(f32x8::splat(LEAST_PART)).fast_min(f32x8::ONE);
        let (on, within, straight) = (off.simd_le(radius), radius / off, way(a, b));
        let rim = way(within * a, within * b);
        let share = ((off - radius) / (BLEND * radius)).fast_min(f32x8::ONE);
        let share = share * share * (3.0 - 2.0 * share);
        let turned = straight * (1.0 - share) + rim * share;
        let bent = |past: Vec3x8| flat.where_or(is_flat, straight.where_or(on, past));
        (bent(rim), bent(turned))
    }
}

/// The radius, up to `radius` cells, at which a disc stands out by [`STAND_OUT`]. The surface bends
/// away by `more` than the disc, 1/voxel.
fn stood_out(more: f32, stride: i32, radius: f32) -> f32 {
    let most = stride as f32 * (2.0 * STAND_OUT / more.max(1e-9)).sqrt();
    if more > 0.0 { most.clamp(SMALLEST.min(radius), radius) } else { radius }
}

/// How far `x` is from where the other field would end the bone, cells. No disc may stand out over
/// that. The field that ends it at `x` is `field`, on an edge along `edge`.
pub(crate) fn to_edge(solid: &impl Solid, field: Field, base: IVec3, x: Vec3, edge: Vec3) -> f32 {
    let other = if field == Field::Cut { Field::Density } else { Field::Cut };
    let (step, along) = (edge.as_ivec3(), x.dot(edge));
    let cell = base + x.round().as_ivec3() + (along.floor() - along.round()) as i32 * step;
    let over = cubic([-1, 0, 1, 2].map(|n| solid.over(other, cell + n * step)), along - along.floor());
    if field == Field::Density {
        // The cut rises by so much a node, wherever.
        return (over * 1e-3).max(0.0);
    }
    if over > FAR_HU {
        return f32::MAX;
    }
    (over / slope(solid, other, cell).length().max(1.0)).max(0.0)
}

/// The densities around a place over the isovalue, HU, and where the middle one is seen from the
/// place.
struct Block {
    hu: [[[f32; 3]; 3]; 3],
    off: Vec3,
}

impl Block {
    fn read(solid: &impl Solid, field: Field, stride: i32, base: IVec3, x: Vec3) -> Self {
        // The nearest voxel, where only those count.
        let all = base.as_vec3() + x;
        let middle = stride as f32 * (all / stride as f32).round() - base.as_vec3();
        let centre = base + middle.as_ivec3();
        let clamp = if field == Field::Cut { f32::MAX } else { CLAMP_HU };
        let over = |i: usize, j: usize, k: usize| {
            let step = IVec3::new(i as i32, j as i32, k as i32) - 1;
            solid.over(field, centre + stride * step).clamp(-clamp, clamp)
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

/// The normal and curvature of the quadric that best fits the densities around a place. It is
/// `share` of the way from `cell` to the next voxel by `step`; weights as in [`Block::fitted`].
fn fitted_quadric(solid: &impl Solid, cell: IVec3, step: IVec3, share: f32, normal: Vec3) -> Option<(Vec3, Bend)> {
    let (u, v) = normal.any_orthonormal_pair();
    let (right, up) = (IVec3::new(step.y, step.z, step.x), IVec3::new(step.z, step.x, step.y));
    let (mut square, mut moment) = (SMatrix::<f32, 7, 7>::zeros(), SVector::<f32, 7>::zeros());
    let along = cubic_taps(share);
    for (n, (j, k)) in (-1..=1).flat_map(|j| (-1..=1).map(move |k| (j, k))).enumerate() {
        let side = [0.125, 0.75, 0.125];
        let w = side[n / 3] * side[n % 3];
        for (i, tap) in (-1..=2).zip(along) {
            let off = i * step + j * right + k * up;
            let d = off.as_vec3() - share * step.as_vec3();
            let (height, a, b) = (d.dot(normal), d.dot(u), d.dot(v));
            let w = w * tap * (1.0 - height * height).max(0.0);
            let over = solid.over(Field::Density, cell + solid.voxel() * off).clamp(-CLAMP_HU, CLAMP_HU);
            let terms = SVector::from([height, a, b, 0.5 * a * a, a * b, 0.5 * b * b, 1.0]);
            square.syger(w, &terms, &terms, 1.0);
            moment.axpy(-w * over, &terms, 1.0);
        }
    }
    for n in 3..6 {
        square[(n, n)] += RIDGE;
    }
    let found = square.cholesky()?.solve(&moment);
    let rise = found[0] * normal + found[1] * u + found[2] * v;
    let size = rise.length();
    let across = (rise / size).try_normalize().filter(|across| across.dot(normal) > SAME)?;
    Some((across, Bend::of(u, v, [3, 4, 5].map(|n| -found[n] / size)).in_plane_of(across)))
}

/// Weights of the four taps of a cubic B-spline, `t` from the second to the third.
fn cubic_taps(t: f32) -> [f32; 4] {
    let s = 1.0 - t;
    let middle = |t: f32| (4.0 + t * t * (3.0 * t - 6.0)) / 6.0;
    [s * s * s / 6.0, middle(t), middle(s), t * t * t / 6.0]
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

    /// How the surface bends whose unit normal is `normal`, where the density falls by `size`.
    fn bend(&self, normal: Vec3, size: f32) -> Bend {
        let (u, v) = normal.any_orthonormal_pair();
        let times = |v: Vec3| times(self.straight, self.mixed, v) / size;
        Bend::of(u, v, [u.dot(times(u)), u.dot(times(v)), v.dot(times(v))])
    }
}

/// Weight, slope and bending of the three taps of a quadratic B-spline, `f` off the middle one.
fn taps(f: f32) -> [[f32; 3]; 3] {
    let (below, above) = (0.5 - f, 0.5 + f);
    [[0.5 * below * below, -below, 1.0], [0.75 - f * f, -2.0 * f, -2.0], [0.5 * above * above, above, 1.0]]
}
