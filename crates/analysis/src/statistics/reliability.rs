//! Intraclass correlation: how well one measurement tells participants apart.
//!
//! # Theory
//! Two-way analysis of variance of n participants by k trials gives the mean squares between
//! participants (B), between trials (J) and of the error (E). ICC(2,1) = (B - E) / (B + (k-1) E + k
//! (J - E) / n) counts a change between trials, such as learning, as error; ICC(3,1) = (B - E) / (B
//! + (k-1) E) does not.
//!
//! # Sources
//! Shrout and Fleiss 1979, Psychol Bull 86; the interval of ICC(2,1) as in McGraw and Wong 1996,
//! Psychol Methods 1.

use serde::Serialize;
use statrs::distribution::{ContinuousCDF, FisherSnedecor};

/// Reliability of one trial.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Reliability {
    /// Participants.
    pub participants: usize,
    /// Trials of each.
    pub trials: usize,
    /// ICC(2,1), absolute agreement.
    pub icc_2_1: f64,
    /// Lower end of its 95 % interval.
    pub icc_2_1_low: f64,
    /// Upper end.
    pub icc_2_1_high: f64,
    /// ICC(3,1), consistency.
    pub icc_3_1: f64,
    /// Lower end of its 95 % interval.
    pub icc_3_1_low: f64,
    /// Upper end.
    pub icc_3_1_high: f64,
}

/// Reliability of the rows of participants by their trials. `None` with fewer than three
/// participants or two trials, rows of unequal length, or where nothing varies.
pub fn reliability(rows: &[Vec<f64>]) -> Option<Reliability> {
    let (n, k) = (rows.len(), rows.first()?.len());
    if n < 3 || k < 2 || rows.iter().any(|row| row.len() != k) {
        return None;
    }
    let (nf, kf) = (n as f64, k as f64);
    let total = rows.iter().flatten().sum::<f64>() / (nf * kf);
    let row_means: Vec<f64> = rows.iter().map(|row| super::mean(row)).collect();
    let trial_means: Vec<f64> = (0..k).map(|trial| rows.iter().map(|row| row[trial]).sum::<f64>() / nf).collect();
    let squares = |means: &[f64]| means.iter().map(|mean| (mean - total).powi(2)).sum::<f64>();
    let between = kf * squares(&row_means) / (nf - 1.0);
    let trials = nf * squares(&trial_means) / (kf - 1.0);
    let residual = |(row, mean): (&Vec<f64>, &f64)| {
        row.iter().zip(&trial_means).map(|(value, trial)| (value - mean - trial + total).powi(2)).sum::<f64>()
    };
    let freedom = (nf - 1.0) * (kf - 1.0);
    let error = rows.iter().zip(&row_means).map(residual).sum::<f64>() / freedom;
    if error.is_nan() || error <= 0.0 {
        return None;
    }
    let f = |share: f64, above: f64, below: f64| Some(FisherSnedecor::new(above, below).ok()?.inverse_cdf(share));
    let consistency = |f: f64| (f - 1.0) / (f + kf - 1.0);
    let ratio = between / error;
    let low = ratio / f(0.975, nf - 1.0, freedom)?;
    let high = ratio * f(0.975, freedom, nf - 1.0)?;
    let value = (between - error) / (between + (kf - 1.0) * error + kf * (trials - error) / nf);
    let change = trials / error;
    let inner = nf * (1.0 + (kf - 1.0) * value) - kf * value;
    let wide =
        freedom * (kf * value * change + inner).powi(2) / ((nf - 1.0) * (kf * value * change).powi(2) + inner.powi(2));
    let (up, down) = (f(0.975, nf - 1.0, wide)?, f(0.975, wide, nf - 1.0)?);
    let spread = kf * trials + (kf * nf - kf - nf) * error;
    Some(Reliability {
        participants: n,
        trials: k,
        icc_2_1: value,
        icc_2_1_low: nf * (between - up * error) / (up * spread + nf * between),
        icc_2_1_high: nf * (down * between - error) / (spread + nf * down * between),
        icc_3_1: consistency(ratio),
        icc_3_1_low: consistency(low),
        icc_3_1_high: consistency(high),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shrout_and_fleiss_example_has_its_published_values() {
        // Their table 2: six targets by four judges.
        let rows = [[9, 2, 5, 8], [6, 1, 3, 2], [8, 4, 6, 8], [7, 1, 2, 6], [10, 5, 6, 9], [6, 2, 4, 7]];
        let rows = rows.map(|row| row.map(f64::from).to_vec());
        let found = reliability(&rows).unwrap();
        assert!((found.icc_2_1 - 0.29).abs() < 0.005 && (found.icc_3_1 - 0.71).abs() < 0.005, "{found:?}");
        // Intervals of R's psych::ICC on the same table: 0.02 to 0.76, and 0.34 to 0.95.
        let ends = [found.icc_2_1_low, found.icc_2_1_high, found.icc_3_1_low, found.icc_3_1_high];
        assert!(ends.iter().zip([0.02, 0.76, 0.34, 0.95]).all(|(a, b)| (a - b).abs() < 0.006), "{found:?}");
        assert_eq!(reliability(&rows[..2]), None);
    }
}
