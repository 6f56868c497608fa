//! Rivals as published: the stiffness that each shows at the hand, and what their papers claim
//! beside what is measured here.
//!
//! # Theory
//! A ball is pressed into a flat wall so slowly that nothing but the place counts. With force F at
//! penetration δ, the caller's spring k and the reference depth δ₀ = 0.5 mm
//! ```text
//! stiffness at the hand  F(δ₀)/δ₀ = k      asked of every rival that has a gain
//! slope                  dF/dδ at δ₀       k for a force in proportion to depth
//!                                          3/2 k for Hertz's, 2 k for a sum over vertices
//! ```
//! Both are means over twelve directions and places of the wall, since methods that count voxels
//! differ from one to the next. The gains are closed forms in the rivals' own files.
//!
//! # Practice
//! The thesis's two methods have no gain and stay as they are printed. The line has no thickness
//! and does not touch a wall so near. Friction and damping of He and Chen's method, which the
//! scenes' smooth bone has not, are measured beside the coefficients that they were given.
//!
//! The burrs of the other parts have radii of 1 to 4 mm: 2 to 8 mm across. Radii in the rivals'
//! papers were not to be read; open temporal-bone simulators take burrs of 1 to 6 mm across.

use super::solid::{RADIUS_MM, directions, held, voxels};
use super::{BUDGET_US, STIFFNESS};
use glam::DVec3;
use trepan_bone::BoneVolume;
use trepan_evidence::part::Part;
use trepan_evidence::picture::Table;
use trepan_evidence::suite::{Findings, Gate, Row};
use trepan_geometry::{Tool, Vec3};
use trepan_rigid::{Method, RigidContact, RigidStep};
use trepan_rivals::Family;
use trepan_rivals::rigid::{burr_and_shaft, centre_line, thesis};

/// Penetration at which stiffness is compared, mm.
const REFERENCE_MM: f32 = 0.5;
/// Half the way over which the slope is taken, mm.
const BESIDE_MM: f32 = 0.1;
/// Way of the slow hand in a tick, mm.
const SLOW_MM: f32 = 0.001;
/// Directions of the wall's normal.
const WALLS: usize = 12;
/// Most that a rival's stiffness may be off, percent.
const MOST_PERCENT: f64 = 15.0;
/// Scene of the stiffness.
const SCENE: &str = "flat wall, stiffness at the hand";
/// Time of a tick at 6000 Hz, µs.
const AT_6_KHZ_US: f64 = 1e6 / 6000.0;

/// Every method on the wall, and the friction.
pub fn parts() -> Vec<Part> {
    vec![
        Part::new("flat wall", |_, findings| {
            let walls = walls();
            let all = Method::all().into_iter().filter(|method| !method.descriptor().is_oracle);
            findings.rows.extend(all.map(|method| stiffness(&method, &walls)));
        }),
        Part::new("flat wall, friction and damping", |_, findings| findings.rows.push(friction())),
    ]
}

/// The limit on the stiffness, and the table of claims.
pub fn judge(findings: &mut Findings) {
    let plain = [Method::of(&thesis::METHOD), Method::of(&thesis::AS_PRINTED), Method::of(&centre_line::METHOD)];
    let has_gain = |row: &&Row| row.scene == SCENE && !plain.iter().any(|method| method.name() == row.method);
    let off = |row: &Row| 100.0 * (row.metrics["stiffness_n_per_mm"] / f64::from(STIFFNESS) - 1.0).abs();
    let gate = |row: &Row| {
        let limit = format!("{}: stiffness at 0.5 mm off k, percent", row.method);
        Gate::at_most(limit, off(row), MOST_PERCENT)
    };
    let gates: Vec<Gate> = findings.rows.iter().filter(has_gain).map(gate).collect();
    findings.gates.extend(gates);
    let table = table(&findings.rows);
    findings.tables.push(table);
}

/// A flat wall.
struct Wall {
    normal: Vec3,
    /// Where it is along the normal, mm: each at another place in its voxels.
    height_mm: f32,
    bone: BoneVolume,
}

fn walls() -> Vec<Wall> {
    const VOXEL_MM: f32 = 0.5;
    let wall = |(at, normal): (usize, Vec3)| {
        let height_mm = VOXEL_MM * ((at as f32 + 0.5) / WALLS as f32 - 0.5);
        let distance = |p: DVec3| p.dot(normal.as_dvec3()) - f64::from(height_mm);
        Wall { normal, height_mm, bone: voxels(40, VOXEL_MM.into(), distance) }
    };
    // In steps of five, so that neighbours in direction are none in height.
    let all = directions(WALLS);
    (0..WALLS).map(|at| wall((at, all[at * 5 % WALLS]))).collect()
}

/// A method pressed slowly into a wall.
struct Press<'a> {
    wall: &'a Wall,
    contact: Box<dyn RigidContact>,
    out: RigidStep,
}

impl<'a> Press<'a> {
    fn new(wall: &'a Wall, mut contact: Box<dyn RigidContact>) -> Self {
        let over = held(wall.normal * (wall.height_mm + RADIUS_MM + 1.0), wall.normal);
        contact.reset(over.world_from_tool);
        Self { wall, contact, out: RigidStep::default() }
    }

    /// Force at the hand, N, after a tick at `depth_mm`, `aside_mm` along the wall.
    fn force(&mut self, depth_mm: f32, aside_mm: f32) -> Vec3 {
        let Wall { normal, height_mm, bone } = self.wall;
        let aside = normal.any_orthonormal_vector() * aside_mm;
        let tool = held(normal * (height_mm + RADIUS_MM - depth_mm) + aside, *normal);
        self.contact.step(bone, &tool, false, 1.0, &mut self.out);
        STIFFNESS * self.out.manifold.depth_mm * self.out.manifold.normal
    }
}

fn stiffness(method: &Method, walls: &[Wall]) -> Row {
    let end_mm = REFERENCE_MM + BESIDE_MM;
    let (mut before, mut at, mut after) = (0.0, Vec::new(), 0.0);
    for wall in walls {
        let mut press = Press::new(wall, method.build(&Tool::burr(RADIUS_MM)));
        let ticks = ((1.0 + end_mm) / SLOW_MM).round() as i32;
        for tick in 0..=ticks {
            let depth_mm = SLOW_MM * tick as f32 - 1.0;
            let force = f64::from(press.force(depth_mm, 0.0).dot(wall.normal));
            let is = |mm: f32| (depth_mm - mm).abs() < 0.5 * SLOW_MM;
            before += if is(REFERENCE_MM - BESIDE_MM) { force } else { 0.0 };
            after += if is(end_mm) { force } else { 0.0 };
            if is(REFERENCE_MM) {
                at.push(force);
            }
        }
    }
    let count = walls.len() as f64;
    let per_mm = |force: f64| force / f64::from(REFERENCE_MM);
    let (low, high) = at.iter().fold((f64::MAX, f64::MIN), |(low, high), &f| (low.min(f), high.max(f)));
    Row::new(SCENE, method.name())
        .with("radius_mm", RADIUS_MM)
        .with("depth_mm", REFERENCE_MM)
        .with("walls", walls.len())
        .metric("stiffness_n_per_mm", per_mm(at.iter().sum::<f64>() / count))
        .metric("stiffness_least_n_per_mm", per_mm(low))
        .metric("stiffness_most_n_per_mm", per_mm(high))
        .metric("slope_n_per_mm", (after - before) / count / f64::from(2.0 * BESIDE_MM))
}

/// He and Chen's force with friction and damping against the one without, slid along a wall and
/// pressed into it.
fn friction() -> Row {
    const SPEED: f32 = 0.05;
    let (damping, friction) = (1.0, 0.2);
    let wall = &walls()[1];
    let last = |config, way: fn(f32) -> (f32, f32)| {
        let mut press = Press::new(wall, burr_and_shaft::new(&Tool::burr(RADIUS_MM), config));
        let force = |tick: i32| {
            let (depth_mm, aside_mm) = way(SPEED * tick as f32);
            press.force(depth_mm, aside_mm)
        };
        (0..=10).map(force).last().unwrap_or_default()
    };
    let plain = burr_and_shaft::Config::default();
    let slide = |way: f32| (REFERENCE_MM, way);
    let (slid, smooth) = (last(burr_and_shaft::Config { friction, ..plain }, slide), last(plain, slide));
    let press = |way: f32| (way, 0.0);
    let (pressed, free) = (last(burr_and_shaft::Config { damping, ..plain }, press), last(plain, press));
    Row::new("flat wall, friction and damping", burr_and_shaft::METHOD.name)
        .with("friction", friction)
        .with("damping_n_ms_per_mm", damping)
        .with("speed_mm_per_ms", SPEED)
        .metric("friction_over_force", f64::from(slid.distance(smooth) / smooth.length()))
        .metric("damping_found_n_ms_per_mm", f64::from(pressed.distance(free) / SPEED))
}

/// What a paper says of its method, and how it is judged here.
struct Claim {
    method: &'static str,
    source: &'static str,
    claim: &'static str,
    /// What is measured, in words, and whether that is what is claimed; `None` without the rows.
    found: fn(&Found) -> Option<(String, bool)>,
}

/// The rows of this run.
struct Found<'a>(&'a [Row]);

impl Found<'_> {
    /// The largest of a metric over a method's rows.
    fn most(&self, method: &str, metric: &str) -> Option<f64> {
        let own = self.0.iter().filter(|row| row.method == method && !row.config.contains_key("bounds"));
        own.filter_map(|row| row.metrics.get(metric)).copied().filter(|value| value.is_finite()).reduce(f64::max)
    }

    /// A metric of a method in the first scene whose name begins so.
    fn at(&self, scene: &str, method: &str, metric: &str) -> Option<f64> {
        let own = self.0.iter().find(|row| row.method == method && row.scene.starts_with(scene))?;
        own.metrics.get(metric).copied().filter(|value| value.is_finite())
    }

    /// The slowest median of a tick, and whether it keeps a rate.
    fn rate(&self, method: &str, period_us: f64) -> Option<(String, bool)> {
        let slowest = self.most(method, "tick_p50_us")?;
        Some((format!("slowest median tick {slowest:.0} µs of {period_us:.0}"), slowest < period_us))
    }

    /// The largest changes of force in a slide on a plane of 0.5 mm voxels by two methods.
    fn jumps(&self, [method, other]: [&str; 2]) -> Option<(String, bool)> {
        let jump = |name| self.at("half-space, 0.5 mm", name, "force_change_slide_max_n_per_ms");
        let (own, others) = (jump(method)?, jump(other)?);
        Some((format!("force changes by up to {own:.2} N/ms in a slide, {other} by {others:.2}"), own < others))
    }
}

const CLAIMS: [Claim; 9] = [
    Claim {
        method: "pointshell-sum",
        source: "McNeely et al. 1999, abstract",
        claim: "1000 Hz haptic rate",
        found: |found| found.rate("pointshell-sum", BUDGET_US),
    },
    Claim {
        method: "pointshell-sum",
        source: "McNeely et al. 1999, abstract",
        claim: "very few surface interpenetrations; a layer of voxels keeps objects apart",
        found: |found| {
            let [works, fails] = ["works_count", "fails_count"].map(|n| found.at("walls x speed", "pointshell-sum", n));
            let (works, fails) = (works?, fails?);
            let text = format!("walls of 1 to 5 voxels: {works:.0} cells held, {fails:.0} lost under 3.3 N");
            Some((text, fails == 0.0))
        },
    },
    Claim {
        method: "pointshell-average",
        source: "Renz et al. 2001, abstract",
        claim: "less voxel noise than the sum",
        found: |found| found.jumps(["pointshell-average", "pointshell-sum"]),
    },
    Claim {
        method: "ray-trace",
        source: "Petersik et al. 2003, abstract",
        claim: "6000 Hz",
        found: |found| found.rate("ray-trace", AT_6_KHZ_US),
    },
    Claim {
        method: "ray-trace",
        source: "Petersik et al. 2002, title",
        claim: "sub-voxel resolution",
        found: |found| {
            let error = found.at("half-space, 0.5 mm", "ray-trace", "depth_error_p95_voxel")?;
            Some((format!("depth within {error:.3} voxel on planes, p95"), error < 0.5))
        },
    },
    Claim {
        method: "exposed-faces",
        source: "Acosta and Liu 2007, abstract",
        claim: "smaller force discontinuities than the voxmap pointshell's",
        found: |found| found.jumps(["exposed-faces", "pointshell-sum"]),
    },
    Claim {
        method: "voxel-sum",
        source: "Agus et al. 2002, abstract",
        claim: "real-time feedback on a low-end PC with two processors",
        found: |found| found.rate("voxel-sum", BUDGET_US),
    },
    Claim {
        method: "burr-and-shaft",
        source: "He and Chen 2006, as the thesis tells it",
        claim: "high-resolution multi-point collision at haptic rates; no time is given",
        found: |found| found.rate("burr-and-shaft", BUDGET_US),
    },
    Claim {
        method: "surface-vertices",
        source: "Asenjo 2008, as the thesis tells it",
        claim: "more stable than the line approximation",
        found: |found| {
            let quiet = |name| found.at("stiffness x damping", name, "works_count");
            let (own, line) = (quiet("surface-vertices")?, quiet("centre-line")?);
            Some((format!("{own:.0} couplings quiet by themselves, the line's {line:.0}"), own > line))
        },
    },
];

fn table(rows: &[Row]) -> Table {
    let found = Found(rows);
    let line = |claim: &Claim| {
        let (text, holds) = match (claim.found)(&found) {
            Some((text, true)) => (text, "yes"),
            Some((text, false)) => (text, "no"),
            None => ("not in this run".into(), "-"),
        };
        let own =
            |metric: &str| found.at(SCENE, claim.method, metric).map_or("-".into(), |value| format!("{value:.2}"));
        vec![
            claim.method.into(),
            claim.source.into(),
            claim.claim.into(),
            text,
            holds.into(),
            own("stiffness_n_per_mm"),
            own("slope_n_per_mm"),
        ]
    };
    let columns =
        ["method", "source", "claim", "measured here", "reproduced", "stiffness at 0.5 mm, N/mm", "slope there, N/mm"];
    Table {
        title: "Rivals as published: what a paper claims beside what is measured here".into(),
        columns: columns.map(String::from).to_vec(),
        rows: CLAIMS.iter().map(line).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_recommended_method_is_as_stiff_as_the_spring_and_friction_is_what_it_was_given() {
        let row = stiffness(&Method::RECOMMENDED, &walls()[..2]);
        for metric in ["stiffness_n_per_mm", "slope_n_per_mm"] {
            assert!((row.metrics[metric] / 2.0 - 1.0).abs() < 0.01, "{metric}: {}", row.metrics[metric]);
        }
        let row = friction();
        assert!((row.metrics["friction_over_force"] - 0.2).abs() < 1e-3, "{:?}", row.metrics);
        assert!((row.metrics["damping_found_n_ms_per_mm"] - 1.0).abs() < 0.02, "{:?}", row.metrics);
    }

    #[test]
    fn every_claim_is_of_a_method_and_is_judged_from_its_rows() {
        assert!(CLAIMS.iter().all(|claim| Method::named(claim.method).is_some()));
        let rows = [("pointshell-sum", 900.0), ("ray-trace", 200.0)]
            .map(|(method, us)| Row::new("sphere", method).metric("tick_p50_us", us));
        let table = table(&rows);
        let judged = |at: usize| table.rows[at][4].as_str();
        assert_eq!([judged(0), judged(1), judged(3)], ["yes", "-", "no"], "{:?}", table.rows);
    }
}
