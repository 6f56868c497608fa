//! Writes charts of a validation as SVG files, for a page of your own.
//!
//! `cargo run --release -p trepan-trials --example charts -- target/validation OUT [SUITE
//! TITLE-BEGINS]...`; without names, the three charts of the top README.

use std::path::Path;
use trepan_evidence::files::whole;
use trepan_evidence::plot;
use trepan_evidence::store::report;
use trepan_trials::suites::ALL;

const OF_README: [(&str, &str); 3] = [
    ("rigid", "The thesis's skulls, touch: whole tick against gap"),
    ("tled", "A block hangs down"),
    ("operation", ""),
];

fn main() -> anyhow::Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [from, out, named @ ..] = &arguments[..] else {
        anyhow::bail!("name the folder of a validation and one for the charts, as in target/validation charts");
    };
    let named: Vec<(&str, &str)> = named.chunks_exact(2).map(|pair| (&*pair[0], &*pair[1])).collect();
    for (suite, title) in if named.is_empty() { OF_README.to_vec() } else { named } {
        anyhow::ensure!(ALL.iter().any(|known| known.name == suite), "there is no suite {suite:?}");
        let Some(report) = report(Path::new(from), suite)? else {
            anyhow::bail!("{from} holds no {suite}.json: run cargo xtask validate {suite}");
        };
        let Some(chart) = report.findings.charts.iter().find(|chart| chart.title.starts_with(title)) else {
            anyhow::bail!("{suite} has no chart that begins with {title:?}");
        };
        let methods: Vec<&str> = chart.marks.iter().map(|mark| mark.method.as_str()).collect();
        let mut each: Vec<&str> = Vec::new();
        methods.iter().for_each(|name| {
            if !each.contains(name) {
                each.push(name)
            }
        });
        let svg = plot::svg(chart, &each).map_err(|fault| anyhow::anyhow!("{fault}"))?;
        let file = Path::new(out).join(format!("chart-{suite}.svg"));
        whole(&file, svg.as_bytes())?;
        println!("{}: {}", file.display(), chart.title);
    }
    Ok(())
}
