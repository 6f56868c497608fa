//! Repeated parts: medians of times with 95 % intervals, and limits judged on medians.
//!
//! # Theory
//! Each repeat runs the part anew. A time of a row is the median over the repeats, with the 2.5 %
//! and 97.5 % quantiles of that median under the bootstrap (Efron 1979). A limit is judged on the
//! median of its measured values. All else is the same in every repeat and is taken from the first.

use crate::compare::is_timed;
use crate::suite::{Findings, Gate, Side};
use trepan_geometry::quantile;

/// Number of bootstrap draws.
const DRAWS: usize = 1000;

/// Median with its 95 % interval.
struct Interval {
    low: f64,
    median: f64,
    high: f64,
}

impl Interval {
    fn of(values: &[f64]) -> Self {
        let median = |mut all: Vec<f64>| quantile(&mut all, 0.5);
        let mut random = fastrand::Rng::with_seed(1);
        let mut draw = |_| median((0..values.len()).map(|_| values[random.usize(..values.len())]).collect());
        let mut drawn: Vec<f64> = (0..DRAWS).map(&mut draw).collect();
        let [low, high] = [0.025, 0.975].map(|share| quantile(&mut drawn, share));
        Self { low, median: median(values.to_vec()), high }
    }
}

/// Combines the findings of some runs of one part.
pub fn combine(mut all: Vec<Findings>) -> Findings {
    let mut first = all.remove(0);
    if all.is_empty() {
        return first;
    }
    for (at, row) in first.rows.iter_mut().enumerate() {
        let same = |other: &&Findings| {
            other.rows.get(at).is_some_and(|other| other.scene == row.scene && other.method == row.method)
        };
        let others: Vec<&Findings> = all.iter().filter(same).collect();
        let timed: Vec<String> = row.metrics.keys().filter(|name| is_timed(name)).cloned().collect();
        for name in timed {
            let values: Vec<f64> = std::iter::once(row.metrics[&name])
                .chain(others.iter().filter_map(|other| other.rows[at].metrics.get(&name).copied()))
                .filter(|value| value.is_finite())
                .collect();
            if values.len() > 1 {
                let Interval { low, median, high } = Interval::of(&values);
                row.metrics.extend([(format!("low_{name}"), low), (format!("high_{name}"), high)]);
                row.metrics.insert(name, median);
            }
        }
        row.config.insert("repeats".into(), (1 + others.len()).into());
    }
    for gate in &mut first.gates {
        let others = all.iter().flat_map(|other| &other.gates).filter(|other| other.name == gate.name);
        let values: Vec<f64> = std::iter::once(gate.value)
            .chain(others.filter(|other| other.op == gate.op).map(|other| other.value))
            .collect();
        let value = if values.iter().any(|value| value.is_nan()) { f64::NAN } else { Interval::of(&values).median };
        *gate = match gate.op {
            Side::AtMost => Gate::at_most(gate.name.clone(), value, gate.limit),
            Side::AtLeast => Gate::at_least(gate.name.clone(), value, gate.limit),
        };
    }
    first
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::suite::Row;

    #[test]
    fn times_become_medians_with_intervals_and_limits_are_judged_on_medians() {
        let run = |us: f64| Findings {
            rows: vec![Row::new("s", "m").metric("step_p50_us", us).metric("depth_error_mm", 0.25)],
            gates: vec![Gate::at_most("ratio", us, 5.0)],
            ..Findings::default()
        };
        let found = combine([4.0, 9.0, 3.0, 5.0, 4.5].map(run).into());
        let metrics = &found.rows[0].metrics;
        assert_eq!((metrics["step_p50_us"], metrics["depth_error_mm"]), (4.5, 0.25));
        assert!(metrics["low_step_p50_us"] >= 3.0 && metrics["low_step_p50_us"] < 4.5);
        assert!(metrics["high_step_p50_us"] > 4.5 && metrics["high_step_p50_us"] <= 9.0);
        assert!(!metrics.contains_key("low_depth_error_mm"));
        assert!(found.gates[0].pass && found.gates[0].value == 4.5);
        assert_eq!(combine(vec![run(6.0)]), run(6.0));
        assert!(!combine(vec![run(6.0), run(f64::NAN)]).gates[0].pass);
    }
}
