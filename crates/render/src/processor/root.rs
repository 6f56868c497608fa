//! Finds where a ray enters bone within a cell.
//!
//! # Theory
//! The density of a cell is trilinear, so that along a ray it is a cubic (Marmitt et al. 2004).
//! Between its extrema a cubic is monotone, and a bracketed Newton's method finds its root.

use crate::mix::greater;
use glam::{Vec3A, Vec4};

/// Trilinear interpolation of a cell's corners at four points, given by their coordinates.
#[inline(always)]
pub(crate) fn blend(corners: &[f32; 8], [x, y, z]: [Vec4; 3]) -> Vec4 {
    let line = |n: usize| corners[n] + x * (corners[n + 1] - corners[n]);
    let plane = |n: usize| {
        let (a, b) = (line(n), line(n + 2));
        a + y * (b - a)
    };
    let (a, b) = (plane(0), plane(4));
    a + z * (b - a)
}

/// Fraction of the segment between two local points of a cell at which bone begins, or 2.
#[inline(always)]
pub(crate) fn enter(corners: &[f32; 8], a: Vec3A, b: Vec3A) -> f32 {
    let shares = Vec4::new(0.0, 1.0 / 3.0, 2.0 / 3.0, 1.0);
    let axis = |n: usize| a[n] + shares * (b[n] - a[n]);
    first_root(blend(corners, [axis(0), axis(1), axis(2)]).to_array())
}

/// First rising root of the cubic with values `v` at 0, 1/3, 2/3, 1, or 2.
///
/// Between its extrema the cubic is monotone: bracketed Newton's method.
#[inline(always)]
pub(crate) fn first_root(v: [f32; 4]) -> f32 {
    if v[0] >= 0.0 {
        return 0.0;
    }
    // The curve lies in the convex hull of its Bézier points.
    let second = -5.0 * v[0] + 18.0 * v[1] - 9.0 * v[2] + 2.0 * v[3];
    let third = 2.0 * v[0] - 9.0 * v[1] + 18.0 * v[2] - 5.0 * v[3];
    if greater(greater(second, third), v[3]) < 0.0 {
        return 2.0;
    }
    rising_root(v, 0.0)
}

/// First place from which two such cubics are both at least 0, or 2.
pub(crate) fn first_of_both(a: [f32; 4], b: [f32; 4]) -> f32 {
    let (mut this, mut other) = (a, b);
    let mut s = rising_root(this, 0.0);
    for _ in 0..MOST_TURNS {
        if s > 1.0 {
            return 2.0;
        }
        let next = rising_root(other, s);
        if next == s {
            break;
        }
        (this, other, s) = (other, this, next);
    }
    s
}

/// Like [`first_root`], where a root is possible, at or behind `from`.
fn rising_root(v: [f32; 4], from: f32) -> f32 {
    let c1 = 0.5 * (-11.0 * v[0] + 18.0 * v[1] - 9.0 * v[2] + 2.0 * v[3]);
    let c2 = 4.5 * (2.0 * v[0] - 5.0 * v[1] + 4.0 * v[2] - v[3]);
    let c3 = 4.5 * (-v[0] + 3.0 * v[1] - 3.0 * v[2] + v[3]);
    let cubic = |s: f32| v[0] + s * (c1 + s * (c2 + s * c3));
    if cubic(from) >= 0.0 {
        return from;
    }
    let slope = |s: f32| c1 + s * (2.0 * c2 + s * 3.0 * c3);
    let roots = greater(c2 * c2 - 3.0 * c1 * c3, 0.0).sqrt();
    let q = -(c2 + if c2 >= 0.0 { roots } else { -roots });
    let e1 = if c3.abs() > 1e-20 { q / (3.0 * c3) } else { 2.0 };
    let e2 = if q.abs() > 1e-20 { c1 / q } else { 2.0 };
    let mut start = from;
    while start < 1.0 {
        let mut to = 1.0f32;
        for extremum in [e1, e2] {
            if extremum > start && extremum < to {
                to = extremum;
            }
        }
        if cubic(to) >= 0.0 {
            let (mut low, mut high) = (start, to);
            let mut s = 0.5 * (low + high);
            for _ in 0..MOST_NEWTON {
                let value = cubic(s);
                if value < 0.0 {
                    low = s
                } else {
                    high = s
                }
                let newton = s - value / slope(s);
                if (newton - s).abs() < 1e-5 {
                    return newton.clamp(low, high);
                }
                s = if newton > low && newton < high { newton } else { 0.5 * (low + high) };
            }
            return s;
        }
        start = to;
    }
    2.0
}

/// Most iterations to a root: bisection alone reaches 2⁻¹² in as many.
const MOST_NEWTON: usize = 12;

/// Most turns between two cubics: each rises at most twice within a cell.
const MOST_TURNS: usize = 4;

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(2000))]
        #[test]
        fn the_first_root_is_the_first_of_a_fine_scan(v in prop::array::uniform4(-1000.0f32..1000.0)) {
            let values = v.map(f64::from);
            let lagrange = |s: f64| {
                let at = [0.0, 1.0 / 3.0, 2.0 / 3.0, 1.0];
                (0..4).map(|i| (0..4).filter(|&j| j != i).map(|j| (s - at[j]) / (at[i] - at[j])).product::<f64>() * values[i]).sum::<f64>()
            };
            let scan = (0..=4000).map(|n| f64::from(n) / 4000.0).find(|&s| lagrange(s) >= 0.0);
            let root = f64::from(first_root(v));
            match scan {
                Some(s) => prop_assert!(root <= s + 3e-4 && (root > s - 6e-4 || lagrange(root) > -0.5), "{root} for {s}"),
                // A scan may miss a narrow peak between its points.
                None => prop_assert!(root == 2.0 || lagrange(root).abs() < 0.5, "{root}"),
            }
        }
    }
}
