//! Writes `device.html`: the results of a device test on one self-contained page.

use crate::device_test::measured::{Measured, Sample};
use crate::device_test::trial::Part;
use crate::report::chart::{Curve, histogram, over_time, traces};
use crate::report::page::{STYLE, escaped, rows, table};
use crate::run::Times;

/// Builds the page.
pub fn html(found: &Measured, samples: &[Sample]) -> Result<String, String> {
    let title = format!("Trepan: test of {}", escaped(&found.device));
    let head = "<!doctype html><html lang=\"en\"><head><meta charset=\"utf-8\"><meta name=\"viewport\" content=\"width=device-width\">";
    let mut page = format!("{head}<title>{title}</title><style>{STYLE}</style></head><body><h1>{title}</h1>");
    page += &format!("<p>{}</p><ul>", escaped(&found.model));
    for finding in &found.findings {
        let class = if finding.good { "" } else { " class=\"w\"" };
        page += &format!("<li{class}>{}</li>", escaped(&finding.text));
    }
    page += "</ul>";
    for (caption, svg) in charts(samples, found.timing.asked_hz)? {
        page += &format!("<figure>{svg}<figcaption>{caption}</figcaption></figure>");
    }
    page += "<h2>Numbers</h2>";
    let value = serde_json::to_value(found).map_err(|fault| format!("device.json: {fault}"))?;
    let mut numbers = Vec::new();
    rows("", &value, &mut numbers);
    table(&mut page, &numbers);
    page += "</body></html>\n";
    Ok(page)
}

fn charts(samples: &[Sample], asked_hz: f64) -> Result<Vec<(&'static str, String)>, String> {
    let over = |name, value: &dyn Fn(&Sample) -> f32| Curve {
        name,
        points: samples.iter().map(|s| (s.time_ms * 1e-3, f64::from(value(s)))).collect(),
    };
    let seen = |name, of: &dyn Fn(&Sample) -> (f32, f32)| Curve {
        name,
        points: samples.iter().map(of).map(|(x, y)| (f64::from(x), f64::from(y))).collect(),
    };
    let floor = samples.iter().filter(|s| s.part == Part::Floor);
    let pressed = Curve { name: "floor", points: floor.map(|s| (f64::from(s.tip.y), f64::from(s.force.y))).collect() };
    let mut gaps = Times::default();
    samples.windows(2).for_each(|pair| gaps.add_us(((pair[1].time_ms - pair[0].time_ms) * 1e3) as f32));
    Ok(vec![
        (
            "Path of the tip from the front: right and up",
            traces(["to the right, mm", "up, mm"], &[seen("tip", &|s| (s.tip.x, s.tip.y))])?,
        ),
        (
            "Path of the tip from the right: towards the user and up",
            traces(["towards you, mm", "up, mm"], &[seen("tip", &|s| (s.tip.z, s.tip.y))])?,
        ),
        ("Height of the tip", over_time("up, mm", &[over("tip", &|s| s.tip.y)], None)?),
        ("Force: at the floor, then of the taps", over_time("force, N", &[over("up", &|s| s.force.y)], None)?),
        ("Force at the floor over the height of the tip", traces(["up, mm", "force, N"], &[pressed])?),
        ("Tick period (dashed: requested)", histogram("tick period, µs", &gaps.bins(), 1e6 / asked_hz)?),
    ])
}
