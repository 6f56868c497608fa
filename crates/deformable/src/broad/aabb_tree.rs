//! A tree of boxes over the tetrahedra, built at rest, refitted bottom-up to the moved mesh.
//!
//! # Theory
//! Van den Bergen 1997: in a deforming body the tree keeps its shape, only its boxes follow, children before parents. The tree is made by halving
//! the tetrahedra at the median of their centres along the longest side. A point goes down every branch whose box holds it.
//!
//! # Practice
//! Children lie behind their parent in memory, so one pass backwards refits. O(tetrahedra) for each refit, O(log tetrahedra) for a point as long as boxes
//! overlap little; large deformation makes them overlap more, never wrong.
//!
//! # When not to use it
//! For one small tool: the refit costs as much as a scan over all boxes. It pays with many points that lie far apart.

use super::{BroadPhase, box_of, push_bounded};
use crate::extent::Extent;
use trepan_geometry::{Aabb, Vec3};

/// A binary tree of boxes.
#[derive(Debug)]
pub struct AabbTree {
    nodes: Vec<Node>,
    order: Vec<u32>,
    open: Vec<u32>,
    boxes: Vec<Extent>,
}

/// A box over `order[first..last]`; a leaf when `right` is 0. The left child is the next node.
#[derive(Clone, Copy, Debug)]
struct Node {
    bounds: Extent,
    first: u32,
    last: u32,
    right: u32,
}

/// Most tetrahedra in a leaf.
const LEAF: usize = 8;

impl AabbTree {
    /// A tree over a mesh at rest.
    pub fn new(positions: &[Vec3], tets: &[[u32; 4]]) -> Self {
        let centres: Vec<Vec3> =
            tets.iter().map(|t| t.iter().map(|&n| positions[n as usize]).sum::<Vec3>() * 0.25).collect();
        let mut tree = Self {
            nodes: Vec::new(),
            order: (0..tets.len() as u32).collect(),
            open: Vec::new(),
            boxes: vec![Extent::EMPTY; tets.len()],
        };
        tree.build(&centres, 0, tets.len());
        tree.open.reserve(tree.nodes.len());
        tree
    }

    fn build(&mut self, centres: &[Vec3], first: usize, last: usize) {
        let node = self.nodes.len();
        self.nodes.push(Node { bounds: Extent::EMPTY, first: first as u32, last: last as u32, right: 0 });
        if last - first <= LEAF {
            return;
        }
        let span = Extent::of(self.order[first..last].iter().map(|&t| &centres[t as usize]));
        let size: [f32; 3] = core::array::from_fn(|axis| span.high[axis] - span.low[axis]);
        let axis = (0..3).fold(0, |longest, axis| if size[axis] > size[longest] { axis } else { longest });
        let middle = (last - first) / 2;
        let along = |t: &u32| centres[*t as usize].to_array()[axis];
        self.order[first..last].select_nth_unstable_by(middle, |a, b| along(a).total_cmp(&along(b)).then(a.cmp(b)));
        self.build(centres, first, first + middle);
        self.nodes[node].right = self.nodes.len() as u32;
        self.build(centres, first + middle, last);
    }

    fn leaf(&self, node: &Node) -> &[u32] {
        &self.order[node.first as usize..node.last as usize]
    }
}

impl BroadPhase for AabbTree {
    fn update(&mut self, positions: &[Vec3], tets: &[[u32; 4]], _region: &Aabb) {
        for (fitted, tet) in self.boxes.iter_mut().zip(tets) {
            *fitted = box_of(positions, tet);
        }
        for at in (0..self.nodes.len()).rev() {
            let node = self.nodes[at];
            let mut bounds = Extent::EMPTY;
            if node.right == 0 {
                self.leaf(&node).iter().for_each(|&t| bounds.merge(&self.boxes[t as usize]));
            } else {
                bounds.merge(&self.nodes[at + 1].bounds);
                bounds.merge(&self.nodes[node.right as usize].bounds);
            }
            self.nodes[at].bounds = bounds;
        }
    }

    fn pairs(&mut self, points: &[Vec3], out: &mut Vec<[u32; 2]>) -> u32 {
        out.clear();
        let mut overflow = 0;
        for (i, &p) in points.iter().enumerate() {
            self.open.clear();
            self.open.push(0);
            while let Some(at) = self.open.pop() {
                let node = self.nodes[at as usize];
                if !node.bounds.contains(p) {
                    continue;
                }
                if node.right != 0 {
                    self.open.extend([node.right, at + 1]);
                    continue;
                }
                for &t in self.leaf(&node).iter().filter(|&&t| self.boxes[t as usize].contains(p)) {
                    overflow += push_bounded(out, [i as u32, t]);
                }
            }
        }
        out.sort_unstable_by_key(|&[point, tet]| (tet, point));
        overflow
    }
}
