//! Points in an octree, made anew at every step; tetrahedra look through the cells that their boxes
//! meet.
//!
//! # Theory
//! Meagher 1982: a cube is cut into eight until few points are left in each. Here the cubes are the
//! tight boxes of their points' half spaces, so empty octants cost nothing. The points are few and
//! the tetrahedra many: so the tree is made of the points, and the boxes ask it.
//!
//! # When not to use it
//! For points that lie evenly, as on a ball: a grid finds their cell without going down.
//!
//! # Sources
//! Meagher 1982; thesis 2.1.1. Liberties: the tree is of the tool's points and not of the scene's
//! primitives; cells are shrunk to their points.

use trepan_deformable::Descriptor;
use trepan_deformable::kit::Extent;
use trepan_deformable::kit::{PointIndex, indexed, list_finite};
use trepan_geometry::Vec3;

/// An octree of points.
#[derive(Debug)]
pub struct Octree {
    order: Vec<u32>,
    cells: Vec<Cell>,
}

/// `order[first..last]`; its children are `cells[children..children + 8]`, none when 0.
#[derive(Clone, Copy, Debug)]
struct Cell {
    bounds: Extent,
    first: u32,
    last: u32,
    children: u32,
    depth: u32,
}

/// Points that are not cut apart any more.
const FEW: u32 = 6;
const MAX_DEPTH: u32 = 10;

impl Octree {
    /// Room for so many points.
    pub fn new(points: usize) -> Self {
        Self { order: Vec::with_capacity(points), cells: Vec::with_capacity(1 + 8 * points) }
    }

    fn cell(&self, points: &[Vec3], first: u32, last: u32, depth: u32) -> Cell {
        let of = self.order[first as usize..last as usize].iter().map(|&i| &points[i as usize]);
        Cell { bounds: Extent::of(of), first, last, children: 0, depth }
    }

    /// Sorts a cell's points into its octants and makes them cells, as long as there is room.
    fn cut(&mut self, points: &[Vec3], at: usize) {
        let Cell { bounds, first, last, depth, .. } = self.cells[at];
        let room = self.cells.capacity() - self.cells.len() >= 8;
        if last - first <= FEW || depth == MAX_DEPTH || !room {
            return;
        }
        let middle: [f32; 3] = core::array::from_fn(|axis| 0.5 * (bounds.low[axis] + bounds.high[axis]));
        let octant = |i: u32| {
            let p = points[i as usize].to_array();
            (0..3).fold(0usize, |sum, axis| sum | usize::from(p[axis] > middle[axis]) << axis)
        };
        let own = &mut self.order[first as usize..last as usize];
        own.sort_unstable_by_key(|&i| (octant(i), i));
        let mut ends = [first; 8];
        own.iter().for_each(|&i| ends[octant(i)..].iter_mut().for_each(|end| *end += 1));
        self.cells[at].children = self.cells.len() as u32;
        let mut start = first;
        for end in ends {
            let child = self.cell(points, start, end, depth + 1);
            self.cells.push(child);
            start = end;
        }
    }

    fn search(&self, at: u32, points: &[Vec3], bounds: &Extent, found: &mut impl FnMut(u32)) {
        let cell = self.cells[at as usize];
        if !cell.bounds.overlaps(bounds) {
            return;
        }
        if cell.children != 0 {
            return (cell.children..cell.children + 8)
                .rev()
                .for_each(|child| self.search(child, points, bounds, found));
        }
        let own = &self.order[cell.first as usize..cell.last as usize];
        own.iter().filter(|&&i| bounds.contains(points[i as usize])).for_each(|&i| found(i));
    }
}

impl PointIndex for Octree {
    fn place(&mut self, points: &[Vec3]) {
        list_finite(points, &mut self.order);
        self.cells.clear();
        let root = self.cell(points, 0, self.order.len() as u32, 0);
        self.cells.push(root);
        let mut at = 0;
        while at < self.cells.len() {
            self.cut(points, at);
            at += 1;
        }
    }

    fn visit(&self, points: &[Vec3], bounds: &Extent, mut found: impl FnMut(u32)) {
        self.search(0, points, bounds, &mut found);
    }
}

/// Points in the octree.
pub const METHOD: Descriptor =
    Descriptor::of("octree", "Meagher 1982", |inputs| indexed(inputs, Octree::new(inputs.points)));
