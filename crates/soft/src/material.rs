//! What the tissue is made of: hyperelastic laws with their parameters, checked, and presets with
//! their source.
//!
//! # Theory
//! The equations are in [`Law`]. At small strain every law has a shear modulus μ and a bulk modulus
//! κ, tied by Poisson's ratio: `κ = 2 μ (1+ν) / (3 (1-2ν))`, `E = 2 μ (1+ν)`.
//!
//! # Sources
//! No preset is calibrated: each takes its number from the paper named, cited from memory and not
//! compared with its text, and none was fitted to data here. Reports of living brain range over a
//! factor of three; replace the numbers where forces matter.
//!
//! Wittek, Miller, Kikinis, Warfield, J. Biomech. 40 (2007): brain shift with 3 kPa. Miller and
//! Chinzei, J. Biomech. 35 (2002): Ogden's law with 842 Pa and exponent -4.7, for brain in tension
//! and compression. Both near 3 kPa at the strain rates of surgery. Budday et al., J. Mech. Behav.
//! Biomed. Mater. 46 (2015), 318-330: white matter 1.895 kPa, grey 1.389 kPa (bovine, indentation);
//! [`Material::WHITE_MATTER`] and [`Material::GREY_MATTER`] keep their ratio and, in equal shares,
//! the 3 kPa of living brain, since what is dead and slow is softer. Wittek et al., Prog. Biophys.
//! Mol. Biol. 103 (2010): ventricles as a solid of 10 Pa and ν 0.1, which the fluid can leave.
//! Torii et al., Comput. Methods Appl. Mech. Eng. 195 (2006): wall of a cerebral artery 1 MPa, ν
//! 0.45.
//!
//! # When not to use it
//! St. Venant-Kirchhoff gives way under compression beyond a stretch of about 0.6 and does not heal
//! when turned inside out: it is here to be compared with.

use crate::{Law, NeoHookean, Stiffening};

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
    /// Living brain, uncalibrated: 3 kPa (Wittek et al. 2007), ν 0.45 (the most that plain
    /// tetrahedra bear), density of water.
    pub const BRAIN: Self = Self::NeoHookean { young_mpa: 0.003, poisson: 0.45, density_g_mm3: 1.0e-3 };

    /// Brain that answers tension and compression differently (Miller and Chinzei 2002),
    /// instantaneous moduli, uncalibrated.
    pub const BRAIN_OGDEN: Self =
        Self::Ogden { shear_mpa: [8.42e-4, 0.0], exponent: [-4.7, 1.0], poisson: 0.45, density_g_mm3: 1.0e-3 };

    /// White matter, uncalibrated: 1.36 times as stiff as grey (Budday et al. 2015), the mean of
    /// both [`Material::BRAIN`]'s.
    pub const WHITE_MATTER: Self = Self::NeoHookean { young_mpa: 0.003_46, poisson: 0.45, density_g_mm3: 1.0e-3 };

    /// Grey matter, uncalibrated (Budday et al. 2015).
    pub const GREY_MATTER: Self = Self::NeoHookean { young_mpa: 0.002_54, poisson: 0.45, density_g_mm3: 1.0e-3 };

    /// A ventricle filled with CSF, uncalibrated (Wittek et al. 2010). It is a solid so soft and
    /// compressible that it neither holds the brain up nor keeps it from closing.
    pub const VENTRICLE: Self = Self::NeoHookean { young_mpa: 1.0e-5, poisson: 0.1, density_g_mm3: 1.0e-3 };

    /// Wall of a cerebral artery, uncalibrated (Torii et al. 2006): 300 times as stiff as brain. It
    /// shortens the stable step 18 times where elements are as large.
    pub const VESSEL_WALL: Self = Self::NeoHookean { young_mpa: 1.0, poisson: 0.45, density_g_mm3: 1.0e-3 };

    /// A tumour, uncalibrated, without a source: three times as stiff as the brain around it
    /// (reports range from 2 to 10 times).
    pub const TUMOUR: Self = Self::NeoHookean { young_mpa: 0.009, poisson: 0.45, density_g_mm3: 1.0e-3 };

    /// The thesis's Table 6.1 in consistent units: 30 kPa, ν 0.3; ten times stiffer and far more
    /// compressible than living brain.
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
        for preset in
            [Material::BRAIN, Material::BRAIN_OGDEN, Material::TUMOUR, Material::THESIS].into_iter().chain(parts)
        {
            assert_eq!(preset.check(), Ok(()));
        }
        assert!((Material::THESIS.wave_speed() - 6.35).abs() < 0.01);
        assert!((Material::BRAIN.wave_speed() - 3.37).abs() < 0.01);
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
