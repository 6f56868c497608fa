//! Pokes a block of brain tissue with a probe and lets go: prints dent, force and how it comes
//! back.

use trepan_contact::NodalContact;
use trepan_geometry::Vec3;
use trepan_soft::{Body, Loads, Material, SoftSolver, boxes};
use trepan_tled::{Config, Tled};

fn main() -> Result<(), trepan_soft::BodyError> {
    let mesh = boxes::split_box([12, 12, 10], Vec3::new(120.0, 120.0, 100.0));
    let pressed = boxes::nodes_where(&mesh, |p| p.z > 99.0 && p.distance(Vec3::new(60.0, 60.0, 100.0)) < 12.0);
    let fixed = boxes::nodes_where(&mesh, |p| p.z < 1.0);
    let body = Body::uniform(mesh, fixed, Material::BRAIN);
    let mut tled = Tled::new(&body, &Config::default())?;
    let dt = tled.stable_dt_ms();
    println!("{} tetrahedra, step {dt:.3} ms, damping {:.4} /ms", body.mesh.tets.len(), tled.damping_per_ms());
    let mut probe = NodalContact::none();
    pressed.iter().for_each(|&n| probe.add(n, 1.0));
    probe.normalise();
    (probe.normal, probe.offset_mm, probe.stiffness) = (Vec3::Z, 5.0 - 100.0, 0.3);
    let (mut loads, mut time) = (Loads { contacts: probe.into(), ..Loads::default() }, 0.0);
    for tenth in 0..20 {
        if tenth == 10 {
            loads.contacts.clear();
        }
        let mut report = tled.step(&loads, dt);
        while time < 100.0 * (tenth + 1) as f32 {
            report = tled.step(&loads, dt);
            time += dt;
        }
        let dent = 100.0 - probe.mean(|n| tled.positions()[n as usize]).z;
        println!("{time:6.0} ms: dent {dent:6.3} mm, force {:.3} N, inverted {}", report.contact_n, report.inverted);
    }
    Ok(())
}
