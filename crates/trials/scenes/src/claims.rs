//! Tables of rivals as published: what a paper claims beside what is measured here, and what a
//! rival was before it was made faster.
//!
//! # Practice
//! Numbers of now come from the rows of the run. Times are shares of another method's in the same
//! run, so that machines compare; those of before were measured the same way and stand in the code.

use trepan_evidence::picture::Table;
use trepan_evidence::suite::{Row, shown};
use trepan_geometry::quantile;

/// What a paper claims of a method.
pub struct Claim {
    /// Paper.
    pub source: &'static str,
    /// Its claim.
    pub claim: &'static str,
    /// How it is tested here.
    pub test: Test,
}

/// Test of a claim on the medians over a run's rows.
pub enum Test {
    /// A metric of one method is at most this multiple of another's.
    Ratio {
        /// Metric.
        metric: &'static str,
        /// Method of the claim.
        of: &'static str,
        /// Method beside it.
        over: &'static str,
        /// Largest ratio with which the claim holds.
        most: f64,
    },
    /// A metric is at most this.
    Bound {
        /// Metric.
        metric: &'static str,
        /// Method of the claim.
        of: &'static str,
        /// Largest value with which the claim holds.
        most: f64,
    },
    /// Why it cannot be tested here.
    NotHere(&'static str),
}

/// A rival as it was, in one scene.
pub struct Former {
    /// Method.
    pub method: &'static str,
    /// Its error.
    pub error: f64,
    /// Its time over that of the base.
    pub time: f64,
    /// What changed, or why it is no better.
    pub remark: &'static str,
}

/// Where rivals of before and now are compared.
pub struct Scale {
    /// Scene.
    pub scene: &'static str,
    /// Method whose time is 1.
    pub base: &'static str,
    /// Metric of time.
    pub time: &'static str,
    /// Metric of error.
    pub error: &'static str,
}

/// Median of a metric of a method over the scenes whose name begins so; NaN without rows.
pub fn median(rows: &[Row], scene: &str, method: &str, metric: &str) -> f64 {
    let of_method = rows.iter().filter(|row| row.method == method && row.scene.starts_with(scene));
    quantile(&mut of_method.filter_map(|row| row.metrics.get(metric).copied()).collect::<Vec<_>>(), 0.5)
}

fn cell(value: f64) -> String {
    if value.is_finite() { shown(value) } else { "not in this run".into() }
}

/// The claims of papers beside this run's measurements in scenes whose name begins so.
pub fn as_published(title: &str, scene: &str, claims: &[Claim], rows: &[Row]) -> Table {
    let of = |method: &str, metric: &str| median(rows, scene, method, metric);
    let line = |Claim { source, claim, test }: &Claim| {
        let (tested, value, most) = match *test {
            Test::Ratio { metric, of: own, over, most } => {
                let tested = format!("{metric} of {own} over {over}, at most {most}");
                (tested, of(own, metric) / of(over, metric), most)
            }
            Test::Bound { metric, of: own, most } => {
                (format!("{metric} of {own}, at most {most}"), of(own, metric), most)
            }
            Test::NotHere(why) => return vec![(*source).into(), (*claim).into(), why.into(), "-".into(), "-".into()],
        };
        let verdict = match value {
            value if !value.is_finite() => "-",
            value if value <= most => "yes",
            _ => "no",
        };
        vec![(*source).into(), (*claim).into(), tested, cell(value), verdict.into()]
    };
    Table {
        title: title.into(),
        columns: ["paper", "claim", "test here", "measured", "reproduced"].map(String::from).into(),
        rows: claims.iter().map(line).collect(),
    }
}

/// Rivals before and now.
pub fn before_and_now(title: &str, scale: &Scale, formers: &[Former], rows: &[Row]) -> Table {
    let Scale { scene, base, time, error } = scale;
    let of_base = median(rows, scene, base, time);
    let line = |former: &Former| {
        let now = median(rows, scene, former.method, time) / of_base;
        let error = median(rows, scene, former.method, error);
        let shown = [former.error, error, former.time, now, former.time / now].map(cell);
        [vec![former.method.to_string()], shown.to_vec(), vec![former.remark.to_string()]].concat()
    };
    let columns = [
        "method".to_string(),
        format!("{error} before"),
        format!("{error} now"),
        format!("time over {base} before"),
        format!("time over {base} now"),
        "times faster".into(),
        "remark".into(),
    ];
    Table { title: format!("{title}: {scene}"), columns: columns.into(), rows: formers.iter().map(line).collect() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn claims_are_judged_by_medians_and_what_was_not_run_is_said() {
        let row = |method: &str, us: f64| Row::new("cube, light", method).metric("step_p50_us", us);
        let rows = [row("a", 3.0), row("a", 100.0), row("a", 4.0), row("b", 2.0)];
        let ratio = |over, most| Test::Ratio { metric: "step_p50_us", of: "a", over, most };
        let claim = |test| Claim { source: "paper", claim: "fast", test };
        let claims = [claim(ratio("b", 2.0)), claim(ratio("b", 1.9)), claim(ratio("c", 1.0))];
        let table = as_published("t", "cube", &claims, &rows);
        assert_eq!(table.rows.iter().map(|row| row[4].as_str()).collect::<Vec<_>>(), ["yes", "no", "-"]);
        assert_eq!((table.rows[0][3].as_str(), table.rows[2][3].as_str()), ("2.0000", "not in this run"));
        let scale = Scale { scene: "cube", base: "b", time: "step_p50_us", error: "error" };
        let former = Former { method: "a", error: 0.1, time: 8.0, remark: "" };
        assert_eq!(before_and_now("t", &scale, &[former], &rows).rows[0][3..6], ["8.0000", "2.0000", "4.0000"]);
    }
}
