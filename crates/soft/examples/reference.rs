//! How far does a beam sag under its own weight? Equilibrium by linear and quadratic elements.

use trepan_geometry::Vec3;
use trepan_soft::reference::{Config, Order, Reference};
use trepan_soft::{Body, Loads, Material, SoftSolver, boxes};

fn main() -> Result<(), trepan_soft::BodyError> {
    let loads = Loads { gravity: Vec3::new(0.0, 0.0, -9.81e-3), ..Loads::default() };
    for order in [Order::Linear, Order::Quadratic] {
        let mesh = boxes::split_box([10, 2, 2], Vec3::new(100.0, 20.0, 20.0));
        let tip = boxes::nodes_where(&mesh, |p| p.x > 99.9)[0] as usize;
        let fixed = boxes::nodes_where(&mesh, |p| p.x < 1e-3);
        let body = Body::uniform(mesh, fixed, Material::BRAIN);
        let mut reference = Reference::new(&body, &Config { order, ..Config::default() })?;
        let report = reference.step(&loads, 1.0);
        let moved = reference.positions()[tip] - body.mesh.positions[tip];
        println!("{order:?}: down {:.3} mm, {} iterations", -moved.z, report.iterations);
    }
    Ok(())
}
