//! Weight above a fluid's level, and anchors, against closed forms and the f64 reference.

use trepan_contact::{NodalContact, NodalContacts};
use trepan_geometry::Vec3;
use trepan_soft::reference::{self, Reference};
use trepan_soft::{Anchor, Body, Fluid, Loads, Material, SoftSolver, boxes};
use trepan_tled::{Config, Settling, Tled};

const WEIGHT: Vec3 = Vec3::new(0.0, 0.0, -9.81e-3);

fn block() -> Body {
    let mesh = boxes::split_box([4, 4, 6], Vec3::new(40.0, 40.0, 60.0));
    let fixed = boxes::nodes_where(&mesh, |p| p.z < 1.0);
    Body::uniform(mesh, fixed, Material::BRAIN)
}

fn settled(body: &Body, loads: &Loads) -> Vec<Vec3> {
    let mut tled = Tled::new(body, &Config::default()).expect("the body is sound");
    assert!(tled.settle(loads, &Settling { tolerance_mm: 1e-3, steps: 50_000 }).converged);
    tled.positions().to_vec()
}

fn apart(a: &[Vec3], b: &[Vec3]) -> f32 {
    a.iter().zip(b).map(|(a, b)| a.distance(*b)).fold(0.0, f32::max)
}

#[test]
fn all_dry_a_body_sags_as_under_gravity_and_all_wet_it_does_not_move() {
    let body = block();
    let mut reference = Reference::new(&body, &reference::Config::default()).unwrap();
    assert!(reference.step(&Loads { gravity: 0.3 * WEIGHT, ..Loads::default() }, 1.0).converged);
    let at = |level_mm: f32| {
        let fluid = Fluid { level_mm, weight: 0.3 * WEIGHT, ..Fluid::default() };
        settled(&body, &Loads { fluid, ..Loads::default() })
    };
    let (dry, half, wet) = (at(-100.0), at(30.0), at(100.0));
    let sag = apart(&dry, &body.mesh.positions);
    assert!(sag > 1.0 && apart(&dry, reference.positions()) < 0.01 * sag);
    assert_eq!(apart(&wet, &body.mesh.positions), 0.0);
    let top = |positions: &[Vec3]| positions.iter().map(|p| p.z).fold(0.0, f32::max);
    assert!((60.0 - top(&half)) > 0.2 && (60.0 - top(&half)) < 0.9 * (60.0 - top(&dry)));
}

/// A stiff block on anchors alone at its free end: `force = stiffness x way`.
#[test]
fn anchors_bear_what_their_springs_say_and_let_go_above_the_level() {
    let mut body = block();
    body.materials = vec![Material::NeoHookean { young_mpa: 1e-5, poisson: 0.3, density_g_mm3: 1e-3 }];
    let top = boxes::nodes_where(&body.mesh, |p| p.z > 59.0);
    let anchor =
        |&node: &u32| Anchor { node, normal: Vec3::Z, along: 0.02, across: 0.005, in_fluid: 1.0, open_mm2: 2.0 };
    body.anchors = top.iter().map(anchor).collect();
    let mean = |positions: &[Vec3]| -> Vec3 {
        top.iter().map(|&n| positions[n as usize] - body.mesh.positions[n as usize]).sum::<Vec3>() / top.len() as f32
    };
    let pushed = |level_mm: f32| {
        let fluid = Fluid { level_mm, opening_mpa: 1e-3, ..Fluid::default() };
        mean(&settled(&body, &Loads { fluid, ..Loads::default() }))
    };
    let (held, free) = (pushed(1e3), pushed(-1e3));
    assert!((held.z / 0.1 - 1.0).abs() < 0.1, "2 mm2 x 1 kPa on 0.02 N/mm give 0.1 mm, not {held}");
    assert!(free.z > 2.0 * held.z, "{free}");
}

/// A tool that presses anchored nodes: hand and tissue agree at rest, `force = k depth`.
#[test]
fn a_spring_on_anchored_nodes_gives_its_whole_force() {
    let mut body = block();
    let top = boxes::nodes_where(&body.mesh, |p| p.z > 59.0);
    let anchor = |&node: &u32| Anchor { node, normal: Vec3::Z, along: 0.05, across: 0.05, ..Anchor::default() };
    body.anchors = top.iter().map(anchor).collect();
    let mut spring = NodalContact::none();
    (spring.normal, spring.offset_mm, spring.stiffness, spring.damping) = (Vec3::Z, 3.0 - 60.0, 0.3, 0.3);
    top.iter().for_each(|&node| spring.add(node, 1.0));
    spring.normalise();
    let loads = Loads { contacts: NodalContacts::from(spring), ..Loads::default() };
    let mut tled = Tled::new(&body, &Config::default()).unwrap();
    let mut force = 0.0;
    (0..4000).for_each(|_| force = tled.step(&loads, tled.stable_dt_ms()).contact_n);
    let depth = spring.offset_mm + spring.mean(|n| tled.positions()[n as usize]).z;
    assert!(depth > 0.1 && (force / (0.3 * depth) - 1.0).abs() < 0.01, "{force} N at {depth} mm");
}
