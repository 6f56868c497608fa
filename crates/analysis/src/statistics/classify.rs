//! Tells groups apart by several measures, judged by leaving each participant out in turn.
//!
//! # Theory
//! Diagonal linear discriminant: the group whose mean is nearest, each measure in units of its
//! standard deviation within the groups. Means and deviations are of the other participants only.
//! It has no setting to tune, and suits few participants (Dudoit, Fridlyand and Speed 2002).
//!
//! # Sources
//! Dudoit et al. 2002, J Am Stat Assoc 97; Clopper and Pearson 1934, Biometrika 26.

use fastrand::Rng;
use serde::Serialize;
use statrs::distribution::{Beta, ContinuousCDF};

/// How well the groups were told apart.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Classified {
    /// Group that each participant was taken for, in the order given.
    pub taken_for: Vec<usize>,
    /// Share that was right.
    pub accuracy: f64,
    /// Lower end of its 95 % interval (Clopper and Pearson).
    pub low: f64,
    /// Upper end.
    pub high: f64,
    /// Share of shuffled labels that are told apart as well.
    pub p: f64,
}

/// Classifies the rows of measures with their groups, numbered from 0. `None` where a group has
/// fewer than three participants, or there is one group only.
pub fn classify(rows: &[Vec<f64>], groups: &[usize], draws: usize, seed: u64) -> Option<Classified> {
    let count = groups.iter().max()? + 1;
    let least = (0..count).map(|group| groups.iter().filter(|g| **g == group).count()).min()?;
    if count < 2 || least < 3 || rows.len() != groups.len() {
        return None;
    }
    let taken_for = leave_each_out(rows, groups, count);
    let right = |taken: &[usize], groups: &[usize]| taken.iter().zip(groups).filter(|(a, b)| a == b).count();
    let hits = right(&taken_for, groups);
    let (mut rng, mut shuffled, mut as_good) = (Rng::with_seed(seed), groups.to_vec(), 0);
    for _ in 0..draws {
        rng.shuffle(&mut shuffled);
        as_good += usize::from(right(&leave_each_out(rows, &shuffled, count), &shuffled) >= hits);
    }
    let (k, n) = (hits as f64, rows.len() as f64);
    let bound = |a: f64, b: f64, share| Beta::new(a, b).map_or(f64::NAN, |beta| beta.inverse_cdf(share));
    let low = if hits == 0 { 0.0 } else { bound(k, n - k + 1.0, 0.025) };
    let high = if hits == rows.len() { 1.0 } else { bound(k + 1.0, n - k, 0.975) };
    let p = (1 + as_good) as f64 / (1 + draws) as f64;
    Some(Classified { taken_for, accuracy: k / n, low, high, p })
}

fn leave_each_out(rows: &[Vec<f64>], groups: &[usize], count: usize) -> Vec<usize> {
    (0..rows.len()).map(|out| nearest(rows, groups, count, out)).collect()
}

/// The group nearest to one row, by the others.
fn nearest(rows: &[Vec<f64>], groups: &[usize], count: usize, out: usize) -> usize {
    let mut distances = vec![0.0; count];
    for measure in 0..rows[out].len() {
        let others = || rows.iter().zip(groups).enumerate().filter(|(at, _)| *at != out);
        let (mut sums, mut sizes) = (vec![0.0; count], vec![0.0; count]);
        for (_, (row, group)) in others() {
            sums[*group] += row[measure];
            sizes[*group] += 1.0;
        }
        let means: Vec<f64> = sums.iter().zip(&sizes).map(|(sum, size)| sum / size).collect();
        let within: f64 = others().map(|(_, (row, group))| (row[measure] - means[*group]).powi(2)).sum();
        let variance = within / (rows.len() - 1 - count) as f64;
        if variance > 0.0 {
            let squares = means.iter().map(|mean| (rows[out][measure] - mean).powi(2) / variance);
            distances.iter_mut().zip(squares).for_each(|(distance, square)| *distance += square);
        }
    }
    (0..count).min_by(|a, b| distances[*a].total_cmp(&distances[*b])).unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn apart_groups_are_told_apart_and_equal_ones_are_not() {
        let mut rng = Rng::with_seed(3);
        let groups: Vec<usize> = (0..40).map(|n| n % 2).collect();
        let mut rows = |gap: f64| -> Vec<Vec<f64>> {
            groups.iter().map(|g| (0..3).map(|_| rng.f64() + gap * *g as f64).collect()).collect()
        };
        let (apart, equal) = (rows(2.0), rows(0.0));
        let found = classify(&apart, &groups, 99, 1).unwrap();
        assert!(found.accuracy == 1.0 && found.p == 0.01 && found.high == 1.0, "{found:?}");
        // Of 40 right ones the lower bound is 0.025^(1/40).
        assert!((found.low - 0.025_f64.powf(1.0 / 40.0)).abs() < 1e-6);
        let found = classify(&equal, &groups, 199, 1).unwrap();
        assert!(found.p > 0.05 && (0.2..0.8).contains(&found.accuracy), "{found:?}");
        assert_eq!(classify(&apart[..4], &groups[..4], 9, 1), None);
    }
}
