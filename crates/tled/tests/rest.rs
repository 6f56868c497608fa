//! What `settle` says of the way that is left, against where the body comes to rest.

use trepan_contact::NodalContact;
use trepan_geometry::{Vec3, units};
use trepan_mesh::Surface;
use trepan_soft::reference::{self, Reference};
use trepan_soft::{Anchor, Body, Fluid, Loads, Material, Membrane, SoftSolver, SurfacePressure, boxes};
use trepan_tled::{Config, Relaxation, Settling, Tled};

/// A body under loads.
struct Case {
    name: &'static str,
    body: Body,
    config: Config,
    loads: Loads,
    pressure: SurfacePressure,
}

impl Case {
    fn of(name: &'static str, body: Body, averaged_pressure: bool, loads: Loads) -> Self {
        let config = Config { averaged_pressure, ..Config::default() };
        Self { name, body, config, loads, pressure: SurfacePressure::default() }
    }

    fn solver(&self) -> Tled {
        let mut solver = Tled::new(&self.body, &self.config).expect("the body is sound");
        solver.set_pressure(self.pressure.clone());
        solver
    }
}

fn gravity() -> Loads {
    Loads { gravity: Vec3::NEG_Z * units::GRAVITY_MM_PER_MS2, ..Loads::default() }
}

/// Cells along each edge of a box, held on one side.
fn held(cells: [usize; 3], size: Vec3, material: Material, is_held: impl Fn(Vec3) -> bool) -> Body {
    let mesh = boxes::split_box(cells, size);
    let fixed = boxes::nodes_where(&mesh, is_held);
    Body::uniform(mesh, fixed, material)
}

fn silicone(poisson: f32) -> Material {
    Material::NeoHookean { young_mpa: 1.8, poisson, density_g_mm3: units::WATER_G_PER_MM3 }
}

/// A rod of 182 mm, 7.5 mm thick, that hangs from one end.
fn rod(poisson: f32, across: usize, along: usize) -> Body {
    held([along, across, across], Vec3::new(182.0, 7.5, 7.5), silicone(poisson), |p| p.x < 1e-3)
}

fn block() -> Body {
    held([5; 3], Vec3::splat(40.0), Material::BRAIN, |p| p.z < 1e-3)
}

/// Spring on the nodes around the middle of the block's top, pressed in by 3 mm.
fn pressed(body: &Body, reach_mm: f32, stiffness: f32) -> Loads {
    let mut contact = NodalContact::none();
    (contact.normal, contact.stiffness, contact.offset_mm) = (Vec3::Z, stiffness, 3.0 - 40.0);
    let under = Vec3::new(16.0, 16.0, 40.0);
    let near = boxes::nodes_where(&body.mesh, |p| p.distance(under) < reach_mm);
    near.iter().for_each(|&n| contact.add(n, 1.0));
    contact.normalise();
    Loads { contacts: contact.into(), ..Loads::default() }
}

/// The block, held at its sides by springs, half of which hold in fluid only, and half of it dry.
fn anchored() -> Case {
    let mut body = block();
    let beside = |p: Vec3| p.x < 1e-3 && p.z > 1.0;
    let anchor = |node| Anchor { node, normal: Vec3::X, along: 1e-3, across: 2e-4, in_fluid: 0.5, open_mm2: 2.0 };
    body.anchors = boxes::nodes_where(&body.mesh, beside).into_iter().map(anchor).collect();
    let weight = Vec3::NEG_Z * units::GRAVITY_MM_PER_MS2;
    let fluid = Fluid { level_mm: 20.0, weight, opening_mpa: 1e-4, ..Fluid::default() };
    Case::of("anchors and fluid", body, false, Loads { fluid, ..Loads::default() })
}

/// The block with a membrane forty times as stiff as its tissue on top.
fn covered() -> Body {
    let body = block();
    let on_top = |t: &[u32; 3]| t.iter().all(|&n| body.mesh.positions[n as usize].z > 39.9);
    let triangles = Surface::of(&body.mesh).triangles.into_iter().filter(on_top).collect();
    Body { membrane: Membrane { triangles, shear_n_per_mm: 0.12 }, ..body }
}

fn cases() -> Vec<Case> {
    let (one, many) = (pressed(&block(), 1.0, 1e4), pressed(&block(), 13.0, 0.3));
    let triangles = Surface::of(&block().mesh).triangles;
    let squeezed = Case::of("pressure", block(), true, Loads::default());
    let relaxing = Case::of("relaxing", block(), false, gravity());
    vec![
        Case::of("block", block(), false, gravity()),
        Case::of("block, averaged pressure", block(), true, gravity()),
        Case::of("stiff spring on one node", block(), false, one.clone()),
        Case::of("stiff spring on one node, averaged pressure", block(), true, one),
        Case::of("pressed surface", block(), true, many),
        anchored(),
        Case::of("membrane under weight", covered(), false, gravity()),
        Case::of("membrane pressed in", covered(), true, pressed(&block(), 13.0, 0.3)),
        Case::of("rod", rod(0.3, 2, 40), false, gravity()),
        Case::of("incompressible rod, averaged pressure", rod(0.49, 2, 40), true, gravity()),
        Case { pressure: SurfacePressure { triangles, mpa: 1.3e-3 }, ..squeezed },
        Case { config: Config { relaxation: Relaxation::BRAIN, ..Config::default() }, ..relaxing },
    ]
}

fn distance(a: &[Vec3], b: &[Vec3]) -> f32 {
    a.iter().zip(b).map(|(a, b)| a.distance(*b)).fold(0.0, f32::max)
}

#[test]
fn what_is_left_is_the_true_distance_from_rest() {
    for case in cases() {
        let mut exact = case.solver();
        let all = exact.settle(&case.loads, &Settling { tolerance_mm: 1e-4, steps: 2000 });
        println!("{}: {all:?}", case.name);
        assert!(all.converged && all.steps < 150, "{}: {all:?}", case.name);
        for tolerance_mm in [1.0, 0.1, 0.01, 0.001] {
            let mut solver = case.solver();
            let settled = solver.settle(&case.loads, &Settling { tolerance_mm, ..Settling::default() });
            let away = distance(solver.positions(), exact.positions());
            println!("  {tolerance_mm}: {} steps, left {}, away {away}", settled.steps, settled.left_mm);
            assert!(settled.converged && settled.left_mm <= tolerance_mm, "{}: {settled:?}", case.name);
            assert!(away < 3.0 * settled.left_mm + 2e-4, "{}: {away} mm away, {settled:?}", case.name);
        }
        for steps in [1, 2, 4, 8] {
            let mut solver = case.solver();
            let settled = solver.settle(&case.loads, &Settling { tolerance_mm: 0.01, steps });
            let away = distance(solver.positions(), exact.positions());
            println!("  {steps} steps: left {}, away {away}, converged {}", settled.left_mm, settled.converged);
            assert!(!settled.converged || away < 0.02, "{}: {away} mm away, {settled:?}", case.name);
        }
    }
}

/// The same forces with inertia: where the motion of a body at rest goes in half a second.
#[test]
fn what_is_at_rest_does_not_move() {
    for case in cases().into_iter().filter(|case| case.config.relaxation.is_none()) {
        let mut solver = case.solver();
        solver.settle(&case.loads, &Settling { tolerance_mm: 0.001, ..Settling::default() });
        let (before, dt_ms) = (solver.positions().to_vec(), solver.stable_dt_ms());
        (0..(500.0 / dt_ms).min(5000.0) as usize).for_each(|_| _ = solver.step(&case.loads, dt_ms));
        let moved = distance(&before, solver.positions());
        println!("{}: {moved} mm", case.name);
        assert!(moved < 0.005, "{}: {moved} mm", case.name);
    }
}

#[test]
fn a_rod_comes_to_rest_where_the_reference_is() {
    let body = rod(0.3, 2, 40);
    let mut exact = Reference::new(&body, &reference::Config::default()).unwrap();
    assert!(exact.step(&gravity(), 1.0).converged);
    let mut solver = Tled::new(&body, &Config::default()).unwrap();
    let settled = solver.settle(&gravity(), &Settling { tolerance_mm: 0.01, ..Settling::default() });
    let (away, sunk) =
        (distance(solver.positions(), exact.positions()), 3.75 - solver.positions()[body.mesh.positions.len() - 1].z);
    println!("{settled:?}: {away} mm away, sunk by {sunk} mm");
    assert!(settled.converged && away < 0.02 && sunk > 30.0 && settled.steps < 100, "{settled:?} {away} {sunk}");
}
