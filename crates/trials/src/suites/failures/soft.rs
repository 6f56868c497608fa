//! Soft tissue: a bar whose rest is wrong, a cube that bursts or does not come back.
//!
//! # Theory
//! A slender bar of neo-Hookean tissue hangs along its axis by one end. At height X from the held
//! end its nominal stress is the weight below,
//! ```text
//! P(λ(X)) = ρ g (L - X),    tip = ∫ (λ(X) - 1) dX
//! ```
//! with P(λ) in uniaxial tension with free sides: a closed form at any load and Poisson's ratio.
//! The held end, which cannot narrow, stiffens a real bar by a few percent.

use super::{Candidate, Family, Scope, Standing};
use crate::suites::tled::closed_forms::{free_side, kirchhoff};
use crate::suites::tled::rivals::{LONGEST_MS, Left, STILL, Solver, brain, left, let_go_seen, pressed, steps};
use crate::suites::tled::stability::offset;
use trepan_evidence::nearest::{Condition, Scale, Trial, exceeds};
use trepan_evidence::picture::Outcome;
use trepan_geometry::{Vec3, units};
use trepan_soft::{Body, Loads, Material, SoftSolver, boxes};

/// Largest error of the bar's tip, as a share.
const MOST_SHARE: f64 = 0.1;

pub const FAMILY: Family<Solver> = Family {
    suite: "tled",
    criterion: "a solver fails when the tip of a hanging bar is more than 10 % from its closed form; when a cube pressed \
                by a plate bursts, is further than 10 mm from rest, is still shaken a second later (20 mm/s) or is \
                more than 1 mm from rest two seconds after it was let go; when elements stay inside out or anything \
                is not a number",
    methods,
};

fn methods(scope: Scope) -> Vec<Candidate<Solver>> {
    let candidate = |(name, method): (&'static str, Solver)| {
        let standing = match method {
            Solver::Tled { .. } => Standing::Own,
            Solver::Rival(rival) if rival.descriptor().is_static => Standing::Oracle,
            Solver::Rival(_) => Standing::by_name(name),
        };
        // The last two are long; a quick run puts only our own solvers to them.
        let conditions = if standing == Standing::Own { &CONDITIONS[..] } else { &CONDITIONS[..scope.pick(5, 7)] };
        Candidate { name: name.into(), standing, conditions, method }
    };
    Solver::all().into_iter().map(candidate).collect()
}

const TIP: [&str; 2] = ["time, ms", "way of the bar's tip, mm"];
const FURTHEST: [&str; 2] = ["time, ms", "furthest node from rest, mm"];

const CONDITIONS: [Condition<Solver>; 7] = [
    Condition {
        name: "load: gravity on a bar",
        unit: "g",
        nominal: BAR.gravity,
        limits: [BAR.gravity, 16.0],
        scale: Scale::Log,
        axes: TIP,
        trial: |solver, gravity| bar(solver, &Bar { gravity, ..BAR }),
    },
    Condition {
        name: "Poisson's ratio of a bar",
        unit: "1",
        nominal: BAR.poisson,
        limits: [BAR.poisson, 0.4999],
        scale: Scale::BelowHalf,
        axes: TIP,
        trial: |solver, poisson| bar(solver, &Bar { poisson, ..BAR }),
    },
    Condition {
        name: "time step over the stable one",
        unit: "1",
        nominal: 1.0,
        limits: [1.0, 256.0],
        scale: Scale::Log,
        axes: TIP,
        trial: |solver, step| bar(solver, &Bar { step, ..BAR }),
    },
    Condition {
        name: "height of a layer of elements",
        unit: "edges",
        nominal: 1.0,
        limits: [1.0 / 64.0, 1.0],
        scale: Scale::Log,
        axes: TIP,
        trial: |solver, layer| bar(solver, &Bar { layer, ..BAR }),
    },
    Condition {
        name: "stiffness of a contact",
        unit: "N/mm",
        nominal: 1.0,
        limits: [1.0, 1e4],
        scale: Scale::Log,
        axes: FURTHEST,
        trial: contact,
    },
    Condition {
        name: "depth of a press of 40 mm",
        unit: "mm",
        nominal: 10.0,
        limits: [10.0, 39.9],
        scale: Scale::Log,
        axes: FURTHEST,
        trial: |solver, depth| released(solver, depth as f32, 0.1),
    },
    Condition {
        name: "speed of a press by 10 mm",
        unit: "mm/s",
        nominal: 100.0,
        limits: [100.0, 1e5],
        scale: Scale::Log,
        axes: FURTHEST,
        trial: |solver, speed| released(solver, 10.0, speed as f32 / 1000.0),
    },
];

/// A hanging bar.
struct Bar {
    /// Times the Earth's.
    gravity: f64,
    poisson: f64,
    /// Times the solver's own stable step.
    step: f64,
    /// Height of the layer in the middle, of a regular one's.
    layer: f64,
}

/// Strains of a few percent, in which all constitutive laws agree.
const BAR: Bar = Bar { gravity: 0.25, poisson: 0.45, step: 1.0, layer: 1.0 };
const LENGTH_MM: f64 = 40.0;
const ACROSS_MM: f32 = 8.0;
const CELLS: [usize; 3] = [10, 2, 2];

fn bar(of: &Solver, bar: &Bar) -> Trial {
    let size = Vec3::new(LENGTH_MM as f32, ACROSS_MM, ACROSS_MM);
    let mut mesh = boxes::centred_box(CELLS, size);
    mesh.positions.iter_mut().for_each(|p| p.x = layered(p.x, bar.layer as f32));
    let fixed = boxes::nodes_where(&mesh, |p| p.x < 1e-3);
    let tip = boxes::nodes_where(&mesh, |p| p.distance(Vec3::new(size.x, 0.5 * ACROSS_MM, 0.5 * ACROSS_MM)) < 1e-3)[0]
        as usize;
    let material =
        Material::NeoHookean { young_mpa: 0.003, poisson: bar.poisson as f32, density_g_mm3: units::WATER_G_PER_MM3 };
    let body = Body::uniform(mesh, fixed, material);
    let gravity = bar.gravity * f64::from(units::GRAVITY_MM_PER_MS2);
    let loads = Loads { gravity: Vec3::X * gravity as f32, ..Loads::default() };
    let way = |solver: &dyn SoftSolver| f64::from(solver.positions()[tip].x) - LENGTH_MM;
    let (found, trace, last) = run(of, &body, &loads, bar.step, way);
    let truth = tip_mm(material, gravity);
    let off = last / truth - 1.0;
    let wrong = exceeds(off.abs(), MOST_SHARE).then(|| format!("the tip is {:+.0} % off", 100.0 * off));
    Trial { fault: broken(&found).or(wrong), trace }
}

/// Moves the plane in the middle of the bar to a share of its height over the one below; the layers
/// beside it follow.
fn layered(x: f32, share: f32) -> f32 {
    let cell = LENGTH_MM as f32 / CELLS[0] as f32;
    let beside = x / cell - (CELLS[0] / 2) as f32;
    match beside {
        beside if beside.abs() >= 1.0 => x,
        beside => x - (1.0 - share) * cell * (1.0 - beside.abs()),
    }
}

/// Way of the tip of a bar of this material, mm, under an acceleration in mm/ms².
fn tip_mm(material: Material, gravity: f64) -> f64 {
    const SLICES: usize = 40;
    let stress = |stretch: f64| {
        let side = free_side(|t| kirchhoff(material, [t, t, stretch])[0]);
        kirchhoff(material, [side, side, stretch])[2] / stretch
    };
    let slice = LENGTH_MM / SLICES as f64;
    let stretched = |n: usize| {
        let below = LENGTH_MM - (n as f64 + 0.5) * slice;
        let weight = f64::from(units::WATER_G_PER_MM3) * gravity * below;
        let (mut low, mut high) = (1.0, 20.0);
        for _ in 0..50 {
            let middle = 0.5 * (low + high);
            if stress(middle) < weight { low = middle } else { high = middle }
        }
        (low - 1.0) * slice
    };
    (0..SLICES).map(stretched).sum()
}

/// Two seconds under steady loads: what was left, a trace, and its last value.
fn run(
    of: &Solver,
    body: &Body,
    loads: &Loads,
    step: f64,
    measure: impl Fn(&dyn SoftSolver) -> f64,
) -> (Left, Vec<(f64, f64)>, f64) {
    let mut solver = of.build(body);
    let dt_ms = step as f32 * solver.stable_dt_ms().min(LONGEST_MS);
    let steps = 2 * steps(of, dt_ms);
    let mut watch = Watch::every(dt_ms, steps);
    let found = left(&mut *solver, body, loads, dt_ms, steps, &mut |solver| watch.see(|| measure(solver)));
    (found, watch.trace, measure(&*solver))
}

/// A trace of some hundred points.
struct Watch {
    dt_ms: f32,
    every: usize,
    step: usize,
    trace: Vec<(f64, f64)>,
}

impl Watch {
    fn every(dt_ms: f32, steps: usize) -> Self {
        Self { dt_ms, every: steps.div_ceil(400).max(1), step: 0, trace: Vec::new() }
    }

    fn see(&mut self, measure: impl FnOnce() -> f64) {
        self.step += 1;
        if self.step.is_multiple_of(self.every) {
            self.trace.push((self.step as f64 * f64::from(self.dt_ms), measure()));
        }
    }
}

/// What no body may be after a run.
fn broken(found: &Left) -> Option<String> {
    if !found.offset_mm.is_finite() {
        Some("not a number".into())
    } else if found.put_back > 0 {
        Some("nodes burst and are put back".into())
    } else if found.inverted > 0 {
        Some(format!("{} elements stay inside out", found.inverted))
    } else if exceeds(found.fastest.into(), STILL.into()) {
        Some(format!("still moves by {:.2} mm/ms", found.fastest))
    } else {
        None
    }
}

/// A plate 2 mm into a cube.
fn contact(of: &Solver, stiffness: f64) -> Trial {
    let body = brain();
    let loads = pressed(stiffness as f32, 2.0);
    let (found, trace, furthest) = run(of, &body, &loads, 1.0, |solver| offset(solver, &body));
    let far = exceeds(furthest, 10.0).then(|| format!("a node is {furthest:.0} mm from rest"));
    Trial { fault: broken(&found).or(far), trace }
}

/// A plate that comes down on a cube at a speed, mm/ms, and is gone half a second later.
fn released(of: &Solver, depth_mm: f32, speed: f32) -> Trial {
    let body = brain();
    let dt_ms = of.build(&body).stable_dt_ms().min(LONGEST_MS);
    let mut watch = Watch::every(dt_ms, 3 * steps(of, dt_ms));
    let outcome = let_go_seen(of, depth_mm, speed, &mut |solver| watch.see(|| offset(solver, &body)));
    let fault = match outcome {
        Outcome::Fails(reason) => Some(reason),
        _ => None,
    };
    Trial { fault, trace: watch.trace }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// At small strains a hanging bar stretches by ρ g L² / 2E, whatever Poisson's ratio.
    #[test]
    fn a_bar_under_little_weight_stretches_as_the_textbook_says() {
        let gravity = 0.01 * f64::from(units::GRAVITY_MM_PER_MS2);
        let expected = 1e-3 * gravity * LENGTH_MM.powi(2) / (2.0 * 0.003);
        for poisson in [0.3, 0.45, 0.49] {
            let material = Material::NeoHookean { young_mpa: 0.003, poisson, density_g_mm3: units::WATER_G_PER_MM3 };
            let found = tip_mm(material, gravity);
            assert!((found / expected - 1.0).abs() < 0.01, "ν {poisson}: {found} mm, not {expected}");
        }
    }

    #[test]
    fn a_layer_is_squeezed_without_moving_the_rest_of_the_bar() {
        let cell = LENGTH_MM as f32 / CELLS[0] as f32;
        assert_eq!([0.0, 4.0 * cell, 6.0 * cell].map(|x| layered(x, 0.1)), [0.0, 4.0 * cell, 6.0 * cell]);
        assert!((layered(5.0 * cell, 0.1) - 4.1 * cell).abs() < 1e-4);
    }
}
