//! Meshes, poses and deformations for the tests.
#![expect(dead_code, reason = "each test file uses its own part")]

use glam::Vec3;
use trepan_geometry::{Pose, Quat, ToolState, Twist};
use trepan_mesh::TetMesh;

/// A small generator with a fixed seed, so that every run is the same.
pub struct Random(u64);

impl Random {
    pub fn new(seed: u64) -> Self {
        Self(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1)
    }

    /// Uniform in 0..1.
    pub fn unit(&mut self) -> f32 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 40) as f32 / (1u64 << 24) as f32
    }

    /// Uniform in the cube -1..1.
    pub fn cube(&mut self) -> Vec3 {
        Vec3::new(self.unit(), self.unit(), self.unit()) * 2.0 - 1.0
    }

    pub fn rotation(&mut self) -> Quat {
        let axis = (self.cube() + Vec3::splat(1e-3)).normalize();
        Quat::from_axis_angle(axis, self.unit() * 6.0)
    }
}

/// A block of `cells` cubes of `edge` mm from the origin, each cut into six tetrahedra around its
/// diagonal.
pub fn block(cells: [usize; 3], edge: f32) -> TetMesh {
    let [nx, ny, nz] = cells.map(|c| c + 1);
    let node = |x: usize, y: usize, z: usize| ((z * ny + y) * nx + x) as u32;
    let mut mesh = TetMesh::default();
    for z in 0..nz {
        for y in 0..ny {
            mesh.positions.extend((0..nx).map(|x| Vec3::new(x as f32, y as f32, z as f32) * edge));
        }
    }
    for z in 0..cells[2] {
        for y in 0..cells[1] {
            for x in 0..cells[0] {
                let at = |c: usize| node(x + (c & 1), y + (c >> 1 & 1), z + (c >> 2));
                for [a, b] in [[1, 3], [3, 2], [2, 6], [6, 4], [4, 5], [5, 1]] {
                    mesh.tets.push([at(0), at(a), at(b), at(7)]);
                }
            }
        }
    }
    mesh
}

/// The block bent, twisted and shaken by up to 0.15 edges: about 30 % strain.
pub fn deformed(mesh: &TetMesh, edge: f32, phase: f32, random: &mut Random) -> Vec<Vec3> {
    let bend = |p: Vec3| {
        let s = (p.x * 0.11 + phase).sin();
        p + Vec3::new(0.08 * p.z, 0.3 * (p.z * 0.15 + phase).sin(), s) * edge * 0.5
    };
    mesh.positions.iter().map(|&p| bend(p) + random.cube() * (0.15 * edge)).collect()
}

/// A tool at rest with any rotation.
pub fn tool_at(tip: Vec3, rotation: Quat) -> ToolState {
    ToolState::at(Pose::from_parts(tip, rotation))
}

pub fn moving_tool(tip: Vec3, linear: Vec3) -> ToolState {
    ToolState { twist: Twist { linear, angular: Vec3::ZERO }, ..tool_at(tip, Quat::IDENTITY) }
}
