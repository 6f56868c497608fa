//! Element forces of the whole body: blocks of eight tetrahedra, and where each force goes.
//!
//! # Theory
//! Every (element, corner) pair owns one slot. Slots lie sorted by node, so a node's force is the sum of one contiguous run, always in the
//! same order: no atomics, no colouring, the same bits whatever computed the slots.
//!
//! ```text
//! elements ──write──▶ slots │ node 0 │ node 1   │ node 2 │ …  ──sum──▶ nodes
//! ```
//!
//! # Practice
//! 76 bytes of constants a tetrahedron and 64 bytes of slots.

use crate::config::Kernel;
use crate::element::Element;
use crate::lane::Lane;
use crate::layout::Layout;
use trepan_soft::Body;
use wide::f32x8;

/// Tetrahedra in a block.
pub(crate) const WIDTH: usize = 8;

/// A vector with a fourth, unused entry: one aligned 16-byte load.
pub(crate) type Quad = [f32; 4];

/// Eight tetrahedra, structure of arrays. Lanes past the last element have no stiffness and write to the spare slot.
#[derive(Clone)]
#[repr(C, align(64))]
struct Block {
    gradients: [[[f32; WIDTH]; 3]; 3],
    mu_volume: [f32; WIDTH],
    kappa_volume: [f32; WIDTH],
    nodes: [[u32; WIDTH]; 4],
    slots: [[u32; WIDTH]; 4],
}

/// The elements of a body and their latest forces.
pub(crate) struct Elements {
    blocks: Vec<Block>,
    slots: Vec<Quad>,
    /// Slots of the node at each place: `starts[place]..starts[place + 1]`.
    starts: Vec<u32>,
}

impl Elements {
    pub fn of(body: &Body, layout: &Layout) -> Self {
        let corners = |t: u32| body.mesh.tets[t as usize].map(|n| layout.place_of[n as usize]);
        let mut starts = vec![0u32; layout.node_at.len() + 1];
        layout.tet_at.iter().flat_map(|&t| corners(t)).for_each(|place| starts[place as usize + 1] += 1);
        (1..starts.len()).for_each(|i| starts[i] += starts[i - 1]);
        let spare = starts[starts.len() - 1];
        let mut next = starts.clone();
        let mut blocks = vec![Block::empty(spare); layout.tet_at.len().div_ceil(WIDTH)];
        for (at, &t) in layout.tet_at.iter().enumerate() {
            let nodes = corners(t);
            let slots = nodes.map(|place| {
                next[place as usize] += 1;
                next[place as usize] - 1
            });
            blocks[at / WIDTH].put(at % WIDTH, body, t as usize, nodes, slots);
        }
        Self { blocks, slots: vec![[0.0; 4]; spare as usize + 1], starts }
    }

    /// Computes every element's forces from displacements by place; gives the number of elements that are inverted.
    pub fn compute(&mut self, u: &[Quad], kernel: Kernel) -> u32 {
        let compute: fn(&Block, &[Quad], &mut [Quad]) -> u32 = match kernel {
            Kernel::Scalar => Block::compute_scalar,
            Kernel::Wide | Kernel::Fastest => Block::compute_wide,
        };
        self.blocks.iter().map(|block| compute(block, u, &mut self.slots)).sum()
    }

    /// Force of the elements on the node at `place`, N.
    #[inline(always)]
    pub fn force(&self, place: usize) -> glam::Vec3A {
        let run = self.starts[place] as usize..self.starts[place + 1] as usize;
        let sum = self.slots[run].iter().fold(glam::Vec4::ZERO, |sum, slot| sum + glam::Vec4::from_array(*slot));
        glam::Vec3A::from_vec4(sum)
    }
}

impl Block {
    fn empty(spare: u32) -> Self {
        Self {
            gradients: [[[0.0; WIDTH]; 3]; 3],
            mu_volume: [0.0; WIDTH],
            kappa_volume: [0.0; WIDTH],
            nodes: [[0; WIDTH]; 4],
            slots: [[spare; WIDTH]; 4],
        }
    }

    fn put(&mut self, lane: usize, body: &Body, tet: usize, nodes: [u32; 4], slots: [u32; 4]) {
        let shape = body.shape(tet);
        for a in 0..3 {
            let gradient = shape.gradients[a + 1].as_vec3();
            (0..3).for_each(|k| self.gradients[a][k][lane] = gradient[k]);
        }
        self.mu_volume[lane] = (body.material.shear_mpa() * shape.volume_mm3) as f32;
        self.kappa_volume[lane] = (body.material.bulk_mpa() * shape.volume_mm3) as f32;
        for corner in 0..4 {
            self.nodes[corner][lane] = nodes[corner];
            self.slots[corner][lane] = slots[corner];
        }
    }

    fn compute_scalar(&self, u: &[Quad], slots: &mut [Quad]) -> u32 {
        let mut inverted = 0;
        for lane in 0..WIDTH {
            let [o, a, b, c] = [0, 1, 2, 3].map(|corner| u[self.nodes[corner][lane] as usize]);
            let element = Element {
                edges: [a, b, c].map(|p| [p[0] - o[0], p[1] - o[1], p[2] - o[2]]),
                gradients: self.gradients.map(|g| g.map(|row| row[lane])),
                mu_volume: self.mu_volume[lane],
                kappa_volume: self.kappa_volume[lane],
            };
            let ([f1, f2, f3], j) = element.forces();
            let f0 = [0, 1, 2].map(|k| 0.0 - (f1[k] + f2[k] + f3[k]));
            for (corner, f) in [f0, f1, f2, f3].into_iter().enumerate() {
                slots[self.slots[corner][lane] as usize] = [f[0], f[1], f[2], 0.0];
            }
            inverted += j.not_positive();
        }
        inverted
    }

    fn compute_wide(&self, u: &[Quad], slots: &mut [Quad]) -> u32 {
        let [o, a, b, c] = self.nodes.map(|nodes| gather(u, &nodes));
        let element = Element {
            edges: [a, b, c].map(|p| [p[0] - o[0], p[1] - o[1], p[2] - o[2]]),
            gradients: self.gradients.map(|g| g.map(f32x8::new)),
            mu_volume: f32x8::new(self.mu_volume),
            kappa_volume: f32x8::new(self.kappa_volume),
        };
        let ([f1, f2, f3], j) = element.forces();
        let f0 = [0, 1, 2].map(|k| f32x8::splat(0.0) - (f1[k] + f2[k] + f3[k]));
        for (corner, f) in [f0, f1, f2, f3].into_iter().enumerate() {
            let [x, y, z] = f.map(f32x8::to_array);
            for lane in 0..WIDTH {
                slots[self.slots[corner][lane] as usize] = [x[lane], y[lane], z[lane], 0.0];
            }
        }
        j.not_positive()
    }
}

#[inline(always)]
fn gather(u: &[Quad], nodes: &[u32; WIDTH]) -> [f32x8; 3] {
    let mut columns = [[0.0; WIDTH]; 3];
    for lane in 0..WIDTH {
        let [x, y, z, _] = u[nodes[lane] as usize];
        (columns[0][lane], columns[1][lane], columns[2][lane]) = (x, y, z);
    }
    columns.map(f32x8::new)
}

#[cfg(test)]
mod tests {
    use super::*;
    use trepan_geometry::Vec3;
    use trepan_soft::{Material, boxes};

    #[test]
    fn kernels_give_the_same_bits_and_the_sum_of_all_forces_vanishes() {
        let mesh = boxes::split_box([3, 2, 3], Vec3::new(24.0, 16.0, 20.0));
        let body = Body { mesh, fixed: vec![], material: Material::BRAIN };
        let layout = Layout::of(&body.mesh);
        let noise = |i: usize| ((i as f32 * 12.9898).sin() * 43758.547).fract() * 3.0;
        let u: Vec<Quad> =
            (0..layout.node_at.len()).map(|n| [noise(3 * n), noise(3 * n + 1), noise(3 * n + 2), 0.0]).collect();
        let forces = |kernel| {
            let mut elements = Elements::of(&body, &layout);
            let inverted = elements.compute(&u, kernel);
            (inverted, (0..u.len()).map(|place| elements.force(place).to_array()).collect::<Vec<_>>())
        };
        let (scalar, wide) = (forces(Kernel::Scalar), forces(Kernel::Wide));
        assert_eq!(scalar, wide);
        let total: glam::Vec3A = wide.1.iter().map(|f| glam::Vec3A::from_array(*f)).sum();
        let largest = wide.1.iter().flatten().fold(0.0f32, |m, f| m.max(f.abs()));
        assert!(total.length() < 1e-5 * largest, "{total} {largest}");
    }
}
