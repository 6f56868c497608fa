//! Stress of brain regions in tension, compression and shear; relaxation; rate; living brain.
//!
//! # Practice
//! Stress comes from the solver's laws with the constants of the program: the f64 law at points of
//! a homogeneous deformation, and a block of the solver's f32 elements held in one.

use super::comparison::{Comparison, How};
use crate::calibration::regions::{Fit, Form, Mode, PULLED, Region};
use crate::calibration::{drawn, of_program, relaxation};
use glam::Mat3;
use trepan_evidence::part::{Part, Scope};
use trepan_evidence::picture::Series;
use trepan_evidence::suite::Findings;
use trepan_geometry::Vec3;
use trepan_measurements::{Row, brain, brain_living, brain_rate, brain_relaxation, fits, tissue};
use trepan_patient::TissueClass;
use trepan_soft::{Body, Loads, Material, SoftSolver, boxes};
use trepan_tled::{Config, Relaxation, Tled};

/// kPa in a MPa.
const KPA: f64 = 1e3;
/// Edge of a block that is held, mm; the larger, the longer its stable step.
const EDGE_MM: f32 = 1000.0;

/// Lists the parts.
pub fn parts(_: Scope) -> Vec<Part> {
    vec![
        Part::new("brain density", |_, findings| density(findings)),
        Part::new("brain regions", |_, findings| regions(findings)),
        Part::new("brain elements", |_, findings| elements(findings)),
        Part::new("brain relaxation", |_, findings| relaxing(findings)),
        Part::new("brain rate", |_, findings| rate(findings)),
        Part::new("brain moduli", |_, findings| moduli(findings)),
    ]
}

fn density(findings: &mut Findings) {
    let ours = f64::from(Material::BRAIN.density_g_mm3()) * 1e3;
    findings.rows.push(Comparison::of(&brain::DENSITY, How::Predicted, ours).row());
}

/// Stress at the end of every curve, and in the middle of shear, with the constants of the program.
fn regions(findings: &mut Findings) {
    let mut errors = Vec::new();
    for region in Region::ALL {
        let law = of_program(region);
        findings.series.extend(Mode::ALL.map(|mode| drawn(region, mode).1));
        for mode in Mode::ALL {
            let Some(rows) = region.rows(mode) else { continue };
            let end = if mode == Mode::Compression { &rows[0] } else { &rows[rows.len() - 1] };
            let how = if mode == Mode::Shear { How::Predicted } else { How::Fitted };
            let why = "tension and compression alone leave the shear of this region open by a fifth";
            findings.rows.push(at_point(end, mode, how, mode.stress(&law, end.at)).why(why).row());
            if mode == Mode::Shear {
                let middle = &rows[rows.len() / 2 - 1];
                let why = "tension and compression begin stiffer than shear does: published fits to shear alone are softer too, \
                           0.54 against 0.66 kPa in the corona radiata";
                findings.rows.push(at_point(middle, mode, how, mode.stress(&law, middle.at)).why(why).row());
            }
        }
        let (ours, published) = (law.moduli().0, region.published()[0]);
        findings.rows.push(Comparison::of(published, How::Fitted, ours).row());
        let why = "the published value was fitted to shear alone, ours to tension and compression";
        findings.rows.push(Comparison::of(region.shear_alone(), How::Predicted, ours).why(why).row());
        let error = |form| 100.0 * Fit::of(region, form, PULLED).error(Mode::Shear);
        let [ours, ogden, plain] = [Form::Stiffening, Form::OneTermOgden, Form::NeoHookean].map(error);
        errors.push(format!("{} {ours:.1} % (Ogden {ogden:.1} %, neo-Hookean {plain:.1} %)", region.name()));
    }
    findings.conclusions.push(format!(
        "Shear predicted from tension and compression, root mean square error over the largest stress: {}.",
        errors.join(", ")
    ));
}

/// A point of a curve, told apart from its other points.
fn at_point(row: &Row, mode: Mode, how: How, ours: f64) -> Comparison {
    let at = if mode == Mode::Shear { "shear" } else { "stretch" };
    let compared = Comparison::of(row, how, ours);
    Comparison { name: format!("{} at {at} {}", compared.name, row.at), ..compared }
}

/// A block of elements of a material, every node held at `F X`.
fn held(material: Material, relaxation: Relaxation, f: Mat3) -> Tled {
    let mesh = boxes::split_box([2; 3], Vec3::splat(EDGE_MM));
    let fixed = (0..mesh.positions.len() as u32).collect();
    let body = Body::uniform(mesh, fixed, material);
    let mut tled = Tled::new(&body, &Config { relaxation, ..Config::default() }).expect("the block is sound");
    for (n, p) in body.mesh.positions.iter().enumerate() {
        tled.set_node(n as u32, f * *p - *p, Vec3::ZERO);
    }
    tled
}

/// Nominal stress on the far face across an axis, along an axis, kPa.
fn on_face(tled: &Tled, rest: &[Vec3], across: usize, along: usize) -> f64 {
    let far = rest.iter().enumerate().filter(|(_, p)| p[across] > 0.99 * EDGE_MM);
    let force_n: f64 = far.map(|(n, _)| f64::from(tled.support_force(n as u32)[along])).sum();
    KPA * force_n / f64::from(EDGE_MM * EDGE_MM)
}

/// Stress of a held block, kPa.
fn of_block(material: Material, mode: Mode, at: f64) -> f64 {
    let (across, at32) = (at.powf(-0.5), at as f32);
    let f = match mode {
        Mode::Shear => Mat3::from_cols(Vec3::X, Vec3::new(at32, 1.0, 0.0), Vec3::Z),
        _ => Mat3::from_diagonal(Vec3::new(at32, across as f32, across as f32)),
    };
    let mut tled = held(material, Relaxation::NONE, f);
    tled.step(&Loads::default(), tled.stable_dt_ms());
    let rest = boxes::split_box([2; 3], Vec3::splat(EDGE_MM)).positions;
    match mode {
        Mode::Shear => on_face(&tled, &rest, 1, 0),
        _ => on_face(&tled, &rest, 0, 0) - on_face(&tled, &rest, 2, 2) * across / at,
    }
}

/// The f32 elements of the solver, in the middle of the curves.
fn elements(findings: &mut Findings) {
    let cases = [
        (Material::CORTEX, Region::Cortex, Mode::Compression, How::Fitted),
        (Material::CORTEX, Region::Cortex, Mode::Shear, How::Predicted),
        (Material::CORONA_RADIATA, Region::CoronaRadiata, Mode::Compression, How::Fitted),
    ];
    for (material, region, mode, how) in cases {
        let rows = region.rows(mode).unwrap_or_default();
        let row = &rows[rows.len() * 3 / 4 - if mode == Mode::Compression { rows.len() / 2 } else { 0 }];
        let compared = at_point(row, mode, how, of_block(material, mode, row.at));
        let name = format!("{}, elements", compared.name);
        findings.rows.push(Comparison { name, ..compared }.row());
    }
}

/// A shear that is held over four minutes, by the solver's stress memory.
fn relaxing(findings: &mut Findings) {
    let f = Mat3::from_cols(Vec3::X, Vec3::new(0.1, 1.0, 0.0), Vec3::Z);
    let rest = boxes::split_box([2; 3], Vec3::splat(EDGE_MM)).positions;
    let mut tled = held(Material::WHOLE_BRAIN, Relaxation::SOLID_AND_FLUID, f);
    let dt_ms = tled.stable_dt_ms();
    let (mut curve, mut peak) = (Vec::new(), f64::NAN);
    let last = brain_relaxation::CURVE[brain_relaxation::CURVE.len() - 1].at;
    for step in 0..=(last * 1e3 / f64::from(dt_ms)) as usize + 1 {
        tled.step(&Loads::default(), dt_ms);
        let stress = on_face(&tled, &rest, 1, 0);
        peak = if step == 0 { stress } else { peak };
        curve.push((step as f64 * f64::from(dt_ms) * 1e-3, stress / peak));
    }
    for row in &brain_relaxation::CURVE[1..] {
        let later = curve.iter().find(|(seconds, _)| *seconds >= row.at).map_or(f64::NAN, |(_, left)| *left);
        let compared = Comparison::of(row, How::Fitted, later);
        findings.rows.push(Comparison { name: format!("{} at {} s", compared.name, row.at), ..compared }.row());
    }
    let thinned = curve.iter().step_by(curve.len() / 100 + 1).copied().collect();
    let swine = Relaxation::BRAIN;
    let of_swine = |seconds: f64| {
        let term = |i: usize| f64::from(swine.share[i]) * (1.0 - (-1e3 * seconds / f64::from(swine.time_ms[i])).exp());
        (seconds, 1.0 - term(0) - term(1))
    };
    findings.series.push(Series {
        title: "A shear held for four minutes".into(),
        x: "time, s".into(),
        y: "stress over its peak".into(),
        lines: vec![
            ("this project, elements".into(), thinned),
            ("measured".into(), brain_relaxation::CURVE.iter().map(|row| (row.at, row.value)).collect()),
            ("swine, two terms, from memory".into(), (0..=50).map(|i| of_swine(5.0 * f64::from(i))).collect()),
        ],
        ..Series::default()
    });
}

/// Share of the stress that is left after a long time.
fn left() -> f64 {
    let shares = [&fits::RELAXATION_SOLID_SHARE, &fits::RELAXATION_FLUID_SHARE, &fits::RELAXATION_SLOW_SHARE];
    relaxation::left(&shares.map(|row| row.value), f64::INFINITY)
}

/// A class of the program at hand speed.
fn at_hand_speed(class: TissueClass) -> Material {
    class.stiffening(1e-3 * brain_living::YOUNG_MODULUS.f32() * fits::HAND_SPEED_FACTOR.f32())
}

/// Shear modulus of a class at hand speed, kPa.
fn fast_kpa(class: TissueClass) -> f64 {
    KPA * at_hand_speed(class).shear_mpa()
}

/// Strain rates of an impact, which the program's relaxation does not reach.
fn rate(findings: &mut Findings) {
    let law = at_hand_speed(TissueClass::Brain).law();
    let why = "an impact of 10 ms or less: no relaxation faster than 9.7 s was fitted, and a hand is a thousand \
               times slower";
    for (rows, stretch) in [(brain_rate::COMPRESSION, 0.7), (brain_rate::TENSION, 1.3)] {
        for row in [&rows[0], &rows[rows.len() - 1]] {
            let ours = KPA * Mode::Tension.stress(&law, stretch).abs();
            let compared = Comparison::of(row, How::Predicted, ours);
            let name = format!("{} at {} /s", compared.name, row.at);
            findings.rows.push(Comparison { name, ..compared }.why(why).row());
        }
    }
}

/// Moduli of the program's classes at hand speed and after minutes.
fn moduli(findings: &mut Findings) {
    let [brain, white, grey, soft] =
        [TissueClass::Brain, TissueClass::White, TissueClass::Grey, TissueClass::SoftTumour].map(fast_kpa);
    let why = "one factor scales all moduli of the program to six measured ones, which disagree by more than this";
    let fitted = [
        (&brain_relaxation::CORTEX_LONG_TERM_MODULUS, grey * left()),
        (&brain_relaxation::CORTEX_RELAXING_MODULUS, grey * (1.0 - left())),
        (&brain_relaxation::CORONA_RADIATA_LONG_TERM_MODULUS, white * left()),
        (&brain_relaxation::CORONA_RADIATA_RELAXING_MODULUS, white * (1.0 - left())),
        (&brain_living::GRAVITY_SHEAR_MODULUS, brain * left()),
    ];
    findings.rows.extend(fitted.map(|(row, ours)| Comparison::of(row, How::Fitted, ours).why(why).row()));
    let why = "elastography shakes at tens of Hz and reads stiffer than a slow test; no such fast relaxation was \
               fitted";
    let predicted = [
        (&tissue::HEALTHY_MODULUS, brain),
        (&tissue::GLIOBLASTOMA_MODULUS, soft),
        (&brain_living::ELASTOGRAPHY_WHITE, white),
        (&brain_living::ELASTOGRAPHY_GREY, grey),
    ];
    findings.rows.extend(predicted.map(|(row, ours)| Comparison::of(row, How::Predicted, ours).why(why).row()));
    let why = "swine, contested: the same form of law fitted to human brain has 0.66 to 1.43 kPa in a slower test";
    let swine = Comparison::of(&brain_living::SWINE_OGDEN_SHEAR_MODULUS, How::Predicted, brain).why(why);
    findings.rows.push(swine.row());
}
