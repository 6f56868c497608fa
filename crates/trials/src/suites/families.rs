//! Checks that every method of every family has rows of speed, accuracy and stability.
//!
//! # Practice
//! The method lists come from the crates. A method that is added there and not measured here is
//! reported as a hole, and a hole fails a run of all suites.

use serde::Serialize;
use trepan_evidence::part::Suite;
use trepan_evidence::picture::Outcome;
use trepan_evidence::report::Report;
use trepan_evidence::suite::{Row, shown};
use trepan_evidence::timer::Samples;
use trepan_rivals::Family as _;

/// A family of methods that answer the same question.
struct Family {
    name: &'static str,
    suite: &'static str,
    methods: fn(&Report) -> Vec<String>,
    speed: &'static [&'static str],
    accuracy: &'static [&'static str],
}

fn names(all: impl IntoIterator<Item = &'static str>) -> Vec<String> {
    all.into_iter().map(String::from).collect()
}

const FAMILIES: [Family; 6] = [
    Family {
        name: "tool and bone (rigid)",
        suite: "rigid",
        methods: |_| names(trepan_rigid::Method::all().iter().map(trepan_rigid::Method::name)),
        speed: &["tick_p50_us"],
        accuracy: &["depth_error_p95_voxel"],
    },
    Family {
        name: "tool and moving tissue (deformable)",
        suite: "deformable",
        methods: |_| names(trepan_deformable::Method::all().iter().map(|method| method.name())),
        speed: &["step_p50_us"],
        accuracy: &["depth_error_p95_mm"],
    },
    Family {
        name: "soft tissue (solver)",
        suite: "tled",
        methods: |_| {
            let rivals = trepan_soft::Method::all();
            names(["tled", "tled cured"].into_iter().chain(rivals.iter().map(trepan_soft::Method::name)))
        },
        speed: &["step_p50_us"],
        accuracy: &["displacement_error_percent"],
    },
    Family {
        name: "contact force",
        suite: "force",
        methods: |report| mapped(report, "Force models"),
        speed: &["call_p50_ns"],
        accuracy: &["force_error_rms_n"],
    },
    Family {
        name: "voxel size",
        suite: "voxel-size",
        methods: |_| names(super::voxel_size::RULES),
        speed: &["cost_us"],
        accuracy: &["regret_percent"],
    },
    Family {
        name: "picture (render)",
        suite: "render",
        methods: |report| mapped(report, "bone"),
        speed: &["frame_p50_ms"],
        accuracy: &["image_error_percent"],
    },
];

/// Column names of a map. Methods that need a missing graphics device are not in it.
fn mapped(report: &Report, title: &str) -> Vec<String> {
    report.findings.maps.iter().filter(|map| map.title == title).flat_map(|map| map.columns.clone()).collect()
}

/// Measurements of one method.
struct Known {
    speed: Vec<f64>,
    accuracy: Vec<f64>,
    /// Number of cells that work, degrade, fail and are refused.
    cells: [usize; 4],
}

impl Known {
    fn of(report: &Report, family: &Family, method: &str) -> Self {
        let rows = || report.findings.rows.iter().filter(|row| row.method == method);
        let metric = |row: &Row, wanted: &[&str]| wanted.iter().find_map(|name| row.metrics.get(*name).copied());
        let all = |wanted| rows().filter_map(|row| metric(row, wanted)).filter(|v| v.is_finite()).collect();
        let mut cells = [0; 4];
        for map in &report.findings.maps {
            // A map belongs to one method, or has methods as columns.
            let whole = map.title.starts_with(&format!("{method}:"));
            let own = map.named_cells().filter(|(_, column, _)| whole || *column == method);
            own.for_each(|(.., cell)| cells[usize::from(Outcome::grade(cell))] += 1);
        }
        Self { speed: all(family.speed), accuracy: all(family.accuracy), cells }
    }

    fn lacks(&self) -> Vec<&'static str> {
        let lacks = [
            (self.speed.is_empty(), "speed"),
            (self.accuracy.is_empty(), "accuracy"),
            (self.cells.iter().sum::<usize>() == 0, "stability"),
        ];
        lacks.into_iter().filter(|(lacks, _)| *lacks).map(|(_, what)| what).collect()
    }
}

/// Methods without a row of speed, accuracy or stability, each with what is missing.
pub fn holes(reports: &[(&Suite, Report)]) -> Vec<String> {
    let mut holes = Vec::new();
    for family in &FAMILIES {
        let Some((_, report)) = reports.iter().find(|(suite, _)| suite.name == family.suite) else { continue };
        for method in (family.methods)(report) {
            for what in Known::of(report, family, &method).lacks() {
                holes.push(format!("{}: {method} has no row of {what}", family.name));
            }
        }
    }
    holes
}

/// A method's line in the table of all methods.
#[derive(Serialize)]
pub struct Measured {
    family: &'static str,
    method: String,
    cost: String,
    error: String,
    /// Number of map cells that work, degrade, fail and are refused.
    cells: [usize; 4],
    /// Condition whose smallest change breaks it; empty without the suite `failures`.
    nearest_failure: String,
    /// Whether nothing is missing.
    is_whole: bool,
}

/// All methods of the families in the reports, with medians over all of their scenes.
pub fn measured(reports: &[(&Suite, Report)]) -> Vec<Measured> {
    let mut measured = Vec::new();
    let failures = reports.iter().find(|(suite, _)| suite.name == "failures").map(|(_, report)| report);
    for family in &FAMILIES {
        let Some((_, report)) = reports.iter().find(|(suite, _)| suite.name == family.suite) else { continue };
        for method in (family.methods)(report) {
            let known = Known::of(report, family, &method);
            let shown = |values: &[f64], name: &str| match values.is_empty() {
                true => "none".into(),
                false => format!("{} {}", shown(Samples::from(values.to_vec()).quantile(0.5)), unit(name)),
            };
            measured.push(Measured {
                family: family.name,
                cost: shown(&known.speed, family.speed[0]),
                error: shown(&known.accuracy, family.accuracy[0]),
                nearest_failure: failures
                    .and_then(|report| super::failures::nearest_of(report, family.suite, &method))
                    .unwrap_or_default(),
                is_whole: known.lacks().is_empty(),
                cells: known.cells,
                method,
            });
        }
    }
    measured
}

fn unit(metric: &str) -> &str {
    match metric.rsplit('_').next().unwrap_or_default() {
        "percent" => "%",
        "n" => "N",
        unit => unit,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::suites::ALL;
    use trepan_evidence::part::Scope;

    #[test]
    fn only_families_without_measurements_have_holes_one_for_each_method() {
        let suite = ALL.iter().find(|suite| suite.name == "force").unwrap();
        let scope = Scope { quick: true, seed: 1 };
        let parts = (suite.parts)(scope);
        let made = |part: trepan_evidence::part::Part| {
            (part.slug(), trepan_evidence::report::Making::here(scope), part.run(scope).0)
        };
        let mut report = Report::of(suite, parts.into_iter().map(made).collect()).unwrap();
        assert_eq!(holes(&[(suite, report.clone())]), Vec::<String>::new());
        report.findings.rows.retain(|row| row.method != "friction");
        let found = holes(&[(suite, report)]);
        assert_eq!(found.len(), 2, "{found:?}");
    }
}
