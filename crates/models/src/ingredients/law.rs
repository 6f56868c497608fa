//! Constitutive laws of the tissue, each with the moduli of a class at small strain.
//!
//! # Sources
//! Rows of `trepan-measurements`. The stiffening law is fitted to human brain (Budday et al. 2017);
//! the exponent of Ogden's law is that of swine (Miller and Chinzei, J. Biomech. 35, 2002), the
//! ratio of Mooney and Rivlin's constants from memory (Mendis, Stalnaker and Advani 1995).

use clap::ValueEnum;
use trepan_measurements::brain_living;
use trepan_patient::TissueClass;
use trepan_soft::Material;

/// Constitutive law of a tissue.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Law {
    /// Compressible neo-Hookean.
    NeoHookean,
    /// Linear in Green's strain; for comparison, it gives way under compression.
    StVenantKirchhoff,
    /// Both isochoric invariants, c10 = 0.9 c01.
    MooneyRivlin,
    /// One term with the exponent of swine brain.
    Ogden,
    /// Fitted to human brain, region by region: stiffens with strain, more in compression.
    Stiffening,
}

/// c10 over c01 of brain.
const MOONEY_RATIO: f32 = brain_living::MOONEY_RATIO.f32();

impl Law {
    /// Material of this law for a class and a Young's modulus of brain, MPa.
    pub fn material(self, class: TissueClass, brain_mpa: f32) -> Material {
        let other = class.material(brain_mpa);
        let (poisson, density_g_mm3) = (other.poisson(), other.density_g_mm3());
        let (young_mpa, shear_mpa) = (other.young_mpa() as f32, other.shear_mpa() as f32);
        match self {
            Self::NeoHookean => other,
            Self::StVenantKirchhoff => Material::StVenantKirchhoff { young_mpa, poisson, density_g_mm3 },
            Self::MooneyRivlin => {
                let c01_mpa = 0.5 * shear_mpa / (1.0 + MOONEY_RATIO);
                Material::MooneyRivlin { c10_mpa: MOONEY_RATIO * c01_mpa, c01_mpa, poisson, density_g_mm3 }
            }
            Self::Ogden => {
                let exponent = [brain_living::SWINE_OGDEN_EXPONENT.f32(), 1.0];
                Material::Ogden { shear_mpa: [shear_mpa, 0.0], exponent, poisson, density_g_mm3 }
            }
            Self::Stiffening => class.stiffening(brain_mpa),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_law_of_every_class_is_physical_and_has_the_moduli_of_the_class() {
        for (law, class) in Law::value_variants().iter().flat_map(|law| TissueClass::ALL.map(|class| (law, class))) {
            let (was, is) = (class.material(0.003), law.material(class, 0.003));
            is.check().unwrap();
            if *law == Law::Stiffening && [TissueClass::White, TissueClass::Grey].contains(&class) {
                continue;
            }
            assert!((is.shear_mpa() / was.shear_mpa() - 1.0).abs() < 1e-5, "{is:?}");
            assert!((is.bulk_mpa() / was.bulk_mpa() - 1.0).abs() < 1e-4, "{is:?}");
        }
    }

    #[test]
    fn human_grey_matter_is_stiffer_than_white_and_both_have_the_mean_of_brain() {
        let [brain, white, grey] = [TissueClass::Brain, TissueClass::White, TissueClass::Grey]
            .map(|class| Law::Stiffening.material(class, 0.003).young_mpa());
        assert!(grey > 1.5 * white && ((grey + white) / (2.0 * brain) - 1.0).abs() < 1e-3, "{brain} {white} {grey}");
    }
}
