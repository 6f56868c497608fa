//! Stiffness, device damping, delay and encoder steps: which walls of voxels stay quiet under a
//! simulated device and hand, by every method.
//!
//! # Theory
//! ```text
//! Gil, Hulin; Colgate at B = 0      K < b / (T/2 + d)
//! Abbott, Okamura; Diolaiti         K ≤ 2 f_c / Δ
//! ```
//! with the device's damping b, delay d, Coulomb friction f_c and encoder step Δ. The hand here is
//! a spring without damping, so that nothing but the device damps: the bounds' own case. A contact
//! method whose depth jumps or whose normal turns adds energy that no bound knows; one that is
//! exact keeps the border of the exact wall, which is mapped first.
//!
//! # Practice
//! Quiet: the handle moves less than 0.1 mm in the last 600 ms of a press of 1 N, at both encoder
//! steps. Quiet with a clamp at 3.3 N alone: works. Quiet only with the guard's passivity
//! controller: degrades. Else: fails.

use super::solid::{RADIUS_MM, held, voxels};
use super::{map_of, passes};
use trepan_bone::BoneVolume;
use trepan_contact::{Contact, ForceGuard, ForceModel, GuardConfig, Hooke};
use trepan_evidence::part::{Part, Scope};
use trepan_evidence::picture::{Map, Outcome};
use trepan_evidence::suite::{Findings, Gate, Row};
use trepan_geometry::{Tool, ToolState, Vec3};
use trepan_haptics::HapticDevice;
use trepan_haptics::replay::Replay;
use trepan_haptics::simulated::{Config, HandModel, Simulated};
use trepan_rigid::{Method, RigidContact, RigidStep};
use trepan_rivals::Family;

/// Length of a tick in the map, ms.
const TICK_MS: f32 = 1.0;
/// N/mm, stiffest first: the rows.
const STIFFNESS: [f32; 7] = [10.0, 5.0, 2.0, 1.0, 0.5, 0.25, 0.1];
/// Damping of the device, N ms/mm, and delay, ticks: the columns.
const DAMPING: [f32; 3] = [0.5, 2.0, 5.0];
const DELAY: [usize; 4] = [0, 1, 2, 5];
const QUANTUM_MM: [f32; 2] = [0.02, 0.055];
/// HandModel that adds no damping.
const HAND: HandModel = HandModel { mass_g: 50.0, damping: 0.0, stiffness: 0.15 };
const FORCE_N: f32 = 1.0;
/// Speed of the hand, mm/ms.
const APPROACH: f32 = 0.1;
const TICKS: usize = 1800;
const JUDGED: usize = 600;
/// Largest movement of a handle that counts as quiet, mm.
pub const QUIET_MM: f32 = 0.1;
/// Share of the bound within which a wall must be quiet.
const SURE: f32 = 0.8;

/// One coupling.
#[derive(Clone, Copy, Debug)]
pub struct Cell {
    /// N/mm.
    pub stiffness: f32,
    /// N ms/mm.
    pub damping: f32,
    /// Ticks.
    pub delay: usize,
    /// Length of a tick, ms.
    pub tick_ms: f32,
}

impl Cell {
    /// Gil's bound, N/mm.
    fn bound(&self) -> f32 {
        self.damping / (self.tick_ms * (0.5 + self.delay as f32))
    }
}

/// What answers for the wall.
enum Wall<'a> {
    /// The closed form.
    Exact,
    Voxels(&'a BoneVolume, Box<dyn RigidContact>),
}

/// The map of the exact wall and of every method.
pub fn parts() -> Vec<Part> {
    let part = |method: Option<Method>| {
        let name = format!("coupling {}", method.as_ref().map_or("exact wall", Method::name));
        Part::new(name, move |scope, found| chart(method.as_ref(), &bone(normal()), normal(), scope, found))
    };
    let slow = |method: &Method| method.descriptor().is_oracle;
    std::iter::once(None).chain(Method::all().into_iter().filter(|m| !slow(m)).map(Some)).map(part).collect()
}

/// The wall's normal: along nothing.
pub fn normal() -> Vec3 {
    Vec3::new(0.36, 0.48, 0.8)
}

/// The wall: a half-space of 0.5 mm voxels.
pub fn bone(normal: Vec3) -> BoneVolume {
    voxels(48, 0.5, |p| p.dot(normal.as_dvec3()))
}

fn chart(method: Option<&Method>, bone: &BoneVolume, normal: Vec3, scope: Scope, findings: &mut Findings) {
    let name = method.map_or("exact wall", Method::name);
    let stiffness = scope.pick(&STIFFNESS[1..5], &STIFFNESS[..]);
    let (damping, delay) = (scope.pick(&DAMPING[1..2], &DAMPING[..]), scope.pick(&DELAY[..3], &DELAY[..]));
    let columns: Vec<(f32, usize)> = damping.iter().flat_map(|&b| delay.iter().map(move |&d| (b, d))).collect();
    let at = |k: f32, (damping, delay): (f32, usize)| Cell { stiffness: k, damping, delay, tick_ms: TICK_MS };
    let quanta = scope.pick(&QUANTUM_MM[1..], &QUANTUM_MM[..]);
    let judged = |k: f32, column| judge(method, bone, normal, at(k, column), quanta);
    let cells: Vec<Vec<Outcome>> =
        stiffness.iter().map(|&k| columns.iter().map(|&column| judged(k, column)).collect()).collect();
    let mut unsure = 0;
    for (&k, row) in stiffness.iter().zip(&cells) {
        for (&column, outcome) in columns.iter().zip(row) {
            let cell = at(k, column);
            unsure += usize::from(k <= SURE * cell.bound() && *outcome != Outcome::Works);
        }
    }
    let line = |share: f32| {
        let level = |&column: &(f32, usize)| height(stiffness, share * at(1.0, column).bound());
        let step = |(i, column): (usize, &(f32, usize))| [(i as f64, level(column)), (i as f64 + 1.0, level(column))];
        columns.iter().enumerate().flat_map(step).collect::<Vec<_>>()
    };
    let friction = 2.0 * Config::default().friction_n / QUANTUM_MM[1];
    let steps = height(stiffness, friction);
    let map = Map {
        title: format!("{name}: stiffness, device, delay"),
        x: "device damping N ms/mm, delay in ticks".into(),
        y: "K, N/mm".into(),
        columns: columns.iter().map(|(b, d)| format!("{b};{d}")).collect(),
        rows: stiffness.iter().map(|k| format!("{k}")).collect(),
        cells,
        lines: vec![
            ("K = b/(T/2 + d)".into(), line(1.0)),
            ("K = 2 f_c/Δ".into(), vec![(0.0, steps), (columns.len() as f64, steps)]),
        ],
        ..Map::default()
    };
    let row = passes(Row::new("stiffness x damping x delay x encoder steps", name), &map);
    findings.rows.push(row.metric("not_quiet_within_80_percent_of_bound_count", unsure as f64));
    if method == Some(&Method::RECOMMENDED) || method.is_none() {
        let limit = format!("{name}: couplings within 80 % of the bound that are not quiet by themselves");
        findings.gates.push(Gate::at_most(limit, unsure as f64, 0.0));
    }
    findings.maps.push(match method {
        Some(method) => map_of(method, map),
        None => map,
    });
}

/// Where a stiffness lies among the rows, in cells from above: rows are at their middles, in
/// between by logarithm.
fn height(rows: &[f32], k: f32) -> f64 {
    let log = |k: f32| f64::from(k).log2();
    for (at, pair) in rows.windows(2).enumerate() {
        if k >= pair[1] {
            return at as f64 + 0.5 + (log(pair[0]) - log(k)) / (log(pair[0]) - log(pair[1]));
        }
    }
    rows.len() as f64
}

/// How a wall of one coupling fares, at the worst of the encoder steps. Without a method: the exact
/// wall.
pub fn judge(method: Option<&Method>, bone: &BoneVolume, normal: Vec3, cell: Cell, quanta: &[f32]) -> Outcome {
    let worst = |guarded: bool| {
        let cycle = |&quantum| cycle_mm(method, bone, normal, cell, quantum, guarded, |_| ());
        quanta.iter().map(cycle).fold(0.0, f32::max)
    };
    if worst(false) <= QUIET_MM {
        return Outcome::Works;
    }
    if worst(true) <= QUIET_MM {
        return Outcome::Degrades("shakes, unless the passivity controller damps it".into());
    }
    Outcome::Fails("shakes by more than 0.1 mm in spite of the guard".into())
}

/// How far the handle moves at the end of a press, mm. `record` gets the handle's position at every
/// tick, mm.
pub fn cycle_mm(
    method: Option<&Method>,
    bone: &BoneVolume,
    normal: Vec3,
    cell: Cell,
    quantum_mm: f32,
    guarded: bool,
    mut record: impl FnMut(Vec3),
) -> f32 {
    let config = Config { damping: cell.damping, delay_ticks: cell.delay, quantum_mm, ..Config::default() };
    let depth = FORCE_N / cell.stiffness + FORCE_N / HAND.stiffness;
    let way = APPROACH * cell.tick_ms;
    let steps = ((2.0 + depth) / way).ceil() as usize;
    let intent = (0..=steps).map(|step| {
        let pressed = (way * step as f32 - 2.0).min(depth);
        held(normal * (RADIUS_MM - pressed), normal)
    });
    let mut device = Simulated::new(config, HAND, Box::new(Replay::new(intent.collect())));
    let limits = device.capabilities().guard_config();
    let passivity = limits.passivity.filter(|_| guarded);
    // Without the controller only the clamp is left: no slew limit, which would damp or feed an
    // oscillation.
    let slew = if guarded { limits.slew_n_per_ms } else { 1e3 };
    let mut guard = ForceGuard::new(GuardConfig { ramp_in_ms: 0.0, passivity, slew_n_per_ms: slew, ..limits });
    let mut wall = match method {
        None => Wall::Exact,
        Some(method) => Wall::Voxels(bone, method.build(&Tool::burr(RADIUS_MM))),
    };
    let (mut model, mut out) = (Hooke { stiffness: cell.stiffness }, RigidStep::default());
    let (mut low, mut high) = (Vec3::MAX, Vec3::MIN);
    for tick in 0..TICKS {
        let tool = device.read(tick as f64 * f64::from(cell.tick_ms)).tool;
        if tick == 0
            && let Wall::Voxels(_, contact) = &mut wall
        {
            contact.reset(tool.world_from_tool);
        }
        wall.touch(&tool, normal, cell.tick_ms, &mut out);
        let wrench = model.wrench(&tool, &out.manifold, cell.tick_ms);
        device.apply(guard.guard(wrench, &tool, cell.tick_ms));
        record(device.position());
        if tick + JUDGED >= TICKS {
            (low, high) = (low.min(device.position()), high.max(device.position()));
        }
    }
    (high - low).length()
}

impl Wall<'_> {
    fn touch(&mut self, tool: &ToolState, normal: Vec3, tick_ms: f32, out: &mut RigidStep) {
        match self {
            Self::Voxels(bone, contact) => contact.step(bone, tool, false, tick_ms, out),
            Self::Exact => {
                out.clear();
                let depth_mm = RADIUS_MM - tool.tip().dot(normal);
                if depth_mm > 0.0 {
                    let point = tool.tip() - normal * (RADIUS_MM - depth_mm);
                    out.manifold.set_single(Contact { point, normal, depth_mm });
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_are_logarithmic() {
        assert_eq!(height(&[4.0, 2.0, 1.0], 2.0), 1.5);
        assert!((height(&[4.0, 2.0, 1.0], 2.0f32.sqrt()) - 2.0).abs() < 1e-6);
        assert_eq!(height(&[4.0, 2.0, 1.0], 0.1), 3.0);
    }

    /// The border, from both sides.
    #[test]
    fn within_the_bound_the_recommended_wall_is_as_quiet_as_the_exact_one_and_beyond_it_both_shake() {
        let (normal, cell) = (normal(), Cell { stiffness: 2.0, damping: 2.0, delay: 0, tick_ms: TICK_MS });
        assert!(cell.stiffness <= SURE * cell.bound());
        let bone = bone(normal);
        let best = Some(&Method::RECOMMENDED);
        for method in [None, best] {
            assert_eq!(judge(method, &bone, normal, cell, &QUANTUM_MM), Outcome::Works);
        }
        let stiff = Cell { stiffness: 10.0, damping: 0.5, delay: 5, tick_ms: TICK_MS };
        for method in [None, best] {
            assert!(judge(method, &bone, normal, stiff, &QUANTUM_MM) != Outcome::Works, "far beyond the bound");
        }
    }
}
