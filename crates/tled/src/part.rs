//! Parts: about a thousand neighbouring elements with copies of their nodes, a task of one thread.
//!
//! # Theory
//! A part copies the displacements of its nodes, adds its element forces to its own sums, and
//! stores these in its own slots: no colouring, and no number is added to by two threads. Parts do
//! not depend on the number of threads, and slots are gathered in a fixed order, so a node's sum
//! has the same bits for any number of threads.
//!
//! ```text
//! places ──copy──▶ part: u ──elements──▶ part: sums ──store──▶ slots ──gather──▶ places
//! ```
//!
//! A part whose nodes all stay within a tenth of a limit for [`DOZE_MS`] falls asleep: its elements
//! keep their forces, and its nodes do not move. It wakes when a load or an awake neighbouring part
//! pushes one of its nodes. So the awake region is surrounded by a ring of stationary nodes, and
//! sleeping parts cost no work.
//!
//! # Practice
//! Copies and sums of a part take 10 kB at the start of their tables: they stay in the L1 cache
//! while its elements are read in order.

use crate::block::{Block, Forces, Memory, Strain, Volumes};
use crate::config::Config;
use crate::dynamic_scaling::{Added, Borne, DynamicScaling};
use crate::fill::Filling;
use crate::force_slots::ForceSlots;
use crate::law::{Constitutive, MooneyRivlin, NeoHookean, Ogden, StVenantKirchhoff, Stiffening};
use crate::nodes::Nodes;
use crate::relaxation::{Fade, PRONY_TERMS};
use crate::scaling::Scaling;
use crate::sheet::{self, SheetBlock, SheetForces};
use glam::Vec4;
use std::any::Any;
use std::marker::PhantomData;
use trepan_soft::simd::Kernel;
use trepan_soft::simd::PassReport;
use trepan_soft::simd::{NODES, Quad, WIDTH};
use trepan_soft::{Body, Law};

/// Some elements of one law, with copies of their nodes and the last force sums.
pub(crate) struct Part {
    elements: Box<dyn LawElements>,
    groups: PartGroups,
    u: Box<[Quad; NODES]>,
    sums: Box<[Quad; NODES]>,
    /// A quarter of the volume change of the elements around each node, mm³; then the mean `J - 1`
    /// of its node group.
    volumes: Box<[f32; NODES]>,
    /// Mass for nodes of stiffened elements in the last force pass, by node of the part.
    added: Vec<Added>,
    /// Report of the last force pass.
    pub report: PassReport,
    tets: usize,
    /// Displacements when the part last moved, and the time since then, ms. It falls asleep over
    /// [`DOZE_MS`]; infinity means asleep.
    anchor: Vec<Quad>,
    quiet_ms: f32,
}

/// Time without motion after which a part falls asleep, ms.
const DOZE_MS: f32 = 50.0;
/// Motion under which a part falls asleep, as a share of the limit that wakes it. It is below 1, so
/// that one waking part does not keep its neighbours awake.
pub(crate) const CALM: f32 = 0.1;

/// Parameters of a force pass.
#[derive(Clone, Copy)]
pub(crate) struct Forcing {
    pub fade: [Fade; PRONY_TERMS],
    pub averaged_pressure: bool,
    pub dynamic: DynamicScaling,
    pub quiet: Quiet,
}

/// Parameters of falling asleep.
#[derive(Clone, Copy)]
pub(crate) struct Quiet {
    /// Time since the last pass, ms.
    pub dt_ms: f32,
    /// Motion that wakes a part, mm; 0 = no part sleeps.
    pub still_mm: f32,
}

/// By node of a part: its node group, ascending; its place; the slot for its force.
pub(crate) struct PartGroups {
    pub node_groups: Vec<u32>,
    pub places: Vec<u32>,
    pub slots: Vec<u32>,
}

/// Elements of one constitutive law.
trait LawElements: Send {
    /// Adds up the forces from displacements by node, or with averaged pressure from the mean
    /// `J - 1` by node and the last volume pass.
    fn forces(
        &mut self,
        kernel: Kernel,
        how: &Forcing,
        of: (&[Quad; NODES], &[f32; NODES]),
        out: (&mut [Quad; NODES], &mut Vec<Added>),
    ) -> PassReport;
    fn volumes(&mut self, kernel: Kernel, u: &[Quad; NODES], shares: &mut [f32; NODES]);
    /// The stress memory: a vector of [`Memory`], or nothing.
    fn memory(&mut self) -> &mut dyn Any;
    /// Clears the stress memory.
    fn forget(&mut self);
    /// Exchanges the stress memory; clears it for one of other elements.
    fn take_memory(&mut self, from: &mut dyn Any);
    /// Changes the fill of an element; `number` is that of its tetrahedron or triangle.
    fn fill(&mut self, index: usize, body: &Body, number: u32, filling: Filling);
}

struct Blocks<M, const K: usize, const T: usize> {
    blocks: Vec<Block<K>>,
    memory: Vec<Memory<T>>,
    /// Of every block with averaged pressure, else empty.
    strains: Vec<Strain>,
    borne: Vec<Borne>,
    law: PhantomData<M>,
}

impl Part {
    /// Creates a part of the elements `tets` (mesh numbers), at least one and all of the same law.
    /// `groups_of` gives the node groups of an element's corners.
    pub fn of(
        body: &Body,
        (scaling, dynamic): (&Scaling, &DynamicScaling),
        tets: &[u32],
        groups_of: &dyn Fn(u32) -> [u32; 4],
        groups: PartGroups,
        config: &Config,
    ) -> Self {
        let nodes = |t: u32| groups_of(t).map(|s| groups.node_groups.partition_point(|&o| o < s) as u32);
        let elements = elements_of(body, (scaling, dynamic), tets, &nodes, config);
        Self::around(elements, tets.len(), groups)
    }

    /// A part at rest.
    fn around(elements: Box<dyn LawElements>, tets: usize, groups: PartGroups) -> Self {
        Self {
            elements,
            u: bytemuck::zeroed_box(),
            sums: bytemuck::zeroed_box(),
            volumes: bytemuck::zeroed_box(),
            added: Vec::with_capacity(4 * tets),
            report: PassReport::default(),
            tets,
            anchor: vec![[0.0; 4]; groups.places.len()],
            quiet_ms: 0.0,
            groups,
        }
    }

    /// Creates a part of triangles of the body's membrane; `group_at` gives a node group of a node.
    pub fn of_sheet(body: &Body, triangles: &[u32], group_at: &dyn Fn(u32) -> u32, groups: PartGroups) -> Self {
        let number = |node: u32| groups.node_groups.partition_point(|&o| o < group_at(node)) as u32;
        Self::around(Box::new(Sheet(sheet::blocks(body, triangles, number))), 0, groups)
    }

    /// Computes the elements' volume changes, unless the part sleeps.
    pub fn volumes(&mut self, kernel: Kernel, quiet: Quiet, nodes: &Nodes, force_slots: &ForceSlots) {
        if self.stays_asleep(quiet, nodes) {
            return;
        }
        self.copy(nodes);
        self.volumes[..self.groups.places.len()].fill(0.0);
        self.elements.volumes(kernel, &self.u, &mut self.volumes);
        self.groups
            .slots
            .iter()
            .zip(&*self.volumes)
            .for_each(|(&slot, &share)| force_slots.shares.set(slot as usize, share));
    }

    /// Finds the elements' forces, unless they sleep; with averaged pressure after their change of
    /// volume was averaged. The fourth number of what a part that falls asleep hands over is 1.
    pub fn forces(&mut self, kernel: Kernel, how: &Forcing, nodes: &Nodes, force_slots: &ForceSlots) {
        let stays_asleep =
            if how.averaged_pressure { self.quiet_ms == f32::INFINITY } else { self.stays_asleep(how.quiet, nodes) };
        if stays_asleep {
            return;
        }
        if how.averaged_pressure {
            let averages = self.groups.node_groups.iter().map(|&group| force_slots.volume_change.get(group as usize));
            self.volumes.iter_mut().zip(averages).for_each(|(to, average)| *to = average);
        } else {
            self.copy(nodes);
        }
        let used = self.groups.places.len();
        self.sums[..used].fill([0.0; 4]);
        self.added.clear();
        let out = (&mut *self.sums, &mut self.added);
        self.report = self.elements.forces(kernel, how, (&self.u, &self.volumes), out);
        if self.quiet_ms > DOZE_MS {
            self.quiet_ms = f32::INFINITY;
            self.sums[..used].iter_mut().for_each(|sum| sum[3] = 1.0);
        }
        self.groups.slots.iter().zip(&*self.sums).for_each(|(&slot, &sum)| force_slots.sums.set(slot as usize, sum));
    }

    /// What nodes of stiffened elements get from the last force pass, by place.
    pub fn added(&self) -> impl Iterator<Item = [Added; 4]> {
        let place = |a: Added| Added { node: self.groups.places[a.node as usize], ..a };
        self.added.as_chunks::<4>().0.iter().map(move |of| of.map(place))
    }

    /// Number of elements, and number of awake elements.
    pub fn awake(&self) -> [usize; 2] {
        [self.tets, if self.quiet_ms == f32::INFINITY { 0 } else { self.tets }]
    }

    /// Changes the fill of an element; `number` is that of its tetrahedron or triangle.
    pub fn fill(&mut self, index: usize, body: &Body, number: u32, filling: Filling) {
        self.elements.fill(index, body, number, filling);
        self.wake();
    }

    /// Wakes the part.
    pub fn wake(&mut self) {
        self.quiet_ms = 0.0;
    }

    /// Updates the time without motion; returns whether the part was asleep and stays asleep.
    fn stays_asleep(&mut self, quiet: Quiet, nodes: &Nodes) -> bool {
        if quiet.still_mm == 0.0 {
            return false;
        }
        let limit = if self.quiet_ms == f32::INFINITY { quiet.still_mm } else { CALM * quiet.still_mm };
        let most = limit * limit;
        let near = |(anchor, &place): (&Quad, &u32)| {
            let moved = nodes.u.vector(place as usize) - Vec4::from_array(*anchor);
            moved.length_squared() <= most && nodes.pushed.get(place as usize) == 0.0
        };
        if self.anchor.iter().zip(&self.groups.places).all(near) {
            self.quiet_ms += quiet.dt_ms;
            return self.quiet_ms == f32::INFINITY;
        }
        self.anchor.iter_mut().zip(&self.groups.places).for_each(|(to, &place)| *to = nodes.u.get(place as usize));
        self.quiet_ms = 0.0;
        false
    }

    fn copy(&mut self, nodes: &Nodes) {
        self.u.iter_mut().zip(&self.groups.places).for_each(|(to, &place)| *to = nodes.u.get(place as usize));
    }

    /// Exchanges the stress memory; clears it where the other has other elements.
    pub fn take_memory(&mut self, from: Option<&mut Self>) {
        match from {
            Some(from) => self.elements.take_memory(from.elements.memory()),
            None => self.elements.forget(),
        }
    }

    /// Clears the stress memory.
    pub fn forget(&mut self) {
        self.elements.forget();
        self.wake();
    }
}

/// Elements of the law of `tets`. The neo-Hookean and the stiffening law have a version without
/// stress memory.
fn elements_of(
    body: &Body,
    (scaling, dynamic): (&Scaling, &DynamicScaling),
    tets: &[u32],
    nodes: &dyn Fn(u32) -> [u32; 4],
    config: &Config,
) -> Box<dyn LawElements> {
    let of = (body, scaling, dynamic, config.averaged_pressure);
    let elastic = config.relaxation.is_none();
    match body.material(tets[0] as usize).law() {
        Law::NeoHookean(_) if elastic => Box::new(Blocks::<NeoHookean, 2, 0>::new(of, tets, nodes)),
        Law::NeoHookean(_) => Box::new(Blocks::<NeoHookean, 2, PRONY_TERMS>::new(of, tets, nodes)),
        Law::StVenantKirchhoff { .. } => Box::new(Blocks::<StVenantKirchhoff, 2, PRONY_TERMS>::new(of, tets, nodes)),
        Law::MooneyRivlin { .. } => Box::new(Blocks::<MooneyRivlin, 3, PRONY_TERMS>::new(of, tets, nodes)),
        Law::Ogden { .. } => Box::new(Blocks::<Ogden, 5, PRONY_TERMS>::new(of, tets, nodes)),
        Law::Stiffening(_) if elastic => Box::new(Blocks::<Stiffening, 4, 0>::new(of, tets, nodes)),
        Law::Stiffening(_) => Box::new(Blocks::<Stiffening, 4, PRONY_TERMS>::new(of, tets, nodes)),
    }
}

impl<M: Constitutive<K>, const K: usize, const T: usize> Blocks<M, K, T> {
    /// Fills the blocks. Neighbours go to the same lane of different blocks, so that consecutive
    /// lanes of a block seldom add to the same node.
    fn new(
        (body, scaling, dynamic, averaged_pressure): (&Body, &Scaling, &DynamicScaling, bool),
        tets: &[u32],
        nodes: &dyn Fn(u32) -> [u32; 4],
    ) -> Self {
        let mut blocks = vec![Block::empty(); tets.len().div_ceil(WIDTH)];
        let count = blocks.len();
        let mut borne = vec![Borne::EMPTY; count];
        for (at, &t) in tets.iter().enumerate() {
            let grams = f64::from(body.material(t as usize).density_g_mm3()) * body.mesh.volume_mm3(t as usize);
            let quarter_mass = (0.25 * grams * scaling.factor(t)) as f32;
            borne[at % count].put(at / count, quarter_mass, scaling.omega2(t), dynamic);
            let tissue = (&body.shape(t as usize), body.material(t as usize), scaling.factor(t));
            blocks[at % count].put::<M>(at / count, tissue, nodes(t));
        }
        let strains = vec![Strain::NONE; if averaged_pressure { count } else { 0 }];
        Self { memory: vec![[[[0.0; WIDTH]; 6]; T]; count], blocks, strains, borne, law: PhantomData }
    }
}

impl<M: Constitutive<K> + Send, const K: usize, const T: usize> LawElements for Blocks<M, K, T> {
    fn forces(
        &mut self,
        kernel: Kernel,
        &Forcing { fade, dynamic, .. }: &Forcing,
        (u, averages): (&[Quad; NODES], &[f32; NODES]),
        (sums, added): (&mut [Quad; NODES], &mut Vec<Added>),
    ) -> PassReport {
        let Self { blocks, memory, strains, borne, law } = self;
        kernel.run(&mut Forces::<M, K, T> {
            blocks,
            memory,
            fade,
            u,
            strains,
            averages,
            sums,
            borne,
            dynamic,
            added,
            law: *law,
        })
    }

    fn volumes(&mut self, kernel: Kernel, u: &[Quad; NODES], shares: &mut [f32; NODES]) {
        kernel.run(&mut Volumes { blocks: &self.blocks, u, strains: &mut self.strains, shares });
    }

    fn memory(&mut self) -> &mut dyn Any {
        &mut self.memory
    }

    fn forget(&mut self) {
        self.memory.fill([[[0.0; WIDTH]; 6]; T]);
    }

    fn take_memory(&mut self, from: &mut dyn Any) {
        match from.downcast_mut::<Vec<Memory<T>>>().filter(|from| from.len() == self.memory.len()) {
            Some(from) => std::mem::swap(&mut self.memory, from),
            None => self.forget(),
        }
    }

    fn fill(&mut self, index: usize, body: &Body, tet: u32, Filling { share, kept }: Filling) {
        let (block, lane) = (index % self.blocks.len(), index / self.blocks.len());
        let volume_mm3 = share * body.mesh.volume_mm3(tet as usize);
        self.blocks[block].fill::<M>(lane, &body.material(tet as usize).law(), volume_mm3);
        self.memory[block].as_flattened_mut().iter_mut().for_each(|row| row[lane] *= kept);
    }
}

/// Triangles of a membrane.
struct Sheet(Vec<SheetBlock>);

impl LawElements for Sheet {
    fn forces(
        &mut self,
        kernel: Kernel,
        _: &Forcing,
        (u, _): (&[Quad; NODES], &[f32; NODES]),
        (sums, _): (&mut [Quad; NODES], &mut Vec<Added>),
    ) -> PassReport {
        kernel.run(&mut SheetForces { blocks: &self.0, u, sums })
    }

    /// A membrane has no volume.
    fn volumes(&mut self, _: Kernel, _: &[Quad; NODES], _: &mut [f32; NODES]) {}

    fn memory(&mut self) -> &mut dyn Any {
        self
    }

    fn forget(&mut self) {}

    fn take_memory(&mut self, _: &mut dyn Any) {}

    fn fill(&mut self, index: usize, body: &Body, triangle: u32, Filling { share, .. }: Filling) {
        let count = self.0.len();
        self.0[index % count].fill(index / count, body, triangle, share);
    }
}
