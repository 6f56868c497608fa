//! Prints the quick rigid suite's charts as tables, with the Pareto front marked.
//!
//! `cargo run --release -p trepan-trials --example front`

use trepan_trials::suites::{ALL, Scope};

fn main() {
    let Some(suite) = ALL.iter().find(|suite| suite.name == "rigid") else { return };
    for chart in suite.run(Scope { quick: true, seed: 1 }).charts {
        let best = chart.front();
        println!("{}", chart.title);
        for mark in &chart.marks {
            let star = if best.contains(&(mark.cost, mark.error)) { "*" } else { " " };
            println!(
                "  {star} {:24} {} {:8.2}   {} {:.4}",
                mark.method, chart.cost, mark.cost, chart.error, mark.error
            );
        }
    }
}
