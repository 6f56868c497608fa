//! Rows of voxels that fill a ball with a ball-shaped hole: what a round tool can touch, without
//! what it has inside.
//!
//! ```text
//!    ┄┄────┄┄
//!  ───        ───      one or two rows a line
//!  ───        ───
//!    ┄┄────┄┄
//! ```

use glam::IVec3;
use trepan_geometry::Vec3;

/// A ball in grid coordinates.
#[derive(Clone, Copy, Debug)]
pub struct GridBall {
    /// Its centre.
    pub centre: Vec3,
    /// Its radius; a negative one has no voxel.
    pub radius: f32,
}

impl GridBall {
    /// Has no voxel.
    pub const NONE: Self = Self { centre: Vec3::ZERO, radius: -1.0 };

    /// Half the length of the ball's row at (j, k); none where it has no row.
    fn half(&self, j: i32, k: i32) -> Option<f32> {
        let across = (j as f32 - self.centre.y).powi(2) + (k as f32 - self.centre.z).powi(2);
        let rest = self.radius * self.radius - across;
        (self.radius > 0.0 && rest >= 0.0).then(|| rest.sqrt())
    }
}

/// Calls `visit` with the first voxel and the last x of every row of `ball` without `hole`.
pub fn rows(ball: GridBall, hole: GridBall, mut visit: impl FnMut(IVec3, i32)) {
    let (low, high) = ((ball.centre - ball.radius).ceil().as_ivec3(), (ball.centre + ball.radius).floor().as_ivec3());
    for k in low.z..=high.z {
        for j in low.y..=high.y {
            let Some(half) = ball.half(j, k) else { continue };
            let from = ceil(ball.centre.x - half);
            let to = floor(ball.centre.x + half);
            match hole.half(j, k) {
                Some(skip) => {
                    let (skip_from, skip_to) = (ceil(hole.centre.x - skip), floor(hole.centre.x + skip));
                    visit(IVec3::new(from, j, k), to.min(skip_from - 1));
                    visit(IVec3::new(from.max(skip_to + 1).max(skip_from), j, k), to);
                }
                None => visit(IVec3::new(from, j, k), to),
            }
        }
    }
}

/// Calls `visit` with each voxel of a box from `start` to before `end`, x fastest.
#[inline]
pub fn each(start: IVec3, end: IVec3, mut visit: impl FnMut(IVec3)) {
    for k in start.z..end.z {
        for j in start.y..end.y {
            (start.x..end.x).for_each(|i| visit(IVec3::new(i, j, k)));
        }
    }
}

/// The greatest whole number up to `x`. Without SSE 4.1 the standard one is a call.
fn floor(x: f32) -> i32 {
    let cut = x as i32;
    cut - i32::from(x < cut as f32)
}

/// The least whole number from `x` on.
fn ceil(x: f32) -> i32 {
    -floor(-x)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::collections::BTreeSet;

    proptest! {
        #[test]
        fn every_voxel_of_ball_without_hole_comes_once(b in prop::array::uniform3(-3.0f32..3.0), h in prop::array::uniform3(-3.0f32..3.0),
                                                       r in 0.1f32..5.0, s in -1.0f32..5.0) {
            let (ball, hole) = (GridBall { centre: b.into(), radius: r }, GridBall { centre: h.into(), radius: s });
            let mut seen = BTreeSet::new();
            rows(ball, hole, |from, to| (from.x..=to).for_each(|x| assert!(seen.insert([x, from.y, from.z]))));
            for at in 0..19i32.pow(3) {
                let v = IVec3::new(at % 19, at / 19 % 19, at / 361) - 9;
                let (out, within) = (v.as_vec3().distance(ball.centre) - r, v.as_vec3().distance(hole.centre) - s);
                if out.abs() > 1e-4 && within.abs() > 1e-4 {
                    prop_assert_eq!(seen.contains(&v.to_array()), out < 0.0 && (within > 0.0 || s <= 0.0), "{:?}", v);
                }
            }
        }
    }
}
