//! Constitutive laws fitted to the stress of brain regions in tension, compression and shear.
//!
//! # Theory
//! Specimens are incompressible. Uniaxial nominal stress is `P₁ - P₃ λ₃/λ₁` at
//! `F = diag(λ, λ^(-1/2), λ^(-1/2))`, which the pressure drops out of; simple shear stress is P₁₂
//! at `F = I + γ e₁ ⊗ e₂`. Every curve counts equally: a residual is divided by the largest stress
//! of its curve and the root of its number of points. P is that of the solver's f64 laws.
//!
//! # Practice
//! A law is fitted to tension and compression, and its shear is a prediction; and to all three, to
//! show what that changes. The program uses the former. No curves of basal ganglia and corpus
//! callosum were found: the published Ogden fits to them stand in.

use super::least_squares::{Minimum, Parameter, minimise};
use glam::{DMat3, DVec3};
use trepan_measurements::{Row, brain, brain_ogden};
use trepan_soft::{Law, NeoHookean, Stiffening};

/// A mode of deformation of a specimen.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mode {
    /// Uniaxial tension; the abscissa is the stretch.
    Tension,
    /// Uniaxial compression; the abscissa is the stretch.
    Compression,
    /// Simple shear; the abscissa is the amount of shear.
    Shear,
}

impl Mode {
    /// All modes.
    pub const ALL: [Self; 3] = [Self::Tension, Self::Compression, Self::Shear];

    /// Name in tables.
    pub fn name(self) -> &'static str {
        ["tension", "compression", "shear"][self as usize]
    }

    /// Nominal stress of a law, in the unit of its moduli.
    pub fn stress(self, law: &Law, at: f64) -> f64 {
        if self == Self::Shear {
            return law.stress(DMat3::from_cols(DVec3::X, DVec3::new(at, 1.0, 0.0), DVec3::Z)).y_axis.x;
        }
        let across = at.powf(-0.5);
        let p = law.stress(DMat3::from_diagonal(DVec3::new(at, across, across)));
        p.x_axis.x - p.z_axis.z * across / at
    }
}

/// A region of the brain.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Region {
    /// Cortex: grey matter.
    Cortex,
    /// Corona radiata: white matter.
    CoronaRadiata,
    /// Basal ganglia.
    BasalGanglia,
    /// Corpus callosum.
    CorpusCallosum,
}

impl Region {
    /// All regions.
    pub const ALL: [Self; 4] = [Self::Cortex, Self::CoronaRadiata, Self::BasalGanglia, Self::CorpusCallosum];

    /// Name in the tables of measurements.
    pub fn name(self) -> &'static str {
        ["cortex", "corona-radiata", "basal-ganglia", "corpus-callosum"][self as usize]
    }

    /// Measured rows of a mode; `None` where only a published fit was found.
    pub fn rows(self, mode: Mode) -> Option<&'static [Row]> {
        let of = match self {
            Self::Cortex => [brain::CORTEX_TENSION, brain::CORTEX_COMPRESSION, brain::CORTEX_SHEAR],
            Self::CoronaRadiata => {
                [brain::CORONA_RADIATA_TENSION, brain::CORONA_RADIATA_COMPRESSION, brain::CORONA_RADIATA_SHEAR]
            }
            Self::BasalGanglia | Self::CorpusCallosum => return None,
        };
        Some(of[mode as usize])
    }

    /// Modulus and exponent of the published Ogden fit.
    pub fn published(self) -> [&'static Row; 2] {
        match self {
            Self::Cortex => [&brain_ogden::CORTEX_OGDEN_SHEAR_MODULUS, &brain_ogden::CORTEX_OGDEN_EXPONENT],
            Self::CoronaRadiata => {
                [&brain_ogden::CORONA_RADIATA_OGDEN_SHEAR_MODULUS, &brain_ogden::CORONA_RADIATA_OGDEN_EXPONENT]
            }
            Self::BasalGanglia => {
                [&brain_ogden::BASAL_GANGLIA_OGDEN_SHEAR_MODULUS, &brain_ogden::BASAL_GANGLIA_OGDEN_EXPONENT]
            }
            Self::CorpusCallosum => {
                [&brain_ogden::CORPUS_CALLOSUM_OGDEN_SHEAR_MODULUS, &brain_ogden::CORPUS_CALLOSUM_OGDEN_EXPONENT]
            }
        }
    }

    /// Modulus fitted to shear alone, published.
    pub fn shear_alone(self) -> &'static Row {
        match self {
            Self::Cortex => &brain_ogden::CORTEX_SHEAR_MODULUS,
            Self::CoronaRadiata => &brain_ogden::CORONA_RADIATA_SHEAR_MODULUS,
            Self::BasalGanglia => &brain_ogden::BASAL_GANGLIA_SHEAR_MODULUS,
            Self::CorpusCallosum => &brain_ogden::CORPUS_CALLOSUM_SHEAR_MODULUS,
        }
    }

    /// Abscissa and stress, kPa, of a mode: measured, or of the published fit at the same places.
    pub fn curve(self, mode: Mode) -> Vec<(f64, f64)> {
        if let Some(rows) = self.rows(mode) {
            return rows.iter().map(|row| (row.at, row.value)).collect();
        }
        let [shear, exponent] = self.published();
        let law = Form::OneTermOgden.law(&[shear.value, exponent.value]);
        let places = Self::Cortex.rows(mode).unwrap_or_default();
        places.iter().map(|row| (row.at, mode.stress(&law, row.at))).collect()
    }
}

/// A form of constitutive law that can be fitted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    /// One modulus.
    NeoHookean,
    /// Two constants.
    MooneyRivlin,
    /// Modulus and exponent.
    OneTermOgden,
    /// Two moduli and exponents of opposite sign.
    TwoTermOgden,
    /// Modulus, neo-Hookean share, bound of the stiffening.
    Stiffening,
}

impl Form {
    /// All forms.
    pub const ALL: [Self; 5] =
        [Self::NeoHookean, Self::MooneyRivlin, Self::OneTermOgden, Self::TwoTermOgden, Self::Stiffening];

    /// Name in tables.
    pub fn name(self) -> &'static str {
        ["neo-Hookean", "Mooney-Rivlin", "Ogden, one term", "Ogden, two terms", "stiffening"][self as usize]
    }

    /// The law with these parameters, moduli in kPa.
    pub fn law(self, p: &[f64]) -> Law {
        let kappa = 1.0;
        match self {
            Self::NeoHookean => Law::NeoHookean(NeoHookean { mu: p[0], kappa }),
            Self::MooneyRivlin => Law::MooneyRivlin { c10: p[0], c01: p[1], kappa },
            Self::OneTermOgden => Law::Ogden { mu: [p[0], 0.0], alpha: [p[1], 1.0], kappa },
            Self::TwoTermOgden => Law::Ogden { mu: [p[0], p[2]], alpha: [p[1], p[3]], kappa },
            Self::Stiffening => Law::Stiffening(Stiffening { mu: p[0], share: p[1], bound: p[2], kappa }),
        }
    }

    fn parameters(self) -> Vec<Parameter> {
        let of = |start, low, high| Parameter { start, limits: [low, high] };
        match self {
            Self::NeoHookean => vec![of(1.0, 0.0, 20.0)],
            Self::MooneyRivlin => vec![of(0.2, -20.0, 20.0), of(0.3, -20.0, 20.0)],
            Self::OneTermOgden => vec![of(1.0, 0.0, 20.0), of(-15.0, -60.0, -1.0)],
            Self::TwoTermOgden => {
                vec![of(1.0, 0.0, 20.0), of(-15.0, -60.0, -1.0), of(0.1, 0.0, 20.0), of(20.0, 1.0, 60.0)]
            }
            Self::Stiffening => vec![of(1.0, 0.0, 20.0), of(0.4, 0.0, 1.0), of(0.02, 1e-3, 0.3)],
        }
    }
}

/// A law fitted to a region.
#[derive(Clone, Debug)]
pub struct Fit {
    /// The region.
    pub region: Region,
    /// The form of the law.
    pub form: Form,
    /// Modes that took part.
    pub fitted: &'static [Mode],
    /// Parameters and their errors.
    pub minimum: Minimum,
    /// The law, moduli in kPa.
    pub law: Law,
}

/// Modes that the program's laws are fitted to.
pub const PULLED: &[Mode] = &[Mode::Tension, Mode::Compression];

impl Fit {
    /// Fits a form to some modes of a region.
    pub fn of(region: Region, form: Form, fitted: &'static [Mode]) -> Self {
        let curves: Vec<(Mode, Vec<(f64, f64)>)> = fitted.iter().map(|&mode| (mode, region.curve(mode))).collect();
        let residuals = |p: &[f64]| {
            let law = form.law(p);
            let of_curve = |(mode, curve): &(Mode, Vec<(f64, f64)>)| {
                let weight = 1.0 / (largest(curve) * (curve.len() as f64).sqrt());
                curve.iter().map(|(at, stress)| weight * (mode.stress(&law, *at) - stress)).collect::<Vec<_>>()
            };
            curves.iter().flat_map(of_curve).collect()
        };
        let minimum = minimise(&form.parameters(), residuals);
        Self { region, form, fitted, law: form.law(&minimum.at), minimum }
    }

    /// Root mean square error of a mode over its largest stress.
    pub fn error(&self, mode: Mode) -> f64 {
        let curve = self.region.curve(mode);
        let squares: f64 = curve.iter().map(|(at, stress)| (mode.stress(&self.law, *at) - stress).powi(2)).sum();
        (squares / curve.len() as f64).sqrt() / largest(&curve)
    }
}

fn largest(curve: &[(f64, f64)]) -> f64 {
    curve.iter().map(|(_, stress)| stress.abs()).fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_fit_of_a_law_to_its_own_curves_gives_its_constants() {
        let found = Fit::of(Region::BasalGanglia, Form::OneTermOgden, &Mode::ALL);
        let [shear, exponent] = Region::BasalGanglia.published();
        assert!((found.minimum.at[0] / shear.value - 1.0).abs() < 1e-4, "{found:?}");
        assert!((found.minimum.at[1] / exponent.value - 1.0).abs() < 1e-4, "{found:?}");
    }

    #[test]
    fn the_stiffening_law_is_convex_in_every_region_and_shear_is_predicted() {
        for region in Region::ALL {
            let fit = Fit::of(region, Form::Stiffening, PULLED);
            assert!(fit.law.is_stable(), "{fit:?}");
            assert!(fit.error(Mode::Shear) < 0.15, "{fit:?}: {}", fit.error(Mode::Shear));
            let plain = Fit::of(region, Form::NeoHookean, PULLED);
            assert!(fit.error(Mode::Shear) < plain.error(Mode::Shear), "{region:?}");
        }
    }
}
