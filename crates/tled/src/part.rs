//! About a thousand neighbouring elements with nodes of their own: what one thread works on at a
//! time.
//!
//! # Theory
//! A part copies the displacements of the nodes that it touches, lets its elements add to sums of
//! its own, and puts these into slots of its own: no colouring, nothing added by two. Which
//! elements make a part does not depend on the number of threads, and slots are gathered in their
//! own order, so a node's sum has the same bits however many threads there are.
//!
//! ```text
//! places ──copy──▶ part: u ──elements──▶ part: sums ──put──▶ slots ──gather──▶ places
//! ```
//!
//! A part whose nodes all stay within a tenth of a limit for [`DOZE_MS`] falls asleep: its elements
//! keep their forces, and its nodes are held. It wakes when something pushes one of them: a load,
//! or an awake part beside it. So what is awake has a guard ring, the held nodes at its edge, and
//! what holds still does no work.
//!
//! # Practice
//! Copies and sums of a part are 10 kB: they stay in the fastest cache while its elements stream
//! by.

use crate::block::{Block, Forces, Memory, Quad, Volumes, WIDTH};
use crate::force_slots::ForceSlots;
use crate::kernel::{Kernel, PassReport};
use crate::law::{Constitutive, MooneyRivlin, NeoHookean, Ogden, StVenantKirchhoff};
use crate::nodes::Nodes;
use crate::relaxation::{Fade, Relaxation};
use crate::scaling::Scaling;
use glam::Vec4;
use std::marker::PhantomData;
use trepan_soft::{Body, Law};

/// Some elements and what they last added to their nodes.
pub(crate) struct Part {
    group: Box<dyn Group>,
    /// Seat of every node of the part, ascending, its place, and the slot of what the part hands
    /// over.
    node_groups: Vec<u32>,
    places: Vec<u32>,
    slots: Vec<u32>,
    u: Vec<Quad>,
    sums: Vec<Quad>,
    /// A quarter of the volume change of the elements around each node, mm³.
    shares: Vec<f32>,
    /// What its last force pass noticed.
    pub found: PassReport,
    tets: usize,
    /// Where its nodes were when it last stirred, and how long ago that is, ms; asleep over
    /// [`DOZE_MS`].
    anchor: Vec<Quad>,
    quiet_ms: f32,
}

/// How long nothing may move before a part falls asleep, ms.
const DOZE_MS: f32 = 50.0;
/// Share of the limit in which it must stay to fall asleep: less than what wakes it, so that one
/// part's waking does not keep its neighbours up.
pub(crate) const CALM: f32 = 0.1;

/// How a round of forces goes.
#[derive(Clone, Copy)]
pub(crate) struct Forcing {
    pub fade: [Fade; 2],
    pub averaged_pressure: bool,
    pub quiet: Quiet,
}

/// When a part falls asleep.
#[derive(Clone, Copy)]
pub(crate) struct Quiet {
    /// Since the last round, ms.
    pub dt_ms: f32,
    /// How far a node of a part at rest may get, mm; 0 = no part sleeps.
    pub still_mm: f32,
}

/// The nodes of a part, ascending by group.
pub(crate) struct PartGroups {
    pub node_groups: Vec<u32>,
    pub places: Vec<u32>,
    pub slots: Vec<u32>,
}

/// Elements of one law.
trait Group: Send {
    fn forces(
        &mut self,
        kernel: Kernel,
        fade: [Fade; 2],
        averaged_pressure: bool,
        u: &[Quad],
        sums: &mut [Quad],
    ) -> PassReport;
    fn volumes(&self, kernel: Kernel, u: &[Quad], shares: &mut [f32]);
    fn forget(&mut self);
}

struct Of<M, const K: usize, const T: usize> {
    blocks: Vec<Block<K>>,
    memory: Vec<Memory<T>>,
    law: PhantomData<M>,
}

impl Part {
    /// The elements at `tets` (mesh numbers), at least one and all of the same law, with the
    /// node_groups of their corners.
    pub fn of(
        body: &Body,
        scaling: &Scaling,
        tets: &[u32],
        groups_of: &dyn Fn(u32) -> [u32; 4],
        own: PartGroups,
        relaxation: &Relaxation,
    ) -> Self {
        let PartGroups { node_groups, places, slots } = own;
        let nodes = |t: u32| groups_of(t).map(|s| node_groups.partition_point(|&o| o < s) as u32);
        Self {
            group: group(body, scaling, tets, &nodes, relaxation),
            u: vec![[0.0; 4]; node_groups.len()],
            sums: vec![[0.0; 4]; node_groups.len()],
            shares: vec![0.0; node_groups.len()],
            found: PassReport::default(),
            tets: tets.len(),
            anchor: vec![[0.0; 4]; node_groups.len()],
            quiet_ms: 0.0,
            node_groups,
            places,
            slots,
        }
    }

    /// Finds the elements' change of volume, unless they sleep.
    pub fn volumes(&mut self, kernel: Kernel, quiet: Quiet, nodes: &Nodes, force_slots: &ForceSlots) {
        if self.sleeps_on(quiet, nodes) {
            return;
        }
        self.copy(nodes);
        self.shares.fill(0.0);
        self.group.volumes(kernel, &self.u, &mut self.shares);
        self.slots.iter().zip(&self.shares).for_each(|(&slot, &share)| force_slots.shares.set(slot as usize, share));
    }

    /// Finds the elements' forces, unless they sleep; where locking is cured after their change of
    /// volume was averaged. The fourth number of what a part that falls asleep hands over is 1.
    pub fn forces(&mut self, kernel: Kernel, how: &Forcing, nodes: &Nodes, force_slots: &ForceSlots) {
        let sleeps_on =
            if how.averaged_pressure { self.quiet_ms == f32::INFINITY } else { self.sleeps_on(how.quiet, nodes) };
        if sleeps_on {
            return;
        }
        if how.averaged_pressure {
            self.u
                .iter_mut()
                .zip(&self.node_groups)
                .for_each(|(u, &group)| u[3] = force_slots.swelling.get(group as usize));
        } else {
            self.copy(nodes);
        }
        self.sums.fill([0.0; 4]);
        self.found = self.group.forces(kernel, how.fade, how.averaged_pressure, &self.u, &mut self.sums);
        if self.quiet_ms > DOZE_MS {
            self.quiet_ms = f32::INFINITY;
            self.sums.iter_mut().for_each(|sum| sum[3] = 1.0);
        }
        self.slots.iter().zip(&self.sums).for_each(|(&slot, &sum)| force_slots.sums.set(slot as usize, sum));
    }

    /// How many elements it has, and how many of them are awake.
    pub fn awake(&self) -> [usize; 2] {
        [self.tets, if self.quiet_ms == f32::INFINITY { 0 } else { self.tets }]
    }

    /// Wakes it.
    pub fn wake(&mut self) {
        self.quiet_ms = 0.0;
    }

    /// Looks whether the nodes are still quiet; gives whether the part fell asleep before and
    /// sleeps on.
    fn sleeps_on(&mut self, quiet: Quiet, nodes: &Nodes) -> bool {
        if quiet.still_mm == 0.0 {
            return false;
        }
        let limit = if self.quiet_ms == f32::INFINITY { quiet.still_mm } else { CALM * quiet.still_mm };
        let most = limit * limit;
        let near = |(anchor, &place): (&Quad, &u32)| {
            let moved = nodes.u.vector(place as usize) - Vec4::from_array(*anchor);
            moved.length_squared() <= most && nodes.pushed.get(place as usize) == 0.0
        };
        if self.anchor.iter().zip(&self.places).all(near) {
            self.quiet_ms += quiet.dt_ms;
            return self.quiet_ms == f32::INFINITY;
        }
        self.anchor.iter_mut().zip(&self.places).for_each(|(to, &place)| *to = nodes.u.get(place as usize));
        self.quiet_ms = 0.0;
        false
    }

    fn copy(&mut self, nodes: &Nodes) {
        self.u.iter_mut().zip(&self.places).for_each(|(to, &place)| *to = nodes.u.get(place as usize));
    }

    /// Forgets past stress.
    pub fn forget(&mut self) {
        self.group.forget();
        self.wake();
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
    /// Neighbours go to the same lane of different blocks, so that the lanes of one block seldom
    /// add to the same node one after the other.
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
    fn forces(
        &mut self,
        kernel: Kernel,
        fade: [Fade; 2],
        averaged_pressure: bool,
        u: &[Quad],
        sums: &mut [Quad],
    ) -> PassReport {
        let (blocks, memory) = (&self.blocks, &mut self.memory);
        kernel.run(&mut Forces::<M, K, T> { blocks, memory, fade, u, sums, averaged_pressure, law: PhantomData })
    }

    fn volumes(&self, kernel: Kernel, u: &[Quad], shares: &mut [f32]) {
        kernel.run(&mut Volumes { blocks: &self.blocks, u, shares });
    }

    fn forget(&mut self) {
        self.memory.fill([[[0.0; WIDTH]; 6]; T]);
    }
}
