//! Searches, a few voxels per tick, whether the bone flap is still connected to the skull.
//!
//! # Theory
//! A breadth-first flood fill through faces starts at a voxel in the middle of the flap. If it
//! reaches the border of a box around the operation, the flap is connected to the skull. If it ends
//! inside, the flap is free and all its voxels are known.
//!
//! ```text
//!  ┌───────────────┐ box
//!  │▒▒▒▒▒ ░░░ ▒▒▒▒▒│ ░ flooded: ends at the cut
//!  └───────────────┘
//! ```
//!
//! # Practice
//! [`FlapSearch::step`] visits a number of voxels and returns, so that a search of a 40 mm flap is
//! spread over some 30 ms of tick time. It must be restarted after the bone has changed. A voxel
//! costs about 50 ns. All memory is allocated in `new`.
//!
//! # When not to use it
//! For every piece of a skull at once: [`Piece::all`](crate::Piece::all).

use crate::BoneVolume;
use glam::{IVec3, Vec3};

/// Most places where a search may begin.
const MOST_SEEDS: usize = 4097;

/// Most voxels of a piece; a larger one counts as connected to the skull.
const MOST: usize = 1 << 20;

/// State of the search.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FlapState {
    /// The search is not finished.
    NotYet,
    /// The bone there is connected to the skull, or there is none.
    Hanging,
    /// The bone is a separate piece.
    Free,
}

/// A flood fill of one piece of bone.
#[derive(Clone, Debug)]
pub struct FlapSearch {
    low: IVec3,
    dims: IVec3,
    seeds: Vec<IVec3>,
    seen: Vec<u64>,
    /// Visited voxels; the neighbours of those from `next` on are still to be visited.
    piece: Vec<u32>,
    next: usize,
    found: FlapState,
    begun: bool,
}

impl FlapSearch {
    /// Prepares a search in the box of `reach_mm` around `centre`. The seed is the first bone on
    /// the line from `from` to `to`, world mm.
    pub fn new(bone: &BoneVolume, centre: Vec3, reach_mm: f32, from: Vec3, to: Vec3) -> Self {
        let last = IVec3::from(bone.dims().map(|n| n as i32 - 1));
        let low = bone.voxel_of(centre - reach_mm).clamp(IVec3::ZERO, last);
        let dims = bone.voxel_of(centre + reach_mm).clamp(low, last) - low + 1;
        let voxels = dims.as_usizevec3().element_product();
        let piece = Vec::with_capacity(voxels.min(MOST));
        let (seeds, seen) = (Vec::with_capacity(MOST_SEEDS), vec![0; voxels.div_ceil(64)]);
        let mut search = Self { low, dims, seeds, seen, piece, next: 0, found: FlapState::NotYet, begun: false };
        search.seed(bone, from, to);
        search
    }

    /// Restarts the search at the first bone on another line, world mm. Allocates nothing.
    pub fn seed(&mut self, bone: &BoneVolume, from: Vec3, to: Vec3) {
        let steps = (2.0 * from.distance(to) / bone.spacing_mm()).ceil().clamp(1.0, MOST_SEEDS as f32 - 1.0) as usize;
        let way = (0..=steps).map(|step| bone.voxel_of(from.lerp(to, step as f32 / steps as f32)));
        let (low, end) = (self.low, self.low + self.dims);
        self.seeds.clear();
        self.seeds.extend(way.filter(|voxel| voxel.cmpge(low).all() && voxel.cmplt(end).all()));
        self.seeds.dedup();
        self.restart();
    }

    /// Restarts the search; the next steps first clear the old one.
    pub fn restart(&mut self) {
        (self.begun, self.found) = (false, FlapState::NotYet);
    }

    /// Continues the search for at most `visits` voxels.
    pub fn step(&mut self, bone: &BoneVolume, visits: usize) -> FlapState {
        for _ in 0..visits {
            if self.found != FlapState::NotYet {
                break;
            }
            if self.begun { self.flood(bone) } else { self.begin(bone) }
        }
        self.found
    }

    /// Number of voxels of the piece, once it is found free.
    pub fn voxels(&self) -> usize {
        if self.found == FlapState::Free { self.piece.len() } else { 0 }
    }

    /// A voxel of the piece.
    pub fn voxel(&self, at: usize) -> IVec3 {
        self.place(self.piece[at])
    }

    fn place(&self, index: u32) -> IVec3 {
        let (index, nx, ny) = (index as i32, self.dims.x, self.dims.y);
        self.low + IVec3::new(index % nx, index / nx % ny, index / (nx * ny))
    }

    /// Clears a voxel of the last search; when all are cleared, starts at the seed.
    fn begin(&mut self, bone: &BoneVolume) {
        match self.piece.pop() {
            Some(index) => self.seen[index as usize / 64] &= !(1 << (index % 64)),
            None => {
                (self.begun, self.next) = (true, 0);
                match self.seeds.iter().copied().find(|seed| bone.is_bone(*seed)) {
                    Some(seed) => self.take(seed),
                    None => self.found = FlapState::Hanging,
                }
            }
        }
    }

    /// Visits the neighbours of the next voxel.
    fn flood(&mut self, bone: &BoneVolume) {
        let Some(&index) = self.piece.get(self.next) else {
            self.found = FlapState::Free;
            return;
        };
        self.next += 1;
        let voxel = self.place(index);
        for axis in [IVec3::X, IVec3::Y, IVec3::Z] {
            for neighbour in [voxel - axis, voxel + axis] {
                if bone.is_bone(neighbour) {
                    self.take(neighbour);
                }
            }
        }
    }

    fn take(&mut self, voxel: IVec3) {
        let at = voxel - self.low;
        if at.cmplt(IVec3::ZERO).any() || at.cmpge(self.dims).any() || self.piece.len() == self.piece.capacity() {
            self.found = FlapState::Hanging;
            return;
        }
        let index = (at.x + self.dims.x * (at.y + self.dims.y * at.z)) as u32;
        let (word, bit) = (&mut self.seen[index as usize / 64], 1 << (index % 64));
        if *word & bit == 0 {
            *word |= bit;
            self.piece.push(index);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Piece;
    use trepan_volume::{AIR_HU, VoxelVolume};

    fn plate() -> BoneVolume {
        let mut ct = VoxelVolume::isotropic([40, 36, 9], Vec3::ZERO, 1.0, AIR_HU);
        ct.data[40 * 36 * 3..40 * 36 * 6].fill(1000);
        BoneVolume::new(&ct, 400).unwrap()
    }

    fn drill(bone: &BoneVolume, x: i32, y: i32) {
        (3..6).for_each(|z| bone.set_hu(IVec3::new(x, y, z), AIR_HU));
    }

    fn run(search: &mut FlapSearch, bone: &BoneVolume) -> (FlapState, usize) {
        let steps = (1..10_000).find(|_| search.step(bone, 7) != FlapState::NotYet);
        (search.found, steps.unwrap())
    }

    #[test]
    fn a_flap_is_free_with_its_last_bridge_and_the_search_may_be_repeated() {
        let bone = plate();
        let before = Piece::all(&bone);
        let (from, to) = (Vec3::new(15.0, 15.0, 8.0), Vec3::new(15.0, 15.0, 0.0));
        let mut search = FlapSearch::new(&bone, Vec3::new(15.0, 15.0, 4.0), 14.0, from, to);
        assert_eq!(run(&mut search, &bone).0, FlapState::Hanging);
        let ring = |x: i32, y: i32| (10..=20).contains(&x) && (9..=21).contains(&y);
        let rim = |x: i32, y: i32| ring(x, y) && !(x > 10 && x < 20 && y > 9 && y < 21);
        for (x, y) in
            (0..40).flat_map(|x| (0..36).map(move |y| (x, y))).filter(|&(x, y)| rim(x, y) && (x, y) != (20, 14))
        {
            drill(&bone, x, y);
        }
        search.restart();
        assert_eq!(run(&mut search, &bone).0, FlapState::Hanging, "a bridge is left");
        drill(&bone, 20, 14);
        for _ in 0..2 {
            search.restart();
            assert_eq!(run(&mut search, &bone).0, FlapState::Free);
            assert_eq!(search.voxels(), 9 * 11 * 3);
            assert_eq!(search.voxels(), Piece::cut_off(&before, &Piece::all(&bone))[0].voxels);
        }
        assert!((0..search.voxels()).all(|at| bone.is_bone(search.voxel(at))));
        (0..search.voxels()).for_each(|at| bone.set_hu(search.voxel(at), AIR_HU));
        search.restart();
        assert_eq!(run(&mut search, &bone).0, FlapState::Hanging, "nothing is there");
    }

    #[test]
    fn a_search_outside_the_grid_finds_nothing() {
        let bone = plate();
        let far = Vec3::splat(500.0);
        let mut search = FlapSearch::new(&bone, far, 5.0, far, far + 3.0);
        assert_eq!(run(&mut search, &bone), (FlapState::Hanging, 1));
    }
}
