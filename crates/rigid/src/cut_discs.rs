//! Discs on the cut, eight at once: where edges leave the bone, and how the cut bends there.
//!
//! # Theory
//! The same as one by one: [`crossing`] and [`Disc::of`], but for rounding.
//!
//! # Practice
//! Eight crossings take 100 ns, eight shapes 300 ns. What is rare is done one by one: where the cut
//! runs along an edge or is not smooth, and where the density ends nearby.

use crate::disc::{Bend, CUT_DISC, Disc, MAX_CURVATURE, SMALLEST, STAND_OUT};
use crate::eight::Vec3x8;
use crate::solid::{Field, Fine, STEEP, end_of_bone};
use glam::IVec3;
use trepan_geometry::Vec3;
use wide::f32x8;

/// Edges that are handled together.
pub(crate) const EDGES: usize = 8;

/// A grid edge out of the bone.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Way {
    /// The node of bone.
    pub from: IVec3,
    /// To its neighbour.
    pub step: IVec3,
}

/// Where eight edges leave the bone.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ends {
    /// Share of the edge that is bone.
    pub share: [f32; EDGES],
    /// A bit for each that ends at the cut; the others end at the CT's surface.
    pub by_cut: u32,
}

/// Where each edge leaves the bone, as [`crossing`](crate::solid::crossing) finds it.
pub(crate) fn ends(fine: &Fine, ways: &[Way; EDGES]) -> Ends {
    let (mut cut, mut density) = ([[0i16; EDGES]; 4], [[0i16; EDGES]; 2]);
    for (lane, Way { from, step }) in ways.iter().enumerate() {
        for (n, values) in (-1..).zip(&mut cut) {
            values[lane] = fine.cut.at(from + n * step);
        }
        for (n, values) in (0..).zip(&mut density) {
            values[lane] = fine.density.at(from + n * step);
        }
    }
    let [here, after] = density.map(|values| fine.density.scaled_eight(&values));
    let by_density = after.simd_ge(f32x8::ZERO).select(f32x8::ONE, here / (here - after));
    let [a, b, c, d] = cut.map(|values| fine.cut.scaled_eight(&values));
    // Newton's steps on the cubic, as in `end_of_bone`.
    let (one, two, three) = (0.5 * (c - a), 0.5 * (2.0 * a - 5.0 * b + 4.0 * c - d), 0.5 * (3.0 * (b - c) + d - a));
    let value = |t: f32x8| b + t * (one + t * (two + t * three));
    let slope = |t: f32x8| one + t * (2.0 * two + 3.0 * t * three);
    let line = b / (b - c);
    let near = line - value(line) / slope(line);
    let found = near - value(near) / slope(near);
    let steep = f32x8::splat(STEEP);
    let outside = c.simd_ge(f32x8::ZERO);
    let sound = slope(line).simd_lt(steep) & slope(near).simd_lt(steep);
    let sound = sound & found.simd_ge(f32x8::ZERO) & found.simd_le(f32x8::ONE);
    let mut by_cut = outside.select(f32x8::ONE, found);
    let hard = !(sound | outside).to_bitmask() & 0xFF;
    if hard != 0 {
        let [a, b, c, d] = [a, b, c, d].map(f32x8::to_array);
        let all = by_cut.as_mut_array();
        for lane in (0..EDGES).filter(|lane| hard >> lane & 1 == 1) {
            all[lane] = end_of_bone([a[lane], b[lane], c[lane], d[lane]]);
        }
    }
    let is_cut = by_cut.simd_le(by_density);
    Ends { share: is_cut.select(by_cut, by_density).to_array(), by_cut: is_cut.to_bitmask() & 0xFF }
}

/// The shapes of discs on the cut at `x`, nodes from `base`, as [`Disc::of`] finds them; at most
/// `radius` nodes.
pub(crate) fn shapes(fine: &Fine, base: IVec3, ways: &[Way; EDGES], x: &[Vec3; EDGES], radius: f32) -> [Disc; EDGES] {
    let mut values = [[[[0i16; EDGES]; 3]; 3]; 3];
    let (mut off, radius) = ([Vec3::ZERO; EDGES], CUT_DISC.min(radius));
    for (lane, x) in x.iter().enumerate() {
        let middle = (base.as_vec3() + x).round() - base.as_vec3();
        off[lane] = middle - *x;
        let block = fine.cut.block(base + middle.as_ivec3());
        for (to, from) in values.as_flattened_mut().as_flattened_mut().iter_mut().zip(block) {
            to[lane] = from;
        }
    }
    let [off, edge] = [Vec3x8::new(off), Vec3x8::new(ways.map(|way| way.step.as_vec3()))];
    let [tx, ty, tz] = [off.x, off.y, off.z].map(|off| taps(-off));
    let zero = Vec3x8::new([Vec3::ZERO; EDGES]);
    let (mut slope, mut straight, mut mixed) = (zero, zero, zero);
    for (layer, z) in values.iter().zip(tz) {
        for (row, y) in layer.iter().zip(ty) {
            let row = row.each_ref().map(|values| fine.cut.scaled_eight(values));
            let [even, steep, bent] = [0, 1, 2].map(|n| row[0] * tx[0][n] + row[1] * tx[1][n] + row[2] * tx[2][n]);
            let add = |to: &mut Vec3x8, x, y, z| *to = *to + Vec3x8 { x, y, z };
            add(&mut slope, steep * y[0] * z[0], even * y[1] * z[0], even * y[0] * z[1]);
            add(&mut straight, bent * y[0] * z[0], even * y[2] * z[0], even * y[0] * z[2]);
            add(&mut mixed, even * y[1] * z[1], steep * y[0] * z[1], steep * y[1] * z[0]);
        }
    }
    let size = slope.length();
    let least = size.fast_max(f32x8::splat(1e-9));
    let normal = slope * (-1.0 / least);
    let sound = size.simd_ge(f32x8::ONE) & normal.dot(edge).simd_ge(f32x8::splat(-0.5));
    let Curved { along, curvatures } = Curved::of(normal, straight * (1.0 / least), mixed * (1.0 / least));
    let most = f32x8::splat(MAX_CURVATURE);
    // What bends away more than a disc may stands out no further than this.
    let more = -curvatures[1] - most;
    let stands = (2.0 * STAND_OUT / more.fast_max(f32x8::splat(1e-9))).sqrt();
    let limit = f32x8::splat(radius);
    let stands = stands.fast_min(limit).fast_max(f32x8::splat(SMALLEST.min(radius)));
    let sizes = more.simd_gt(f32x8::ZERO).select(stands, limit).to_array();
    let curvatures = curvatures.map(|k| k.fast_max(-most).fast_min(most).to_array());
    let sound = sound.to_bitmask();
    core::array::from_fn(|lane| {
        let way = &ways[lane];
        if sound >> lane & 1 == 0 {
            return Disc::of(fine, base, (x[lane], Field::Cut), way.step.as_vec3(), radius);
        }
        let bend = Bend::new(along.lane(lane), curvatures.map(|k| k[lane]));
        Disc { centre: x[lane], normal: normal.lane(lane), radius: sizes[lane], bend, shaft: false }
    })
}

/// Weight, slope and bending of the three taps of a quadratic B-spline, `f` off the middle one.
fn taps(f: f32x8) -> [[f32x8; 3]; 3] {
    let (below, above, one) = (0.5 - f, 0.5 + f, f32x8::ONE);
    [
        [0.5 * below * below, -below, one],
        [0.75 - f * f, -2.0 * f, f32x8::splat(-2.0)],
        [0.5 * above * above, above, one],
    ]
}

/// How eight surfaces bend.
struct Curved {
    along: Vec3x8,
    curvatures: [f32x8; 2],
}

impl Curved {
    /// Of second derivatives `straight` xx, yy, zz and `mixed` yz, xz, xy, over those of the slope.
    fn of(normal: Vec3x8, straight: Vec3x8, mixed: Vec3x8) -> Self {
        // The pair of Duff et al. 2017, as in glam.
        let sign = normal.z.simd_ge(f32x8::ZERO).select(f32x8::ONE, -f32x8::ONE);
        let a = -1.0 / (sign + normal.z);
        let b = normal.x * normal.y * a;
        let u = Vec3x8 { x: 1.0 + sign * normal.x * normal.x * a, y: sign * b, z: -sign * normal.x };
        let v = Vec3x8 { x: b, y: sign + normal.y * normal.y * a, z: -normal.y };
        let times = |v: Vec3x8| Vec3x8 {
            x: straight.x * v.x + mixed.z * v.y + mixed.y * v.z,
            y: mixed.z * v.x + straight.y * v.y + mixed.x * v.z,
            z: mixed.y * v.x + mixed.x * v.y + straight.z * v.z,
        };
        let (tu, tv) = (times(u), times(v));
        let (uu, uv, vv) = (u.dot(tu), u.dot(tv), v.dot(tv));
        let (mean, half) = (0.5 * (uu + vv), 0.5 * (uu - vv));
        let root = (half * half + uv * uv).sqrt();
        let cosine = half / root.fast_max(f32x8::splat(1e-9));
        let cos = (0.5 + 0.5 * cosine).fast_max(f32x8::ZERO).sqrt();
        let sin = (0.5 - 0.5 * cosine).fast_max(f32x8::ZERO).sqrt();
        let sin = uv.simd_lt(f32x8::ZERO).select(-sin, sin);
        Self { along: u * cos + v * sin, curvatures: [mean + root, mean - root] }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::nodes::Nodes;
    use crate::solid::{Solid, crossing};
    use crate::surface::NEIGHBOURS;
    use trepan_bone::{BoneVolume, CUT_STEPS, CUT_SURFACE};
    use trepan_volume::VoxelVolume;

    /// Two balls cut from a slope of the CT, which ends some edges and discs.
    fn cut_bone() -> BoneVolume {
        let mut ct = VoxelVolume::isotropic([24; 3], Vec3::splat(-6.0), 0.5, 0i16);
        for at in 0..ct.data.len() {
            let place = ct.centre_of([at % 24, at / 24 % 24, at / 576]);
            ct.data[at] = (400.0 + 900.0 * (2.0 - place.z - 0.3 * place.x)).clamp(-1000.0, 1500.0) as i16;
        }
        let bone = BoneVolume::new(&ct, 400).unwrap();
        let mut writer = bone.cut_writer();
        for at in 0..24i32.pow(3) {
            let node = IVec3::new(at % 24, at / 24 % 24, at / 576);
            let of = |centre: Vec3, radius: f32| radius - node.as_vec3().distance(centre);
            let depth = of(Vec3::splat(11.3), 6.0).max(of(Vec3::new(15.1, 9.0, 12.7), 3.1)).clamp(-3.0, 3.0);
            if depth > -3.0 {
                writer.set(node, (f32::from(CUT_SURFACE) + CUT_STEPS * depth).round() as i16);
            }
        }
        drop(writer);
        bone
    }

    #[test]
    fn eight_at_once_are_as_one_by_one() {
        let (bone, mut nodes, base) = (cut_bone(), Nodes::new(3.0), IVec3::splat(12));
        nodes.cover(&bone, base, 14).unwrap();
        let fine = nodes.fine();
        let mut all = Vec::new();
        for at in 0..20i32.pow(3) {
            let from = 2 + IVec3::new(at % 20, at / 20 % 20, at / 400);
            let leaves = |step: &IVec3| fine.is_bone(from) && !fine.is_bone(from + *step);
            all.extend(NEIGHBOURS.into_iter().filter(leaves).map(|step| Way { from, step }));
        }
        let (mut cuts, mut bent) = (0, 0);
        for eight in all.as_chunks::<EDGES>().0 {
            let found = ends(&fine, eight);
            let one = eight.map(|way| crossing(&fine, base, way.from - base, way.step));
            let places = one.map(|(x, _)| x);
            let shaped = shapes(&fine, base, eight, &places, 0.8);
            for (lane, way) in eight.iter().enumerate() {
                let (x, field) = one[lane];
                let place = (way.from - base).as_vec3() + found.share[lane] * way.step.as_vec3();
                assert!(place.distance(x) < 1e-4, "{way:?}: {place} {x}");
                assert_eq!(found.by_cut >> lane & 1 == 1, field == Field::Cut, "{way:?}");
                if field == Field::Density {
                    continue;
                }
                cuts += 1;
                let (eight, one) = (shaped[lane], Disc::of(&fine, base, (x, field), way.step.as_vec3(), 0.8));
                assert!(eight.normal.distance(one.normal) < 1e-4, "{way:?}: {eight:?} {one:?}");
                assert!((eight.radius - one.radius).abs() < 1e-4, "{way:?}: {eight:?} {one:?}");
                for from in [one.normal, 0.4 * one.normal.any_orthonormal_vector() + one.normal] {
                    let (eight, one) = (eight.way_to(from).0, one.way_to(from).0);
                    assert!(eight.distance(one) < 1e-4, "{way:?}: {eight} {one}");
                    bent += usize::from(eight.distance(from) > 0.01);
                }
            }
        }
        assert!(cuts > 500 && bent > 100 && cuts < all.len(), "{cuts} {bent} of {}", all.len());
    }
}
