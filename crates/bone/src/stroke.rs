//! Copies of bricks before the last strokes, for undo in bounded, preallocated memory.
//!
//! # Theory
//! A brick is copied before its first change in a stroke; a stamp per brick records the stroke of
//! its last copy. Undoing swaps brick and copy, newest stroke first; a second swap reverts it. The
//! copies of all strokes are in one ring: when it is full, the oldest stroke is discarded. A stroke
//! that alone needs more room cannot be undone, nor can any before it.
//!
//! ```text
//! ring of copies   │ discarded │ stroke 3 │ stroke 4 │ stroke 5, open │ free │
//! ```
//!
//! # Practice
//! Relaxed atomics: one thread writes, records and undoes. A copy is 1 kB and costs a quarter of a
//! microsecond.

use std::sync::atomic::{AtomicBool, AtomicI16, AtomicU32, AtomicUsize, Ordering::Relaxed};

/// Edge of a brick in voxels.
pub const BRICK: usize = 8;
/// Voxels in a brick.
pub(crate) const BRICK_VOXELS: usize = BRICK * BRICK * BRICK;
/// Most bricks stored for all strokes: 4 MB; at half a millimetre a voxel 256 cm³.
pub const MAX_STROKE_BRICKS: usize = 4096;
/// Most strokes stored.
pub const MAX_STROKES: usize = 64;

/// Result of [`BoneVolume::undo_stroke`](crate::BoneVolume::undo_stroke).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Undone {
    /// This many bricks were restored.
    Bricks(usize),
    /// There is no stroke, or all have been undone.
    Nothing,
    /// The earlier state was discarded: over [`MAX_STROKES`] strokes or [`MAX_STROKE_BRICKS`]
    /// bricks.
    Forgotten,
}

/// The bricks before the last strokes.
#[derive(Debug)]
pub(crate) struct Strokes {
    /// Whether a stroke is in progress.
    open: AtomicBool,
    /// Stamp of the newest stroke; 0 before the first.
    stamp: AtomicU32,
    /// The stroke in which each brick was copied last.
    stamps: Vec<AtomicU32>,
    /// First copy in the ring of each stored stroke, `oldest` up to before `next`.
    starts: Vec<AtomicUsize>,
    oldest: AtomicUsize,
    next: AtomicUsize,
    /// End of the copies of each stroke that was undone.
    ends: Vec<AtomicUsize>,
    /// Number of strokes that were undone since the last stroke began.
    undone: AtomicUsize,
    /// Whether an older stroke was discarded.
    forgot: AtomicBool,
    /// Copies made so far, less those of undone strokes.
    copied: AtomicUsize,
    bricks: Vec<AtomicU32>,
    copies: Vec<AtomicI16>,
}

impl Strokes {
    /// Creates the buffers for a volume of this many bricks.
    pub fn new(bricks: usize) -> Self {
        let room = bricks.clamp(1, MAX_STROKE_BRICKS);
        Self {
            open: AtomicBool::new(false),
            stamp: AtomicU32::new(0),
            stamps: (0..bricks).map(|_| AtomicU32::new(0)).collect(),
            starts: (0..MAX_STROKES).map(|_| AtomicUsize::new(0)).collect(),
            oldest: AtomicUsize::new(0),
            next: AtomicUsize::new(0),
            ends: (0..MAX_STROKES).map(|_| AtomicUsize::new(0)).collect(),
            undone: AtomicUsize::new(0),
            forgot: AtomicBool::new(false),
            copied: AtomicUsize::new(0),
            bricks: (0..room).map(|_| AtomicU32::new(0)).collect(),
            copies: (0..room * BRICK_VOXELS).map(|_| AtomicI16::new(0)).collect(),
        }
    }

    /// Starts a new stroke; what was undone before cannot be redone from here on.
    pub fn begin(&self) {
        self.end();
        self.undone.store(0, Relaxed);
        self.stamp.store(self.stamp.load(Relaxed).wrapping_add(1).max(1), Relaxed);
        if self.count() == MAX_STROKES {
            self.forget();
        }
        let next = self.next.fetch_add(1, Relaxed);
        self.starts[next % MAX_STROKES].store(self.copied.load(Relaxed), Relaxed);
        self.open.store(true, Relaxed);
    }

    /// Ends the stroke: later changes belong to none. A stroke without changes is dropped.
    pub fn end(&self) {
        if self.open.swap(false, Relaxed) && self.length() == 0 {
            self.next.fetch_sub(1, Relaxed);
        }
    }

    /// Number of the newest stroke, from 1.
    pub fn number(&self) -> usize {
        self.next.load(Relaxed)
    }

    /// Number of stored strokes.
    pub fn count(&self) -> usize {
        self.next.load(Relaxed) - self.oldest.load(Relaxed)
    }

    /// Whether an older stroke was discarded.
    pub fn forgot(&self) -> bool {
        self.forgot.load(Relaxed)
    }

    /// Number of bricks of the newest stroke; 0 without one.
    pub fn length(&self) -> usize {
        if self.count() == 0 { 0 } else { self.copied.load(Relaxed) - self.start(self.next.load(Relaxed) - 1) }
    }

    fn start(&self, stroke: usize) -> usize {
        self.starts[stroke % MAX_STROKES].load(Relaxed)
    }

    /// Discards the oldest stroke.
    fn forget(&self) {
        self.forgot.store(true, Relaxed);
        self.oldest.fetch_add(1, Relaxed);
    }

    /// Whether `brick` must be copied before it changes; true once per stroke.
    #[inline]
    pub fn is_first(&self, brick: usize) -> bool {
        let stamp = self.stamp.load(Relaxed);
        self.open.load(Relaxed) && self.stamps[brick].swap(stamp, Relaxed) != stamp
    }

    /// Copies the densities of `brick`, voxel by voxel.
    pub fn keep(&self, brick: usize, density: impl Fn(usize) -> i16) {
        let (room, copied) = (self.bricks.len(), self.copied.load(Relaxed));
        while self.count() > 0 && copied - self.start(self.oldest.load(Relaxed)) >= room {
            self.forget();
        }
        if self.count() == 0 {
            // The current stroke was the last that could make room.
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

    /// The `n`th brick of the newest stroke and its copy; `None` from [`length`](Self::length) on.
    pub fn kept(&self, n: usize) -> Option<(usize, &[AtomicI16])> {
        let length = self.length();
        let slot = || (self.copied.load(Relaxed) - length + n) % self.bricks.len();
        (n < length).then(|| (self.bricks[slot()].load(Relaxed) as usize, self.copy(slot())))
    }

    /// Number of undone strokes that can be redone.
    pub fn undone(&self) -> usize {
        self.undone.load(Relaxed)
    }

    /// Makes the stroke that was undone last the newest again; its copies hold what it cut.
    pub fn take_up(&self) -> bool {
        let undone = self.undone();
        if undone > 0 {
            self.undone.store(undone - 1, Relaxed);
            let stroke = self.next.fetch_add(1, Relaxed);
            self.copied.store(self.ends[stroke % MAX_STROKES].load(Relaxed), Relaxed);
        }
        undone > 0
    }

    /// Removes the newest stroke after it was undone; it can be redone until the next one begins.
    pub fn drop_newest(&self) {
        if self.count() > 0 {
            self.ends[(self.next.load(Relaxed) - 1) % MAX_STROKES].store(self.copied.load(Relaxed), Relaxed);
            self.undone.fetch_add(1, Relaxed);
            self.copied.fetch_sub(self.length(), Relaxed);
            self.next.fetch_sub(1, Relaxed);
            self.open.store(false, Relaxed);
        }
    }
}
