//! Rays with what their walk through cells needs.

use glam::{IVec3, Vec3, Vec3A};

/// A ray o + t·d in padded grid coordinates, with precomputed values.
pub(crate) struct Line {
    pub o: Vec3A,
    pub d: Vec3A,
    pub inverse: Vec3A,
    /// 1 along the axes on which it ascends, else 0.
    pub ahead: Vec3A,
    /// 1 along these axes, else -1.
    pub side: Vec3A,
    pub step: IVec3,
    /// Octant of the direction: bit n is set where it ascends along axis n.
    pub octant: usize,
}

impl Line {
    #[inline(always)]
    pub fn of(o: Vec3, d: Vec3) -> Self {
        let d = Vec3A::from(d);
        let d = Vec3A::select(d.abs().cmplt(Vec3A::splat(1e-12)), Vec3A::splat(1e-12), d);
        let ahead = Vec3A::select(d.cmpgt(Vec3A::ZERO), Vec3A::ONE, Vec3A::ZERO);
        let side = ahead * 2.0 - 1.0;
        let octant = d.cmpgt(Vec3A::ZERO).bitmask() as usize;
        Self { o: o.into(), d, inverse: d.recip(), ahead, side, step: side.as_ivec3(), octant }
    }

    #[inline(always)]
    pub fn at(&self, t: f32) -> Vec3A {
        self.o + self.d * t
    }
}
