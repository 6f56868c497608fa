//! Selects the fastest solver for a body on this machine by measurement.
//!
//! # Practice
//! Every candidate is stepped at rest through [`SoftSolver`], as in a simulator, for some ms of the
//! caller's clock. The measure is wall time per ms of simulated time, so that longer steps are no
//! disadvantage. The winner is built again, so the measurement does not change its state.

use crate::{Config, Tled};
use trepan_soft::{Body, BodyError, Loads, SoftSolver};

/// A solver to choose from.
pub struct Candidate<'a> {
    /// Name of the solver.
    pub name: &'static str,
    /// Builds the solver at rest, or returns the reason why not.
    pub build: Box<dyn Fn() -> Result<Box<dyn SoftSolver>, ChoiceError> + 'a>,
}

/// Why a candidate, or any at all, was not built.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ChoiceError {
    /// The body or the settings make no sense.
    #[error(transparent)]
    Body(#[from] BodyError),
    /// The body does not run on the graphics device.
    #[cfg(feature = "gpu")]
    #[error(transparent)]
    Gpu(#[from] crate::gpu::GpuTledError),
    /// The program has no solver on the graphics device.
    #[error("this program was built without the feature `gpu`")]
    NoGpuFeature,
    /// Every candidate failed, each for the reason given.
    #[error("{0}")]
    NoneBuilt(String),
}

/// The chosen solver.
pub struct Chosen {
    /// The solver, at rest.
    pub solver: Box<dyn SoftSolver>,
    /// Name of the solver.
    pub name: &'static str,
    /// Cost of each candidate, or why it was not built, as text.
    pub why: String,
}

/// TLED on the CPU, and on a graphics card where this crate has the feature `gpu`.
pub fn candidates<'a>(body: &'a Body, config: &'a Config) -> Vec<Candidate<'a>> {
    let processor = || Ok(Box::new(Tled::new(body, config)?) as Box<dyn SoftSolver>);
    #[cfg(feature = "gpu")]
    let device = || Ok(Box::new(crate::gpu::WithSpare::on_a_card(body, config)?) as Box<dyn SoftSolver>);
    #[cfg(not(feature = "gpu"))]
    let device = || Err(ChoiceError::NoGpuFeature);
    vec![
        Candidate { name: "tled", build: Box::new(processor) },
        Candidate { name: "tled-gpu", build: Box::new(device) },
    ]
}

/// Steps each candidate under `loads` for `each_ms` of the clock `now_ms` and returns the cheapest.
/// The error gives the reasons if none could be built.
pub fn fastest(
    candidates: &[Candidate<'_>],
    loads: &Loads,
    each_ms: f64,
    now_ms: &dyn Fn() -> f64,
) -> Result<Chosen, ChoiceError> {
    let (mut words, mut best) = (Vec::new(), None::<(f64, &Candidate<'_>)>);
    for candidate in candidates {
        match (candidate.build)() {
            Ok(mut solver) => {
                let cost = cost_per_ms(&mut *solver, loads, each_ms, now_ms);
                words.push(format!("{}: {cost:.3} ms for a ms of tissue", candidate.name));
                if best.is_none_or(|(least, _)| cost < least) {
                    best = Some((cost, candidate));
                }
            }
            Err(fault) => words.push(format!("{}: {fault}", candidate.name)),
        }
    }
    let why = words.join("; ");
    let (_, winner) = best.ok_or_else(|| ChoiceError::NoneBuilt(why.clone()))?;
    Ok(Chosen { solver: (winner.build)()?, name: winner.name, why })
}

fn cost_per_ms(solver: &mut dyn SoftSolver, loads: &Loads, each_ms: f64, now_ms: &dyn Fn() -> f64) -> f64 {
    // A solver without a stability limit takes the simulators' step.
    let mut step = || {
        let dt_ms = solver.next_dt_ms().min(1.0);
        solver.step(loads, dt_ms);
        f64::from(dt_ms)
    };
    step();
    let (start, mut steps, mut tissue_ms) = (now_ms(), 0u32, 0.0);
    while steps == 0 || (now_ms() - start < each_ms && steps < 1_000_000) {
        tissue_ms += step();
        steps += 1;
    }
    (now_ms() - start) / tissue_ms
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Arc;
    use std::sync::atomic::{AtomicU64, Ordering};
    use trepan_geometry::Vec3;
    use trepan_soft::{Material, NodeState, StepReport, boxes};

    /// Solver that only advances the clock.
    struct Costly(Arc<AtomicU64>, u64, f32, NodeState);

    impl SoftSolver for Costly {
        fn step(&mut self, _: &Loads, _: f32) -> StepReport {
            self.0.fetch_add(self.1, Ordering::Relaxed);
            StepReport::default()
        }
        fn state(&self) -> &NodeState {
            &self.3
        }
        fn stable_dt_ms(&self) -> f32 {
            self.2
        }
    }

    #[test]
    fn the_cheapest_for_a_ms_of_tissue_wins_whatever_it_is_called() {
        let clock = Arc::new(AtomicU64::new(0));
        let make = |name, cost, dt| {
            let clock = Arc::clone(&clock);
            let costly = move || Costly(Arc::clone(&clock), cost, dt, NodeState::default());
            let build = move || Ok(Box::new(costly()) as Box<dyn SoftSolver>);
            Candidate { name, build: Box::new(build) }
        };
        let absent = Candidate { name: "absent", build: Box::new(|| Err(ChoiceError::NoneBuilt("no adapter".into()))) };
        let all = [make("short steps", 2, 0.1), make("long steps", 10, 0.8), absent];
        let now_ms = || clock.load(Ordering::Relaxed) as f64;
        let chosen = fastest(&all, &Loads::default(), 200.0, &now_ms).ok().map(|c| (c.name, c.why));
        let why =
            "short steps: 20.000 ms for a ms of tissue; long steps: 12.500 ms for a ms of tissue; absent: no adapter";
        assert_eq!(chosen, Some(("long steps", why.to_string())));
        assert_eq!(
            fastest(&all[2..], &Loads::default(), 1.0, &now_ms).err().unwrap().to_string(),
            "absent: no adapter"
        );
    }

    #[test]
    fn a_body_gets_a_solver_at_rest_and_the_device_is_mentioned() {
        let mesh = boxes::split_box([3, 3, 3], Vec3::splat(30.0));
        let fixed = boxes::nodes_where(&mesh, |p| p.z < 1e-3);
        let body = Body::uniform(mesh, fixed, Material::BRAIN);
        let (ticks, config) = (AtomicU64::new(0), Config::default());
        let now_ms = || ticks.fetch_add(1, Ordering::Relaxed) as f64;
        let chosen = fastest(&candidates(&body, &config), &Loads::default(), 10.0, &now_ms).unwrap();
        assert!(chosen.why.contains("tled: ") && chosen.why.contains("tled-gpu: "), "{}", chosen.why);
        assert_eq!(chosen.solver.positions(), &body.mesh.positions[..]);
    }
}
