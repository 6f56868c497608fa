//! The triangles of a body's membrane: blocks of sixteen, and the pass of their forces.
//!
//! # Theory
//! See [`Membrane`](trepan_soft::Membrane) for the law. The strain is taken from displacements, so
//! that a membrane at rest has exactly no tension: with the axes e in the plane and the gradient h
//! of the displacement, `F = e + h` and `C - 1 = e·h + h·e + h·h`.
//!
//! Explicit steps bear the membrane by mass m on its corners, from the bound k of a triangle's
//! stiffness ([`Membrane::stiffest`](trepan_soft::Membrane::stiffest)). It has no weight, so
//! equilibria stay. Without averaged accelerations `m = dt²/4 k` keeps `dt² (K + K_m)` within
//! `4 (M + M_m)`. With them `m = dt²/12 k`, averaged over the triangle like a tetrahedron's:
//! `dt² K_m ≤ 12 R_m`, and the proof of `averaging.rs` holds with the sums `M + M_m` and `R + R_m`.
//! That is for steps up to the recommended one, which has a margin for the elements only.

use crate::block::{load, minus};
use trepan_soft::simd::{Lane, Layout, NODES, Pass, PassReport, Quad, WIDTH, dot};
use trepan_soft::{Body, Membrane};

/// Sixteen triangles. Unused lanes have no stiffness and add zero to node 0.
#[derive(Clone)]
#[repr(C, align(64))]
pub(crate) struct SheetBlock {
    /// Gradients of corners 1 and 2 along both axes, 1/mm.
    gradients: [[[f32; WIDTH]; 2]; 2],
    axes: [[[f32; WIDTH]; 3]; 2],
    /// Shear modulus times volume, N mm.
    stiffness: [f32; WIDTH],
    nodes: [[u32; WIDTH]; 3],
}

/// Triangles by place, in an order in which neighbours are close, for parts of at most `most`.
pub(crate) fn sheets(membrane: &Membrane, layout: &Layout, most: usize) -> Vec<Vec<u32>> {
    let places = |&t: &u32| membrane.triangles[t as usize].map(|n| layout.place_of[n as usize]);
    let mut order: Vec<u32> = if membrane.is_none() { vec![] } else { (0..membrane.triangles.len() as u32).collect() };
    order.sort_by_cached_key(|t| {
        let mut places = places(t);
        places.sort_unstable();
        (places, *t)
    });
    order.chunks(most).map(<[u32]>::to_vec).collect()
}

/// Blocks of some triangles whose nodes have numbers by `nodes`.
pub(crate) fn blocks(body: &Body, triangles: &[u32], nodes: impl Fn(u32) -> u32) -> Vec<SheetBlock> {
    let zero = [0.0; WIDTH];
    let empty = SheetBlock { gradients: [[zero; 2]; 2], axes: [[zero; 3]; 2], stiffness: zero, nodes: [[0; WIDTH]; 3] };
    let mut blocks = vec![empty; triangles.len().div_ceil(WIDTH)];
    let count = blocks.len();
    for (at, &t) in triangles.iter().enumerate() {
        let (block, lane) = (&mut blocks[at % count], at / count);
        let shape = body.membrane.shape(t as usize, &body.mesh.positions);
        for k in 0..2 {
            let along = shape.gradients.map(|g| g[k] as f32);
            (0..2).for_each(|corner| block.gradients[corner][k][lane] = along[corner + 1]);
            (0..3).for_each(|i| block.axes[k][i][lane] = shape.axes[k][i] as f32);
        }
        block.stiffness[lane] = (f64::from(body.membrane.shear_n_per_mm) * shape.area_mm2) as f32;
        let corners = body.membrane.triangles[t as usize];
        (0..3).for_each(|corner| block.nodes[corner][lane] = nodes(corners[corner]));
    }
    blocks
}

/// The force pass.
pub(crate) struct SheetForces<'a> {
    pub blocks: &'a [SheetBlock],
    pub u: &'a [Quad; NODES],
    pub sums: &'a mut [Quad; NODES],
}

impl Pass for SheetForces<'_> {
    #[inline(always)]
    fn run<L: Lane>(&mut self) -> PassReport {
        for block in self.blocks {
            for part in 0..WIDTH / L::LANES {
                let lanes = part * L::LANES..(part + 1) * L::LANES;
                let [o, a, b] = block.nodes.each_ref().map(|corner| &corner[lanes.clone()]);
                let [fa, fb] =
                    block.forces::<L>(part, [L::gather(self.u, o), L::gather(self.u, a), L::gather(self.u, b)]);
                let zero = L::splat(0.0);
                let fo = [zero - (fa[0] + fb[0]), zero - (fa[1] + fb[1]), zero - (fa[2] + fb[2])];
                L::add_rows([fo, fa, fb, [zero; 3]], self.sums, [o, a, b, o]);
            }
        }
        PassReport::default()
    }
}

impl SheetBlock {
    /// Leaves a triangle a share of its stiffness.
    pub fn fill(&mut self, lane: usize, body: &Body, triangle: u32, share: f64) {
        let area_mm2 = body.membrane.shape(triangle as usize, &body.mesh.positions).area_mm2;
        self.stiffness[lane] = (share * f64::from(body.membrane.shear_n_per_mm) * area_mm2) as f32;
    }

    /// Forces on corners 1 and 2 from the displacements of all three.
    #[inline(always)]
    fn forces<L: Lane>(&self, part: usize, [o, a, b]: [[L; 3]; 3]) -> [[L; 3]; 2] {
        let (zero, half, one) = (L::splat(0.0), L::splat(0.5), L::splat(1.0));
        let gradients = [load::<L, 2>(&self.gradients[0], part), load::<L, 2>(&self.gradients[1], part)];
        let axes = [load::<L, 3>(&self.axes[0], part), load::<L, 3>(&self.axes[1], part)];
        let (a, b) = (minus(&a, &o), minus(&b, &o));
        let mut turned = [[zero; 3]; 2];
        let mut f = axes;
        for k in 0..2 {
            for i in 0..3 {
                turned[k][i] = a[i] * gradients[0][k] + b[i] * gradients[1][k];
                f[k][i] = axes[k][i] + turned[k][i];
            }
        }
        let [h, g] = turned;
        let first = dot(&h, &axes[0]) + dot(&h, &f[0]);
        let second = dot(&g, &axes[1]) + dot(&g, &f[1]);
        let shear = dot(&axes[0], &g) + dot(&h, &f[1]);
        let (mean, half_apart) = (half * (first + second), half * (first - second));
        let radius = (half_apart * half_apart + shear * shear).sqrt();
        let wide = (one + mean + radius).at_least(1e-6);
        let narrow = (one + mean - radius).larger(one / wide.sqrt());
        let along = (one - one / (wide * wide * narrow)).at_least(0.0);
        let across = (one - one / (narrow * narrow * wide)).at_least(0.0);
        let stiffness = L::load(&self.stiffness, part);
        let round = stiffness * half * (along + across);
        let turn = stiffness * half * (along - across) / radius.at_least(1e-9);
        let (xx, yy, xy) = (round + turn * half_apart, round - turn * half_apart, turn * shear);
        let mut forces = [[zero; 3]; 2];
        for i in 0..3 {
            let (px, py) = (f[0][i] * xx + f[1][i] * xy, f[0][i] * xy + f[1][i] * yy);
            for corner in 0..2 {
                forces[corner][i] = zero - (px * gradients[corner][0] + py * gradients[corner][1]);
            }
        }
        forces
    }
}
