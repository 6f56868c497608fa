//! The nodes that a burr's ball reaches, and what the bone among them costs.
//!
//! # Practice
//! Lengths are nodes, seen from where the ball starts. Eight nodes of a row are looked at and
//! changed together; sums run in eight lanes.

use crate::eight::Vec3x8;
use crate::rows::each;
use crate::window::wide;
use glam::IVec3;
use trepan_bone::{CUT_STEPS, CUT_SURFACE};
use trepan_geometry::Vec3;
use wide::{f32x8, i16x8};

/// How far from its surface the cut is kept, nodes: as far as its splines reach.
pub(crate) const BAND: f32 = 2.1;
/// Nodes further from the cut's surface than this weigh little in its splines, and follow it with a
/// lag of at most [`LAG`], nodes.
const NEAR: f32 = 1.1;
/// See [`NEAR`].
const LAG: f32 = 0.007;
/// How far behind its start a burr still cuts, nodes: none of it but what rounding leaves.
const BEHIND: f32 = -1.5;
/// Nodes that are looked at together.
pub(crate) const LANES: usize = 8;

/// The part of a shaft that cuts, from the burr's centre both ways.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Side {
    pub axis: Vec3,
    /// Half its length, nodes.
    pub half: f32,
}

impl Side {
    pub fn of(half: Vec3) -> Self {
        Self { axis: half.normalize_or_zero(), half: half.length() }
    }

    /// `off`, from the centre, seen from the nearest point of the side.
    #[inline]
    pub fn nearest(&self, off: Vec3) -> Vec3 {
        off - off.dot(self.axis).max(-self.half).min(self.half) * self.axis
    }
}

/// A ball, or a shaft of that radius, that goes forward.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sweep {
    /// Where it starts.
    pub centre: Vec3,
    pub side: Side,
    /// Unit vector.
    pub forward: Vec3,
    pub radius: f32,
}

impl Sweep {
    /// Calls `visit` with each eight nodes of a row, by the first of them, brick by brick. They are
    /// ahead, up to `beyond` the radius from the start, and not all nearer than `hollow`.
    #[inline]
    pub fn eights(&self, hollow: f32, beyond: f32, mut visit: impl FnMut(IVec3, Place)) {
        let Self { centre, side, forward, radius } = *self;
        let reach = radius + beyond + side.half;
        let (outer, inner) = (reach * reach, hollow.max(0.0).powi(2));
        // What lies behind needs no look.
        let behind = BEHIND - side.half;
        let edge = LANES as i32;
        let of = |node: Vec3| node.floor().as_ivec3().div_euclid(IVec3::splat(edge));
        each(of(centre - reach), of(centre + reach) + 1, |brick| {
            let start = edge * brick;
            let first = start.as_vec3() - centre;
            let last = first + (edge - 1) as f32;
            let (near, far) = (first.max(-last).max(Vec3::ZERO), last.max(-first));
            let ahead = (first * forward).max(last * forward);
            if near.length_squared() > outer || far.length_squared() < inner || ahead.element_sum() < behind {
                return;
            }
            let (x, y) = (first.x + LANE, first.y + LANE);
            let (apart, along) = (x * x, x * forward.x);
            for k in 0..edge {
                let z = first.z + k as f32;
                let (across, rest) = (y * y + z * z, y * forward.y + z * forward.z);
                let meets = across.simd_le(f32x8::splat(outer - near.x * near.x))
                    & across.simd_ge(f32x8::splat(inner - far.x * far.x))
                    & rest.simd_ge(f32x8::splat(behind - ahead.x));
                for j in lanes(meets.to_bitmask()) {
                    let node = start + IVec3::new(0, j as i32, k);
                    let place = if side.half == 0.0 {
                        Place { apart: apart + across.as_array()[j], along: along + rest.as_array()[j] }
                    } else {
                        self.beside(node)
                    };
                    visit(node, place);
                }
            }
        });
    }

    /// Where the eight nodes from `node` on lie to a shaft.
    #[inline(never)]
    fn beside(&self, node: IVec3) -> Place {
        let Self { centre, side, forward, .. } = self;
        let off: [Vec3; LANES] =
            core::array::from_fn(|n| side.nearest((node + n as i32 * IVec3::X).as_vec3() - centre));
        let of = |each: fn(&Vec3, Vec3) -> f32| f32x8::new(off.each_ref().map(|off| each(off, *forward)));
        Place { along: of(|off, forward| off.dot(forward)), apart: of(|off, _| off.length_squared()) }
    }

    /// One bit for each of eight nodes that may lose bone when it goes `most`.
    #[inline]
    pub fn takes(&self, place: &Place, before: f32x8, most: f32) -> u32 {
        // It loses some if the ball gets nearer than this, nodes.
        let nearest = (self.radius - before).fast_min(f32x8::splat(self.radius + 0.5)).fast_max(f32x8::ZERO);
        let taken = place.apart_after(most).simd_lt(nearest * nearest);
        (taken & place.ahead() & covered(before, self.radius).simd_lt(f32x8::ONE)).to_bitmask()
    }

    /// Cosine of the angle between a node's way from the start and the `rise` of the density there.
    /// Of eight nodes from `node` on; `sizes` are those of the ways and rises.
    #[inline]
    pub fn cosine(&self, node: IVec3, rise: Vec3x8, sizes: (f32x8, f32x8)) -> f32x8 {
        let off = node.as_vec3() - self.centre;
        let ahead = rise.x * (LANE + off.x) + rise.y * off.y + rise.z * off.z;
        let Vec3 { x, y, z } = self.side.axis;
        let half = f32x8::splat(self.side.half);
        let beside = ((LANE + off.x) * x + off.y * y + off.z * z).fast_max(-half).fast_min(half);
        let ahead = ahead - beside * (rise.x * x + rise.y * y + rise.z * z);
        let cosine = ahead / (sizes.0 * sizes.1).fast_max(f32x8::splat(1e-3));
        cosine.fast_max(-f32x8::ONE).fast_min(f32x8::ONE)
    }

    /// The values of eight nodes of the cut, which `was`, when it has gone `way`, and which of them
    /// have changed.
    #[inline]
    pub fn cut(&self, place: &Place, was: i16x8, way: f32) -> (i16x8, i16x8) {
        let depth = place.depth(self.radius, way);
        let value = depth.fast_min(f32x8::splat(BAND)) * CUT_STEPS + f32::from(CUT_SURFACE);
        let value = value & depth.simd_gt(f32x8::splat(-BAND)) & place.ahead();
        let is = i16x8::from_i32x8_saturate(value.fast_round_int());
        let far = (was - CUT_SURFACE).abs().simd_gt(i16x8::splat((NEAR * CUT_STEPS) as i16));
        (is, is.simd_gt(was + (far & i16x8::splat((LAG * CUT_STEPS) as i16))))
    }
}

/// Where eight nodes lie to the burr.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Place {
    /// Square of their distance from the burr's start, nodes².
    pub apart: f32x8,
    /// How far they lie along the way, nodes.
    pub along: f32x8,
}

impl Place {
    /// Square of their distance from the burr's centre on a way of `way`, nodes².
    #[inline]
    fn apart_after(self, way: f32) -> f32x8 {
        let passed = self.along.fast_max(f32x8::ZERO).fast_min(f32x8::splat(way.max(0.0)));
        (self.apart + passed * (passed - 2.0 * self.along)).fast_max(f32x8::ZERO)
    }

    /// Those that are not behind.
    #[inline]
    fn ahead(&self) -> f32x8 {
        self.along.simd_ge(f32x8::splat(BEHIND))
    }

    /// How deep they lie in a ball of `radius` that has gone `way`, nodes. One that has gone less
    /// than nothing has not left and is so much smaller.
    #[inline]
    fn depth(self, radius: f32, way: f32) -> f32x8 {
        f32x8::splat(radius + way.min(0.0)) - self.apart_after(way).sqrt()
    }
}

/// 0 to 7.
pub(crate) const LANE: f32x8 = f32x8::new([0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0]);

/// How deep eight nodes of the cut lie in it, nodes.
#[inline]
pub(crate) fn depths(values: &[i16; LANES]) -> f32x8 {
    (wide(values) - f32::from(CUT_SURFACE)) * (1.0 / CUT_STEPS)
}

/// The lanes of which a bit is set.
#[inline]
pub(crate) fn lanes(mut bits: u32) -> impl Iterator<Item = usize> {
    core::iter::from_fn(move || {
        let lane = bits.trailing_zeros() as usize;
        bits &= bits.wrapping_sub(1);
        (lane < LANES).then_some(lane)
    })
}

/// Eight nodes of which the CT's surface leaves a part to the bone.
///
/// The surface and the burr's meet under an angle, so a burr that covers `e` of a node takes
/// ```text
/// (1 - |c|) d e + max(c, 0) max(d + e - 1, 0) + max(-c, 0) min(d, e)        c: its cosine
/// ```
/// of it: d e is exact where they cross at right angles, the others where they are parallel.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CrossedDistances {
    /// How much of a node is bone, d.
    pub share: f32x8,
    /// Cosine of the angle between the two normals, c.
    pub cosine: f32x8,
}

impl CrossedDistances {
    /// How much of each node a burr takes that covers so much of it.
    #[inline]
    pub fn taken(&self, covered: f32x8) -> f32x8 {
        let Self { share, cosine } = *self;
        let least = (share + covered - 1.0).fast_max(f32x8::ZERO);
        let parallel = cosine.simd_gt(f32x8::ZERO).select(least, share.fast_min(covered));
        let across = share * covered;
        across + cosine.abs() * (parallel - across)
    }
}

/// Nodes of bone that the burr may take some of, eight by eight.
#[derive(Default)]
pub(crate) struct PayableNodes {
    along: Vec<f32>,
    apart: Vec<f32>,
    /// As in [`CrossedDistances`].
    share: Vec<f32>,
    cosine: Vec<f32>,
    /// How much of each node was taken before.
    gone: Vec<f32>,
    /// What a node of bone costs there.
    price: Vec<f32>,
}

/// Bone that a ball takes.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct RemovedBone {
    /// As if all of it had the reference density, node³.
    pub cost: f32,
    /// node³.
    pub volume: f32,
}

impl PayableNodes {
    pub fn with_capacity(limit: usize) -> Self {
        let room = || Vec::with_capacity(limit);
        Self { along: room(), apart: room(), share: room(), cosine: room(), gone: room(), price: room() }
    }

    pub fn clear(&mut self) {
        self.all().into_iter().for_each(Vec::clear);
    }

    fn all(&mut self) -> [&mut Vec<f32>; 6] {
        let Self { along, apart, share, cosine, gone, price } = self;
        [along, apart, share, cosine, gone, price]
    }

    /// Adds the node in a lane, of which so much is `gone`.
    #[inline]
    pub fn push(&mut self, lane: usize, place: &Place, crossed: &CrossedDistances, gone: f32x8, price: f32) {
        let of = |all: f32x8| all.as_array()[lane];
        let values = [of(place.along), of(place.apart), of(crossed.share), of(crossed.cosine), of(gone), price];
        for (list, value) in self.all().into_iter().zip(values) {
            list.push(value);
        }
    }

    /// How many nodes there are.
    pub fn len(&self) -> usize {
        self.along.len()
    }

    /// Fills the last eight up with nodes that hold nothing.
    pub fn fill_up(&mut self) {
        let full = self.along.len().next_multiple_of(LANES);
        self.all().into_iter().for_each(|list| list.resize(full, 0.0));
    }

    /// The bone that a ball of `radius` takes on a way of `way`.
    pub fn taken(&self, radius: f32, way: f32) -> RemovedBone {
        let (mut costs, mut volumes) = (f32x8::ZERO, f32x8::ZERO);
        fn eights(list: &[f32]) -> impl Iterator<Item = &[f32; LANES]> {
            list.as_chunks().0.iter()
        }
        let places = eights(&self.along).zip(eights(&self.apart));
        let surfaces = eights(&self.share).zip(eights(&self.cosine));
        let costs_of = eights(&self.gone).zip(eights(&self.price));
        for (((along, apart), (share, cosine)), (gone, price)) in places.zip(surfaces).zip(costs_of) {
            let place = Place { along: f32x8::new(*along), apart: f32x8::new(*apart) };
            let crossed = CrossedDistances { share: f32x8::new(*share), cosine: f32x8::new(*cosine) };
            // As it will be stored.
            let depth = (place.depth(radius, way) * CUT_STEPS).round() * (1.0 / CUT_STEPS);
            let taken = crossed.taken(covered(depth, radius));
            let volume = (taken - f32x8::new(*gone)).fast_max(f32x8::ZERO);
            volumes += volume;
            costs += f32x8::new(*price) * volume;
        }
        RemovedBone { cost: costs.reduce_add(), volume: volumes.reduce_add() }
    }
}

/// How much of a node a burr of `radius` nodes covers when it lies so deep in the cut.
///
/// In a round hole that counts `π (R² + 1/12)` nodes² where there are `π R²`; a border that lies
/// `1/(24 R)` further out makes up for it.
#[inline]
pub(crate) fn covered(depth: f32x8, radius: f32) -> f32x8 {
    (0.5 - 1.0 / (24.0 * radius) + depth).fast_max(f32x8::ZERO).fast_min(f32x8::ONE)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn taken(share: f32, cosine: f32, covered: f32) -> f32 {
        let crossed = CrossedDistances { share: f32x8::splat(share), cosine: f32x8::splat(cosine) };
        crossed.taken(f32x8::splat(covered)).as_array()[3]
    }

    /// Halves of a node by two half-spaces: apart, crossed at a right angle, and the same. A node
    /// that one of them fills or leaves out is the other's, under any angle.
    #[test]
    fn what_is_taken_of_a_node_depends_on_the_angle_of_its_surfaces() {
        let is = |found: f32, wanted: f32| assert!((found - wanted).abs() < 1e-6, "{found} of {wanted}");
        for (cosine, wanted) in [(1.0, 0.0), (0.0, 0.25), (-1.0, 0.5)] {
            is(taken(0.5, cosine, 0.5), wanted);
        }
        for cosine in [-1.0, -0.4, 0.0, 0.7, 1.0] {
            for (share, covered, wanted) in [(1.0, 0.3, 0.3), (0.3, 1.0, 0.3), (0.0, 0.3, 0.0), (0.3, 0.0, 0.0)] {
                is(taken(share, cosine, covered), wanted);
            }
        }
    }
}
