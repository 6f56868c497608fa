//! `measure`: measures this machine's graphics card with Trepan's kernels, from a folder that needs
//! nothing installed but a Vulkan driver (`cargo xtask bundle gpu`).

use anyhow::{Context, Result, bail};
use clap::Parser;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::{Duration, Instant};
use trepan_evidence::files::whole;
use trepan_evidence::part::Scope;
use trepan_evidence::report::{Making, Report};
use trepan_evidence::suite::Gate;
use trepan_evidence::{limits, page};
use trepan_gpu::{Gpu, GpuError, Prefer};
use trepan_trials::suites::ON_REQUEST;

/// No further part is begun after this time.
const PATIENCE: Duration = Duration::from_secs(7 * 60);

#[derive(Parser)]
#[command(about = "Measure a graphics card: tissue, pictures, agreement; writes one JSON and one page", version)]
struct Arguments {
    /// Fewer and smaller scenes
    #[arg(long)]
    quick: bool,
    /// Take a software driver too, for its agreement alone
    #[arg(long)]
    software: bool,
    /// Run only these parts [default: all]
    parts: Vec<String>,
    /// Folder for card.json and card.html
    #[arg(long, value_name = "DIR", default_value = "measured")]
    out: PathBuf,
}

fn main() -> ExitCode {
    match run(&Arguments::parse()) {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::from(2),
        Err(fault) => {
            eprintln!("measure: {fault:#}");
            ExitCode::FAILURE
        }
    }
}

/// Whether every limit that was judged is met.
fn run(given: &Arguments) -> Result<bool> {
    let found = match Gpu::open(Prefer::Hardware) {
        Ok(gpu) => gpu,
        Err(GpuError::NoAdapter) => bail!(
            "no Vulkan driver was found: install the card's driver, or name its file, as in \
             VK_DRIVER_FILES=/usr/share/vulkan/icd.d/nvidia_icd.json ./measure"
        ),
        Err(fault) => return Err(fault.into()),
    };
    println!("{} {}", found.name(), found.driver());
    if found.is_software() && !given.software {
        bail!("this is a software driver, which says nothing of a card: give --software to check its agreement only");
    }
    let suite = ON_REQUEST.iter().find(|suite| suite.name == "card").context("the suite is listed")?;
    let (scope, start) = (Scope { quick: given.quick, seed: 1 }, Instant::now());
    let mut making = Making::here(scope);
    making.machine.insert("graphics card".into(), format!("{}, {}", found.name(), found.driver()));
    let mut parts = Vec::new();
    for part in (suite.parts)(scope) {
        let name = part.slug();
        if !given.parts.is_empty() && !given.parts.contains(&name) {
            continue;
        }
        if start.elapsed() > PATIENCE {
            println!("{name}: left out, since {} s have passed", PATIENCE.as_secs());
            continue;
        }
        let begun = Instant::now();
        let (findings, _) = part.run(scope);
        println!("{name}: {:.1} s", begun.elapsed().as_secs_f64());
        parts.push((name, making.clone(), findings));
    }
    let report = Report::of(suite, parts).context("no part of that name: see the page of a whole run")?;
    for table in &report.findings.tables {
        println!("\n{}", table.columns.join(" | "));
        table.rows.iter().for_each(|row| println!("{}", row.join(" | ")));
    }
    println!();
    for gate in &report.findings.gates {
        let word = if gate.pass { "met" } else { "MISSED" };
        println!("{word}: {}: {:.4} ({} {})", gate.name, gate.value, gate.op, gate.limit);
    }
    std::fs::create_dir_all(&given.out).with_context(|| given.out.display().to_string())?;
    whole(&given.out.join("card.json"), &serde_json::to_vec_pretty(&report)?)?;
    let met = !report.findings.gates.iter().any(Gate::breaks);
    let gaps = limits::known_gaps(suite.name, scope, &report.findings.gates);
    gaps.iter().for_each(|gap| println!("KNOWN GAP {gap}"));
    let page = given.out.join("card.html");
    whole(&page, page::html(&[(suite, report)], &[(); 0])?.as_bytes())?;
    println!("page: {}", page.display());
    Ok(met)
}
