//! Lays out a stability map for the page's template: cells, names, lines and lettered reasons.

use crate::picture::{Line, Map, Outcome};
use serde::Serialize;

/// Width and height of a cell, px.
const CELL: [usize; 2] = [34, 20];
/// Fill colours that also differ in lightness, to be distinguishable without colour.
const FILL: [&str; 4] = ["#d5efe6", "#f2cf74", "#d9744f", "#9aa5b1"];
const STROKE: [&str; 3] = ["#0072b2", "#000000", "#cc79a7"];

/// A map with the places of its parts, px from the upper left corner.
#[derive(Serialize)]
pub struct Figure<'a> {
    title: &'a str,
    x: &'a str,
    y: &'a str,
    width: usize,
    height: usize,
    cell: [usize; 2],
    /// Whether the columns' names stand slanted.
    slanted: bool,
    columns: Vec<Name<'a>>,
    rows: Vec<Name<'a>>,
    cells: Vec<Cell<'a>>,
    lines: Vec<Polyline<'a>>,
    notes: &'a [String],
    reasons: Vec<Reason<'a>>,
}

#[derive(Serialize)]
struct Name<'a> {
    x: usize,
    y: usize,
    text: &'a str,
}

#[derive(Serialize)]
struct Cell<'a> {
    x: usize,
    y: usize,
    fill: &'static str,
    reason: &'a str,
    letter: String,
}

#[derive(Serialize)]
struct Polyline<'a> {
    name: &'a str,
    colour: &'static str,
    points: String,
}

#[derive(Serialize)]
struct Reason<'a> {
    letter: String,
    text: &'a str,
}

impl<'a> Figure<'a> {
    /// Lays out a map.
    pub fn of(map: &'a Map) -> Self {
        let longest = |names: &[String]| names.iter().map(|name| name.chars().count()).max().unwrap_or(0);
        let widest = longest(&map.columns);
        let slanted = widest > 6;
        let left = 8 + 7 * longest(&map.rows).max(4);
        let top = if slanted { 30 + 6 * widest } else { 36 };
        let own = left + CELL[0] * map.columns.len() + 8 + if slanted { 4 * widest } else { 0 };
        let reasons = reasons(map);
        let column = |(at, text)| Name { x: left + CELL[0] * at + CELL[0] / 2, y: top - 6, text };
        let row = |(at, text)| Name { x: left - 5, y: top + CELL[1] * at + 14, text };
        let cell = |(at, (column, cell)): (usize, (usize, &'a Outcome))| Cell {
            x: left + CELL[0] * column,
            y: top + CELL[1] * at,
            fill: FILL[usize::from(cell.grade())],
            reason: cell.reason(),
            letter: reasons.iter().position(|reason| *reason == cell.reason()).map(letter).unwrap_or_default(),
        };
        let cells = map.cells.iter().enumerate();
        let cells = cells.flat_map(|(at, cells)| cells.iter().enumerate().map(move |cell| (at, cell)));
        let place = |&(x, y): &(f64, f64)| {
            let (x, y) = (x.clamp(0.0, map.columns.len() as f64), y.clamp(0.0, map.rows.len() as f64));
            format!("{:.1},{:.1}", left as f64 + x * CELL[0] as f64, top as f64 + y * CELL[1] as f64)
        };
        let line = |(at, (name, points)): (usize, &'a Line)| Polyline {
            name,
            colour: STROKE[at % STROKE.len()],
            points: points.iter().map(place).collect::<Vec<_>>().join(" "),
        };
        Self {
            title: &map.title,
            x: &map.x,
            y: &map.y,
            width: own.max(8 * map.title.len().max(map.x.len() + map.y.len() + 8)),
            height: top + CELL[1] * map.rows.len() + 20,
            cell: CELL,
            slanted,
            columns: map.columns.iter().map(String::as_str).enumerate().map(column).collect(),
            rows: map.rows.iter().map(String::as_str).enumerate().map(row).collect(),
            cells: cells.map(cell).collect(),
            lines: map.lines.iter().enumerate().map(line).collect(),
            notes: &map.notes,
            reasons: reasons.iter().enumerate().map(|(at, text)| Reason { letter: letter(at), text }).collect(),
        }
    }
}

/// Distinct reasons in order of appearance.
fn reasons(map: &Map) -> Vec<&str> {
    let mut found = Vec::new();
    for reason in map.cells.iter().flatten().map(Outcome::reason) {
        if !reason.is_empty() && !found.contains(&reason) {
            found.push(reason);
        }
    }
    found
}

/// Letter of a reason: a, b … z, a1, b1 …
fn letter(at: usize) -> String {
    let first = char::from(b'a' + (at % 26) as u8);
    if at < 26 { first.to_string() } else { format!("{first}{}", at / 26) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_map_letters_each_reason_once() {
        let fails = |why: &str| Outcome::Fails(why.into());
        let map = Map {
            columns: vec!["1".into(), "2".into()],
            rows: vec!["r".into(), "s".into()],
            cells: vec![vec![Outcome::Works, fails("falls through")], vec![fails("falls through"), fails("shakes")]],
            lines: vec![("bound".into(), vec![(0.0, 1.0), (9.0, 0.5)])],
            ..Map::default()
        };
        let figure = Figure::of(&map);
        let letters: Vec<&str> = figure.cells.iter().map(|cell| cell.letter.as_str()).collect();
        assert_eq!(letters, ["", "a", "a", "b"]);
        assert_eq!((figure.reasons[1].text, figure.reasons.len()), ("shakes", 2));
        assert_eq!(figure.lines[0].points, "36.0,56.0 104.0,46.0", "clamped to the cells");
        assert_eq!(letter(27), "b1");
    }
}
