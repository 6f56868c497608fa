//! Two touching spheres: counted work at several cell sizes, and the sizes chosen by each rule.

use trepan_geometry::Vec3;
use trepan_mesh::lattice;
use trepan_volume::VoxelVolume;
use trepan_voxel_size::{CostModel, Measures, counts};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut mask = VoxelVolume::isotropic([48; 3], Vec3::splat(-23.5), 1.0, 0u8);
    for at in 0..mask.data.len() {
        mask.data[at] = u8::from(mask.centre_of([at % 48, at / 48 % 48, at / 2304]).length() < 22.0);
    }
    let mesh = lattice::tetrahedra(&mask, &lattice::Config { target_tets: 42_000, ..Default::default() })?;
    let particles: Vec<Vec3> = mesh.positions.iter().map(|p| *p + Vec3::new(43.0, 0.0, 0.0)).collect();
    let boxes = counts::boxes(&mesh);

    let measures = Measures::of(&mesh)?;
    let busy = counts::grid(&boxes, &particles, measures.mean_edge_mm)?.busy_boxes;
    println!("{} tetrahedra, {:.2} % of them near a particle", boxes.len(), 100.0 * busy as f64 / boxes.len() as f64);
    let model = CostModel::default();
    let (analytic, usual) = (model.analytic(&measures)?, measures.traditional_mm());
    println!("analytic {analytic:.3} mm, mean edge {usual:.3} mm, ratio {:.3}", analytic / usual);

    println!("{:>9} {:>10} {:>10} {:>12}", "cell mm", "visits", "tests", "work");
    for share in [0.4, 0.6, 0.8, 1.0, 1.2, 1.45, 1.7, 2.0, 3.0, 5.0] {
        let cell = share * usual;
        let counts = counts::grid(&boxes, &particles, cell)?;
        let work = counts.visits as f64 + model.r_t * counts.tests as f64;
        println!("{cell:9.3} {:10} {:10} {work:12.0}", counts.visits, counts.tests);
    }
    Ok(())
}
