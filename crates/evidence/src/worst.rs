//! Table of the worst scenes of a run, each with the command that runs it again.

use crate::part::Scope;
use crate::picture::Table;
use crate::suite::{Row, shown};

/// Share of the scenes that is named.
const SHARE: f64 = 0.01;

/// A quantity by which scenes are ranked.
pub struct Rank<'a> {
    /// Metric of the rows.
    pub metric: &'a str,
    /// Whether small values are bad.
    pub low_is_bad: bool,
}

/// Names the worst 1 % of the rows, at least one, by each quantity. `suite`: name on the command
/// line.
pub fn table(suite: &str, scope: Scope, rows: &[&Row], ranks: &[Rank]) -> Table {
    let seed = if scope.seed == 1 { String::new() } else { format!(" --seed {}", scope.seed) };
    let quick = if scope.quick { " --quick" } else { "" };
    let mut lines = Vec::new();
    for rank in ranks {
        let value = |row: &Row| row.metrics.get(rank.metric).copied().filter(|value| value.is_finite());
        let badness = |row: &Row| value(row).map(|value| if rank.low_is_bad { -value } else { value });
        let mut known: Vec<(&Row, f64)> = rows.iter().filter_map(|row| Some((*row, badness(row)?))).collect();
        known.sort_by(|a, b| b.1.total_cmp(&a.1));
        let count = (SHARE * known.len() as f64).ceil() as usize;
        lines.extend(known.iter().take(count).map(|(row, _)| {
            let again = format!("cargo xtask validate {suite}/{}{quick}{seed}", row.part);
            let measured = value(row).map_or("none".into(), shown);
            vec![rank.metric.replace('_', " "), measured, row.scene.clone(), row.method.clone(), again]
        }));
    }
    Table {
        title: "Worst 1 % of the scenes".into(),
        columns: ["by", "value", "scene", "method", "again by"].map(String::from).into(),
        rows: lines,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_worst_rows_are_named_with_their_command() {
        let row = |n: u32| Row {
            part: format!("part-{n}"),
            ..Row::new(format!("scene {n}"), "auto").metric("error_mm", n.into()).metric("dice", 1.0 / f64::from(n))
        };
        let rows: Vec<Row> =
            (1..=150).map(row).chain([Row::new("none", "auto").metric("error_mm", f64::NAN)]).collect();
        let of = |metric, low_is_bad| Rank { metric, low_is_bad };
        let rows: Vec<&Row> = rows.iter().collect();
        let scope = Scope { quick: false, seed: 31 };
        let found = table("made-up", scope, &rows, &[of("error_mm", false), of("dice", true)]);
        let scenes: Vec<&str> = found.rows.iter().map(|line| line[2].as_str()).collect();
        assert_eq!(scenes, ["scene 150", "scene 149", "scene 150", "scene 149"]);
        assert_eq!(found.rows[0][4], "cargo xtask validate made-up/part-150 --seed 31");
    }
}
