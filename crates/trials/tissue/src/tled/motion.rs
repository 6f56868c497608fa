//! Motion: the frequency of a beam, the energy of one that nothing damps, and the rest that dynamic
//! relaxation finds.

use super::{Part, Scope};
use glam::DMat3;
use trepan_evidence::suite::{Findings, Gate, Row};
use trepan_geometry::{Vec3, units};
use trepan_mesh::TetMesh;
use trepan_soft::reference::{self, Reference};
use trepan_soft::{Body, Loads, Material, SoftSolver, boxes};
use trepan_tled::{Config, Damping, Settling, Tled};

/// First frequency of the beam by quadratic tetrahedra of an independent code (scikit-fem, 30×6×6
/// cells), Hz.
const CONVERGED_HZ: f64 = 1.7328;
const BEAM_MM: Vec3 = Vec3::new(100.0, 20.0, 20.0);

/// Every scene of motion.
pub fn parts() -> Vec<Part> {
    vec![
        Part::new("frequency", frequency),
        Part::new("energy", |_, findings| energy(findings)),
        Part::new("relaxation", |_, findings| relaxation(findings)),
    ]
}

/// Linear tetrahedra are too stiff by the square of their size. Plain ones on two meshes tell the
/// limit; those with averaged pressure on the finer one are near it.
fn frequency(scope: Scope, findings: &mut Findings) {
    let (coarse, fine) = scope.pick((4, 6), (6, 12));
    let split = |across: usize| boxes::split_box([5 * across, across, across], BEAM_MM);
    let low = swing_hz(split(coarse), false, findings);
    let high = swing_hz(split(fine), false, findings);
    let ratio = (fine as f64 / coarse as f64).powi(2);
    let limit = (ratio * high - low) / (ratio - 1.0);
    let off = |hertz: f64| 100.0 * (hertz / CONVERGED_HZ - 1.0).abs();
    let name = "clamped beam: frequency in the limit of small elements against quadratic ones, percent";
    findings.gates.push(Gate::at_most(name, off(limit), 2.0));
    let across = scope.pick(4, 6);
    let cured = swing_hz(boxes::centred_box([40, across, across], BEAM_MM), true, findings);
    findings.gates.push(Gate::at_most("clamped beam: frequency of cured elements, percent", off(cured), 2.0));
    if !scope.quick {
        findings.gates.push(Gate::at_most(
            "clamped beam: frequency of plain ones on the finest mesh, percent",
            off(high),
            2.0,
        ));
    }
}

/// Frequency of the beam let go bent, undamped, Hz.
fn swing_hz(mesh: TetMesh, averaged_pressure: bool, findings: &mut Findings) -> f64 {
    let fixed = boxes::nodes_where(&mesh, |p| p.x < 1e-3);
    let body = Body::uniform(mesh, fixed, Material::THESIS);
    let config = Config { damping: Damping::None, averaged_pressure, ..Config::default() };
    let mut solver = Tled::new(&body, &config).expect("the beam is sound");
    let start: Vec<Vec3> =
        body.mesh.positions.iter().map(|p| Vec3::new(0.0, 0.2, -0.2) * (p.x / 100.0).powi(2)).collect();
    start.iter().enumerate().for_each(|(n, &u)| solver.set_node(n as u32, u, Vec3::ZERO));
    let dt_ms = solver.stable_dt_ms();
    let (mut crossings, mut before, mut time) = (Vec::new(), 1.0f32, 0.0);
    while crossings.len() < 3 && time < 3000.0 {
        solver.step(&Loads::default(), dt_ms);
        time += f64::from(dt_ms);
        // The part of the motion along the start: higher modes are small in the start and smaller
        // by its square here.
        let parts = solver.positions().iter().zip(&body.mesh.positions).zip(&start);
        let now: f32 = parts.map(|((x, rest), along)| (*x - *rest).dot(*along)).sum();
        if before.signum() != now.signum() {
            crossings.push(time - f64::from(dt_ms * now / (now - before)));
        }
        before = now;
    }
    let hertz = if crossings.len() < 3 { f64::NAN } else { 1000.0 / (crossings[2] - crossings[0]) };
    findings.rows.push(
        Row::new("clamped beam swings", if averaged_pressure { "tled cured" } else { "tled" })
            .with("tets", body.mesh.tets.len())
            .metric("frequency_hz", hertz)
            .metric("frequency_error_percent", 100.0 * (hertz / CONVERGED_HZ - 1.0).abs()),
    );
    hertz
}

/// Ten seconds of a beam that nothing damps.
fn energy(findings: &mut Findings) {
    let mesh = boxes::split_box([6, 2, 2], Vec3::new(60.0, 20.0, 20.0));
    let fixed = boxes::nodes_where(&mesh, |p| p.x < 1e-3);
    let body = Body::uniform(mesh, fixed, Material::BRAIN);
    let mut solver =
        Tled::new(&body, &Config { damping: Damping::None, ..Config::default() }).expect("the beam is sound");
    for (n, p) in body.mesh.positions.iter().enumerate() {
        solver.set_node(n as u32, Vec3::ZERO, Vec3::new(0.0, 0.02, 0.05) * (p.x / 60.0).powi(2));
    }
    let masses = body.lumped_masses_g();
    let kinetic = |v: &[Vec3]| v.iter().zip(&masses).map(|(v, m)| 0.5 * m * v.as_dvec3().length_squared()).sum::<f64>();
    let (start, dt_ms) = (kinetic(solver.velocities()), 0.25 * solver.stable_dt_ms());
    let (mut worst, mut before) = (0.0f64, solver.velocities().to_vec());
    for step in 0..(10_000.0 / dt_ms) as usize {
        let watched = step % 200 == 199;
        if watched {
            before.copy_from_slice(solver.velocities());
        }
        solver.step(&Loads::default(), dt_ms);
        if watched {
            // Velocities live half a step away: the mean of two is the one at the positions between
            // them.
            let moved = solver.positions().iter().zip(solver.velocities());
            let earlier: Vec<Vec3> = moved.map(|(x, v)| *x - *v * dt_ms).collect();
            let middle: Vec<Vec3> = before.iter().zip(solver.velocities()).map(|(a, b)| (*a + *b) * 0.5).collect();
            worst = worst.max(((kinetic(&middle) + elastic(&body, &earlier)) / start - 1.0).abs());
        }
    }
    findings.rows.push(
        Row::new("beam without damping, 10 s", "tled")
            .with("tets", body.mesh.tets.len())
            .metric("energy_drift_percent", 100.0 * worst),
    );
    findings.gates.push(Gate::at_most("beam without damping, 10 s: energy drift, percent", 100.0 * worst, 1.0));
}

fn elastic(body: &Body, positions: &[Vec3]) -> f64 {
    let of = |t: usize| {
        let shape = body.shape(t);
        let f: DMat3 = shape.gradient_of(body.mesh.tets[t].map(|n| positions[n as usize].as_dvec3()));
        shape.volume_mm3 * body.material(t).law().energy(f)
    };
    (0..body.mesh.tets.len()).map(of).sum()
}

/// Sag under gravity and the shift of a turned head, as `settle` finds them, against the static
/// reference.
fn relaxation(findings: &mut Findings) {
    let mesh = boxes::split_box([6, 6, 6], Vec3::splat(60.0));
    let fixed = boxes::nodes_where(&mesh, |p| p.z < 1e-3);
    let mut body = Body::uniform(mesh, fixed, Material::BRAIN);
    body.materials.push(Material::TUMOUR);
    for tet in 0..body.mesh.tets.len() {
        let middle: Vec3 = body.mesh.corners(tet).iter().sum::<Vec3>() / 4.0;
        body.material_of_tet[tet] = u8::from((middle - Vec3::splat(30.0)).length() < 12.0);
    }
    let (down, turned) = (Vec3::NEG_Z * units::GRAVITY_MM_PER_MS2, Vec3::new(6e-3, 0.0, -6e-3));
    for (scene, gravity, balanced) in
        [("sag under gravity", down, Vec3::ZERO), ("shift of a turned head", turned, down)]
    {
        let mut exact = Reference::new(&body, &reference::Config::default()).expect("the block is held");
        exact.step(&Loads { gravity: gravity - balanced, ..Loads::default() }, 1.0);
        let config = Config { balanced_gravity: balanced, ..Config::default() };
        let mut solver = Tled::new(&body, &config).expect("the block is sound");
        let settled = solver.settle(&Loads { gravity, ..Loads::default() }, &Settling::default());
        let largest =
            |a: &[Vec3], b: &[Vec3]| a.iter().zip(b).map(|(a, b)| f64::from(a.distance(*b))).fold(0.0, f64::max);
        let error_mm = largest(solver.positions(), exact.positions());
        findings.rows.push(
            Row::new(scene, "settle")
                .with("tets", body.mesh.tets.len())
                .metric("steps_count", f64::from(settled.steps))
                .metric("moved_mm", largest(exact.positions(), &body.mesh.positions))
                .metric("error_mm", error_mm)
                .metric("estimated_error_mm", f64::from(settled.left_mm)),
        );
        findings.gates.push(Gate::at_most(format!("{scene}: distance from the reference's rest, mm"), error_mm, 0.01));
    }
}
