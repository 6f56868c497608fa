//! Only what moves is stepped: a tool dents one corner of a large block, and elements whose nodes
//! rest fall asleep. What that saves, and how wrong it is.
//!
//! # Theory
//! What creeps more slowly than the limit of motion ([`Config::still_mm`]) in 50 ms is stopped
//! where it is; the error is the largest distance from the block with every element stepped, at any
//! time, as a share of the dent. What is saved is counted in elements, which no busy machine
//! changes.

use super::Scope;
use std::time::Instant;
use trepan_contact::NodalContact;
use trepan_evidence::picture::{Chart, Mark};
use trepan_evidence::suite::{Findings, Gate, Row};
use trepan_geometry::Vec3;
use trepan_soft::{Body, Loads, Material, SoftSolver, boxes};
use trepan_tled::{Config, Tled};

/// Steps with the tool, and as many without it.
const STEPS: usize = 2000;
const DENT_MM: f32 = 4.0;

/// Every limit beside the block with all elements stepped.
pub fn run(scope: Scope, findings: &mut Findings) {
    let cells = scope.pick([16, 12, 8], [24, 20, 14]);
    let mesh = boxes::split_box(cells, Vec3::from_array(cells.map(|n| 6.0 * n as f32)));
    let fixed = boxes::nodes_where(&mesh, |p| p.z < 1e-3);
    let body = Body::uniform(mesh, fixed, Material::BRAIN);
    let truth = history(&body, 0.0);
    let scene = format!("dent in one corner, {} tetrahedra", body.mesh.tets.len());
    let mut marks = Vec::new();
    for still_mm in [0.0f32, 1e-4, 1e-3, 1e-2, 1e-1] {
        let found = if still_mm > 0.0 { history(&body, still_mm) } else { truth.clone() };
        let furthest =
            found.places.iter().zip(&truth.places).map(|(a, b)| f64::from(a.distance(*b))).fold(0.0, f64::max);
        let error_percent = 100.0 * furthest / f64::from(DENT_MM);
        let method = format!("still {still_mm} mm");
        findings.rows.push(
            Row::new(&scene, &method)
                .with("tets", body.mesh.tets.len())
                .metric("stepped_percent", found.stepped_percent)
                .metric("step_mean_us", found.step_us)
                .metric("displacement_error_percent", error_percent),
        );
        if still_mm == 1e-3 {
            let name = format!("{scene}, {method}: off the block with all elements stepped, percent of the dent");
            findings.gates.push(Gate::at_most(name, error_percent, 1.0));
            let name = format!("{scene}, {method}: elements stepped, percent");
            findings.gates.push(Gate::at_most(name, found.stepped_percent, 60.0));
        }
        marks.push(Mark { method, cost: found.stepped_percent, error: error_percent });
    }
    findings.charts.push(Chart {
        title: "Only what moves is stepped: error over the share of elements stepped".into(),
        cost: "stepped_percent".into(),
        error: "displacement_error_percent".into(),
        marks,
        ..Chart::default()
    });
}

/// What a block did.
#[derive(Clone)]
struct History {
    /// Positions of all nodes every 50 steps, mm.
    places: Vec<Vec3>,
    stepped_percent: f64,
    step_us: f64,
}

fn history(body: &Body, still_mm: f32) -> History {
    let mut solver = Tled::new(body, &Config { still_mm, ..Config::default() }).expect("the block is sound");
    let (pressed, free, dt_ms) = (tool(body), Loads::default(), solver.stable_dt_ms());
    let (mut places, mut stepped, start) = (Vec::new(), 0.0, Instant::now());
    for step in 0..2 * STEPS {
        solver.step(if step < STEPS { &pressed } else { &free }, dt_ms);
        stepped += f64::from(solver.awake_share());
        if step % 50 == 49 {
            places.extend_from_slice(solver.positions());
        }
    }
    let count = 2.0 * STEPS as f64;
    History { places, stepped_percent: 100.0 * stepped / count, step_us: start.elapsed().as_secs_f64() * 1e6 / count }
}

/// A tool of 10 mm that stands 4 mm deep over the block's far corner.
fn tool(body: &Body) -> Loads {
    let (mut contact, top) = (NodalContact::none(), body.mesh.bounds().max);
    (contact.normal, contact.stiffness, contact.damping) = (Vec3::Z, 0.5, 0.05);
    let under = top - Vec3::new(15.0, 15.0, 0.0);
    boxes::nodes_where(&body.mesh, |p| p.distance(under) < 10.0 && p.z > top.z - 1e-3)
        .iter()
        .for_each(|&n| contact.add(n, 1.0));
    contact.normalise();
    contact.offset_mm = DENT_MM - top.z;
    Loads { contacts: contact.into(), ..Loads::default() }
}
