//! Timing: repeats of one call, and quantiles of their times.

use std::time::Instant;

/// Sorted times, µs.
#[derive(Clone, Debug, Default)]
pub struct Samples(Vec<f64>);

impl Samples {
    /// Times `count` calls, each on its own.
    pub fn of(count: usize, mut call: impl FnMut(usize)) -> Self {
        let time = |i| {
            let start = Instant::now();
            call(i);
            start.elapsed().as_secs_f64() * 1e6
        };
        Self::from((0..count).map(time).collect::<Vec<f64>>())
    }

    /// A quantile, 0 to 1, µs; NaN without samples.
    pub fn quantile(&self, share: f64) -> f64 {
        let last = self.0.len().saturating_sub(1);
        self.0.get((share * last as f64).round() as usize).copied().unwrap_or(f64::NAN)
    }
}

impl From<Vec<f64>> for Samples {
    /// From times in any order, µs.
    fn from(mut times: Vec<f64>) -> Self {
        times.sort_by(f64::total_cmp);
        Self(times)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_ordered() {
        let samples = Samples::of(50, |i| {
            std::hint::black_box((0..i * 50).sum::<usize>());
        });
        assert!(samples.quantile(0.0) <= samples.quantile(0.5) && samples.quantile(0.5) <= samples.quantile(1.0));
        assert!(Samples::default().quantile(0.5).is_nan());
    }
}
