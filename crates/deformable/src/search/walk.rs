//! Points that keep their tetrahedron and walk on through neighbours in the moving mesh.
//!
//! # Theory
//! A point that was in a tetrahedron is, a millisecond later, in it or in one close by: step across
//! the face with the most negative barycentric coordinate until all are 0 or more (Guibas and
//! Stolfi's walk). A point that leaves through the border, walks in a circle or had no tetrahedron
//! is lost. Let R be the box of the lost points. A flood through faces reaches tetrahedra that meet
//! R, from three kinds of seeds in R: border triangles, degenerate tetrahedra (`degenerate.rs`),
//! tetrahedra that hold a point.
//!
//! *Nothing is missed.* Let C be a set of tetrahedra that meet R, connected through faces inside R,
//! and not reached. Its border does not run through R, so all points of R are covered by C equally
//! often, upright ones counted +1 and inverted ones -1; and C has no inverted ones, else it would
//! have been reached. So C covers all of R. Therefore one lost point p says it all: a second flood
//! runs along the ray from p out of the mesh, in a thin box that nothing covers whole, hence misses
//! nothing, and finds a tetrahedron around p if there is one. If so, R is flooded from there; if
//! not, the lost are outside.
//!
//! ```text
//!      x   x  ____ →→→→→→→→ ray     o  kept its tetrahedron: walks
//!   ____o_x__/    surface            x  lost: flood from border and degenerate ones near all x
//! ```
//!
//! # Practice
//! A step costs what lies near the tool, one pass over the boxes of the surface and a slice of the
//! rest. The proof asks that the surface's boxes are not stale ([`crate::TissueStep::stale`]) and
//! that the degenerate tetrahedra near the tool are known: for nodes that leap in a mesh of over
//! 2048 tetrahedra that can take some steps.
//!
//! # When not to use it
//! On a large mesh that is torn anew at every step: take a method that looks at all boxes.

use super::{degenerate::Degenerate, flood::Flood, lost::Lost};
use crate::extent::Extent;
use crate::method::{Descriptor, Method};
use crate::narrow::{Hits, NONE, is_inside};
use crate::scene::Scene;
use crate::seam::Search;
use crate::surface::MovingSurface;
use trepan_mesh::OPPOSITE;

/// The tetrahedron of each point, and room for floods.
pub(crate) struct Walk {
    last: Vec<u32>,
    lost: Lost,
    alone: Lost,
    near: Vec<u32>,
    flood: Flood,
    degenerate: Degenerate,
}

/// Most tetrahedra crossed by one point in one step.
const MAX_STEPS: usize = 32;
/// Most border triangles taken as seeds.
const MAX_SEEDS: usize = 4_096;

/// The walk.
pub const METHOD: Descriptor = Descriptor {
    uses_surface: true,
    ..Descriptor::of("walk", "Guibas and Stolfi 1985, with floods (this crate)", |inputs| {
        Box::new(Walk::new(inputs.points, inputs.mesh.tets.len()))
    })
};

impl Method {
    /// What the simulators use.
    pub const RECOMMENDED: Self = Self::of(&METHOD);
}

impl Search for Walk {
    fn reset(&mut self) {
        self.last.fill(NONE);
        self.degenerate.alarm();
    }

    fn find(&mut self, scene: &Scene, surface: &mut MovingSurface, hits: &mut Hits) {
        if surface.stale > 0 {
            self.degenerate.alarm();
        }
        self.degenerate.watch(scene);
        hits.overflow += self.degenerate.overflow;
        let all = Extent::of(scene.points);
        if !all.overlaps(&surface.bounds) && self.degenerate.meeting(all).next().is_none() {
            return self.last.fill(NONE);
        }
        self.walk_all(scene, hits);
        self.search_lost(scene, surface, hits);
        if !self.lost.is_empty() && hits.skipped > 0 && !self.degenerate.knows(hits.last_skipped) {
            self.degenerate.alarm();
            self.degenerate.watch(scene);
            self.search_lost(scene, surface, hits);
        }
        if !self.lost.is_empty() && self.is_covered(scene, surface, hits) {
            self.search_lost(scene, surface, hits);
        }
        self.last.copy_from_slice(&hits.tet);
    }
}

impl Walk {
    pub(crate) fn new(points: usize, tets: usize) -> Self {
        Self {
            last: vec![NONE; points],
            lost: Lost::with_capacity(points),
            alone: Lost::with_capacity(1),
            near: Vec::with_capacity(MAX_SEEDS),
            flood: Flood::over(tets),
            degenerate: Degenerate::among(tets),
        }
    }

    /// Every point from where it was; those that do not arrive are lost.
    fn walk_all(&mut self, scene: &Scene, hits: &mut Hits) {
        self.lost.clear();
        for (i, &p) in scene.points.iter().enumerate() {
            if self.last[i] == NONE || !walk(scene, i, self.last[i], hits) {
                self.lost.push(i as u32, p);
            }
        }
    }

    /// Lost points against every tetrahedron that meets their box and can be reached from a seed.
    fn search_lost(&mut self, scene: &Scene, surface: &mut MovingSurface, hits: &mut Hits) {
        if self.lost.is_empty() {
            return;
        }
        let region = self.lost.bounds();
        self.seed(&region, scene, surface, hits);
        for i in 0..scene.points.len() {
            if hits.tet[i] != NONE {
                self.flood.reach(hits.tet[i], hits);
            }
        }
        self.flood.run(scene, &region, &mut self.lost, hits);
    }

    /// Border triangles and degenerate tetrahedra in a region.
    fn seed(&mut self, region: &Extent, scene: &Scene, surface: &mut MovingSurface, hits: &mut Hits) {
        self.flood.begin();
        self.near.clear();
        hits.overflow += surface.gather(scene.positions, region, &mut self.near);
        for &t in &self.near {
            self.flood.reach(surface.tet_of_triangle[t as usize], hits);
        }
        for tet in self.degenerate.meeting(*region) {
            self.flood.reach(tet, hits);
        }
    }

    /// Whether the lost points lie under a sheet without border near them: one of them tells, along
    /// the shortest ray out of the mesh.
    fn is_covered(&mut self, scene: &Scene, surface: &mut MovingSurface, hits: &mut Hits) -> bool {
        let mut all = surface.bounds;
        all.merge(&self.degenerate.bounds());
        let (k, ray) = shortest_ray(&self.lost, &all);
        let (i, p) = (self.lost.number(k), self.lost.place(k));
        self.alone.clear();
        self.alone.push(i, p);
        self.seed(&ray, scene, surface, hits);
        self.flood.run(scene, &ray, &mut self.alone, hits);
        let start = hits.tet[i as usize];
        if start == NONE {
            return false;
        }
        self.lost.swap_remove(k);
        for k in (0..self.lost.len()).rev() {
            if walk(scene, self.lost.number(k) as usize, start, hits) {
                self.lost.swap_remove(k);
            }
        }
        true
    }
}

/// The lost point that is first on the shortest way out of a box along an axis, and that way.
fn shortest_ray(lost: &Lost, all: &Extent) -> (usize, Extent) {
    let region = lost.bounds();
    let way = |axis: usize, up: bool| match up {
        true => all.high[axis] - region.high[axis],
        false => region.low[axis] - all.low[axis],
    };
    let ways = (0..3).flat_map(|axis| [(axis, false), (axis, true)]);
    let (axis, up) = ways.min_by(|a, b| way(a.0, a.1).total_cmp(&way(b.0, b.1))).unwrap_or((0, true));
    let along = |k: &usize| lost.place(*k).to_array()[axis] * if up { 1.0 } else { -1.0 };
    let first = (0..lost.len()).max_by(|a, b| along(a).total_cmp(&along(b))).unwrap_or(0);
    let mut ray = Extent::of(&[lost.place(first)]);
    match up {
        true => ray.high[axis] = ray.high[axis].max(all.high[axis] + BEYOND_MM),
        false => ray.low[axis] = ray.low[axis].min(all.low[axis] - BEYOND_MM),
    }
    (first, ray)
}

/// How far a ray ends outside the mesh's box, mm.
const BEYOND_MM: f32 = 1.0;

/// Walks point `i` from `tet`; says whether it arrived.
pub fn walk(scene: &Scene, i: usize, mut tet: u32, hits: &mut Hits) -> bool {
    for _ in 0..MAX_STEPS {
        let Some(weights) = hits.test(scene, i, tet) else { return false };
        if is_inside(&weights) {
            return true;
        }
        let corner = (0..4).fold(0, |lowest, c| if weights[c] < weights[lowest] { c } else { lowest });
        let face = (0..4).find(|&f| OPPOSITE[f] == corner).unwrap_or(0);
        tet = scene.neighbours[tet as usize][face];
        if tet == NONE {
            return false;
        }
    }
    false
}
