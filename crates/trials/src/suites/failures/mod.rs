//! The nearest failure of every method of every family: the smallest change of one condition that
//! breaks it, with a trace of how it breaks.
//!
//! # Theory
//! A condition (speed, stiffness, delay, time step, Poisson's ratio, element quality, size) is
//! changed alone from a value at which sessions work, outwards and then by bisection
//! ([`nearest`](trepan_evidence::nearest)). The nearest failure of a method is that of the
//! condition with the smallest factor, |log₂(factor)|.
//!
//! # Practice
//! A verdict is physical and the same for all methods of a family: closed forms, f64 oracles and
//! the hand's rest decide, never the method. [`Family::criterion`] says it in words, for the page.
//! Our own methods come first. A factor of 1 is a method that fails as it stands.

mod deformable;
mod force;
mod render;
mod rigid;
mod soft;
mod table;
mod voxel_size;

use super::{Part, Scope};
use serde_json::Value;
use trepan_evidence::nearest::{Condition, Failure, Tried};
use trepan_evidence::picture::Series;
use trepan_evidence::report::Report;
use trepan_evidence::suite::{Findings, Row};

/// Distance between trials on the way outwards, octaves: of a quick run and of a full one.
const STEP: [f64; 2] = [1.0, 0.5];
/// Largest change of a condition in a quick run, octaves.
const QUICK_REACH: f64 = 3.0;

/// Where a method comes from, in the order of the table.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Standing {
    Own,
    Thesis,
    Rival,
    Oracle,
}

impl Standing {
    const ALL: [Self; 4] = [Self::Own, Self::Thesis, Self::Rival, Self::Oracle];

    fn word(self) -> &'static str {
        ["own", "thesis", "rival", "oracle"][self as usize]
    }

    /// Standing of a method that is neither recommended nor an oracle, by its name.
    fn by_name(name: &str) -> Self {
        if name.contains("thesis") { Self::Thesis } else { Self::Rival }
    }
}

/// A method under trial, and the conditions that are changed.
struct Candidate<M: 'static> {
    name: String,
    standing: Standing,
    method: M,
    conditions: &'static [Condition<M>],
}

/// Methods that answer the same question.
struct Family<M: 'static> {
    /// Suite that measures the methods' accuracy.
    suite: &'static str,
    /// What fails, the same for all methods.
    criterion: &'static str,
    /// Methods of a quick or a full run.
    methods: fn(Scope) -> Vec<Candidate<M>>,
}

/// A family as the table needs it.
struct Listed {
    suite: &'static str,
    criterion: &'static str,
    methods: Vec<String>,
}

impl<M> Family<M> {
    /// A part for each method.
    fn parts(&'static self, scope: Scope) -> Vec<Part> {
        let part = |candidate: Candidate<M>| {
            let name = format!("{} {}", self.suite, candidate.name);
            Part::new(name, move |scope, findings: &mut Findings| self.probe(&candidate, scope, findings))
        };
        (self.methods)(scope).into_iter().map(part).collect()
    }

    /// One part for all methods, where listing them is costly.
    fn part(&'static self) -> Part {
        Part::new(self.suite, |scope, findings: &mut Findings| {
            (self.methods)(scope).iter().for_each(|candidate| self.probe(candidate, scope, findings));
        })
    }

    fn listed(&self, scope: Scope) -> Listed {
        let methods = (self.methods)(scope).into_iter().map(|candidate| candidate.name).collect();
        Listed { suite: self.suite, criterion: self.criterion, methods }
    }

    /// Rows of all conditions. Traces of every failure of an own method, else of the nearest.
    fn probe(&self, candidate: &Candidate<M>, scope: Scope, findings: &mut Findings) {
        let reach = scope.pick(QUICK_REACH, f64::INFINITY);
        let found = |condition: &'static Condition<M>| {
            (condition, condition.within(reach).nearest(&candidate.method, scope.pick(STEP[0], STEP[1])))
        };
        let found: Vec<_> = candidate.conditions.iter().map(found).collect();
        findings.rows.extend(
            found.iter().map(|(condition, failure)| self.row(candidate, &condition.within(reach), failure.as_ref())),
        );
        let mut traced: Vec<_> = found.iter().filter_map(|(of, failure)| Some((*of, failure.as_ref()?))).collect();
        traced.sort_by(|a, b| a.1.octaves().total_cmp(&b.1.octaves()));
        let kept = if candidate.standing == Standing::Own { traced.len() } else { 1 };
        findings.series.extend(traced.iter().take(kept).map(|(of, failure)| {
            let whose = title(self.suite, &candidate.name);
            trace(&whose, of, failure)
        }));
    }

    fn row(&self, candidate: &Candidate<M>, condition: &Condition<M>, failure: Option<&Failure>) -> Row {
        let [low, high] = condition.limits;
        let row = Row::new(format!("{}: {}", self.suite, condition.name), &candidate.name)
            .with("family", self.suite)
            .with("condition", condition.name)
            .with("standing", candidate.standing.word())
            .with("unit", condition.unit)
            .with("nominal", condition.nominal);
        match failure {
            None => row.with("none", format!("none from {} to {}", number(low), amount(high, condition.unit))),
            Some(failure) => row
                .with("fault", failure.fault.as_str())
                .metric("failure_factor", failure.factor)
                .metric(&format!("failure_at_{}", suffix(condition.unit)), failure.at.value),
        }
    }
}

/// Unit as metrics' names end in it.
fn suffix(unit: &str) -> String {
    match unit {
        "1" => "ratio".into(),
        "°" => "deg".into(),
        unit => unit.to_lowercase().replace('/', "_per_").replace(' ', "_"),
    }
}

/// Start of a trace's title.
fn title(suite: &str, method: &str) -> String {
    format!("{suite}: {method}, ")
}

/// Lines of what was recorded at the last value that works and at the one that fails.
fn trace<M>(whose: &str, condition: &Condition<M>, failure: &Failure) -> Series {
    let line =
        |word: &str, tried: &Tried| (format!("{word} at {}", amount(tried.value, condition.unit)), tried.trace.clone());
    let works = failure.works.iter().map(|works| line("works", works));
    let title = format!("{whose}{}: {}", condition.name, failure.fault);
    let lines = works.chain([line("fails", &failure.at)]);
    Series { around_first: true, ..Series::over(title, condition.axes, lines) }
}

/// A number and its unit.
fn amount(value: f64, unit: &str) -> String {
    if unit == "1" { number(value) } else { format!("{} {unit}", number(value)) }
}

/// Four significant digits, which tell 0.4999 from a half.
fn number(value: f64) -> String {
    let digits = (3.0 - value.abs().max(1e-9).log10().floor()).clamp(0.0, 9.0);
    let text = format!("{value:.*}", digits as usize);
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_string() } else { text }
}

/// A part for every method of every family.
pub fn parts(scope: Scope) -> Vec<Part> {
    let mut parts = rigid::FAMILY.parts(scope);
    parts.extend(deformable::FAMILY.parts(scope));
    parts.extend(soft::FAMILY.parts(scope));
    parts.extend(force::FAMILY.parts(scope));
    parts.extend(voxel_size::FAMILY.parts(scope));
    parts.push(render::FAMILY.part());
    parts
}

/// Every family with its methods.
fn families(scope: Scope) -> [Listed; 6] {
    [
        rigid::FAMILY.listed(scope),
        deformable::FAMILY.listed(scope),
        soft::FAMILY.listed(scope),
        force::FAMILY.listed(scope),
        voxel_size::FAMILY.listed(scope),
        render::FAMILY.listed(scope),
    ]
}

/// Adds the tables of nearest failures, what counts as one, and the gates.
pub fn judge(scope: Scope, findings: &mut Findings) {
    table::judge(&families(scope), findings);
}

/// The nearest failure of a method of a suite's family in words; `None` if it was not tried.
pub fn nearest_of(report: &Report, suite: &str, method: &str) -> Option<String> {
    let rows = &report.findings.rows;
    let own: Vec<&Row> = rows.iter().filter(|row| row.method == method && text(row, "family") == suite).collect();
    table::nearest(&own).map(table::Line::short)
}

fn text<'a>(row: &'a Row, name: &str) -> &'a str {
    row.config.get(name).and_then(Value::as_str).unwrap_or_default()
}
