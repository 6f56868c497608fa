//! The judgement over all scenes: how often choices meet their tolerances, and at what cost over
//! the cheapest.
//!
//! # Theory
//! A scene asks for three tolerances. One that no choice meets in time on the scene's machine is
//! left out of its scene and counted: there the plan must say so. Apart from scenes, what the plan
//! says is held against what its choices do: a tolerance that it doubts, and misses though some
//! other choice meets it, is a miss but no broken word.

use std::collections::BTreeMap;
use trepan_evidence::part::Scope;
use trepan_evidence::picture::{Chart, Mark};
use trepan_evidence::suite::{Findings, Gate, Row};
use trepan_evidence::timer::Samples;
use trepan_evidence::worst::{self, Rank};

const KINDS: [&str; 3] = ["bone", "tissue", "picture"];
const METHODS: [&str; 5] = ["auto", "draft", "usual", "fine", "cheapest"];
/// Scenes under which a share of them says nothing.
const MANY: usize = 50;

/// What one method did for one kind in one scene.
#[derive(Clone, Copy, Debug, Default)]
struct Did {
    /// Error over tolerance.
    error: f64,
    cost: f64,
    in_time: bool,
    /// Whether it said that it would meet the tolerance.
    claims_met: bool,
}

impl Did {
    fn met(&self) -> bool {
        self.error <= 1.0 && self.in_time
    }
}

/// One scene: kind and method.
type Scene = BTreeMap<(String, String), Did>;

/// Summary rows, gates and the chart.
pub fn judge(scope: Scope, findings: &mut Findings) {
    let scenes = scenes(&findings.rows);
    if scenes.is_empty() {
        return;
    }
    for kind in KINDS {
        let row = summary(&scenes, &[kind], &format!("all scenes, {kind}"), findings);
        findings.rows.extend(row);
    }
    let row = summary(&scenes, &KINDS, "all scenes", findings);
    findings.rows.extend(row);
    gates(&scenes, findings);
    // Tolerances that some choice meets.
    let is_possible = |row: &&Row| {
        let kind = row.config.get("kind").and_then(|kind| kind.as_str()).unwrap_or_default();
        let name = row.scene.strip_suffix(&format!(", {kind}")).unwrap_or_default();
        scenes.get(&format!("{}, {name}", row.part)).is_some_and(|scene| did(scene, kind, "cheapest").is_some())
    };
    let own: Vec<&Row> = findings.rows.iter().filter(|row| row.method == "auto").filter(is_possible).collect();
    let worst = worst::table("budget", scope, &own, &[Rank { metric: "error_over_tolerance", low_is_bad: false }]);
    findings.tables.push(worst);
}

/// What the rows say, by part and scene.
fn scenes(rows: &[Row]) -> BTreeMap<String, Scene> {
    let mut scenes: BTreeMap<String, Scene> = BTreeMap::new();
    for row in rows {
        let Some(kind) = row.config.get("kind").and_then(|kind| kind.as_str()) else { continue };
        let Some(name) = row.scene.strip_suffix(&format!(", {kind}")) else { continue };
        let metric = |name: &str| row.metrics.get(name).copied().unwrap_or(f64::NAN);
        let did = Did {
            error: metric("error_over_tolerance"),
            cost: metric("cost_cores"),
            in_time: metric("in_time_count") > 0.5,
            claims_met: metric("says_met_count") > 0.5,
        };
        let scene = scenes.entry(format!("{}, {name}", row.part)).or_default();
        scene.insert((kind.into(), row.method.clone()), did);
    }
    scenes
}

fn did(scene: &Scene, kind: &str, method: &str) -> Option<Did> {
    scene.get(&(kind.to_string(), method.to_string())).copied()
}

/// The kinds of which some choice meets the tolerance.
fn possible<'a>(scene: &Scene, kinds: &[&'a str]) -> Vec<&'a str> {
    kinds.iter().copied().filter(|kind| did(scene, kind, "cheapest").is_some()).collect()
}

/// Share of scenes that meet every tolerance that some choice meets, and cost over the cheapest
/// there.
fn summary(scenes: &BTreeMap<String, Scene>, kinds: &[&str], name: &str, findings: &mut Findings) -> Vec<Row> {
    let scenes: Vec<(&Scene, Vec<&str>)> = scenes.values().map(|scene| (scene, possible(scene, kinds))).collect();
    let scenes: Vec<_> = scenes.into_iter().filter(|(_, kinds)| !kinds.is_empty()).collect();
    let cost = |(scene, kinds): &(&Scene, Vec<&str>), method: &str| {
        kinds.iter().filter_map(|kind| did(scene, kind, method)).map(|d| d.cost).sum::<f64>()
    };
    let total = |method: &str| scenes.iter().map(|scene| cost(scene, method)).sum::<f64>();
    let mut marks = Vec::new();
    let row = |method: &&str| {
        let met = |(scene, kinds): &&(&Scene, Vec<&str>)| {
            kinds.iter().all(|kind| did(scene, kind, method).is_some_and(|d| d.met()))
        };
        let share = 100.0 * scenes.iter().filter(met).count() as f64 / scenes.len() as f64;
        let ratios: Samples = scenes.iter().map(|s| cost(s, method) / cost(s, "cheapest")).collect::<Vec<_>>().into();
        let ratio = total(method) / total("cheapest");
        marks.push(Mark { method: (*method).into(), cost: ratio, error: 100.0 - share });
        Row::new(name, *method)
            .with("scenes", scenes.len())
            .metric("met_percent", share)
            .metric("cost_over_cheapest", ratio)
            .metric("cost_over_cheapest_p50", ratios.quantile(0.5))
            .metric("cost_over_cheapest_p95", ratios.quantile(0.95))
            .metric("cost_over_cheapest_worst", ratios.quantile(1.0))
    };
    let rows = METHODS.iter().map(row).collect();
    findings.charts.push(Chart {
        title: format!("Scenes that miss a tolerance over cost: {name}"),
        cost: "cost_over_cheapest".into(),
        error: "missed_percent".into(),
        marks,
        ..Chart::default()
    });
    rows
}

fn gates(scenes: &BTreeMap<String, Scene>, findings: &mut Findings) {
    let auto = |scene: &Scene| {
        possible(scene, &KINDS).into_iter().filter_map(|kind| did(scene, kind, "auto")).collect::<Vec<_>>()
    };
    // Tolerances that no choice meets, and what the plan says of its own.
    let hopeless = |kind: &&str| {
        let of = |scene: &Scene| did(scene, kind, "cheapest").is_none().then(|| did(scene, kind, "auto")).flatten();
        scenes.values().filter_map(of).map(|auto| auto.claims_met).collect::<Vec<_>>()
    };
    // What the plan says that its choices meet, and whether they do.
    let each = scenes.values().flat_map(|scene| KINDS.iter().filter_map(|kind| did(scene, kind, "auto")));
    let promised: Vec<bool> = each.filter(|auto| auto.claims_met).map(|auto| auto.met()).collect();
    let kept = 100.0 * promised.iter().filter(|met| **met).count() as f64 / promised.len().max(1) as f64;
    let claims_met: Vec<bool> = KINDS.iter().flat_map(hopeless).collect();
    let silent =
        100.0 * claims_met.iter().filter(|claims_met| **claims_met).count() as f64 / claims_met.len().max(1) as f64;
    let worst = scenes.values().flat_map(auto).map(|did| did.error).fold(0.0, f64::max);
    let summary = |metric: &str| {
        let row = findings.rows.iter().rev().find(|row| row.scene == "all scenes" && row.method == "auto");
        row.and_then(|row| row.metrics.get(metric).copied()).unwrap_or(f64::NAN)
    };
    let count = scenes.len();
    let mut gates = vec![Gate::at_most(
        "tolerances that no choice meets in time, of which the plan says that its does, percent",
        silent,
        5.0,
    )];
    if count < MANY {
        gates.push(Gate::at_most(format!("auto: worst error over tolerance in {count} scenes"), worst, 2.0));
    } else {
        let met = summary("met_percent");
        gates.push(Gate::at_least(
            format!("auto: scenes of {count} that meet every tolerance that some choice meets, percent"),
            met,
            95.0,
        ));
        let ratio = summary("cost_over_cheapest");
        gates.push(Gate::at_most("auto: cost of all scenes over that of the cheapest choices", ratio, 1.25));
        let name = "auto: tolerances that the plan says its choice meets, of which it does, percent";
        gates.push(Gate::at_least(name, kept, 95.0));
    }
    findings.gates.extend(gates);
}
