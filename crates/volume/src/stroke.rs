//! What bricks held before the last stroke: enough to undo it, in memory that is bounded and taken beforehand.
//!
//! # Theory
//! A brick is copied whole before its first change in a stroke; a stamp per brick says for which stroke that has been done. Undoing is
//! copying back. A stroke that changes more bricks than there is room for cannot be undone, and says so.
//!
//! # Practice
//! Atomics without order: one thread writes, records and undoes. A copy is 1 kB and costs a quarter of a microsecond.

use crate::bone::BRICK;
use std::sync::atomic::{AtomicI16, AtomicU32, AtomicUsize, Ordering::Relaxed};

/// Voxels in a brick.
pub(crate) const BRICK_VOXELS: usize = BRICK * BRICK * BRICK;
/// Most bricks that a stroke may change: 2 MB, at half a millimetre a voxel 128 cm³.
pub const MAX_STROKE_BRICKS: usize = 2048;

/// What [`BoneVolume::undo_stroke`](crate::BoneVolume::undo_stroke) did.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Undone {
    /// So many bricks are as they were before the stroke.
    Bricks(usize),
    /// There is no stroke, or it has been undone already.
    Nothing,
    /// The stroke changed more than [`MAX_STROKE_BRICKS`] bricks; nothing was undone.
    TooLong,
}

/// The bricks before the last stroke.
#[derive(Debug)]
pub(crate) struct Stroke {
    /// Number of the stroke; 0 before the first.
    number: AtomicU32,
    /// The stroke in which each brick was copied last.
    stamps: Vec<AtomicU32>,
    /// Bricks copied, and those for which there was no room.
    count: AtomicUsize,
    bricks: Vec<AtomicU32>,
    copies: Vec<AtomicI16>,
}

impl Stroke {
    /// For a volume of so many bricks.
    pub fn new(bricks: usize) -> Self {
        let room = bricks.min(MAX_STROKE_BRICKS);
        Self {
            number: AtomicU32::new(0),
            stamps: (0..bricks).map(|_| AtomicU32::new(0)).collect(),
            count: AtomicUsize::new(0),
            bricks: (0..room).map(|_| AtomicU32::new(0)).collect(),
            copies: (0..room * BRICK_VOXELS).map(|_| AtomicI16::new(0)).collect(),
        }
    }

    /// A new stroke: the one before cannot be undone any more.
    pub fn begin(&self) {
        self.number.store(self.number.load(Relaxed).wrapping_add(1).max(1), Relaxed);
        self.count.store(0, Relaxed);
    }

    /// Whether `brick` must be kept before it changes; true once in a stroke.
    #[inline]
    pub fn is_first(&self, brick: usize) -> bool {
        let number = self.number.load(Relaxed);
        self.stamps[brick].swap(number, Relaxed) != number
    }

    /// Keeps the densities of `brick`, voxel by voxel.
    pub fn keep(&self, brick: usize, density: impl Fn(usize) -> i16) {
        let at = self.count.fetch_add(1, Relaxed);
        if let Some(slot) = self.bricks.get(at) {
            slot.store(brick as u32, Relaxed);
            for (voxel, copy) in self.copies[at * BRICK_VOXELS..][..BRICK_VOXELS].iter().enumerate() {
                copy.store(density(voxel), Relaxed);
            }
        }
    }

    /// Gives each brick kept, and each of its voxels with the density of before, to `restore`, and forgets them.
    pub fn undo(&self, mut restore: impl FnMut(usize, usize, i16)) -> Undone {
        let count = self.count.load(Relaxed);
        if count > self.bricks.len() {
            return Undone::TooLong;
        }
        self.count.store(0, Relaxed);
        for at in 0..count {
            let brick = self.bricks[at].load(Relaxed) as usize;
            for (voxel, copy) in self.copies[at * BRICK_VOXELS..][..BRICK_VOXELS].iter().enumerate() {
                restore(brick, voxel, copy.load(Relaxed));
            }
        }
        if count == 0 { Undone::Nothing } else { Undone::Bricks(count) }
    }
}
