//! Every solver under the conditions in which solvers of its kind give way.
//!
//! # Practice
//! A cube of 40 mm of brain on its base, a second of simulated time. Each solver takes its own
//! stable step, at most 4 ms, or the multiple of it that the condition says. Works: rests where it
//! should without a node put back or held; degrades: usable, with that drawback; fails: bursts,
//! shakes or leaves numbers that are none.

use super::stability::{cube, offset};
use trepan_contact::NodalContact;
use trepan_evidence::picture::Outcome;
use trepan_evidence::suite::{Findings, Gate};
use trepan_geometry::{Vec3, units};
use trepan_rivals::Family;
use trepan_soft::{Body, Loads, Material, Method, SoftSolver, boxes};
use trepan_tled::{Config, Tled};
use trepan_trials_scenes::conditions;

/// Longest step of a solver that would take any, ms.
pub const LONGEST_MS: f32 = 4.0;
const SECOND_MS: f32 = 1000.0;
/// Steps by a solver that solves the whole problem in each.
pub const STATIC_STEPS: usize = 3;
/// Further than this no node of the cube may be from rest, mm.
const BURST_MM: f64 = 60.0;
/// A node that is still faster than this after a second is shaken, mm/ms.
pub const STILL: f32 = 0.02;

/// A solver, made for a body.
#[derive(Clone, Copy)]
pub enum Solver {
    /// TLED, as a session runs it.
    Tled {
        /// With averaged nodal pressure.
        cured: bool,
    },
    /// Another solver.
    Rival(Method),
}

impl Solver {
    /// Every solver with its name.
    pub fn all() -> Vec<(&'static str, Self)> {
        let mut all = vec![("tled", Self::Tled { cured: false }), ("tled cured", Self::Tled { cured: true })];
        all.extend(Method::all().iter().map(|method| (method.name(), Self::Rival(*method))));
        all
    }

    /// Makes the solver for a body.
    pub fn build(&self, body: &Body) -> Box<dyn SoftSolver> {
        match self {
            Self::Tled { cured } => {
                let config = Config { averaged_pressure: *cured, ..Config::default() };
                Box::new(Tled::new(body, &config).expect("the cube is sound"))
            }
            Self::Rival(method) => method.build(body).expect("the cube is sound"),
        }
    }

    /// Whether a step goes to equilibrium.
    pub fn is_static(&self) -> bool {
        matches!(self, Self::Rival(method) if method.descriptor().is_static)
    }
}

/// Sees a solver after every step.
pub type See<'a> = &'a mut dyn FnMut(&dyn SoftSolver);

type Condition = (&'static str, fn(&Solver) -> Outcome);

const CONDITIONS: [Condition; 12] = [
    ("nothing acts", |solver| endured(solver, &brain(), &Loads::default(), 1.0, 1e-3)),
    ("gravity", |solver| endured(solver, &brain(), &gravity(1.0), 1.0, BURST_MM)),
    ("gravity, 1.5 times its stable step", |solver| endured(solver, &brain(), &gravity(1.0), 1.5, BURST_MM)),
    ("gravity, 5 times its stable step", |solver| endured(solver, &brain(), &gravity(1.0), 5.0, BURST_MM)),
    ("five times gravity", |solver| endured(solver, &brain(), &gravity(5.0), 1.0, BURST_MM)),
    ("gravity, ν 0.49", |solver| endured(solver, &cube(4, poisson(0.49)), &gravity(1.0), 1.0, BURST_MM)),
    ("gravity, ν 0.499", |solver| endured(solver, &cube(4, poisson(0.499)), &gravity(1.0), 1.0, BURST_MM)),
    ("contact of 1 N/mm", |solver| endured(solver, &brain(), &pressed(1.0, 2.0), 1.0, 10.0)),
    ("pressed by half at 100 mm/s, let go", |solver| let_go(solver, 20.0, 0.1)),
    ("contact of 100 N/mm", |solver| endured(solver, &brain(), &pressed(100.0, 2.0), 1.0, 10.0)),
    ("pressed flat at once, let go", |solver| let_go(solver, 36.0, f32::INFINITY)),
    ("loads and steps that are no numbers", no_numbers),
];

/// The map of all solvers.
pub fn run(findings: &mut Findings) {
    let solvers = Solver::all();
    let names = CONDITIONS.map(|(name, _)| name);
    conditions::judge("Solvers", &names, &solvers, |at, solver| CONDITIONS[at].1(solver), findings);
    let map = findings.maps.last().expect("it was just drawn");
    let failed = |method: &str| {
        let own = map.named_cells().filter(|(_, column, _)| *column == method);
        own.filter(|(.., cell)| cell.grade() == 2).count()
    };
    for method in ["tled", "tled cured"] {
        let name = format!("{method}: conditions that it fails");
        findings.gates.push(Gate::at_most(name, failed(method) as f64, 0.0));
    }
}

/// A cube of brain on its base.
pub fn brain() -> Body {
    cube(4, Material::BRAIN)
}

fn poisson(poisson: f32) -> Material {
    Material::NeoHookean { young_mpa: 0.003, poisson, density_g_mm3: units::WATER_G_PER_MM3 }
}

fn gravity(times: f32) -> Loads {
    Loads { gravity: Vec3::X * (times * units::GRAVITY_MM_PER_MS2), ..Loads::default() }
}

/// A plate over the cube's top that stands some depth below it.
pub fn pressed(stiffness: f32, depth_mm: f32) -> Loads {
    let (mut contact, body) = (NodalContact::none(), brain());
    boxes::nodes_where(&body.mesh, |p| p.z > 39.9).iter().for_each(|&node| contact.add(node, 1.0));
    contact.normalise();
    (contact.normal, contact.stiffness, contact.damping) = (Vec3::Z, stiffness, 0.05);
    contact.offset_mm = depth_mm - 40.0;
    Loads { contacts: contact.into(), ..Loads::default() }
}

/// What a run left.
#[derive(Default)]
pub struct Left {
    /// Furthest that a node is from its rest position, mm.
    pub offset_mm: f64,
    /// Speed of the fastest node, mm/ms.
    pub fastest: f32,
    /// Nodes that burst and were put back, over all steps.
    pub put_back: u32,
    held: u32,
    /// Elements that are inside out at the end.
    pub inverted: u32,
    skipped_ms: f32,
    converged: bool,
}

/// Makes so many steps under steady loads.
pub fn left(solver: &mut dyn SoftSolver, body: &Body, loads: &Loads, dt_ms: f32, steps: usize, see: See) -> Left {
    let mut left = Left::default();
    for _ in 0..steps {
        let report = solver.step(loads, dt_ms);
        see(solver);
        left.inverted = report.inverted;
        left.put_back = left.put_back.saturating_add(report.non_finite);
        left.held = left.held.saturating_add(report.limited);
        left.skipped_ms += report.skipped_ms;
        left.converged = report.converged;
    }
    left.offset_mm = offset(solver, body);
    left.fastest = solver.velocities().iter().map(|v| v.length()).fold(0.0, f32::max);
    left
}

/// Steps of a second.
pub fn steps(of: &Solver, dt_ms: f32) -> usize {
    if of.is_static() { STATIC_STEPS } else { (SECOND_MS / dt_ms).ceil() as usize }
}

/// A second under steady loads.
fn endured(of: &Solver, body: &Body, loads: &Loads, step_share: f32, most_mm: f64) -> Outcome {
    let mut solver = of.build(body);
    let dt_ms = step_share * solver.stable_dt_ms().min(LONGEST_MS);
    let left = left(&mut *solver, body, loads, dt_ms, steps(of, dt_ms), &mut |_| ());
    if !left.offset_mm.is_finite() {
        Outcome::Fails("not a number".into())
    } else if left.put_back > 0 {
        Outcome::Fails("nodes burst and are put back".into())
    } else if left.offset_mm > most_mm {
        Outcome::Fails("is where it cannot be".into())
    } else if left.fastest > STILL {
        Outcome::Fails("still shaken after a second".into())
    } else if left.held > 0 {
        Outcome::Degrades("nodes held at the limits of motion".into())
    } else if left.skipped_ms > 0.0 {
        Outcome::Degrades("slower than real time, and says so".into())
    } else if !left.converged {
        Outcome::Degrades("does not converge, and says so".into())
    } else {
        Outcome::Works
    }
}

/// A plate comes down to a depth at a speed, mm/ms, stays for half a second, and is gone: back at
/// rest two seconds later.
fn let_go(of: &Solver, depth_mm: f32, speed: f32) -> Outcome {
    let_go_seen(of, depth_mm, speed, &mut |_| ())
}

/// The same; `see` sees the solver after every step.
pub fn let_go_seen(of: &Solver, depth_mm: f32, speed: f32, see: See) -> Outcome {
    let body = brain();
    let mut solver = of.build(&body);
    let dt_ms = solver.stable_dt_ms().min(LONGEST_MS);
    let half = steps(of, dt_ms).div_ceil(2);
    let depths = (1..).map(|step| speed * dt_ms * step as f32).take_while(|&depth| depth < depth_mm);
    for depth in depths.take(half) {
        solver.step(&pressed(1.0, depth), dt_ms);
        see(&*solver);
    }
    let flat = left(&mut *solver, &body, &pressed(1.0, depth_mm), dt_ms, half, see);
    let after = left(&mut *solver, &body, &Loads::default(), dt_ms, 4 * half, see);
    if !after.offset_mm.is_finite() || flat.put_back + after.put_back > 0 {
        Outcome::Fails("bursts".into())
    } else if after.offset_mm > 1.0 {
        Outcome::Fails("does not come back".into())
    } else if after.offset_mm > 0.2 {
        Outcome::Degrades("not quite back after two seconds".into())
    } else {
        Outcome::Works
    }
}

fn no_numbers(of: &Solver) -> Outcome {
    let body = brain();
    let mut solver = of.build(&body);
    let dt_ms = solver.stable_dt_ms().min(LONGEST_MS);
    solver.step(&Loads { gravity: Vec3::NAN, ..Loads::default() }, dt_ms);
    [0.0, -1.0, f32::NAN, f32::INFINITY].into_iter().for_each(|dt_ms| _ = solver.step(&gravity(0.1), dt_ms));
    let after = left(&mut *solver, &body, &Loads::default(), dt_ms, 2 * steps(of, dt_ms), &mut |_| ());
    if !after.offset_mm.is_finite() {
        Outcome::Fails("not a number ever after".into())
    } else if after.offset_mm > 0.2 {
        Outcome::Degrades("not back at rest two seconds later".into())
    } else {
        Outcome::Works
    }
}
