//! The skull during drilling: a density grid with one writer, many readers and no locks.
//!
//! # Theory
//! Densities are stored in a flat grid of atomics, so that the haptic tick can remove bone while
//! renderer and distance field read. Each brick of 8³ voxels has a version that increases after a
//! write. A reader stores the versions that it has seen and so finds later changes at any time:
//! there is no queue that could overflow.
//!
//! ```text
//! writer: store density (relaxed) → version += 1 (release)
//! reader: load version (acquire) → load densities (relaxed)
//! A density newer than the version is only read again later.
//! ```
//!
//! # Practice
//! World is patient RAS+ mm; the grid is axis-aligned and isotropic (the import resamples), so that
//! converting a world point costs three multiply-adds. 2 bytes a voxel, 4 bytes a brick. The caller
//! must ensure that only one thread writes at a time.
//!
//! What a burr cuts is not written into the densities but into a second field, which is finer
//! (`cut.rs`); [`hu`](BoneVolume::hu) shows both as one.
//!
//! Strokes of the burr, each from the pedal's press to its release, can be undone, newest first.
//! [`begin_stroke`](BoneVolume::begin_stroke) marks the press; bricks are then copied before they
//! change. For readers an undo is one more change. A tick undoes a few bricks at a time
//! ([`exchange_brick`](BoneVolume::exchange_brick)).
//!
//! # When not to use it
//! For volumes that do not change: use [`VoxelVolume`].

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;

mod between;
mod cut;
mod flap;
mod piece;
mod scanned;
mod stroke;
mod undo;

pub use between::BetweenScratch;
pub use cut::{CUT_STEPS, CUT_SURFACE, CutWriter, cut_depth};
pub use flap::{FlapSearch, FlapState};
pub use piece::Piece;
pub use stroke::{BRICK, MAX_STROKE_BRICKS, MAX_STROKES, Undone};

use crate::scanned::Scanned;
use crate::stroke::Strokes;
use glam::{DVec3, IVec3};
use rayon::prelude::*;
use std::sync::atomic::{AtomicBool, AtomicI16, AtomicU32, AtomicU64, Ordering};
use trepan_geometry::{Aabb, Vec3};
use trepan_volume::{AIR_HU, VoxelVolume};

/// The number of the next volume.
static NEXT_ID: AtomicU64 = AtomicU64::new(0);

/// A grid of densities in HU that one thread modifies and others read.
#[derive(Debug)]
pub struct BoneVolume {
    id: u64,
    dims: [usize; 3],
    origin: Vec3,
    spacing_mm: f32,
    isovalue: i16,
    bounds: Aabb,
    /// The CT.
    hu: Vec<AtomicI16>,
    cut: cut::CutField,
    bricks: [usize; 3],
    /// Changes of each brick's densities.
    versions: Vec<AtomicU32>,
    /// Changes of the cut in each brick.
    cut_versions: Vec<AtomicU32>,
    /// Whether a brick has ever held bone.
    solid: Vec<AtomicBool>,
    strokes: Strokes,
    scanned: Scanned,
    /// Number of times that bone was restored.
    undone: AtomicU32,
}

/// Why a volume cannot be used as bone.
#[derive(Debug, thiserror::Error, PartialEq)]
pub enum BoneError {
    /// The grid is oblique, mirrored or anisotropic.
    #[error("the bone grid must be axis-aligned with cubic voxels, but its affine is {0}; resample it first")]
    Grid(String),
    /// No voxel reaches the isovalue.
    #[error("no voxel reaches {0} HU, so there is no bone; give a lower isovalue or another CT")]
    Empty(i16),
}

impl BoneVolume {
    /// Copies densities; voxels at or over `isovalue`, HU, are bone.
    ///
    /// # Errors
    /// If the grid is not one of cubes along the axes, or holds no bone.
    pub fn new(volume: &VoxelVolume<i16>, isovalue: i16) -> Result<Self, BoneError> {
        Self::of(volume.clone(), isovalue)
    }

    /// As [`new`](Self::new), in the memory of the volume: no second copy of a large skull.
    ///
    /// # Errors
    /// If the grid is not one of cubes along the axes, or holds no bone.
    pub fn of(volume: VoxelVolume<i16>, isovalue: i16) -> Result<Self, BoneError> {
        let spacing = volume.spacing_mm().x;
        let scale = volume.world_from_voxel.matrix3;
        if !scale.abs_diff_eq(glam::DMat3::from_diagonal(DVec3::splat(spacing)), 1e-6 * spacing) {
            return Err(BoneError::Grid(format!("{scale:?}")));
        }
        let bricks = volume.dims.map(|n| n.div_ceil(BRICK));
        let counters = || (0..bricks.iter().product()).map(|_| AtomicU32::new(0)).collect();
        let mut bone = Self {
            id: NEXT_ID.fetch_add(1, Ordering::Relaxed),
            dims: volume.dims,
            origin: volume.world_from_voxel.translation.as_vec3(),
            spacing_mm: spacing as f32,
            isovalue,
            bounds: Aabb::EMPTY,
            hu: volume.data.into_iter().map(AtomicI16::new).collect(),
            cut: cut::CutField::new(volume.dims, spacing as f32, 0),
            bricks,
            versions: counters(),
            cut_versions: counters(),
            solid: (0..bricks.iter().product()).map(|_| AtomicBool::new(false)).collect(),
            strokes: Strokes::new(0),
            scanned: Scanned::new(bricks.iter().product()),
            undone: AtomicU32::new(0),
        };
        bone.bounds = bone.find_bone().ok_or(BoneError::Empty(isovalue))?;
        let solid = bone.solid.iter().filter(|solid| solid.load(Ordering::Relaxed)).count();
        bone.cut = cut::CutField::new(volume.dims, bone.spacing_mm, solid);
        bone.strokes = Strokes::new(bone.versions.len() + bone.cut.pool());
        Ok(bone)
    }

    /// Bounding box of the bone; marks the bricks that contain some.
    fn find_bone(&self) -> Option<Aabb> {
        let [nx, ny, nz] = self.dims;
        let is_bone = |v: &AtomicI16| v.load(Ordering::Relaxed) >= self.isovalue;
        let ends = |row: usize| {
            let voxels = &self.hu[row * nx..][..nx];
            let at = |x: usize| IVec3::new(x as i32, (row % ny) as i32, (row / ny) as i32);
            let low = at(voxels.iter().position(is_bone)?);
            for (brick, _) in voxels.chunks(BRICK).enumerate().filter(|(_, part)| part.iter().any(is_bone)) {
                self.solid[self.brick_of(at(brick * BRICK))].store(true, Ordering::Relaxed);
            }
            Some((low, at(voxels.iter().rposition(is_bone)?)))
        };
        let rows = (0..ny * nz).into_par_iter().filter_map(ends);
        let (low, high) = rows.reduce_with(|(a, b), (c, d)| (a.min(c), b.max(d)))?;
        let half = Vec3::splat(0.5 * self.spacing_mm);
        Some(Aabb { min: self.centre_of(low) - half, max: self.centre_of(high) + half })
    }

    /// Number of this volume, unique in the process. Readers that keep state recognise it by this.
    pub fn id(&self) -> u64 {
        self.id
    }

    /// Voxels along x, y, z.
    pub fn dims(&self) -> [usize; 3] {
        self.dims
    }

    /// Edge of a voxel, mm.
    #[inline]
    pub fn spacing_mm(&self) -> f32 {
        self.spacing_mm
    }

    /// Volume of a voxel, mm³.
    pub fn voxel_mm3(&self) -> f32 {
        self.spacing_mm.powi(3)
    }

    /// World centre of voxel (0, 0, 0), mm.
    pub fn origin(&self) -> Vec3 {
        self.origin
    }

    /// The isovalue, HU; a voxel at or over it is bone.
    #[inline]
    pub fn isovalue(&self) -> i16 {
        self.isovalue
    }

    /// World bounding box of the initial bone, mm.
    pub fn bounds(&self) -> Aabb {
        self.bounds
    }

    /// The voxel that contains a world point (possibly outside the grid).
    #[inline]
    pub fn voxel_of(&self, point: Vec3) -> IVec3 {
        self.grid_of(point).round().as_ivec3()
    }

    /// Continuous grid coordinates of a world point; voxel centres are at integers.
    #[inline]
    pub fn grid_of(&self, point: Vec3) -> Vec3 {
        (point - self.origin) / self.spacing_mm
    }

    /// World centre of a voxel, mm.
    #[inline]
    pub fn centre_of(&self, voxel: IVec3) -> Vec3 {
        self.origin + self.spacing_mm * voxel.as_vec3()
    }

    #[inline]
    fn index(&self, voxel: IVec3) -> Option<usize> {
        let [nx, ny, nz] = self.dims;
        let inside = voxel.cmpge(IVec3::ZERO).all() && voxel.cmplt(IVec3::new(nx as i32, ny as i32, nz as i32)).all();
        inside.then(|| voxel.x as usize + nx * (voxel.y as usize + ny * voxel.z as usize))
    }

    /// Density of a voxel with what was cut from it, HU. It is less than that of the CT in a cut
    /// and within a voxel of it; [`AIR_HU`] outside the grid.
    #[inline]
    pub fn hu(&self, voxel: IVec3) -> i16 {
        self.index(voxel).map_or(AIR_HU, |at| self.shown(at, voxel))
    }

    /// Densities at the corners of the cell whose lowest is `low`, x fastest, HU; each as
    /// [`hu`](Self::hu), with one test for the grid's borders.
    #[inline]
    pub fn corners(&self, low: IVec3) -> [i16; 8] {
        let [nx, ny, _] = self.dims;
        match (self.index(low), self.index(low + 1)) {
            (Some(at), Some(_)) if !self.is_cut_near(self.cut.nodes * low, self.cut.nodes * (low + 1)) => {
                let pair = |at: usize| {
                    let pair = &self.hu[at..at + 2];
                    [pair[0].load(Ordering::Relaxed), pair[1].load(Ordering::Relaxed)]
                };
                let ([a, b], [c, d]) = (pair(at), pair(at + nx));
                let ([e, f], [g, h]) = (pair(at + nx * ny), pair(at + nx * ny + nx));
                [a, b, c, d, e, f, g, h]
            }
            _ => core::array::from_fn(|c| self.hu(low + IVec3::new(c as i32 & 1, c as i32 >> 1 & 1, c as i32 >> 2))),
        }
    }

    /// Reads the densities of the voxels along x from `start` on, HU; each as [`hu`](Self::hu).
    #[inline]
    pub fn read_row(&self, start: IVec3, out: &mut [i16]) {
        let end = start + (out.len().max(1) - 1) as i32 * IVec3::X;
        match (self.index(start), self.index(end)) {
            (Some(at), Some(_)) if !self.is_cut_near(self.cut.nodes * start, self.cut.nodes * end) => {
                out.iter_mut().zip(&self.hu[at..]).for_each(|(out, hu)| *out = hu.load(Ordering::Relaxed));
            }
            _ => out.iter_mut().zip(0..).for_each(|(out, i)| *out = self.hu(start + i * IVec3::X)),
        }
    }

    #[inline]
    fn shown(&self, at: usize, voxel: IVec3) -> i16 {
        self.ramped(self.hu[at].load(Ordering::Relaxed), self.cut.at(self.cut.nodes * voxel))
    }

    /// Density of a voxel in the CT, HU, as if nothing had been cut; [`AIR_HU`] outside the grid.
    #[inline]
    pub fn ct(&self, voxel: IVec3) -> i16 {
        self.index(voxel).map_or(AIR_HU, |at| self.hu[at].load(Ordering::Relaxed))
    }

    /// Reads the CT's densities of a row of voxels along x from `start`, HU; [`AIR_HU`] beyond the
    /// grid.
    pub fn read_ct(&self, start: IVec3, out: &mut [i16]) {
        out.fill(AIR_HU);
        let skipped = (-start.x).max(0);
        let Some(first) = self.index(start + skipped * IVec3::X) else { return };
        let room = self.dims[0] - (start.x + skipped) as usize;
        let from = self.hu[first..first + room].iter();
        let to = out.iter_mut().skip(skipped as usize);
        to.zip(from).for_each(|(to, from)| *to = from.load(Ordering::Relaxed));
    }

    /// Whether a voxel is bone.
    #[inline]
    pub fn is_bone(&self, voxel: IVec3) -> bool {
        self.hu(voxel) >= self.isovalue
    }

    /// Density over the isovalue at a point, HU: trilinear between voxel centres.
    pub fn over_isovalue(&self, point: Vec3) -> f32 {
        let at = self.grid_of(point);
        let (low, part) = (at.floor().as_ivec3(), at - at.floor());
        let corner = |n: i32| {
            let step = IVec3::new(n & 1, n >> 1 & 1, n >> 2);
            let weight = Vec3::select(step.cmpeq(IVec3::ONE), part, 1.0 - part);
            weight.element_product() * f32::from(self.hu(low + step))
        };
        (0..8).map(corner).sum::<f32>() - f32::from(self.isovalue())
    }

    /// Whether a world point is in bone that was not cut, to the nearest voxel and node.
    #[inline]
    pub fn holds(&self, point: Vec3) -> bool {
        let at = self.grid_of(point);
        let node = (self.cut.nodes as f32 * at).round().as_ivec3();
        self.ct(at.round().as_ivec3()) >= self.isovalue && self.cut.at(node) < CUT_SURFACE
    }

    /// Sets the CT's density of a voxel, HU; ignored outside the grid. For the writer only.
    pub fn set_hu(&self, voxel: IVec3, hu: i16) {
        if let Some(at) = self.index(voxel) {
            let (brick, low) = (self.brick_of(voxel), self.low_of(self.brick_of(voxel)));
            self.scanned.keep(brick, |n| self.ct(low + Self::within(n)));
            if self.strokes.is_first(brick) {
                self.strokes.keep(brick, |n| self.ct(low + Self::within(n)));
            }
            self.hu[at].store(hu, Ordering::Release);
            if hu >= self.isovalue {
                self.solid[brick].store(true, Ordering::Relaxed);
            }
            self.versions[brick].fetch_add(1, Ordering::Release);
        }
    }

    /// Records that [`set_hu`](Self::set_hu) restored bone. For the writer only.
    pub fn came_back(&self) {
        self.undone.fetch_add(1, Ordering::Release);
    }

    /// How often bone was restored, by an undone stroke or by a call.
    pub fn undone(&self) -> u32 {
        self.undone.load(Ordering::Acquire)
    }

    /// Version of a brick, incremented by each change; 0 outside the grid. The brick starts at
    /// voxel 8 times `brick`.
    #[inline]
    pub fn version(&self, brick: IVec3) -> u32 {
        self.ct_version(brick).wrapping_add(self.cut_version(brick))
    }

    /// Version of a brick's densities alone.
    #[inline]
    pub fn ct_version(&self, brick: IVec3) -> u32 {
        self.brick_index(brick).map_or(0, |at| self.versions[at].load(Ordering::Acquire))
    }

    /// Version of the cut in a brick alone; beyond the grid that of the nearest brick.
    #[inline]
    pub fn cut_version(&self, brick: IVec3) -> u32 {
        let last = IVec3::from(self.bricks.map(|n| n as i32)) - 1;
        let nearest = brick.clamp(IVec3::ZERO, last);
        self.brick_index(nearest).map_or(0, |at| self.cut_versions[at].load(Ordering::Acquire))
    }

    fn brick_index(&self, brick: IVec3) -> Option<usize> {
        let [bx, by, bz] = self.bricks;
        let inside = brick.cmpge(IVec3::ZERO).all() && brick.cmplt(IVec3::new(bx as i32, by as i32, bz as i32)).all();
        inside.then(|| brick.x as usize + bx * (brick.y as usize + by * brick.z as usize))
    }

    /// Versions of all bricks.
    fn all_versions(&self) -> impl Iterator<Item = u32> + '_ {
        let sum =
            |(ct, cut): (&AtomicU32, &AtomicU32)| ct.load(Ordering::Acquire).wrapping_add(cut.load(Ordering::Acquire));
        self.versions.iter().zip(&self.cut_versions).map(sum)
    }

    /// The last voxel.
    fn last(&self) -> IVec3 {
        IVec3::from(self.dims.map(|n| n as i32)) - 1
    }

    /// The lowest voxel of a brick.
    fn low_of(&self, brick: usize) -> IVec3 {
        let [bx, by, _] = self.bricks;
        IVec3::from([brick % bx, brick / bx % by, brick / (bx * by)].map(|b| (b * BRICK) as i32))
    }

    /// Offset from the lowest voxel of a brick to its `n`th.
    fn within(n: usize) -> IVec3 {
        IVec3::new((n % BRICK) as i32, (n / BRICK % BRICK) as i32, (n / (BRICK * BRICK)) as i32)
    }

    /// Index of the brick of a voxel inside the grid.
    #[inline]
    fn brick_of(&self, voxel: IVec3) -> usize {
        let [bx, by, _] = self.bricks;
        let b = voxel.as_uvec3() / BRICK as u32;
        b.x as usize + bx * (b.y as usize + by * b.z as usize)
    }

    /// Whether the box from voxel `low` to voxel `high`, inclusive, touches a brick that has ever
    /// held bone.
    pub fn may_hold_bone(&self, low: IVec3, high: IVec3) -> bool {
        let (low, high) = (low.max(IVec3::ZERO), high.min(self.last()));
        if low.cmpgt(high).any() {
            return false;
        }
        let [bx, by, _] = self.bricks.map(|n| n as i32);
        let (first, last) = (low / BRICK as i32, high / BRICK as i32);
        (first.z..=last.z).any(|k| {
            (first.y..=last.y).any(|j| {
                let row = (bx * (j + by * k)) as usize;
                let row = &self.solid[row + first.x as usize..=row + last.x as usize];
                row.iter().any(|solid| solid.load(Ordering::Relaxed))
            })
        })
    }

    /// Bricks along x, y, z; brick (0, 0, 0) starts at voxel (0, 0, 0).
    pub fn bricks(&self) -> [usize; 3] {
        self.bricks
    }

    /// Creates a reader's record for [`changed`](Self::changed), with everything so far marked as
    /// seen.
    pub fn seen(&self) -> Vec<u32> {
        self.all_versions().collect()
    }

    /// Calls `visit` with the coordinates of up to `limit` bricks changed since `seen` and marks
    /// them. Returns how many changed bricks remain for the next call.
    ///
    /// Cost: one load and compare per brick; no allocation.
    pub fn changed(&self, seen: &mut [u32], limit: usize, mut visit: impl FnMut([usize; 3])) -> usize {
        let [bx, by, _] = self.bricks;
        let mut found = 0;
        for (at, (now, seen)) in self.all_versions().zip(seen).enumerate() {
            if now != *seen {
                found += 1;
                if found <= limit {
                    *seen = now;
                    visit([at % bx, at / bx % by, at / (bx * by)]);
                }
            }
        }
        found.saturating_sub(limit)
    }

    /// A copy of the current densities with what was cut, HU: [`hu`](Self::hu) of every voxel.
    pub fn snapshot(&self) -> VoxelVolume<i16> {
        let mut volume = VoxelVolume::isotropic(self.dims, self.origin, self.spacing_mm, AIR_HU);
        let [nx, ny, _] = self.dims;
        volume.data.par_chunks_exact_mut(nx).enumerate().for_each(|(row, to)| {
            let start = IVec3::new(0, (row % ny) as i32, (row / ny) as i32);
            let from = &self.hu[row * nx..][..nx];
            if self.is_cut_near(self.cut.nodes * start, self.cut.nodes * start.with_x(nx as i32 - 1)) {
                to.iter_mut().enumerate().for_each(|(x, to)| *to = self.shown(row * nx + x, start.with_x(x as i32)));
            } else {
                to.iter_mut().zip(from).for_each(|(to, from)| *to = from.load(Ordering::Relaxed));
            }
        });
        volume
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ball() -> VoxelVolume<i16> {
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
    fn a_late_reader_still_finds_every_change() {
        let bone = BoneVolume::new(&ball(), 400).unwrap();
        let mut seen = bone.seen();
        bone.set_hu(IVec3::new(5, 3, 4), AIR_HU);
        bone.set_hu(IVec3::new(11, 8, 9), AIR_HU);
        bone.set_hu(IVec3::new(-1, 0, 0), 5);
        let mut found = Vec::new();
        assert_eq!(bone.changed(&mut seen, 1, |b| found.push(b)), 1);
        assert_eq!(bone.changed(&mut seen, 9, |b| found.push(b)), 0);
        assert_eq!(found, [[0, 0, 0], [1, 1, 1]]);
        assert_eq!(bone.changed(&mut seen, 9, |_| panic!("seen")), 0);
        assert_eq!(bone.snapshot().get([5, 3, 4]), Some(AIR_HU));
    }

    #[test]
    fn cells_and_rows_are_what_single_voxels_are_at_the_border_and_in_a_cut_too() {
        let bone = BoneVolume::new(&ball(), 400).unwrap();
        let nodes = bone.cut_nodes();
        let same = |bone: &BoneVolume| {
            for at in 0..22 * 20 * 19 {
                let low = IVec3::new(at % 22, at / 22 % 20, at / 440) - 1;
                let each = |c: i32| bone.hu(low + IVec3::new(c & 1, c >> 1 & 1, c >> 2));
                assert_eq!(bone.corners(low), core::array::from_fn(|c| each(c as i32)), "{low}");
                let mut row = [0; 5];
                bone.read_row(low, &mut row);
                assert_eq!(row, core::array::from_fn(|x| bone.hu(low + x as i32 * IVec3::X)), "{low}");
            }
        };
        same(&bone);
        let eight = nodes * IVec3::new(8, 5, 6);
        assert!(bone.cut_writer().set_eight(eight, [CUT_SURFACE + 300; 8], 0xFF));
        same(&bone);
        assert!(bone.hu(eight / nodes) < 400);
    }

    #[test]
    fn points_and_voxels_agree_and_bounds_hold_the_bone() {
        let bone = BoneVolume::new(&ball(), 400).unwrap();
        let voxel = IVec3::new(7, 5, 9);
        assert_eq!(bone.voxel_of(bone.centre_of(voxel) + Vec3::splat(0.24)), voxel);
        assert_eq!(bone.bounds().min, Vec3::new(-9.0 + 4.5 * 0.5, 4.0 + 2.5 * 0.5, 1.0 + 3.5 * 0.5));
        assert_eq!(bone.hu(IVec3::new(0, 0, 40)), AIR_HU);
        assert!(bone.may_hold_bone(IVec3::splat(-9), IVec3::splat(4)) && bone.may_hold_bone(voxel, voxel));
        assert!(
            !bone.may_hold_bone(IVec3::new(16, 0, 0), IVec3::splat(40))
                && !bone.may_hold_bone(IVec3::splat(30), IVec3::splat(40))
        );
        assert_eq!(BoneVolume::new(&ball(), 1000).unwrap_err(), BoneError::Empty(1000));
    }
}
