//! Estimates the stable solver step from the size of the tetrahedra.
//!
//! # Theory
//! A pressure wave may travel no further than the smallest height in one step: `dt = h_min / c`,
//! `c = √((λ + 2μ)/ρ)`. N equal regular tetrahedra in a volume V have the edge
//! `a = (6√2 V/N)^(1/3)` and the height `a √(2/3)`; the smallest height of a real mesh is a
//! fraction of that.
//!
//! # When not to use it
//! When a mesh exists: `trepan_soft::power_bound_ms` gives its true bound. This estimate is for
//! planning before meshing.

use trepan_soft::Material;

/// Ratio of the smallest to the regular height in meshes from `trepan_mesh::lattice`, less the
/// compression under the tool.
pub(crate) const SLENDERNESS: f64 = 0.35;

/// Edge of `tets` equal regular tetrahedra that fill `volume_mm3`, mm.
pub fn edge_mm(volume_mm3: f64, tets: usize) -> f64 {
    (6.0 * 2.0f64.sqrt() * volume_mm3 / tets as f64).cbrt()
}

/// Stable step of an explicit solver on such a mesh, ms.
pub fn stable_dt_ms(volume_mm3: f64, tets: usize, material: &Material) -> f64 {
    let height = edge_mm(volume_mm3, tets) * (2.0f64 / 3.0).sqrt();
    SLENDERNESS * height / material.wave_speed()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Computed by hand.
    ///
    /// 1.2e6/22000 = 54.5 mm³, a = (8.485 · 54.5)^(1/3) = 7.73 mm, height 6.31 mm, c = 3.37 mm/ms:
    /// 0.35 · 1.87 = 0.655 ms.
    #[test]
    fn a_brain_of_22_thousand_tetrahedra() {
        assert!((edge_mm(1.2e6, 22_000) - 7.735).abs() < 0.01);
        assert!((stable_dt_ms(1.2e6, 22_000, &Material::BRAIN) - 0.655).abs() < 0.005);
    }

    #[test]
    fn eight_times_the_tetrahedra_halve_the_step() {
        let dt = |tets| stable_dt_ms(1.2e6, tets, &Material::THESIS);
        assert!((dt(10_000) / dt(80_000) - 2.0).abs() < 1e-9);
    }
}
