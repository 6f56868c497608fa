//! A printed number beside ours, and the verdict that follows from the two.
//!
//! # Theory
//! A verdict is computed from ratios, never typed in. Within a tenth is the same.
//! ```text
//! less is better:  ours / printed        more is better:  printed / ours
//! time:            over the printed bound is worse; else ours / the thesis's method, same run
//! nothing printed: ours / the thesis's method, same run
//! equal:           same within a tolerance, else it cannot be compared
//! ```
//! Where ours has no such quantity, the thesis's method of this run stands for it: then the verdict
//! says whether the printed result comes out again.

use trepan_evidence::suite::{Row, shown};

/// Ratio within which two values are the same.
const SAME: f64 = 0.1;

/// How two values are compared.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Rule {
    /// Less is better.
    Less,
    /// More is better.
    More,
    /// Time under a bound that a machine of 2012 kept.
    Time,
    /// Same within a share of the printed value; otherwise neither better nor worse.
    Equal(f64),
}

/// Verdict on a number, or on a numbered figure or table.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Verdict {
    /// The two do not measure the same.
    CannotCompare,
    /// Better.
    Better,
    /// Same.
    Same,
    /// Worse.
    Worse,
}

impl Verdict {
    /// All of them, in the order of the conclusions.
    pub const ALL: [Self; 4] = [Self::Same, Self::Better, Self::Worse, Self::CannotCompare];

    /// The verdict in words.
    pub fn name(self) -> &'static str {
        match self {
            Self::CannotCompare => "cannot be compared",
            Self::Better => "better",
            Self::Same => "same",
            Self::Worse => "worse",
        }
    }

    /// Verdict on a ratio where less is better.
    fn of_ratio(ratio: f64) -> Self {
        match ratio {
            r if r.is_nan() => Self::CannotCompare,
            r if r < 1.0 - SAME => Self::Better,
            r if r <= 1.0 + SAME => Self::Same,
            _ => Self::Worse,
        }
    }
}

/// What measured times are compared with.
const THESIS_HERE: &str = "the thesis's method in this run";

/// Ratio of a verdict, with its words.
pub struct Ratio {
    /// Over 1 is worse; NaN where there is nothing to compare with.
    pub value: f64,
    /// The ratio in words; empty where there is none.
    pub text: String,
}

/// A quantity of a numbered figure or table.
#[derive(Clone, Debug, PartialEq)]
pub struct Comparison {
    /// Figure or table, as in `Figure 3.11`.
    pub item: String,
    /// Quantity, with model and task.
    pub quantity: String,
    /// Unit.
    pub unit: String,
    /// Rule of the verdict.
    pub rule: Rule,
    /// Value or bound that the thesis prints; NaN where it prints none.
    pub printed: f64,
    /// The thesis's method as printed, in this run.
    pub as_printed: f64,
    /// The thesis's method with its errors put right, in this run.
    pub corrected: f64,
    /// The recommended method, or this project's value.
    pub ours: f64,
    /// What limits the comparison.
    pub why: String,
}

impl Comparison {
    /// Creates a comparison without values: less is better.
    pub fn new(item: &str, quantity: impl Into<String>, unit: &str) -> Self {
        let (item, quantity, unit) = (item.into(), quantity.into(), unit.into());
        let [printed, as_printed, corrected, ours] = [f64::NAN; 4];
        Self { item, quantity, unit, rule: Rule::Less, printed, as_printed, corrected, ours, why: String::new() }
    }

    /// Sets the printed value and the rule.
    pub fn printed(self, rule: Rule, printed: f64) -> Self {
        Self { rule, printed, ..self }
    }

    /// Sets what this run measured: as printed, put right, ours.
    pub fn measured(self, [as_printed, corrected, ours]: [f64; 3]) -> Self {
        Self { as_printed, corrected, ours, ..self }
    }

    /// Sets this project's value alone.
    pub fn ours(self, ours: f64) -> Self {
        Self { ours, ..self }
    }

    /// Says what limits the comparison.
    pub fn why(self, why: &str) -> Self {
        Self { why: why.into(), ..self }
    }

    /// The value that is judged: ours, else the thesis's method in this run.
    pub fn judged(&self) -> f64 {
        [self.ours, self.corrected, self.as_printed].into_iter().find(|v| v.is_finite()).unwrap_or(f64::NAN)
    }

    /// The thesis's method in this run, put right where there is such a value.
    fn thesis_here(&self) -> f64 {
        if self.corrected.is_finite() { self.corrected } else { self.as_printed }
    }

    /// What is judged against what; over 1 is worse, or for `Equal` more.
    pub fn ratio(&self) -> Ratio {
        let (judged, printed, thesis_here) = (self.judged(), self.printed, self.thesis_here());
        let (own, against, value) = match self.rule {
            Rule::More => (judged, "the printed value", printed / judged),
            Rule::Time if judged > printed => (judged, "the printed bound", judged / printed),
            Rule::Time => (self.ours, THESIS_HERE, self.ours / thesis_here),
            Rule::Less if printed.is_nan() => (self.ours, THESIS_HERE, self.ours / thesis_here),
            Rule::Less | Rule::Equal(_) => (judged, "the printed value", judged / printed),
        };
        let quotient = if self.rule == Rule::More { 1.0 / value } else { value };
        let subject = if own == self.ours { "ours" } else { "the thesis's method here" };
        let text = if value.is_finite() { format!("{subject} is {quotient:.2} of {against}") } else { String::new() };
        Ratio { value, text }
    }

    /// The verdict.
    pub fn verdict(&self) -> Verdict {
        let (judged, ratio) = (self.judged(), self.ratio().value);
        match self.rule {
            Rule::Equal(within) => match (ratio - 1.0).abs() <= within {
                true => Verdict::Same,
                false => Verdict::CannotCompare,
            },
            Rule::Time if judged > self.printed => Verdict::Worse,
            Rule::Time if ratio.is_nan() && judged.is_finite() => Verdict::Same,
            _ => Verdict::of_ratio(ratio),
        }
    }

    /// The reason of the verdict, with its ratio.
    pub fn reason(&self) -> String {
        let holds = self.rule == Rule::Time && self.judged() <= self.printed;
        let bound = if holds { "the bound of 2012 holds" } else { "" };
        let all = [self.ratio().text, bound.into(), self.why.clone()];
        all.into_iter().filter(|text| !text.is_empty()).collect::<Vec<_>>().join("; ")
    }

    /// The row of a file.
    pub fn row(&self) -> Row {
        let rule = match self.rule {
            Rule::Less => "less",
            Rule::More => "more",
            Rule::Time => "time",
            Rule::Equal(_) => "equal",
        };
        let within = if let Rule::Equal(within) = self.rule { within } else { SAME };
        Row::new(&self.item, &self.quantity)
            .with("rule", rule)
            .with("within", within)
            .with("unit", self.unit.as_str())
            .with("why", self.why.as_str())
            .metric("printed", self.printed)
            .metric("thesis_as_printed", self.as_printed)
            .metric("thesis_put_right", self.corrected)
            .metric("ours", self.ours)
    }

    /// Reads the row back; `None` for a row of another kind.
    pub fn of(row: &Row) -> Option<Self> {
        let text = |name: &str| row.config.get(name).and_then(|value| value.as_str()).map(String::from);
        let rule = match text("rule")?.as_str() {
            "less" => Rule::Less,
            "more" => Rule::More,
            "time" => Rule::Time,
            _ => Rule::Equal(row.config.get("within")?.as_f64()?),
        };
        let value = |name: &str| row.metrics.get(name).copied().unwrap_or(f64::NAN);
        Some(Self {
            rule,
            printed: value("printed"),
            why: text("why")?,
            ..Self::new(&row.scene, row.method.clone(), &text("unit")?)
                .measured(["thesis_as_printed", "thesis_put_right", "ours"].map(value))
        })
    }
}

/// A value for the table; a dash where there is none.
pub fn cell(value: f64) -> String {
    match value {
        v if !v.is_finite() => "–".into(),
        v if v.fract() == 0.0 && v.abs() < 1e9 => format!("{v}"),
        v if v.abs() >= 100.0 => format!("{v:.0}"),
        v if v.abs() >= 10.0 => format!("{v:.1}"),
        v if v.abs() >= 0.1 => format!("{v:.3}"),
        v => shown(v),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(rule: Rule, printed: f64, corrected: f64, ours: f64) -> Comparison {
        Comparison::new("Figure 3.11", "q", "µs").printed(rule, printed).measured([f64::NAN, corrected, ours])
    }

    #[test]
    fn verdicts_follow_from_the_numbers() {
        let verdict = |rule, printed, corrected, ours| of(rule, printed, corrected, ours).verdict();
        let nan = f64::NAN;
        assert_eq!(verdict(Rule::Less, 0.5, 9.0, 0.2), Verdict::Better);
        assert_eq!(verdict(Rule::Less, 0.5, 9.0, 0.52), Verdict::Same);
        assert_eq!(verdict(Rule::Less, 0.5, 0.1, 0.6), Verdict::Worse);
        assert_eq!(verdict(Rule::Less, nan, 2.0, 1.0), Verdict::Better);
        assert_eq!(verdict(Rule::Less, nan, nan, 1.0), Verdict::CannotCompare);
        assert_eq!(verdict(Rule::Less, 1.0, 2.0, nan), Verdict::Worse);
        assert_eq!(verdict(Rule::More, 15.0, nan, 30.0), Verdict::Better);
        assert_eq!(verdict(Rule::More, 15.0, nan, 3.0), Verdict::Worse);
        assert_eq!(verdict(Rule::Time, 1000.0, 10.0, 20.0), Verdict::Worse);
        assert_eq!(verdict(Rule::Time, 1000.0, 20.0, 10.0), Verdict::Better);
        assert_eq!(verdict(Rule::Time, 5.0, 20.0, 10.0), Verdict::Worse);
        assert_eq!(verdict(Rule::Time, 15.0, 10.0, nan), Verdict::Same);
        assert_eq!(verdict(Rule::Time, 15.0, nan, 1.0), Verdict::Same);
        assert_eq!(verdict(Rule::Time, 15.0, nan, nan), Verdict::CannotCompare);
        assert_eq!(verdict(Rule::Equal(0.02), 100.0, nan, 101.0), Verdict::Same);
        assert_eq!(verdict(Rule::Equal(0.02), 100.0, nan, 110.0), Verdict::CannotCompare);
        assert_eq!(verdict(Rule::Equal(0.02), nan, nan, nan), Verdict::CannotCompare);
    }

    #[test]
    fn a_row_keeps_the_comparison() {
        for rule in [Rule::Less, Rule::More, Rule::Time, Rule::Equal(0.25)] {
            let comparison = of(rule, 2.0, 3.0, 4.0).why("because");
            let mut back = Comparison::of(&comparison.row()).unwrap();
            assert!(back.as_printed.is_nan());
            back.as_printed = 1.0;
            assert_eq!(back, Comparison { as_printed: 1.0, ..comparison });
        }
        assert!(Comparison::of(&Row::new("a", "b")).is_none());
    }
}
