//! The nodes that a burr's ball reaches, and what the bone among them costs.
//!
//! # Practice
//! Lengths are nodes, seen from where the ball starts. Eight nodes of a row are looked at together;
//! sums run in eight lanes.

use trepan_geometry::Vec3;
use trepan_volume::cut_depth;

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

/// Where a node lies to the burr.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Place {
    /// Square of its distance from the burr's start, nodes².
    pub apart: f32,
    /// How far it lies along the way, nodes.
    pub along: f32,
}

impl Place {
    /// Square of its distance from the burr's centre on a way of `way`, nodes².
    #[inline]
    pub fn apart_after(self, way: f32) -> f32 {
        let passed = self.along.max(0.0).min(way.max(0.0));
        (self.apart + passed * (passed - 2.0 * self.along)).max(0.0)
    }

    /// How deep it lies in a ball of `radius` that has gone `way`, nodes. One that has gone less
    /// than nothing has not left and is so much smaller.
    #[inline]
    pub fn depth(self, radius: f32, way: f32) -> f32 {
        radius + way.min(0.0) - self.apart_after(way).sqrt()
    }
}

/// Eight nodes of a row.
pub(crate) struct Eight {
    pub along: [f32; LANES],
    pub apart: [f32; LANES],
    pub value: [i16; LANES],
}

impl Eight {
    #[inline]
    pub fn of(each: impl Fn(i32) -> (f32, f32, i16)) -> Self {
        let mut all = Self { along: [0.0; LANES], apart: [0.0; LANES], value: [0; LANES] };
        for lane in 0..LANES {
            (all.along[lane], all.apart[lane], all.value[lane]) = each(lane as i32);
        }
        all
    }

    /// One bit for each node that a ball of `radius` changes when it goes `most`.
    #[inline]
    pub fn reached(&self, radius: f32, most: f32) -> u32 {
        let mut bytes = [0u8; LANES];
        for lane in 0..LANES {
            // It is reached if the ball gets nearer than this, nodes.
            let before = cut_depth(self.value[lane]);
            let lag = if before.abs() > NEAR { LAG } else { 0.0 };
            let most_apart = (radius - before - lag).min(radius + BAND).max(0.0);
            let apart = Place { along: self.along[lane], apart: self.apart[lane] }.apart_after(most);
            let hit = (self.along[lane] >= BEHIND) & (before < BAND) & (apart < most_apart * most_apart);
            bytes[lane] = u8::from(hit);
        }
        (u64::from_le_bytes(bytes).wrapping_mul(0x0102_0408_1020_4080) >> 56) as u32
    }
}

/// Nodes of bone that the burr may take some of, eight by eight.
#[derive(Default)]
pub(crate) struct Paid {
    pub along: Vec<f32>,
    pub apart: Vec<f32>,
    /// How much of each node is bone.
    pub share: Vec<f32>,
    /// What a node of bone costs there.
    pub price: Vec<f32>,
}

impl Paid {
    pub fn with_capacity(limit: usize) -> Self {
        let room = || Vec::with_capacity(limit);
        Self { along: room(), apart: room(), share: room(), price: room() }
    }

    pub fn clear(&mut self) {
        for each in [&mut self.along, &mut self.apart, &mut self.share, &mut self.price] {
            each.clear();
        }
    }

    pub fn push(&mut self, place: Place, share: f32, price: f32) {
        self.along.push(place.along);
        self.apart.push(place.apart);
        self.share.push(share);
        self.price.push(price);
    }

    /// What the bone costs that a ball of `radius` takes on a way of `way`, node³.
    pub fn cost(&self, radius: f32, way: f32) -> f32 {
        let one = |along: f32, apart: f32, share: f32, price: f32| {
            price * (share - outside(Place { along, apart }.depth(radius, way), radius)).max(0.0)
        };
        let mut sums = [0.0; LANES];
        let (along, rest) = self.along.as_chunks::<LANES>();
        let (apart, share, price) =
            (self.apart.as_chunks::<LANES>().0, self.share.as_chunks::<LANES>().0, self.price.as_chunks::<LANES>().0);
        for (((along, apart), share), price) in along.iter().zip(apart).zip(share).zip(price) {
            for lane in 0..LANES {
                sums[lane] += one(along[lane], apart[lane], share[lane], price[lane]);
            }
        }
        let last = self.along.len() - rest.len();
        let rest = (last..self.along.len()).map(|n| one(self.along[n], self.apart[n], self.share[n], self.price[n]));
        sums.iter().sum::<f32>() + rest.sum::<f32>()
    }
}

/// How much of a node is bone when it lies so deep in the cut of a burr of `radius` nodes.
///
/// In a round hole that counts `π (R² + 1/12)` nodes² where there are `π R²`; a border that lies
/// `1/(24 R)` further out makes up for it.
#[inline]
pub(crate) fn outside(depth: f32, radius: f32) -> f32 {
    (0.5 + 1.0 / (24.0 * radius) - depth).clamp(0.0, 1.0)
}
