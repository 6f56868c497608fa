//! Broad phases: from moving boxes to few pairs of point and tetrahedron, each of which gets the
//! exact test.

use crate::bounded::push_bounded;
use crate::extent::Extent;
use crate::narrow::{Hits, NONE};
use crate::scene::Scene;
use crate::seam::{Search, SearchInputs};
use crate::surface::MovingSurface;
use glam::Vec3A;
use trepan_geometry::{Aabb, Vec3};

/// Finds which points may lie in which tetrahedra. A pair may be false, a missing pair may not.
///
/// Both calls run once in every collision step: no allocation, no lock, no panic.
pub trait BroadPhase: Send {
    /// Takes the tetrahedra of a moved mesh; only those whose box meets `region` matter.
    fn update(&mut self, positions: &[Vec3], tets: &[[u32; 4]], region: &Aabb);

    /// Clears `out` and fills it, up to its capacity, with `[point, tetrahedron]` pairs, ascending
    /// by tetrahedron; returns how many did not fit.
    fn pairs(&mut self, points: &[Vec3], out: &mut Vec<[u32; 2]>) -> u32;
}

/// Box of a tetrahedron; empty when a corner is not finite.
#[inline]
pub fn box_of(positions: &[Vec3], tet: &[u32; 4]) -> Extent {
    let [a, b, c, d] = *tet;
    let [a, b, c, d] = [a, b, c, d].map(|node| Vec3A::from(positions[node as usize]));
    if !(a + b + c + d).is_finite() {
        return Extent::EMPTY;
    }
    Extent { low: a.min(b).min(c.min(d)), high: a.max(b).max(c.max(d)) }
}

/// The points of a step, sorted so that a box finds those inside it.
pub trait PointIndex: Send {
    /// Takes the points of a step; those that are not finite are left out.
    fn place(&mut self, points: &[Vec3]);

    /// Calls `found` once for each placed point inside `bounds`.
    fn visit(&self, points: &[Vec3], bounds: &Extent, found: impl FnMut(u32));
}

/// Fills `out`, up to its capacity, with the numbers of the finite points.
pub fn list_finite(points: &[Vec3], out: &mut Vec<u32>) {
    out.clear();
    let finite = (0..points.len() as u32).filter(|&i| points[i as usize].is_finite());
    out.extend(finite.take(out.capacity()));
}

/// The broad phase by an index of the points, which the boxes of the tetrahedra ask.
#[derive(Debug)]
pub struct Indexed<I> {
    /// The index.
    pub index: I,
    /// Boxes that meet the region, in order.
    boxes: Vec<(u32, Extent)>,
}

impl<I> Indexed<I> {
    /// For at most so many tetrahedra.
    pub fn new(index: I, tets: usize) -> Self {
        Self { index, boxes: Vec::with_capacity(tets) }
    }

    /// Forgets the tetrahedra of the last step.
    pub fn clear(&mut self) {
        self.boxes.clear();
    }

    /// Takes a tetrahedron when its box meets the region and there is room.
    pub fn offer(&mut self, tet: u32, bounds: Extent, region: &Extent) {
        if bounds.overlaps(region) {
            push_bounded(&mut self.boxes, (tet, bounds));
        }
    }

    /// Brings the tetrahedra into ascending order.
    pub fn sort(&mut self) {
        self.boxes.sort_unstable_by_key(|(tet, _)| *tet);
    }
}

impl<I: PointIndex> BroadPhase for Indexed<I> {
    fn update(&mut self, positions: &[Vec3], tets: &[[u32; 4]], region: &Aabb) {
        self.boxes.clear();
        let region = Extent::from(*region);
        let met = tets.iter().enumerate().map(|(t, tet)| (t as u32, box_of(positions, tet)));
        self.boxes.extend(met.filter(|(_, b)| b.overlaps(&region)).take(self.boxes.capacity()));
    }

    fn pairs(&mut self, points: &[Vec3], out: &mut Vec<[u32; 2]>) -> u32 {
        out.clear();
        self.index.place(points);
        let mut overflow = 0;
        for (tet, bounds) in &self.boxes {
            self.index.visit(points, bounds, |point| overflow += push_bounded(out, [point, *tet]));
        }
        overflow
    }
}

/// The search by an index of the points.
pub fn indexed(inputs: &SearchInputs, index: impl PointIndex + 'static) -> Box<dyn Search> {
    Box::new(Phased::new(Indexed::new(index, inputs.mesh.tets.len()), inputs.points))
}

/// The search by any [`BroadPhase`] and the exact test on each of its pairs.
pub struct Phased {
    phase: Box<dyn BroadPhase>,
    pairs: Vec<[u32; 2]>,
}

/// Room for this many candidate tetrahedra at each point.
const CANDIDATES: usize = 64;

impl Phased {
    /// The search by a broad phase for so many points.
    pub fn new(phase: impl BroadPhase + 'static, points: usize) -> Self {
        Self { phase: Box::new(phase), pairs: Vec::with_capacity(points * CANDIDATES) }
    }
}

impl Search for Phased {
    fn find(&mut self, scene: &Scene, _: &mut MovingSurface, hits: &mut Hits) {
        self.phase.update(scene.positions, scene.tets, &scene.ball_box());
        hits.overflow += self.phase.pairs(scene.points, &mut self.pairs);
        for &[point, tet] in &self.pairs {
            let i = point as usize;
            if hits.tet[i] == NONE {
                hits.test(scene, i, tet);
            }
        }
    }
}
