//! The elements of a body: which law they obey, where their forces go, and what the nodes get of them.
//!
//! # Theory
//! Every (element, corner) pair owns one slot. Slots lie sorted by node, so a node's force is the sum of one contiguous run, always in the
//! same order: no atomics, no colouring, the same bits whatever computed the slots.
//!
//! ```text
//! elements ──write──▶ slots │ node 0 │ node 1   │ node 2 │ …  ──sum──▶ nodes
//! ```

use crate::block::{Block, Forces, Memory, Quad, Volumes, WIDTH};
use crate::kernel::{Found, Kernel};
use crate::law::{Constitutive, MooneyRivlin, NeoHookean, Ogden, StVenantKirchhoff};
use crate::layout::Layout;
use crate::relaxation::{Fade, Relaxation};
use std::marker::PhantomData;
use trepan_soft::{Body, Law};

/// The elements of a body and their latest forces.
pub(crate) struct Elements {
    group: Box<dyn Group>,
    slots: Vec<Quad>,
    /// Slots of the node at each place: `starts[place]..starts[place + 1]`.
    starts: Vec<u32>,
    inverse_volume: Vec<f32>,
    kernel: Kernel,
    cure_locking: bool,
    relaxation: Relaxation,
}

/// Elements of one law.
trait Group: Send {
    fn forces(&mut self, kernel: Kernel, fade: [Fade; 2], cure_locking: bool, u: &[Quad], slots: &mut [Quad]) -> Found;
    fn volumes(&self, kernel: Kernel, u: &[Quad], slots: &mut [Quad]);
    fn forget(&mut self);
}

struct Of<M, const K: usize, const T: usize> {
    blocks: Vec<Block<K>>,
    memory: Vec<Memory<T>>,
    law: PhantomData<M>,
}

impl Elements {
    pub fn of(body: &Body, layout: &Layout, kernel: Kernel, cure_locking: bool, relaxation: Relaxation) -> Self {
        let places = |t: u32| body.mesh.tets[t as usize].map(|n| layout.place_of[n as usize]);
        let mut starts = vec![0u32; layout.node_at.len() + 1];
        layout.tet_at.iter().flat_map(|&t| places(t)).for_each(|place| starts[place as usize + 1] += 1);
        (1..starts.len()).for_each(|i| starts[i] += starts[i - 1]);
        let mut volume = vec![0.0; layout.node_at.len()];
        for &t in &layout.tet_at {
            places(t).iter().for_each(|&p| volume[p as usize] += 0.25 * body.mesh.volume_mm3(t as usize));
        }
        Self {
            group: group(body, layout, &starts, &relaxation),
            slots: vec![[0.0; 4]; starts[starts.len() - 1] as usize + 1],
            starts,
            inverse_volume: volume.iter().map(|v| (1.0 / v) as f32).collect(),
            kernel: kernel.resolved(),
            cure_locking,
            relaxation,
        }
    }

    /// Computes every element's forces from displacements by place, `dt_ms` after the last time.
    pub fn compute(&mut self, u: &mut [Quad], dt_ms: f32) -> Found {
        if self.cure_locking {
            self.group.volumes(self.kernel, u, &mut self.slots);
            for place in 0..u.len() {
                u[place][3] = self.sum(place)[3] * self.inverse_volume[place];
            }
        }
        let fade = self.relaxation.fade(dt_ms);
        self.group.forces(self.kernel, fade, self.cure_locking, u, &mut self.slots)
    }

    /// Force of the elements on the node at `place`, N.
    #[inline(always)]
    pub fn force(&self, place: usize) -> glam::Vec3A {
        glam::Vec3A::from_vec4(self.sum(place))
    }

    /// Forgets past stress.
    pub fn forget(&mut self) {
        self.group.forget();
    }

    #[inline(always)]
    fn sum(&self, place: usize) -> glam::Vec4 {
        let run = self.starts[place] as usize..self.starts[place + 1] as usize;
        self.slots[run].iter().fold(glam::Vec4::ZERO, |sum, slot| sum + glam::Vec4::from_array(*slot))
    }
}

/// The group for a body's law. Only the commonest law has a form without memory.
fn group(body: &Body, layout: &Layout, starts: &[u32], relaxation: &Relaxation) -> Box<dyn Group> {
    match body.material.law() {
        Law::NeoHookean(_) if relaxation.is_none() => Box::new(Of::<NeoHookean, 2, 0>::new(body, layout, starts)),
        Law::NeoHookean(_) => Box::new(Of::<NeoHookean, 2, 2>::new(body, layout, starts)),
        Law::StVenantKirchhoff { .. } => Box::new(Of::<StVenantKirchhoff, 2, 2>::new(body, layout, starts)),
        Law::MooneyRivlin { .. } => Box::new(Of::<MooneyRivlin, 3, 2>::new(body, layout, starts)),
        Law::Ogden { .. } => Box::new(Of::<Ogden, 5, 2>::new(body, layout, starts)),
    }
}

impl<M: Constitutive<K>, const K: usize, const T: usize> Of<M, K, T> {
    fn new(body: &Body, layout: &Layout, starts: &[u32]) -> Self {
        let (mut next, spare) = (starts.to_vec(), starts[starts.len() - 1]);
        let mut blocks = vec![Block::empty(spare); layout.tet_at.len().div_ceil(WIDTH)];
        for (at, &t) in layout.tet_at.iter().enumerate() {
            let nodes = body.mesh.tets[t as usize].map(|n| layout.place_of[n as usize]);
            let slots = nodes.map(|place| {
                next[place as usize] += 1;
                next[place as usize] - 1
            });
            blocks[at / WIDTH].put::<M>(at % WIDTH, &body.shape(t as usize), &body.material, [nodes, slots]);
        }
        Self { memory: vec![[[[0.0; WIDTH]; 6]; T]; blocks.len()], blocks, law: PhantomData }
    }
}

impl<M: Constitutive<K> + Send, const K: usize, const T: usize> Group for Of<M, K, T> {
    fn forces(&mut self, kernel: Kernel, fade: [Fade; 2], cure_locking: bool, u: &[Quad], slots: &mut [Quad]) -> Found {
        let (blocks, memory) = (&self.blocks, &mut self.memory);
        kernel.run(&mut Forces::<M, K, T> { blocks, memory, fade, u, slots, cure_locking, law: PhantomData })
    }

    fn volumes(&self, kernel: Kernel, u: &[Quad], slots: &mut [Quad]) {
        kernel.run(&mut Volumes { blocks: &self.blocks, u, slots });
    }

    fn forget(&mut self) {
        self.memory.fill([[[0.0; WIDTH]; 6]; T]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use trepan_geometry::Vec3;
    use trepan_soft::{Material, boxes};

    #[test]
    fn kernels_give_the_same_bits_for_every_law_and_the_sum_of_all_forces_vanishes() {
        let mesh = boxes::split_box([3, 2, 3], Vec3::new(24.0, 16.0, 20.0));
        let stiff = Material::StVenantKirchhoff { young_mpa: 0.003, poisson: 0.45, density_g_mm3: 1e-3 };
        let mooney = Material::MooneyRivlin { c10_mpa: 3e-4, c01_mpa: 2e-4, poisson: 0.45, density_g_mm3: 1e-3 };
        for material in [Material::BRAIN, stiff, mooney, Material::BRAIN_OGDEN] {
            let body = Body { mesh: mesh.clone(), fixed: vec![], material };
            for (cure, relaxation) in [(false, Relaxation::NONE), (true, Relaxation::NONE), (true, Relaxation::BRAIN)] {
                compare(&body, cure, relaxation);
            }
        }
    }

    fn compare(body: &Body, cure: bool, relaxation: Relaxation) {
        let layout = Layout::of(&body.mesh);
        let noise = |i: usize| ((i as f32 * 12.9898).sin() * 43758.547).fract() * 3.0;
        let count = layout.node_at.len();
        let forces = |kernel: Kernel| {
            let mut u: Vec<Quad> =
                (0..count).map(|n| [noise(3 * n), noise(3 * n + 1), noise(3 * n + 2), 0.0]).collect();
            let mut elements = Elements::of(body, &layout, kernel, cure, relaxation);
            let found = (0..3).map(|_| elements.compute(&mut u, 0.7)).last();
            (found, (0..count).map(|place| elements.force(place).to_array()).collect::<Vec<_>>())
        };
        let scalar = forces(Kernel::Scalar);
        for kernel in Kernel::all().into_iter().filter(|k| k.runs_here()) {
            assert_eq!(scalar, forces(kernel), "{} {:?}", kernel.name(), body.material);
        }
        let total: glam::Vec3A = scalar.1.iter().map(|f| glam::Vec3A::from_array(*f)).sum();
        let largest = scalar.1.iter().flatten().fold(0.0f32, |m, f| m.max(f.abs()));
        assert!(largest > 0.0 && total.length() < 1e-5 * largest, "{total} {largest}");
    }
}
