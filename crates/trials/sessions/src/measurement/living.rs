//! A ball pressed on the living brain: the shear modulus that a surgeon's tactile sensor reads.
//!
//! # Theory
//! The sensor takes its modulus from the force F at depth d by Hertz's formula for an
//! incompressible half-space, `F = 16/3 G √R d^(3/2)`. The same ball presses a block of the
//! program's brain at the same speed, and the same formula reads the force.

use super::comparison::{Comparison, How};
use anyhow::Result;
use trepan_budget::Quality;
use trepan_contact::NodalContacts;
use trepan_evidence::part::{Part, Scope};
use trepan_evidence::picture::Series;
use trepan_evidence::suite::Findings;
use trepan_measurements::living;
use trepan_models::Ingredients;
use trepan_models::measure::tissue::{BallContact, MASS_ADDED, PressedBall};
use trepan_patient::TissueClass;
use trepan_soft::{Loads, SoftSolver};
use trepan_tled::{Config, Tled};
use trepan_trials_tissue::tled::outside::{Pressed, Shape, Size};

/// Time between updates of the ball, ms.
const TURN_MS: f32 = 1.0;
/// Young's modulus of the brain, MPa: the programs' default.
const YOUNG_MPA: f32 = 0.003;
/// Mesh of the preset `usual`.
const USUAL: Size = Size { count: 8_000, halvings: 4, of_truth: false };

/// Lists the parts.
pub fn parts(_: Scope) -> Vec<Part> {
    vec![Part::new("palpation", |_, findings| palpation(findings).expect("the block is sound"))]
}

fn palpation(findings: &mut Findings) -> Result<()> {
    let mut pressed = Shape::block()?.pressed(USUAL, false)?;
    let with = Ingredients::of(Quality::Auto);
    pressed.body.materials = vec![with.materials(YOUNG_MPA)[TissueClass::Brain as usize]];
    let curve = press(&pressed, &with)?;
    let (depth_mm, force_n) = curve[curve.len() - 1];
    let ours_kpa = hertz_kpa(depth_mm, force_n);
    let why = "the ball presses bare brain here, through scalp and scar there";
    findings.rows.push(Comparison::of(&living::PALPATION_SHEAR, How::Predicted, ours_kpa).why(why).row());
    let [low, middle, high] = [-1.0, 0.0, 1.0].map(|by| {
        let shear_kpa = living::PALPATION_SHEAR.value + by * living::PALPATION_SHEAR.spread;
        curve.iter().map(|(mm, _)| (*mm, 1e-3 * shear_kpa * hertz_mm2(*mm))).collect::<Vec<_>>()
    });
    findings.series.push(Series {
        title: "A ball of 5 mm pressed on the brain at 1.5 mm/s".into(),
        x: "depth, mm".into(),
        y: "force, N".into(),
        lines: vec![
            ("this project".into(), curve),
            ("7 living people, mean".into(), middle),
            ("less one standard deviation".into(), low),
            ("and one more".into(), high),
        ],
        ..Series::default()
    });
    Ok(())
}

/// Area by which Hertz's formula multiplies the shear modulus, mm².
fn hertz_mm2(depth_mm: f64) -> f64 {
    16.0 / 3.0 * living::PALPATION_RADIUS.value.sqrt() * depth_mm.powf(1.5)
}

/// Shear modulus that Hertz's formula reads, kPa.
fn hertz_kpa(depth_mm: f64, force_n: f64) -> f64 {
    1e3 * force_n / hertz_mm2(depth_mm)
}

/// Depth, mm, and force, N, as the ball goes in.
fn press(pressed: &Pressed, with: &Ingredients) -> Result<Vec<(f64, f64)>> {
    let config = Config {
        mass_scaling: MASS_ADDED,
        averaged_pressure: true,
        relaxation: with.relaxation(),
        ..Config::default()
    };
    let mut solver = Tled::new(&pressed.body, &config)?;
    let mut loads = Loads { contacts: NodalContacts::with_room(), ..Loads::default() };
    let (speed_mm_per_ms, end_mm) = (1e-3 * living::PALPATION_SPEED.f32(), living::PALPATION_DEPTH.f32());
    let mut contact = BallContact::new(&pressed.body.mesh, living::PALPATION_RADIUS.f32())?;
    let (mut now_ms, mut depth_mm, mut curve) = (0.0f32, 0.0f32, Vec::new());
    while depth_mm < end_mm {
        depth_mm = (depth_mm + speed_mm_per_ms * TURN_MS).min(end_mm);
        let ball = PressedBall { radius_mm: living::PALPATION_RADIUS.f32(), depth_mm, ..pressed.ball };
        let force_n = contact.press(&ball, TURN_MS, &solver, &mut loads.contacts);
        curve.push((depth_mm.into(), force_n));
        let next_ms = now_ms + TURN_MS;
        while now_ms < next_ms {
            let dt_ms = solver.next_dt_ms().min(1.0);
            solver.step(&loads, dt_ms);
            now_ms += dt_ms;
        }
    }
    Ok(curve)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_formula_reads_the_modulus_that_it_was_given() {
        assert!((hertz_kpa(2.0, 1e-3 * 1.7 * hertz_mm2(2.0)) - 1.7).abs() < 1e-12);
        assert!((hertz_mm2(1.0) - 8.433).abs() < 1e-3);
    }
}
