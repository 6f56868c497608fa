//! Meshes a mask with tetrahedra and prints their quality.
//! `cargo run -p trepan-mesh --example mask_to_mesh [MASK.nii.gz [TETS [COARSENING
//! [X,Y,Z,RADIUS,HALVINGS [OUT.vtk]]]]]`. Without a mask (or with `-`) it uses a ball of 45 mm.

use std::path::Path;
use std::time::Instant;
use trepan_geometry::Vec3;
use trepan_mesh::lattice::{self, Fine};
use trepan_mesh::{Quality, Surface, Topology, vtk};
use trepan_volume::VoxelVolume;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let mask = match arguments.first().filter(|path| *path != "-") {
        Some(path) => trepan_volume::read(Path::new(path))?.map(|v| u8::from(v > 0.5)),
        None => ball(45.0),
    };
    let target_tets = arguments.get(1).map_or(Ok(15_000), |n| n.parse())?;
    let coarsening = arguments.get(2).map_or(Ok(0), |n| n.parse())?;
    let fine = arguments.get(3).map_or(Ok(None), |text| fine(text))?;
    let config = lattice::Config { target_tets, coarsening, fine, ..Default::default() };
    let start = Instant::now();
    let mesh = lattice::tetrahedra(&mask, &config)?;
    let seconds = start.elapsed().as_secs_f64();
    mesh.check()?;

    let (quality, surface) = (Quality::of(&mesh), Surface::of(&mesh));
    let mask_ml = mask.data.iter().filter(|v| **v != 0).count() as f64 * mask.voxel_mm3() / 1000.0;
    println!("{} tetrahedra, {} nodes in {seconds:.2} s", mesh.tets.len(), mesh.positions.len());
    println!("volume {:.2} ml, mask {mask_ml:.2} ml", quality.total_mm3 / 1000.0);
    println!("dihedral angles {:.1} to {:.1} degrees", quality.min_dihedral_deg, quality.max_dihedral_deg);
    println!("radius ratio: mean {:.3}, worst {:.3}", quality.mean_radius_ratio, quality.min_radius_ratio);
    println!(
        "edges {:.2} to {:.2} mm, lowest height {:.3} mm",
        quality.min_edge_mm, quality.max_edge_mm, quality.min_height_mm
    );
    let area_cm2 = surface.area_mm2(&mesh.positions) / 100.0;
    println!("surface: {} triangles, {area_cm2:.1} cm2, closed: {}", surface.triangles.len(), surface.is_closed());
    println!("face-connected parts: {}", Topology::of(&mesh).components().1);
    if let Some(out) = arguments.get(4) {
        vtk::write(Path::new(out), &mesh)?;
        println!("written to {out}");
    }
    Ok(())
}

/// Parses a centre, a radius and a count of halvings; `-` for none.
fn fine(text: &str) -> Result<Option<Fine>, std::num::ParseFloatError> {
    let numbers = text.split(',').filter(|word| *word != "-").map(str::parse).collect::<Result<Vec<f32>, _>>()?;
    Ok(match numbers[..] {
        [x, y, z, radius_mm, halvings] => {
            Some(Fine { centre: Vec3::new(x, y, z), radius_mm, halvings: halvings as u32 })
        }
        _ => None,
    })
}

fn ball(radius: f64) -> VoxelVolume<u8> {
    let mut mask = VoxelVolume::isotropic([100; 3], Vec3::splat(-49.5), 1.0, 0);
    for at in 0..mask.data.len() {
        mask.data[at] = u8::from(mask.centre_of([at % 100, at / 100 % 100, at / 10_000]).length() < radius);
    }
    mask
}
