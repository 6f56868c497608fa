//! What does one collision step cost, and what does it find? A probe strokes a bending block of 20
//! thousand tetrahedra, with each method.

use glam::{Quat, Vec3};
use std::time::Instant;
use trepan_deformable::{Config, Method, TissueCollision, TissueStep};
use trepan_geometry::{Pose, Tool, ToolState};
use trepan_mesh::TetMesh;
use trepan_rivals::Family;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let cells: usize = std::env::args().nth(1).map_or(Ok(15), |arg| arg.parse())?;
    let (mesh, size) = (block(cells, 100.0), 100.0);
    println!("{} tetrahedra, {} nodes, 211 points, 2 mm ball", mesh.tets.len(), mesh.positions.len());
    println!(
        "{:>13} {:>7} {:>9} {:>9} {:>9} {:>7} {:>9}",
        "method", "points", "tests", "p50 us", "p99 us", "depth", "jump us"
    );
    let only = std::env::args().nth(2);
    for method in Method::all().into_iter().filter(|m| only.as_deref().is_none_or(|name| m.name() == name)) {
        let config = Config { method, ..Config::default() };
        let mut collision = TissueCollision::new(&mesh, &Tool::probe(2.0), &config)?;
        let steps = if method.descriptor().is_oracle { 5 } else { 400 };
        let mut out = TissueStep::default();
        let mut us = Vec::new();
        let still = vec![Vec3::ZERO; mesh.positions.len()];
        let mut deepest = 0.0f32;
        for k in 0..steps {
            let positions = bent(&mesh, k as f32 * 0.01);
            let along = 0.3 + 0.4 * k as f32 / steps as f32;
            let tip = Vec3::new(along * size, 0.45 * size, size + 1.2);
            let start = Instant::now();
            collision.step(&positions, &still, &state(tip), &mut out);
            us.push(start.elapsed().as_secs_f64() * 1e6);
            deepest = deepest.max(out.manifold.depth_mm);
        }
        let (points, tests) = (out.points_in_contact, out.tests);
        let start = Instant::now();
        collision.step(&mesh.positions, &still, &state(Vec3::splat(0.4 * size)), &mut out);
        let jump = start.elapsed().as_secs_f64() * 1e6;
        us.sort_by(f64::total_cmp);
        let (p50, p99) = (us[us.len() / 2], us[us.len() * 99 / 100]);
        println!("{:>13} {points:>7} {tests:>9} {p50:>9.1} {p99:>9.1} {deepest:>7.2} {jump:>9.1}", method.name());
    }
    Ok(())
}

fn state(tip: Vec3) -> ToolState {
    ToolState::at(Pose::from_parts(tip, Quat::IDENTITY))
}

/// The block with a slow wave through it.
fn bent(mesh: &TetMesh, phase: f32) -> Vec<Vec3> {
    mesh.positions.iter().map(|p| *p + Vec3::Z * (0.05 * p.x + phase).sin()).collect()
}

/// A cube of `cells`³ cells, each cut into six tetrahedra.
fn block(cells: usize, size: f32) -> TetMesh {
    let n = cells + 1;
    let node = |x: usize, y: usize, z: usize| ((z * n + y) * n + x) as u32;
    let mut mesh = TetMesh::default();
    for i in 0..n * n * n {
        let at = Vec3::new((i % n) as f32, (i / n % n) as f32, (i / n / n) as f32);
        mesh.positions.push(at * size / cells as f32);
    }
    for i in 0..cells * cells * cells {
        let (x, y, z) = (i % cells, i / cells % cells, i / cells / cells);
        let at = |c: usize| node(x + (c & 1), y + (c >> 1 & 1), z + (c >> 2));
        let around = [[1, 3], [3, 2], [2, 6], [6, 4], [4, 5], [5, 1]];
        mesh.tets.extend(around.map(|[a, b]| [at(0), at(a), at(b), at(7)]));
    }
    mesh
}
