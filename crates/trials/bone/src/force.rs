//! Force models: cost of a call, force error of a pressing hand, and conditions under which each
//! fails.
//!
//! # Theory
//! A hand of stiffness K_h whose target is d deep in a wall of stiffness K comes to rest under
//! ```text
//! F = K K_h / (K + K_h) · d
//! ```
//! The error is the root mean square deviation from F over the second after the press; it stays
//! large for a model that oscillates. The device has no friction and exact positions, so that only
//! the model damps, and it responds one tick late.
//!
//! # Practice
//! No guard is used, because it would hide the failures. `god-object` is the damped spring on a
//! contact found by the god-object constrained to planes; all others use the nearest face.

use trepan_contact::{
    Contact, ContactManifold, ForceGuard, ForceModel, ForceShading, Friction, GodObject, GuardConfig, Hooke, Plane,
    Vibration, Viscoelastic,
};
use trepan_evidence::part::{Part, Scope};
use trepan_evidence::picture::{Chart, Mark, Outcome};
use trepan_evidence::suite::{Findings, Gate, Row};
use trepan_evidence::timer::Samples;
use trepan_geometry::{Pose, ToolState, Twist, Vec3};
use trepan_haptics::HapticDevice;
use trepan_haptics::replay::Replay;
use trepan_haptics::simulated::{Config, HandModel, Simulated};
use trepan_trials_scenes::conditions;

/// Damping of all damped walls, N ms/mm.
const DAMPING: f32 = 0.5;
/// Target depth of the hands, mm: below the force that the device can give.
const MEANT_MM: f32 = 4.0;
/// Stiffness above the limit of a bare spring and below that of a damped one on this device, N/mm.
const STIFF: f32 = 1.5;
const TICKS: usize = 3000;
const JUDGED: usize = 1000;
/// Largest allowed oscillation, mm, and change of force per tick, N.
pub const QUIET_MM: f32 = 0.1;
const SMOOTH_N: f32 = 0.1;
/// Model that a session uses for tissue, and below the drill's vibration for bone.
pub const CHOSEN: &str = "viscoelastic";

/// Force model of a given stiffness, and whether a god-object finds the contact.
#[derive(Clone, Copy)]
pub struct Model {
    make: fn(f32) -> Box<dyn ForceModel>,
    proxy: bool,
}

fn damped(stiffness: f32) -> Viscoelastic {
    Viscoelastic { stiffness, damping: DAMPING }
}

/// All models with their names.
pub fn models() -> Vec<(&'static str, Model)> {
    let nearest = |make| Model { make, proxy: false };
    vec![
        ("hooke (thesis)", nearest(|stiffness| Box::new(Hooke { stiffness }))),
        (CHOSEN, nearest(|stiffness| Box::new(damped(stiffness)))),
        ("friction", nearest(|k| Box::new(Friction::new(damped(k), k, 0.3, 0.2)))),
        ("shading", nearest(|stiffness| Box::new(ForceShading::new(damped(stiffness), 1.0)))),
        ("drill", nearest(|stiffness| Box::new(Vibration::drill(damped(stiffness))))),
        ("god-object", Model { make: |stiffness| Box::new(damped(stiffness)), proxy: true }),
    ]
}

/// Lists the parts: cost and error, then the conditions.
pub fn parts(_: Scope) -> Vec<Part> {
    vec![Part::new("press", press), Part::new("conditions", |_, findings| endure(findings))]
}

fn press(scope: Scope, findings: &mut Findings) {
    let mut marks = Vec::new();
    let calls = calls(scope.pick(200, 2000));
    for ((name, model), ns) in models().into_iter().zip(&calls) {
        let [low, ratio, high] = ns.over(&calls[0]);
        let (mut worst, mut cycle_mm) = (0.0f64, 0.0f32);
        for stiffness in [0.5f32, 1.0, STIFF] {
            let found = hold(&model, stiffness, 1, None);
            worst = worst.max(found.error_n);
            cycle_mm = cycle_mm.max(found.cycle_mm);
        }
        let ladder = (1..=16).map(|step| 0.25 * step as f32);
        let stiffest = ladder.take_while(|&k| hold(&model, k, 1, None).cycle_mm <= QUIET_MM).last().unwrap_or(0.0);
        findings.rows.push(
            Row::new("pressed wall of 0.5 to 1.5 N/mm, a tick late", name)
                .metric("call_p50_ns", ns.quantile(0.5))
                .metric("call_p99_ns", ns.quantile(0.99))
                .metric("call_spread_percent", 100.0 * ns.spread())
                .metric("times_the_thesis", ratio)
                .metric("times_the_thesis_low", low)
                .metric("times_the_thesis_high", high)
                .metric("force_error_rms_n", worst)
                .metric("limit_cycle_mm", cycle_mm.into())
                .metric("stiffest_quiet_n_per_mm", stiffest.into()),
        );
        marks.push(Mark { method: name.into(), cost: ns.quantile(0.5), error: worst });
    }
    let chart = Chart {
        title: "Force models: a call against the error of the force on a pressed wall".into(),
        cost: "call_p50_ns".into(),
        error: "force_error_rms_n".into(),
        marks,
        chosen: Some(CHOSEN.into()),
        ..Chart::default()
    };
    let beaten = chart.beaten_beyond(CHOSEN, Chart::SPREAD) as f64;
    findings.gates.push(Gate::at_most(format!("models that beat {CHOSEN} in both"), beaten, 0.0));
    findings.charts.push(chart);
}

/// Calls that are timed together: their time in µs is that of one call in ns.
const CALLS: usize = 1000;

/// Times of a call, ns, of all models in turn.
fn calls(rounds: usize) -> Vec<Samples> {
    let mut models: Vec<Box<dyn ForceModel>> = models().iter().map(|(_, model)| (model.make)(1.0)).collect();
    Samples::in_turn(rounds, &mut models, |model, _| {
        for call in 0..CALLS {
            let depth_mm = 0.001 * call as f32;
            let touch = ContactManifold::single(Contact { point: Vec3::ZERO, normal: Vec3::X, depth_mm });
            std::hint::black_box(model.wrench(&at(-depth_mm), &touch, 1.0));
        }
    })
}

/// Measurements of a pressing hand.
#[derive(Clone, Copy, Default)]
pub struct PressingHand {
    error_n: f64,
    /// How far the hand still moves at the end, mm.
    pub cycle_mm: f32,
    /// Largest force against the wall's outward normal, N.
    pub inward_n: f32,
    /// Whether every force was a number.
    pub finite: bool,
}

/// A wall and the loop in which a hand presses it.
#[derive(Clone, Copy)]
pub struct Press {
    /// N/mm.
    pub stiffness: f32,
    /// Ticks.
    pub delay_ticks: usize,
    /// Thickness of the wall; `None` for a half-space.
    pub thick_mm: Option<f32>,
    /// Length of a tick, ms.
    pub tick_ms: f32,
    /// The hand that presses.
    pub hand: HandModel,
}

fn hold(model: &Model, stiffness: f32, delay_ticks: usize, thick_mm: Option<f32>) -> PressingHand {
    press_into(model, &Press { stiffness, delay_ticks, thick_mm, tick_ms: 1.0, hand: HandModel::LIGHT }, |_| ())
}

/// Presses a hand into a wall at x ≤ 0 and holds it there. `record` gets the handle's x at every
/// tick, mm.
pub fn press_into(model: &Model, press: &Press, mut record: impl FnMut(f32)) -> PressingHand {
    let Press { stiffness, delay_ticks, thick_mm, tick_ms, hand } = *press;
    let goal = thick_mm.map_or(MEANT_MM, |thick| thick + 2.0);
    let intent = (0..TICKS).map(|tick| at((2.0 - 0.05 * tick_ms * tick as f32).max(-goal))).collect();
    let config = Config { delay_ticks, friction_n: 0.0, quantum_mm: 0.0, ..Config::default() };
    let mut device = Simulated::new(config, hand, Box::new(Replay::new(intent)));
    let mut guard = ForceGuard::new(GuardConfig { ramp_in_ms: 0.0, passivity: None, ..GuardConfig::default() });
    let (mut force, mut proxy) = ((model.make)(stiffness), GodObject::new(Vec3::X * 2.0));
    let truth = stiffness * hand.stiffness / (stiffness + hand.stiffness) * goal;
    let (mut squares, mut way, mut held) =
        (0.0f64, (f32::MAX, f32::MIN), PressingHand { finite: true, ..PressingHand::default() });
    for tick in 0..TICKS {
        let tool = device.read(tick as f64 * f64::from(tick_ms)).tool;
        let touch = if model.proxy { by_proxy(&mut proxy, tool.tip()) } else { nearest(tool.tip().x, thick_mm) };
        let wrench = force.wrench(&tool, &touch, tick_ms);
        held.finite &= wrench.force.is_finite();
        held.inward_n = held.inward_n.max(-wrench.force.x);
        device.apply(guard.guard(wrench, &tool, tick_ms));
        record(device.position().x);
        if tick + JUDGED >= TICKS {
            squares += f64::from(wrench.force.x - truth).powi(2);
            way = (way.0.min(device.position().x), way.1.max(device.position().x));
        }
    }
    (held.error_n, held.cycle_mm) = ((squares / JUDGED as f64).sqrt(), way.1 - way.0);
    held
}

/// Contact with the nearest face of the wall, whichever it is.
fn nearest(x: f32, thick_mm: Option<f32>) -> ContactManifold {
    let (front, back) = (-x, thick_mm.map_or(f32::MAX, |thick| x + thick));
    if front <= 0.0 || back <= 0.0 {
        ContactManifold::default()
    } else if front <= back {
        ContactManifold::single(Contact { point: Vec3::ZERO, normal: Vec3::X, depth_mm: front })
    } else {
        ContactManifold::single(Contact { point: Vec3::ZERO, normal: Vec3::NEG_X, depth_mm: back })
    }
}

/// Contact with the face that the god-object has not crossed.
fn by_proxy(proxy: &mut GodObject, tip: Vec3) -> ContactManifold {
    let place = proxy.follow(tip, &[Plane { point: Vec3::ZERO, normal: Vec3::X }]);
    let depth_mm = place.distance(tip);
    if depth_mm <= 1e-6 {
        return ContactManifold::default();
    }
    ContactManifold::single(Contact { point: place, normal: (place - tip) / depth_mm, depth_mm })
}

fn at(x: f32) -> ToolState {
    ToolState::at(Pose::from_translation(Vec3::X * x))
}

type Condition = (&'static str, fn(&Model) -> Outcome);

const CONDITIONS: [Condition; 10] = [
    ("0.5 N/mm, no delay", |model| quiet(&hold(model, 0.5, 0, None))),
    ("1 N/mm, a tick late", |model| quiet(&hold(model, 1.0, 1, None))),
    ("2 N/mm, a tick late", |model| quiet(&hold(model, 2.0, 1, None))),
    ("2 N/mm, three ticks late", |model| quiet(&hold(model, 2.0, 3, None))),
    ("wall of 1 mm, pressed 2 mm past it", |model| held_back(&hold(model, 0.5, 1, Some(1.0)))),
    ("over a facet's edge of 30°", over_an_edge),
    ("contact that is not a number", |model| finite(model, 1.0, f32::NAN)),
    ("tick of 0 ms", |model| finite(model, 0.0, 0.5)),
    ("tick that is not a number", |model| finite(model, f32::NAN, 0.5)),
    ("torn away at 1 m/s", torn_away),
];

fn endure(findings: &mut Findings) {
    let names = CONDITIONS.map(|(name, _)| name);
    conditions::judge("Force models", &names, &models(), |at, model| CONDITIONS[at].1(model), findings);
}

fn quiet(held: &PressingHand) -> Outcome {
    match held.cycle_mm {
        _ if !held.finite => Outcome::Fails("not a number".into()),
        cycle if cycle <= QUIET_MM => Outcome::Works,
        cycle if cycle <= 5.0 * QUIET_MM => Outcome::Degrades("the hand swings by up to 0.5 mm".into()),
        _ => Outcome::Fails("the hand is shaken".into()),
    }
}

fn held_back(held: &PressingHand) -> Outcome {
    if held.inward_n > 1e-3 { Outcome::Fails("pushes on through the wall".into()) } else { quiet(held) }
}

/// Largest change of force in a tick over an edge of 30°.
fn over_an_edge(model: &Model) -> Outcome {
    match slid_over_an_edge(model, 30.0, |_| ()) {
        most if !most.is_finite() => Outcome::Fails("not a number".into()),
        most if most <= SMOOTH_N => Outcome::Works,
        _ => Outcome::Degrades("the force jumps by over 0.1 N in a tick".into()),
    }
}

/// Largest change of force in a tick, N, on a way over an edge. The way is 5 mm to each side, at
/// 50 mm/s, 0.5 mm deep at 1 N/mm. `record` gets the force along the edge's plane, N.
pub fn slid_over_an_edge(model: &Model, angle_deg: f32, mut record: impl FnMut(f32)) -> f32 {
    let (sin, cos) = angle_deg.to_radians().sin_cos();
    let (mut force, mut last, mut most) = ((model.make)(1.0), None::<Vec3>, 0.0f32);
    for tick in 0..200 {
        let way = 0.05 * tick as f32 - 5.0;
        let normal = if way < 0.0 { Vec3::X } else { Vec3::new(cos, sin, 0.0) };
        let tool = ToolState::at(Pose::from_translation(Vec3::new(-0.5, way, 0.0)));
        let touch = Contact { point: Vec3::Y * way, normal, depth_mm: 0.5 };
        let now = force.wrench(&tool, &ContactManifold::single(touch), 1.0).force;
        record(now.y);
        let change = last.replace(now).map_or(0.0, |was| now.distance(was));
        most = if change.is_nan() { f32::NAN } else { most.max(change) };
    }
    most
}

fn finite(model: &Model, dt_ms: f32, depth_mm: f32) -> Outcome {
    let mut force = (model.make)(1.0);
    let touch = ContactManifold::single(Contact { point: Vec3::ZERO, normal: Vec3::X, depth_mm });
    let given: Vec<Vec3> = (0..10).map(|_| force.wrench(&at(-0.5), &touch, dt_ms).force).collect();
    // The guard replaces non-finite forces by zero; a model that relies on it is usable.
    if given.iter().all(|force| force.is_finite()) {
        Outcome::Works
    } else {
        Outcome::Degrades("only the guard stops it".into())
    }
}

fn torn_away(model: &Model) -> Outcome {
    let mut force = (model.make)(1.0);
    let pull = |tick: u8| {
        let depth_mm = 1.0 - 0.1 * f32::from(tick);
        let tool = ToolState { twist: Twist { linear: Vec3::X, ..Twist::default() }, ..at(-depth_mm) };
        let touch = ContactManifold::single(Contact { point: Vec3::ZERO, normal: Vec3::X, depth_mm });
        force.wrench(&tool, &touch, 1.0).force.x
    };
    let least = (0..10).map(pull).fold(f32::MAX, f32::min);
    if least >= -1e-6 { Outcome::Works } else { Outcome::Degrades("pulls on the tool".into()) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bare_spring_oscillates_where_a_damped_one_rests_and_a_god_object_holds_a_thin_wall() {
        let verdict = |condition: usize, name: &str| {
            let (_, model) = models().into_iter().find(|(known, _)| *known == name).unwrap();
            CONDITIONS[condition].1(&model).word()
        };
        assert_eq!([verdict(0, CHOSEN), verdict(4, "god-object")], ["works"; 2]);
        assert_eq!([verdict(3, "hooke (thesis)"), verdict(4, CHOSEN)], ["fails"; 2]);
        assert_eq!([verdict(5, "shading"), verdict(5, CHOSEN)], ["works", "degrades"]);
    }
}
