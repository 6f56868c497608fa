//! What the thesis prints of its own rigid handling, as rows beside ours.
//!
//! # Sources
//! Thesis, section 3.6: 466 points, a Phantom Omni at 1 kHz, k = 2 N/mm. Bounds, not quantiles:
//! touching "all below 1 ms" for every cube and skull; drilling over 1 ms for the finest cubes and
//! "on a few occasions" for Skull5; forces change by less than 0.6 N a tick when touching and at
//! most 0.4 N when drilling. The machine is of 2012: compare the ratio to `thesis`, not these.

use super::BUDGET_US;
use trepan_evidence::suite::Row;

/// The name on charts.
const NAME: &str = "thesis, its own figures";

/// A row for each model and task.
pub fn rows() -> Vec<Row> {
    let jump = |task: &str| if task == "touch" { 0.6 } else { 0.4 };
    ["cubes", "skulls"]
        .into_iter()
        .flat_map(|models| ["touch", "drill"].map(|task| (models, task)))
        .map(|(models, task)| {
            Row::new(format!("{models}, {task}, as printed"), NAME)
                .with("group", format!("{models}, {task}"))
                .with("points", 466)
                .with("bounds", true)
                .metric("tick_p50_us", BUDGET_US)
                .metric("tick_p99_us", BUDGET_US)
                .metric("force_change_max_n_per_ms", jump(task))
        })
        .collect()
}
