//! Presses a ball into a block of tetrahedra: depth, normal and the springs that push back.

use glam::Vec3;
use trepan_contact::NodalContacts;
use trepan_deformable::{Config, TissueCollision, TissueStep};
use trepan_geometry::{Pose, Tool, ToolState};
use trepan_mesh::TetMesh;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mesh = block(8, 5.0);
    let still = vec![Vec3::ZERO; mesh.positions.len()];
    let mut collision = TissueCollision::new(&mesh, &Tool::probe(2.0), &Config::default())?;
    let (mut out, mut springs) = (TissueStep::default(), NodalContacts::default());
    for step in 0..6 {
        let tool = ToolState::at(Pose::from_translation(Vec3::new(20.0, 20.0, 42.5 - 0.5 * step as f32)));
        collision.step(&mesh.positions, &still, &tool, &mut out);
        out.springs(&mut springs);
        let (depth, normal) = (out.manifold.depth_mm, out.manifold.normal);
        println!("{depth:.2} mm deep along {normal:.2}, {} springs", springs.all().count());
    }
    Ok(())
}

/// A cube of cubes, each cut into six tetrahedra around its diagonal.
fn block(cells: usize, edge: f32) -> TetMesh {
    let nodes = cells + 1;
    let mut mesh = TetMesh::default();
    for n in 0..nodes.pow(3) {
        mesh.positions
            .push(Vec3::new((n % nodes) as f32, (n / nodes % nodes) as f32, (n / nodes.pow(2)) as f32) * edge);
    }
    for n in 0..cells.pow(3) {
        let [x, y, z] = [n % cells, n / cells % cells, n / cells.pow(2)];
        let at = |c: usize| (((z + (c >> 2)) * nodes + y + (c >> 1 & 1)) * nodes + x + (c & 1)) as u32;
        for [a, b] in [[1, 3], [3, 2], [2, 6], [6, 4], [4, 5], [5, 1]] {
            mesh.tets.push([at(0), at(a), at(b), at(7)]);
        }
    }
    mesh
}
