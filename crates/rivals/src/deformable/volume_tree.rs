//! A tree of bounding volumes over the tetrahedra, asked with the tool's box in one descent and
//! refitted only where the tool is.
//!
//! # Theory
//! The tree is made at rest by halving the tetrahedra at the median of their centres along the
//! longest side, and keeps its shape. A volume is fitted to the nodes below it. Later it counts as
//! wider by as much as any node can have moved since (`motion.rs`); where the tool's box meets a
//! volume whose margin has grown over a tenth of its size, it is fitted anew.
//!
//! ```text
//!      [0]         one volume for each node, of any kind: box, ball, k-DOP, turned box
//!     /   \
//!   [1]   [4]      the tool's box goes down where it meets a volume with its margin
//!   / \   / \
//! [2] [3] …        a leaf: its tetrahedra's own boxes, then points against those
//! ```
//!
//! # Practice
//! One pass over the coordinates of all nodes, then O(log tetrahedra) and what lies near the tool;
//! a large volume is fitted seldom, since its margin may grow more. The last test is against the
//! tetrahedron's own box, so that all kinds give the same pairs.
//!
//! # When not to use it
//! When all nodes leap in every step: each look then fits every volume on the way down.
//!
//! # Sources
//! Van den Bergen 1997, section 4: the tree keeps its shape and all of it is refitted, children
//! before parents, in every step. Larsson and Akenine-Möller 2001: what is not looked at need not
//! be refitted. Liberties: fitted to the mesh instead of to children, which is as tight as it can
//! be; margins by the largest motion, in place of James and Pai 2004, whose balls take theirs from
//! reduced coordinates: a mesh of free nodes has none.

use super::motion::{Fitted, Motion};
use trepan_deformable::kit::Extent;
use trepan_deformable::kit::distinct_rows;
use trepan_deformable::kit::{BroadPhase, Indexed, Phased, box_of};
use trepan_deformable::search::UniformGrid;
use trepan_deformable::{Search, SearchInputs};
use trepan_geometry::{Aabb, Vec3};
use trepan_mesh::Csr;

/// Something that holds points.
pub trait Volume: Copy + Send {
    /// The volume of some finite points, at least one.
    fn around(points: impl Iterator<Item = Vec3> + Clone) -> Self;

    /// Whether it meets a box from `low` to `high` when it is wider by a margin along each axis,
    /// mm. True in doubt.
    fn meets(&self, low: Vec3, high: Vec3, margin_mm: f32) -> bool;

    /// Its longest side or diameter, mm.
    fn size_mm(&self) -> f32;
}

/// A binary tree of bounding volumes.
#[derive(Debug)]
pub struct VolumeTree<V> {
    volumes: Vec<V>,
    fitted: Vec<Fitted>,
    shape: Vec<Node>,
    order: Vec<u32>,
    /// Mesh nodes below each node of the tree.
    nodes: Csr,
    motion: Motion,
    near: Indexed<UniformGrid>,
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

/// Margin over which a volume is fitted anew, as a share of its size.
const LOOSE: f32 = 0.1;

impl<V: Volume> VolumeTree<V> {
    /// A tree over a mesh at rest, halved from the top.
    pub fn new(inputs: &SearchInputs) -> Self {
        Self::of_shape(inputs, halved(&inputs.mesh.positions, &inputs.mesh.tets))
    }

    /// A tree of any shape, with the tetrahedra in its order.
    pub(crate) fn of_shape(inputs: &SearchInputs, (shape, order): (Vec<Node>, Vec<u32>)) -> Self {
        let (positions, tets) = (&inputs.mesh.positions, &inputs.mesh.tets);
        let nodes = distinct_rows(shape.iter().map(|n| n.tets(&order).iter().flat_map(|&t| tets[t as usize])));
        let (motion, now) = Motion::of(positions);
        let volume = |at: usize| V::around(nodes.row(at).iter().map(|&n| positions[n as usize]));
        Self {
            volumes: (0..shape.len()).map(volume).collect(),
            fitted: vec![now; shape.len()],
            motion,
            near: Indexed::new(UniformGrid::new(inputs.cell_mm, inputs.points), tets.len()),
            nodes,
            shape,
            order,
        }
    }

    /// Lists the tetrahedra below a node whose boxes meet the region.
    fn descend(&mut self, at: usize, positions: &[Vec3], tets: &[[u32; 4]], region: &Extent) {
        let (low, high) = (region.low.into(), region.high.into());
        let margin_mm = self.motion.since(self.fitted[at]);
        if !self.volumes[at].meets(low, high, margin_mm) {
            return;
        }
        if margin_mm > LOOSE * self.volumes[at].size_mm() {
            let places = &self.motion.places;
            self.volumes[at] = V::around(self.nodes.row(at).iter().map(|&n| places[n as usize]));
            self.fitted[at] = self.motion.now();
            if !self.volumes[at].meets(low, high, 0.0) {
                return;
            }
        }
        let node = self.shape[at];
        if node.right != 0 {
            self.descend(at + 1, positions, tets, region);
            return self.descend(node.right as usize, positions, tets, region);
        }
        for &t in node.tets(&self.order) {
            self.near.offer(t, box_of(positions, &tets[t as usize]), region);
        }
    }
}

/// The search by a tree of such volumes.
pub(crate) fn search<V: Volume + 'static>(inputs: &SearchInputs) -> Box<dyn Search> {
    Box::new(Phased::new(VolumeTree::<V>::new(inputs), inputs.points))
}

impl<V: Volume> BroadPhase for VolumeTree<V> {
    fn update(&mut self, positions: &[Vec3], tets: &[[u32; 4]], region: &Aabb) {
        self.motion.follow(positions);
        self.near.clear();
        self.descend(0, positions, tets, &Extent::from(*region));
        self.near.sort();
    }

    fn pairs(&mut self, points: &[Vec3], out: &mut Vec<[u32; 2]>) -> u32 {
        self.near.pairs(points, out)
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
