//! What the papers of the rules claim, and what each rule gains by a tuned constant.
//!
//! # Sources
//! Thesis 5.3 and its Tables 5.2 and 5.3; Teschner et al. 2003, section on cell size; Garcia-Alonso
//! et al. 1994, as the thesis quotes it (5.1).

use trepan_evidence::picture::Table;
use trepan_evidence::suite::{Row, shown};
use trepan_trials_scenes::claims::{Claim, Test, as_published, median};

const REGRET: &str = "regret_percent";
/// What a good size may lose, percent: the zone of the thesis.
const GOOD: f64 = 10.0;

const CLAIMS: [Claim; 4] = [
    Claim {
        source: "thesis, Table 5.3",
        claim: "the analytic size is nearer to the best than the mean edge",
        test: Test::Ratio { metric: REGRET, of: "thesis analytic", over: "mean edge", most: 1.0 },
    },
    Claim {
        source: "thesis, Table 5.3",
        claim: "the analytic size lies in the good zone",
        test: Test::Bound { metric: REGRET, of: "thesis analytic", most: GOOD },
    },
    Claim {
        source: "Teschner et al. 2003",
        claim: "the best cell is as large as the mean edge",
        test: Test::Bound { metric: REGRET, of: "mean edge", most: GOOD },
    },
    Claim {
        source: "Garcia-Alonso et al. 1994",
        claim: "512 voxels an object are best",
        test: Test::Bound { metric: REGRET, of: "512 voxels", most: GOOD },
    },
];

/// Claims of papers, and rules as printed beside their tuned selves.
pub fn tables(rows: &[Row]) -> Vec<Table> {
    let line = |rule: &str| {
        let worst = |rule: &str| {
            let of_rule = rows.iter().filter(|row| row.method == rule);
            of_rule.filter_map(|row| row.metrics.get(REGRET).copied()).fold(f64::NAN, f64::max)
        };
        let tuned = format!("{rule}, tuned");
        let values = [median(rows, "", rule, REGRET), median(rows, "", &tuned, REGRET), worst(rule), worst(&tuned)];
        [vec![rule.to_string()], values.map(shown).to_vec()].concat()
    };
    let columns =
        ["rule", "median regret as printed, %", "median regret tuned, %", "worst as printed, %", "worst tuned, %"];
    vec![
        as_published("Rules as published", "", &CLAIMS, rows),
        Table {
            title: "Rules as printed and tuned by as many timed passes as ours".into(),
            columns: columns.map(String::from).into(),
            rows: ["thesis analytic", "mean edge", "512 voxels"].map(line).into(),
        },
    ]
}
