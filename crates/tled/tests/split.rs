//! Bodies that are cut while they move: a solver made anew goes on with copies of nodes.

use trepan_geometry::Vec3;
use trepan_mesh::{NONE, Split, Splitter, TetMesh};
use trepan_soft::{Body, Loads, Material, SoftSolver, boxes};
use trepan_tled::{Config, Relaxation, Tled};

/// Splits along the faces between two sides, of those that `cuts` takes by their tetrahedron's
/// middle.
fn splits(mesh: &TetMesh, side: impl Fn(Vec3) -> bool, cuts: impl Fn(Vec3) -> bool) -> Vec<Split> {
    let middle = |tet: u32| mesh.corners(tet as usize).into_iter().sum::<Vec3>() / 4.0;
    let (mut splitter, mut splits) = (Splitter::of(mesh), Vec::with_capacity(4 * mesh.tets.len()));
    for (tet, face) in (0..mesh.tets.len() as u32).flat_map(|tet| (0..4).map(move |face| (tet, face))) {
        let next = splitter.neighbours(tet)[face];
        if next != NONE && side(middle(tet)) != side(middle(next)) && cuts(middle(tet)) {
            splitter.cut(tet, face, |_| false, &mut splits);
        }
    }
    splits
}

/// A block of brain, 40 mm wide, on its floor.
fn block() -> Body {
    let mesh = boxes::split_box([10, 8, 8], Vec3::new(40.0, 32.0, 32.0));
    let fixed = boxes::nodes_where(&mesh, |p| p.z < 1e-3);
    Body::uniform(mesh, fixed, Material::BRAIN)
}

fn config() -> Config {
    Config { averaged_pressure: true, relaxation: Relaxation::BRAIN, ..Config::default() }
}

/// The solver of the same body after a cut, with its state.
fn cut(solver: &mut Tled, splits: &[Split]) -> Box<dyn SoftSolver> {
    let mut next = solver.split(splits).expect("it can be split")().expect("the body is sound");
    next.resume(solver, splits);
    next
}

#[test]
fn a_cut_in_motion_opens_to_the_rest_shape_of_a_body_made_with_it() {
    let body = block();
    let splits = splits(&body.mesh, |p| p.x < 20.0, |p| p.z > 12.0);
    let mut apart = body.clone();
    apart.split(&splits).unwrap();
    assert!(apart.mesh.positions.len() > body.mesh.positions.len() + 40);
    // Both halves are drawn aside by their own weight.
    let loads = Loads { gravity: Vec3::new(0.0, 0.0, -9.81e-3), ..Loads::default() };
    let mut solver = Tled::new(&body, &config()).unwrap();
    (0..400).for_each(|_| _ = solver.step(&loads, solver.stable_dt_ms()));
    let mut opened = cut(&mut solver, &splits);
    assert_eq!(opened.positions()[..body.mesh.positions.len()], *solver.positions());
    assert!(opened.stable_dt_ms() > 0.5 * solver.stable_dt_ms());
    let mut anew = Tled::new(&apart, &config()).unwrap();
    let (dt_ms, mut inverted) = (opened.stable_dt_ms().min(anew.stable_dt_ms()), 0);
    for _ in 0..12_000 {
        inverted += opened.step(&loads, dt_ms).inverted;
        anew.step(&loads, dt_ms);
    }
    let far = |(a, b): (&Vec3, &Vec3)| a.distance(*b);
    let off_mm = opened.positions().iter().zip(anew.positions()).map(far).fold(0.0, f32::max);
    let sunk_mm = anew.positions().iter().zip(&apart.mesh.positions).map(far).fold(0.0, f32::max);
    let gap_mm = splits.iter().map(|s| anew.positions()[s.node as usize].distance(anew.positions()[s.from as usize]));
    let gap_mm = gap_mm.fold(0.0, f32::max);
    assert!(inverted == 0 && off_mm < 0.01 * sunk_mm, "{inverted} {off_mm} of {sunk_mm} mm");
    assert!(gap_mm > 0.02 * sunk_mm, "it gapes by {gap_mm} mm");
}

#[test]
fn a_cut_keeps_the_momentum() {
    let body = block();
    let splits = splits(&body.mesh, |p| p.x + 0.3 * p.y < 25.0, |p| p.z > 8.0);
    let mut solver = Tled::new(&body, &Config { damping: trepan_tled::Damping::None, ..config() }).unwrap();
    (0..body.mesh.positions.len() as u32).filter(|n| !body.fixed.contains(n)).for_each(|node| {
        let at = body.mesh.positions[node as usize];
        solver.set_node(node, Vec3::X * 0.02 * at.z, Vec3::new(0.01, 0.002, -0.003));
    });
    let mut apart = body.clone();
    apart.split(&splits).unwrap();
    let momentum = |body: &Body, velocities: &[Vec3]| -> Vec3 {
        body.lumped_masses_g().iter().zip(velocities).map(|(grams, v)| *v * *grams as f32).sum()
    };
    let opened = cut(&mut solver, &splits);
    let [before, after] = [momentum(&body, solver.velocities()), momentum(&apart, opened.velocities())];
    assert!(before.distance(after) < 1e-6 * before.length(), "{before} {after}");
}

#[test]
fn fills_pressure_and_stress_memory_are_taken_over() {
    let body = block();
    let splits = splits(&body.mesh, |p| p.y < 16.0, |p| p.z > 16.0);
    let strained = || {
        let mut solver = Tled::new(&body, &config()).unwrap();
        let top = boxes::nodes_where(&body.mesh, |p| p.z > 31.0);
        top.iter().for_each(|n| solver.set_node(*n, Vec3::Z * -2.0, Vec3::ZERO));
        (0..30).for_each(|tet| solver.lower_fill(10 * tet, if tet % 2 == 0 { 0 } else { 30_000 }));
        (0..40).for_each(|_| _ = solver.step(&Loads::default(), solver.stable_dt_ms()));
        solver
    };
    // Largest distance after so many steps of the same length.
    let apart = |a: &mut dyn SoftSolver, b: &mut dyn SoftSolver, steps: usize| {
        let dt_ms = a.stable_dt_ms();
        (0..steps).for_each(|_| _ = (a.step(&Loads::default(), dt_ms), b.step(&Loads::default(), dt_ms)));
        a.positions().iter().zip(b.positions()).map(|(a, b)| a.distance(*b)).fold(0.0, f32::max)
    };
    // A cheaper solver of a cut body goes on with the stress of its own elements: no kick.
    let [mut cut_now, mut former] = [cut(&mut strained(), &splits), cut(&mut strained(), &splits)];
    let mut cheaper = former.cheaper().expect("there is one")().expect("the body is sound");
    cheaper.resume(&mut *former, &[]);
    let off_mm = apart(&mut *cut_now, &mut *cheaper, 4);
    assert!(off_mm < 0.02, "{off_mm} mm");
    // A pressure lies on the faces, whichever nodes they have.
    let triangles = trepan_mesh::Surface::of(&body.mesh).triangles;
    let mut pressed = Tled::new(&body, &config()).unwrap();
    pressed.set_pressure(trepan_soft::SurfacePressure { triangles, mpa: 1e-3 });
    let mut pressed = cut(&mut pressed, &splits);
    pressed.step(&Loads::default(), 0.1);
    let copies = splits.iter().map(|split| split.node as usize).filter(|n| body.mesh.positions.len() <= *n);
    assert!(copies.clone().any(|n| pressed.velocities()[n] != Vec3::ZERO), "copies are pressed too");
    // Without a cut it goes on as it was, and the one before it without its stress memory.
    let [mut solver, mut former] = [strained(), strained()];
    let mut same = cut(&mut former, &[]);
    let off_mm = apart(&mut solver, &mut *same, 20);
    let without_mm = apart(&mut strained(), &mut former, 20);
    assert!(off_mm < 0.05 && without_mm > 4.0 * off_mm, "{off_mm} and {without_mm} mm");
    assert!(solver.split(&[Split { corner: 0, from: 0, node: 1 << 20 }]).unwrap()().is_none(), "it does not fit");
}
