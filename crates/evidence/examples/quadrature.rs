//! Two ways to integrate a sine, judged: rows of error and cost, an acceptance limit, the front.

use trepan_evidence::front::front;
use trepan_evidence::part::{Part, Scope};
use trepan_evidence::suite::{Gate, Row};

/// Error of the integral from 0 to π, which is 2, by so many intervals and these weights.
fn error(intervals: usize, weight: impl Fn(usize) -> f64) -> f64 {
    let width = std::f64::consts::PI / intervals as f64;
    let sum: f64 = (0..=intervals).map(|n| weight(n) * (n as f64 * width).sin()).sum();
    (sum * width - 2.0).abs()
}

fn main() {
    let part = Part::new("quadrature", |scope: Scope, findings| {
        let most = scope.pick(8, 32);
        for intervals in [2, 4, 8, 16, 32].into_iter().filter(|n| *n <= most) {
            let simpson = |n: usize| if n % 2 == 1 { 4.0 / 3.0 } else { 2.0 / 3.0 };
            for (name, found) in [("trapezoid", error(intervals, |_| 1.0)), ("Simpson", error(intervals, simpson))] {
                let row = Row::new("sine", name).with("intervals", intervals).metric("error", found);
                findings.rows.push(row.metric("evaluations", intervals as f64 + 1.0));
            }
        }
        let best = findings.rows.iter().map(|row| row.metrics["error"]).fold(f64::INFINITY, f64::min);
        findings.gates.push(Gate::at_most("the best error", best, 1e-4));
    });
    let (findings, _) = part.run(Scope { quick: false, seed: 1 });
    let points: Vec<(f64, f64)> =
        findings.rows.iter().map(|row| (row.metrics["evaluations"], row.metrics["error"])).collect();
    for at in front(&points) {
        println!("on the front: {} {:?}", findings.rows[at].method, points[at]);
    }
    findings.gates.iter().for_each(|gate| println!("{}: {:.1e} {} {:.0e}", gate.name, gate.value, gate.op, gate.limit));
}
