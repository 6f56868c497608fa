//! How far does a beam sag under its own weight, by every method? The stiffer the beam, the more
//! they agree.

use trepan_geometry::Vec3;
use trepan_rivals::Family;
use trepan_soft::{Body, Loads, Material, Method, boxes};

fn main() -> Result<(), trepan_soft::BodyError> {
    let loads = Loads { gravity: Vec3::new(0.0, 0.0, -9.81e-3), ..Loads::default() };
    for young_mpa in [3.0, 0.3, 0.03] {
        for method in Method::all() {
            let mesh = boxes::split_box([10, 2, 2], Vec3::new(100.0, 20.0, 20.0));
            let tip = boxes::nodes_where(&mesh, |p| p.x > 99.9 && (p.truncate().y - 10.0).abs() < 0.1)[1] as usize;
            let fixed = boxes::nodes_where(&mesh, |p| p.x < 1e-3);
            let material = Material::NeoHookean { young_mpa, poisson: 0.3, density_g_mm3: 1e-3 };
            let body = Body::uniform(mesh, fixed, material);
            let mut solver = method.build(&body)?;
            let dt = solver.stable_dt_ms().min(1.0);
            let steps = if solver.stable_dt_ms().is_finite() { (3000.0 / dt) as u32 } else { 1 };
            let iterations: u32 = (0..steps).map(|_| solver.step(&loads, dt).iterations.max(1)).sum();
            let moved = solver.positions()[tip] - body.mesh.positions[tip];
            println!(
                "{:4} kPa, {:9}: down {:7.3} mm, back {:7.3} mm, {iterations} steps or iterations",
                1000.0 * young_mpa,
                method.name(),
                -moved.z,
                -moved.x
            );
        }
    }
    Ok(())
}
