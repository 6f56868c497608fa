//! Runs every method under every condition and returns a stability map and one row per method.

use std::panic::{AssertUnwindSafe, catch_unwind};
use trepan_evidence::picture::{Map, Outcome};
use trepan_evidence::suite::{Findings, Row};

/// Runs every method under every condition. A panic fails only its cell, not the run.
pub fn judge<M>(
    title: &str,
    conditions: &[&str],
    methods: &[(&str, M)],
    mut verdict: impl FnMut(usize, &M) -> Outcome,
    findings: &mut Findings,
) {
    let mut caught = |condition: usize, method: &M| {
        let judged = catch_unwind(AssertUnwindSafe(|| verdict(condition, method)));
        judged.unwrap_or_else(|_| Outcome::Fails("panics".into()))
    };
    let of_condition = |at: usize| methods.iter().map(|(_, method)| caught(at, method)).collect();
    let cells: Vec<Vec<Outcome>> = (0..conditions.len()).map(of_condition).collect();
    let map = Map {
        title: title.into(),
        x: "method".into(),
        y: "condition".into(),
        columns: methods.iter().map(|(name, _)| name.to_string()).collect(),
        rows: conditions.iter().map(|name| name.to_string()).collect(),
        cells,
        ..Map::default()
    };
    findings.rows.extend(rows(&map));
    findings.maps.push(map);
}

/// One row per map column with the number of cells of each grade.
pub fn rows(map: &Map) -> Vec<Row> {
    let row = |(column, name): (usize, &String)| {
        let graded = |grade: u8| map.cells.iter().filter(|row| row[column].grade() == grade).count() as f64;
        Row::new(&map.title, name)
            .metric("works_count", graded(0))
            .metric("degrades_count", graded(1))
            .metric("fails_count", graded(2))
            .metric("refused_count", graded(3))
    };
    map.columns.iter().enumerate().map(row).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_fails_only_its_cell() {
        let mut findings = Findings::default();
        let verdict = |at: usize, limit: &usize| {
            assert!(at < *limit, "on purpose");
            Outcome::Works
        };
        judge("made up", &["one", "two"], &[("a", 2), ("b", 1)], verdict, &mut findings);
        assert_eq!(findings.maps[0].cell("two", "b"), Some(&Outcome::Fails("panics".into())));
        let count = |method: usize, name: &str| findings.rows[method].metrics[name];
        assert_eq!([count(0, "works_count"), count(1, "works_count"), count(1, "fails_count")], [2.0, 1.0, 1.0]);
    }
}
