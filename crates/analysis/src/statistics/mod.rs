//! Statistics of studies: comparison, learning, reliability, classification, strokes, outliers,
//! power.
//!
//! # Practice
//! Functions of plain slices; what draws at random takes a seed. Missing values are left out by the
//! caller. `tests/test_statistics.py` compares them with SciPy and pingouin.

mod classify;
mod compare;
mod learning;
mod power;
mod reliability;
mod strokes;

pub use classify::{Classified, classify};
pub use compare::{Comparison, compare, compare_paired, holm};
pub use learning::{PowerLaw, fit_power_law};
pub use power::{Design, participants_needed, power};
pub use reliability::{Reliability, reliability};
pub use strokes::{Stroke, strokes};

/// Arithmetic mean; NaN for none.
pub fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

/// Unbiased variance; NaN for fewer than two values.
pub fn variance(values: &[f64]) -> f64 {
    let mean = mean(values);
    let sum: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
    if values.len() < 2 { f64::NAN } else { sum / (values.len() - 1) as f64 }
}

/// The quantile of a share from 0 to 1, between the values by rank; NaN for none. Sorts `values`.
pub fn quantile(values: &mut [f64], share: f64) -> f64 {
    values.sort_by(f64::total_cmp);
    let Some(last) = values.len().checked_sub(1) else { return f64::NAN };
    let at = share.clamp(0.0, 1.0) * last as f64;
    let (below, above) = (at.floor() as usize, at.ceil() as usize);
    values[below] + (at - at.floor()) * (values[above] - values[below])
}

/// Middle value; NaN for none.
pub fn median(values: &[f64]) -> f64 {
    quantile(&mut values.to_vec(), 0.5)
}

/// Modified z-score at which a value counts as an outlier (Iglewicz and Hoaglin 1993).
pub const OUTLIER_Z: f64 = 3.5;

/// Modified z-scores: 0.6745 times the distance from the median over the median absolute deviation.
/// All 0 where more than half of the values are the same.
///
/// Source: Iglewicz and Hoaglin 1993, How to Detect and Handle Outliers.
pub fn modified_z(values: &[f64]) -> Vec<f64> {
    let middle = median(values);
    let deviation = median(&values.iter().map(|value| (value - middle).abs()).collect::<Vec<_>>());
    let z = |value: &f64| if deviation > 0.0 { 0.6745 * (value - middle) / deviation } else { 0.0 };
    values.iter().map(z).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_outlier_is_found_and_the_others_are_not() {
        // Iglewicz and Hoaglin's example: of ten values, two are labelled.
        let values = [3.2, 3.3, 8.1, 3.2, 2.9, 3.7, 3.1, 3.5, 3.3, 9.2];
        let z = modified_z(&values);
        let far: Vec<f64> = values.into_iter().zip(z).filter(|(_, z)| z.abs() > OUTLIER_Z).map(|(v, _)| v).collect();
        assert_eq!(far, [8.1, 9.2]);
        assert_eq!(modified_z(&[1.0, 1.0, 1.0, 5.0]), [0.0; 4]);
    }
}
