//! Quantiles of measured values.

/// Returns the quantile `share`, 0 to 1, of values in any order, which it sorts; NaN without
/// values.
///
/// The result is one of the values, the one at index `share (n - 1)`, rounded to the nearest and
/// from a half up; nothing is interpolated. So the median of an even number of values is the upper
/// of the two in the middle.
pub fn quantile(values: &mut [f64], share: f64) -> f64 {
    values.sort_by(f64::total_cmp);
    let last = values.len().saturating_sub(1);
    values.get((share * last as f64).round() as usize).copied().unwrap_or(f64::NAN)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_quantile_is_the_nearest_of_the_sorted_values() {
        let mut values = [3.0, 1.0, f64::INFINITY, 2.0];
        assert_eq!(
            [0.0, 0.5, 0.95, 1.0].map(|share| quantile(&mut values, share)),
            [1.0, 3.0, f64::INFINITY, f64::INFINITY]
        );
        assert_eq!(quantile(&mut [5.0, 4.0, 6.0], 0.5), 5.0);
        assert!(quantile(&mut [], 0.5).is_nan());
    }
}
