//! Longest stable step of a body, at rest and deformed.
//!
//! # Theory
//! Central differences are stable for `dt ≤ 2/ω`, ω² the largest eigenvalue of `M⁻¹K`. At rest it
//! comes from power iteration. In any state it is at most the largest of the single elements (Irons
//! and Treharne 1971), which is up to four times as much. The difference is lost when elements
//! deform and turn against each other, sooner than their own stiffness shows it: a brain pressed
//! by a probe was unstable with steps by the eigenvalue at rest plus the largest growth of an
//! element's ω², where the elements' bound is not. Elements that turn against each other grow
//! little and raise the eigenvalue all the same: with a brain that had sunk by 0.5 mm, under 5 % of
//! growth, two nodes swung by 1 mm for good. So the eigenvalue at rest counts only at rest.

use crate::scaling::Scaling;
use trepan_soft::{Body, Stiffness, power_bound_of_ms};

/// Growth of an element's ω² up to which a body is at rest, as a share of the largest ω² of its
/// elements at rest.
const AT_REST: f32 = 1e-3;
/// Largest considered growth of the stiffest element's frequency; worse states are recovering from
/// inversion.
const MAX_STIFFENING: f32 = 64.0;

/// Stable steps of one body without safety factor.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Bound {
    /// Stable step at rest, ms.
    pub at_rest_ms: f32,
    /// Largest ω² of an element at rest, with scaled mass, 1/ms².
    pub stiffest: f32,
}

impl Bound {
    /// Finds the bounds of a body at rest.
    pub fn of(body: &Body, stiffness: &Stiffness, scaling: &Scaling) -> Self {
        let at_rest_ms = power_bound_of_ms(body, stiffness) as f32;
        Self { at_rest_ms, stiffest: (scaling.stiffest as f32).max(4.0 / (at_rest_ms * at_rest_ms)) }
    }

    /// Stable step by the elements at rest, ms: the one that a slightly deformed body keeps.
    pub fn elements_ms(&self) -> f32 {
        2.0 / self.stiffest.sqrt()
    }

    /// Stable step of the deformed body, ms, from the largest growth of an element's ω², 1/ms².
    pub fn deformed_ms(&self, growth: f32) -> f32 {
        let relative = (growth / self.stiffest).min(MAX_STIFFENING * MAX_STIFFENING);
        if relative > AT_REST { 2.0 / (self.stiffest * (1.0 + relative)).sqrt() } else { self.at_rest_ms }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use trepan_geometry::Vec3;
    use trepan_soft::{Material, boxes};

    #[test]
    fn the_step_at_rest_holds_at_rest_and_the_elements_bound_beyond() {
        let body = Body::uniform(boxes::split_box([4, 4, 4], Vec3::splat(40.0)), vec![], Material::BRAIN);
        let scaling = Scaling::of(&body, 0.0);
        let bound = Bound::of(&body, &Stiffness::of(&body), &scaling);
        let by_element = trepan_soft::element_bound_ms(&body) as f32;
        assert!(bound.at_rest_ms > 1.1 * by_element);
        assert_eq!(bound.deformed_ms(0.0), bound.at_rest_ms);
        assert!((bound.elements_ms() / by_element - 1.0).abs() < 1e-4);
        let deformed = |relative: f32| bound.deformed_ms(relative * 4.0 / (by_element * by_element)) / by_element;
        assert!((deformed(0.01) - 1.01f32.sqrt().recip()).abs() < 1e-4);
        assert!((deformed(3.0) - 0.5).abs() < 1e-4);
        assert!((deformed(f32::INFINITY) - 1.0 / 64.0).abs() < 1e-4);
    }
}
