//! Data of the charts (cost against error with the Pareto front), tables and stability maps.
//!
//! # Practice
//! A suite fills them together with its rows; the page draws them. Both axes of a chart are
//! logarithmic. Costs below a thousandth of a unit and errors below a hundred-thousandth are drawn
//! at that limit.

use crate::front::{self, front};
use crate::row::number;
use serde::{Deserialize, Serialize};

/// One point of a chart.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Mark {
    /// Name of the method.
    pub method: String,
    /// Cost.
    #[serde(deserialize_with = "number")]
    pub cost: f64,
    /// Error.
    #[serde(deserialize_with = "number")]
    pub error: f64,
}

/// Chart of cost against error.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Chart {
    /// Title.
    pub title: String,
    /// Metric on the cost axis.
    pub cost: String,
    /// Metric on the error axis.
    pub error: String,
    /// One mark or more for each method.
    pub marks: Vec<Mark>,
    /// Cost limit with its name.
    pub budget: Option<(f64, String)>,
    /// The method that must be on the Pareto front; gates call [`beaten`](Self::beaten).
    pub chosen: Option<String>,
}

impl Chart {
    /// Number of other methods with a mark better than this method's first in both cost and error;
    /// `usize::MAX` if the method has no finite mark.
    pub fn beaten(&self, method: &str) -> usize {
        self.beaten_beyond(method, 0.0)
    }

    /// Like [`beaten`](Self::beaten), counting only marks that are cheaper by more than a share.
    pub fn beaten_beyond(&self, method: &str, share: f64) -> usize {
        let is_number = |mark: &&Mark| mark.cost.is_finite() && mark.error.is_finite();
        let Some(own) = self.marks.iter().filter(is_number).find(|mark| mark.method == method) else {
            return usize::MAX;
        };
        let better =
            |mark: &&Mark| mark.method != method && mark.cost < own.cost * (1.0 - share) && mark.error < own.error;
        self.marks.iter().filter(is_number).filter(better).count()
    }

    /// Relative difference in cost between two runs of one commit on a shared machine that does not
    /// change a Pareto front.
    pub const SPREAD: f64 = front::SPREAD;

    /// Methods with a mark on the Pareto front.
    pub fn on_front(&self) -> Vec<String> {
        let front = self.front();
        let on = |mark: &&Mark| front.contains(&(mark.cost, mark.error));
        let mut names: Vec<String> = self.marks.iter().filter(on).map(|mark| mark.method.clone()).collect();
        names.sort();
        names.dedup();
        names
    }

    /// Whether a method has a mark on the Pareto front, or would have if it were cheaper by
    /// [`SPREAD`](Self::SPREAD).
    pub fn near_front(&self, method: &str) -> bool {
        let beats = |other: &Mark, own: &Mark| other.cost < own.cost * (1.0 - Self::SPREAD) && other.error <= own.error;
        let own =
            self.marks.iter().filter(|mark| mark.method == method && mark.cost.is_finite() && mark.error.is_finite());
        own.into_iter().any(|own| !self.marks.iter().any(|other| beats(other, own)))
    }

    /// Marks on the Pareto front, cheapest first.
    pub fn front(&self) -> Vec<(f64, f64)> {
        let pairs: Vec<(f64, f64)> = self.marks.iter().map(|mark| (mark.cost, mark.error)).collect();
        front(&pairs).into_iter().map(|at| pairs[at]).collect()
    }
}

/// Table of a suite's results, for its page.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Table {
    /// Title.
    pub title: String,
    /// Names of the columns with their units.
    pub columns: Vec<String>,
    /// Cells, row by row.
    pub rows: Vec<Vec<String>>,
}

/// Lines of a quantity over frames, or over another quantity, for a suite's page.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Series {
    /// Title.
    pub title: String,
    /// Quantity of the horizontal axis with its unit.
    pub x: String,
    /// Quantity of the vertical axis with its unit.
    pub y: String,
    /// Whether the vertical axis is logarithmic; values that are not positive are left out then.
    pub logarithmic: bool,
    /// Lines: name, and points in order.
    #[serde(serialize_with = "within_a_file")]
    pub lines: Vec<Line>,
    /// Limit across the vertical axis with its name.
    pub limit: Option<(f64, String)>,
    /// Whether the vertical axis ends three heights of the first line beyond it, so that a line
    /// that bursts leaves the picture.
    #[serde(default)]
    pub around_first: bool,
}

/// Most ranges in a thinned line; each keeps its least and its largest value.
const RANGES: usize = 240;

impl Series {
    /// Creates a chart of values over frames. Long lines keep the least and the largest value of
    /// every range of frames, so no peak is lost.
    pub fn over_frames<'a, V: Into<f64> + Copy + 'a>(
        title: impl Into<String>,
        y: &str,
        lines: impl IntoIterator<Item = (String, &'a [V])>,
    ) -> Self {
        let points = |values: &[V]| values.iter().enumerate().map(|(n, value)| (n as f64, (*value).into())).collect();
        Self::over(title, ["frame", y], lines.into_iter().map(|(name, values)| (name, points(values))))
    }

    /// Creates a chart of lines over a quantity; `axes`: the quantities with their units. Points
    /// that are not finite are left out, and long lines thinned as over frames.
    pub fn over(
        title: impl Into<String>,
        axes: [&str; 2],
        lines: impl IntoIterator<Item = (String, Vec<(f64, f64)>)>,
    ) -> Self {
        let lines = lines.into_iter().map(|(name, points)| (name, thinned(&points))).collect();
        Self { title: title.into(), x: axes[0].into(), y: axes[1].into(), lines, ..Self::default() }
    }

    /// The same on a logarithmic vertical axis with a limit.
    pub fn limited(self, limit: f64, name: &str) -> Self {
        Self { logarithmic: true, limit: Some((limit, name.into())), ..self }
    }

    /// Whether every line has two finite points or more.
    pub fn is_drawn(&self) -> bool {
        let finite = |(_, points): &Line| points.iter().filter(|(x, y)| x.is_finite() && y.is_finite()).count();
        !self.lines.is_empty() && self.lines.iter().all(|line| finite(line) > 1)
    }
}

/// Five significant digits, so that files stay small.
fn rounded(value: f64) -> f64 {
    format!("{value:.4e}").parse().unwrap_or(value)
}

/// Finite points of a line; each range keeps its least and its largest value.
fn thinned(points: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let mut kept = Vec::new();
    for range in points.chunks(points.len().div_ceil(RANGES).max(1)) {
        let finite = || range.iter().filter(|(x, y)| x.is_finite() && y.is_finite()).map(|(x, y)| (*x, rounded(*y)));
        let least = finite().min_by(|a, b| a.1.total_cmp(&b.1));
        let most = finite().max_by(|a, b| a.1.total_cmp(&b.1));
        let mut both: Vec<(f64, f64)> = least.into_iter().chain(most).collect();
        both.sort_by(|a, b| a.0.total_cmp(&b.0));
        both.dedup();
        kept.extend(both);
    }
    kept
}

/// Picture that a run made, for a suite's page.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Snapshot {
    /// Title.
    pub title: String,
    /// The PNG file in base 64 (RFC 4648).
    pub png: String,
}

/// Result of a method in one cell of a map.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Outcome {
    /// Meets all requirements.
    Works,
    /// Usable, with this drawback.
    Degrades(String),
    /// Not usable, for this reason.
    Fails(String),
    /// Rejected before it started, for this reason.
    Refused(String),
}

impl Outcome {
    /// Grade: 0 works, 1 degrades, 2 fails, 3 refused.
    pub fn grade(&self) -> u8 {
        match self {
            Self::Works => 0,
            Self::Degrades(_) => 1,
            Self::Fails(_) => 2,
            Self::Refused(_) => 3,
        }
    }

    /// The grade as a word.
    pub fn word(&self) -> &'static str {
        ["works", "degrades", "fails", "refused"][usize::from(self.grade())]
    }

    /// Whether another outcome is better; from best to worst: usable, refused, failed.
    pub fn worse_than(&self, other: &Self) -> bool {
        let rank = |outcome: &Self| [0, 1, 3, 2][usize::from(outcome.grade())];
        rank(self) > rank(other)
    }

    /// Reason for not working, else empty.
    pub fn reason(&self) -> &str {
        match self {
            Self::Works => "",
            Self::Degrades(reason) | Self::Fails(reason) | Self::Refused(reason) => reason,
        }
    }
}

/// Line over a map: its name and its points.
pub type Line = (String, Vec<(f64, f64)>);

/// Map of outcomes over a grid of conditions.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Map {
    /// Title, often the method.
    pub title: String,
    /// Quantity of the columns.
    pub x: String,
    /// Quantity of the rows.
    pub y: String,
    /// Names of the columns, left to right.
    pub columns: Vec<String>,
    /// Names of the rows, top to bottom.
    pub rows: Vec<String>,
    /// Outcomes row by row.
    pub cells: Vec<Vec<Outcome>>,
    /// Lines over the cells: name, and points in cells from the upper left corner.
    #[serde(serialize_with = "within_a_file")]
    pub lines: Vec<Line>,
    /// Notes printed under the map.
    pub notes: Vec<String>,
}

/// Serializes lines with infinite coordinates clamped, because JSON has no infinity.
fn within_a_file<S: serde::Serializer>(lines: &[Line], to: S) -> Result<S::Ok, S::Error> {
    let kept = |v: f64| if v.is_nan() { 0.0 } else { v.clamp(-1e6, 1e6) };
    let line = |(name, points): &Line| {
        (name.clone(), points.iter().map(|&(x, y)| (kept(x), kept(y))).collect::<Vec<(f64, f64)>>())
    };
    lines.iter().map(line).collect::<Vec<Line>>().serialize(to)
}

impl Map {
    /// All cells with the names of their row and column.
    pub fn named_cells(&self) -> impl Iterator<Item = (&str, &str, &Outcome)> {
        let cells = self.rows.iter().zip(&self.cells);
        cells.flat_map(|(row, cells)| {
            self.columns.iter().zip(cells).map(move |(column, cell)| (&**row, &**column, cell))
        })
    }

    /// The cell of a row and a column, by name.
    pub fn cell(&self, row: &str, column: &str) -> Option<&Outcome> {
        self.named_cells().find(|(r, c, _)| *r == row && *c == column).map(|(.., cell)| cell)
    }
}

/// One line that names a changed cell and its old and new outcome.
pub fn describe_change(map: &Map, row: &str, column: &str, was: &Outcome, is: &Outcome) -> String {
    let word = if is.worse_than(was) { "WORSE" } else { "better" };
    let reason = [is.reason(), was.reason()].into_iter().find(|reason| !reason.is_empty()).unwrap_or_default();
    format!("{word}: {} | {row} | {column}: {} -> {} ({reason})", map.title, was.word(), is.word())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_thinned_line_keeps_its_peaks_in_order() {
        let mut values = vec![1.0f64; 10_000];
        (values[4321], values[4322]) = (-7.0, 9.0);
        let series = Series::over_frames("t", "y", [("a".to_string(), &values[..])]);
        let points = &series.lines[0].1;
        assert!(points.len() <= 2 * RANGES && series.is_drawn());
        assert!(points.contains(&(4321.0, -7.0)) && points.contains(&(4322.0, 9.0)));
        assert!(points.is_sorted_by(|a, b| a.0 < b.0));
        let gap = Series::over_frames("t", "y", [("a".to_string(), &[f64::NAN, 1.0][..])]);
        assert!(!gap.is_drawn() && gap.lines[0].1 == [(1.0, 1.0)]);
    }

    #[test]
    fn a_mark_better_in_both_beats() {
        let mark = |method: &str, cost, error| Mark { method: method.into(), cost, error };
        let marks = vec![mark("a", 1.0, 9.0), mark("b", 2.0, 2.0), mark("c", 3.0, 3.0), mark("d", 1.0, f64::NAN)];
        let chart = Chart { marks, ..Chart::default() };
        assert_eq!(["a", "b", "c"].map(|name| chart.beaten(name)), [0, 0, 1]);
        assert_eq!((chart.beaten("d"), chart.beaten("none")), (usize::MAX, usize::MAX));
    }
}
