//! The nodes that a burr's ball reaches, and what the bone among them costs.
//!
//! # Practice
//! Lengths are nodes, seen from where the ball starts. Eight nodes of a row are looked at and
//! changed together; sums run in eight lanes.

use glam::IVec3;
use trepan_geometry::Vec3;
use trepan_volume::{CUT_STEPS, CUT_SURFACE};
use wide::{f32x8, i16x8, i32x8};

/// How far from its surface the cut is kept, nodes: as far as its splines reach.
pub(crate) const BAND: f32 = 2.1;
/// Nodes further from the cut's surface than this weigh little in its splines, and follow it with a
/// lag of at most [`LAG`], nodes.
const NEAR: f32 = 1.1;
/// See [`NEAR`].
const LAG: f32 = 0.02;
/// How far behind its start a burr still cuts, nodes: none of it but what rounding leaves.
pub(crate) const BEHIND: f32 = -1.5;
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

/// The rows of nodes along x that the front half of a ball meets.
pub(crate) struct FrontRows {
    pub centre: Vec3,
    pub forward: Vec3,
    /// How much further back it begins.
    pub long: f32,
    pub radius: f32,
    /// Radius of the part of it that is not looked at.
    pub hollow: f32,
}

impl FrontRows {
    /// Calls `visit` with the first node and the last x of each row, and the first and last x of
    /// what is hollow in it. Rows may be a node longer at both ends than they need to be.
    pub fn each(&self, mut visit: impl FnMut(IVec3, i32, (i32, i32))) {
        let Self { centre, forward, long, radius, hollow } = *self;
        let (low, high) = ((centre - radius).floor().as_ivec3(), (centre + radius).ceil().as_ivec3());
        let half = |square: f32, across: f32x8| (square - across).fast_max(f32x8::ZERO).sqrt();
        let whole = |x: f32x8| (centre.x + x).fast_round_int().to_array();
        for k in low.z..=high.z {
            let z = k as f32 - centre.z;
            for j in (low.y..=high.y).step_by(LANES) {
                let y = j as f32 - centre.y + LANE;
                let across = y * y + z * z;
                let (outer, inner) = (half(radius * radius, across), half(hollow.max(0.0).powi(2), across));
                // What lies behind needs no look.
                let behind = BEHIND - long - (y * forward.y + z * forward.z);
                let (mut from, mut to) = (-outer, outer);
                if forward.x > 1e-3 {
                    from = from.fast_max(behind / forward.x);
                } else if forward.x < -1e-3 {
                    to = to.fast_min(behind / forward.x);
                } else {
                    to = behind.simd_gt(f32x8::splat(1.0)).bitselect(from - 2.0, to);
                }
                let [from, to, hole_from, hole_to] = [from - 0.5, to + 0.5, 0.5 - inner, inner - 0.5].map(whole);
                let meets = across.simd_lt(f32x8::splat(radius * radius)).to_bitmask();
                for lane in lanes(meets).filter(|lane| from[*lane] <= to[*lane]) {
                    let start = IVec3::new(from[lane], j + lane as i32, k);
                    visit(start, to[lane], (hole_from[lane], hole_to[lane]));
                }
            }
        }
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

    /// How deep they lie in a ball of `radius` that has gone `way`, nodes. One that has gone less
    /// than nothing has not left and is so much smaller.
    #[inline]
    fn depth(self, radius: f32, way: f32) -> f32x8 {
        f32x8::splat(radius + way.min(0.0)) - self.apart_after(way).sqrt()
    }
}

/// Eight nodes of a row, the first at a multiple of eight: one load, and never in two bricks.
pub(crate) struct Eight {
    /// The first.
    pub node: IVec3,
    /// One bit for each that counts.
    pub hits: u32,
    pub place: Place,
    /// What the cut was there, steps of [`CUT_STEPS`] a node.
    value: f32x8,
}

/// 0 to 7.
pub(crate) const LANE: f32x8 = f32x8::new([0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0]);

impl Eight {
    /// The nodes from `node` on, none of which counts yet.
    #[inline]
    pub fn of(node: IVec3, value: [i16; LANES], place: Place) -> Self {
        let value = f32x8::from_i32x8(i32x8::from_i16x8(i16x8::new(value)));
        Self { node, hits: 0, place, value }
    }

    /// How deep they lay in the cut, nodes.
    #[inline]
    fn before(&self) -> f32x8 {
        (self.value - f32::from(CUT_SURFACE)) * (1.0 / CUT_STEPS)
    }

    /// One bit for each node of `which` that a ball of `radius` changes when it goes `most`.
    #[inline]
    pub fn reached(&self, which: u32, radius: f32, most: f32) -> u32 {
        // It is reached if the ball gets nearer than this, nodes.
        let before = self.before();
        let lag = before.abs().simd_gt(f32x8::splat(NEAR)) & f32x8::splat(LAG);
        let most_apart = (radius - before - lag).fast_min(f32x8::splat(radius + BAND)).fast_max(f32x8::ZERO);
        let reached = self.place.apart_after(most).simd_lt(most_apart * most_apart);
        let ahead = self.place.along.simd_ge(f32x8::splat(BEHIND));
        which & (reached & ahead & before.simd_lt(f32x8::splat(BAND))).to_bitmask()
    }

    /// How much of each is outside the cut, and one bit for each hit that may lose bone.
    /// The ball of `radius` goes `most`.
    #[inline]
    pub fn paid(&self, radius: f32, most: f32) -> (f32x8, u32) {
        let (share, edge) = (outside(self.before(), radius), f32x8::splat((radius + 0.5) * (radius + 0.5)));
        let taken = share.simd_gt(f32x8::ZERO) & self.place.apart_after(most).simd_lt(edge);
        (share, self.hits & taken.to_bitmask())
    }

    /// The values when a ball of `radius` has gone `way`, and one bit for each hit that it changes.
    #[inline]
    pub fn cut(&self, radius: f32, way: f32) -> ([i16; LANES], u32) {
        let depth = self.place.depth(radius, way).fast_max(f32x8::splat(-BAND)).fast_min(f32x8::splat(BAND));
        let value = (depth * CUT_STEPS + f32::from(CUT_SURFACE)).fast_round_int();
        let changed = f32x8::from_i32x8(value).simd_gt(self.value);
        (value.to_array().map(|value| value as i16), self.hits & changed.to_bitmask())
    }

    /// Whether a node was outside the cut.
    pub fn was_outside(&self, lane: usize) -> bool {
        self.value.as_array()[lane] < f32::from(CUT_SURFACE)
    }
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

/// Nodes of bone that the burr may take some of, eight by eight.
#[derive(Default)]
pub(crate) struct Paid {
    along: Vec<f32>,
    apart: Vec<f32>,
    /// How much of each node is bone.
    share: Vec<f32>,
    /// What a node of bone costs there.
    price: Vec<f32>,
}

/// Bone that a ball takes.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Taken {
    /// As if all of it had the reference density, node³.
    pub cost: f32,
    /// node³.
    pub volume: f32,
}

impl Paid {
    pub fn with_capacity(limit: usize) -> Self {
        let room = || Vec::with_capacity(limit);
        Self { along: room(), apart: room(), share: room(), price: room() }
    }

    pub fn clear(&mut self) {
        self.all().into_iter().for_each(Vec::clear);
    }

    fn all(&mut self) -> [&mut Vec<f32>; 4] {
        [&mut self.along, &mut self.apart, &mut self.share, &mut self.price]
    }

    /// Adds the node in a lane of `place` of which `share` is bone.
    pub fn push(&mut self, place: &Place, lane: usize, share: f32, price: f32) {
        let (along, apart) = (place.along.as_array()[lane], place.apart.as_array()[lane]);
        for (list, value) in self.all().into_iter().zip([along, apart, share, price]) {
            list.push(value);
        }
    }

    /// Fills the last eight up with nodes that hold nothing.
    pub fn fill_up(&mut self) {
        let full = self.along.len().next_multiple_of(LANES);
        self.all().into_iter().for_each(|list| list.resize(full, 0.0));
    }

    /// The bone that a ball of `radius` takes on a way of `way`.
    pub fn taken(&self, radius: f32, way: f32) -> Taken {
        let (mut costs, mut volumes) = (f32x8::ZERO, f32x8::ZERO);
        fn eights(list: &[f32]) -> impl Iterator<Item = &[f32; LANES]> {
            list.as_chunks().0.iter()
        }
        let places = eights(&self.along).zip(eights(&self.apart));
        for ((along, apart), (share, price)) in places.zip(eights(&self.share).zip(eights(&self.price))) {
            let place = Place { along: f32x8::new(*along), apart: f32x8::new(*apart) };
            let after = outside(place.depth(radius, way), radius);
            let volume = (f32x8::new(*share) - after).fast_max(f32x8::ZERO);
            volumes += volume;
            costs += f32x8::new(*price) * volume;
        }
        Taken { cost: costs.reduce_add(), volume: volumes.reduce_add() }
    }
}

/// How much of a node is bone when it lies so deep in the cut of a burr of `radius` nodes.
///
/// In a round hole that counts `π (R² + 1/12)` nodes² where there are `π R²`; a border that lies
/// `1/(24 R)` further out makes up for it.
#[inline]
pub(crate) fn outside(depth: f32x8, radius: f32) -> f32x8 {
    (0.5 + 1.0 / (24.0 * radius) - depth).fast_max(f32x8::ZERO).fast_min(f32x8::ONE)
}
