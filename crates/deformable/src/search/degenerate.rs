//! The tetrahedra that lie inside out, are flat, or have a corner that is nowhere: known by number,
//! looked for in turn.
//!
//! # Theory
//! A sheet of tissue that is folded over itself can hide from a search that begins at the border.
//! But wherever a fold covers a point both upright and inside out, one of its tetrahedra there has
//! no positive volume; who knows these misses nothing (`walk.rs`).
//!
//! # Practice
//! Small meshes are looked at whole at every step. In larger ones [`SLICE`] tetrahedra are looked
//! at in each step, and in a step that finds a new degenerate one, or that is told of an alarm, up
//! to [`MOST`]: 400 us. So an degenerate tetrahedron that comes alone far from the tool is known
//! after tetrahedra / SLICE steps at the latest; one that the tool's points meet, at once.

use super::flood::passage;
use crate::{extent::Extent, narrow::is_sound, scene::Scene};

/// Known degenerate tetrahedra with their boxes.
pub(crate) struct Degenerate {
    known: Vec<(u32, Extent)>,
    is_known: Vec<bool>,
    next: u32,
    /// Tetrahedra that are to be looked at before the turn is slow again.
    urgent: u32,
    /// Degenerate tetrahedra that did not fit in this step.
    pub overflow: u32,
}

/// Tetrahedra looked at in a quiet step: 0.8 us.
const SLICE: u32 = 64;
/// Meshes up to this size are looked at whole.
const SMALL: u32 = 2_048;
/// Tetrahedra looked at in an urgent step.
const MOST: u32 = 65_536;
/// Most degenerate tetrahedra known.
const MAX_KNOWN: usize = 16_384;

impl Degenerate {
    pub(crate) fn among(tets: usize) -> Self {
        let known = Vec::with_capacity(MAX_KNOWN.min(tets));
        Self { known, is_known: vec![false; tets], next: 0, urgent: tets as u32, overflow: 0 }
    }

    /// Nothing is trusted: all are to be looked at soon.
    pub(crate) fn alarm(&mut self) {
        self.urgent = self.is_known.len() as u32;
    }

    /// Whether this one is known to be degenerate.
    pub(crate) fn knows(&self, tet: u32) -> bool {
        self.is_known[tet as usize]
    }

    /// Looks again at the known ones, and at the next few of all.
    pub(crate) fn watch(&mut self, scene: &Scene) {
        self.overflow = 0;
        let is_known = &mut self.is_known;
        self.known.retain_mut(|(tet, bounds)| {
            *bounds = passage(scene, *tet);
            is_known[*tet as usize] = scene.is_live(*tet) && !is_sound(scene.corners(*tet));
            is_known[*tet as usize]
        });
        let count = self.is_known.len() as u32;
        let quiet = if count <= SMALL { count } else { SLICE };
        let (mut left, mut looked) = (quiet.max(self.urgent.min(MOST)), 0);
        while looked < left {
            if self.look(scene, self.next) {
                self.alarm();
                left = count.min(MOST);
            }
            self.next = (self.next + 1) % count;
            looked += 1;
        }
        self.urgent = self.urgent.saturating_sub(looked);
    }

    /// Says whether this one is newly found to be degenerate.
    fn look(&mut self, scene: &Scene, tet: u32) -> bool {
        if self.is_known[tet as usize] || !scene.is_live(tet) || is_sound(scene.corners(tet)) {
            return false;
        }
        if self.known.len() == self.known.capacity() {
            self.overflow += 1;
            return false;
        }
        self.is_known[tet as usize] = true;
        self.known.push((tet, passage(scene, tet)));
        true
    }

    /// Those whose box meets a region.
    pub(crate) fn meeting(&self, region: Extent) -> impl Iterator<Item = u32> + '_ {
        self.known.iter().filter(move |(_, bounds)| bounds.overlaps(&region)).map(|&(tet, _)| tet)
    }

    /// Box around all whose place is known.
    pub(crate) fn bounds(&self) -> Extent {
        let mut all = Extent::EMPTY;
        self.known.iter().filter(|(_, b)| *b != Extent::EVERYWHERE).for_each(|(_, b)| all.merge(b));
        all
    }
}
