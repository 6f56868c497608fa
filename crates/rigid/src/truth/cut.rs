//! What burrs have cut: an exact union of capsules, in a spatial hash.

use glam::{DVec3, IVec3};
use std::collections::HashMap;

/// Edge of the hash's cells, mm.
const CELL_MM: f64 = 1.0;
/// How far a burr's way may be from the straight piece that stands for it, mm.
const STRAIGHT_MM: f64 = 1e-6;
/// Depth that stands for anywhere far from all cuts, mm.
const FAR_MM: f64 = -1.0;

/// A ball that went straight.
#[derive(Clone, Copy)]
struct Capsule {
    from: DVec3,
    to: DVec3,
    radius: f64,
}

impl Capsule {
    fn depth(&self, place: DVec3) -> f64 {
        self.radius - from_segment(place, self.from, self.to)
    }
}

/// Distance of a place from a segment, mm.
fn from_segment(place: DVec3, from: DVec3, to: DVec3) -> f64 {
    let (way, off) = (to - from, place - from);
    let along = (off.dot(way) / way.length_squared().max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
    off.distance(along * way)
}

/// Union of the balls that a burr has been.
#[derive(Default)]
pub struct Cut {
    cells: HashMap<IVec3, Vec<Capsule>>,
    /// The piece of the way that still grows.
    last: Option<Capsule>,
    /// Where the ball was on that piece.
    passed: Vec<DVec3>,
}

impl Cut {
    /// Adds the ball of `radius` that goes from one place to another.
    pub fn sweep(&mut self, radius: f64, from: DVec3, to: DVec3) {
        if let Some(last) = &mut self.last {
            let goes_on = last.radius == radius && last.to == from;
            if goes_on && self.passed.iter().all(|place| from_segment(*place, last.from, to) < STRAIGHT_MM) {
                last.to = to;
                self.passed.push(to);
                return;
            }
        }
        let done = self.last.replace(Capsule { from, to, radius });
        self.passed.clear();
        self.passed.push(to);
        if let Some(done) = done {
            self.keep(done);
        }
    }

    /// Lists a capsule in every cell that it reaches into.
    fn keep(&mut self, capsule: Capsule) {
        let cell = |place: DVec3| (place / CELL_MM).floor().as_ivec3();
        let (low, high) =
            (cell(capsule.from.min(capsule.to) - capsule.radius), cell(capsule.from.max(capsule.to) + capsule.radius));
        let reach = capsule.radius + 0.5 * 3f64.sqrt() * CELL_MM;
        for k in low.z..=high.z {
            for j in low.y..=high.y {
                for i in low.x..=high.x {
                    let cell = IVec3::new(i, j, k);
                    let middle = CELL_MM * (cell.as_dvec3() + 0.5);
                    if from_segment(middle, capsule.from, capsule.to) < reach {
                        self.cells.entry(cell).or_default().push(capsule);
                    }
                }
            }
        }
    }

    /// How deep a place lies in what was cut, mm; negative outside, where it is no nearer.
    pub fn depth(&self, place: DVec3) -> f64 {
        let listed = self.cells.get(&(place / CELL_MM).floor().as_ivec3());
        let all = listed.into_iter().flatten().chain(&self.last);
        all.map(|capsule| capsule.depth(place)).fold(FAR_MM, f64::max)
    }
}
