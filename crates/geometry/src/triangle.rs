//! The point of a triangle that is closest to a given one.
//!
//! # Theory
//! Voronoi regions of corners, edges and face, told apart by projections on the two edges from the
//! first corner (Ericson 2005, Real-Time Collision Detection, 5.1.5). A flat triangle ends in one
//! of its edges or corners.

use crate::Vec3;

/// Weights on the corners of the point of a triangle that is closest to `p`.
///
/// Their sum is 1, none is negative.
#[inline]
pub fn closest_weights([a, b, c]: [Vec3; 3], p: Vec3) -> [f32; 3] {
    let (ab, ac, ap) = (b - a, c - a, p - a);
    let (d1, d2) = (ab.dot(ap), ac.dot(ap));
    if d1 <= 0.0 && d2 <= 0.0 {
        return [1.0, 0.0, 0.0];
    }
    let bp = p - b;
    let (d3, d4) = (ab.dot(bp), ac.dot(bp));
    if d3 >= 0.0 && d4 <= d3 {
        return [0.0, 1.0, 0.0];
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        let v = ratio(d1, d1 - d3);
        return [1.0 - v, v, 0.0];
    }
    let cp = p - c;
    let (d5, d6) = (ab.dot(cp), ac.dot(cp));
    if d6 >= 0.0 && d5 <= d6 {
        return [0.0, 0.0, 1.0];
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        let w = ratio(d2, d2 - d6);
        return [1.0 - w, 0.0, w];
    }
    let va = d3 * d6 - d5 * d4;
    if va <= 0.0 && d4 >= d3 && d5 >= d6 {
        let w = ratio(d4 - d3, (d4 - d3) + (d5 - d6));
        return [0.0, 1.0 - w, w];
    }
    let sum = va + vb + vc;
    let (v, w) = (ratio(vb, sum), ratio(vc, sum));
    [1.0 - v - w, v, w]
}

fn ratio(part: f32, whole: f32) -> f32 {
    if whole > 0.0 { (part / whole).clamp(0.0, 1.0) } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn no_point_of_the_triangle_is_nearer(c in prop::array::uniform12(-2.0f32..2.0), s in 0.0f32..1.0, t in 0.0f32..1.0) {
            let v = |i: usize| Vec3::new(c[3 * i], c[3 * i + 1], c[3 * i + 2]);
            let (corners, p) = ([v(0), v(1), v(2)], v(3));
            let w = closest_weights(corners, p);
            prop_assert!(w.iter().all(|w| *w >= -1e-6) && (w.iter().sum::<f32>() - 1.0).abs() < 1e-5);
            let found = corners[0] * w[0] + corners[1] * w[1] + corners[2] * w[2];
            let (s, t) = if s + t > 1.0 { (1.0 - s, 1.0 - t) } else { (s, t) };
            let other = corners[0] + (corners[1] - corners[0]) * s + (corners[2] - corners[0]) * t;
            prop_assert!(found.distance(p) <= other.distance(p) + 2e-3, "{} > {}", found.distance(p), other.distance(p));
        }
    }
}
