//! Which physical constants change what a trainee meets, for drilling, pressing and brain shift.
//!
//! # Theory
//! Each constant ranges over its row of the register: between value over factor and value times
//! factor ([`Row::factor`](trepan_measurements::Row::factor)), uniform in its logarithm. Effects
//! and shares are those on the logarithm of the output. All constants are screened by elementary
//! effects (`morris`); the variance is shared out among those that rank first (`sobol`), the
//! others stay at the program's values.
//!
//! # Practice
//! A scene runs the program's own code on a small model. Its outputs rank constants; the outputs
//! themselves are judged elsewhere.

mod drill;
mod judgement;
mod morris;
mod press;
mod scene;
mod shift;
mod sobol;

pub use judgement::judge;

use scene::{OUTPUTS, Scene};
use trepan_evidence::part::{Part, Scope};
use trepan_evidence::suite::{Findings, Row};

/// Constants whose variance is shared out.
const RANKED: usize = 4;

/// Lists the parts: each scene, and the estimator on functions with known shares.
pub fn parts(_: Scope) -> Vec<Part> {
    let of = |make: fn() -> Scene| Part::new(make().name, move |scope, findings| rank(&make(), scope, findings));
    let mut parts: Vec<Part> = [drill::scene, press::scene, shift::scene].map(of).into();
    parts.push(Part::new("closed forms", |scope, findings| {
        let error = sobol::error_on_closed_forms(4096, scope.seed);
        findings.rows.push(Row::new("closed forms", "sobol").metric("index_error", error));
    }));
    parts
}

/// Screens a scene's constants, shares out the variance among the first, and adds a row for each
/// constant and output.
fn rank(scene: &Scene, scope: Scope, findings: &mut Findings) {
    let (trajectories, rows) = scope.pick((3, 8), (16, 256));
    let logarithm = |outputs: [f64; OUTPUTS]| outputs.map(|output| output.max(f64::MIN_POSITIVE).ln());
    let all = scene.inputs.len();
    let effects = morris::effects(all, trajectories, &mut scope.random(1), |places| logarithm(scene.at(places)));
    let strength = |input: usize| effects.iter().map(|of| of[input].mean).fold(0.0, f64::max);
    let mut order: Vec<usize> = (0..all).collect();
    order.sort_by(|a, b| strength(*b).total_cmp(&strength(*a)));
    order.truncate(RANKED);
    let shares = sobol::shares(order.len(), rows, scope.seed, |places| {
        let mut at = vec![0.5; all];
        order.iter().zip(places).for_each(|(input, place)| at[*input] = *place);
        logarithm(scene.at(&at))
    });
    let nominal = scene.nominal();
    for (out, output) in scene.outputs.iter().enumerate() {
        for (number, input) in scene.inputs.iter().enumerate() {
            let (effect, of) = (effects[out][number], &shares[out]);
            let share = order.iter().position(|ranked| *ranked == number).map(|at| of.indices[at]);
            let or_none = |get: fn(sobol::Indices) -> f64| share.map_or(f64::NAN, get);
            findings.rows.push(
                Row::new(format!("{}: {output}", scene.name), input.name)
                    .with("row", input.row.name())
                    .with("calibrated", input.row.is_calibrated())
                    .metric("factor", input.row.factor())
                    .metric("effect_percent", 100.0 * effect.mean)
                    .metric("effect_deviation_percent", 100.0 * effect.deviation)
                    .metric("first_percent", 100.0 * or_none(|share| share.first))
                    .metric("total_percent", 100.0 * or_none(|share| share.total))
                    .metric("total_error_percent", 100.0 * or_none(|share| share.error))
                    .metric("output", nominal[out])
                    .metric("output_p16", of.quantile(0.16).exp())
                    .metric("output_p84", of.quantile(0.84).exp()),
            );
        }
    }
}
