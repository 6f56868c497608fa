//! Which way of touching bone is worth its cost: the quick rigid suite, as a table with the front marked.
//!
//! `cargo run --release -p trepan-trials --example front`

use trepan_trials::front::front;
use trepan_trials::suites::{ALL, Scope};

fn main() {
    let Some(suite) = ALL.iter().find(|suite| suite.name == "rigid") else { return };
    let findings = (suite.run)(Scope { quick: true, shard: (0, 1) });
    let (cost, error) = suite.chart;
    for scene in ["half-space", "sphere"] {
        let rows: Vec<_> = findings.rows.iter().filter(|row| row.scene == scene).collect();
        let points: Vec<(f64, f64)> = rows.iter().map(|row| (row.metrics[cost], row.metrics[error])).collect();
        let best = front(&points);
        println!("{scene}");
        for (at, row) in rows.iter().enumerate() {
            let mark = if best.contains(&at) { "*" } else { " " };
            println!("  {mark} {:16} {cost} {:8.2}   {error} {:.4}", row.method, points[at].0, points[at].1);
        }
    }
}
