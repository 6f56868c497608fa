//! The consistent unit system mm, ms, g, and its constants.
//!
//! # Practice
//! | quantity | unit | of note |
//! |---|---|---|
//! | length, time, mass | mm, ms, g | |
//! | velocity | mm/ms = m/s | |
//! | force | g mm/ms² = N | |
//! | stress, stiffness modulus | N/mm² = MPa | 3 kPa = 0.003 MPa |
//! | spring, damper | N/mm, N ms/mm | |
//! | density | g/mm³ | water 1e-3 |
//!
//! Files and command lines name other units in their fields (`young_modulus_kpa`); these are
//! converted when read.

/// Standard gravity, mm/ms².
pub const GRAVITY_MM_PER_MS2: f32 = 9.81e-3;

/// Density of water, g/mm³.
pub const WATER_G_PER_MM3: f32 = 1.0e-3;

/// Kilopascals to MPa (N/mm²).
pub const fn mpa_from_kpa(kpa: f32) -> f32 {
    kpa * 1.0e-3
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_litre_of_water_weighs_9_81_newtons() {
        let mass_g = 1.0e6 * WATER_G_PER_MM3;
        assert!((mass_g * GRAVITY_MM_PER_MS2 - 9.81).abs() < 1e-4);
    }
}
