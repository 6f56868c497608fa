//! A flood through face neighbours over all tetrahedra whose box meets a region.

use super::lost::Lost;
use crate::{
    bounded::push_bounded,
    extent::Extent,
    narrow::{Hits, NONE},
    phase::box_of,
    scene::Scene,
};

/// Tetrahedra to look at, and those seen in this flood.
pub struct Flood {
    open: Vec<u32>,
    seen_at: Vec<u32>,
    number: u32,
}

/// Most tetrahedra waiting in one flood.
const MAX_OPEN: usize = 16_384;

impl Flood {
    /// Room for a mesh of so many tetrahedra.
    pub fn over(tets: usize) -> Self {
        Self { open: Vec::with_capacity(MAX_OPEN.min(4 * tets)), seen_at: vec![0; tets], number: 0 }
    }

    /// Forgets what was seen.
    pub fn begin(&mut self) {
        self.open.clear();
        self.number = self.number.wrapping_add(1);
        if self.number == 0 {
            self.seen_at.fill(0);
            self.number = 1;
        }
    }

    /// Adds a tetrahedron to begin from; counts one that does not fit.
    pub fn reach(&mut self, tet: u32, hits: &mut Hits) {
        if self.seen_at[tet as usize] == self.number {
            return;
        }
        match push_bounded(&mut self.open, tet) {
            0 => self.seen_at[tet as usize] = self.number,
            _ => hits.overflow += 1,
        }
    }

    /// Spreads over all tetrahedra that meet `region`, until no point is lost any more.
    pub fn run(&mut self, scene: &Scene, region: &Extent, lost: &mut Lost, hits: &mut Hits) {
        while let Some(tet) = self.open.pop().filter(|_| !lost.is_empty()) {
            let bounds = passage(scene, tet);
            if !bounds.overlaps(region) {
                continue;
            }
            let mut from = 0;
            while let Some(k) = lost.next_in(from, &bounds) {
                let i = lost.number(k) as usize;
                hits.test(scene, i, tet);
                match hits.tet[i] {
                    NONE => from = k + 1,
                    _ => (from, _) = (k, lost.swap_remove(k)),
                }
            }
            for next in scene.neighbours[tet as usize] {
                if next != NONE {
                    self.reach(next, hits);
                }
            }
        }
    }
}

/// Box that a flood passes through: one with a NaN corner is passed always, since its place is
/// unknown.
pub fn passage(scene: &Scene, tet: u32) -> Extent {
    let bounds = box_of(scene.positions, &scene.tets[tet as usize]);
    if bounds == Extent::EMPTY { Extent::EVERYWHERE } else { bounds }
}
