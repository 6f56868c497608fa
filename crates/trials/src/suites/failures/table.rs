//! Tables of nearest failures, and the gates on them.

use super::{Listed, Standing, amount, text};
use crate::engine::picture::Table;
use crate::engine::suite::{Findings, Gate, Row};
use serde_json::Value;

const COLUMNS: [&str; 8] = ["family", "method", "whose", "condition", "nominal", "fails at", "factor", "how it fails"];

/// A row of a table: one method under one condition.
#[derive(Clone, Copy)]
pub struct Line<'a> {
    row: &'a Row,
}

impl<'a> Line<'a> {
    /// Size of the change, octaves; infinite where nothing failed.
    fn octaves(&self) -> f64 {
        self.row.metrics.get("failure_factor").map_or(f64::INFINITY, |factor| factor.log2().abs())
    }

    fn standing(&self) -> Standing {
        let word = text(self.row, "standing");
        Standing::ALL.into_iter().find(|standing| standing.word() == word).unwrap_or(Standing::Rival)
    }

    /// Value at which it fails, with its unit; the limits where nothing failed.
    fn fails_at(&self) -> String {
        let at = self.row.metrics.iter().find(|(name, _)| name.starts_with("failure_at_"));
        let unit = text(self.row, "unit");
        at.map_or_else(|| text(self.row, "none").into(), |(_, value)| amount(*value, unit))
    }

    /// Condition, value and factor in a few words.
    pub fn short(self) -> String {
        match self.row.metrics.get("failure_factor") {
            Some(1.0) => "fails as it stands".into(),
            Some(factor) => {
                format!("{} {} (× {})", text(self.row, "condition"), self.fails_at(), amount(*factor, "1"))
            }
            None => "none within the limits".into(),
        }
    }

    fn cells(&self) -> Vec<String> {
        let nominal = self.row.config.get("nominal").and_then(Value::as_f64).unwrap_or(f64::NAN);
        let factor = match self.row.metrics.get("failure_factor") {
            Some(1.0) => "1, as it stands".into(),
            factor => factor.map_or_else(String::new, |factor| amount(*factor, "1")),
        };
        vec![
            text(self.row, "family").into(),
            self.row.method.clone(),
            self.standing().word().into(),
            text(self.row, "condition").into(),
            amount(nominal, text(self.row, "unit")),
            self.fails_at(),
            factor,
            text(self.row, "fault").into(),
        ]
    }
}

/// The line of the smallest change among a method's rows; `None` without rows.
pub fn nearest<'a>(rows: &[&'a Row]) -> Option<Line<'a>> {
    let lines = rows.iter().map(|row| Line { row });
    lines.min_by(|a, b| a.octaves().total_cmp(&b.octaves()))
}

/// Adds a table of the nearest failure of every method, one of all conditions of our own methods,
/// the criteria, and the gates.
pub fn judge(families: &[Listed], findings: &mut Findings) {
    let rows = findings.rows.clone();
    let of = |suite: &str, method: &str| -> Vec<&Row> {
        rows.iter().filter(|row| row.method == method && text(row, "family") == suite).collect()
    };
    let methods = families.iter().flat_map(|family| family.methods.iter().map(|method| (family.suite, method)));
    let all: Vec<(&str, &String, Option<Line>)> =
        methods.map(|(suite, method)| (suite, method, nearest(&of(suite, method)))).collect();
    let untried: Vec<String> = all
        .iter()
        .filter(|(.., line)| line.is_none())
        .map(|(suite, method, _)| format!("{suite}: {method} has no nearest failure"))
        .collect();
    findings.gates.push(Gate::at_most("methods without a nearest failure", untried.len() as f64, 0.0));
    let mut lines: Vec<Line> = all.iter().filter_map(|(.., line)| *line).collect();
    lines.sort_by(|a, b| a.standing().cmp(&b.standing()).then(a.octaves().total_cmp(&b.octaves())));
    for own in lines.iter().filter(|line| line.standing() == Standing::Own) {
        let fails = of(text(own.row, "family"), &own.row.method);
        let stands = fails.iter().filter(|row| Line { row }.octaves() == 0.0).count();
        let name = format!("{}: {}: conditions that it fails as it stands", text(own.row, "family"), own.row.method);
        findings.gates.push(Gate::at_most(name, stands as f64, 0.0));
    }
    let mut own: Vec<Line> = rows.iter().map(|row| Line { row }).collect();
    own.retain(|line| line.standing() == Standing::Own && !text(line.row, "family").is_empty());
    own.sort_by(|a, b| a.octaves().total_cmp(&b.octaves()));
    let table = |title: &str, lines: &[Line]| Table {
        title: title.into(),
        columns: COLUMNS.map(String::from).to_vec(),
        rows: lines.iter().map(Line::cells).collect(),
    };
    findings.tables.push(table("Nearest failures", &lines));
    findings.tables.push(table("Every condition of our own methods", &own));
    let criteria = families.iter().map(|family| format!("{}: {}", family.suite, family.criterion));
    findings.conclusions.extend(criteria.chain(untried));
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(method: &str, standing: &str, condition: &str, factor: Option<f64>) -> Row {
        let row = Row::new(condition, method).with("family", "rigid").with("standing", standing);
        let row = row.with("condition", condition).with("unit", "mm").with("nominal", 2.0);
        match factor {
            Some(factor) => row.metric("failure_factor", factor).metric("failure_at_mm", 2.0 * factor),
            None => row.with("none", "none from 1 to 9 mm"),
        }
    }

    #[test]
    fn the_smallest_change_counts_own_methods_come_first_and_a_missing_method_is_a_hole() {
        let mut findings = Findings {
            rows: vec![
                row("rival", "rival", "size", Some(1.0)),
                row("ours", "own", "size", Some(8.0)),
                row("ours", "own", "edge", Some(0.25)),
                row("ours", "own", "speed", None),
            ],
            ..Findings::default()
        };
        let methods = ["rival", "ours", "new"].map(String::from).to_vec();
        judge(&[Listed { suite: "rigid", criterion: "it breaks", methods }], &mut findings);
        let table = &findings.tables[0].rows;
        assert_eq!((table.len(), table[0][1].as_str(), table[0][3].as_str()), (2, "ours", "edge"));
        assert_eq!((table[0][5].as_str(), table[0][6].as_str()), ("0.5 mm", "0.25"));
        assert_eq!(table[1][6], "1, as it stands");
        let gate = |at: usize| (findings.gates[at].value, findings.gates[at].pass);
        assert_eq!((gate(0), gate(1)), ((1.0, false), (0.0, true)));
        assert_eq!(findings.tables[1].rows[2][5], "none from 1 to 9 mm");
        assert_eq!(findings.conclusions[1], "rigid: new has no nearest failure");
    }
}
