//! Report of one suite: its parts with commit and machine, and their joint findings.

use crate::part::{Part, Scope, Suite};
use crate::suite::{Findings, Gate};
use crate::{borders, limits};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Provenance of a part.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Making {
    /// Commit of the sources, or `unknown`.
    pub commit: String,
    /// Properties of the machine by name.
    pub machine: BTreeMap<String, String>,
    /// Whether the run was a quick one.
    pub quick: bool,
    /// Seed of the run.
    pub seed: u64,
}

impl Making {
    /// Provenance of a part made now, on this machine.
    pub fn here(scope: Scope) -> Self {
        Self { commit: commit(), machine: machine(), quick: scope.quick, seed: scope.seed }
    }

    /// Scope of the run.
    pub fn scope(&self) -> Scope {
        Scope { quick: self.quick, seed: self.seed }
    }
}

/// Content of a suite's JSON file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Report {
    /// Name of the suite.
    pub suite: String,
    /// Command that reproduces it.
    pub command: String,
    /// Provenance of the first part.
    #[serde(flatten)]
    pub making: Making,
    /// Machines of the parts that were made elsewhere, by part.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub elsewhere: BTreeMap<String, BTreeMap<String, String>>,
    /// Findings of all parts.
    #[serde(flatten)]
    pub findings: Findings,
}

impl Report {
    /// Combines parts in the order of the suite and judges them. `None` without any part.
    pub fn of(suite: &Suite, parts: Vec<(String, Making, Findings)>) -> Option<Self> {
        let making = parts.first()?.1.clone();
        let away = parts.iter().filter(|(_, made, _)| made.machine != making.machine);
        let elsewhere = away.map(|(name, made, _)| (name.clone(), made.machine.clone())).collect();
        let mut findings = Findings::default();
        parts.into_iter().for_each(|(_, _, found)| findings.append(found));
        (suite.judge)(making.scope(), &mut findings);
        borders::judge(suite.name, making.scope(), &mut findings);
        limits::judge(suite.name, making.scope(), &mut findings);
        let quick = if making.quick { " --quick" } else { "" };
        let seed = if making.seed == 1 { String::new() } else { format!(" --seed {}", making.seed) };
        let command = format!("cargo xtask validate {}{quick}{seed}", suite.name);
        Some(Self { suite: suite.name.into(), command, making, elsewhere, findings })
    }

    /// Whether every acceptance limit is met.
    pub fn passed(&self) -> bool {
        !self.findings.gates.iter().any(Gate::breaks)
    }
}

/// File names of a suite's parts.
pub fn slugs(suite: &Suite, scope: Scope) -> Vec<String> {
    (suite.parts)(scope).iter().map(Part::slug).collect()
}

fn commit() -> String {
    let describe = ["-C", env!("CARGO_MANIFEST_DIR"), "describe", "--always", "--dirty", "--abbrev=12"];
    let out = std::process::Command::new("git").args(describe).output();
    let described =
        out.ok().filter(|out| out.status.success()).map(|out| String::from_utf8_lossy(&out.stdout).trim().to_string());
    described.unwrap_or_else(|| "unknown".into())
}

fn machine() -> BTreeMap<String, String> {
    let cpuinfo = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let cpu =
        cpuinfo.lines().find_map(|line| line.strip_prefix("model name")?.split_once(':')).map(|(_, name)| name.trim());
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let known = [
        ("cpu", cpu.unwrap_or("unknown").to_string()),
        ("cores", cores.to_string()),
        ("caches", caches()),
        ("frequency", content(&format!("{CPU}/cpufreq/scaling_governor")).unwrap_or("not said by the system".into())),
        (
            "memory",
            content("/proc/meminfo").map_or("unknown".into(), |text| text.lines().next().map_or("", total).into()),
        ),
        ("system", format!("{} {}", std::env::consts::OS, std::env::consts::ARCH)),
        ("profile", if cfg!(debug_assertions) { "dev" } else { "release" }.to_string()),
    ];
    known.map(|(name, value)| (name.to_string(), value)).into()
}

/// Folder in which Linux describes the first core.
const CPU: &str = "/sys/devices/system/cpu/cpu0";

fn content(file: &str) -> Option<String> {
    std::fs::read_to_string(file).ok().map(|text| text.trim().to_string())
}

fn total(line: &str) -> &str {
    line.split_once(':').map_or(line, |(_, size)| size.trim())
}

/// Levels and sizes of the first core's caches.
fn caches() -> String {
    let of = |index: usize| {
        let word = |what: &str| content(&format!("{CPU}/cache/index{index}/{what}"));
        Some(format!("L{} {} {}", word("level")?, word("type")?.to_lowercase(), word("size")?))
    };
    let all: Vec<String> = (0..8).map_while(of).collect();
    if all.is_empty() { "not said by the system".into() } else { all.join(", ") }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::part::nothing_more;
    use crate::suite::{Gate, Row};

    #[test]
    fn the_file_has_the_documented_fields_and_reads_back() {
        let suite = Suite {
            name: "s",
            question: "q",
            chart: ("a_us", "b_mm"),
            parts: |_| {
                let make = |_, findings: &mut Findings| {
                    findings
                        .rows
                        .push(Row::new("plane", "thesis").with("points", 466).metric("depth_error_voxel", 0.1));
                    findings.gates.push(Gate::at_most("depth", 0.1, 0.05));
                };
                vec![Part::new("one", make)]
            },
            judge: nothing_more,
        };
        let scope = Scope { quick: true, seed: 2 };
        let part = (suite.parts)(scope).remove(0);
        let parts = vec![(part.slug(), Making::here(scope), part.run(scope).0)];
        let report = Report::of(&suite, parts).unwrap();
        assert!(!report.passed() && report.command == "cargo xtask validate s --quick --seed 2");
        let json = serde_json::to_value(&report).unwrap();
        for field in [
            "/suite",
            "/commit",
            "/machine/cpu",
            "/seed",
            "/rows/0/config/points",
            "/rows/0/metrics/depth_error_voxel",
            "/gates/0/op",
        ] {
            assert!(json.pointer(field).is_some(), "{field} is missing");
        }
        assert_eq!(serde_json::from_value::<Report>(json).unwrap(), report);
        assert!(Report::of(&suite, Vec::new()).is_none());
    }
}
