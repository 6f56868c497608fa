//! About a thousand neighbouring elements with nodes of their own: what one thread works on at a time.
//!
//! # Theory
//! A part copies the displacements of the nodes that it touches, lets its elements add to sums of its own, and these are added up over all parts: no atomics, no
//! colouring. Which elements make a part does not depend on the number of threads, and parts add in their own order, so a node's sum has the same bits
//! however many threads there are.
//!
//! ```text
//! places ──copy──▶ part: u ──elements──▶ part: sums ──add, part after part──▶ places
//! ```
//!
//! # Practice
//! Copies and sums of a part are 10 kB: they stay in the fastest cache while its elements stream by.

use crate::block::{Block, Forces, Memory, Quad, Volumes, WIDTH};
use crate::kernel::{Found, Kernel};
use crate::law::{Constitutive, MooneyRivlin, NeoHookean, Ogden, StVenantKirchhoff};
use crate::layout::Layout;
use crate::relaxation::{Fade, Relaxation};
use crate::scaling::Scaling;
use crate::seats::Seats;
use std::marker::PhantomData;
use trepan_soft::{Body, Law};

/// Some elements and what they last added to their nodes.
pub(crate) struct Part {
    group: Box<dyn Group>,
    /// Seat of every node of the part, ascending, and its place.
    seats: Vec<u32>,
    places: Vec<u32>,
    u: Vec<Quad>,
    sums: Vec<Quad>,
    /// A quarter of the volume change of the elements around each node, mm³.
    shares: Vec<f32>,
    /// What its last force pass noticed.
    pub found: Found,
}

/// What the nodes know that elements need.
#[derive(Clone, Copy)]
pub(crate) struct Now<'a> {
    /// Displacements by place, mm.
    pub u: &'a [Quad],
    /// `J - 1` by seat, where locking is cured.
    pub swelling: &'a [f32],
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
    fn forces(&mut self, kernel: Kernel, fade: [Fade; 2], cure_locking: bool, u: &[Quad], sums: &mut [Quad]) -> Found;
    fn volumes(&self, kernel: Kernel, u: &[Quad], shares: &mut [f32]);
    fn forget(&mut self);
}

struct Of<M, const K: usize, const T: usize> {
    blocks: Vec<Block<K>>,
    memory: Vec<Memory<T>>,
    law: PhantomData<M>,
}

impl Part {
    /// The elements at `tets` (mesh numbers), at least one and all of the same law.
    pub fn of(
        body: &Body,
        layout: &Layout,
        seats: &Seats,
        scaling: &Scaling,
        tets: &[u32],
        relaxation: &Relaxation,
    ) -> Self {
        let mut own: Vec<u32> = tets.iter().flat_map(|&t| seats.of_tet(body, layout, t)).collect();
        own.sort_unstable();
        own.dedup();
        let nodes = |t: u32| seats.of_tet(body, layout, t).map(|s| own.partition_point(|&o| o < s) as u32);
        Self {
            group: group(body, scaling, tets, &nodes, relaxation),
            places: own.iter().map(|&s| seats.place_of[s as usize]).collect(),
            u: vec![[0.0; 4]; own.len()],
            sums: vec![[0.0; 4]; own.len()],
            shares: vec![0.0; own.len()],
            seats: own,
            found: Found::default(),
        }
    }

    /// Does some work.
    pub fn compute(&mut self, kernel: Kernel, work: Work, now: Now<'_>) {
        match work {
            Work::Volumes => {
                self.copy(now.u);
                self.shares.fill(0.0);
                self.group.volumes(kernel, &self.u, &mut self.shares);
            }
            Work::Forces { fade, cure_locking } => {
                if cure_locking {
                    self.u.iter_mut().zip(&self.seats).for_each(|(u, &seat)| u[3] = now.swelling[seat as usize]);
                } else {
                    self.copy(now.u);
                }
                self.sums.fill([0.0; 4]);
                self.found = self.group.forces(kernel, fade, cure_locking, &self.u, &mut self.sums);
            }
        }
    }

    fn copy(&mut self, u: &[Quad]) {
        self.u.iter_mut().zip(&self.places).for_each(|(to, &place)| *to = u[place as usize]);
    }

    /// Adds its forces to the sums by place.
    pub fn add_to(&self, sums: &mut [Quad]) {
        for (&place, mine) in self.places.iter().zip(&self.sums) {
            let sum = &mut sums[place as usize];
            *sum = (glam::Vec4::from_array(*sum) + glam::Vec4::from_array(*mine)).to_array();
        }
    }

    /// Adds its shares of the volume change to the sums by seat.
    pub fn add_shares_to(&self, sums: &mut [f32]) {
        self.seats.iter().zip(&self.shares).for_each(|(&seat, share)| sums[seat as usize] += share);
    }

    /// Forgets past stress.
    pub fn forget(&mut self) {
        self.group.forget();
    }
}

/// The group for the law of these elements. Only the commonest law has a form without memory.
fn group(
    body: &Body,
    scaling: &Scaling,
    tets: &[u32],
    nodes: &dyn Fn(u32) -> [u32; 4],
    relaxation: &Relaxation,
) -> Box<dyn Group> {
    let of = (body, scaling);
    match body.material(tets[0] as usize).law() {
        Law::NeoHookean(_) if relaxation.is_none() => Box::new(Of::<NeoHookean, 2, 0>::new(of, tets, nodes)),
        Law::NeoHookean(_) => Box::new(Of::<NeoHookean, 2, 2>::new(of, tets, nodes)),
        Law::StVenantKirchhoff { .. } => Box::new(Of::<StVenantKirchhoff, 2, 2>::new(of, tets, nodes)),
        Law::MooneyRivlin { .. } => Box::new(Of::<MooneyRivlin, 3, 2>::new(of, tets, nodes)),
        Law::Ogden { .. } => Box::new(Of::<Ogden, 5, 2>::new(of, tets, nodes)),
    }
}

impl<M: Constitutive<K>, const K: usize, const T: usize> Of<M, K, T> {
    /// Neighbours go to the same lane of different blocks, so that the lanes of one block seldom add to the same node one after the other.
    fn new((body, scaling): (&Body, &Scaling), tets: &[u32], nodes: &dyn Fn(u32) -> [u32; 4]) -> Self {
        let mut blocks = vec![Block::empty(); tets.len().div_ceil(WIDTH)];
        let count = blocks.len();
        for (at, &t) in tets.iter().enumerate() {
            let tissue = (&body.shape(t as usize), body.material(t as usize), scaling.factor(t));
            blocks[at % count].put::<M>(at / count, tissue, nodes(t));
        }
        Self { memory: vec![[[[0.0; WIDTH]; 6]; T]; count], blocks, law: PhantomData }
    }
}

impl<M: Constitutive<K> + Send, const K: usize, const T: usize> Group for Of<M, K, T> {
    fn forces(&mut self, kernel: Kernel, fade: [Fade; 2], cure_locking: bool, u: &[Quad], sums: &mut [Quad]) -> Found {
        let (blocks, memory) = (&self.blocks, &mut self.memory);
        kernel.run(&mut Forces::<M, K, T> { blocks, memory, fade, u, sums, cure_locking, law: PhantomData })
    }

    fn volumes(&self, kernel: Kernel, u: &[Quad], shares: &mut [f32]) {
        kernel.run(&mut Volumes { blocks: &self.blocks, u, shares });
    }

    fn forget(&mut self) {
        self.memory.fill([[[0.0; WIDTH]; 6]; T]);
    }
}
