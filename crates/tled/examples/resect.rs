//! Empties a ball of a block of brain tissue under its own weight. Prints the volume taken, how the
//! wall sinks, and what the steps cost.

use std::time::Instant;
use trepan_geometry::Vec3;
use trepan_soft::{Body, Loads, Material, SoftSolver, boxes};
use trepan_tled::{Config, FULL, Relaxation, Tled};

fn main() -> Result<(), trepan_soft::BodyError> {
    let size = Vec3::splat(60.0);
    let mesh = boxes::split_box([15; 3], size);
    let fixed = boxes::nodes_where(&mesh, |p| p.z < 1e-3);
    let body = Body::uniform(mesh, fixed, Material::BRAIN);
    let config = Config { averaged_pressure: true, relaxation: Relaxation::SOLID_AND_FLUID, ..Config::default() };
    let mut tled = Tled::new(&body, &config)?;
    let middle = Vec3::new(30.0, 30.0, 60.0);
    let place = |t: usize| body.mesh.corners(t).into_iter().sum::<Vec3>() / 4.0;
    // From the surface on, as a tip takes them.
    let mut ball: Vec<usize> = (0..body.mesh.tets.len()).filter(|&t| place(t).distance(middle) < 15.0).collect();
    ball.sort_by(|&a, &b| place(b).z.total_cmp(&place(a).z));
    let wall = boxes::nodes_where(&body.mesh, |p| p.distance(middle) < 20.0 && p.distance(middle) > 18.0);
    let (dt, loads) = (tled.stable_dt_ms(), Loads { gravity: Vec3::NEG_Z * 9.81e-3, ..Loads::default() });
    println!("{} tetrahedra, {} of them to be emptied, step {dt:.3} ms", body.mesh.tets.len(), ball.len());
    let (mut others, mut emptying) = (Vec::new(), Vec::new());
    for (second, tenth) in (0..20).flat_map(|tenth| (0..100).map(move |step| (step, tenth))) {
        let next = (tenth * 100 + second) / 2;
        if second % 2 == 0 && next < ball.len() {
            tled.lower_fill(ball[next] as u32, 0);
        }
        let begun = Instant::now();
        let report = tled.step(&loads, dt);
        let us = 1e6 * begun.elapsed().as_secs_f64();
        if next < ball.len() {
            emptying.push(us)
        } else {
            others.push(us)
        }
        assert_eq!((report.non_finite, report.limited, report.inverted), (0, 0, 0));
        if second == 99 {
            let gone = |t: usize| f64::from(FULL - tled.fills()[t]) / f64::from(FULL) * body.mesh.volume_mm3(t);
            let ml = (0..body.mesh.tets.len()).map(gone).sum::<f64>() / 1e3;
            let sunk = |n: u32| body.mesh.positions[n as usize].z - tled.positions()[n as usize].z;
            let mean = wall.iter().map(|&n| sunk(n)).sum::<f32>() / wall.len() as f32;
            println!("{:5.0} ms: {ml:5.2} ml taken, the wall is {mean:.3} mm down", dt * (100 * tenth + 100) as f32);
        }
    }
    for (name, us) in [("emptying", &mut emptying), ("other", &mut others)] {
        us.sort_by(f64::total_cmp);
        println!("{name} steps: {:.0} us, 99 of 100 under {:.0} us", us[us.len() / 2], us[us.len() * 99 / 100]);
    }
    Ok(())
}
