//! The point of an intersection of half-spaces that is nearest to a given point.
//!
//! # Theory
//! ```text
//! minimise |x - goal|²   subject to   gᵢ·x ≥ bᵢ
//! ```
//! A problem of LP type in three dimensions: at most three half-spaces are active at the solution. Start with none; as long as
//! some half-space is violated, take the one violated most and find the best active set among it and the (at most three) active ones.
//! The distance to the goal grows with each exchange, so no set comes back.
//!
//! # Practice
//! Two to six exchanges are usual, each one pass over the half-spaces. Any unit of length; tolerances are in that unit. Active sets are solved in f64, as
//! their borders may be nearly parallel.
//!
//! # Sources
//! M. Sharir, E. Welzl, *A combinatorial bound for linear programming and related problems*, STACS 1992; R. Seidel,
//! *Small-dimensional linear programming and convex hulls made easy*, Discrete Comput. Geom. 6 (1991).

use glam::DVec3;
use trepan_geometry::Vec3;

/// How far outside a half-space counts as inside.
const TOLERANCE: f32 = 1e-4;
/// Exchanges before giving up; only rounding in nearly parallel half-spaces gets there.
const MAX_EXCHANGES: usize = 48;

/// All x with `normal·x ≥ offset`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct HalfSpace {
    /// Unit vector into the half-space.
    pub normal: Vec3,
    /// Height of its border along the normal.
    pub offset: f32,
}

impl HalfSpace {
    fn height(&self, x: Vec3) -> f32 {
        self.normal.dot(x) - self.offset
    }

    fn exact_height(&self, x: DVec3) -> f64 {
        self.normal.as_dvec3().dot(x) - f64::from(self.offset)
    }
}

/// The point of all `spaces` nearest to `goal`; `None` when there is none (or rounding hides it).
pub(crate) fn nearest(goal: Vec3, spaces: &[HalfSpace]) -> Option<Vec3> {
    let mut active = Active::default();
    let mut x = goal;
    for _ in 0..MAX_EXCHANGES {
        let (mut lowest, mut worst) = (-TOLERANCE, None);
        for space in spaces {
            let height = space.height(x);
            if height < lowest {
                (lowest, worst) = (height, Some(space));
            }
        }
        match worst {
            Some(worst) => x = active.exchange(goal, worst)?,
            None => return Some(x),
        }
    }
    None
}

/// The half-spaces whose borders hold the present solution.
#[derive(Default)]
struct Active {
    spaces: [HalfSpace; 3],
    count: usize,
}

impl Active {
    /// Takes `entering` in and keeps of the others what the new solution needs, which is returned.
    fn exchange(&mut self, goal: Vec3, entering: &HalfSpace) -> Option<Vec3> {
        let all = [*entering, self.spaces[0], self.spaces[1], self.spaces[2]];
        let all = &all[..=self.count];
        // The entering half-space is active for sure: bit 0 is set. Sets of four have no common point.
        let (x, set) = (0..1u32 << self.count)
            .map(|others| 1 | others << 1)
            .filter(|set| set.count_ones() <= 3)
            .filter_map(|set| Some((on_borders(goal, all, set)?, set)))
            .filter(|(x, _)| all.iter().all(|s| s.exact_height(*x) >= -0.5 * f64::from(TOLERANCE)))
            .min_by(|a, b| a.0.distance_squared(goal.as_dvec3()).total_cmp(&b.0.distance_squared(goal.as_dvec3())))?;
        self.count = 0;
        for (i, space) in all.iter().enumerate() {
            if set >> i & 1 == 1 {
                self.spaces[self.count] = *space;
                self.count += 1;
            }
        }
        Some(x.as_vec3())
    }
}

/// The point nearest to `goal` on the borders of the half-spaces in `set`; `None` when they are nearly dependent.
fn on_borders(goal: Vec3, spaces: &[HalfSpace], set: u32) -> Option<DVec3> {
    let mut x = goal.as_dvec3();
    let mut basis = [DVec3::ZERO; 4];
    for (i, space) in spaces.iter().enumerate().filter(|(i, _)| set >> i & 1 == 1) {
        let normal = space.normal.as_dvec3();
        let free = basis.iter().fold(normal, |n, b| n - *b * n.dot(*b));
        let size = free.length();
        if size.is_nan() || size < 1e-5 {
            return None;
        }
        basis[i] = free / size;
        x -= basis[i] * (space.exact_height(x) / size);
    }
    Some(x)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Dykstra's alternating projections in f64: slow, obvious, and sure to converge.
    fn dykstra(goal: Vec3, spaces: &[HalfSpace]) -> Vec3 {
        let mut x = goal.as_dvec3();
        let mut given_back = vec![DVec3::ZERO; spaces.len()];
        for _ in 0..4000 {
            for (space, back) in spaces.iter().zip(&mut given_back) {
                let (n, from) = (space.normal.as_dvec3(), x + *back);
                x = from - n * (n.dot(from) - f64::from(space.offset)).min(0.0);
                *back = from - x;
            }
        }
        x.as_vec3()
    }

    proptest! {
        #[test]
        fn agrees_with_dykstra(goal in prop::array::uniform3(-4.0f32..4.0), n in prop::collection::vec((prop::array::uniform3(-1.0f32..1.0), 0.0f32..1.0), 1..12)) {
            // All half-spaces hold the origin, so there is always a solution.
            let spaces: Vec<_> = n.iter().filter(|(n, _)| Vec3::from(*n).length() > 0.2)
                .map(|(n, b)| HalfSpace { normal: Vec3::from(*n).normalize(), offset: -b }).collect();
            let goal = Vec3::from(goal);
            if let Some(found) = nearest(goal, &spaces) {
                let truth = dykstra(goal, &spaces);
                prop_assert!(spaces.iter().all(|s| s.height(found) > -1e-3));
                prop_assert!((found.distance(goal) - truth.distance(goal)).abs() < 0.02, "{found} {truth}");
            } else {
                // Only nearly dependent borders may hide the solution.
                let near = spaces.iter().enumerate().any(|(i, a)| spaces[..i].iter().any(|b| a.normal.cross(b.normal).length() < 0.05))
                    || spaces.len() > 2;
                prop_assert!(near);
            }
        }
    }

    #[test]
    fn opposed_half_spaces_have_no_point() {
        let up = HalfSpace { normal: Vec3::Z, offset: 1.0 };
        let down = HalfSpace { normal: Vec3::NEG_Z, offset: 0.5 };
        assert_eq!(nearest(Vec3::ZERO, &[up, down]), None);
        assert_eq!(nearest(Vec3::X, &[up]), Some(Vec3::new(1.0, 0.0, 1.0)));
    }
}
