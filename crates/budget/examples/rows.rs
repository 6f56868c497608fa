//! Measures the rows that plans are made from: depth error and relative time on voxel bone, relative error of the displacement of meshes.

use std::time::Instant;
use trepan_geometry::{Pose, Tool, ToolState, Vec3};
use trepan_rigid::{Method, RigidStep, thesis};
use trepan_soft::{Body, Loads, Material, SoftSolver, boxes, reference};
use trepan_volume::{BoneVolume, VoxelVolume};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    bone()?;
    tissue()
}

fn bone() -> Result<(), Box<dyn std::error::Error>> {
    let (_, unit_us) = rigid(Method::Thesis(thesis::Config::default()), 0.5)?;
    println!("reference tick {unit_us:.1} us");
    for spacing_mm in [1.5, 1.0, 0.75, 0.5, 0.35, 0.25] {
        for points in [211, 466, 932] {
            let (error_mm, us) = rigid(Method::Thesis(thesis::Config { points, ..Default::default() }), spacing_mm)?;
            println!("thesis {spacing_mm} mm, {points} points: {error_mm:.4} mm, time {:.2}", us / unit_us);
        }
        let (error_mm, us) = rigid(Method::RECOMMENDED, spacing_mm)?;
        println!("{} {spacing_mm} mm: {error_mm:.4} mm, time {:.2}", Method::RECOMMENDED.name(), us / unit_us);
    }
    Ok(())
}

fn tissue() -> Result<(), Box<dyn std::error::Error>> {
    let measured = [5, 8, 10, 12, 14, 16, 18, 20].iter().map(|&n| mesh(n));
    let measured: Vec<(usize, f64)> = measured.collect::<Result<_, _>>()?;
    // Aitken's limit of three meshes, each twice as fine as the one before: 5, 10 and 20 cells.
    let (u5, u10, u20) = (measured[0].1, measured[2].1, measured[7].1);
    let limit = u20 + (u20 - u10).powi(2) / ((u10 - u5) - (u20 - u10));
    println!("displacement with infinitely many tetrahedra {limit:.4} mm");
    measured
        .iter()
        .for_each(|(tets, u)| println!("{tets} tetrahedra: {u:.4} mm, relative error {:.4}", 1.0 - u / limit));
    Ok(())
}

/// Depth error (root mean square, mm) on a knob of 4 mm, and µs for each tick (median of the directions).
fn rigid(method: Method, spacing_mm: f64) -> Result<(f64, f64), Box<dyn std::error::Error>> {
    let n = (16.0 / spacing_mm) as usize + 1;
    let mut ct = VoxelVolume::isotropic([n; 3], Vec3::splat(-8.03), spacing_mm as f32, 0i16);
    for at in 0..ct.data.len() {
        let outside = ct.centre_of([at % n, at / n % n, at / n / n]).length() - 4.0;
        ct.data[at] = (400.0 - 1200.0 * (outside / 0.9).tanh()) as i16;
    }
    let bone = BoneVolume::new(&ct, 400)?;
    let mut contact = method.build(&Tool::burr(2.0));
    let (mut out, mut sum, mut us) = (RigidStep::default(), 0.0, Vec::new());
    let directions = trepan_geometry::Pointshell::sphere(1.0, 200, Default::default()).points;
    for direction in &directions {
        contact.reset(Pose::from_translation(*direction * 6.6));
        let start = Instant::now();
        for k in 0..40 {
            let tip = *direction * (6.6 - 0.9 * (k.min(30) as f32 / 30.0));
            contact.step(&bone, &ToolState::at(Pose::from_translation(tip)), false, 1.0, &mut out);
        }
        us.push(start.elapsed().as_secs_f64() * 1e6 / 40.0);
        sum += f64::from(out.manifold.depth_mm - 0.3).powi(2);
    }
    us.sort_by(f64::total_cmp);
    Ok(((sum / us.len() as f64).sqrt(), us[us.len() / 2]))
}

/// Tetrahedra, and the displacement of the top under a small sideways gravity, mm.
fn mesh(n: usize) -> Result<(usize, f64), Box<dyn std::error::Error>> {
    let size = 1.2e6f32.cbrt();
    let mesh = boxes::split_box([n; 3], Vec3::splat(size));
    let tets = mesh.tets.len();
    let (top, fixed) = (boxes::nodes_where(&mesh, |p| p.z > size - 1e-3), boxes::nodes_where(&mesh, |p| p.z < 1e-3));
    let rest: Vec<f32> = top.iter().map(|&n| mesh.positions[n as usize].x).collect();
    let body = Body::uniform(mesh, fixed, Material::BRAIN);
    let mut solver = reference::Reference::new(&body, &Default::default())?;
    solver.step(&Loads { gravity: Vec3::X * 1e-4, ..Loads::default() }, 1.0);
    let moved = top.iter().zip(&rest).map(|(&n, x)| f64::from(solver.positions()[n as usize].x - x));
    Ok((tets, moved.sum::<f64>() / top.len() as f64))
}
