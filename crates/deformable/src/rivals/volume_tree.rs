//! A tree of bounding volumes over the tetrahedra, built at rest, refitted bottom-up to the moved
//! mesh.
//!
//! # Theory
//! Van den Bergen 1997: in a deforming body the tree keeps its shape, only its volumes follow,
//! children before parents. The tree is made by halving the tetrahedra at the median of their
//! centres along the longest side. A point goes down every branch whose volume holds it.
//!
//! ```text
//!      [0]         one volume for each node, of any kind: box, ball, k-DOP, turned box
//!     /   \
//!   [1]   [4]      children lie behind their parent, so one pass backwards refits
//!   / \   / \
//! [2] [3] …
//! ```
//!
//! # Practice
//! O(tetrahedra) for each refit, O(log tetrahedra) for a point as long as volumes overlap little;
//! large deformation makes them overlap more, never wrong. The last test is against the
//! tetrahedron's own box, so that all kinds give the same pairs.
//!
//! # When not to use it
//! For one small tool: the refit costs more than a scan over all boxes. It pays with many points
//! that lie far apart.

use crate::bounded::push_bounded;
use crate::extent::Extent;
use crate::phase::{BroadPhase, Phased, box_of};
use crate::seam::{Search, SearchInputs};
use trepan_geometry::{Aabb, Vec3};

/// Something that holds points, and can be made to hold more.
pub trait Volume: Copy + Send {
    /// An empty volume for these points at rest; one with directions takes them from here and keeps
    /// them.
    fn for_points(points: &[Vec3]) -> Self;

    /// Holds nothing any more.
    fn clear(&mut self);

    /// Holds a tetrahedron with these finite corners too.
    fn add_corners(&mut self, corners: &[Vec3; 4]);

    /// Holds all that a child holds too.
    fn add_child(&mut self, child: &Self);

    /// Whether a point lies inside, with nothing lost to rounding.
    fn holds(&self, p: Vec3) -> bool;
}

/// A binary tree of bounding volumes.
#[derive(Debug)]
pub struct VolumeTree<V> {
    volumes: Vec<V>,
    shape: Vec<Node>,
    order: Vec<u32>,
    boxes: Vec<Extent>,
}

/// What a node stands for: `order[first..last]`; a leaf when `right` is 0. The left child is the
/// next node.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Node {
    pub first: u32,
    pub last: u32,
    pub right: u32,
}

impl Node {
    /// The tetrahedra below it, in the order of its tree.
    pub fn tets<'a>(&self, order: &'a [u32]) -> &'a [u32] {
        &order[self.first as usize..self.last as usize]
    }
}

/// Most tetrahedra in a leaf.
pub(crate) const LEAF: usize = 8;

impl<V: Volume> VolumeTree<V> {
    /// A tree over a mesh at rest.
    pub fn new(positions: &[Vec3], tets: &[[u32; 4]]) -> Self {
        let (shape, order) = halved(positions, tets);
        let corners = |n: &Node| -> Vec<Vec3> {
            n.tets(&order).iter().flat_map(|&t| tets[t as usize].map(|c| positions[c as usize])).collect()
        };
        Self {
            volumes: shape.iter().map(|n| V::for_points(&corners(n))).collect(),
            boxes: vec![Extent::EMPTY; tets.len()],
            shape,
            order,
        }
    }

    /// Adds the pairs of a point below a node; returns how many did not fit.
    fn descend(&self, at: u32, i: u32, p: Vec3, out: &mut Vec<[u32; 2]>) -> u32 {
        let node = self.shape[at as usize];
        if !self.volumes[at as usize].holds(p) {
            return 0;
        }
        if node.right != 0 {
            return self.descend(at + 1, i, p, out) + self.descend(node.right, i, p, out);
        }
        let met = node.tets(&self.order).iter().filter(|&&t| self.boxes[t as usize].contains(p));
        met.map(|&t| push_bounded(out, [i, t])).sum()
    }
}

/// The search by a tree of such volumes.
pub(crate) fn search<V: Volume + 'static>(inputs: &SearchInputs) -> Box<dyn Search> {
    Box::new(Phased::new(VolumeTree::<V>::new(&inputs.mesh.positions, &inputs.mesh.tets), inputs.points))
}

impl<V: Volume> BroadPhase for VolumeTree<V> {
    fn update(&mut self, positions: &[Vec3], tets: &[[u32; 4]], _region: &Aabb) {
        for (fitted, tet) in self.boxes.iter_mut().zip(tets) {
            *fitted = box_of(positions, tet);
        }
        for at in (0..self.shape.len()).rev() {
            let node = self.shape[at];
            let mut volume = self.volumes[at];
            volume.clear();
            if node.right == 0 {
                for &t in node.tets(&self.order) {
                    if self.boxes[t as usize] != Extent::EMPTY {
                        volume.add_corners(&tets[t as usize].map(|c| positions[c as usize]));
                    }
                }
            } else {
                volume.add_child(&self.volumes[at + 1]);
                volume.add_child(&self.volumes[node.right as usize]);
            }
            self.volumes[at] = volume;
        }
    }

    fn pairs(&mut self, points: &[Vec3], out: &mut Vec<[u32; 2]>) -> u32 {
        out.clear();
        let overflow = (0..).zip(points).map(|(i, &p)| self.descend(0, i, p, out)).sum();
        out.sort_unstable_by_key(|&[point, tet]| (tet, point));
        overflow
    }
}

/// The shape of the tree, and the tetrahedra in its order.
pub(crate) fn halved(positions: &[Vec3], tets: &[[u32; 4]]) -> (Vec<Node>, Vec<u32>) {
    let centres: Vec<Vec3> =
        tets.iter().map(|t| t.iter().map(|&n| positions[n as usize]).sum::<Vec3>() * 0.25).collect();
    let (mut shape, mut order) = (Vec::new(), (0..tets.len() as u32).collect::<Vec<u32>>());
    halve(&centres, &mut order, &mut shape, 0, tets.len());
    (shape, order)
}

fn halve(centres: &[Vec3], order: &mut [u32], shape: &mut Vec<Node>, first: usize, last: usize) {
    let node = shape.len();
    shape.push(Node { first: first as u32, last: last as u32, right: 0 });
    if last - first <= LEAF {
        return;
    }
    let span = Extent::of(order[first..last].iter().map(|&t| &centres[t as usize]));
    let size: [f32; 3] = core::array::from_fn(|axis| span.high[axis] - span.low[axis]);
    let axis = (0..3).fold(0, |longest, axis| if size[axis] > size[longest] { axis } else { longest });
    let middle = (last - first) / 2;
    let along = |t: &u32| centres[*t as usize].to_array()[axis];
    order[first..last].select_nth_unstable_by(middle, |a, b| along(a).total_cmp(&along(b)).then(a.cmp(b)));
    halve(centres, order, shape, first, first + middle);
    shape[node].right = shape.len() as u32;
    halve(centres, order, shape, first + middle, last);
}
