//! A material for a tetrahedron that holds several.
//!
//! # Theory
//! Of parts with volume shares f and moduli M, equal strain gives Voigt's bound `Σ f M`, equal
//! stress Reuss's `1 / Σ (f / M)`; Hill's is their mean. The best upper bound of an isotropic mix
//! is Hashin and Shtrikman's, with K and μ of the stiffest part: it holds for soft pockets, such as
//! fluid, in a stiffer matrix, where Hill's is half of Voigt's however few they are.
//! ```text
//! K* = 1 / Σ f/(Kᵢ + z) - z, z = 4/3 μ    μ* = 1 / Σ f/(μᵢ + z) - z, z = μ/6 (9 K + 8 μ)/(K + 2 μ)
//! ```
//! The law is that of the part with most of Voigt's shear modulus. Where it is the stiffening one,
//! its share and bound are means, weighted by what they act on.
//!
//! The bulk modulus is rounded to a power of 4 times a reference's: averaged nodal pressure keeps
//! apart elements of different bulk moduli ([`Body::bulk_groups`](crate::Body::bulk_groups)), and
//! would lock again if every tetrahedron had its own. Brain's stands for that of water anyway.
//!
//! # Sources
//! R. Hill: The elastic behaviour of a crystalline aggregate, Proc. Phys. Soc. A 65, 1952, with
//! Voigt's (1889) and Reuss's (1929) bounds. Z. Hashin, S. Shtrikman: A variational approach to the
//! theory of the elastic behaviour of multiphase materials, J. Mech. Phys. Solids 11, 1963.

use crate::Material;

/// How the moduli of parts make one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Bound {
    /// Equal strain, the stiffest.
    Voigt,
    /// Equal stress, the softest.
    Reuss,
    /// The mean of both.
    Hill,
    /// The best upper bound for isotropic mixes.
    HashinShtrikman,
}

impl Bound {
    /// Shear and bulk modulus of parts, each with its share of the volume and its two moduli.
    pub fn of(self, parts: &[(f64, [f64; 2])]) -> [f64; 2] {
        let most = |n: usize| parts.iter().map(|(_, moduli)| moduli[n]).fold(0.0, f64::max);
        let mean = |n: usize, z: f64| 1.0 / parts.iter().map(|(f, moduli)| f / (moduli[n] + z)).sum::<f64>() - z;
        let voigt = |n: usize| parts.iter().map(|(f, moduli)| f * moduli[n]).sum::<f64>();
        match self {
            Self::Voigt => [0, 1].map(voigt),
            Self::Reuss => [0, 1].map(|n| mean(n, 0.0)),
            Self::Hill => [0, 1].map(|n| 0.5 * (voigt(n) + mean(n, 0.0))),
            Self::HashinShtrikman => {
                let (mu, kappa) = (most(0), most(1));
                [mean(0, mu / 6.0 * (9.0 * kappa + 8.0 * mu) / (kappa + 2.0 * mu)), mean(1, 4.0 / 3.0 * mu)]
            }
        }
    }
}

impl Material {
    /// Mixes parts, given by their shares of the volume, which add up to 1.
    ///
    /// The bulk modulus is that of `reference` times a power of 4, and at least 2/3 of the shear
    /// modulus. `None` without a part.
    pub fn mixture(parts: &[(f64, Self)], bound: Bound, reference: &Self) -> Option<Self> {
        let weight = |(share, part): &(f64, Self)| share * part.shear_mpa();
        let first = parts.iter().max_by(|a, b| weight(a).total_cmp(&weight(b)))?.1;
        let moduli = |(share, part): &(f64, Self)| (*share, [part.shear_mpa(), part.bulk_mpa()]);
        let [shear, bulk] = bound.of(&parts.iter().map(moduli).collect::<Vec<_>>());
        let rounded = (0.5 * (bulk / reference.bulk_mpa()).log2()).round().exp2().powi(2);
        let density = parts.iter().map(|(share, part)| share * f64::from(part.density_g_mm3())).sum::<f64>();
        let mut mixed = first.with_moduli(shear, rounded * reference.bulk_mpa(), density);
        if let Self::Stiffening { share: mixed_share, bound: mixed_bound, .. } = &mut mixed {
            let (mut all, mut plain, mut stiff, mut bounds) = (0.0, 0.0, 0.0, 0.0);
            for part in parts {
                if let Self::Stiffening { share, bound, .. } = part.1 {
                    let rest = weight(part) * f64::from(1.0 - share);
                    all += weight(part);
                    plain += weight(part) * f64::from(share);
                    (stiff, bounds) = (stiff + rest, bounds + rest * f64::from(bound));
                }
            }
            (*mixed_share, *mixed_bound) = ((plain / all) as f32, (bounds / stiff) as f32);
        }
        Some(mixed)
    }

    /// The same law with other moduli at small strain, MPa, and density, g/mm³.
    fn with_moduli(self, shear: f64, bulk: f64, density: f64) -> Self {
        let ratio = (shear / self.shear_mpa()) as f32;
        let poisson = ((3.0 * bulk - 2.0 * shear) / (2.0 * (3.0 * bulk + shear))).max(0.0);
        let young_mpa = (2.0 * shear * (1.0 + poisson)) as f32;
        let (poisson, density_g_mm3) = (poisson as f32, density as f32);
        match self {
            Self::NeoHookean { .. } => Self::NeoHookean { young_mpa, poisson, density_g_mm3 },
            Self::StVenantKirchhoff { .. } => Self::StVenantKirchhoff { young_mpa, poisson, density_g_mm3 },
            Self::MooneyRivlin { c10_mpa, c01_mpa, .. } => {
                Self::MooneyRivlin { c10_mpa: c10_mpa * ratio, c01_mpa: c01_mpa * ratio, poisson, density_g_mm3 }
            }
            Self::Ogden { shear_mpa, exponent, .. } => {
                Self::Ogden { shear_mpa: shear_mpa.map(|mu| mu * ratio), exponent, poisson, density_g_mm3 }
            }
            Self::Stiffening { share, bound, .. } => {
                Self::Stiffening { shear_mpa: shear as f32, share, bound, poisson, density_g_mm3 }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ALL: [Bound; 4] = [Bound::Reuss, Bound::Hill, Bound::HashinShtrikman, Bound::Voigt];

    #[test]
    fn a_mixture_of_one_is_that_one_and_bounds_are_in_order() {
        for part in [Material::BRAIN, Material::BRAIN_OGDEN, Material::CORTEX] {
            let mixed = Material::mixture(&[(1.0, part)], Bound::Hill, &part).unwrap();
            assert!((mixed.shear_mpa() / part.shear_mpa() - 1.0).abs() < 1e-6, "{mixed:?}");
            assert!((mixed.bulk_mpa() / part.bulk_mpa() - 1.0).abs() < 1e-5, "{mixed:?}");
            assert_eq!(mixed.check(), Ok(()));
        }
        let parts = [(0.25, [4.0, 40.0]), (0.75, [1.0, 10.0])];
        let [reuss, hill, upper, voigt] = ALL.map(|bound| bound.of(&parts));
        assert_eq!((voigt, reuss.map(|m| (m * 13.0).round())), ([1.75, 17.5], [16.0, 160.0]));
        for n in 0..2 {
            assert_eq!(hill[n], 0.5 * (voigt[n] + reuss[n]));
            assert!(reuss[n] < upper[n] && upper[n] < voigt[n]);
        }
        // A tenth of round holes: K (1 - f) / (1 + 3 K f / (4 μ)), exact for coated spheres.
        let holes = Bound::HashinShtrikman.of(&[(0.9, [1.0, 10.0]), (0.1, [0.0, 0.0])]);
        assert!((holes[1] - 10.0 * 0.9 / (1.0 + 0.1 * 30.0 / 4.0)).abs() < 1e-12, "{holes:?}");
    }

    #[test]
    fn mixtures_of_solids_share_a_bulk_modulus_and_fluid_softens_both() {
        let of = |grey: f64| {
            let parts = [(grey, Material::CORTEX), (1.0 - grey, Material::CORONA_RADIATA)];
            Material::mixture(&parts, Bound::Hill, &Material::WHOLE_BRAIN).unwrap()
        };
        for grey in [0.05, 0.3, 0.5, 0.9] {
            let (mixed, brain) = (of(grey), Material::WHOLE_BRAIN);
            assert_eq!(mixed.check(), Ok(()));
            assert!((mixed.bulk_mpa() / brain.bulk_mpa() - 1.0).abs() < 1e-4, "{mixed:?}");
        }
        let Material::Stiffening { share, bound, .. } = of(0.5) else { panic!("another law") };
        let [Material::Stiffening { share: a, bound: b, .. }, Material::Stiffening { share: c, bound: d, .. }] =
            [Material::CORTEX, Material::CORONA_RADIATA]
        else {
            panic!("another law")
        };
        assert!((a.min(c)..=a.max(c)).contains(&share) && (b.min(d)..=b.max(d)).contains(&bound));
        for fluid in [0.1, 0.5, 0.9] {
            let parts = [(1.0 - fluid, Material::WHOLE_BRAIN), (fluid, Material::VENTRICLE)];
            for bound in ALL {
                let mixed = Material::mixture(&parts, bound, &Material::WHOLE_BRAIN).unwrap();
                assert_eq!(mixed.check(), Ok(()), "{fluid} {bound:?}");
                assert!(mixed.shear_mpa() < Material::WHOLE_BRAIN.shear_mpa());
            }
        }
    }
}
