//! Writes `device.html`: the results of a device test on one self-contained page.

use crate::ReportError;
use crate::chart::{Chart, Curve, histogram, over_time, traces};
use crate::device_test::measured::{Measured, Sample};
use crate::device_test::trial::Part;
use crate::page::{Table, render, rows};
use serde_json::json;
use trepan_runtime::Times;

/// Builds the page.
pub(super) fn html(found: &Measured, samples: &[Sample]) -> Result<String, ReportError> {
    let context = json!({
        "title": format!("Trepan: test of {}", found.device),
        "found": found,
        "charts": charts(samples, found.timing.asked_hz)?,
        "tables": [Table { title: "Numbers", rows: rows("device.json", found)? }],
    });
    render("device.html", &context)
}

fn charts(samples: &[Sample], asked_hz: f64) -> Result<[Chart; 6], ReportError> {
    let over = |name, value: fn(&Sample) -> f32| Curve::over_time(name, samples, |s| (s.time_ms, value(s)));
    let of = |name, part: Option<Part>, point: fn(&Sample) -> (f32, f32)| {
        let points = samples.iter().filter(|s| part.is_none_or(|part| s.part == part)).map(point);
        Curve { name, points: points.map(|(x, y)| (f64::from(x), f64::from(y))).collect() }
    };
    let front = [of("tip", None, |s| (s.tip.x, s.tip.y))];
    let side = [of("tip", None, |s| (s.tip.z, s.tip.y))];
    let pressed = [of("floor", Some(Part::Floor), |s| (s.tip.y, s.force.y))];
    let [height, force] = [over("tip", |s| s.tip.y), over("up", |s| s.force.y)];
    let mut gaps = Times::default();
    samples.windows(2).for_each(|pair| gaps.add_us(((pair[1].time_ms - pair[0].time_ms) * 1e3) as f32));
    let periods = histogram("tick period, µs", &gaps.bins(), 1e6 / asked_hz)?;
    Ok([
        Chart::new("Path of the tip from the front: right and up", traces(["to the right, mm", "up, mm"], &front)?),
        Chart::new(
            "Path of the tip from the right: towards the user and up",
            traces(["towards you, mm", "up, mm"], &side)?,
        ),
        Chart::new("Height of the tip", over_time("up, mm", &[height], None)?),
        Chart::new("Force: at the floor, then of the taps", over_time("force, N", &[force], None)?),
        Chart::new("Force at the floor over the height of the tip", traces(["up, mm", "force, N"], &pressed)?),
        Chart::new("Tick period (dashed: requested)", periods),
    ])
}
