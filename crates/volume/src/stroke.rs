//! What bricks held before the last strokes: enough to undo them one by one, in memory that is
//! bounded and taken beforehand.
//!
//! # Theory
//! A brick is copied whole before its first change in a stroke; a stamp per brick says for which
//! stroke that has been done. Undoing exchanges brick and copy, newest stroke first; the same
//! exchange again takes it back. The copies of all strokes lie in one ring: where room runs out,
//! the oldest stroke is forgotten. One stroke that alone needs more room than there is cannot be
//! undone, nor can any before it.
//!
//! ```text
//! ring of copies   │ forgotten │ stroke 3 │ stroke 4 │ stroke 5, open │ free │
//! ```
//!
//! # Practice
//! Atomics without order: one thread writes, records and undoes. A copy is 1 kB and costs a quarter
//! of a microsecond.

use crate::bone::BRICK;
use std::sync::atomic::{AtomicBool, AtomicI16, AtomicU32, AtomicUsize, Ordering::Relaxed};

/// Voxels in a brick.
pub(crate) const BRICK_VOXELS: usize = BRICK * BRICK * BRICK;
/// Most bricks that are kept of all strokes: 4 MB, at half a millimetre a voxel 256 cm³.
pub const MAX_STROKE_BRICKS: usize = 4096;
/// Most strokes that are kept.
pub const MAX_STROKES: usize = 64;

/// What [`BoneVolume::undo_stroke`](crate::BoneVolume::undo_stroke) did.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Undone {
    /// So many bricks are as they were before the stroke.
    Bricks(usize),
    /// There is no stroke, or all have been undone already.
    Nothing,
    /// What was done before is kept no longer: over [`MAX_STROKES`] strokes, or over
    /// [`MAX_STROKE_BRICKS`] bricks.
    Forgotten,
}

/// The bricks before the last strokes.
#[derive(Debug)]
pub(crate) struct Strokes {
    /// Whether a stroke is under way.
    open: AtomicBool,
    /// Stamp of the newest stroke; 0 before the first.
    stamp: AtomicU32,
    /// The stroke in which each brick was copied last.
    stamps: Vec<AtomicU32>,
    /// Strokes from `oldest` up to before `next` are kept; their first copies, by number in the
    /// ring.
    starts: Vec<AtomicUsize>,
    oldest: AtomicUsize,
    next: AtomicUsize,
    /// Whether an older stroke was forgotten.
    forgot: AtomicBool,
    /// Copies made so far, less those of strokes that were undone.
    copied: AtomicUsize,
    bricks: Vec<AtomicU32>,
    copies: Vec<AtomicI16>,
}

impl Strokes {
    /// For a volume of so many bricks.
    pub fn new(bricks: usize) -> Self {
        let room = bricks.clamp(1, MAX_STROKE_BRICKS);
        Self {
            open: AtomicBool::new(false),
            stamp: AtomicU32::new(0),
            stamps: (0..bricks).map(|_| AtomicU32::new(0)).collect(),
            starts: (0..MAX_STROKES).map(|_| AtomicUsize::new(0)).collect(),
            oldest: AtomicUsize::new(0),
            next: AtomicUsize::new(0),
            forgot: AtomicBool::new(false),
            copied: AtomicUsize::new(0),
            bricks: (0..room).map(|_| AtomicU32::new(0)).collect(),
            copies: (0..room * BRICK_VOXELS).map(|_| AtomicI16::new(0)).collect(),
        }
    }

    /// A new stroke begins.
    pub fn begin(&self) {
        self.end();
        self.stamp.store(self.stamp.load(Relaxed).wrapping_add(1).max(1), Relaxed);
        if self.count() == MAX_STROKES {
            self.forget();
        }
        let next = self.next.fetch_add(1, Relaxed);
        self.starts[next % MAX_STROKES].store(self.copied.load(Relaxed), Relaxed);
        self.open.store(true, Relaxed);
    }

    /// The stroke is over: later changes belong to none. One that changed nothing is none.
    pub fn end(&self) {
        if self.open.swap(false, Relaxed) && self.length() == 0 {
            self.next.fetch_sub(1, Relaxed);
        }
    }

    /// Number of the newest stroke, from 1.
    pub fn number(&self) -> usize {
        self.next.load(Relaxed)
    }

    /// Strokes that are kept.
    pub fn count(&self) -> usize {
        self.next.load(Relaxed) - self.oldest.load(Relaxed)
    }

    /// Whether an older stroke was forgotten.
    pub fn forgot(&self) -> bool {
        self.forgot.load(Relaxed)
    }

    /// Bricks of the newest stroke; 0 without one.
    pub fn length(&self) -> usize {
        if self.count() == 0 { 0 } else { self.copied.load(Relaxed) - self.start(self.next.load(Relaxed) - 1) }
    }

    fn start(&self, stroke: usize) -> usize {
        self.starts[stroke % MAX_STROKES].load(Relaxed)
    }

    /// Forgets the oldest stroke.
    fn forget(&self) {
        self.forgot.store(true, Relaxed);
        self.oldest.fetch_add(1, Relaxed);
    }

    /// Whether `brick` must be kept before it changes; true once in a stroke.
    #[inline]
    pub fn is_first(&self, brick: usize) -> bool {
        let stamp = self.stamp.load(Relaxed);
        self.open.load(Relaxed) && self.stamps[brick].swap(stamp, Relaxed) != stamp
    }

    /// Keeps the densities of `brick`, voxel by voxel.
    pub fn keep(&self, brick: usize, density: impl Fn(usize) -> i16) {
        let (room, copied) = (self.bricks.len(), self.copied.load(Relaxed));
        while self.count() > 0 && copied - self.start(self.oldest.load(Relaxed)) >= room {
            self.forget();
        }
        if self.count() == 0 {
            // The stroke at hand was the last that could make room.
            self.open.store(false, Relaxed);
            return;
        }
        self.copied.store(copied + 1, Relaxed);
        self.bricks[copied % room].store(brick as u32, Relaxed);
        for (voxel, copy) in self.copy(copied % room).iter().enumerate() {
            copy.store(density(voxel), Relaxed);
        }
    }

    fn copy(&self, slot: usize) -> &[AtomicI16] {
        &self.copies[slot * BRICK_VOXELS..][..BRICK_VOXELS]
    }

    /// The `n`th brick of the newest stroke, and what is kept of it, voxel by voxel; `None` from
    /// [`length`](Self::length) on.
    pub fn kept(&self, n: usize) -> Option<(usize, &[AtomicI16])> {
        let length = self.length();
        let slot = || (self.copied.load(Relaxed) - length + n) % self.bricks.len();
        (n < length).then(|| (self.bricks[slot()].load(Relaxed) as usize, self.copy(slot())))
    }

    /// Lets the newest stroke go: it has been undone.
    pub fn drop_newest(&self) {
        if self.count() > 0 {
            self.copied.fetch_sub(self.length(), Relaxed);
            self.next.fetch_sub(1, Relaxed);
            self.open.store(false, Relaxed);
        }
    }
}
