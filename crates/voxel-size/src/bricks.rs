//! Optimal brick size of a density volume that a tool reads and carves.
//!
//! # Theory
//! A volume of voxels of edge h is stored in bricks of edge δ. A tool whose box has width w covers
//! `(w/δ + 1)³` bricks on average over its positions; each costs one visit, t_v (look-up, version
//! check). Its changes are in the same box, and whole bricks are copied (to the renderer, to the
//! next thread): `(w/δ + 1)³ (δ/h)³` voxels at t_p each. So
//!
//! ```text
//! z(δ) = t_v (w/δ + 1)³ + t_p ((w + δ)/h)³        dz/dδ = 0   ⇔   δ⁴ = w h³ t_v / t_p
//! ```
//!
//! z decreases before that single root and increases after it. This extends chapter 5 of the thesis
//! to volumes, which it leaves open (7.2).
//!
//! # Practice
//! Bricks have whole voxels, often a power of two: [`Bricks::best_of`] compares given candidates.
//!
//! # When not to use it
//! When nothing is copied (t_p = 0): then larger is always better, up to the memory.

use crate::error::{VoxelSizeError, checked, positive};

/// A volume, a tool, and the cost of each operation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bricks {
    /// Edge of a voxel, h, mm.
    pub voxel_mm: f64,
    /// Width of the tool's box, w, mm.
    pub tool_mm: f64,
    /// Cost of visiting a brick, t_v, in any unit. Higher values favour larger bricks.
    pub visit: f64,
    /// Cost of copying a voxel, t_p, in the same unit. Higher values favour smaller bricks.
    pub copy: f64,
}

impl Bricks {
    /// z(δ), in the unit of the costs.
    pub fn cost(&self, delta_mm: f64) -> f64 {
        let (w, h) = (self.tool_mm, self.voxel_mm);
        self.visit * (w / delta_mm + 1.0).powi(3) + self.copy * ((w + delta_mm) / h).powi(3)
    }

    /// The cheapest brick edge, mm, in closed form.
    pub fn analytic(&self) -> Result<f64, VoxelSizeError> {
        self.check()?;
        Ok((self.tool_mm * self.voxel_mm.powi(3) * self.visit / self.copy).powf(0.25))
    }

    /// The cheapest of some edges in voxels, for example powers of two; the first on a tie.
    pub fn best_of(&self, voxels: &[u32]) -> Result<u32, VoxelSizeError> {
        self.check()?;
        let smallest = voxels.iter().min().copied().unwrap_or(0);
        checked("voxels in a brick's edge", smallest.into(), smallest > 0, "at least one choice, each above 0")?;
        let cost = |n: &u32| self.cost(f64::from(*n) * self.voxel_mm);
        Ok(voxels.iter().copied().min_by(|a, b| cost(a).total_cmp(&cost(b))).unwrap_or(smallest))
    }

    fn check(&self) -> Result<(), VoxelSizeError> {
        positive("voxel_mm", self.voxel_mm)?;
        positive("tool_mm", self.tool_mm)?;
        positive("visit", self.visit)?;
        positive("copy", self.copy).map(|_| ())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_root_is_the_minimum(voxel_mm in 0.1f64..2.0, tool_mm in 0.5f64..20.0, visit in 0.1f64..100.0, copy in 0.001f64..1.0) {
            let bricks = Bricks { voxel_mm, tool_mm, visit, copy };
            let best = bricks.analytic().unwrap();
            for off in [0.5, 0.9, 0.99, 1.01, 1.1, 2.0] {
                prop_assert!(bricks.cost(off * best) >= bricks.cost(best) * (1.0 - 1e-12));
            }
            let choices = [1, 2, 4, 8, 16, 32];
            let chosen = bricks.best_of(&choices).unwrap();
            prop_assert!(choices.iter().all(|&n| bricks.cost(f64::from(n) * voxel_mm) >= bricks.cost(f64::from(chosen) * voxel_mm)));
        }
    }

    /// The mean number of bricks that a box covers along one axis, over its positions, is w/δ + 1.
    #[test]
    fn the_count_is_the_mean_over_places() {
        for (w, delta) in [(4.0f64, 1.5f64), (1.0, 8.0)] {
            let places = 10_000;
            let met = |n: i32| {
                let low = delta * f64::from(n) / f64::from(places) + 1e-9;
                ((low + w) / delta).floor() - (low / delta).floor() + 1.0
            };
            let mean = (0..places).map(met).sum::<f64>() / f64::from(places);
            assert!((mean - (w / delta + 1.0)).abs() < 1e-3, "{mean}");
        }
    }

    #[test]
    fn bad_numbers_are_named() {
        let good = Bricks { voxel_mm: 0.5, tool_mm: 4.0, visit: 10.0, copy: 0.1 };
        let field = |e: VoxelSizeError| match e {
            VoxelSizeError::Field { field, .. } => field,
            other => panic!("{other:?}"),
        };
        assert_eq!(field(Bricks { voxel_mm: 0.0, ..good }.analytic().unwrap_err()), "voxel_mm");
        assert_eq!(field(Bricks { tool_mm: f64::NAN, ..good }.analytic().unwrap_err()), "tool_mm");
        assert_eq!(field(Bricks { copy: 0.0, ..good }.best_of(&[8]).unwrap_err()), "copy");
        assert_eq!(field(good.best_of(&[]).unwrap_err()), "voxels in a brick's edge");
        assert_eq!(field(good.best_of(&[8, 0]).unwrap_err()), "voxels in a brick's edge");
    }
}
