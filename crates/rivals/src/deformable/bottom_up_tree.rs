//! A tree of boxes that is built from the tetrahedra upwards.
//!
//! # Theory
//! Neighbouring volumes are joined to pairs, pairs to pairs of pairs, until one is left (thesis
//! 2.1.2). On each level the volumes stand in their order along one axis curve, and each takes the
//! one of the next few with which its box stays smallest.
//!
//! # Practice
//! Asked and refitted as `volume_tree.rs`; only the shape differs. Built in O(n log n).
//!
//! # Sources
//! Thesis 2.1.2; Omohundro 1989, bottom-up construction. Liberties: a volume looks at the next
//! eight only, where Omohundro looks at all; the first order is that of the halved tree.

use super::Aabox;
use super::volume_tree::{LEAF, Node, VolumeTree, halved};
use trepan_deformable::Descriptor;
use trepan_deformable::kit::Extent;
use trepan_deformable::kit::{Phased, box_of};
use trepan_geometry::Vec3;

/// How many of the next volumes each looks at.
const AHEAD: usize = 8;

/// A volume of a level: its box, the tetrahedra in it, and its parts.
struct Cluster {
    bounds: Extent,
    count: usize,
    parts: Parts,
}

enum Parts {
    Tet(u32),
    Two(Box<[Cluster; 2]>),
}

impl Cluster {
    fn of(a: Self, b: Self) -> Self {
        let mut bounds = a.bounds;
        bounds.merge(&b.bounds);
        Self { bounds, count: a.count + b.count, parts: Parts::Two(Box::new([a, b])) }
    }

    /// Half the surface of the box of two, mm².
    fn surface_with(&self, other: &Self) -> f32 {
        let mut both = self.bounds;
        both.merge(&other.bounds);
        let [x, y, z] = (both.high - both.low).to_array();
        x * y + y * z + z * x
    }

    /// Lists the tetrahedra below.
    fn list(&self, order: &mut Vec<u32>) {
        match &self.parts {
            Parts::Tet(tet) => order.push(*tet),
            Parts::Two(two) => two.iter().for_each(|part| part.list(order)),
        }
    }

    /// Lists the tree below, parents first; few tetrahedra are a leaf.
    fn flatten(&self, shape: &mut Vec<Node>, order: &mut Vec<u32>) {
        let (node, first) = (shape.len(), order.len() as u32);
        shape.push(Node { first, last: first + self.count as u32, right: 0 });
        match &self.parts {
            Parts::Two(two) if self.count > LEAF => {
                two[0].flatten(shape, order);
                shape[node].right = shape.len() as u32;
                two[1].flatten(shape, order);
            }
            _ => self.list(order),
        }
    }
}

/// The shape of the tree, and the tetrahedra in its order.
fn joined(positions: &[Vec3], tets: &[[u32; 4]]) -> (Vec<Node>, Vec<u32>) {
    let (_, start) = halved(positions, tets);
    let leaf = |&t: &u32| Cluster { bounds: box_of(positions, &tets[t as usize]), count: 1, parts: Parts::Tet(t) };
    let mut level: Vec<Option<Cluster>> = start.iter().map(|t| Some(leaf(t))).collect();
    while level.len() > 1 {
        let mut next = Vec::with_capacity(level.len().div_ceil(2));
        for at in 0..level.len() {
            let Some(own) = level[at].take() else { continue };
            let ahead = (at + 1..level.len().min(at + 1 + AHEAD)).filter_map(|k| Some((k, level[k].as_ref()?)));
            let best = ahead.min_by(|a, b| own.surface_with(a.1).total_cmp(&own.surface_with(b.1))).map(|(k, _)| k);
            let other = best.and_then(|k| level[k].take());
            next.push(Some(match other {
                Some(other) => Cluster::of(own, other),
                None => own,
            }));
        }
        level = next;
    }
    let (mut shape, mut order) = (Vec::new(), Vec::with_capacity(tets.len()));
    level.iter().flatten().for_each(|root| root.flatten(&mut shape, &mut order));
    (shape, order)
}

/// The tree of boxes built from below.
pub const METHOD: Descriptor = Descriptor::of("bottom-up-tree", "thesis 2.1.2; Omohundro 1989", |inputs| {
    let shape = joined(&inputs.mesh.positions, &inputs.mesh.tets);
    Box::new(Phased::new(VolumeTree::<Aabox>::of_shape(inputs, shape), inputs.points))
});
