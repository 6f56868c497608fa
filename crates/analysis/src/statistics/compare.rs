//! Compares two samples: permutation test, Hedges' g, bootstrap interval, Holm's correction.
//!
//! # Theory
//! The permutation test needs no distribution: under the null hypothesis the labels (or the signs
//! of paired differences) are exchangeable. p = (1 + draws as far or farther) / (1 + draws), which
//! is valid for any number of draws (Phipson and Smyth 2010). Hedges' g is the difference of means
//! over the pooled standard deviation, times 1 - 3/(4 n - 9) against its bias. The interval is the
//! bias-corrected and accelerated bootstrap (Efron 1987).
//!
//! # Sources
//! Hedges 1981, J Educ Stat 6; Efron 1987, J Am Stat Assoc 82; Holm 1979, Scand J Stat 6; Phipson
//! and Smyth 2010, Stat Appl Genet Mol Biol 9.

use super::{mean, variance};
use fastrand::Rng;
use serde::Serialize;
use statrs::distribution::{ContinuousCDF, Normal};

/// Two samples compared: the first minus the second.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Comparison {
    /// Size of the first sample.
    pub n_first: usize,
    /// Size of the second sample.
    pub n_second: usize,
    /// Mean of the first sample.
    pub mean_first: f64,
    /// Mean of the second sample.
    pub mean_second: f64,
    /// Hedges' g; of pairs, the mean difference over the differences' standard deviation,
    /// corrected.
    pub g: f64,
    /// Lower end of the 95 % interval of g.
    pub g_low: f64,
    /// Upper end.
    pub g_high: f64,
    /// Two-sided p of the permutation test.
    pub p: f64,
}

impl Comparison {
    fn of(a: &[f64], b: &[f64], g: f64, [g_low, g_high]: [f64; 2], p: f64) -> Self {
        Self { n_first: a.len(), n_second: b.len(), mean_first: mean(a), mean_second: mean(b), g, g_low, g_high, p }
    }
}

/// Compares independent samples with `draws` permutations and as many bootstrap samples. `None`
/// with fewer than three values in a sample, or where no value differs.
pub fn compare(a: &[f64], b: &[f64], draws: usize, seed: u64) -> Option<Comparison> {
    let g = hedges_g(a, b);
    if a.len() < 3 || b.len() < 3 || !g.is_finite() {
        return None;
    }
    let mut rng = Rng::with_seed(seed);
    let mut all = [a, b].concat();
    // A little less, for rounding.
    let observed = (mean(a) - mean(b)).abs() * (1.0 - 1e-12);
    let total: f64 = all.iter().sum();
    let mut far = 0;
    for _ in 0..draws {
        // The first values of a shuffle are a random choice.
        for at in 0..a.len() {
            let other = rng.usize(at..all.len());
            all.swap(at, other);
        }
        let sum: f64 = all[..a.len()].iter().sum();
        let difference = sum / a.len() as f64 - (total - sum) / b.len() as f64;
        far += usize::from(difference.abs() >= observed);
    }
    let samples = (0..draws).map(|_| hedges_g(&redrawn(a, &mut rng), &redrawn(b, &mut rng))).collect();
    let left_out = without_each(a).map(|a| hedges_g(&a, b)).chain(without_each(b).map(|b| hedges_g(a, &b))).collect();
    Some(Comparison::of(a, b, g, bca(g, samples, left_out), (1 + far) as f64 / (1 + draws) as f64))
}

/// Compares pairs by flips of the differences' signs. `None` with fewer than five pairs, of which
/// no flip can be significant, or where no difference varies.
pub fn compare_paired(pairs: &[[f64; 2]], draws: usize, seed: u64) -> Option<Comparison> {
    let differences: Vec<f64> = pairs.iter().map(|[a, b]| a - b).collect();
    let g = paired_g(&differences);
    if pairs.len() < 5 || !g.is_finite() {
        return None;
    }
    let mut rng = Rng::with_seed(seed);
    let observed = mean(&differences).abs() * (1.0 - 1e-12);
    let mut far = 0;
    for _ in 0..draws {
        let sum: f64 = differences.iter().map(|d| if rng.bool() { *d } else { -d }).sum();
        far += usize::from((sum / differences.len() as f64).abs() >= observed);
    }
    let samples = (0..draws).map(|_| paired_g(&redrawn(&differences, &mut rng))).collect();
    let left_out = without_each(&differences).map(|rest| paired_g(&rest)).collect();
    let column = |at: usize| pairs.iter().map(|pair| pair[at]).collect::<Vec<_>>();
    Some(Comparison::of(&column(0), &column(1), g, bca(g, samples, left_out), (1 + far) as f64 / (1 + draws) as f64))
}

fn hedges_g(a: &[f64], b: &[f64]) -> f64 {
    let (n, m) = (a.len() as f64, b.len() as f64);
    let pooled = ((n - 1.0) * variance(a) + (m - 1.0) * variance(b)) / (n + m - 2.0);
    (mean(a) - mean(b)) / pooled.sqrt() * (1.0 - 3.0 / (4.0 * (n + m) - 9.0))
}

fn paired_g(differences: &[f64]) -> f64 {
    let freedom = differences.len() as f64 - 1.0;
    mean(differences) / variance(differences).sqrt() * (1.0 - 3.0 / (4.0 * freedom - 1.0))
}

fn redrawn(values: &[f64], rng: &mut Rng) -> Vec<f64> {
    (0..values.len()).map(|_| values[rng.usize(..values.len())]).collect()
}

/// The sample without each value in turn.
fn without_each(values: &[f64]) -> impl Iterator<Item = Vec<f64>> {
    (0..values.len()).map(|out| [&values[..out], &values[out + 1..]].concat())
}

/// 95 % interval, bias-corrected and accelerated; NaN where the samples vary too little for one.
fn bca(estimate: f64, mut samples: Vec<f64>, left_out: Vec<f64>) -> [f64; 2] {
    samples.retain(|sample| sample.is_finite());
    let normal = Normal::standard();
    let below = samples.iter().filter(|sample| **sample < estimate).count() as f64
        + 0.5 * samples.iter().filter(|sample| **sample == estimate).count() as f64;
    let bias = normal.inverse_cdf((below / samples.len() as f64).clamp(1e-6, 1.0 - 1e-6));
    let middle = mean(&left_out);
    let power = |k| left_out.iter().map(|value| (middle - value).powi(k)).sum::<f64>();
    let acceleration = power(3) / (6.0 * power(2).powf(1.5)).max(f64::MIN_POSITIVE);
    [0.025, 0.975].map(|share| {
        let z = bias + normal.inverse_cdf(share);
        super::quantile(&mut samples, normal.cdf(bias + z / (1.0 - acceleration * z)))
    })
}

/// Holm's adjusted p-values, in the order given: they keep the chance of any false finding.
pub fn holm(p: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..p.len()).collect();
    order.sort_by(|a, b| p[*a].total_cmp(&p[*b]));
    let (mut adjusted, mut most) = (vec![0.0; p.len()], 0.0_f64);
    for (rank, at) in order.into_iter().enumerate() {
        most = most.max((p.len() - rank) as f64 * p[at]).min(1.0);
        adjusted[at] = most;
    }
    adjusted
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn p_of_a_small_sample_is_that_of_all_its_permutations() {
        // Of the 20 choices of 3 from 6, two are as far: exact p 0.1.
        let found = compare(&[1.0, 2.0, 3.0], &[4.0, 5.0, 6.0], 100_000, 1).unwrap();
        assert!((found.p - 0.1).abs() < 0.004, "{}", found.p);
        // d is -3, the correction 1 - 3/15.
        assert!((found.g + 2.4).abs() < 1e-12, "{}", found.g);
        // Of 32 flips of five differences of one sign, two are as far.
        let pairs = [[2.0, 1.0], [3.0, 1.0], [4.0, 1.0], [5.0, 1.0], [6.0, 1.0]];
        assert!((compare_paired(&pairs, 100_000, 1).unwrap().p - 0.0625).abs() < 0.003);
        assert_eq!(compare(&[1.0; 3], &[1.0; 3], 100, 1), None);
        assert_eq!(compare_paired(&pairs[..4], 100, 1), None);
    }

    #[test]
    fn p_under_the_null_hypothesis_is_uniform_and_the_interval_holds_the_truth() {
        let normal = Normal::standard();
        let (mut under, mut covered, rounds) = (0, 0, 1000);
        for seed in 0..rounds {
            let mut rng = Rng::with_seed(seed);
            let mut draw =
                |shift: f64| (0..20).map(|_| shift + normal.inverse_cdf(rng.f64().max(1e-12))).collect::<Vec<_>>();
            let (a, b, c) = (draw(0.0), draw(0.0), draw(-0.8));
            under += usize::from(compare(&a, &b, 199, seed).unwrap().p <= 0.05);
            let Comparison { g_low: low, g_high: high, .. } = compare(&a, &c, 399, seed).unwrap();
            covered += usize::from(low <= 0.8 && 0.8 <= high);
        }
        // 50 of 1000 are expected, with a standard deviation of 7.
        assert!((29..=71).contains(&under), "{under} of 1000 under 0.05");
        // A bootstrap of 20 + 20 values is a little short of 95 %.
        assert!((900..=975).contains(&covered), "{covered} of 1000 cover");
    }

    #[test]
    fn holm_is_that_of_the_textbook() {
        let adjusted = holm(&[0.01, 0.04, 0.03, 0.005]);
        let expected = [0.03, 0.06, 0.06, 0.02];
        assert!(adjusted.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12), "{adjusted:?}");
    }
}
