//! Arrays that threads share between rounds of work without a lock.
//!
//! # Theory
//! Each number is written by one thread in a round and read by others in later rounds. The counters
//! that begin and end a round order these accesses, so the numbers themselves use relaxed loads and
//! stores, as fast as plain memory.

use glam::Vec4;
use std::sync::atomic::{AtomicU32, AtomicU64, Ordering::Relaxed};
use trepan_soft::simd::Quad;

/// Array of rows of four numbers.
pub(crate) struct Field(Vec<[AtomicU64; 2]>);

/// Array of single numbers.
pub(crate) struct Scalars(Vec<AtomicU32>);

impl Field {
    pub fn zeroed(len: usize) -> Self {
        Self((0..len).map(|_| Default::default()).collect())
    }

    pub fn len(&self) -> usize {
        self.0.len()
    }

    #[inline(always)]
    pub fn get(&self, at: usize) -> Quad {
        let [a, b] = &self.0[at];
        bytemuck::cast([a.load(Relaxed), b.load(Relaxed)])
    }

    #[inline(always)]
    pub fn set(&self, at: usize, row: Quad) {
        let ([a, b], [x, y]) = (&self.0[at], bytemuck::cast::<Quad, [u64; 2]>(row));
        a.store(x, Relaxed);
        b.store(y, Relaxed);
    }

    #[inline(always)]
    pub fn vector(&self, at: usize) -> Vec4 {
        Vec4::from_array(self.get(at))
    }
}

impl Scalars {
    pub fn of(values: &[f32]) -> Self {
        Self(values.iter().map(|value| AtomicU32::new(value.to_bits())).collect())
    }

    pub fn len(&self) -> usize {
        self.0.len()
    }

    pub fn zeroed(len: usize) -> Self {
        Self((0..len).map(|_| AtomicU32::default()).collect())
    }

    #[inline(always)]
    pub fn get(&self, at: usize) -> f32 {
        f32::from_bits(self.0[at].load(Relaxed))
    }

    #[inline(always)]
    pub fn set(&self, at: usize, value: f32) {
        self.0[at].store(value.to_bits(), Relaxed);
    }
}
