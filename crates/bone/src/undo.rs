//! Records strokes of the burr and undoes them brick by brick.

use crate::stroke::BRICK;
use crate::stroke::Undone;
use crate::{BoneVolume, CUT_SURFACE};
use glam::IVec3;
use std::sync::atomic::{AtomicI16, Ordering};
use trepan_geometry::Vec3;

impl BoneVolume {
    /// Starts a new stroke, to which [`undo_stroke`](Self::undo_stroke) returns. For the writer
    /// only.
    pub fn begin_stroke(&self) {
        self.strokes.begin();
    }

    /// Ends the stroke: later changes belong to none and are kept. For the writer only.
    pub fn end_stroke(&self) {
        self.strokes.end();
    }

    /// Number of the newest stroke, from 1; undoing one frees its number.
    pub fn stroke_number(&self) -> usize {
        self.strokes.number()
    }

    /// Number of strokes that can be undone.
    pub fn strokes(&self) -> usize {
        self.strokes.count()
    }

    /// Whether older strokes were discarded for lack of room.
    pub fn forgot_strokes(&self) -> bool {
        self.strokes.forgot()
    }

    /// Number of bricks that the newest stroke changed; 0 without one.
    pub fn stroke_bricks(&self) -> usize {
        self.strokes.length()
    }

    /// Swaps the `n`th brick of the newest stroke with its earlier state; a second call swaps back.
    /// For the writer only; half a microsecond.
    pub fn exchange_brick(&self, n: usize) {
        let Some((brick, copy)) = self.strokes.kept(n) else { return };
        // Not an atomic swap, which would lock the bus: there is one writer.
        let exchange = |kept: &AtomicI16, value: &AtomicI16| {
            let before = kept.load(Ordering::Relaxed);
            kept.store(value.load(Ordering::Relaxed), Ordering::Relaxed);
            value.store(before, Ordering::Relaxed);
        };
        if let Some(place) = brick.checked_sub(self.versions.len()) {
            copy.iter().zip(self.cut.values(place)).for_each(|(kept, value)| exchange(kept, value));
            self.note_cut(self.cut.low_of(place) / BRICK as i32);
        } else {
            let low = self.low_of(brick);
            for (n, kept) in copy.iter().enumerate() {
                if let Some(at) = self.index(low + Self::within(n)) {
                    exchange(kept, &self.hu[at]);
                }
            }
            self.versions[brick].fetch_add(1, Ordering::Release);
        }
        self.came_back();
    }

    /// Whether undoing the `n`th brick of the newest stroke would restore bone at a point for which
    /// `taken` is true. `near` is called first, with the brick's centre and half diagonal, mm.
    pub fn brings_back(&self, n: usize, near: impl Fn(Vec3, f32) -> bool, taken: impl Fn(Vec3) -> bool) -> bool {
        let Some((brick, copy)) = self.strokes.kept(n) else { return false };
        let place = brick.checked_sub(self.versions.len());
        let low = place.map_or_else(|| self.low_of(brick), |place| self.cut.low_of(place));
        let edge = place.map_or(self.spacing_mm, |_| self.node_mm());
        let world = |at: IVec3| self.origin + edge * at.as_vec3();
        let middle = world(low) + Vec3::splat(0.5 * (BRICK - 1) as f32 * edge);
        let half = 0.5 * 3f32.sqrt() * BRICK as f32 * edge;
        let comes = |n: usize, copy: &AtomicI16| {
            let (at, kept) = (low + Self::within(n), copy.load(Ordering::Relaxed));
            let gone = match place {
                None => kept >= self.isovalue && !self.is_bone(at),
                Some(place) => {
                    let now = self.cut.values(place)[n].load(Ordering::Relaxed);
                    kept < CUT_SURFACE
                        && now >= CUT_SURFACE
                        && self.ct(at.div_euclid(IVec3::splat(self.cut.nodes))) >= self.isovalue
                }
            };
            gone && taken(world(at))
        };
        near(middle, half) && copy.iter().enumerate().any(|(n, copy)| comes(n, copy))
    }

    /// Removes the newest stroke after its bricks were undone; the one before it becomes the
    /// newest. For the writer only.
    pub fn drop_stroke(&self) {
        self.strokes.drop_newest();
    }

    /// Number of undone strokes that can be redone: those since the last stroke began.
    pub fn undone_strokes(&self) -> usize {
        self.strokes.undone()
    }

    /// Makes the stroke that was undone last the newest again, to exchange its bricks once more;
    /// false if there is none. For the writer only.
    pub fn take_up_stroke(&self) -> bool {
        self.strokes.take_up()
    }

    /// Restores all bricks of the newest stroke. For the writer only; up to a few milliseconds for
    /// the largest stroke.
    pub fn undo_stroke(&self) -> Undone {
        match self.stroke_bricks() {
            0 if self.forgot_strokes() => Undone::Forgotten,
            0 => Undone::Nothing,
            count => {
                (0..count).for_each(|n| self.exchange_brick(n));
                self.drop_stroke();
                Undone::Bricks(count)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{MAX_STROKE_BRICKS, MAX_STROKES};
    use trepan_volume::{AIR_HU, VoxelVolume};

    fn block() -> VoxelVolume<i16> {
        let mut volume = VoxelVolume::isotropic([20, 18, 17], Vec3::new(-9.0, 4.0, 1.0), 0.5, AIR_HU);
        for k in 4..10 {
            for j in 3..9 {
                for i in 5..12 {
                    let at = volume.index([i, j, k]);
                    volume.data[at] = 900;
                }
            }
        }
        volume
    }

    #[test]
    fn a_stroke_is_undone_to_the_last_voxel_and_readers_notice() {
        let bone = BoneVolume::new(&block(), 400).unwrap();
        bone.set_hu(IVec3::new(6, 4, 5), 100);
        assert_eq!(bone.undo_stroke(), Undone::Nothing, "no stroke has begun");
        let before = bone.snapshot();
        bone.begin_stroke();
        for at in 0..19 * 17 * 16 {
            bone.set_hu(IVec3::new(at % 19, at / 19 % 17, at / 323), AIR_HU);
        }
        let mut seen = bone.seen();
        assert_eq!(bone.undo_stroke(), Undone::Bricks(3 * 3 * 2));
        assert_eq!(bone.snapshot(), before);
        let mut found = 0;
        bone.changed(&mut seen, 99, |_| found += 1);
        assert_eq!((found, bone.undone() > 0), (18, true));
        assert_eq!(bone.undo_stroke(), Undone::Nothing);
        assert!(bone.version(IVec3::ZERO) > 0 && bone.version(IVec3::new(0, 0, 99)) == 0);
    }

    #[test]
    fn strokes_come_back_one_by_one_and_what_lies_between_them_stays() {
        let bone = BoneVolume::new(&block(), 400).unwrap();
        let mut states = Vec::new();
        for n in 0..5 {
            states.push(bone.snapshot());
            bone.begin_stroke();
            (0..=n).for_each(|x| bone.set_hu(IVec3::new(6 + x, 4, 5 + n), 10 * n as i16));
            bone.end_stroke();
        }
        bone.begin_stroke();
        bone.begin_stroke();
        bone.end_stroke();
        assert_eq!(bone.strokes(), 5, "a stroke through air is none");
        for state in states.iter().rev() {
            assert!(matches!(bone.undo_stroke(), Undone::Bricks(_)));
            assert_eq!(bone.snapshot(), *state);
        }
        assert_eq!(bone.undo_stroke(), Undone::Nothing);
        bone.begin_stroke();
        bone.set_hu(IVec3::new(6, 4, 5), AIR_HU);
        bone.end_stroke();
        bone.set_hu(IVec3::new(7, 4, 5), 77);
        bone.exchange_brick(0);
        let back = |bone: &BoneVolume| [6, 7].map(|x| bone.hu(IVec3::new(x, 4, 5)));
        assert_eq!(back(&bone), [900, 900]);
        bone.exchange_brick(0);
        assert_eq!((back(&bone), bone.strokes()), ([AIR_HU, 77], 1), "exchanged twice it is as it was");
    }

    #[test]
    fn undone_strokes_are_redone_until_a_new_one_begins() {
        let bone = BoneVolume::new(&block(), 400).unwrap();
        let mut states = vec![bone.snapshot()];
        for n in 0..4 {
            bone.begin_stroke();
            (0..=n).for_each(|x| bone.set_hu(IVec3::new(6 + x, 4, 5 + n), AIR_HU));
            bone.end_stroke();
            states.push(bone.snapshot());
        }
        let redo = |bone: &BoneVolume| {
            let taken = bone.take_up_stroke();
            (0..bone.stroke_bricks()).filter(|_| taken).for_each(|n| bone.exchange_brick(n));
            taken
        };
        (0..3).for_each(|_| _ = bone.undo_stroke());
        assert!(bone.snapshot() == states[1] && bone.undone_strokes() == 3);
        assert!(redo(&bone) && bone.snapshot() == states[2]);
        assert!(redo(&bone) && bone.snapshot() == states[3]);
        assert!(matches!(bone.undo_stroke(), Undone::Bricks(_)) && bone.snapshot() == states[2]);
        assert!(redo(&bone) && redo(&bone) && bone.snapshot() == states[4]);
        assert!(!redo(&bone) && bone.snapshot() == states[4], "nothing is left");
        bone.undo_stroke();
        bone.begin_stroke();
        bone.set_hu(IVec3::new(6, 5, 5), AIR_HU);
        bone.end_stroke();
        let new = bone.snapshot();
        assert!(!redo(&bone) && bone.snapshot() == new, "a new stroke ends it");
    }

    #[test]
    fn only_restored_bone_counts_as_collision() {
        let bone = BoneVolume::new(&block(), 400).unwrap();
        let (gone, there, thin) = (IVec3::new(6, 4, 5), IVec3::new(5, 4, 5), IVec3::new(0, 4, 5));
        bone.begin_stroke();
        bone.set_hu(gone, AIR_HU);
        bone.set_hu(thin, -900);
        let at = |voxel| {
            let place = bone.centre_of(voxel);
            bone.brings_back(0, |middle, half| middle.distance(place) <= half, |p| p.distance(place) < 0.1)
        };
        assert_eq!([gone, there, thin].map(at), [true, false, false]);
        assert!(!bone.brings_back(0, |_, _| false, |_| true) && !bone.brings_back(1, |_, _| true, |_| true));
    }

    #[test]
    fn the_oldest_strokes_are_forgotten_where_room_runs_out() {
        let volume = VoxelVolume::isotropic([8, 8, 8 * (MAX_STROKE_BRICKS + 1)], Vec3::ZERO, 1.0, 900i16);
        let bone = BoneVolume::new(&volume, 400).unwrap();
        let stroke = |bricks: std::ops::Range<usize>, hu| {
            bone.begin_stroke();
            bricks.for_each(|k| bone.set_hu(IVec3::new(0, 0, 8 * k as i32), hu));
            bone.end_stroke();
        };
        stroke(0..10, 1);
        stroke(0..10, 2);
        assert!(bone.strokes() == 2 && !bone.forgot_strokes());
        stroke(0..MAX_STROKE_BRICKS - 5, 3);
        assert_eq!((bone.strokes(), bone.forgot_strokes()), (1, true), "two made room for the third");
        assert_eq!(bone.undo_stroke(), Undone::Bricks(MAX_STROKE_BRICKS - 5));
        assert_eq!((bone.hu(IVec3::ZERO), bone.undo_stroke()), (2, Undone::Forgotten));
        (0..MAX_STROKES + 3).for_each(|n| stroke(0..1, 100 + n as i16));
        assert_eq!(bone.strokes(), MAX_STROKES);
        (0..MAX_STROKES).for_each(|_| assert_eq!(bone.undo_stroke(), Undone::Bricks(1)));
        assert_eq!((bone.hu(IVec3::ZERO), bone.undo_stroke()), (102, Undone::Forgotten));
    }

    #[test]
    fn a_stroke_longer_than_there_is_room_for_is_not_half_undone() {
        let mut volume = VoxelVolume::isotropic([8, 8, 8 * (MAX_STROKE_BRICKS + 1)], Vec3::ZERO, 1.0, 900i16);
        volume.data[0] = 0;
        let bone = BoneVolume::new(&volume, 400).unwrap();
        bone.begin_stroke();
        (0..=MAX_STROKE_BRICKS as i32).for_each(|k| bone.set_hu(IVec3::new(0, 0, 8 * k), 7));
        let drilled = bone.snapshot();
        assert_eq!(bone.undo_stroke(), Undone::Forgotten);
        assert_eq!(bone.snapshot(), drilled);
        bone.begin_stroke();
        bone.set_hu(IVec3::ZERO, AIR_HU);
        assert_eq!(bone.undo_stroke(), Undone::Bricks(1));
        assert_eq!(bone.hu(IVec3::ZERO), 7);
    }
}
