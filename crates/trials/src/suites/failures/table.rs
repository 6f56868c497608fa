//! Tables and maps of nearest failures, and the gates on them.

use super::{Listed, Standing, amount, text, title};
use serde_json::Value;
use trepan_evidence::picture::{Map, Outcome, Table};
use trepan_evidence::suite::{Findings, Gate, Row};

const COLUMNS: [&str; 8] = ["family", "method", "whose", "condition", "nominal", "fails at", "factor", "how it fails"];

/// Octaves beyond which a failure counts as far.
const FAR: f64 = 3.0;

/// A row of a table: one method under one condition.
#[derive(Clone, Copy)]
pub struct Line<'a> {
    row: &'a Row,
    /// Number of conditions of which this is the nearest.
    of: usize,
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

    /// Cell of a map.
    fn outcome(&self) -> Outcome {
        let how = format!("{}: {}", self.fails_at(), text(self.row, "fault"));
        match self.octaves() {
            0.0 => Outcome::Fails(format!("as it stands: {}", text(self.row, "fault"))),
            near if near < FAR => Outcome::Degrades(how),
            _ => Outcome::Works,
        }
    }

    fn cells(&self) -> Vec<String> {
        let nominal = self.row.config.get("nominal").and_then(Value::as_f64).unwrap_or(f64::NAN);
        let none_of_many = self.of > 1 && self.octaves().is_infinite();
        let factor = match self.row.metrics.get("failure_factor") {
            Some(1.0) => "1, as it stands".into(),
            factor => factor.map_or_else(String::new, |factor| amount(*factor, "1")),
        };
        vec![
            text(self.row, "family").into(),
            self.row.method.clone(),
            self.standing().word().into(),
            if none_of_many { format!("any of {}", self.of) } else { text(self.row, "condition").into() },
            if none_of_many { String::new() } else { amount(nominal, text(self.row, "unit")) },
            if none_of_many { "none within the limits".into() } else { self.fails_at() },
            factor,
            text(self.row, "fault").into(),
        ]
    }
}

/// The line of the smallest change among a method's rows; `None` without rows.
pub fn nearest<'a>(rows: &[&'a Row]) -> Option<Line<'a>> {
    let lines = rows.iter().map(|row| Line { row, of: rows.len() });
    lines.min_by(|a, b| a.octaves().total_cmp(&b.octaves()))
}

/// Map of a family: how far each failure is, method by method.
fn map(family: &Listed, rows: &[Row]) -> Map {
    let own: Vec<&Row> = rows.iter().filter(|row| text(row, "family") == family.suite).collect();
    let mut conditions: Vec<&str> = Vec::new();
    for condition in own.iter().map(|row| text(row, "condition")) {
        if !conditions.contains(&condition) {
            conditions.push(condition);
        }
    }
    let cell = |condition: &str, method: &String| {
        let row = own.iter().find(|row| row.method == *method && text(row, "condition") == condition);
        row.map_or_else(|| Outcome::Refused("not tried".into()), |row| Line { row, of: 1 }.outcome())
    };
    let cells = conditions.iter().map(|condition| family.methods.iter().map(|of| cell(condition, of)).collect());
    Map {
        title: format!("{}: how far the nearest failure is", family.suite),
        x: "method".into(),
        y: "condition".into(),
        columns: family.methods.clone(),
        cells: cells.collect(),
        rows: conditions.iter().map(ToString::to_string).collect(),
        notes: vec!["Works: no failure up to 8 times the change. Degrades: within it. Fails: as it stands.".into()],
        ..Map::default()
    }
}

/// Adds tables, maps, criteria and gates. The tables: the nearest failure of every method, and
/// every condition of our own.
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
        let stands = fails.iter().filter(|row| Line { row, of: 1 }.octaves() == 0.0).count();
        let name = format!("{}: {}: conditions that it fails as it stands", text(own.row, "family"), own.row.method);
        findings.gates.push(Gate::at_most(name, stands as f64, 0.0));
    }
    // Traces of our own methods first; the sort is stable.
    let owned: Vec<String> = lines
        .iter()
        .filter(|line| line.standing() == Standing::Own)
        .map(|line| title(text(line.row, "family"), &line.row.method))
        .collect();
    findings.series.sort_by_key(|trace| !owned.iter().any(|own| trace.title.starts_with(own)));
    let mut own: Vec<Line> = rows.iter().map(|row| Line { row, of: 1 }).collect();
    own.retain(|line| line.standing() == Standing::Own && !text(line.row, "family").is_empty());
    own.sort_by(|a, b| a.octaves().total_cmp(&b.octaves()));
    let table = |title: &str, lines: &[Line]| Table {
        title: title.into(),
        columns: COLUMNS.map(String::from).to_vec(),
        rows: lines.iter().map(Line::cells).collect(),
    };
    findings.tables.push(table("Nearest failures", &lines));
    findings.tables.push(table("Every condition of our own methods", &own));
    findings.maps.extend(families.iter().map(|family| map(family, &rows)));
    let criteria = families.iter().map(|family| format!("{}: {}", family.suite, family.criterion));
    findings.conclusions.extend(criteria.chain(untried));
}

#[cfg(test)]
mod tests {
    use super::*;
    use trepan_evidence::picture::Series;

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
        let trace = |title: &str| Series { title: title.into(), ..Series::default() };
        findings.series = ["rigid: rival, size: bends", "rigid: ours, edge: breaks"].map(trace).to_vec();
        judge(&[Listed { suite: "rigid", criterion: "it breaks", methods }], &mut findings);
        let table = &findings.tables[0].rows;
        assert_eq!((table.len(), table[0][1].as_str(), table[0][3].as_str()), (2, "ours", "edge"));
        assert_eq!((table[0][5].as_str(), table[0][6].as_str()), ("0.5 mm", "0.25"));
        assert_eq!(table[1][6], "1, as it stands");
        let gate = |at: usize| (findings.gates[at].value, findings.gates[at].pass);
        assert_eq!((gate(0), gate(1)), ((1.0, false), (0.0, true)));
        let cell = |row: &str, column: &str| findings.maps[0].cell(row, column).unwrap().grade();
        assert_eq!(
            [cell("edge", "ours"), cell("size", "ours"), cell("size", "rival"), cell("size", "new")],
            [1, 0, 2, 3]
        );
        assert_eq!(findings.series[0].title, "rigid: ours, edge: breaks");
        assert_eq!(findings.tables[1].rows[2][5], "none from 1 to 9 mm");
        assert_eq!(findings.conclusions[1], "rigid: new has no nearest failure");
    }
}
