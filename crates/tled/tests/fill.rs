//! Tissue that is taken from a body while it moves.

use trepan_geometry::Vec3;
use trepan_mesh::{Surface, TetMesh};
use trepan_soft::{Body, Loads, Material, Membrane, SoftSolver, StepReport, SurfacePressure, boxes};
use trepan_tled::{Config, FULL, Kernel, RAMP_STEPS, Relaxation, Settling, Tled};

const GRAVITY: Vec3 = Vec3::new(2e-3, 0.0, -9.81e-3);

/// A block of two tissues that stands on its lower face, under a membrane.
fn block(cells: usize) -> Body {
    let mesh = boxes::split_box([cells; 3], Vec3::splat(40.0));
    let fixed = boxes::nodes_where(&mesh, |p| p.z < 1e-3);
    let triangles = Surface::of(&mesh).triangles;
    let mut body = Body::uniform(mesh, fixed, Material::BRAIN);
    body.materials.push(Material::TUMOUR);
    for t in 0..body.mesh.tets.len() {
        body.material_of_tet[t] = u8::from(centre(&body.mesh, t).x > 20.0);
    }
    body.membrane = Membrane { triangles, shear_n_per_mm: 0.01 };
    body
}

fn centre(mesh: &TetMesh, tet: usize) -> Vec3 {
    mesh.corners(tet).into_iter().sum::<Vec3>() / 4.0
}

/// The tetrahedra of a hole in the block's upper face.
fn hole(body: &Body) -> Vec<u32> {
    let inside = |t: &u32| centre(&body.mesh, *t as usize).distance(Vec3::new(22.0, 20.0, 40.0)) < 14.0;
    (0..body.mesh.tets.len() as u32).filter(inside).collect()
}

/// The body without some tetrahedra, and the old number of each of its nodes.
fn without(body: &Body, taken: &[u32]) -> (Body, Vec<u32>) {
    let kept: Vec<usize> = (0..body.mesh.tets.len()).filter(|&t| !taken.contains(&(t as u32))).collect();
    let mut nodes: Vec<u32> = kept.iter().flat_map(|&t| body.mesh.tets[t]).collect();
    nodes.sort_unstable();
    nodes.dedup();
    let number = |old: &u32| nodes.binary_search(old).ok().map(|new| new as u32);
    let mut left = body.clone();
    left.mesh.positions = nodes.iter().map(|&n| body.mesh.positions[n as usize]).collect();
    left.mesh.tets = kept.iter().map(|&t| body.mesh.tets[t].map(|n| number(&n).expect("kept"))).collect();
    left.material_of_tet = kept.iter().map(|&t| body.material_of_tet[t]).collect();
    left.fixed = body.fixed.iter().filter_map(number).collect();
    let is_kept = |triangle: &&[u32; 3]| kept.iter().any(|&t| triangle.iter().all(|n| body.mesh.tets[t].contains(n)));
    let triangles = body.membrane.triangles.iter().filter(is_kept);
    left.membrane.triangles = triangles.map(|t| t.map(|n| number(&n).expect("kept"))).collect();
    (left, nodes)
}

fn emptied(body: &Body, config: &Config, taken: &[u32]) -> Tled {
    let mut tled = Tled::new(body, config).expect("a sound body");
    taken.iter().for_each(|&t| tled.lower_fill(t, 0));
    (0..RAMP_STEPS).for_each(|_| _ = tled.step(&Loads::default(), 1e-3));
    assert!(taken.iter().all(|&t| tled.fills()[t as usize] == 0));
    tled
}

#[test]
fn a_body_with_a_hole_settles_as_the_body_meshed_without_it() {
    let body = block(6);
    let taken = hole(&body);
    let (left, nodes) = without(&body, &taken);
    assert!(taken.len() > 50 && nodes.len() < body.mesh.positions.len());
    for averaged_pressure in [false, true] {
        let config = Config { averaged_pressure, ..Config::default() };
        let loads = Loads { gravity: GRAVITY, ..Loads::default() };
        let settle = |mut tled: Tled| {
            let settled = tled.settle(&loads, &Settling { tolerance_mm: 1e-3, ..Settling::default() });
            assert!(settled.converged, "{settled:?}");
            tled
        };
        let (holed, anew) = (settle(emptied(&body, &config, &taken)), settle(Tled::new(&left, &config).unwrap()));
        let apart = |(new, old): (usize, &u32)| holed.positions()[*old as usize].distance(anew.positions()[new]);
        let moved = |(new, old): (usize, &u32)| body.mesh.positions[*old as usize].distance(anew.positions()[new]);
        let most = nodes.iter().enumerate().map(apart).fold(0.0, f32::max);
        let furthest = nodes.iter().enumerate().map(moved).fold(0.0, f32::max);
        assert!(furthest > 1.0 && most < 0.004, "{averaged_pressure}: {most} mm of {furthest}");
        let weight = |tled: &Tled, fixed: &[u32]| fixed.iter().map(|&n| tled.support_force(n)).sum::<Vec3>();
        let (a, b) = (weight(&holed, &body.fixed), weight(&anew, &left.fixed));
        assert!(a.distance(b) < 1e-4 * b.length(), "{a} {b}");
    }
}

/// Lamé: a ball of radius a in an unbounded body under the pressure p widens by `p a³ / (4 G r²)`
/// at r. Here it is emptied in a free cube of eight times its radius; a is that of its volume.
#[test]
fn a_cavity_under_pressure_widens_as_lame_says() {
    let off = [8, 14].map(|cells| {
        let (middle, mesh) = (Vec3::splat(30.0), boxes::split_box([cells; 3], Vec3::splat(60.0)));
        let corners = boxes::nodes_where(&mesh, |p| p.z < 1e-3 && [p.x, p.y].iter().all(|x| (x - 30.0).abs() > 29.0));
        let body = Body::uniform(mesh, corners, Material::BRAIN);
        let taken: Vec<u32> = (0..body.mesh.tets.len() as u32)
            .filter(|t| centre(&body.mesh, *t as usize).distance(middle) < 8.0)
            .collect();
        let (left, nodes) = without(&body, &taken);
        let wall = Surface::of(&left.mesh)
            .triangles
            .into_iter()
            .filter(|triangle| triangle.iter().all(|n| left.mesh.positions[*n as usize].distance(middle) < 20.0));
        let triangles = wall.map(|triangle| triangle.map(|n| nodes[n as usize])).collect();
        let mpa = 0.08 * body.materials[0].shear_mpa() as f32;
        let mut tled = emptied(&body, &Config { averaged_pressure: true, ..Config::default() }, &taken);
        tled.set_pressure(SurfacePressure { triangles, mpa });
        let settled = tled.settle(&Loads::default(), &Settling { tolerance_mm: 5e-4, ..Settling::default() });
        assert!(settled.converged, "{settled:?}");
        let volume: f64 = taken.iter().map(|&t| body.mesh.volume_mm3(t as usize)).sum();
        let a3 = 3.0 * volume / (4.0 * std::f64::consts::PI);
        let ratio = |n: &u32| {
            let from = body.mesh.positions[*n as usize] - middle;
            let widened = (tled.positions()[*n as usize] - body.mesh.positions[*n as usize]).dot(from.normalize());
            let r2 = f64::from(from.length_squared());
            (r2 > 12.0 * 12.0 && r2 < 18.0 * 18.0).then(|| f64::from(widened) * 4.0 * r2 / (0.08 * a3))
        };
        let ratios: Vec<f64> = nodes.iter().filter_map(ratio).collect();
        ratios.iter().sum::<f64>() / ratios.len() as f64 - 1.0
    });
    assert!(off[0].abs() < 0.2 && off[1].abs() < 0.1, "{off:?}");
}

#[test]
fn the_order_the_kernel_and_the_threads_do_not_matter() {
    let body = block(4);
    let taken = hole(&body);
    let state = |order: &dyn Fn(usize) -> usize, kernel: Kernel, threads: usize| {
        let config = Config {
            averaged_pressure: true,
            relaxation: Relaxation::SOLID_AND_FLUID,
            kernel,
            threads,
            ..Config::default()
        };
        let mut tled = Tled::new(&body, &config).unwrap();
        (0..taken.len()).for_each(|i| tled.lower_fill(taken[order(i)], (taken[order(i)] % 3) as u16 * 9000));
        let loads = Loads { gravity: GRAVITY, ..Loads::default() };
        let dt = tled.stable_dt_ms();
        (0..60).for_each(|_| _ = tled.step(&loads, dt));
        (tled.state().clone(), tled.fills().to_vec())
    };
    let first = state(&|i| i, Kernel::Scalar, 1);
    for kernel in Kernel::all().into_iter().filter(|kernel| kernel.runs_here()) {
        for threads in [1, 2, 3] {
            assert!(first == state(&|i| taken.len() - 1 - i, kernel, threads), "{} {threads}", kernel.name());
        }
    }
}

#[test]
fn a_body_eaten_away_at_random_stays_finite_and_slow() {
    // Five bodies, two elements, 12,000 random fills each: a hundred thousand, and more.
    for (seed, averaged_pressure) in (0..5).flat_map(|seed| [(seed, false), (seed, true)]) {
        let body = block(5);
        let config = Config { averaged_pressure, relaxation: Relaxation::BRAIN, ..Config::default() };
        let mut tled = Tled::new(&body, &config).unwrap();
        let loads = Loads { gravity: GRAVITY, ..Loads::default() };
        let count = body.mesh.tets.len() as u32;
        let (mut random, mut worst, mut fastest) = (2026u32 + seed, StepReport::default(), 0.0f32);
        let mut next = || {
            random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            random >> 8
        };
        let dt = tled.stable_dt_ms();
        for step in 0..6000 {
            (0..2).for_each(|_| tled.lower_fill(next() % count, (next() % 3) as u16 * 20_000));
            if step == 5000 {
                (0..count).for_each(|t| tled.lower_fill(t, 0));
            }
            let report = tled.step(&loads, dt);
            worst.limited += report.limited;
            worst.non_finite += report.non_finite;
            worst.inverted = worst.inverted.max(report.inverted);
            fastest = tled.velocities().iter().fold(fastest, |most, v| most.max(v.length()));
        }
        // What came loose falls freely until it is empty too.
        let free_fall = GRAVITY.length() * dt * 6000.0;
        assert_eq!((worst.limited, worst.non_finite, worst.inverted), (0, 0, 0), "{averaged_pressure}, {seed}");
        assert!(fastest < free_fall, "{averaged_pressure}: {fastest} of {free_fall} mm/ms");
        assert!(tled.fills().iter().all(|&fill| fill == 0) && tled.velocities().iter().all(|v| *v == Vec3::ZERO));
    }
}

#[test]
fn a_cheaper_solver_has_the_same_hole() {
    let body = block(6);
    let (_, nodes) = without(&body, &hole(&body));
    let mut tled = emptied(&body, &Config::default(), &hole(&body));
    let mut cheaper = tled.cheaper().unwrap()().unwrap();
    cheaper.resume(&mut tled, &[]);
    let loads = Loads { gravity: GRAVITY, ..Loads::default() };
    (0..20).for_each(|_| _ = cheaper.step(&loads, 0.1));
    let is_still = |n: &u32| cheaper.velocities()[*n as usize] == Vec3::ZERO;
    let dead: Vec<u32> = (0..body.mesh.positions.len() as u32).filter(|n| nodes.binary_search(n).is_err()).collect();
    assert!(!dead.is_empty() && dead.iter().all(is_still));
    assert!(nodes.iter().filter(|n| is_still(n)).count() == body.fixed.len(), "the wall moves");
}

#[test]
fn a_fill_never_rises_and_foreign_numbers_change_nothing() {
    let body = block(3);
    let mut tled = Tled::new(&body, &Config::default()).unwrap();
    tled.lower_fill(7, FULL / 2);
    tled.lower_fill(7, FULL);
    tled.lower_fill(u32::MAX, 0);
    let fills: Vec<u16> = (0..RAMP_STEPS).map(|_| (tled.step(&Loads::default(), 0.1), tled.fills()[7]).1).collect();
    assert!(fills.is_sorted_by(|a, b| a >= b) && fills[0] < FULL && fills[9] == FULL / 2, "{fills:?}");
    assert_eq!(tled.fills().iter().filter(|&&fill| fill < FULL).count(), 1);
}
