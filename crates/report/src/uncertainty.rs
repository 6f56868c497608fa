//! Bands on forces and times from the spread of the physical constants.
//!
//! # Theory
//! A constant is known within a factor f ([`Row::factor`]): one standard deviation where a spread
//! was published. To first order in logarithms an output is known within `f^s`, with
//! `s = d ln output / d ln constant`:
//! ```text
//! force on tissue   s = d / (d + F/k)    d: how far the tissue gave way, F/k: the hand's spring
//! time of drilling  s = F / (F - F₀)     F: mean load on the burr, F₀: load under which it rubs
//! ```
//! The force of a tissue that gives way by d is in proportion to its stiffness; a hand that holds
//! its place sinks in deeper where tissue is softer, and feels less of the difference. The secant
//! F/d stands for the tangent, which is stiffer: the band is rather too wide.
//!
//! # Practice
//! The force on bone has no band: it is that of the spring between hand and tool. The band says
//! nothing of the error of the method; `--quality` bounds that.

use crate::constants;
use serde::Serialize;
use trepan_measurements::{Row, drilling, sensitivity};
use trepan_rigid::removal::Cutter;
use trepan_stages::score::ScoreKeeper;

/// Stiffness of brain, with its spread between sources.
pub const STIFFNESS: Row = sensitivity::SHEAR_MODULUS;
/// Energy of cutting bone.
pub const ENERGY: Row = drilling::BURR_ENERGY;
/// Radius of the burr that the session begins with, mm.
const BURR_MM: f32 = 3.0;
/// Largest power that a time of drilling takes from the energy: nearer to rubbing the first order
/// fails.
const MOST_POWER: f64 = 3.0;

/// A value and the band that the spread of a constant leaves it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Band {
    /// The value.
    pub value: f64,
    /// Lower end of the band.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

impl Band {
    /// Band of a value that changes with a power of a constant.
    fn of(value: f64, row: &Row, power: f64) -> Self {
        let factor = row.factor().powf(power);
        Self { value, low: value / factor, high: value * factor }
    }

    /// Band of a force of tissue, N.
    ///
    /// The hand stands `way_mm` past the rest surface, `depth_mm` of that in the present one.
    pub fn of_tissue_force(force_n: f32, way_mm: f32, depth_mm: f32) -> Self {
        let power = ((way_mm - depth_mm) / way_mm).clamp(0.0, 1.0);
        // Tissue that moved towards the tool, or an unknown way: the widest band.
        let known = way_mm > depth_mm && power.is_finite();
        Self::of(force_n.into(), &STIFFNESS, if known { power.into() } else { 1.0 })
    }

    /// Band of a time of drilling, s, under a mean load, newtons of the task.
    pub fn of_drilling(seconds: f64, load_n: f64) -> Self {
        let cuts_n = load_n - f64::from(Cutter::BURR.rubbing_n(BURR_MM));
        Self::of(seconds, &ENERGY, if cuts_n > 0.0 { (load_n / cuts_n).min(MOST_POWER) } else { MOST_POWER })
    }
}

/// Bands of a session's results; `null` for what did not happen.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Bands {
    /// Greatest force of tissue on the hand, N.
    pub tissue_force_n: Option<Band>,
    /// Time of drilling, s.
    pub drilling_s: Option<Band>,
}

impl Bands {
    /// Bands of scores; `scale` is the newtons at the hand per newton of the task, on bone.
    pub fn of(scores: &ScoreKeeper, scale: f32) -> Self {
        let ScoreKeeper { peak_tissue_force_n, peak_tissue, drilling_s, cutting: [newton_s, cutting_s], .. } = *scores;
        let load_n = newton_s / (cutting_s * f64::from(scale));
        let [way_mm, depth_mm] = peak_tissue;
        let force = Band::of_tissue_force(peak_tissue_force_n, way_mm, depth_mm);
        Self {
            tissue_force_n: (peak_tissue_force_n > 0.0).then_some(force),
            drilling_s: (cutting_s > 0.0 && scale > 0.0).then(|| Band::of_drilling(drilling_s, load_n)),
        }
    }

    /// Each band in a sentence.
    pub fn sentences(&self) -> Vec<String> {
        let force = self.tissue_force_n.map(|Band { value, low, high }| {
            format!(
                "The brain was pressed with up to {value:.2} N; as soft or stiff as brains may be, {low:.2} to {high:.2} N."
            )
        });
        let time = self.drilling_s.map(|Band { value, low, high }| {
            format!("Drilling took {value:.1} s; in bone as soft or hard as bone may be, {low:.0} to {high:.0} s.")
        });
        force.into_iter().chain(time).collect()
    }
}

/// Error of a force by the method beside what the constants leave open, in words.
pub fn beside(error_n: f64, force_n: f64) -> String {
    let Band { low, high, .. } = Band::of(100.0, &STIFFNESS, 1.0);
    let by_method = 100.0 * error_n / force_n;
    format!("model error {by_method:.0} % of the force, constants -{:.0} to +{:.0} %", 100.0 - low, high - 100.0)
}

/// How far finer models can bring forces and times nearer to the patient's, in words.
pub fn limits() -> String {
    format!(
        "constants: tissue is known within a factor of {:.2} in stiffness, bone within {:.2} in the energy of cutting; \
         models finer than that agree better with each other, not with the patient ({})\n",
        STIFFNESS.factor(),
        ENERGY.factor(),
        constants::sentence()
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use trepan_contact::NodalContact;
    use trepan_geometry::Vec3;
    use trepan_patient::TissueClass;
    use trepan_rigid::removal::{Pressed, RemovalLaw};
    use trepan_soft::{Body, Loads, Material, SoftSolver, boxes};
    use trepan_stages::haptic_config::TISSUE;
    use trepan_tled::{Config, Settling, Tled};

    /// Force of a block on a hand 5 mm past its surface, N, and how far that gave way, mm.
    fn pressed(material: Material) -> [f32; 2] {
        let mesh = boxes::centred_box([4; 3], Vec3::splat(30.0));
        let fixed = boxes::nodes_where(&mesh, |p| p.z < 1e-3);
        let mut contact = NodalContact::none();
        let middle = Vec3::new(15.0, 15.0, 30.0);
        boxes::nodes_where(&mesh, |p| p.distance(middle) < 8.0 && p.z > 29.99)
            .iter()
            .for_each(|node| contact.add(*node, 1.0));
        contact.normalise();
        (contact.normal, contact.stiffness, contact.offset_mm) = (Vec3::Z, TISSUE.stiffness, 5.0 - 30.0);
        let config = Config { mass_scaling: f32::INFINITY, averaged_pressure: true, ..Config::default() };
        let body = Body::uniform(mesh, fixed, material);
        let mut solver = Tled::new(&body, &config).unwrap();
        let settling = Settling { tolerance_mm: 1e-3, ..Settling::default() };
        let settled = solver.settle(&Loads { contacts: contact.into(), ..Loads::default() }, &settling);
        [settled.last.contact_n, 30.0 - contact.mean(|node| solver.positions()[node as usize]).z]
    }

    #[test]
    fn the_band_of_a_press_is_that_of_softer_and_stiffer_tissue() {
        let factor = STIFFNESS.factor() as f32;
        for law in [TissueClass::material, TissueClass::stiffening] {
            let [usual, soft, stiff] =
                [1.0, 1.0 / factor, factor].map(|share| pressed(law(TissueClass::Brain, 0.003 * share)));
            let band = Band::of_tissue_force(usual[0], 5.0, 5.0 - usual[1]);
            println!("{usual:?} N and mm, {soft:?} softer, {stiff:?} stiffer: {band:?}");
            assert!(usual[0] > 0.05 && band.low < f64::from(usual[0]), "{usual:?} {band:?}");
            for (is, truth) in [(band.low, soft[0]), (band.high, stiff[0])] {
                assert!((is / f64::from(truth) - 1.0).abs() < 0.15, "{is} N, pressed {truth} N");
            }
        }
    }

    #[test]
    fn the_band_of_a_time_of_drilling_is_that_of_cutters_of_less_and_more_energy() {
        let rate = |share: f32| {
            let cutter = Cutter { chip_energy_mpa: Cutter::BURR.chip_energy_mpa * share, ..Cutter::BURR };
            let RemovalLaw::Rate { perforator, cancellous_share, stiffness, max_load_n, .. } = RemovalLaw::RATE else {
                unreachable!()
            };
            let law = RemovalLaw::Rate { cutter, perforator, cancellous_share, stiffness, max_load_n };
            let pressed = Pressed { radius_mm: BURR_MM, depth_mm: 14.0 / stiffness, cosine: 0.0, dt_ms: 1.0 };
            f64::from(law.volume_mm3(&pressed))
        };
        let step = 1.05;
        let truth = (rate(1.0 / step) / rate(step)).ln() / (2.0 * f64::from(step).ln());
        let band = Band::of_drilling(1.0, 14.0);
        let power = band.high.ln() / ENERGY.factor().ln();
        assert!((power / truth - 1.0).abs() < 0.02, "{power} of {truth}");
        assert!(Band::of_drilling(1.0, 1.0).high > band.high, "near to rubbing");
    }

    #[test]
    fn a_hand_that_is_followed_by_all_of_the_tissue_feels_all_of_its_spread() {
        let factor = STIFFNESS.factor();
        let all = Band::of_tissue_force(1.0, 4.0, 0.0);
        assert!((all.high - factor).abs() < 1e-6 && (all.low * factor - 1.0).abs() < 1e-6, "{all:?}");
        assert_eq!(Band::of_tissue_force(1.0, -2.0, 1.0), Band::of_tissue_force(1.0, f32::INFINITY, 1.0));
        let none = Bands::of(&ScoreKeeper::default(), 0.2);
        assert_eq!((none, none.sentences().len()), (Bands::default(), 0));
        let mut scores = ScoreKeeper::default();
        (scores.peak_tissue_force_n, scores.peak_tissue) = (0.2, [3.0, 1.0]);
        (scores.drilling_s, scores.cutting) = (6.0, [10.0, 5.0]);
        let sentences = Bands::of(&scores, 0.2).sentences();
        assert!(sentences[0].starts_with("The brain was pressed with up to 0.20 N; "), "{sentences:?}");
        assert!(sentences[1].starts_with("Drilling took 6.0 s; "), "{sentences:?}");
        assert!(beside(0.01, 0.1).starts_with("model error 10 % of the force, constants -"));
    }
}
