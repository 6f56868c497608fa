//! Meshes a label volume with conforming tetrahedra.
//! `cargo run -p trepan-mesh --example labels_to_mesh [LABELS.nii.gz [TETS
//! [OUT.vtk]]]`. Without a volume (or with `-`) it uses a ball of 20 mm in one of 40 mm.

use std::path::Path;
use std::time::Instant;
use trepan_geometry::Vec3;
use trepan_mesh::{Quality, Surface, lattice, vtk};
use trepan_volume::VoxelVolume;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let labels = match arguments.first().filter(|path| *path != "-") {
        Some(path) => trepan_volume::labels(Path::new(path), &trepan_volume::read(Path::new(path))?)?,
        None => balls(40.0, 20.0),
    };
    let target_tets = arguments.get(1).map_or(Ok(30_000), |n| n.parse())?;
    let start = Instant::now();
    let labelled = lattice::labelled(&labels, &lattice::Config { target_tets, ..Default::default() })?;
    let (seconds, mesh) = (start.elapsed().as_secs_f64(), &labelled.mesh);
    mesh.check()?;

    let quality = Quality::of(mesh);
    println!("{} tetrahedra, {} nodes in {seconds:.2} s", mesh.tets.len(), mesh.positions.len());
    println!("dihedral angles {:.1} to {:.1} degrees", quality.min_dihedral_deg, quality.max_dihedral_deg);
    println!("surface closed: {}", Surface::of(mesh).is_closed());
    let mut names: Vec<u16> = labels.data.iter().copied().filter(|label| *label != 0).collect();
    names.sort_unstable();
    names.dedup();
    for name in names {
        let tets = (0..mesh.tets.len()).filter(|&t| labelled.label_of_tet[t] == name);
        let ml = tets.map(|t| mesh.volume_mm3(t)).sum::<f64>() / 1000.0;
        let voxels_ml = labels.data.iter().filter(|l| **l == name).count() as f64 * labels.voxel_mm3() / 1000.0;
        println!("label {name}: {ml:.3} ml, voxels {voxels_ml:.3} ml");
    }
    if let Some(out) = arguments.get(2) {
        vtk::write_labelled(Path::new(out), &labelled)?;
        println!("written to {out}");
    }
    Ok(())
}

fn balls(outer: f64, inner: f64) -> VoxelVolume<u16> {
    let mut labels = VoxelVolume::isotropic([90; 3], Vec3::splat(-44.5), 1.0, 0);
    for at in 0..labels.data.len() {
        let radius = labels.centre_of([at % 90, at / 90 % 90, at / 8100]).length();
        labels.data[at] = if radius < inner { 2 } else { u16::from(radius < outer) };
    }
    labels
}
