//! Springs on the tissue, with the solver's present nodes, at every explicit step: how much of each is stable, and their forces.
//!
//! # Theory
//! Spring c adds `k_c w_c w_cᵀ` to the stiffness and `b_c w_c w_cᵀ` to the damping along its normal. With damping lagging half a step the leapfrog
//! stays stable while `dt² ω_max² + λ ≤ 4`, where λ is the largest eigenvalue of `Q G`, `Q = diag(k_c dt² + 2 b_c dt)` and `G = W M⁻¹ Wᵀ`. No
//! eigenvalue exceeds the largest row sum (Gershgorin), so that each spring may have the share that keeps its own row in bounds:
//!
//! ```text
//! row_c = q_c Σᵢ |w_ci| sᵢ/mᵢ     sᵢ = Σ_d |w_di|, all springs on node i     share_c = min(1, (4 - dt² ω_max²)/row_c)
//! ```
//! Springs that share no node do not weaken each other; for a single one the bound is exact. A solver that cuts its step while elements are compressed gives the bound of its uncut step too: a share
//! that rose with the compression would push back harder than it was pushed, and so swing for ever.
//!
//! # Practice
//! 5 ns for each node of each spring. Nodes outside the mesh are left out.

use crate::StepReport;
use trepan_contact::NodalContact;
use trepan_geometry::Vec3;

/// Share of the stable region that contacts may use up.
const LIMIT: f32 = 0.95 * 4.0;

/// Room for the sums over springs at every node.
#[derive(Clone, Debug)]
pub struct ContactShares {
    load_of_node: Vec<f32>,
}

/// What a step does with springs: its length and the mesh's own stiffness.
#[derive(Clone, Copy, Debug)]
pub struct StepBound {
    /// Length of the step, ms.
    pub dt_ms: f32,
    /// ω_max² of the mesh, 1/ms².
    pub omega2: f32,
}

impl ContactShares {
    /// For a body of so many nodes.
    pub fn of_nodes(nodes: usize) -> Self {
        Self { load_of_node: vec![0.0; nodes] }
    }

    /// Gives each spring's share of its stiffness and damping that is stable under all `bounds` to `each`. `inverse_mass` gives 1/m of a node, 1/g, 0 when it is fixed.
    pub fn each(
        &mut self,
        springs: &[NodalContact],
        bounds: &[StepBound],
        inverse_mass: impl Fn(u32) -> f32,
        mut each: impl FnMut(&NodalContact, f32),
    ) {
        self.load(springs, |sum, weight| *sum += weight.abs());
        for spring in springs {
            let row = |(n, w): (u32, f32)| {
                self.load_of_node.get(n as usize).map_or(0.0, |sum| w.abs() * sum * inverse_mass(n))
            };
            let compliance: f32 = spring.nodes().map(row).sum();
            let share = |&StepBound { dt_ms, omega2 }: &StepBound| {
                let room = (LIMIT - dt_ms * dt_ms * omega2).max(0.0);
                let wanted = (spring.stiffness * dt_ms + 2.0 * spring.damping) * dt_ms * compliance;
                if wanted > room { room / wanted } else { 1.0 }
            };
            each(spring, bounds.iter().map(share).fold(1.0, f32::min));
        }
        self.load(springs, |sum, _| *sum = 0.0);
    }

    fn load(&mut self, springs: &[NodalContact], change: impl Fn(&mut f32, f32)) {
        for (node, weight) in springs.iter().flat_map(NodalContact::nodes) {
            if let Some(sum) = self.load_of_node.get_mut(node as usize) {
                change(sum, weight);
            }
        }
    }

    /// Adds the stable share of every spring's force to the nodes, `add(node, N)`, and to the report.
    pub fn press(
        &mut self,
        springs: &[NodalContact],
        bounds: &[StepBound],
        inverse_mass: impl Fn(u32) -> f32,
        state: [&[Vec3]; 2],
        report: &mut StepReport,
        mut add: impl FnMut(u32, Vec3),
    ) {
        report.contact_n = 0.0;
        self.each(springs, bounds, inverse_mass, |spring, share| {
            report.contact_scale = report.contact_scale.min(share);
            report.contact_n += press(spring, share, state, &mut add);
        });
    }
}

/// Adds a share of a spring's force to the nodes at these positions and velocities, `add(node, N)`; gives it, N.
pub(crate) fn press(
    spring: &NodalContact,
    share: f32,
    [positions, velocities]: [&[Vec3]; 2],
    mut add: impl FnMut(u32, Vec3),
) -> f32 {
    let known = |values: &[Vec3], n: u32| values.get(n as usize).copied().unwrap_or_default();
    let (mean, speed) = (spring.mean(|n| known(positions, n)), spring.mean(|n| known(velocities, n)));
    let pressure = share * spring.pressure_n(mean, speed);
    if !(pressure.is_finite() && pressure > 0.0) {
        return 0.0;
    }
    let nodes = spring.nodes().filter(|(n, _)| (*n as usize) < positions.len());
    nodes.for_each(|(n, w)| add(n, spring.normal * -(pressure * w)));
    pressure
}

#[cfg(test)]
mod tests {
    use super::*;
    use faer::{Mat, Side};
    use proptest::prelude::*;

    fn spring(stiffness: f32, nodes: &[(u32, f32)]) -> NodalContact {
        let mut spring = NodalContact::none();
        spring.stiffness = stiffness;
        nodes.iter().for_each(|&(n, w)| spring.add(n, w));
        spring
    }

    fn shares(springs: &[NodalContact], omega2: f32, dt_ms: f32, inverse_mass: f32) -> Vec<f32> {
        let mut shares = Vec::new();
        let mut sums = ContactShares::of_nodes(8);
        sums.each(springs, &[StepBound { dt_ms, omega2 }], |_| inverse_mass, |_, share| shares.push(share));
        assert!(sums.load_of_node.iter().all(|&sum| sum == 0.0));
        shares
    }

    #[test]
    fn a_soft_spring_is_used_whole_and_a_stiff_one_to_the_bound() {
        assert_eq!(shares(&[spring(0.3, &[(0, 1.0)])], 2.0, 0.5, 2.0), [1.0]);
        let stiff = [spring(300.0, &[(0, 1.0)])];
        let share = shares(&stiff, 2.0, 0.5, 2.0)[0];
        assert!((0.25 * (2.0 + share * 600.0) - 3.8).abs() < 1e-4);
        assert_eq!(shares(&stiff, 2.0, 0.5, 0.0), [1.0]);
    }

    #[test]
    fn springs_on_one_node_share_its_room_and_others_keep_theirs() {
        let springs = [spring(300.0, &[(0, 1.0)]), spring(300.0, &[(0, 1.0)]), spring(300.0, &[(5, 1.0)])];
        let found = shares(&springs, 2.0, 0.5, 2.0);
        let alone = shares(&springs[2..], 2.0, 0.5, 2.0)[0];
        assert_eq!(found, [0.5 * alone, 0.5 * alone, alone]);
    }

    proptest! {
        #[test]
        fn no_sum_of_springs_is_unstable(
            weights in prop::collection::vec(prop::array::uniform8(-1.0f32..1.0), 1..6),
            stiffness in prop::array::uniform6(0.1f32..2000.0),
        ) {
            let of = |(c, weights): (usize, &[f32; 8])| {
                let nodes: Vec<_> = (0..8).zip(weights.iter().copied()).collect();
                spring(stiffness[c], &nodes)
            };
            let springs: Vec<_> = weights.iter().enumerate().map(of).collect();
            let found = shares(&springs, 1.0, 0.5, 2.0);
            let mut matrix = Mat::<f64>::zeros(8, 8);
            for (spring, share) in springs.iter().zip(&found) {
                let w: Vec<f64> = spring.nodes().map(|(_, w)| f64::from(w)).collect();
                matrix += Mat::from_fn(8, 8, |i, j| w[i] * w[j] * f64::from(spring.stiffness * share * 2.0));
            }
            let largest = matrix.self_adjoint_eigenvalues(Side::Lower).unwrap().into_iter().fold(0.0, f64::max);
            prop_assert!(0.25 * (1.0 + largest) <= 3.8001, "{largest}");
        }
    }
}
