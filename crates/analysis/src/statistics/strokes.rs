//! Strokes of the tool, told from its motion.
//!
//! # Theory
//! A stroke begins where the smoothed speed of the tip rises over a threshold and ends where it
//! falls under half of it, so that noise at the threshold does not split it; short ones are no
//! strokes. The threshold is a share of the session's fast speed: slow hands make strokes too.
//!
//! # Sources
//! Hysteresis as in the segmentation of reaching movements: Hogan and Sternad 2009, J Mot Behav 41.

/// Mean over which the speed is smoothed, ms; numerical, as a hand moves below 10 Hz.
const SMOOTH_MS: f64 = 50.0;
/// Threshold over the 95th percentile of the speed; numerical.
const START_SHARE: f64 = 0.2;
/// Slowest threshold, mm/s; numerical, the tremor of a still hand is below.
const SLOWEST_MM_S: f64 = 2.0;
/// Shortest stroke, ms; numerical.
const SHORTEST_MS: f64 = 80.0;

/// One stroke.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Stroke {
    /// First and last time, ms.
    pub time_ms: [f64; 2],
    /// Length of the way, mm.
    pub path_mm: f64,
    /// Fastest smoothed speed, mm/s.
    pub peak_mm_s: f64,
}

/// Strokes of a tip: times in ms, rising, and positions in mm. Costs a few passes over them.
pub fn strokes(time_ms: &[f64], tip_mm: &[[f32; 3]]) -> Vec<Stroke> {
    let count = time_ms.len().min(tip_mm.len());
    if count < 3 {
        return Vec::new();
    }
    let span = (time_ms[count - 1] - time_ms[0]).max(1e-9);
    let half = ((0.5 * SMOOTH_MS * (count - 1) as f64 / span).round() as usize).max(1);
    let distance =
        |a: &[f32; 3], b: &[f32; 3]| a.iter().zip(b).map(|(a, b)| f64::from(a - b).powi(2)).sum::<f64>().sqrt();
    // The speed over a window around each tick: mean velocity, so that tremor cancels.
    let speed: Vec<f64> = (0..count)
        .map(|at| {
            let (from, to) = (at.saturating_sub(half), (at + half).min(count - 1));
            1e3 * distance(&tip_mm[from], &tip_mm[to]) / (time_ms[to] - time_ms[from]).max(1e-9)
        })
        .collect();
    let fast = super::quantile(&mut speed.clone(), 0.95);
    let start = (START_SHARE * fast).max(SLOWEST_MM_S);
    let (mut found, mut begun) = (Vec::new(), None);
    for at in 0..count {
        begun = match begun {
            None if speed[at] > start => Some(at),
            Some(from) if speed[at] < 0.5 * start || at + 1 == count => {
                if time_ms[at] - time_ms[from] >= SHORTEST_MS {
                    let path_mm = tip_mm[from..=at].windows(2).map(|pair| distance(&pair[0], &pair[1])).sum();
                    let peak_mm_s = speed[from..=at].iter().copied().fold(0.0, f64::max);
                    found.push(Stroke { time_ms: [time_ms[from], time_ms[at]], path_mm, peak_mm_s });
                }
                None
            }
            other => other,
        };
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn minimum_jerk_strokes_are_counted_and_measured_under_tremor() {
        // Seven strokes of 20 mm in 600 ms, with 400 ms between: their peak is 1.875 × 20/0.6 mm/s.
        let time_ms: Vec<f64> = (0..7000).map(f64::from).collect();
        let along = |t: f64| {
            let s = (t % 1000.0 / 600.0).min(1.0);
            let part = s.powi(3) * (10.0 - 15.0 * s + 6.0 * s * s);
            20.0 * if ((t / 1000.0) as u64).is_multiple_of(2) { part } else { 1.0 - part }
        };
        let tremor = |t: f64| 0.03 * (t * 1e-3 * 9.0 * std::f64::consts::TAU).sin();
        let tip: Vec<[f32; 3]> = time_ms.iter().map(|t| [along(*t) as f32, tremor(*t) as f32, 0.0]).collect();
        let found = strokes(&time_ms, &tip);
        assert_eq!(found.len(), 7, "{found:?}");
        for stroke in &found {
            assert!((stroke.peak_mm_s / 62.5 - 1.0).abs() < 0.03, "{stroke:?}");
            assert!((18.0..21.0).contains(&stroke.path_mm), "{stroke:?}");
        }
        assert!(strokes(&time_ms, &vec![[0.0; 3]; 7000]).is_empty());
    }
}
