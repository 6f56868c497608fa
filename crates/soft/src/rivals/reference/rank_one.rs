//! A spring on many nodes beside a sparse matrix: one rank-one term, taken in after the solution
//! (Sherman and Morrison 1950).

use crate::bound::dot;
use glam::DVec3;

/// `k v vᵀ` in the matrix: v, the solution for it without this term, and `1/k + v·solved`.
pub(super) struct RankOne {
    pub v: Vec<DVec3>,
    pub solved: Vec<DVec3>,
    pub below: f64,
}

impl RankOne {
    /// Takes the term into a solution that lacks it (Sherman and Morrison).
    pub fn correct(&self, x: &mut [DVec3]) {
        let share = dot(&self.v, x) / self.below;
        x.iter_mut().zip(&self.solved).for_each(|(x, c)| *x -= *c * share);
    }
}
