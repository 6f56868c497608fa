//! What the tissue is made of: hyperelastic laws with their parameters, checked, and presets with
//! their source.
//!
//! # Theory
//! The equations are in [`Law`]. At small strain every law has a shear modulus μ and a bulk modulus
//! κ, tied by Poisson's ratio: `κ = 2 μ (1+ν) / (3 (1-2ν))`, `E = 2 μ (1+ν)`.
//!
//! # Sources
//! Every preset but [`Material::THESIS`] is written in terms of rows of `trepan-measurements`,
//! which name their papers. [`Material::CORTEX`] and the regions after it are fitted to human brain
//! at the speed of a slow test (`cargo xtask calibrate`; Budday et al., Acta Biomater. 48, 2017).
//! The neo-Hookean presets are **uncalibrated**: assumptions of models, and bovine indentation for
//! the ratio of white to grey matter, which human brain contradicts. Reports of living brain range
//! over a factor of three.
//!
//! # When not to use it
//! St. Venant-Kirchhoff gives way under compression beyond a stretch of about 0.6 and does not heal
//! when turned inside out: it is here to be compared with.

use crate::{Law, NeoHookean, Stiffening};
use trepan_measurements::{Row, brain_living as living, fits, tissue};

const MPA_PER_KPA: f32 = 1e-3; // by definition
const POISSON: f32 = living::POISSON.f32();
/// Density of water, g/mm³, by definition of the gram in good approximation.
const WATER_G_MM3: f32 = 1e-3;
const WHITE_OVER_GREY: f32 = tissue::WHITE_OVER_GREY.f32();

const fn neo_hookean(young_kpa: f32) -> Material {
    Material::NeoHookean { young_mpa: MPA_PER_KPA * young_kpa, poisson: POISSON, density_g_mm3: WATER_G_MM3 }
}

/// The stiffening law with rows of shear modulus, kPa, share and bound.
const fn stiffening([shear, share, bound]: [&Row; 3]) -> Material {
    Material::Stiffening {
        shear_mpa: MPA_PER_KPA * shear.f32(),
        share: share.f32(),
        bound: bound.f32(),
        poisson: POISSON,
        density_g_mm3: WATER_G_MM3,
    }
}

/// A hyperelastic material. A closed list: every solver matches on it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Material {
    /// Compressible neo-Hookean solid.
    NeoHookean {
        /// Young's modulus at small strain E, MPa (3 kPa = 0.003).
        young_mpa: f32,
        /// Poisson's ratio ν at small strain, 0 ≤ ν < 0.5. Over about 0.47 plain 4-node tetrahedra
        /// lock.
        poisson: f32,
        /// Density of the rest state, g/mm³ (water 1e-3).
        density_g_mm3: f32,
    },
    /// Linear in Green's strain: right for large rotations, wrong for large strain.
    StVenantKirchhoff {
        /// Young's modulus E, MPa.
        young_mpa: f32,
        /// Poisson's ratio ν, 0 ≤ ν < 0.5.
        poisson: f32,
        /// Density of the rest state, g/mm³.
        density_g_mm3: f32,
    },
    /// Both isochoric invariants.
    MooneyRivlin {
        /// Constant of the first invariant, MPa.
        c10_mpa: f32,
        /// Constant of the second invariant, MPa; `2 (c10 + c01)` is the shear modulus.
        c01_mpa: f32,
        /// Poisson's ratio ν at small strain, 0 ≤ ν < 0.5.
        poisson: f32,
        /// Density of the rest state, g/mm³.
        density_g_mm3: f32,
    },
    /// Ogden's law with up to two terms: asymmetric in tension and compression.
    Ogden {
        /// μ of each term, MPa; 0 = no term. Their sum is the shear modulus.
        shear_mpa: [f32; 2],
        /// α of each term, not 0 where there is a term.
        exponent: [f32; 2],
        /// Poisson's ratio ν at small strain, 0 ≤ ν < 0.5.
        poisson: f32,
        /// Density of the rest state, g/mm³.
        density_g_mm3: f32,
    },
    /// Stiffening with strain, more in compression than in tension.
    Stiffening {
        /// Shear modulus μ at small strain, MPa.
        shear_mpa: f32,
        /// Share of it that is neo-Hookean, 0 to 1.
        share: f32,
        /// Bound of the stiffening, over 0 and at most 0.3; the smaller, the stiffer it gets.
        bound: f32,
        /// Poisson's ratio ν at small strain, 0 ≤ ν < 0.5.
        poisson: f32,
        /// Density of the rest state, g/mm³.
        density_g_mm3: f32,
    },
}

/// Why a material was refused.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum MaterialError {
    /// Young's modulus is not a positive number.
    #[error("young_mpa is {0}: it must be positive and finite (living brain is about 0.003 MPa = 3 kPa)")]
    Young(f32),
    /// The shear modulus that the constants add up to is not a positive number.
    #[error(
        "the constants give a shear modulus of {0} MPa: it must be positive and finite (living brain is about 0.001 MPa)"
    )]
    Shear(f32),
    /// An exponent of Ogden's law is zero or not a number.
    #[error("exponent is {0}: it must be finite and not 0 where its shear_mpa is not 0 (brain is about -4.7)")]
    Exponent(f32),
    /// Poisson's ratio is outside its range.
    #[error("poisson is {0}: it must be at least 0 and below 0.5 (brain is 0.45 to 0.499)")]
    Poisson(f32),
    /// Density is not a positive number.
    #[error("density_g_mm3 is {0}: it must be positive and finite (water is 0.001 g/mm³)")]
    Density(f32),
    /// The neo-Hookean share of the stiffening law is outside its range.
    #[error("share is {0}: it must be 0 to 1 (cortex is 0.5)")]
    Share(f32),
    /// The bound of the stiffening law is outside its range.
    #[error("bound is {0}: it must be over 0 and at most 0.3 (cortex is 0.02)")]
    Bound(f32),
    /// A fit that pushes back less when it is stretched more.
    #[error(
        "these constants make a material that gets softer until it collapses between stretch 0.5 and 2: \
         choose ones with all shear_mpa·exponent (or c10, c01) of positive sign, or a fit over a wider range"
    )]
    NotConvex,
}

impl Material {
    /// Living brain, neo-Hookean, uncalibrated: a modulus of models of brain shift, ν the most that
    /// plain tetrahedra bear, density of water.
    pub const BRAIN: Self = neo_hookean(living::YOUNG_MODULUS.f32());

    /// Brain that answers tension and compression differently (Miller and Chinzei 2002),
    /// instantaneous moduli of swine.
    pub const BRAIN_OGDEN: Self = Self::Ogden {
        shear_mpa: [MPA_PER_KPA * living::SWINE_OGDEN_SHEAR_MODULUS.f32(), 0.0],
        exponent: [living::SWINE_OGDEN_EXPONENT.f32(), 1.0],
        poisson: POISSON,
        density_g_mm3: WATER_G_MM3,
    };

    /// Brain without a region: mean of [`Material::CORTEX`] and [`Material::CORONA_RADIATA`].
    pub const WHOLE_BRAIN: Self = stiffening([&fits::BRAIN_SHEAR_MODULUS, &fits::BRAIN_SHARE, &fits::BRAIN_BOUND]);

    /// Human cortex, ex vivo, at the speed of a slow test: stiffening law fitted to tension and
    /// compression.
    pub const CORTEX: Self = stiffening([&fits::CORTEX_SHEAR_MODULUS, &fits::CORTEX_SHARE, &fits::CORTEX_BOUND]);

    /// Human corona radiata: white matter, fitted as [`Material::CORTEX`].
    pub const CORONA_RADIATA: Self =
        stiffening([&fits::CORONA_RADIATA_SHEAR_MODULUS, &fits::CORONA_RADIATA_SHARE, &fits::CORONA_RADIATA_BOUND]);

    /// Human basal ganglia, fitted to their published Ogden fit.
    pub const BASAL_GANGLIA: Self =
        stiffening([&fits::BASAL_GANGLIA_SHEAR_MODULUS, &fits::BASAL_GANGLIA_SHARE, &fits::BASAL_GANGLIA_BOUND]);

    /// Human corpus callosum, fitted to its published Ogden fit.
    pub const CORPUS_CALLOSUM: Self =
        stiffening([&fits::CORPUS_CALLOSUM_SHEAR_MODULUS, &fits::CORPUS_CALLOSUM_SHARE, &fits::CORPUS_CALLOSUM_BOUND]);

    /// White matter, neo-Hookean, uncalibrated: bovine, stiffer than grey, the mean of both
    /// [`Material::BRAIN`]'s. Human white matter is softer: [`Material::CORONA_RADIATA`].
    pub const WHITE_MATTER: Self =
        neo_hookean(living::YOUNG_MODULUS.f32() * 2.0 * WHITE_OVER_GREY / (1.0 + WHITE_OVER_GREY));

    /// Grey matter, neo-Hookean, uncalibrated; see [`Material::WHITE_MATTER`].
    pub const GREY_MATTER: Self = neo_hookean(living::YOUNG_MODULUS.f32() * 2.0 / (1.0 + WHITE_OVER_GREY));

    /// A ventricle filled with CSF, uncalibrated (Wittek et al. 2010). It is a solid so soft and
    /// compressible that it neither holds the brain up nor keeps it from closing.
    pub const VENTRICLE: Self = Self::NeoHookean {
        young_mpa: MPA_PER_KPA * tissue::VENTRICLE_YOUNG_MODULUS.f32(),
        poisson: tissue::VENTRICLE_POISSON.f32(),
        density_g_mm3: WATER_G_MM3,
    };

    /// Wall of a cerebral artery, uncalibrated (Torii et al. 2006): 300 times as stiff as brain. It
    /// shortens the stable step 18 times where elements are as large.
    pub const VESSEL_WALL: Self = neo_hookean(tissue::ARTERY_YOUNG_MODULUS.f32());

    /// A firm tumour, uncalibrated: three times as stiff as the brain around it (assumptions range
    /// from 2 to 10 times).
    pub const TUMOUR: Self = neo_hookean(living::YOUNG_MODULUS.f32() * tissue::STIFF_TUMOUR_RATIO.f32());

    /// A soft tumour: a glioblastoma over the healthy white matter of the same patients, by
    /// magnetic resonance elastography.
    pub const SOFT_TUMOUR: Self = neo_hookean(living::YOUNG_MODULUS.f32() * tissue::SOFT_TUMOUR_RATIO.f32());

    /// The thesis's Table 6.1 in consistent units: 30 kPa, ν 0.3. It is ten times stiffer and far
    /// more compressible than living brain; numerical, to compare with it.
    pub const THESIS: Self = Self::NeoHookean { young_mpa: 0.030, poisson: 0.3, density_g_mm3: 1.0e-3 };

    /// Refuses parameters that no material has, and fits that are not convex.
    pub fn check(&self) -> Result<(), MaterialError> {
        let positive = |x: f32| x.is_finite() && x > 0.0;
        let [poisson, density] = self.poisson_and_density();
        if !(0.0..0.5).contains(&poisson) {
            return Err(MaterialError::Poisson(poisson));
        }
        if !positive(density) {
            return Err(MaterialError::Density(density));
        }
        match *self {
            Self::NeoHookean { young_mpa, .. } | Self::StVenantKirchhoff { young_mpa, .. } => {
                return if positive(young_mpa) { Ok(()) } else { Err(MaterialError::Young(young_mpa)) };
            }
            Self::Ogden { shear_mpa, exponent, .. } => {
                let bad = |p: &usize| shear_mpa[*p] != 0.0 && (exponent[*p] == 0.0 || !exponent[*p].is_finite());
                if let Some(p) = (0..2).find(bad) {
                    return Err(MaterialError::Exponent(exponent[p]));
                }
            }
            Self::Stiffening { share, .. } if !(0.0..=1.0).contains(&share) => {
                return Err(MaterialError::Share(share));
            }
            Self::Stiffening { bound, .. } if !(bound > 0.0 && bound <= 0.3) => {
                return Err(MaterialError::Bound(bound));
            }
            Self::MooneyRivlin { .. } | Self::Stiffening { .. } => {}
        }
        let shear = self.shear_mpa() as f32;
        if !positive(shear) {
            return Err(MaterialError::Shear(shear));
        }
        if self.law().is_stable() { Ok(()) } else { Err(MaterialError::NotConvex) }
    }

    /// Density of the rest state, g/mm³.
    pub fn density_g_mm3(&self) -> f32 {
        self.poisson_and_density()[1]
    }

    /// Poisson's ratio at small strain.
    pub fn poisson(&self) -> f32 {
        self.poisson_and_density()[0]
    }

    fn poisson_and_density(&self) -> [f32; 2] {
        match *self {
            Self::NeoHookean { poisson, density_g_mm3, .. }
            | Self::StVenantKirchhoff { poisson, density_g_mm3, .. }
            | Self::MooneyRivlin { poisson, density_g_mm3, .. }
            | Self::Ogden { poisson, density_g_mm3, .. }
            | Self::Stiffening { poisson, density_g_mm3, .. } => [poisson, density_g_mm3],
        }
    }

    /// Shear modulus μ at small strain, MPa.
    pub fn shear_mpa(&self) -> f64 {
        match *self {
            Self::NeoHookean { young_mpa, poisson, .. } | Self::StVenantKirchhoff { young_mpa, poisson, .. } => {
                f64::from(young_mpa) / (2.0 * (1.0 + f64::from(poisson)))
            }
            Self::MooneyRivlin { c10_mpa, c01_mpa, .. } => 2.0 * (f64::from(c10_mpa) + f64::from(c01_mpa)),
            Self::Ogden { shear_mpa, .. } => f64::from(shear_mpa[0]) + f64::from(shear_mpa[1]),
            Self::Stiffening { shear_mpa, .. } => shear_mpa.into(),
        }
    }

    /// Young's modulus E at small strain, MPa.
    pub fn young_mpa(&self) -> f64 {
        2.0 * self.shear_mpa() * (1.0 + f64::from(self.poisson()))
    }

    /// Bulk modulus κ at small strain, MPa.
    pub fn bulk_mpa(&self) -> f64 {
        let poisson = f64::from(self.poisson());
        2.0 * self.shear_mpa() * (1.0 + poisson) / (3.0 * (1.0 - 2.0 * poisson))
    }

    /// The law with its constants, f64.
    pub fn law(&self) -> Law {
        let (mu, kappa) = (self.shear_mpa(), self.bulk_mpa());
        match *self {
            Self::NeoHookean { .. } => Law::NeoHookean(NeoHookean { mu, kappa }),
            Self::StVenantKirchhoff { .. } => Law::StVenantKirchhoff { lambda: kappa - mu * 2.0 / 3.0, mu },
            Self::MooneyRivlin { c10_mpa, c01_mpa, .. } => {
                Law::MooneyRivlin { c10: c10_mpa.into(), c01: c01_mpa.into(), kappa }
            }
            Self::Ogden { shear_mpa, exponent, .. } => {
                Law::Ogden { mu: shear_mpa.map(f64::from), alpha: exponent.map(f64::from), kappa }
            }
            Self::Stiffening { share, bound, .. } => {
                Law::Stiffening(Stiffening { mu, share: share.into(), bound: bound.into(), kappa })
            }
        }
    }

    /// Speed of pressure waves `√((κ + 4μ/3)/ρ)`, mm/ms.
    pub fn wave_speed(&self) -> f64 {
        ((self.bulk_mpa() + self.shear_mpa() * 4.0 / 3.0) / f64::from(self.density_g_mm3())).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn presets_are_accepted_and_the_thesis_wave_speed_is_6_35_m_per_s() {
        let parts = [Material::WHITE_MATTER, Material::GREY_MATTER, Material::VENTRICLE, Material::VESSEL_WALL];
        let regions = [
            Material::WHOLE_BRAIN,
            Material::CORTEX,
            Material::CORONA_RADIATA,
            Material::BASAL_GANGLIA,
            Material::CORPUS_CALLOSUM,
            Material::SOFT_TUMOUR,
        ];
        for preset in [Material::BRAIN, Material::BRAIN_OGDEN, Material::TUMOUR, Material::THESIS]
            .into_iter()
            .chain(parts)
            .chain(regions)
        {
            assert_eq!(preset.check(), Ok(()));
        }
        assert!((Material::THESIS.wave_speed() - 6.35).abs() < 0.01);
        assert!((Material::BRAIN.wave_speed() - 3.37).abs() < 0.01);
        assert!(Material::CORTEX.shear_mpa() > 1.5 * Material::CORONA_RADIATA.shear_mpa());
    }

    #[test]
    fn what_is_not_physical_is_refused_and_the_message_names_the_field() {
        let with =
            |young_mpa, poisson, density_g_mm3| Material::NeoHookean { young_mpa, poisson, density_g_mm3 }.check();
        assert!(matches!(with(0.0, 0.3, 1e-3), Err(MaterialError::Young(_))));
        assert!(matches!(with(f32::NAN, 0.3, 1e-3), Err(MaterialError::Young(_))));
        assert!(matches!(with(0.003, 0.5, 1e-3), Err(MaterialError::Poisson(_))));
        assert!(matches!(with(0.003, f32::NAN, 1e-3), Err(MaterialError::Poisson(_))));
        assert!(with(0.003, -0.1, 1e-3).unwrap_err().to_string().contains("poisson"));
        assert!(matches!(with(0.003, 0.3, f32::INFINITY), Err(MaterialError::Density(_))));
    }

    #[test]
    fn fits_that_collapse_are_refused() {
        let mooney =
            |c10_mpa, c01_mpa| Material::MooneyRivlin { c10_mpa, c01_mpa, poisson: 0.45, density_g_mm3: 1e-3 }.check();
        assert_eq!(mooney(2e-4, 1e-4), Ok(()));
        assert!(matches!(mooney(2e-4, -2e-4), Err(MaterialError::Shear(_))));
        assert_eq!(mooney(-2e-4, 4e-4), Err(MaterialError::NotConvex));
        let ogden =
            |shear_mpa, exponent| Material::Ogden { shear_mpa, exponent, poisson: 0.45, density_g_mm3: 1e-3 }.check();
        assert_eq!(ogden([2e-3, -1.3e-3], [1.0, 4.0]), Err(MaterialError::NotConvex));
        assert_eq!(ogden([1e-3, 0.0], [0.0, 1.0]), Err(MaterialError::Exponent(0.0)));
    }
}
