//! Maps of wall stability: stiffness by delay and damping, one map for each device, hand and way of
//! guarding, with theoretical bounds.

use trepan_evidence::picture::{Map, Outcome};
use trepan_evidence::suite::Row;

/// Ways of guarding: key in the row and name in the title.
const WAYS: [(&str, &str); 3] = [("unguarded", "bare"), ("guarded", "guarded"), ("limited", "guarded and limited")];

/// One map for each device, hand and way; bare walls first.
pub fn of(rows: &[Row]) -> Vec<Map> {
    let presses: Vec<&Row> = rows.iter().filter(|row| row.metrics.contains_key("limit_cycle_mm")).collect();
    let mut pairs: Vec<(&str, &str)> = Vec::new();
    for pair in presses.iter().map(|row| (text(row, "device"), text(row, "hand"))) {
        if !pairs.contains(&pair) {
            pairs.push(pair);
        }
    }
    let of_pair = |&(device, hand): &(&str, &str)| {
        let rows: Vec<&Row> =
            presses.iter().copied().filter(|row| (text(row, "device"), text(row, "hand")) == (device, hand)).collect();
        WAYS.map(|(method, words)| map(format!("{device}, {hand}: {words}"), method, &rows))
    };
    pairs.iter().flat_map(of_pair).collect()
}

fn map(title: String, method: &str, rows: &[&Row]) -> Map {
    let stiffnesses = values(rows, |row| number(row, "stiffness_n_per_mm"));
    let lines = values(rows, |row| 100.0 * number(row, "delay_ticks") + number(row, "damping_n_ms_per_mm"));
    let at = |line: f64, stiffness: f64, method: &str| {
        rows.iter().find(|row| {
            row.method == method
                && number(row, "stiffness_n_per_mm") == stiffness
                && 100.0 * number(row, "delay_ticks") + number(row, "damping_n_ms_per_mm") == line
        })
    };
    // A wall within the device's limit is not limited: its row is the guarded one.
    let cell = |line, stiffness| at(line, stiffness, method).or_else(|| at(line, stiffness, "guarded"));
    let bound = |name: &str| {
        let of_line = |(place, &line): (usize, &f64)| {
            let bound = at(line, stiffnesses[0], "guarded").map_or(0.0, |row| row.metrics[name]);
            let x = column(&stiffnesses, bound);
            [(x, place as f64), (x, place as f64 + 1.0)]
        };
        lines.iter().enumerate().flat_map(of_line).collect()
    };
    Map {
        title,
        x: "stiffness, N/mm".into(),
        y: "ticks late, damping in N ms/mm".into(),
        columns: stiffnesses.iter().map(|k| format!("{k:.1}")).collect(),
        rows: lines.iter().map(|line| format!("{}, {:.1}", (line / 100.0).floor(), line % 100.0)).collect(),
        cells: lines
            .iter()
            .map(|&line| {
                stiffnesses.iter().map(|&k| cell(line, k).map_or(Outcome::Works, |row| outcome(row))).collect()
            })
            .collect(),
        lines: vec![
            ("Gil: stable".into(), bound("gil_n_per_mm")),
            ("Colgate: passive".into(), bound("colgate_n_per_mm")),
        ],
        notes: notes(method),
    }
}

fn notes(method: &str) -> Vec<String> {
    let limited =
        "Columns are walls as wanted; given is no more than the device's delay, mass and damping bear, as in sessions.";
    let promised = "Promised: light and firm grip, to 2 N/mm, encoder steps that the device's friction covers.";
    match method {
        "limited" => vec![limited.into(), promised.into()],
        "guarded" => vec![promised.into()],
        _ => Vec::new(),
    }
}

/// Outcome of a press.
fn outcome(row: &Row) -> Outcome {
    let metric = |name: &str| row.metrics[name];
    if metric("limit_cycle_mm") > 0.1 && metric("limit_cycle_growth") < 0.8 {
        Outcome::Degrades("rings, and dies away".into())
    } else if metric("limit_cycle_mm") > 1.0 {
        Outcome::Fails("swings by more than 1 mm".into())
    } else if metric("limit_cycle_mm") > 0.1 {
        Outcome::Fails("swings by 0.1 to 1 mm".into())
    } else if metric("energy_out_j") > 1e-4 {
        Outcome::Fails("gives the hand more than 0.1 mJ".into())
    } else if metric("steady_force_lost_percent") > 5.0 {
        Outcome::Degrades("more than 5 % of the force is lost".into())
    } else if metric("motor_energy_out_j") > 1e-4 {
        Outcome::Degrades("the motors give more than 0.1 mJ, the device's friction takes it".into())
    } else {
        Outcome::Works
    }
}

/// Position of a stiffness on the column axis, where column centres are the given stiffnesses;
/// logarithmic in between.
fn column(stiffnesses: &[f64], bound: f64) -> f64 {
    let after = stiffnesses.partition_point(|k| *k < bound);
    match (after.checked_sub(1).map(|at| stiffnesses[at]), stiffnesses.get(after)) {
        (Some(low), Some(high)) => after as f64 - 0.5 + (bound / low).ln() / (high / low).ln(),
        (None, _) => 0.0,
        (_, None) => stiffnesses.len() as f64,
    }
}

fn values(rows: &[&Row], of: impl Fn(&Row) -> f64) -> Vec<f64> {
    let mut found: Vec<f64> = rows.iter().map(|row| of(row)).collect();
    found.sort_by(f64::total_cmp);
    found.dedup();
    found
}

/// Setting rounded to four decimals, to hide single-precision digits.
fn number(row: &Row, name: &str) -> f64 {
    (row.config[name].as_f64().unwrap_or(f64::NAN) * 1e4).round() / 1e4
}

fn text<'a>(row: &'a Row, name: &str) -> &'a str {
    row.config[name].as_str().unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn press(method: &str, stiffness: f64, delay: u32, cycle_mm: f64) -> Row {
        Row::new("bench", method)
            .with("device", "Touch")
            .with("hand", "light grip")
            .with("stiffness_n_per_mm", stiffness)
            .with("delay_ticks", delay)
            .with("damping_n_ms_per_mm", 0.5)
            .metric("limit_cycle_mm", cycle_mm)
            .metric("limit_cycle_growth", 1.0)
            .metric("energy_out_j", 0.0)
            .metric("motor_energy_out_j", 0.0)
            .metric("steady_force_lost_percent", 0.0)
            .metric("gil_n_per_mm", 2.0)
            .metric("colgate_n_per_mm", 0.0)
    }

    #[test]
    fn cells_lie_where_their_rows_say_and_bounds_between_them() {
        let mut rows = Vec::new();
        for (delay, stiffness, cycle_mm) in [(0, 1.0, 0.0), (0, 4.0, 0.5), (1, 1.0, 0.0), (1, 4.0, 2.0)] {
            rows.push(press("unguarded", stiffness, delay, cycle_mm));
            rows.push(press("guarded", stiffness, delay, 0.0));
        }
        let maps = of(&rows);
        let grades =
            |map: &Map| map.cells.iter().map(|row| row.iter().map(Outcome::grade).collect()).collect::<Vec<Vec<_>>>();
        assert_eq!(maps.iter().map(grades).collect::<Vec<_>>(), [[[0, 2], [0, 2]], [[0, 0], [0, 0]], [[0, 0], [0, 0]]]);
        assert_eq!((maps[0].columns.clone(), maps[0].rows[1].as_str()), (vec!["1.0".into(), "4.0".into()], "1, 0.5"));
        assert!((maps[0].lines[0].1[0].0 - 1.0).abs() < 1e-9, "2 lies half-way from 1 to 4 by its logarithm");
        assert_eq!(maps[0].lines[1].1[3], (0.0, 2.0));
    }
}
