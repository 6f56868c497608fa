//! Data of the charts (cost against error with the Pareto front) and of the stability maps.
//!
//! # Practice
//! A suite fills them together with its rows; the page draws them. Both axes of a chart are
//! logarithmic. Costs below a thousandth of a unit and errors below a hundred-thousandth are drawn
//! at that limit.

use crate::front::front;
use crate::html::text;
use crate::row::number;
use serde::{Deserialize, Serialize};
use std::fmt::Write;

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
    pub const SPREAD: f64 = 0.15;

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

const CELL: (usize, usize) = (34, 20);
/// Fill colours that also differ in lightness, to be distinguishable without colour.
const FILL: [&str; 4] = ["#d5efe6", "#f2cf74", "#d9744f", "#9aa5b1"];
const STROKE: [&str; 3] = ["#0072b2", "#000000", "#cc79a7"];

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

    /// The map as a figure with its reasons, lettered, below.
    pub fn svg(&self) -> String {
        let reasons = self.reasons();
        let left = 8 + 7 * self.rows.iter().map(|name| name.chars().count()).max().unwrap_or(0).max(4);
        let widest = self.columns.iter().map(|name| name.chars().count()).max().unwrap_or(0);
        let slanted = widest > 6;
        let top = if slanted { 30 + 6 * widest } else { 36 };
        let (width, height) = (left + CELL.0 * self.columns.len() + 8, top + CELL.1 * self.rows.len() + 20);
        let width = (width + if slanted { 4 * widest } else { 0 })
            .max(8 * self.title.len().max(self.x.len() + self.y.len() + 8));
        let mut svg = format!(
            "<figure><svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" \
             font-family=\"sans-serif\" font-size=\"11\"><text x=\"2\" y=\"13\" font-weight=\"bold\">{}</text>\
             <text x=\"2\" y=\"{}\" fill=\"#555\">{} ↓, {} →</text>",
            text(&self.title),
            height - 4,
            text(&self.y),
            text(&self.x)
        );
        for (at, name) in self.columns.iter().enumerate() {
            let (x, y, name) = (left + CELL.0 * at + CELL.0 / 2, top - 6, text(name));
            if slanted {
                _ = write!(svg, "<text transform=\"translate({x},{y}) rotate(-60)\">{name}</text>");
            } else {
                _ = write!(svg, "<text x=\"{x}\" y=\"{y}\" text-anchor=\"middle\">{name}</text>");
            }
        }
        for (at, (name, cells)) in self.rows.iter().zip(&self.cells).enumerate() {
            let y = top + CELL.1 * at;
            _ = write!(svg, "<text x=\"{}\" y=\"{}\" text-anchor=\"end\">{}</text>", left - 5, y + 14, text(name));
            for (column, cell) in cells.iter().enumerate() {
                draw_cell(&mut svg, (left + CELL.0 * column, y), cell, &reasons);
            }
        }
        self.draw_lines(&mut svg, (left, top));
        svg += "</svg><figcaption>";
        self.notes.iter().for_each(|note| _ = write!(svg, "{}<br>", text(note)));
        for (at, reason) in reasons.iter().enumerate() {
            _ = write!(svg, "<b>{}</b> {}<br>", letter(at), text(reason));
        }
        for (at, (name, _)) in self.lines.iter().enumerate() {
            _ = write!(svg, "<span style=\"color:{}\">━</span> {} ", STROKE[at % STROKE.len()], text(name));
        }
        svg + "</figcaption></figure>"
    }

    fn draw_lines(&self, svg: &mut String, (left, top): (usize, usize)) {
        for (at, (_, points)) in self.lines.iter().enumerate() {
            let place = |&(x, y): &(f64, f64)| {
                let (x, y) = (x.clamp(0.0, self.columns.len() as f64), y.clamp(0.0, self.rows.len() as f64));
                format!("{:.1},{:.1}", left as f64 + x * CELL.0 as f64, top as f64 + y * CELL.1 as f64)
            };
            let points: Vec<String> = points.iter().map(place).collect();
            _ = write!(
                svg,
                "<polyline points=\"{}\" fill=\"none\" stroke=\"{}\" stroke-width=\"2\"/>",
                points.join(" "),
                STROKE[at % STROKE.len()]
            );
        }
    }

    /// Distinct reasons in order of appearance.
    fn reasons(&self) -> Vec<&str> {
        let mut found = Vec::new();
        for reason in self.cells.iter().flatten().map(Outcome::reason) {
            if !reason.is_empty() && !found.contains(&reason) {
                found.push(reason);
            }
        }
        found
    }
}

fn draw_cell(svg: &mut String, (x, y): (usize, usize), cell: &Outcome, reasons: &[&str]) {
    let mark = reasons.iter().position(|reason| *reason == cell.reason()).map(letter).unwrap_or_default();
    _ = write!(
        svg,
        "<rect x=\"{x}\" y=\"{y}\" width=\"{}\" height=\"{}\" fill=\"{}\" stroke=\"white\"><title>{}</title></rect>\
         <text x=\"{}\" y=\"{}\" text-anchor=\"middle\" pointer-events=\"none\">{mark}</text>",
        CELL.0,
        CELL.1,
        FILL[usize::from(cell.grade())],
        text(cell.reason()),
        x + CELL.0 / 2,
        y + 14
    );
}

/// Letter of a reason: a, b … z, a1, b1 …
fn letter(at: usize) -> String {
    let first = char::from(b'a' + (at % 26) as u8);
    if at < 26 { first.to_string() } else { format!("{first}{}", at / 26) }
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
    fn a_mark_better_in_both_beats() {
        let mark = |method: &str, cost, error| Mark { method: method.into(), cost, error };
        let marks = vec![mark("a", 1.0, 9.0), mark("b", 2.0, 2.0), mark("c", 3.0, 3.0), mark("d", 1.0, f64::NAN)];
        let chart = Chart { marks, ..Chart::default() };
        assert_eq!(["a", "b", "c"].map(|name| chart.beaten(name)), [0, 0, 1]);
        assert_eq!((chart.beaten("d"), chart.beaten("none")), (usize::MAX, usize::MAX));
    }

    #[test]
    fn a_map_letters_each_reason_once() {
        let fails = |why: &str| Outcome::Fails(why.into());
        let map = Map {
            title: "t".into(),
            columns: vec!["1".into(), "2".into()],
            rows: vec!["r".into(), "s".into()],
            cells: vec![vec![Outcome::Works, fails("falls through")], vec![fails("falls through"), fails("shakes")]],
            lines: vec![("bound".into(), vec![(0.0, 1.0), (9.0, 0.5)])],
            ..Map::default()
        };
        let svg = map.svg();
        assert_eq!(svg.matches(">a</text>").count(), 2, "{svg}");
        assert!(svg.contains("<b>b</b> shakes") && svg.contains("polyline"));
        assert_eq!((Outcome::Works.grade(), letter(27)), (0, "b1".to_string()));
    }
}
