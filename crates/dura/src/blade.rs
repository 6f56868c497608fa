//! A blade that incises the sheet along its way.
//!
//! # Practice
//! The cut goes along edges, from node to node. The node that the blade comes near is moved into
//! its way first, so that the cut is as straight as the hand. An incision that meets an older one
//! joins it.

use crate::sheet::{Point, Sheet};
use trepan_geometry::Vec3;

/// The way at which the next edge is cut, over its length, numerical.
const NEXT: f32 = 0.95;
/// The way over which a blade was elsewhere meanwhile, over the edge, numerical.
const AWAY: f32 = 1.5;
/// Largest distance of the next node from the blade, over the edge, numerical.
const NEAR: f32 = 0.75;
/// Reach of an incision to an older one, over the edge, numerical.
const JOINS: f32 = 1.3;

/// Where a blade is in the sheet.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Blade {
    /// The node that it cut to.
    front: Option<u32>,
    /// Where the node before that one lies at rest.
    before: Option<Vec3>,
}

/// What a blade did.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Work {
    /// Length of what was cut, mm.
    pub cut_mm: f32,
    /// Whether a node was moved in the sheet.
    pub moved: bool,
}

impl Blade {
    /// Cuts on to a point of a sheet whose edges have a length, mm.
    pub fn follow(&mut self, sheet: &mut Sheet, edge_mm: f32, at: &Point) -> Work {
        let rest = sheet.mean(at).rest;
        let Some(front) = self.front else { return self.begin(sheet, at) };
        // Nothing is cut yet: across an older incision it begins beyond that.
        if self.before.is_none() && older(sheet, at, rest).is_some_and(|older| older != front) {
            return self.begin(sheet, at);
        }
        let here = sheet.nodes[front as usize].rest;
        let way_mm = here.distance(rest);
        if way_mm < NEXT * edge_mm {
            return Work::default();
        }
        let mm = |n: &u32| sheet.nodes[*n as usize].rest.distance(rest);
        let nearest = sheet.beside(front).min_by(|a, b| mm(a).total_cmp(&mm(b)));
        match nearest.filter(|n| mm(n) < NEAR * edge_mm) {
            Some(next) => {
                let is_older = sheet.is_incised(next);
                let moved = sheet.snap(next, at);
                // Beyond an older incision another begins.
                *self = Self { front: Some(next).filter(|_| !is_older), before: Some(here) };
                Work { cut_mm: sheet.cut(front, next), moved }
            }
            None if way_mm < AWAY * edge_mm => Work::default(),
            None => {
                let cut_mm = self.join(sheet, edge_mm);
                Work { cut_mm, ..self.begin(sheet, at) }
            }
        }
    }

    /// Ends an incision: the blade was lifted.
    pub fn lift(&mut self, sheet: &mut Sheet, edge_mm: f32) -> Work {
        let cut_mm = self.join(sheet, edge_mm);
        *self = Self::default();
        Work { cut_mm, moved: false }
    }

    /// Begins at the nearest node; at one of an older incision where there is one.
    fn begin(&mut self, sheet: &mut Sheet, at: &Point) -> Work {
        let corners = sheet.triangles[at.triangle as usize].corners;
        let older = older(sheet, at, sheet.mean(at).rest);
        let heaviest = (0..3).max_by(|&a, &b| at.weights[a].total_cmp(&at.weights[b])).unwrap_or_default();
        let front = older.unwrap_or(corners[heaviest]);
        let moved = older.is_none() && sheet.snap(front, at);
        *self = Self { front: Some(front), before: None };
        Work { cut_mm: 0.0, moved }
    }

    /// Cuts from the end of an incision to an older one that lies ahead.
    fn join(&self, sheet: &mut Sheet, edge_mm: f32) -> f32 {
        let Some((front, before)) = self.front.zip(self.before) else { return 0.0 };
        let here = sheet.nodes[front as usize].rest;
        let heading = (here - before).normalize_or_zero();
        let ahead = |n: &u32| {
            let way = sheet.nodes[*n as usize].rest - here;
            sheet.is_incised(*n) && way.length() < JOINS * edge_mm && way.dot(heading) > 0.5 * way.length()
        };
        let older = sheet.beside(front).find(ahead);
        older.map_or(0.0, |older| sheet.cut(front, older))
    }
}

/// The nearest corner of the touched triangle that lies on an incision.
fn older(sheet: &Sheet, at: &Point, rest: Vec3) -> Option<u32> {
    let corners = sheet.triangles[at.triangle as usize].corners;
    let mm = |n: &u32| sheet.nodes[*n as usize].rest.distance(rest);
    corners.into_iter().filter(|&n| sheet.is_incised(n)).min_by(|a, b| mm(a).total_cmp(&mm(b)))
}
