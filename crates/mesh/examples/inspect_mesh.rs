//! Reads a mesh file of any supported format and prints its properties.
//! `cargo run -p trepan-mesh --example inspect_mesh FILE [COPY]`; the extension of COPY selects its
//! format.

use std::path::Path;
use trepan_mesh::{Quality, Surface, Topology};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let path = Path::new(arguments.first().ok_or("give a mesh file")?);
    let is_surface = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("stl") || e.eq_ignore_ascii_case("obj"));
    if is_surface {
        let mesh = trepan_mesh::read_surface(path)?;
        println!("{} vertices, {} triangles, closed: {}", mesh.positions.len(), mesh.triangles.len(), mesh.is_closed());
        println!("volume {:.3} ml, box {}", mesh.volume_mm3() / 1000.0, mesh.bounds().size());
        return Ok(());
    }
    let trepan_mesh::Import { mesh, notes } = trepan_mesh::import(path)?;
    notes.iter().for_each(|note| println!("note: {note}"));
    let quality = Quality::of(&mesh);
    println!("{} nodes, {} tetrahedra, {:.3} ml", mesh.positions.len(), mesh.tets.len(), quality.total_mm3 / 1000.0);
    println!("sound: {}", mesh.check().map_or_else(|e| e.to_string(), |()| "yes".into()));
    println!("dihedral angles {:.2} to {:.2} degrees", quality.min_dihedral_deg, quality.max_dihedral_deg);
    println!("volumes {:.6} to {:.3} mm3, mean edge {:.3} mm", quality.min_mm3, quality.max_mm3, quality.mean_edge_mm);
    println!("parts: {}, surface closed: {}", Topology::of(&mesh).components().1, Surface::of(&mesh).is_closed());
    if let Some(copy) = arguments.get(1) {
        trepan_mesh::write(Path::new(copy), &mesh)?;
    }
    Ok(())
}
