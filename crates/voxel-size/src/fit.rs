//! Fits the costs of a visit and a test on a machine to measured times.
//!
//! # Theory
//! A pass takes t = t_0 + t_v · visits + t_d · doubts + t_p · tests. t_0 is the part independent of
//! the cell size (sorting particles, boxes, the narrow phase) and t_d the cost of a mispredicted
//! branch. With times at several cell sizes this is linear least squares, solved here with relative
//! weights (each time divided by itself), so that no size dominates. A negative cost, possible with
//! noise, is set to 0 and the others are solved again.
//!
//! # Practice
//! Times are in any unit; costs are in the same unit. At least four cell sizes are needed; seven to
//! twelve from 0.5 to 4 mean edges are recommended.

use crate::CostModel;
use crate::error::{VoxelSizeError, checked, positive};
use nalgebra::{SMatrix, SVector};

/// The work of a pass that depends on the cell size: counted, or expected by
/// [`Expected::work`](crate::Expected::work).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Work {
    /// Cells visited.
    pub visits: f64,
    /// Loops over the cells of a box whose length a processor mispredicts.
    pub doubts: f64,
    /// Particles tested.
    pub tests: f64,
}

/// Cost of each part of a pass, in the unit of the measured times.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Prices {
    /// The part independent of the cell size.
    pub fixed: f64,
    /// One visited cell, t_v.
    pub visit: f64,
    /// One misprediction.
    pub doubt: f64,
    /// One tested particle, t_p.
    pub test: f64,
}

impl Prices {
    /// Predicted time of a pass.
    pub fn time(&self, work: &Work) -> f64 {
        self.fixed + self.visit * work.visits + self.doubt * work.doubts + self.test * work.tests
    }

    /// The cost model with these costs, for a measured fraction of idle tetrahedra.
    pub fn model(&self, p_nc: f64) -> Result<CostModel, VoxelSizeError> {
        checked("visit", self.visit, self.visit > 0.0, "positive; measure also at small cells")?;
        checked("test", self.test, self.test > 0.0, "positive; measure also at large cells")?;
        let model = CostModel { p_nc, r_t: self.test / self.visit };
        model.check().map(|()| model)
    }
}

/// Number of costs.
const PRICES: usize = 4;

/// Fits the costs to measured work and times.
pub fn fit(measured: &[(Work, f64)]) -> Result<Prices, VoxelSizeError> {
    for (_, time) in measured {
        positive("a measured time", *time)?;
    }
    let mut used = [true; PRICES];
    loop {
        let prices = least_squares(measured, used)?;
        match (0..PRICES).filter(|&n| prices[n] < 0.0).min_by(|&a, &b| prices[a].total_cmp(&prices[b])) {
            Some(worst) => used[worst] = false,
            None => {
                let [fixed, visit, doubt, test] = prices;
                return Ok(Prices { fixed, visit, doubt, test });
            }
        }
    }
}

/// Least-squares costs of the used columns; 0 for the others.
fn least_squares(measured: &[(Work, f64)], mut used: [bool; PRICES]) -> Result<[f64; PRICES], VoxelSizeError> {
    let scale = column_scale(measured);
    (0..PRICES).for_each(|n| used[n] &= scale[n] > f64::MIN_POSITIVE);
    let wanted = used.iter().filter(|u| **u).count();
    let (mut normal, mut right) = (SMatrix::<f64, PRICES, PRICES>::zeros(), SVector::<f64, PRICES>::zeros());
    for (work, time) in measured {
        let columns = columns(work);
        let row = SVector::<f64, PRICES>::from_fn(|n, _| if used[n] { columns[n] / scale[n] / time } else { 0.0 });
        normal += row * row.transpose();
        right += row;
    }
    (0..PRICES).filter(|&n| !used[n]).for_each(|n| normal[(n, n)] = 1.0);
    let lu = normal.lu();
    let is_regular = lu.u().diagonal().iter().all(|pivot| pivot.abs() > 1e-10) && measured.len() >= wanted;
    let solved = lu.solve(&right).filter(|_| is_regular);
    let solved = solved.ok_or(VoxelSizeError::Fit { got: measured.len(), wanted })?;
    Ok(std::array::from_fn(|n| if used[n] { solved[n] / scale[n] } else { 0.0 }))
}

fn columns(work: &Work) -> [f64; PRICES] {
    [1.0, work.visits, work.doubts, work.tests]
}

/// The largest ratio of each column to its time, used to scale the normal matrix.
fn column_scale(measured: &[(Work, f64)]) -> [f64; PRICES] {
    let largest = |n: usize| measured.iter().map(|(c, t)| columns(c)[n] / t).fold(f64::MIN_POSITIVE, f64::max);
    std::array::from_fn(largest)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn measured(prices: &Prices, noise: f64) -> Vec<(Work, f64)> {
        let at = |n: u64| {
            let doubts = [900.0, 100.0, 800.0, 300.0, 500.0, 200.0, 700.0][n as usize - 1];
            Work { visits: 80_000.0 / (n * n) as f64, doubts, tests: (30 * n * n * n) as f64 }
        };
        (1..8).map(|n| (at(n), prices.time(&at(n)) * (1.0 + noise * (n as f64 * 12.9).sin()))).collect()
    }

    #[test]
    fn prices_come_back() {
        let prices = Prices { fixed: 400.0, visit: 0.8, doubt: 7.0, test: 4.4 };
        let found = fit(&measured(&prices, 0.0)).unwrap();
        assert!(
            (found.visit / 0.8 - 1.0).abs() < 1e-6
                && (found.test / 4.4 - 1.0).abs() < 1e-6
                && (found.fixed / 400.0 - 1.0).abs() < 1e-6
                && (found.doubt / 7.0 - 1.0).abs() < 1e-6
        );
        assert!((found.model(0.99).unwrap().r_t - 5.5).abs() < 1e-5);
        let noisy = fit(&measured(&prices, 0.02)).unwrap();
        assert!((noisy.visit / 0.8 - 1.0).abs() < 0.1 && (noisy.test / 4.4 - 1.0).abs() < 0.1);
    }

    #[test]
    fn no_price_is_negative() {
        let prices = Prices { fixed: 0.0, visit: 1.0, doubt: 0.0, test: 0.0 };
        let found = fit(&measured(&prices, 0.05)).unwrap();
        assert!(found.fixed >= 0.0 && found.visit > 0.9 && found.doubt >= 0.0 && found.test >= 0.0);
    }

    #[test]
    fn too_little_is_refused() {
        let prices = Prices { fixed: 1.0, visit: 1.0, doubt: 1.0, test: 1.0 };
        let all = measured(&prices, 0.0);
        assert_eq!(fit(&all[..3]), Err(VoxelSizeError::Fit { got: 3, wanted: 4 }));
        assert_eq!(fit(&[all[0]; 6]), Err(VoxelSizeError::Fit { got: 6, wanted: 4 }));
        assert!(matches!(fit(&[(Work::default(), f64::NAN)]), Err(VoxelSizeError::Field { .. })));
    }
}
