//! Timing: interleaved repeats, quantiles, spread, ratios with confidence intervals, and a machine
//! control.
//!
//! # Practice
//! Contenders are timed in turn, so that a slow moment of the machine affects all of them. A ratio
//! of medians comes with its 95 % bootstrap interval. A control (an empty timed call and a fixed
//! sum) is timed with every part; its variation is the noise of the times of that run.

use serde::{Deserialize, Serialize};
use std::time::Instant;

/// Number of bootstrap draws.
const DRAWS: usize = 400;
/// Number of control calls.
const CALLS: usize = 300;
/// Numbers that the control adds up: about 10 µs.
const SUM: u32 = 20_000;

/// Sorted times, µs.
#[derive(Clone, Debug, Default)]
pub struct Samples(Vec<f64>);

impl Samples {
    /// Times each of `count` calls.
    pub fn of(count: usize, mut call: impl FnMut(usize)) -> Self {
        let time = |i| {
            let start = Instant::now();
            call(i);
            start.elapsed().as_secs_f64() * 1e6
        };
        Self::from((0..count).map(time).collect::<Vec<f64>>())
    }

    /// Times `rounds` calls of each contender, one after the other in every round.
    pub fn in_turn<C>(rounds: usize, contenders: &mut [C], mut call: impl FnMut(&mut C, usize)) -> Vec<Self> {
        let mut times = vec![Vec::with_capacity(rounds); contenders.len()];
        for round in 0..rounds {
            for (contender, times) in contenders.iter_mut().zip(&mut times) {
                let start = Instant::now();
                call(contender, round);
                times.push(start.elapsed().as_secs_f64() * 1e6);
            }
        }
        times.into_iter().map(Self::from).collect()
    }

    /// Quantile, 0 to 1, µs; NaN without samples.
    pub fn quantile(&self, share: f64) -> f64 {
        let last = self.0.len().saturating_sub(1);
        self.0.get((share * last as f64).round() as usize).copied().unwrap_or(f64::NAN)
    }

    /// Interquartile range as a share of the median.
    pub fn spread(&self) -> f64 {
        (self.quantile(0.75) - self.quantile(0.25)) / self.quantile(0.5)
    }

    /// Ratio of this median to another's: low end, value, high end of the 95 % interval.
    pub fn over(&self, other: &Self) -> [f64; 3] {
        let mut random = fastrand::Rng::with_seed(1);
        let mut drawn = |samples: &Self| {
            let all = (0..samples.0.len()).map(|_| samples.0[random.usize(..samples.0.len())]);
            Self::from(all.collect::<Vec<f64>>()).quantile(0.5)
        };
        let ratios = Self::from((0..DRAWS).map(|_| drawn(self) / drawn(other)).collect::<Vec<f64>>());
        [ratios.quantile(0.025), self.quantile(0.5) / other.quantile(0.5), ratios.quantile(0.975)]
    }
}

impl From<Vec<f64>> for Samples {
    /// Creates samples from unsorted times, µs.
    fn from(mut times: Vec<f64>) -> Self {
        times.sort_by(f64::total_cmp);
        Self(times)
    }
}

/// Times of an empty call and of a fixed sum on this machine, µs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Control {
    /// 99 % quantile of an empty timed call, µs.
    pub empty_p99_us: f64,
    /// Median of the fixed sum, µs.
    pub sum_p50_us: f64,
    /// 99 % quantile of the fixed sum, µs.
    pub sum_p99_us: f64,
    /// Processes that run or wait for a core, mean over a minute; 0 where the system does not say.
    #[serde(default)]
    pub load: f64,
}

impl Control {
    /// The slower of two controls in each value.
    pub fn or(self, other: Self) -> Self {
        Self {
            empty_p99_us: self.empty_p99_us.max(other.empty_p99_us),
            sum_p50_us: self.sum_p50_us.max(other.sum_p50_us),
            sum_p99_us: self.sum_p99_us.max(other.sum_p99_us),
            load: self.load.max(other.load),
        }
    }

    /// Measures the control in about 5 ms.
    pub fn now() -> Self {
        let empty = Samples::of(CALLS, |_| {});
        let sum = Samples::of(CALLS, |call| {
            let all = (0..SUM).fold(call as u32, |sum, n| std::hint::black_box(sum.wrapping_mul(31).wrapping_add(n)));
            std::hint::black_box(all);
        });
        let text = std::fs::read_to_string("/proc/loadavg").unwrap_or_default();
        let load = text.split_whitespace().next().and_then(|word| word.parse().ok()).unwrap_or(0.0);
        let [empty_p99_us, sum_p50_us] = [empty.quantile(0.99), sum.quantile(0.5)];
        Self { empty_p99_us, sum_p50_us, sum_p99_us: sum.quantile(0.99), load }
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

    #[test]
    fn a_ratio_lies_in_its_interval_and_contenders_alternate() {
        let mut order = Vec::new();
        let timed = Samples::in_turn(3, &mut ['a', 'b'], |name, round| order.push((*name, round)));
        assert_eq!(order, [('a', 0), ('b', 0), ('a', 1), ('b', 1), ('a', 2), ('b', 2)]);
        assert_eq!(timed.len(), 2);
        let samples =
            |scale: f64| Samples::from((0..40).map(|n| scale * (10.0 + f64::from(n % 7))).collect::<Vec<_>>());
        let [low, ratio, high] = samples(2.0).over(&samples(1.0));
        assert!(
            low <= ratio && ratio <= high && (ratio - 2.0).abs() < 1e-12 && high / low < 1.5,
            "{low} {ratio} {high}"
        );
        assert!((samples(1.0).spread() - samples(3.0).spread()).abs() < 1e-12);
    }
}
