//! Mass scaling: mass added to the few elements that set the stable step.
//!
//! # Theory
//! An element's stable step is `2/ω`, `ω² ∝ 1/ρ`. Raising ρ by `max(ω²/ω_t², 1)` lowers every
//! element's frequency to ω_t or less; ω_t is the lowest for which the added mass stays within the
//! allowed share. On a brain mesh a hundredth of the mass is enough for the slivers that would
//! otherwise set the step of the whole body. Weight is not scaled, so the equilibrium does not
//! change; motion is slower where mass was added.

use trepan_soft::{Body, element_omega2};

/// Factors on the density of every tetrahedron, and the added mass.
pub(crate) struct Scaling {
    factors: Vec<f64>,
    /// ω² of every tetrahedron before scaling, 1/ms².
    omega2: Vec<f64>,
    /// Largest ω² of an element after scaling, 1/ms².
    pub stiffest: f64,
    /// Added mass, as a share of the body's mass.
    pub added: f64,
}

impl Scaling {
    /// Adds at most the share `most` of the body's mass; 0 = none, infinity = until all elements
    /// have the same stable step.
    pub fn of(body: &Body, most: f32) -> Self {
        let count = body.mesh.tets.len();
        let omega2: Vec<f64> = (0..count).map(|t| element_omega2(&body.shape(t), body.material(t))).collect();
        let stiffest = omega2.iter().copied().fold(0.0, f64::max);
        if most <= 0.0 {
            return Self { factors: vec![1.0; count], omega2, stiffest, added: 0.0 };
        }
        let mass = |t: usize| f64::from(body.material(t).density_g_mm3()) * body.mesh.volume_mm3(t);
        let total: f64 = (0..count).map(mass).sum();
        let mut stiffest_first: Vec<usize> = (0..count).collect();
        stiffest_first.sort_by(|&a, &b| omega2[b].total_cmp(&omega2[a]));
        // With the k stiffest scaled to ω_t², the added mass is Σ m ω²/ω_t² - Σ m.
        let (mut weighed, mut plain, mut target) = (0.0, 0.0, f64::MAX);
        for (k, &t) in stiffest_first.iter().enumerate() {
            (weighed, plain) = (weighed + mass(t) * omega2[t], plain + mass(t));
            let next = stiffest_first.get(k + 1).map_or(0.0, |&t| omega2[t]);
            let least = weighed / (f64::from(most) * total + plain);
            target = least.max(omega2[stiffest_first[count - 1]]);
            if least >= next {
                break;
            }
        }
        let factors: Vec<f64> = omega2.iter().map(|w| (w / target).max(1.0)).collect();
        let added = (0..count).map(|t| mass(t) * (factors[t] - 1.0)).sum::<f64>() / total;
        Self { factors, omega2, stiffest: stiffest.min(target), added }
    }

    /// Factor on the density of a tetrahedron.
    pub fn factor(&self, tet: u32) -> f64 {
        self.factors[tet as usize]
    }

    /// ω² of a tetrahedron with its scaled mass, 1/ms².
    pub fn omega2(&self, tet: u32) -> f32 {
        (self.omega2[tet as usize] / self.factors[tet as usize]) as f32
    }

    /// Inertial mass of every node, g.
    pub fn masses_g(&self, body: &Body) -> Vec<f64> {
        body.lumped_masses_scaled_g(|tet| self.factors[tet])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use trepan_geometry::Vec3;
    use trepan_soft::{Material, boxes};

    fn squeezed() -> Body {
        let mut mesh = boxes::split_box([4, 4, 4], Vec3::splat(40.0));
        let node = boxes::nodes_where(&mesh, |p| p.distance(Vec3::splat(20.0)) < 1e-3)[0] as usize;
        mesh.positions[node] += Vec3::new(0.0, 0.0, 8.0);
        Body::uniform(mesh, vec![], Material::BRAIN)
    }

    #[test]
    fn no_more_mass_than_allowed_is_added_and_it_goes_to_the_stiffest() {
        let body = squeezed();
        let omega2 = |t: usize| element_omega2(&body.shape(t), body.material(t));
        for most in [0.001f32, 0.01, 0.1] {
            let scaling = Scaling::of(&body, most);
            assert!((scaling.added / f64::from(most) - 1.0).abs() < 1e-6, "{most}: {}", scaling.added);
            let now = (0..384).map(|t| omega2(t) / scaling.factor(t as u32));
            let (bound, before) = (now.fold(0.0, f64::max), (0..384).map(omega2).fold(0.0, f64::max));
            assert!(bound < before);
            assert!((0..384).all(|t| scaling.factor(t as u32) == 1.0 || omega2(t as usize) > bound));
        }
        let all = Scaling::of(&body, f32::INFINITY);
        let least = (0..384).map(omega2).fold(f64::MAX, f64::min);
        assert!((0..384).all(|t| (omega2(t) / all.factor(t as u32) / least - 1.0).abs() < 1e-9));
        assert_eq!(Scaling::of(&body, 0.0).added, 0.0);
    }
}
