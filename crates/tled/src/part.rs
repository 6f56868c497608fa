//! About a thousand neighbouring elements with nodes of their own: what one thread works on at a time.
//!
//! # Theory
//! A part copies the displacements of the nodes that it touches, lets its elements add to sums of its own, and puts these into slots of its own: no
//! colouring, nothing added by two. Which elements make a part does not depend on the number of threads, and slots are gathered in their own order, so a node's sum has the same bits
//! however many threads there are.
//!
//! ```text
//! places ──copy──▶ part: u ──elements──▶ part: sums ──put──▶ slots ──gather──▶ places
//! ```
//!
//! A part whose nodes all stay within a limit of where they were when its forces were found keeps these forces, as every element's are a function of where its nodes are: so only
//! what moves is computed, to the edge of the motion and not further. Nodes go on being moved everywhere, so nothing is cut loose.
//!
//! # Practice
//! Copies and sums of a part are 10 kB: they stay in the fastest cache while its elements stream by.

use crate::block::{Block, Forces, Memory, Quad, Volumes, WIDTH};
use crate::handed::Handed;
use crate::kernel::{Found, Kernel};
use crate::law::{Constitutive, MooneyRivlin, NeoHookean, Ogden, StVenantKirchhoff};
use crate::nodes::Nodes;
use crate::relaxation::{Fade, Relaxation};
use crate::scaling::Scaling;
use std::marker::PhantomData;
use trepan_geometry::Vec3;
use trepan_soft::{Body, Law};

/// Some elements and what they last added to their nodes.
pub(crate) struct Part {
    group: Box<dyn Group>,
    /// Seat of every node of the part, ascending, its place, and the slot of what the part hands over.
    seats: Vec<u32>,
    places: Vec<u32>,
    slots: Vec<u32>,
    u: Vec<Quad>,
    sums: Vec<Quad>,
    /// A quarter of the volume change of the elements around each node, mm³.
    shares: Vec<f32>,
    /// What its last force pass noticed.
    pub found: Found,
    tets: usize,
    /// Since its forces were found, ms; `None` where they must be.
    elapsed_ms: Option<f32>,
    /// Whether its change of volume was found anew since its forces were.
    stirred: bool,
    /// Largest gradient of a shape function: the most strain that a mm of motion is, 1/mm.
    strain_per_mm: f32,
}

/// How a round of forces goes.
#[derive(Clone, Copy)]
pub(crate) struct Forcing {
    /// Since the last round, ms.
    pub dt_ms: f32,
    pub relaxation: Relaxation,
    pub cure_locking: bool,
    /// How far a node may get before its elements' forces are found anew, mm.
    pub still_mm: f32,
}

/// The nodes of a part, ascending by seat.
pub(crate) struct Own {
    pub seats: Vec<u32>,
    pub places: Vec<u32>,
    pub slots: Vec<u32>,
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
    /// The elements at `tets` (mesh numbers), at least one and all of the same law, with the seats of their corners.
    pub fn of(
        body: &Body,
        scaling: &Scaling,
        tets: &[u32],
        seats_of: &dyn Fn(u32) -> [u32; 4],
        own: Own,
        relaxation: &Relaxation,
    ) -> Self {
        let Own { seats, places, slots } = own;
        let nodes = |t: u32| seats_of(t).map(|s| seats.partition_point(|&o| o < s) as u32);
        Self {
            group: group(body, scaling, tets, &nodes, relaxation),
            u: vec![[0.0; 4]; seats.len()],
            sums: vec![[0.0; 4]; seats.len()],
            shares: vec![0.0; seats.len()],
            found: Found::default(),
            tets: tets.len(),
            elapsed_ms: None,
            stirred: false,
            strain_per_mm: tets.iter().map(|&t| steepest(body, t)).fold(0.0, f32::max),
            seats,
            places,
            slots,
        }
    }

    /// Finds the elements' change of volume, unless their nodes rest.
    pub fn volumes(&mut self, kernel: Kernel, still_mm: f32, nodes: &Nodes, handed: &Handed) {
        if self.elapsed_ms.is_some() && self.nodes_rest(still_mm, nodes) {
            return;
        }
        self.stirred = true;
        self.copy(nodes);
        self.shares.fill(0.0);
        self.group.volumes(kernel, &self.u, &mut self.shares);
        self.slots.iter().zip(&self.shares).for_each(|(&slot, &share)| handed.shares.set(slot as usize, share));
    }

    /// Finds the elements' forces, unless nothing changed; where locking is cured after their change of volume was averaged.
    pub fn forces(&mut self, kernel: Kernel, how: &Forcing, nodes: &Nodes, handed: &Handed) {
        self.elapsed_ms = self.elapsed_ms.map(|elapsed_ms| elapsed_ms + how.dt_ms);
        let may_rest = self.elapsed_ms.is_some_and(|elapsed_ms| elapsed_ms <= how.relaxation.brief_ms());
        if may_rest && self.rests(how, nodes, handed) {
            return;
        }
        let fade = how.relaxation.fade(self.elapsed_ms.unwrap_or(0.0));
        (self.elapsed_ms, self.stirred) = (Some(0.0), false);
        if how.cure_locking {
            self.u.iter_mut().zip(&self.seats).for_each(|(u, &seat)| u[3] = handed.swelling.get(seat as usize));
        } else {
            self.copy(nodes);
        }
        self.sums.fill([0.0; 4]);
        self.found = self.group.forces(kernel, fade, how.cure_locking, &self.u, &mut self.sums);
        self.slots.iter().zip(&self.sums).for_each(|(&slot, &sum)| handed.sums.set(slot as usize, sum));
    }

    /// How many elements it has, and of how many the forces were found in the last round.
    pub fn stepped(&self) -> [usize; 2] {
        [self.tets, if self.elapsed_ms == Some(0.0) { self.tets } else { 0 }]
    }

    /// Whether everything that forces depend on is where it was when they were found.
    fn rests(&self, how: &Forcing, nodes: &Nodes, handed: &Handed) -> bool {
        if !how.cure_locking {
            return self.nodes_rest(how.still_mm, nodes);
        }
        let most = how.still_mm * self.strain_per_mm;
        let as_before = |(u, &seat): (&Quad, &u32)| (handed.swelling.get(seat as usize) - u[3]).abs() <= most;
        how.still_mm > 0.0 && !self.stirred && self.u.iter().zip(&self.seats).all(as_before)
    }

    fn nodes_rest(&self, still_mm: f32, nodes: &Nodes) -> bool {
        let near = |(&[x, y, z, _], &place): (&Quad, &u32)| {
            nodes.displacement(place as usize).distance_squared(Vec3::new(x, y, z)) <= still_mm * still_mm
        };
        still_mm > 0.0 && self.u.iter().zip(&self.places).all(near)
    }

    fn copy(&mut self, nodes: &Nodes) {
        self.u.iter_mut().zip(&self.places).for_each(|(to, &place)| *to = nodes.u.get(place as usize));
    }

    /// Forgets past stress.
    pub fn forget(&mut self) {
        self.group.forget();
        self.elapsed_ms = None;
    }
}

/// Length of the longest gradient of a tetrahedron's shape functions, 1/mm.
fn steepest(body: &Body, tet: u32) -> f32 {
    body.shape(tet as usize).gradients.iter().map(|g| g.length()).fold(0.0, f64::max) as f32
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
