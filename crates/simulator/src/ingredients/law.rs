//! Constitutive laws of the tissue, each with the moduli of a class at small strain.
//!
//! # Sources
//! Exponent of Ogden's law: Miller and Chinzei, J. Biomech. 35 (2002). Ratio of the constants of
//! Mooney and Rivlin: Mendis, Stalnaker and Advani, J. Biomech. Eng. 117 (1995), cited from memory.
//! Uncalibrated, as all materials ([`Material`]).

use clap::ValueEnum;
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
    /// One term with the exponent of brain.
    Ogden,
}

/// c10 over c01 of brain.
const MOONEY_RATIO: f32 = 0.9;

impl Law {
    /// Material of this law with the moduli and the density of another.
    pub(crate) fn like(self, other: Material) -> Material {
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
                Material::Ogden { shear_mpa: [shear_mpa, 0.0], exponent: [-4.7, 1.0], poisson, density_g_mm3 }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tissue_class::TissueClass;

    #[test]
    fn every_law_of_every_class_is_physical_and_has_the_moduli_of_the_class() {
        for (law, class) in Law::value_variants().iter().flat_map(|law| TissueClass::ALL.map(|class| (law, class))) {
            let (was, is) = (class.material(0.003), law.like(class.material(0.003)));
            is.check().unwrap();
            assert!((is.shear_mpa() / was.shear_mpa() - 1.0).abs() < 1e-5, "{is:?}");
            assert!((is.bulk_mpa() / was.bulk_mpa() - 1.0).abs() < 1e-4, "{is:?}");
        }
    }
}
