//! The table of all figures and tables, their count, and the count of verdicts.

use super::comparison::{Comparison, Ratio, Verdict, cell};
use super::items::{ITEMS, Item};
use crate::suites::Scope;
use trepan_evidence::picture::Table;
use trepan_evidence::suite::{Findings, Gate, Row};

/// Least share of the numbered figures and tables with a counterpart, %: this project's goal.
const LEAST_PERCENT: f64 = 90.0;
/// Metric of a row that points into the sources: 1 where the item is there.
pub const FOUND: &str = "found_flag";

/// A figure or table with what the run made of it.
struct Counterpart<'a> {
    item: &'static Item,
    comparisons: Vec<Comparison>,
    /// Rows that point into the sources.
    pointers: Vec<&'a Row>,
    lines: usize,
    pictures: usize,
}

/// Adds the table, the conclusions and the limit.
pub fn judge(_: Scope, findings: &mut Findings) {
    let all: Vec<Counterpart> = ITEMS.iter().map(|item| Counterpart::of(item, findings)).collect();
    let there = || all.iter().filter(|of| of.is_there());
    let missing: Vec<&str> = all.iter().filter(|of| !of.is_there()).map(|of| of.item.number).collect();
    let percent = 100.0 * there().count() as f64 / ITEMS.len() as f64;
    let with = |what: &dyn Fn(&Counterpart) -> bool| there().filter(|of| what(of)).count();
    let mut conclusions = vec![format!(
        "{} of {} numbered figures and tables of chapters 3 to 6 have a counterpart ({percent:.0} %): {} with numbers, \
         {} with lines, {} with pictures, {} with items of the sources.{}",
        there().count(),
        ITEMS.len(),
        with(&|of| of.comparisons.iter().any(|c| c.judged().is_finite())),
        with(&|of| of.lines > 0),
        with(&|of| of.pictures > 0),
        with(&|of| !of.pointers.is_empty()),
        if missing.is_empty() { String::new() } else { format!(" Missing: {}.", missing.join(", ")) },
    )];
    let counts = Verdict::ALL
        .map(|verdict| format!("{} {}", verdict.name(), there().filter(|of| of.verdict() == verdict).count()));
    conclusions.push(format!("By the worst verdict of each: {}.", counts.join(", ")));
    conclusions.extend(
        there()
            .filter_map(Counterpart::worst)
            .map(|(c, ratio)| format!("Worse: {}, {}: {}.", c.item, c.quantity, ratio.text)),
    );
    let rows = all.iter().flat_map(Counterpart::lines_of_table).collect();
    let gate = Gate::at_least("numbered figures and tables with a counterpart, percent", percent, LEAST_PERCENT);
    findings.tables.insert(0, table(rows));
    let place = |title: &str| ITEMS.iter().position(|item| is_of(title, item));
    findings.series.sort_by_key(|series| place(&series.title));
    findings.pictures.sort_by_key(|picture| place(&picture.title));
    findings.conclusions.extend(conclusions);
    findings.gates.push(gate);
}

fn table(rows: Vec<Vec<String>>) -> Table {
    let columns = [
        "number",
        "shows",
        "quantity",
        "printed",
        "thesis's method here, as printed",
        "put right",
        "ours",
        "verdict",
        "why",
    ];
    Table { title: "The thesis, page by page".into(), columns: columns.map(String::from).into(), rows }
}

/// Whether a title is of a figure or table: `Figure 3.1` is not of `Figure 3.11`.
fn is_of(title: &str, item: &Item) -> bool {
    title.strip_prefix(item.number).is_some_and(|rest| !rest.starts_with(|c: char| c.is_ascii_digit()))
}

impl<'a> Counterpart<'a> {
    fn of(item: &'static Item, findings: &'a Findings) -> Self {
        let rows = || findings.rows.iter().filter(|row| row.scene == item.number);
        let of_item = |title: &&str| is_of(title, item);
        Self {
            item,
            comparisons: rows().filter_map(Comparison::of).collect(),
            pointers: rows().filter(|row| row.metrics.contains_key(FOUND)).collect(),
            lines: findings.series.iter().filter(|series| is_of(&series.title, item) && series.is_drawn()).count(),
            pictures: findings.pictures.iter().map(|picture| picture.title.as_str()).filter(of_item).count(),
        }
    }

    /// Whether the run made anything of it. A pointer that leads nowhere spoils it.
    fn is_there(&self) -> bool {
        let found = self.pointers.iter().all(|row| row.metrics[FOUND] == 1.0);
        let measured = self.comparisons.iter().any(|comparison| comparison.judged().is_finite());
        found && (measured || !self.pointers.is_empty() || self.lines > 0 || self.pictures > 0)
    }

    /// The worst verdict of its numbers; without numbers: same, if every box of a chart has its
    /// item in the sources.
    fn verdict(&self) -> Verdict {
        let worst = self.comparisons.iter().map(Comparison::verdict).max();
        let pointed = if self.pointers.is_empty() { Verdict::CannotCompare } else { Verdict::Same };
        worst.unwrap_or(pointed)
    }

    /// The number with the worst ratio among those that are worse.
    fn worst(&self) -> Option<(&Comparison, Ratio)> {
        let worse = self.comparisons.iter().filter(|c| c.verdict() == Verdict::Worse);
        worse.map(|c| (c, c.ratio())).max_by(|a, b| a.1.value.total_cmp(&b.1.value))
    }

    fn lines_of_table(&self) -> Vec<Vec<String>> {
        let mut lines: Vec<Vec<String>> = Vec::new();
        let mut add = |cells: [String; 7]| {
            let first = lines.is_empty();
            let head = if first { [self.item.number, self.item.shows] } else { ["", ""] };
            lines.push(head.map(String::from).into_iter().chain(cells).collect());
        };
        for c in &self.comparisons {
            let unit = if c.unit.is_empty() { String::new() } else { format!(", {}", c.unit) };
            let [printed, as_printed, corrected, ours] = [c.printed, c.as_printed, c.corrected, c.ours].map(cell);
            let (verdict, quantity) = (c.verdict().name().to_string(), format!("{}{unit}", c.quantity));
            add([quantity, printed, as_printed, corrected, ours, verdict, c.reason()]);
        }
        let dash = || String::from("–");
        if !self.pointers.is_empty() {
            let text = |row: &Row, name: &str| row.config.get(name).and_then(|v| v.as_str()).unwrap_or("").to_string();
            let place = |row: &&Row| format!("{}: {} in {}", row.method, text(row, "item"), text(row, "file"));
            let found = self.pointers.iter().filter(|row| row.metrics[FOUND] == 1.0).count();
            let places = self.pointers.iter().map(place).collect::<Vec<_>>().join("; ");
            let (all, verdict) = (self.pointers.len(), if found == self.pointers.len() { "same" } else { "worse" });
            let ours = format!("{found} of {all} in the sources");
            add(["boxes of the drawing".into(), all.to_string(), dash(), dash(), ours, verdict.into(), places]);
        }
        if self.comparisons.is_empty() && self.lines + self.pictures > 0 {
            let made = format!("{} charts, {} pictures below", self.lines, self.pictures);
            let why = "a picture has no number".to_string();
            add(["what is seen".into(), dash(), dash(), dash(), made, Verdict::CannotCompare.name().into(), why]);
        }
        if lines.is_empty() {
            let none = [self.item.number, self.item.shows, "no counterpart", "–", "–", "–", "–", "–", ""];
            lines.push(none.map(String::from).into());
        }
        lines
    }
}

#[cfg(test)]
mod tests {
    use super::super::comparison::Rule;
    use super::*;
    use trepan_evidence::picture::{Series, Snapshot};

    #[test]
    fn only_what_a_run_made_is_a_counterpart() {
        let empty = Comparison::new("Figure 3.1", "q", "").printed(Rule::Less, 1.0).row();
        let pointer =
            |found: f64| Row::new("Figure 3.2", "box").with("file", "f").with("item", "i").metric(FOUND, found);
        let mut findings = Findings {
            rows: vec![
                empty,
                pointer(1.0),
                pointer(0.0),
                Comparison::new("Table 3.1", "q", "mm").printed(Rule::Equal(0.01), 2.0).ours(2.0).row(),
            ],
            series: vec![
                Series::over_frames("Figure 3.11 (a): t", "µs", [("a".to_string(), &[1.0, 2.0][..])]),
                Series::over_frames("Figure 3.12: t", "µs", [("a".to_string(), &[1.0][..])]),
            ],
            pictures: vec![Snapshot { title: "Figure 6.5: brain".into(), png: "AA".into() }],
            ..Findings::default()
        };
        let there = |number: &str| {
            let item = ITEMS.iter().find(|item| item.number == number).unwrap();
            Counterpart::of(item, &findings).is_there()
        };
        let expected = [
            ("Figure 3.1", false),
            ("Figure 3.2", false),
            ("Table 3.1", true),
            ("Figure 3.11", true),
            ("Figure 3.12", false),
            ("Figure 6.5", true),
        ];
        expected.into_iter().for_each(|(number, is)| assert_eq!(there(number), is, "{number}"));
        judge(Scope { quick: true, seed: 1 }, &mut findings);
        assert!(!findings.gates[0].pass && (findings.gates[0].value - 300.0 / 74.0).abs() < 1e-9);
        assert!(findings.conclusions[0].starts_with("3 of 74"), "{}", findings.conclusions[0]);
        assert!(findings.tables[0].rows.len() >= ITEMS.len());
        assert!(findings.tables[0].rows.iter().all(|row| row.len() == findings.tables[0].columns.len()));
    }
}
