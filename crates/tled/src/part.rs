//! A run of elements with the slots that their forces go to: what one thread works on at a time.
//!
//! # Theory
//! Every (element, corner) pair owns one slot. Slots lie sorted by node, so what a part adds to a node is the sum of one contiguous run, always in
//! the same order: no atomics, no colouring. Parts add in their own order, so a node's sum goes through its elements in the same sequence however
//! many parts there are, and has the same bits.
//!
//! ```text
//! elements ──write──▶ slots │ node 7 │ node 8   │ node 9 │ …  ──sum──▶ nodes
//! ```

use crate::block::{Block, Forces, Memory, Quad, Volumes, WIDTH};
use crate::kernel::{Found, Kernel};
use crate::law::{Constitutive, MooneyRivlin, NeoHookean, Ogden, StVenantKirchhoff};
use crate::layout::Layout;
use crate::relaxation::{Fade, Relaxation};
use crate::scaling::Scaling;
use std::marker::PhantomData;
use trepan_soft::{Body, Law};

/// Some elements and their latest forces.
pub(crate) struct Part {
    group: Box<dyn Group>,
    slots: Vec<Quad>,
    /// A quarter of every element's volume change, mm³, by block.
    shares: Vec<[f32; WIDTH]>,
    /// By slot: whose it is, number of the element in this part.
    owners: Vec<u32>,
    /// Place of the first node that it touches.
    first: usize,
    /// Slots of the node at place `first + i`: `starts[i]..starts[i + 1]`.
    starts: Vec<u32>,
    /// What its last force pass noticed.
    pub found: Found,
}

/// What to do with the elements.
#[derive(Clone, Copy)]
pub(crate) enum Work {
    /// Volume changes.
    Volumes,
    /// Forces.
    Forces { fade: [Fade; 2], cure_locking: bool },
}

/// Elements of one law.
trait Group: Send {
    fn forces(&mut self, kernel: Kernel, fade: [Fade; 2], cure_locking: bool, u: &[Quad], slots: &mut [Quad]) -> Found;
    fn volumes(&self, kernel: Kernel, u: &[Quad], shares: &mut [[f32; WIDTH]]);
    fn forget(&mut self);
}

struct Of<M, const K: usize, const T: usize> {
    blocks: Vec<Block<K>>,
    memory: Vec<Memory<T>>,
    law: PhantomData<M>,
}

impl Part {
    /// The elements at `tets` (mesh numbers, in the solver's order), at least one and all of the same law.
    pub fn of(body: &Body, layout: &Layout, scaling: &Scaling, tets: &[u32], relaxation: &Relaxation) -> Self {
        let places =
            || tets.iter().flat_map(|&t| body.mesh.tets[t as usize]).map(|n| layout.place_of[n as usize] as usize);
        let first = places().min().unwrap_or(0);
        let count = places().max().map_or(0, |last| last + 1 - first);
        let mut starts = vec![0u32; count + 1];
        places().for_each(|place| starts[place - first + 1] += 1);
        (1..starts.len()).for_each(|i| starts[i] += starts[i - 1]);
        Self {
            group: group((body, layout, scaling), tets, (first, &starts), relaxation),
            slots: vec![[0.0; 4]; starts[count] as usize + 1],
            shares: vec![[0.0; WIDTH]; tets.len().div_ceil(WIDTH)],
            owners: owners(body, layout, tets, (first, &starts)),
            first,
            starts,
            found: Found::default(),
        }
    }

    /// Does some work from displacements by place.
    pub fn compute(&mut self, kernel: Kernel, work: Work, u: &[Quad]) {
        match work {
            Work::Volumes => self.group.volumes(kernel, u, &mut self.shares),
            Work::Forces { fade, cure_locking } => {
                self.found = self.group.forces(kernel, fade, cure_locking, u, &mut self.slots);
            }
        }
    }

    /// Adds its slots to the sums by place.
    pub fn add_to(&self, sums: &mut [Quad]) {
        for (run, sum) in self.starts.windows(2).zip(&mut sums[self.first..]) {
            let slots = &self.slots[run[0] as usize..run[1] as usize];
            let add = |sum: glam::Vec4, slot: &Quad| sum + glam::Vec4::from_array(*slot);
            *sum = slots.iter().fold(glam::Vec4::from_array(*sum), add).to_array();
        }
    }

    /// Adds its shares of the volume change to the sums by place.
    pub fn add_shares_to(&self, sums: &mut [f32]) {
        let shares = self.shares.as_flattened();
        for (run, sum) in self.starts.windows(2).zip(&mut sums[self.first..]) {
            let owners = &self.owners[run[0] as usize..run[1] as usize];
            *sum = owners.iter().fold(*sum, |sum, &owner| sum + shares[owner as usize]);
        }
    }

    /// Forgets past stress.
    pub fn forget(&mut self) {
        self.group.forget();
    }
}

/// The elements around each node, in the order of its slots.
fn owners(body: &Body, layout: &Layout, tets: &[u32], (first, starts): (usize, &[u32])) -> Vec<u32> {
    let mut next = starts.to_vec();
    let mut owners = vec![0; starts[starts.len() - 1] as usize];
    for (at, &t) in tets.iter().enumerate() {
        for n in body.mesh.tets[t as usize] {
            let place = layout.place_of[n as usize] as usize - first;
            owners[next[place] as usize] = at as u32;
            next[place] += 1;
        }
    }
    owners
}

/// The group for the law of these elements. Only the commonest law has a form without memory.
fn group(
    of: (&Body, &Layout, &Scaling),
    tets: &[u32],
    starts: (usize, &[u32]),
    relaxation: &Relaxation,
) -> Box<dyn Group> {
    match of.0.material(tets[0] as usize).law() {
        Law::NeoHookean(_) if relaxation.is_none() => Box::new(Of::<NeoHookean, 2, 0>::new(of, tets, starts)),
        Law::NeoHookean(_) => Box::new(Of::<NeoHookean, 2, 2>::new(of, tets, starts)),
        Law::StVenantKirchhoff { .. } => Box::new(Of::<StVenantKirchhoff, 2, 2>::new(of, tets, starts)),
        Law::MooneyRivlin { .. } => Box::new(Of::<MooneyRivlin, 3, 2>::new(of, tets, starts)),
        Law::Ogden { .. } => Box::new(Of::<Ogden, 5, 2>::new(of, tets, starts)),
    }
}

impl<M: Constitutive<K>, const K: usize, const T: usize> Of<M, K, T> {
    fn new(
        (body, layout, scaling): (&Body, &Layout, &Scaling),
        tets: &[u32],
        (first, starts): (usize, &[u32]),
    ) -> Self {
        let (mut next, spare) = (starts.to_vec(), starts[starts.len() - 1]);
        let mut blocks = vec![Block::empty(spare); tets.len().div_ceil(WIDTH)];
        for (at, &t) in tets.iter().enumerate() {
            let nodes = body.mesh.tets[t as usize].map(|n| layout.place_of[n as usize]);
            let slots = nodes.map(|place| {
                next[place as usize - first] += 1;
                next[place as usize - first] - 1
            });
            let tissue = (&body.shape(t as usize), body.material(t as usize), scaling.factor(t));
            blocks[at / WIDTH].put::<M>(at % WIDTH, tissue, [nodes, slots]);
        }
        Self { memory: vec![[[[0.0; WIDTH]; 6]; T]; blocks.len()], blocks, law: PhantomData }
    }
}

impl<M: Constitutive<K> + Send, const K: usize, const T: usize> Group for Of<M, K, T> {
    fn forces(&mut self, kernel: Kernel, fade: [Fade; 2], cure_locking: bool, u: &[Quad], slots: &mut [Quad]) -> Found {
        let (blocks, memory) = (&self.blocks, &mut self.memory);
        kernel.run(&mut Forces::<M, K, T> { blocks, memory, fade, u, slots, cure_locking, law: PhantomData })
    }

    fn volumes(&self, kernel: Kernel, u: &[Quad], shares: &mut [[f32; WIDTH]]) {
        kernel.run(&mut Volumes { blocks: &self.blocks, u, shares });
    }

    fn forget(&mut self) {
        self.memory.fill([[[0.0; WIDTH]; 6]; T]);
    }
}
