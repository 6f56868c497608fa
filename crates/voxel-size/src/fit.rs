//! What a visit, a test and the rest cost on a machine, from times that someone else measured.
//!
//! # Theory
//! A pass takes t = t_0 + t_v · visits + t_p · tests, where t_0 holds what no cell size changes (sorting particles, boxes, the narrow phase). With times at several cell
//! sizes this is linear least squares, solved here with relative weights (each time divided by itself), so that no size dominates.
//! A negative price, which noise can give, is set to 0 and the rest solved again.
//!
//! # Practice
//! Times in any unit; prices come in the same unit. Three cell sizes are the minimum; five to ten from 0.5 to 4 mean edges do well.

use crate::CostModel;
use crate::counts::Counts;
use crate::error::{VoxelSizeError, checked};

/// What each part of a pass costs, in the unit of the measured times.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Prices {
    /// The part that no cell size changes.
    pub fixed: f64,
    /// One cell visited, t_v.
    pub visit: f64,
    /// One particle tested, t_p.
    pub test: f64,
}

impl Prices {
    /// Predicted time of a pass.
    pub fn time(&self, counts: &Counts) -> f64 {
        self.fixed + self.visit * counts.visits as f64 + self.test * counts.tests as f64
    }

    /// The cost model with these prices, for a measured share of idle tetrahedra.
    pub fn model(&self, p_nc: f64) -> Result<CostModel, VoxelSizeError> {
        checked("visit", self.visit, self.visit > 0.0, "positive; measure also at small cells")?;
        checked("test", self.test, self.test > 0.0, "positive; measure also at large cells")?;
        let model = CostModel { p_nc, r_t: self.test / self.visit };
        model.check().map(|()| model)
    }
}

/// Prices from counts and the times that they took.
pub fn fit(measured: &[(Counts, f64)]) -> Result<Prices, VoxelSizeError> {
    for (_, time) in measured {
        checked("a measured time", *time, *time > 0.0 && time.is_finite(), "positive and finite")?;
    }
    let mut used = [true; 3];
    loop {
        let prices = least_squares(measured, used)?;
        match (0..3).filter(|&n| prices[n] < 0.0).min_by(|&a, &b| prices[a].total_cmp(&prices[b])) {
            Some(worst) => used[worst] = false,
            None => return Ok(Prices { fixed: prices[0], visit: prices[1], test: prices[2] }),
        }
    }
}

/// Prices of the used columns; 0 for the others.
fn least_squares(measured: &[(Counts, f64)], used: [bool; 3]) -> Result<[f64; 3], VoxelSizeError> {
    let wanted = used.iter().filter(|u| **u).count();
    let scale = column_scale(measured);
    let mut matrix = [[0.0; 4]; 3];
    for (counts, time) in measured {
        let row: [f64; 3] = std::array::from_fn(|n| if used[n] { columns(counts)[n] / scale[n] / time } else { 0.0 });
        for i in 0..3 {
            (0..3).for_each(|j| matrix[i][j] += row[i] * row[j]);
            matrix[i][3] += row[i];
        }
    }
    (0..3).filter(|&n| !used[n]).for_each(|n| matrix[n][n] = 1.0);
    let solved = solve(matrix).filter(|_| measured.len() >= wanted);
    let solved = solved.ok_or(VoxelSizeError::Fit { got: measured.len(), wanted })?;
    Ok(std::array::from_fn(|n| solved[n] / scale[n]))
}

fn columns(counts: &Counts) -> [f64; 3] {
    [1.0, counts.visits as f64, counts.tests as f64]
}

/// The largest of each column over its time, so that the normal matrix is well scaled.
fn column_scale(measured: &[(Counts, f64)]) -> [f64; 3] {
    let largest = |n: usize| measured.iter().map(|(c, t)| columns(c)[n] / t).fold(f64::MIN_POSITIVE, f64::max);
    std::array::from_fn(largest)
}

/// Gauss's elimination with row pivots; `None` when the matrix is singular to rounding.
fn solve(mut m: [[f64; 4]; 3]) -> Option<[f64; 3]> {
    for col in 0..3 {
        let pivot = (col..3).max_by(|&a, &b| m[a][col].abs().total_cmp(&m[b][col].abs()))?;
        m.swap(col, pivot);
        let regular = m[col][col].abs() > 1e-10;
        if !regular {
            return None;
        }
        let pivot_row = m[col];
        for row in (0..3).filter(|&row| row != col) {
            let factor = m[row][col] / pivot_row[col];
            (col..4).for_each(|n| m[row][n] -= factor * pivot_row[n]);
        }
    }
    Some(std::array::from_fn(|n| m[n][3] / m[n][n]))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn measured(prices: &Prices, noise: f64) -> Vec<(Counts, f64)> {
        let at = |n: u64| Counts { visits: 80_000 / (n * n), tests: 30 * n * n * n, ..Counts::default() };
        (1..8).map(|n| (at(n), prices.time(&at(n)) * (1.0 + noise * (n as f64 * 12.9).sin()))).collect()
    }

    #[test]
    fn prices_come_back() {
        let prices = Prices { fixed: 400.0, visit: 0.8, test: 4.4 };
        let found = fit(&measured(&prices, 0.0)).unwrap();
        assert!(
            (found.visit / 0.8 - 1.0).abs() < 1e-6
                && (found.test / 4.4 - 1.0).abs() < 1e-6
                && (found.fixed / 400.0 - 1.0).abs() < 1e-6
        );
        assert!((found.model(0.99).unwrap().r_t - 5.5).abs() < 1e-5);
        let noisy = fit(&measured(&prices, 0.02)).unwrap();
        assert!((noisy.visit / 0.8 - 1.0).abs() < 0.1 && (noisy.test / 4.4 - 1.0).abs() < 0.1);
    }

    #[test]
    fn no_price_is_negative() {
        let prices = Prices { fixed: 0.0, visit: 1.0, test: 0.0 };
        let found = fit(&measured(&prices, 0.05)).unwrap();
        assert!(found.fixed >= 0.0 && found.visit > 0.9 && found.test >= 0.0);
    }

    #[test]
    fn too_little_is_refused() {
        let prices = Prices { fixed: 1.0, visit: 1.0, test: 1.0 };
        let all = measured(&prices, 0.0);
        assert_eq!(fit(&all[..2]), Err(VoxelSizeError::Fit { got: 2, wanted: 3 }));
        assert_eq!(fit(&[all[0]; 6]), Err(VoxelSizeError::Fit { got: 6, wanted: 3 }));
        assert!(matches!(fit(&[(Counts::default(), f64::NAN)]), Err(VoxelSizeError::Field { .. })));
    }
}
