//! The point of an intersection of half-spaces that is nearest to a given point.
//!
//! # Theory
//! ```text
//! minimise |x - goal|²   subject to   gᵢ·x ≥ bᵢ
//! ```
//! A problem of LP type in three dimensions: at most three half-spaces are active at the solution.
//! Start with none; as long as some half-space is violated, take the one violated most and find the
//! best active set among it and the (at most three) active ones. The distance to the goal grows
//! with each exchange, so no set comes back. Whatever the set to start from: that of the last
//! solution is a good guess, and where it still holds one pass says so.
//!
//! # Practice
//! Two to six exchanges are usual without a guess, each one pass over the half-spaces. Any unit of
//! length; tolerances are in that unit. Active sets are solved in f64, as their borders may be
//! nearly parallel.
//!
//! # Sources
//! M. Sharir, E. Welzl, *A combinatorial bound for linear programming and related problems*, STACS
//! 1992; R. Seidel, *Small-dimensional linear programming and convex hulls made easy*, Discrete
//! Comput. Geom. 6 (1991).

use glam::{DMat3, DVec3};
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

/// Half-spaces, with those of them that held the last solution as the first guess of the next.
#[derive(Default)]
pub(crate) struct HalfSpaces {
    list: Vec<HalfSpace>,
    /// Places of those that held the last solution.
    held: Vec<usize>,
}

impl HalfSpaces {
    pub fn with_capacity(count: usize) -> Self {
        Self { list: Vec::with_capacity(count), held: Vec::with_capacity(3) }
    }

    /// Takes all of them away, but keeps the guess.
    pub fn clear(&mut self) {
        self.list.clear();
    }

    pub fn push(&mut self, space: HalfSpace) {
        self.list.push(space);
    }

    pub fn list(&self) -> &[HalfSpace] {
        &self.list
    }

    /// The point of all of them that is nearest to `goal`; `None` when there is none (or rounding
    /// hides it).
    pub fn nearest(&mut self, goal: Vec3) -> Option<Vec3> {
        Some(self.solve(goal)?.0)
    }

    /// Those that keep the nearest point off `goal`, each with its weight. The sum of their normals
    /// so weighted is the way from the goal.
    pub fn supports(&mut self, goal: Vec3) -> Option<impl Iterator<Item = (usize, f32)> + use<>> {
        let (x, active) = self.solve(goal)?;
        let sizes = active.weights((x - goal).as_dvec3());
        Some((0..active.count).map(move |i| (active.of[i], sizes[i].max(0.0) as f32)))
    }

    fn solve(&mut self, goal: Vec3) -> Option<(Vec3, Active)> {
        let (mut x, mut active) = Active::guess(goal, &self.list, &self.held).unwrap_or((goal, Active::default()));
        for _ in 0..MAX_EXCHANGES {
            let (mut lowest, mut worst) = (-TOLERANCE, None);
            for (at, space) in self.list.iter().enumerate() {
                let height = space.height(x);
                if height < lowest {
                    (lowest, worst) = (height, Some(at));
                }
            }
            let Some(worst) = worst else {
                self.held.clear();
                self.held.extend(&active.of[..active.count]);
                return Some((x, active));
            };
            x = active.exchange(goal, &self.list[worst], worst)?;
        }
        None
    }
}

/// The half-spaces whose borders hold the present solution.
#[derive(Default)]
struct Active {
    spaces: [HalfSpace; 3],
    /// Their places in the list.
    of: [usize; 3],
    count: usize,
}

impl Active {
    /// The solution that those of `spaces` at the places `held` would hold, if they hold any.
    fn guess(goal: Vec3, spaces: &[HalfSpace], held: &[usize]) -> Option<(Vec3, Self)> {
        let mut guess = Self { count: held.len(), ..Self::default() };
        for (i, at) in held.iter().enumerate() {
            (guess.spaces[i], guess.of[i]) = (*spaces.get(*at)?, *at);
        }
        let x = on_borders(goal, &guess.spaces, !(!0 << guess.count))?;
        // A half-space that draws the point to itself is not needed.
        let sound = guess.weights(x - goal.as_dvec3()).to_array().iter().take(guess.count).all(|size| *size >= 0.0);
        sound.then(|| (x.as_vec3(), guess))
    }

    /// How much of each half-space's normal is in the `way` from the goal to the solution.
    fn weights(&self, way: DVec3) -> DVec3 {
        let normals: [DVec3; 3] =
            core::array::from_fn(|i| if i < self.count { self.spaces[i].normal.as_dvec3() } else { DVec3::ZERO });
        // Normal equations; the rows that are not in use are the identity's.
        let row = |i: usize| {
            DVec3::from_array(core::array::from_fn(|j| {
                normals[i].dot(normals[j]) + f64::from(u8::from(i == j && i >= self.count))
            }))
        };
        DMat3::from_cols(row(0), row(1), row(2)).inverse() * DVec3::from_array(normals.map(|normal| normal.dot(way)))
    }

    /// Takes `entering` in and keeps of the others what the new solution needs, which is returned.
    fn exchange(&mut self, goal: Vec3, entering: &HalfSpace, at: usize) -> Option<Vec3> {
        let all = [*entering, self.spaces[0], self.spaces[1], self.spaces[2]];
        let of = [at, self.of[0], self.of[1], self.of[2]];
        let all = &all[..=self.count];
        // The entering half-space is active for sure: bit 0 is set. Sets of four have no common
        // point.
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
                self.of[self.count] = of[i];
                self.count += 1;
            }
        }
        Some(x.as_vec3())
    }
}

/// The point nearest to `goal` on the borders of the half-spaces in `set`; `None` when they are
/// nearly dependent.
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

    fn nearest(goal: Vec3, spaces: &[HalfSpace]) -> Option<Vec3> {
        HalfSpaces { list: spaces.to_vec(), held: vec![] }.nearest(goal)
    }

    proptest! {
        #[test]
        fn no_guess_changes_the_solution(goals in prop::collection::vec(prop::array::uniform3(-4.0f32..4.0), 2..6),
                                         n in prop::collection::vec((prop::array::uniform3(-1.0f32..1.0), 0.0f32..1.0), 1..12)) {
            let spaces: Vec<_> = n.iter().filter(|(n, _)| Vec3::from(*n).length() > 0.2)
                .map(|(n, b)| HalfSpace { normal: Vec3::from(*n).normalize(), offset: -b }).collect();
            let mut kept = HalfSpaces { list: spaces.clone(), held: vec![] };
            for goal in goals.into_iter().map(Vec3::from) {
                if let (Some(warm), Some(cold)) = (kept.nearest(goal), nearest(goal, &spaces)) {
                    prop_assert!((warm.distance(goal) - cold.distance(goal)).abs() < 2e-3, "{warm} {cold}");
                }
            }
        }

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
    fn supports_carry_the_way_from_the_goal() {
        let spaces = [Vec3::Z, Vec3::X, Vec3::new(0.6, 0.0, 0.8)].map(|normal| HalfSpace { normal, offset: 0.0 });
        let mut all = HalfSpaces { list: spaces.to_vec(), held: vec![] };
        let found: Vec<_> = all.supports(Vec3::new(-1.0, 5.0, -2.0)).unwrap().collect();
        let way: Vec3 = found.iter().map(|&(at, size)| size * spaces[at].normal).sum();
        assert!((way - Vec3::new(1.0, 0.0, 2.0)).length() < 1e-6, "{found:?}");
        assert_eq!(all.supports(Vec3::ONE).unwrap().count(), 0);
    }

    #[test]
    fn opposed_half_spaces_have_no_point() {
        let up = HalfSpace { normal: Vec3::Z, offset: 1.0 };
        let down = HalfSpace { normal: Vec3::NEG_Z, offset: 0.5 };
        assert_eq!(nearest(Vec3::ZERO, &[up, down]), None);
        assert_eq!(nearest(Vec3::X, &[up]), Some(Vec3::new(1.0, 0.0, 1.0)));
    }
}
