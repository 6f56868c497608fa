//! Generated holes: is every breach told before it comes, and no other?
//!
//! # Theory
//! A skull is a spherical shell with known radii, so that the truth is geometry: the burr's ball is
//! through when it reaches below the inner table, and on the dura when it reaches the brain's
//! sphere. Half of the hands mean to come through, half stop 0.8 to 3 mm before.
//!
//! ```text
//!  C ·············· R - t - g  brain ·· R - t  inner table ▒▒▒▒ R  outer table
//!  reach = |c - C| - r of the ball
//! ```

use super::bench::Bench;
use std::sync::Arc;
use trepan_bone::BoneVolume;
use trepan_contact::GuardedWrench;
use trepan_evidence::part::{Part, Scope};
use trepan_evidence::suite::{Findings, Gate, Row};
use trepan_geometry::{Buttons, Pose, Quat, ToolState, Twist, Vec3};
use trepan_haptics::simulated::HandModel;
use trepan_haptics::{Capabilities, HapticDevice, Reading, Status};
use trepan_link::wire::TickRecord;
use trepan_stages::{Program, Warning};
use trepan_volume::{DistanceField, VoxelVolume};

/// Edge of the piece of skull, mm.
const EDGE_MM: f32 = 30.0;
/// How long a hand that stops short waits, and one that means to come through, at most, ms.
const WAIT_MS: (f64, f64) = (3000.0, 40_000.0);
/// How long a hand stays that has come through, ms.
const AFTER_MS: f64 = 1500.0;
/// Bone left, mm, under which an announced breach that did not come is no false alarm, when the
/// hand gave up.
const ABOUT_MM: f32 = 0.5;
/// What counts as an announcement of a breach.
const ANNOUNCE: [Warning; 2] = [Warning::BreachSoon, Warning::BreakThrough];

/// One hole.
#[derive(Clone, Copy, Debug)]
struct Hole {
    radius_mm: f32,
    thick_mm: f32,
    gap_mm: f32,
    spacing_mm: f32,
    /// Out of the head along the tool.
    outward: Vec3,
    slot: usize,
    feed_mm_s: f32,
    grip: HandModel,
    /// Bone that the hand means to leave, mm; negative to come through.
    left_mm: f32,
}

/// What came of a hole.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Outcome {
    through: Option<u64>,
    contact: Option<u64>,
    announced: Option<u64>,
    /// Least bone that was ever left before the burr, mm.
    left_mm: f32,
}

impl Hole {
    fn random(own: u64, scope: Scope) -> Self {
        let mut rng = scope.random(own);
        let mut within = |low: f32, high: f32| low + (high - low) * rng.f32();
        let (tilt, turn) = (within(0.0, 0.35), within(0.0, std::f32::consts::TAU));
        Self {
            radius_mm: within(60.0, 110.0),
            thick_mm: within(3.0, 10.0),
            gap_mm: within(0.8, 4.0),
            spacing_mm: within(0.5, 0.9),
            outward: Quat::from_rotation_z(turn) * Vec3::new(tilt.sin(), 0.0, tilt.cos()),
            slot: usize::from(within(0.0, 1.0) < 0.5),
            feed_mm_s: within(0.4, 3.0),
            grip: if within(0.0, 1.0) < 0.7 { HandModel::FIRM } else { HandModel::LIGHT },
            left_mm: if own.is_multiple_of(2) { -2.0 } else { within(0.8, 3.0) },
        }
    }

    fn centre(&self) -> Vec3 {
        Vec3::new(0.0, 0.0, -self.radius_mm)
    }

    fn skull(&self) -> (Arc<BoneVolume>, Arc<DistanceField>) {
        let n = (EDGE_MM / self.spacing_mm) as usize;
        let origin = Vec3::new(-0.5 * EDGE_MM, -0.5 * EDGE_MM, 5.0 - EDGE_MM);
        let mut ct = VoxelVolume::isotropic([n; 3], origin, self.spacing_mm, -1000i16);
        let mut brain = ct.map(|_| 0u8);
        for at in 0..ct.data.len() {
            let place = ct.centre_of([at % n, at / n % n, at / (n * n)]).as_vec3();
            let below = self.radius_mm - place.distance(self.centre());
            let inside = below.min(self.thick_mm - below) / self.spacing_mm;
            ct.data[at] = (400.0 + 1000.0 * inside).clamp(-1000.0, 1300.0) as i16;
            brain.data[at] = u8::from(below > self.thick_mm + self.gap_mm);
        }
        (Arc::new(BoneVolume::new(&ct, 400).expect("there is bone")), Arc::new(DistanceField::of_mask(&brain)))
    }

    /// Thickness of the bone along the tool, mm.
    fn along_mm(&self) -> f32 {
        let down = self.outward.dot(-self.centre());
        let inner = self.radius_mm - self.thick_mm;
        down - (down * down - self.radius_mm.powi(2) + inner * inner).max(0.0).sqrt()
    }

    fn drilled(&self) -> Outcome {
        let (bone, brain) = self.skull();
        let tip_mm = Program::Craniotomy.tray()[self.slot].tip_radius_mm;
        let goal_mm = self.along_mm() - self.left_mm - tip_mm;
        let intent = Feed { hole: *self, from_mm: -tip_mm - 1.0, goal_mm, time_ms: 0.0 };
        let end_ms = intent.end_ms() + if self.left_mm < 0.0 { WAIT_MS.1 } else { WAIT_MS.0 };
        let grip = self.grip;
        let mut bench = Bench::new(Program::Craniotomy, bone, brain, None, grip, Box::new(intent));
        let (inner, dura) = (self.radius_mm - self.thick_mm, self.radius_mm - self.thick_mm - self.gap_mm);
        let reach = |tick: &TickRecord| tick.proxy.translation.distance(self.centre()) - tip_mm;
        let mut left_ms = AFTER_MS;
        bench.run(end_ms, |tick| {
            left_ms -= f64::from(u8::from(reach(tick) < inner));
            left_ms <= 0.0 || reach(tick) < dura - 0.5
        });
        let first = |below: f32| bench.records.iter().find(|tick| reach(tick) < below).map(|tick| tick.tick);
        let deepest = bench.records.iter().map(reach).fold(f32::INFINITY, f32::min);
        Outcome {
            through: first(inner),
            contact: first(dura),
            announced: bench.raised(&ANNOUNCE),
            left_mm: deepest - inner,
        }
    }
}

/// A hand that feeds the burr in at an even speed and waits.
struct Feed {
    hole: Hole,
    from_mm: f32,
    goal_mm: f32,
    time_ms: f64,
}

impl Feed {
    fn end_ms(&self) -> f64 {
        f64::from((self.goal_mm - self.from_mm) / self.hole.feed_mm_s) * 1e3
    }
}

impl HapticDevice for Feed {
    fn read(&mut self, time_ms: f64) -> Reading {
        self.time_ms = time_ms;
        let depth_mm = self.goal_mm.min(self.from_mm + self.hole.feed_mm_s * 1e-3 * time_ms as f32);
        let rotation = Quat::from_rotation_arc(Vec3::Z, self.hole.outward);
        let tool = ToolState {
            world_from_tool: Pose::from_parts(-depth_mm * self.hole.outward, rotation),
            twist: Twist::default(),
            buttons: Buttons::slot(self.hole.slot) | Buttons::PEDAL,
            time_ms,
        };
        Reading { tool, status: Status::Fresh }
    }

    fn apply(&mut self, _: GuardedWrench) {}

    fn capabilities(&self) -> Capabilities {
        Capabilities::passive("feed")
    }

    fn close(&mut self) {}
}

/// Holes in one part.
const TOGETHER: u64 = 50;
/// What a row of a part counts.
const HOLES: &str = "holes_count";
const THROUGH: &str = "through_count";
const NOT_THROUGH: &str = "meant_to_and_not_through_count";
const TOLD_BREACH: &str = "told_before_breach_count";
const TOLD_CONTACT: &str = "told_before_contact_count";
const FALSE: &str = "false_count";
const LEADS: &str = "lead_ms";

/// A thousand holes, or sixty, each with its own seed.
pub fn parts(scope: Scope) -> Vec<Part> {
    let part = |first: u64| {
        Part::new(format!("holes from {first}"), move |scope: Scope, findings: &mut Findings| {
            let last = (first + TOGETHER).min(count(scope));
            findings.rows.push(tally(first, (first..last).map(|own| Hole::random(own, scope)).collect()));
        })
    };
    (0..count(scope)).step_by(TOGETHER as usize).map(part).collect()
}

fn count(scope: Scope) -> u64 {
    scope.pick(20, 1000)
}

fn tally(first: u64, holes: Vec<Hole>) -> Row {
    let outcomes: Vec<(Hole, Outcome)> = holes.into_iter().map(|hole| (hole, hole.drilled())).collect();
    let through = || outcomes.iter().filter(|(_, outcome)| outcome.through.is_some());
    let short = || outcomes.iter().filter(|(_, outcome)| outcome.through.is_none());
    let before = |outcome: &Outcome, event: Option<u64>| {
        event.is_none_or(|event| outcome.announced.is_some_and(|announced| announced < event))
    };
    let leads: Vec<f64> = through().filter_map(|(_, o)| Some(o.through? as f64 - o.announced? as f64)).collect();
    let told_contact = through().filter(|(_, o)| o.announced.is_some() && before(o, o.contact));
    let wrong = short().filter(|(_, o)| o.announced.is_some() && o.left_mm > ABOUT_MM);
    Row::new(format!("holes from {first}"), "warnings")
        .with(LEADS, leads)
        .metric(HOLES, outcomes.len() as f64)
        .metric(THROUGH, through().count() as f64)
        .metric(NOT_THROUGH, short().filter(|(hole, _)| hole.left_mm < 0.0).count() as f64)
        .metric(TOLD_BREACH, through().filter(|(_, o)| before(o, o.through)).count() as f64)
        .metric(TOLD_CONTACT, told_contact.count() as f64)
        .metric(FALSE, wrong.count() as f64)
}

/// One row for those that come through, one for those that do not, and their gates.
pub fn judge(findings: &mut Findings) {
    let rows: Vec<&Row> = findings.rows.iter().filter(|row| row.config.contains_key(LEADS)).collect();
    let sum = |name: &str| rows.iter().map(|row| row.metrics[name]).sum::<f64>();
    let (holes, through) = (sum(HOLES), sum(THROUGH));
    let (told_contact, wrong) = (sum(TOLD_CONTACT) / through, sum(FALSE) / (holes - through));
    let mut leads: Vec<f64> = rows.iter().flat_map(|row| row.numbers(LEADS)).collect();
    leads.sort_by(f64::total_cmp);
    let quantile = |q: f64| leads.get((q * leads.len() as f64) as usize).copied().unwrap_or(f64::NAN);
    let come_through = Row::new("holes that come through", "warnings")
        .with("holes", holes)
        .metric("breaches", through)
        .metric("not_through", sum(NOT_THROUGH))
        .metric("told_before_breach_percent", 100.0 * sum(TOLD_BREACH) / through)
        .metric("told_before_contact_percent", 100.0 * told_contact)
        .metric("lead_p50_ms", quantile(0.5))
        .metric("lead_p01_ms", quantile(0.01));
    let stop_short = Row::new("holes that stop short", "warnings")
        .with("holes", holes)
        .metric("holes", holes - through)
        .metric("false_percent", 100.0 * wrong);
    findings.rows.extend([come_through, stop_short]);
    findings.gates.extend([
        Gate::at_least("holes: share of breaches told before the dura is touched", told_contact, 0.99),
        Gate::at_most("holes: share of false announcements", wrong, 0.01),
    ]);
}
