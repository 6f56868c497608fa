//! Tissue pressed by a wall comes to rest, with light nodes and rare updates of the wall.
#![expect(clippy::unwrap_used, reason = "a test may panic")]

use trepan_contact::NodalContacts;
use trepan_deformable::SlidingWall;
use trepan_geometry::Vec3;
use trepan_soft::{Body, Loads, Material, SoftSolver, boxes};
use trepan_stages::SolverStage;
use trepan_tled::{Config, Tled};

/// Makes a slab of brain, 12 x 12 x 4 mm, fixed at its upper side; nodes weigh 0.0004 to 0.001 g.
fn slab() -> Body {
    let mesh = boxes::split_box([12, 12, 4], Vec3::new(12.0, 12.0, 4.0));
    let fixed = boxes::nodes_where(&mesh, |p| p.z > 3.99);
    Body::uniform(mesh, fixed, Material::BRAIN)
}

/// Presses the slab 0.5 mm deep into a slightly curved wall for 400 ms. Returns the largest change
/// of a node's velocity in a step, mm/ms, in the first and in the last 20 ms, and the final force
/// of the wall, N.
fn pressed(refresh: u64) -> (f32, f32, f32) {
    let body = slab();
    let wall = SlidingWall::around(&body.mesh, &body.fixed).unwrap();
    let centre = Vec3::new(6.3, 5.8, 60.5);
    let hollow = |p: Vec3| (60.0 - p.distance(centre), (centre - p).normalize());
    let mut solver = Tled::new(&body, &Config::default()).unwrap();
    let dt_ms = solver.stable_dt_ms();
    let mut loads = Loads { contacts: NodalContacts::with_room(), ..Loads::default() };
    let (mut first, mut last, mut force) = (0.0f32, 0.0f32, 0.0);
    let steps = (400.0 / dt_ms) as u64;
    for step in 0..steps {
        if step % refresh == 0 {
            loads.contacts.clear();
            wall.step(solver.positions(), hollow, &mut loads.contacts);
        }
        let before = solver.velocities().to_vec();
        force = solver.step(&loads, dt_ms).contact_n;
        let change = before.iter().zip(solver.velocities()).map(|(a, b)| a.distance(*b)).fold(0.0, f32::max);
        let time_ms = step as f32 * dt_ms;
        first = if time_ms < 20.0 { first.max(change) } else { first };
        last = if time_ms > 380.0 { last.max(change) } else { last };
    }
    (first, last, force)
}

#[test]
fn light_nodes_pressed_on_a_wall_come_to_rest() {
    for refresh in [1, 2, 4] {
        let (first, last, force) = pressed(refresh);
        assert!(first > 1e-3 && force > 1e-3, "nothing is pressed: {first} mm/ms, {force} N");
        assert!(last < 1e-3 * first, "every {refresh} steps: {first} mm/ms at first, {last} at the end");
    }
}

/// Motion of a node without a touch is counted and gives a remark.
#[test]
fn motion_without_touch_is_counted_and_gives_a_remark() {
    let body = slab();
    let mut stage = SolverStage::new(Box::new(Tled::new(&body, &Config::default()).unwrap()));
    let mut loads = Loads::default();
    (0..200).for_each(|_| _ = stage.step(&loads, 1));
    assert_eq!((stage.solver_faults().restless_steps, stage.solver_faults().rest_motion_mm), (0, 0.0));
    assert_eq!(stage.solver_faults().remarks().count(), 0);
    loads.gravity = Vec3::X * 3.0;
    (0..200).for_each(|_| _ = stage.step(&loads, 2));
    assert!(
        stage.solver_faults().restless_steps > 0 && stage.solver_faults().rest_motion_mm > 0.02,
        "{:?}",
        stage.solver_faults()
    );
    assert!(stage.solver_faults().remarks().any(|remark| remark.contains("moved by itself")));
}
