//! The tool's spring on the tissue, with the solver's present nodes, at every step.
//!
//! # Theory
//! The spring adds `k w wᵀ` to the stiffness and `b w wᵀ` to the damping along the normal. On lumped masses its own eigenvalue is
//! `s = k Σ wᵢ²/mᵢ`, and with damping lagging half a step the leapfrog stays stable while
//! `dt² (ω_max² + s) + 2 dt b Σ wᵢ²/mᵢ ≤ 4`. What would break this is scaled down, and the scale reported.

use trepan_contact::NodalContact;

/// Share of the stable region that a contact may use up.
const LIMIT: f32 = 0.95 * 4.0;

/// The largest share of a contact's stiffness and damping that is stable.
///
/// `mesh_omega2` is ω_max² of the mesh, 1/ms²; `inverse_mass` gives 1/m of a node, 1/g, 0 when it is fixed.
pub(crate) fn stable_share(
    contact: &NodalContact,
    mesh_omega2: f32,
    dt_ms: f32,
    inverse_mass: impl Fn(u32) -> f32,
) -> f32 {
    let compliance: f32 = contact.nodes().map(|(n, w)| w * w * inverse_mass(n)).sum();
    let wanted = (contact.stiffness * dt_ms + 2.0 * contact.damping) * dt_ms * compliance;
    let room = (LIMIT - dt_ms * dt_ms * mesh_omega2).max(0.0);
    if wanted > room { room / wanted } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_soft_spring_is_used_whole_and_a_stiff_one_to_the_bound() {
        let mut contact = NodalContact::none();
        contact.stiffness = 0.3;
        contact.add(0, 1.0);
        assert_eq!(stable_share(&contact, 2.0, 0.5, |_| 2.0), 1.0);
        contact.stiffness = 300.0;
        let share = stable_share(&contact, 2.0, 0.5, |_| 2.0);
        assert!((0.25 * (2.0 + share * 600.0) - 3.8).abs() < 1e-4);
        assert_eq!(stable_share(&contact, 2.0, 0.5, |_| 0.0), 1.0);
    }
}
