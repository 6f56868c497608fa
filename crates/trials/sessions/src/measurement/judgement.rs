//! The table "Against measurement", its counts, and the limits on them.

use super::comparison::{Comparison, How};
use trepan_evidence::part::Scope;
use trepan_evidence::picture::Table;
use trepan_evidence::suite::{Findings, Gate, shown};

/// Published values that the page compares, at least: this project's goal.
const LEAST_VALUES: f64 = 40.0;
/// Of them inside, at least: this project's goal.
const LEAST_INSIDE: f64 = 30.0;

/// Adds the table, the conclusions and the limits.
pub fn judge(_: Scope, findings: &mut Findings) {
    let all: Vec<Comparison> = findings.rows.iter().filter_map(Comparison::of_row).collect();
    let count = |is: &dyn Fn(&&Comparison) -> bool| all.iter().filter(is).count();
    let inside = count(&|c| c.is_inside());
    let unexplained: Vec<&Comparison> = all.iter().filter(|c| !c.is_inside() && c.why.is_empty()).collect();
    findings.conclusions.push(format!(
        "{} published values: {inside} inside ({} of {} predicted, {} of {} fitted).",
        all.len(),
        count(&|c| c.is_inside() && c.how == How::Predicted),
        count(&|c| c.how == How::Predicted),
        count(&|c| c.is_inside() && c.how == How::Fitted),
        count(&|c| c.how == How::Fitted),
    ));
    findings.conclusions.extend(all.iter().filter(|c| !c.is_inside()).map(|c| {
        let why = if c.why.is_empty() { "not explained" } else { &c.why };
        format!(
            "Outside: {}, {}: measured {}, ours {} {}: {why}.",
            c.name,
            c.quantity,
            number(c.measured),
            number(c.ours),
            c.unit
        )
    }));
    findings.tables.insert(0, table(&all));
    findings.gates.extend([
        Gate::at_least("published values compared", all.len() as f64, LEAST_VALUES),
        Gate::at_least("published values, ours inside", inside as f64, LEAST_INSIDE),
        Gate::at_most("published values outside without explanation", unexplained.len() as f64, 0.0),
    ]);
}

fn table(all: &[Comparison]) -> Table {
    let columns = ["row", "quantity", "unit", "measured", "spread", "ours", "inside", "how", "why outside", "source"];
    let line = |c: &Comparison| {
        let spread = if c.spread.is_nan() { "none published".into() } else { number(c.spread) };
        let inside = if c.is_inside() { "inside" } else { "outside" };
        let (numbers, words) =
            ([number(c.measured), spread, number(c.ours)], [inside, c.how.name(), &c.why, &c.source]);
        let names = [&c.name, &c.quantity, &c.unit].map(String::from);
        names.into_iter().chain(numbers).chain(words.map(String::from)).collect()
    };
    Table {
        title: "Against measurement".into(),
        columns: columns.map(String::from).into(),
        rows: all.iter().map(line).collect(),
    }
}

/// A number in three significant digits.
fn number(value: f64) -> String {
    let size = value.abs();
    match size {
        0.0 => "0".into(),
        _ if !value.is_finite() || !(1e-3..1e5).contains(&size) => shown(value),
        _ => format!("{value:.*}", (2.0 - size.log10().floor()).max(0.0) as usize),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use trepan_measurements::brain;

    #[test]
    fn values_inside_outside_and_unexplained_are_counted() {
        let mut findings = Findings::default();
        let of = |ours| Comparison::of(&brain::DENSITY, How::Predicted, ours);
        findings.rows = [of(1.0), of(2.0), of(2.0).why("a reason")].iter().map(Comparison::row).collect();
        judge(Scope { quick: true, seed: 1 }, &mut findings);
        assert_eq!(findings.gates.iter().map(|gate| gate.value).collect::<Vec<_>>(), [3.0, 1.0, 1.0]);
        assert_eq!(findings.tables[0].rows.len(), 3);
    }

    #[test]
    fn numbers_have_three_significant_digits() {
        assert_eq!([0.0, 0.01234, 12.34, 1234.5].map(number), ["0", "0.0123", "12.3", "1234"]);
    }
}
