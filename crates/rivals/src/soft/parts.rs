//! Elements of the moving rivals in blocks of sixteen lanes, f32, and passes over them.
//!
//! # Theory
//! As in `trepan-tled`: about a thousand neighbouring elements are a part. It copies its nodes'
//! rows, runs its blocks by the fastest kernel of this CPU, and adds its sums to the nodes. Change
//! of volume comes from the displacement gradient H without a difference of large numbers:
//! ```text
//! J - 1 = tr H + tr cof H + det H        cof F = (1 + tr H) I - Hᵀ + cof H
//! ```
//!
//! # Practice
//! A block has K rows of constants and four rows of node numbers. Unused lanes have zeros, and add
//! zero to the part's first node.

use glam::Vec4;
use std::cmp::Reverse;
use std::collections::BTreeMap;
use trepan_soft::simd::{Kernel, Lane, Layout, NODES, Pass, PassReport, Quad, WIDTH, dot};
use trepan_soft::{Body, Shape};

/// Elements of a part.
const PART: usize = 64 * WIDTH;
const _: () = assert!(4 * PART <= NODES);

/// One row of four numbers for each node of a part.
pub(super) type Rows = [Quad; NODES];

/// Sixteen elements with K constants and four nodes each.
#[derive(Clone)]
#[repr(C, align(64))]
pub(super) struct Block<const K: usize> {
    pub rows: [[f32; WIDTH]; K],
    pub nodes: [[u32; WIDTH]; 4],
}

/// Four nodes and K constants.
#[derive(Clone, Copy)]
pub(super) struct Item<const K: usize> {
    pub nodes: [u32; 4],
    pub constants: [f32; K],
}

/// What is done with every register of a block's elements.
pub(super) trait Action<const K: usize> {
    /// Reads `x` and adds to `sums`; gives the number of inverted elements. Always inlined.
    fn act<L: Lane>(&self, block: &mut Block<K>, lanes: usize, x: &mut Rows, sums: &mut Rows) -> u32;
}

/// All elements of a body.
pub(super) struct Parts<const K: usize> {
    parts: Vec<Part<K>>,
    x: Box<Rows>,
    sums: Box<Rows>,
    kernel: Kernel,
}

struct Part<const K: usize> {
    nodes: Vec<u32>,
    blocks: Vec<Block<K>>,
}

struct Run<'a, A, const K: usize> {
    action: &'a A,
    blocks: &'a mut [Block<K>],
    x: &'a mut Rows,
    sums: &'a mut Rows,
}

impl<A: Action<K>, const K: usize> Pass for Run<'_, A, K> {
    #[inline(always)]
    fn run<L: Lane>(&mut self) -> PassReport {
        let mut inverted = 0;
        for block in self.blocks.iter_mut() {
            for lanes in 0..WIDTH / L::LANES {
                inverted += self.action.act::<L>(block, lanes, self.x, self.sums);
            }
        }
        PassReport { inverted, ..PassReport::default() }
    }
}

impl<const K: usize> Parts<K> {
    /// Neighbours go to the same lane of different blocks, so that consecutive lanes seldom add to
    /// one node.
    pub fn spread(items: &[Item<K>]) -> Self {
        Self::of(items, |items| {
            let count = items.len().div_ceil(WIDTH);
            (0..count).map(|block| items.iter().skip(block).step_by(count).copied().collect()).collect()
        })
    }

    /// No two elements of a block share a node, so that all sixteen may move their nodes at once.
    /// Those whose nodes have the most elements left go first, so that the last blocks are full.
    pub fn disjoint(items: &[Item<K>]) -> Self {
        let is_apart = |a: &Item<K>, b: &Item<K>| !b.nodes.iter().any(|n| a.nodes.contains(n));
        Self::of(items, |items| {
            let (mut left, mut blocks) = (items.to_vec(), Vec::new());
            while !left.is_empty() {
                let mut around: BTreeMap<u32, u32> = BTreeMap::new();
                left.iter().flat_map(|item| item.nodes).for_each(|n| *around.entry(n).or_default() += 1);
                left.sort_by_cached_key(|item| Reverse(item.nodes.map(|n| around[&n]).iter().sum::<u32>()));
                let mut block: Vec<Item<K>> = Vec::new();
                left.retain(|item| {
                    let fits = block.len() < WIDTH && block.iter().all(|other| is_apart(item, other));
                    block.extend(fits.then_some(*item));
                    !fits
                });
                blocks.push(block);
            }
            blocks
        })
    }

    fn of(items: &[Item<K>], arrange: impl Fn(&[Item<K>]) -> Vec<Vec<Item<K>>>) -> Self {
        let part = |items: &[Item<K>]| {
            let mut nodes: Vec<u32> = items.iter().flat_map(|item| item.nodes).collect();
            nodes.sort_unstable();
            nodes.dedup();
            let blocks = arrange(items).iter().map(|items| Block::of(items, &nodes)).collect();
            Part { nodes, blocks }
        };
        Self {
            parts: items.chunks(PART).map(part).collect(),
            x: bytemuck::zeroed_box(),
            sums: bytemuck::zeroed_box(),
            kernel: Kernel::Fastest.resolved(),
        }
    }

    /// `to = Σ` of what the elements add, from `x` by node.
    pub fn sum(&mut self, action: &impl Action<K>, x: &[Vec4], to: &mut [Vec4]) -> u32 {
        to.fill(Vec4::ZERO);
        let mut inverted = 0;
        for part in &mut self.parts {
            self.x.iter_mut().zip(&part.nodes).for_each(|(row, &n)| *row = x[n as usize].to_array());
            self.sums[..part.nodes.len()].fill([0.0; 4]);
            let (x, sums) = (&mut *self.x, &mut *self.sums);
            inverted += self.kernel.run(&mut Run { action, blocks: &mut part.blocks, x, sums }).inverted;
            self.sums.iter().zip(&part.nodes).for_each(|(row, &n)| to[n as usize] += Vec4::from_array(*row));
        }
        inverted
    }

    /// Moves `x` by node, part after part.
    pub fn correct(&mut self, action: &impl Action<K>, x: &mut [Vec4]) -> u32 {
        let mut inverted = 0;
        for part in &mut self.parts {
            self.x.iter_mut().zip(&part.nodes).for_each(|(row, &n)| *row = x[n as usize].to_array());
            let (rows, sums) = (&mut *self.x, &mut *self.sums);
            inverted += self.kernel.run(&mut Run { action, blocks: &mut part.blocks, x: rows, sums }).inverted;
            self.x.iter().zip(&part.nodes).for_each(|(row, &n)| x[n as usize] = Vec4::from_array(*row));
        }
        inverted
    }
}

impl<const K: usize> Block<K> {
    fn of(items: &[Item<K>], nodes: &[u32]) -> Self {
        let mut block = Self { rows: [[0.0; WIDTH]; K], nodes: [[0; WIDTH]; 4] };
        for (lane, item) in items.iter().enumerate() {
            block.rows.iter_mut().zip(item.constants).for_each(|(row, constant)| row[lane] = constant);
            let own = item.nodes.map(|node| nodes.partition_point(|&n| n < node) as u32);
            block.nodes.iter_mut().zip(own).for_each(|(row, node)| row[lane] = node);
        }
        block
    }

    /// Node numbers of the lanes, corner by corner.
    #[inline(always)]
    pub fn corners<L: Lane>(&self, lanes: usize) -> [&[u32]; 4] {
        let (from, to) = (lanes * L::LANES, (lanes + 1) * L::LANES);
        let [o, a, b, c] = &self.nodes;
        [&o[from..to], &a[from..to], &b[from..to], &c[from..to]]
    }

    /// Vectors of nodes 1 to 3 less that of node 0.
    #[inline(always)]
    pub fn edges<L: Lane>(&self, lanes: usize, x: &Rows) -> [[L; 3]; 3] {
        let [o, a, b, c] = self.corners::<L>(lanes);
        let (o, a, b, c) = (L::gather(x, o), L::gather(x, a), L::gather(x, b), L::gather(x, c));
        [minus(&a, &o), minus(&b, &o), minus(&c, &o)]
    }

    /// Three rows from `first` on.
    #[inline(always)]
    pub fn vector<L: Lane>(&self, lanes: usize, first: usize) -> [L; 3] {
        [self.number(lanes, first), self.number(lanes, first + 1), self.number(lanes, first + 2)]
    }

    /// Nine rows from `first` on: gradients of the shape functions 1 to 3, 1/mm.
    #[inline(always)]
    pub fn gradients<L: Lane>(&self, lanes: usize, first: usize) -> [[L; 3]; 3] {
        [self.vector(lanes, first), self.vector(lanes, first + 3), self.vector(lanes, first + 6)]
    }

    /// One row.
    #[inline(always)]
    pub fn number<L: Lane>(&self, lanes: usize, row: usize) -> L {
        L::load(&self.rows[row], lanes)
    }

    /// Adds vectors to nodes 1 to 3, and takes their sum from node 0.
    #[inline(always)]
    pub fn add<L: Lane>(&self, lanes: usize, [f, g, h]: [[L; 3]; 3], to: &mut Rows) {
        let zero = L::splat(0.0);
        let o = [zero - (f[0] + g[0] + h[0]), zero - (f[1] + g[1] + h[1]), zero - (f[2] + g[2] + h[2])];
        L::add_rows([o, f, g, h], to, self.corners::<L>(lanes));
    }
}

/// Tetrahedra of a body in the order of `trepan-tled`, with constants of each.
pub(super) fn tetrahedra<const K: usize>(body: &Body, constants: impl Fn(usize) -> [f32; K]) -> Vec<Item<K>> {
    let item = |&t: &u32| Item { nodes: body.mesh.tets[t as usize], constants: constants(t as usize) };
    Layout::of(body).tet_at.iter().map(item).collect()
}

/// Gradients of the shape functions 1 to 3, 1/mm.
pub(super) fn gradients_of(shape: &Shape) -> [f32; 9] {
    std::array::from_fn(|i| shape.gradients[1 + i / 3][i % 3] as f32)
}

/// The displacement gradient of an element, and how its volume changes.
pub(super) struct Motion<L> {
    /// Rows of H.
    pub h: [[L; 3]; 3],
    cofactor: [[L; 3]; 3],
    trace: L,
    /// J - 1.
    pub excess: L,
}

impl<L: Lane> Motion<L> {
    /// From `u_a - u_0` and ∇N_a, a = 1..3.
    #[inline(always)]
    pub fn of(edges: &[[L; 3]; 3], gradients: &[[L; 3]; 3]) -> Self {
        let h = product(edges, gradients);
        let cofactor = [cross(&h[1], &h[2]), cross(&h[2], &h[0]), cross(&h[0], &h[1])];
        let trace = h[0][0] + h[1][1] + h[2][2];
        let excess = trace + (cofactor[0][0] + cofactor[1][1] + cofactor[2][2]) + dot(&h[0], &cofactor[0]);
        Self { h, cofactor, trace, excess }
    }

    /// Rows of cof F - I.
    #[inline(always)]
    pub fn cofactor_less_one(&self) -> [[L; 3]; 3] {
        let (h, c, t) = (&self.h, &self.cofactor, self.trace);
        [
            [c[0][0] + t - h[0][0], c[0][1] - h[1][0], c[0][2] - h[2][0]],
            [c[1][0] - h[0][1], c[1][1] + t - h[1][1], c[1][2] - h[2][1]],
            [c[2][0] - h[0][2], c[2][1] - h[1][2], c[2][2] + t - h[2][2]],
        ]
    }

    /// Number of lanes with J ≤ 0.
    #[inline(always)]
    pub fn inverted(&self) -> u32 {
        (L::splat(1.0) + self.excess).not_positive()
    }
}

/// `Σ e_a ⊗ g_a` by rows.
#[inline(always)]
pub(super) fn product<L: Lane>([a, b, c]: &[[L; 3]; 3], [g, h, i]: &[[L; 3]; 3]) -> [[L; 3]; 3] {
    [row(a[0], b[0], c[0], g, h, i), row(a[1], b[1], c[1], g, h, i), row(a[2], b[2], c[2], g, h, i)]
}

#[inline(always)]
fn row<L: Lane>(a: L, b: L, c: L, g: &[L; 3], h: &[L; 3], i: &[L; 3]) -> [L; 3] {
    [a * g[0] + b * h[0] + c * i[0], a * g[1] + b * h[1] + c * i[1], a * g[2] + b * h[2] + c * i[2]]
}

/// A matrix by rows times each of three vectors.
#[inline(always)]
pub(super) fn times<L: Lane>(m: &[[L; 3]; 3], [g, h, i]: &[[L; 3]; 3]) -> [[L; 3]; 3] {
    [applied(m, g), applied(m, h), applied(m, i)]
}

/// A matrix by rows times a vector.
#[inline(always)]
pub(super) fn applied<L: Lane>(m: &[[L; 3]; 3], v: &[L; 3]) -> [L; 3] {
    [dot(&m[0], v), dot(&m[1], v), dot(&m[2], v)]
}

/// a + b.
#[inline(always)]
pub(super) fn plus<L: Lane>(a: &[L; 3], b: &[L; 3]) -> [L; 3] {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

/// a - b.
#[inline(always)]
pub(super) fn minus<L: Lane>(a: &[L; 3], b: &[L; 3]) -> [L; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// a times a number.
#[inline(always)]
pub(super) fn scaled<L: Lane>(a: &[L; 3], by: L) -> [L; 3] {
    [a[0] * by, a[1] * by, a[2] * by]
}

#[inline(always)]
fn cross<L: Lane>(a: &[L; 3], b: &[L; 3]) -> [L; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// Small-strain stress times volume, `λV tr H I + μV (H + Hᵀ)`.
#[inline(always)]
pub(super) fn hooke<L: Lane>(h: &[[L; 3]; 3], lambda: L, mu: L) -> [[L; 3]; 3] {
    let pressure = lambda * (h[0][0] + h[1][1] + h[2][2]);
    let (xy, xz, yz) = (mu * (h[0][1] + h[1][0]), mu * (h[0][2] + h[2][0]), mu * (h[1][2] + h[2][1]));
    let twice = mu + mu;
    [[pressure + twice * h[0][0], xy, xz], [xy, pressure + twice * h[1][1], yz], [xz, yz, pressure + twice * h[2][2]]]
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DMat3;
    use proptest::prelude::*;
    use trepan_geometry::Vec3;
    use trepan_soft::{Material, boxes};

    #[test]
    fn elements_of_a_disjoint_block_share_no_node_and_blocks_are_nearly_full() {
        let body = Body::uniform(boxes::split_box([8; 3], Vec3::splat(40.0)), vec![], Material::BRAIN);
        let parts = Parts::disjoint(&tetrahedra(&body, |_| [1.0]));
        let mut lanes = 0;
        for block in parts.parts.iter().flat_map(|part| &part.blocks) {
            let used: Vec<usize> = (0..WIDTH).filter(|&lane| block.rows[0][lane] > 0.0).collect();
            let mut nodes: Vec<u32> = used.iter().flat_map(|&lane| block.nodes.map(|row| row[lane])).collect();
            nodes.sort_unstable();
            nodes.dedup();
            assert_eq!(nodes.len(), 4 * used.len());
            lanes += WIDTH;
        }
        assert!(lanes * 10 < 11 * body.mesh.tets.len(), "{lanes} lanes for {} elements", body.mesh.tets.len());
    }

    proptest! {
        #[test]
        fn the_change_of_volume_keeps_its_digits_at_small_strain(x in proptest::array::uniform9(-1.0f32..1.0), scale in 1e-6f32..1.0) {
            let h = x.map(|x| x * scale);
            let edges = [[h[0], h[3], h[6]], [h[1], h[4], h[7]], [h[2], h[5], h[8]]];
            let motion = Motion::of(&edges, &[[1.0f32, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]);
            let f = DMat3::from_cols_array(&h.map(f64::from)).transpose() + DMat3::IDENTITY;
            prop_assert!((f64::from(motion.excess) - (f.determinant() - 1.0)).abs() < 2e-6 * f64::from(scale));
            let c = trepan_soft::cofactor(f) - DMat3::IDENTITY;
            for (j, row) in motion.cofactor_less_one().iter().enumerate() {
                prop_assert!((0..3).all(|k| (f64::from(row[k]) - c.col(k)[j]).abs() < 2e-6 * f64::from(scale)));
            }
        }
    }
}
