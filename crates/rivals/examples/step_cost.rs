//! Cost of a step of every method, ns a tetrahedron, on a hanging block.

use std::time::Instant;
use trepan_geometry::Vec3;
use trepan_rivals::Family;
use trepan_soft::{Body, Loads, Material, Method, boxes};

fn main() {
    for cells in [4, 8, 14] {
        let mesh = boxes::split_box([cells; 3], Vec3::splat(40.0));
        let fixed = boxes::nodes_where(&mesh, |p| p.x < 1e-3);
        let body = Body::uniform(mesh, fixed, Material::BRAIN);
        let loads = Loads { gravity: Vec3::NEG_Z * 9.81e-4, ..Loads::default() };
        for method in Method::all().into_iter().filter(|method| !method.descriptor().is_static) {
            let mut solver = method.build(&body).expect("the block is sound");
            let dt = solver.stable_dt_ms().min(4.0);
            let (mut best, mut passes) = (f64::INFINITY, 0);
            for _ in 0..40 {
                let start = Instant::now();
                let report = solver.step(&loads, dt);
                passes = report.substeps.max(report.iterations + 1);
                best = best.min(start.elapsed().as_secs_f64() * 1e9 / f64::from(passes));
            }
            let each = best / body.mesh.tets.len() as f64;
            println!(
                "{:6} tetrahedra, {:12} {each:6.1} ns a pass, {passes} passes",
                body.mesh.tets.len(),
                method.name()
            );
        }
    }
}
