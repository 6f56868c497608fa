//! Blocks of sixteen tetrahedra (structure of arrays) and the two passes over them.
//!
//! # Theory
//! The force pass turns displacements into forces. With averaged pressure a volume pass comes
//! before it: each node group gets the mean `J - 1` of its elements, weighted by volume, and the
//! force pass uses the mean of its four node groups instead of the element's own `J - 1`. This is
//! the averaged nodal pressure of Bonet and Burton 1998, material by material as in Joldes, Wittek
//! and Miller 2009 (see `node_groups.rs`).
//!
//! # Practice
//! A tetrahedron has 84 bytes of constants, and 48 more for the stress memory. With averaged
//! pressure it has 40 more for F and J, which the volume pass hands to the force pass: that reads
//! them in a row instead of its nodes' displacements. Node numbers refer to the part that the
//! block belongs to. Forces are added lane by lane for every register width, so that every kernel
//! sums in the same order.

use crate::dynamic_scaling::{Added, Borne, DynamicScaling};
use crate::element::{deformation, deformation_of, forces};
use crate::law::{Constitutive, Deformation, Stress};
use crate::relaxation::{Fade, PRONY_TERMS};
use crate::stiffness::{stiffness, stiffness_at_rest};
use std::marker::PhantomData;
use trepan_soft::simd::{Lane, NODES, Quad, WIDTH};
use trepan_soft::simd::{Pass, PassReport};
use trepan_soft::{Law, Material, Shape, element_omega2};

/// Sixteen tetrahedra with K material constants each. Unused lanes have zero stiffness and add zero
/// to node 0.
#[derive(Clone)]
#[repr(C, align(64))]
pub(crate) struct Block<const K: usize> {
    gradients: [[[f32; WIDTH]; 3]; 3],
    constants: [[f32; WIDTH]; K],
    /// Quarter of the element's volume, mm³.
    quarter_volume: [f32; WIDTH],
    /// The element's ω² at rest divided by its stiffness at rest.
    omega2: [f32; WIDTH],
    nodes: [[u32; WIDTH]; 4],
}

/// Stress memory of a block, T Prony terms.
pub(crate) type Memory<const T: usize> = [[[f32; WIDTH]; 6]; T];

/// F by rows and det F of a block, from the volume pass for the force pass.
#[derive(Clone)]
#[repr(C, align(64))]
pub(crate) struct Strain {
    f: [[[f32; WIDTH]; 3]; 3],
    j: [f32; WIDTH],
}

/// The force pass.
pub(crate) struct Forces<'a, M, const K: usize, const T: usize> {
    pub blocks: &'a [Block<K>],
    pub memory: &'a mut [Memory<T>],
    pub fade: [Fade; PRONY_TERMS],
    pub u: &'a [Quad; NODES],
    /// Of every block with averaged pressure, else empty.
    pub strains: &'a [Strain],
    /// Mean `J - 1` by node; read with averaged pressure only.
    pub averages: &'a [f32; NODES],
    pub sums: &'a mut [Quad; NODES],
    pub borne: &'a [Borne],
    pub dynamic: DynamicScaling,
    /// Mass for nodes of stiffened elements, by node of the part.
    pub added: &'a mut Vec<Added>,
    pub law: PhantomData<M>,
}

/// The volume pass.
pub(crate) struct Volumes<'a, const K: usize> {
    pub blocks: &'a [Block<K>],
    pub u: &'a [Quad; NODES],
    pub strains: &'a mut [Strain],
    /// `Σ V (J - 1) / 4` by node, mm³.
    pub shares: &'a mut [f32; NODES],
}

impl Strain {
    /// No deformation.
    pub const NONE: Self = {
        let (zero, one) = ([0.0; WIDTH], [1.0; WIDTH]);
        Self { f: [[one, zero, zero], [zero, one, zero], [zero, zero, one]], j: one }
    };

    #[inline(always)]
    fn store<L: Lane>(&mut self, d: &Deformation<L>, part: usize) {
        for (row, f) in self.f.as_flattened_mut().iter_mut().zip(d.f.as_flattened()) {
            f.store(row, part);
        }
        d.j.store(&mut self.j, part);
    }

    #[inline(always)]
    fn deformation<L: Lane>(&self, part: usize) -> Deformation<L> {
        let [a, b, c] = &self.f;
        deformation_of([load(a, part), load(b, part), load(c, part)], L::load(&self.j, part))
    }
}

impl<const K: usize> Block<K> {
    /// Creates a block without elements.
    pub fn empty() -> Self {
        Self {
            gradients: [[[0.0; WIDTH]; 3]; 3],
            constants: [[0.0; WIDTH]; K],
            quarter_volume: [0.0; WIDTH],
            omega2: [0.0; WIDTH],
            nodes: [[0; WIDTH]; 4],
        }
    }

    /// Puts an element into a lane, with a factor on its density.
    pub fn put<M: Constitutive<K>>(
        &mut self,
        lane: usize,
        (shape, material, density): (&Shape, &Material, f64),
        nodes: [u32; 4],
    ) {
        for a in 0..3 {
            let gradient = shape.gradients[a + 1].as_vec3();
            (0..3).for_each(|k| self.gradients[a][k][lane] = gradient[k]);
        }
        let constants = M::constants(&material.law(), shape.volume_mm3);
        self.constants.iter_mut().zip(constants).for_each(|(row, constant)| row[lane] = constant);
        self.omega2[lane] = omega2_over_stiffness::<M, K>(shape, material, &constants) / density as f32;
        self.quarter_volume[lane] = (0.25 * shape.volume_mm3) as f32;
        for corner in 0..4 {
            self.nodes[corner][lane] = nodes[corner];
        }
    }

    /// Leaves an element this volume, mm³; without any it does not deform either.
    pub fn fill<M: Constitutive<K>>(&mut self, lane: usize, law: &Law, volume_mm3: f64) {
        let constants = M::constants(law, volume_mm3);
        self.constants.iter_mut().zip(constants).for_each(|(row, constant)| row[lane] = constant);
        self.quarter_volume[lane] = (0.25 * volume_mm3) as f32;
        if volume_mm3 == 0.0 {
            self.gradients.as_flattened_mut().iter_mut().for_each(|row| row[lane] = 0.0);
        }
    }

    #[inline(always)]
    fn gradients<L: Lane>(&self, part: usize) -> [[L; 3]; 3] {
        let [a, b, c] = &self.gradients;
        [load(a, part), load(b, part), load(c, part)]
    }

    /// Deformation from the nodes' displacements.
    #[inline(always)]
    fn deformation<L: Lane>(&self, part: usize, u: &[Quad; NODES]) -> Deformation<L> {
        let [o, a, b, c] = self.corners::<L>(part);
        let (o, a, b, c) = (L::gather(u, o), L::gather(u, a), L::gather(u, b), L::gather(u, c));
        deformation(&[minus(&a, &o), minus(&b, &o), minus(&c, &o)], &self.gradients::<L>(part))
    }

    /// Node numbers of the lanes, corner by corner.
    #[inline(always)]
    fn corners<L: Lane>(&self, part: usize) -> [&[u32]; 4] {
        let (from, to) = (part * L::LANES, (part + 1) * L::LANES);
        let [o, a, b, c] = &self.nodes;
        [&o[from..to], &a[from..to], &b[from..to], &c[from..to]]
    }
}

/// An element's ω² divided by its stiffness, both at rest. Multiplied by the present stiffness it
/// gives the present ω².
pub(crate) fn omega2_over_stiffness<M: Constitutive<K>, const K: usize>(
    shape: &Shape,
    material: &Material,
    constants: &[f32; K],
) -> f32 {
    let at_rest = stiffness_at_rest(M::at_rest(constants), M::moduli(constants));
    (element_omega2(shape, material) / f64::from(at_rest)) as f32
}

impl<M: Constitutive<K>, const K: usize, const T: usize> Pass for Forces<'_, M, K, T> {
    #[inline(always)]
    fn run<L: Lane>(&mut self) -> PassReport {
        if self.strains.is_empty() { self.sum::<L, false>() } else { self.sum::<L, true>() }
    }
}

impl<M: Constitutive<K>, const K: usize, const T: usize> Forces<'_, M, K, T> {
    /// Adds up the forces, with averaged pressure if A.
    #[inline(always)]
    fn sum<L: Lane, const A: bool>(&mut self) -> PassReport {
        let (mut inverted, mut growth) = (0, L::splat(0.0));
        for (i, (block, memory)) in self.blocks.iter().zip(self.memory.iter_mut()).enumerate() {
            for part in 0..WIDTH / L::LANES {
                let corners = block.corners::<L>(part);
                let (gradients, constants) = (block.gradients::<L>(part), load::<L, K>(&block.constants, part));
                let d = if A { self.strains[i].deformation::<L>(part) } else { block.deformation::<L>(part, self.u) };
                let mut stress = M::stress(&constants, &d);
                let (own, (resistance, slope)) = (d.j - L::splat(1.0), d.resistance(M::WALL));
                let volume_change = if A { L::mean(self.averages, corners) } else { own } - resistance;
                let moduli = M::moduli(&constants);
                let gained = stiffness(&stress, moduli, &d, (volume_change, slope))
                    - stiffness_at_rest(M::at_rest(&constants), moduli);
                let grown = L::load(&block.omega2, part) * gained;
                growth = if (L::load(&self.borne[i].growth, part) - grown).not_positive() > 0 {
                    self.dynamic.weigh(grown, part, (block.corners::<L>(part), &self.borne[i]), self.added)
                } else {
                    // What it bears by its share of averaging needs no shorter step.
                    grown.larger(L::splat(0.0)).smaller(self.dynamic.limit)
                }
                .larger(growth);
                if T > 0 {
                    relax::<L, T>(&mut stress, &d.inverse_green(), memory, &self.fade, part);
                }
                stress.q = stress.q + moduli.1 * volume_change;
                let [f1, f2, f3] = forces(&stress, M::ROUND && T == 0, &d, &gradients);
                let zero = L::splat(0.0);
                let f0 =
                    [zero - (f1[0] + f2[0] + f3[0]), zero - (f1[1] + f2[1] + f3[1]), zero - (f1[2] + f2[2] + f3[2])];
                L::add_rows([f0, f1, f2, f3], self.sums, corners);
                inverted += d.j.not_positive();
            }
        }
        PassReport { inverted, growth: growth.largest() }
    }
}

impl<const K: usize> Pass for Volumes<'_, K> {
    #[inline(always)]
    fn run<L: Lane>(&mut self) -> PassReport {
        // Shares are added while the next elements' are computed: neither waits for the other.
        let mut late: Option<(L, [&[u32]; 4])> = None;
        for (block, strain) in self.blocks.iter().zip(self.strains.iter_mut()) {
            for part in 0..WIDTH / L::LANES {
                let d = block.deformation::<L>(part, self.u);
                strain.store(&d, part);
                let share = L::load(&block.quarter_volume, part) * (d.j - L::splat(1.0));
                if let Some((share, corners)) = late.replace((share, block.corners::<L>(part))) {
                    share.add_to(self.shares, corners);
                }
            }
        }
        if let Some((share, corners)) = late {
            share.add_to(self.shares, corners);
        }
        PassReport::default()
    }
}

/// Updates the stress memory with the isochoric stress, and subtracts the memory from it.
#[inline(always)]
fn relax<L: Lane, const T: usize>(
    stress: &mut Stress<L>,
    inverse: &[L; 6],
    memory: &mut Memory<T>,
    fade: &[Fade; PRONY_TERMS],
    part: usize,
) {
    let mut left = stress.s;
    for k in 0..6 {
        let whole = stress.s[k] + stress.q * inverse[k];
        for term in 0..T {
            let row = &mut memory[term][k];
            let kept = L::splat(fade[term].keep) * L::load(row, part) + L::splat(fade[term].gain) * whole;
            kept.store(row, part);
            left[k] = left[k] - kept;
        }
    }
    stress.s = left;
}

#[inline(always)]
pub(crate) fn minus<L: Lane>(a: &[L; 3], b: &[L; 3]) -> [L; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

#[inline(always)]
pub(crate) fn load<L: Lane, const N: usize>(rows: &[[f32; WIDTH]; N], part: usize) -> [L; N] {
    let mut loaded = [L::splat(0.0); N];
    for k in 0..N {
        loaded[k] = L::load(&rows[k], part);
    }
    loaded
}
