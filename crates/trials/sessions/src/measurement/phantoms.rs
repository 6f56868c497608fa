//! Phantoms: a rod of silicone that bends under its weight, silicones and rubber that are pulled.
//!
//! # Theory
//! The rod's law and density are those that its experimenters state; its shape is computed.
//!
//! A cube is pulled one way, `F = diag(λ, t, t)` on its two ends, or two ways alike,
//! `F = diag(λ, λ, t)` on its four sides, t such that no force is left across the pull. The force
//! on an end over its area at rest is the nominal stress. Ogden's law with one term goes through
//! the stresses at two stretches of a tension test. All other stretches, and those of the pull two
//! ways, are predicted.

use super::comparison::{Comparison, How};
use trepan_evidence::part::{Part, Scope};
use trepan_evidence::picture::Series;
use trepan_evidence::suite::Findings;
use trepan_geometry::{Vec3, units};
use trepan_measurements::{Row as Measured, phantom_rod, phantom_rubber, phantom_silicone};
use trepan_soft::{Body, Loads, Material, SoftSolver, boxes};
use trepan_tled::{Config, Settling, Tled};
use trepan_trials_tissue::tled::slender::Rod;

/// Cells along and across the rod, in a quick run and in a full one. The coarser ones bend a tenth
/// less than the elastica.
const ROD_CELLS: [[usize; 2]; 2] = [[60, 4], [120, 6]];
/// Poisson's ratio that stands for incompressible silicone under bending, and under a pull to three
/// times the length.
const BENT: f32 = 0.49;
const PULLED: f32 = 0.495;
/// Edge of the cube that is pulled, mm.
const EDGE_MM: f32 = 10.0;

/// Lists the parts.
pub fn parts(_: Scope) -> Vec<Part> {
    vec![
        Part::new("phantom, rod", rod),
        Part::new("phantom, silicones", |_, findings| silicones(findings)),
        Part::new("phantom, rubber", |_, findings| rubber(findings)),
    ]
}

fn rod(scope: Scope, findings: &mut Findings) {
    let rod = Rod { length_mm: phantom_rod::LENGTH.f32(), radius_mm: phantom_rod::RADIUS.f32() };
    let material = Material::MooneyRivlin {
        c10_mpa: phantom_rod::FIRST_CONSTANT.f32(),
        c01_mpa: phantom_rod::SECOND_CONSTANT.f32(),
        poisson: BENT,
        // 1 g/mm³ is 1e6 kg/m³.
        density_g_mm3: 1e-6 * phantom_rod::DENSITY.f32(),
    };
    let (body, tip) = rod.body(scope.pick(ROD_CELLS[0], ROD_CELLS[1]), material);
    let config = Config { averaged_pressure: true, ..Config::default() };
    let mut solver = Tled::new(&body, &config).expect("the rod is sound");
    let loads = Loads { gravity: Vec3::NEG_Z * units::GRAVITY_MM_PER_MS2, ..Loads::default() };
    let settled = solver.settle(&loads, &Settling { tolerance_mm: 0.1, ..Settling::default() });
    let at = if settled.converged { solver.positions()[tip] } else { Vec3::NAN };
    let compare = |row: &Measured, ours: f32| Comparison::of(row, How::Predicted, ours.into()).row();
    findings.rows.push(compare(&phantom_rod::TIP_DROP, -at.z));
    findings.rows.push(compare(&phantom_rod::TIP_REACH, at.x));
    let axis = boxes::nodes_where(&body.mesh, |p| p.y.hypot(p.z) < 1e-3);
    let mut line: Vec<(f64, f64)> =
        axis.into_iter().map(|n| solver.positions()[n as usize]).map(|p| (f64::from(p.x), f64::from(-p.z))).collect();
    line.sort_by(|a, b| a.0.total_cmp(&b.0));
    let tip = (phantom_rod::TIP_REACH.value, phantom_rod::TIP_DROP.value);
    findings.series.push(Series {
        title: "Rod of silicone, 182 mm long, 8.5 mm thick, under its own weight".into(),
        x: "distance from the clamp, mm".into(),
        y: "drop, mm".into(),
        lines: vec![("this project, axis".into(), line), ("measured tip".into(), vec![tip, tip])],
        ..Series::default()
    });
}

fn silicones(findings: &mut Findings) {
    let all = [
        ("Ecoflex 00-10", phantom_silicone::ECOFLEX_10),
        ("Ecoflex 00-30", phantom_silicone::ECOFLEX_30),
        ("Ecoflex 00-50", phantom_silicone::ECOFLEX_50),
        ("Dragon Skin 10", phantom_silicone::DRAGON_SKIN_10),
    ];
    let mut lines = Vec::new();
    for (name, rows) in all {
        // kPa at a strain; the law goes through half and full strain.
        let law = Ogden::through([&rows[1], &rows[3]].map(|row| (1.0 + row.at, 1e-3 * row.value)));
        let ours = |row: &Measured| 1e3 * pulled_mpa(law.material(), 1.0 + row.at, Pull::OneWay);
        for (place, how) in [(0, How::Predicted), (3, How::Fitted), (4, How::Predicted), (5, How::Predicted)] {
            findings.rows.push(compare(&rows[place], "strain", how, ours(&rows[place])).row());
        }
        lines.push((format!("{name}, this project"), rows.iter().map(|row| (row.at, ours(row))).collect()));
        lines.push((format!("{name}, measured"), rows.iter().map(|row| (row.at, row.value)).collect()));
    }
    findings.series.push(Series {
        title: "Silicones pulled one way".into(),
        x: "strain".into(),
        y: "nominal stress, kPa".into(),
        lines,
        ..Series::default()
    });
}

fn rubber(findings: &mut Findings) {
    let (one, two) = (phantom_rubber::TENSION, phantom_rubber::BIAXIAL);
    let law = Ogden::through([&one[0], &one[4]].map(|row| (row.at, row.value)));
    let pulls = [(one, Pull::OneWay, "one way"), (two, Pull::TwoWays, "two ways")];
    let ours = |row: &Measured, pull| pulled_mpa(law.material(), row.at, pull);
    let mut lines = Vec::new();
    for (rows, pull, name) in pulls {
        lines.push((format!("{name}, this project"), rows.iter().map(|row| (row.at, ours(row, pull))).collect()));
        lines.push((format!("{name}, measured"), rows.iter().map(|row| (row.at, row.value)).collect()));
    }
    findings.rows.push(compare(&one[4], "stretch", How::Fitted, ours(&one[4], Pull::OneWay)).row());
    findings.rows.push(compare(&one[2], "stretch", How::Predicted, ours(&one[2], Pull::OneWay)).row());
    for place in [2, 3, 5, 7] {
        let why = "a pull one way does not show the term of negative exponent that a pull two ways needs beyond twice \
                   the length";
        findings
            .rows
            .push(compare(&two[place], "stretch", How::Predicted, ours(&two[place], Pull::TwoWays)).why(why).row());
    }
    findings.series.push(Series {
        title: "Rubber pulled one way and two ways, the law from one way".into(),
        x: "stretch".into(),
        y: "nominal stress, MPa".into(),
        lines,
        ..Series::default()
    });
}

/// Compares our value with a point of a curve, named by its place on the abscissa.
fn compare(row: &Measured, abscissa: &str, how: How, ours: f64) -> Comparison {
    let comparison = Comparison::of(row, how, ours);
    Comparison { quantity: format!("{}, {abscissa} {}", comparison.quantity, row.at), ..comparison }
}

/// Ogden's law with one term, MPa.
#[derive(Clone, Copy, Debug)]
struct Ogden {
    shear_mpa: f64,
    exponent: f64,
}

impl Ogden {
    /// The law through two points of a pull one way, stretch and MPa; the second is the longer one.
    fn through([(near, near_mpa), (far, far_mpa)]: [(f64, f64); 2]) -> Self {
        // `2/α (λ^(α-1) - λ^(-α/2-1))` grows faster between the two the larger α is.
        let of = |stretch: f64, exponent: f64| {
            2.0 / exponent * (stretch.powf(exponent - 1.0) - stretch.powf(-0.5 * exponent - 1.0))
        };
        let (mut low, mut high) = (0.1, 10.0);
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            if of(far, middle) * near_mpa < far_mpa * of(near, middle) { low = middle } else { high = middle }
        }
        Self { shear_mpa: near_mpa / of(near, low), exponent: low }
    }

    fn material(self) -> Material {
        Material::Ogden {
            shear_mpa: [self.shear_mpa as f32, 0.0],
            exponent: [self.exponent as f32, 1.0],
            poisson: PULLED,
            density_g_mm3: units::WATER_G_PER_MM3,
        }
    }
}

/// How a cube is pulled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Pull {
    /// By two opposite sides.
    OneWay,
    /// By four sides alike.
    TwoWays,
}

/// A cube with nodes on the pulled sides held where the pull has them.
struct Cube {
    body: Body,
    solver: Tled,
    pull: Pull,
}

/// Forces on a cube's ends, N.
#[derive(Clone, Copy)]
struct Forces {
    along: f64,
    across: f64,
}

impl Cube {
    fn of(material: Material, pull: Pull) -> Self {
        let mesh = boxes::split_box([2; 3], Vec3::splat(EDGE_MM));
        let is_end = |x: f32| !(1e-3..EDGE_MM - 1e-3).contains(&x);
        let fixed = boxes::nodes_where(&mesh, |p| is_end(p.x) || pull == Pull::TwoWays && is_end(p.y));
        let body = Body::uniform(mesh, fixed, material);
        let config = Config { averaged_pressure: true, ..Config::default() };
        let solver = Tled::new(&body, &config).expect("the cube is sound");
        Self { body, solver, pull }
    }

    /// Forces at rest with these stretches along and across the pull; NaN without rest.
    fn forces(&mut self, along: f64, across: f64) -> Forces {
        let beside = if self.pull == Pull::TwoWays { along } else { across };
        let more = Vec3::new(along as f32, beside as f32, across as f32) - 1.0;
        for (n, p) in self.body.mesh.positions.iter().enumerate() {
            self.solver.set_node(n as u32, *p * more, Vec3::ZERO);
        }
        let settled = self.solver.settle(&Loads::default(), &Settling { tolerance_mm: 1e-4, ..Settling::default() });
        let at = |n: &&u32, axis: usize| self.body.mesh.positions[**n as usize][axis] > EDGE_MM - 1e-3;
        let sum = |axis: usize| -> f64 {
            let end = self.body.fixed.iter().filter(|n| at(n, axis));
            end.map(|&n| f64::from(self.solver.support_force(n)[axis])).sum()
        };
        let nothing = if settled.converged { 0.0 } else { f64::NAN };
        Forces { along: sum(0) + nothing, across: sum(2) }
    }
}

/// Nominal stress of a cube pulled to `stretch`, MPa. Across the pull it is free: its stretch there
/// is the one at which no force is left, found by the secant method.
fn pulled_mpa(material: Material, stretch: f64, pull: Pull) -> f64 {
    let mut cube = Cube::of(material, pull);
    let mut across = if pull == Pull::TwoWays { stretch.powi(-2) } else { stretch.powf(-0.5) };
    let (mut before, mut forces) = (1.001 * across, cube.forces(stretch, across));
    let mut forces_before = cube.forces(stretch, before);
    for _ in 0..8 {
        let slope = (forces.across - forces_before.across) / (across - before);
        if !slope.is_normal() || forces.across.abs() < 1e-4 * forces.along.abs() {
            break;
        }
        (before, forces_before) = (across, forces);
        across -= forces.across / slope;
        forces = cube.forces(stretch, across);
    }
    forces.along / f64::from(EDGE_MM * EDGE_MM)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Incompressible Ogden solid, closed form: `2 μ/α (λ^(α-1) - λ^(-2α-1))` for a pull two ways.
    #[test]
    fn a_pulled_cube_bears_the_closed_form() {
        let law = Ogden { shear_mpa: 0.4, exponent: 1.6 };
        for stretch in [1.3f64, 2.0] {
            let of = |across: f64| {
                2.0 * law.shear_mpa / law.exponent
                    * (stretch.powf(law.exponent - 1.0) - stretch.powf(-across * law.exponent - 1.0))
            };
            for (pull, across) in [(Pull::OneWay, 0.5), (Pull::TwoWays, 2.0)] {
                let share = pulled_mpa(law.material(), stretch, pull) / of(across);
                assert!((share - 1.0).abs() < 0.02, "{pull:?} {stretch}: {share}");
            }
        }
    }

    #[test]
    fn the_law_goes_through_both_points() {
        let law = Ogden::through([(1.5, 0.02), (2.0, 0.04)]);
        let ratio = pulled_mpa(law.material(), 2.0, Pull::OneWay) / pulled_mpa(law.material(), 1.5, Pull::OneWay);
        assert!((ratio / 2.0 - 1.0).abs() < 0.01, "{ratio}");
    }
}
