//! What the tissue is made of: hyperelastic laws with their parameters, checked, and presets with their source.
//!
//! # Theory
//! Shear modulus `μ = E/(2(1+ν))`, bulk modulus `κ = E/(3(1-2ν))`, wave modulus `λ+2μ = κ + 4μ/3`.
//! Compressible neo-Hookean: `W = μ/2 (J^(-2/3) I₁ - 3) + κ/2 (J-1)²` with `J = det F`, `I₁ = tr FᵀF`.
//!
//! # Sources
//! Wittek, Miller, Kikinis, Warfield, J. Biomech. 40 (2007): brain shift with 3 kPa. Miller and Chinzei, J. Biomech. 35 (2002):
//! initial shear modulus 842 Pa, so E about 2.5 kPa. Both near 3 kPa at the strain rates of surgery.

/// A hyperelastic material. A closed list: every solver matches on it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Material {
    /// Compressible neo-Hookean solid.
    NeoHookean {
        /// Young's modulus at small strain E, MPa (3 kPa = 0.003).
        young_mpa: f32,
        /// Poisson's ratio ν at small strain, 0 ≤ ν < 0.5. Over about 0.47 plain 4-node tetrahedra lock.
        poisson: f32,
        /// Density of the rest state, g/mm³ (water 1e-3).
        density_g_mm3: f32,
    },
}

/// Why a material was refused.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum MaterialError {
    /// Young's modulus is not a positive number.
    #[error("young_mpa is {0}: it must be positive and finite (living brain is about 0.003 MPa = 3 kPa)")]
    Young(f32),
    /// Poisson's ratio is outside its range.
    #[error("poisson is {0}: it must be at least 0 and below 0.5 (brain is 0.45 to 0.499)")]
    Poisson(f32),
    /// Density is not a positive number.
    #[error("density_g_mm3 is {0}: it must be positive and finite (water is 0.001 g/mm³)")]
    Density(f32),
}

impl Material {
    /// Living brain: 3 kPa, ν 0.45 (the most that plain tetrahedra bear), density of water.
    pub const BRAIN: Self = Self::NeoHookean { young_mpa: 0.003, poisson: 0.45, density_g_mm3: 1.0e-3 };

    /// The thesis's Table 6.1 in consistent units: 30 kPa, ν 0.3; ten times stiffer and far more compressible than living brain.
    pub const THESIS: Self = Self::NeoHookean { young_mpa: 0.030, poisson: 0.3, density_g_mm3: 1.0e-3 };

    /// Refuses parameters that no material has.
    pub fn check(&self) -> Result<(), MaterialError> {
        let Self::NeoHookean { young_mpa, poisson, density_g_mm3 } = *self;
        let positive = |x: f32| x.is_finite() && x > 0.0;
        if !positive(young_mpa) {
            return Err(MaterialError::Young(young_mpa));
        }
        if !(0.0..0.5).contains(&poisson) {
            return Err(MaterialError::Poisson(poisson));
        }
        if !positive(density_g_mm3) {
            return Err(MaterialError::Density(density_g_mm3));
        }
        Ok(())
    }

    /// Density of the rest state, g/mm³.
    pub fn density_g_mm3(&self) -> f32 {
        let Self::NeoHookean { density_g_mm3, .. } = *self;
        density_g_mm3
    }

    /// Shear modulus μ at small strain, MPa.
    pub fn shear_mpa(&self) -> f64 {
        let Self::NeoHookean { young_mpa, poisson, .. } = *self;
        f64::from(young_mpa) / (2.0 * (1.0 + f64::from(poisson)))
    }

    /// Bulk modulus κ at small strain, MPa.
    pub fn bulk_mpa(&self) -> f64 {
        let Self::NeoHookean { young_mpa, poisson, .. } = *self;
        f64::from(young_mpa) / (3.0 * (1.0 - 2.0 * f64::from(poisson)))
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
        assert!(Material::BRAIN.check().is_ok() && Material::THESIS.check().is_ok());
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
}
