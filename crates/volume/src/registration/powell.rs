//! Derivative-free maximisation: Powell's conjugate directions (1964) with parabolic line searches.

/// A pose: three translations, three rotations, all in mm.
pub(super) type Pose = [f64; 6];

/// Step size and stopping criteria.
#[derive(Clone, Copy)]
pub(super) struct Climb {
    /// First step along a direction, mm.
    pub step: f64,
    /// A sweep with less motion ends the search, mm.
    pub tolerance: f64,
    /// Largest number of sweeps over the directions.
    pub sweeps: usize,
}

/// Maximises `height` from `start`; returns the pose and its height.
pub(super) fn climb(height: &impl Fn(&Pose) -> f64, start: Pose, how: Climb) -> (Pose, f64) {
    let mut directions: [Pose; 6] = std::array::from_fn(|a| std::array::from_fn(|b| f64::from(u8::from(a == b))));
    let (mut pose, mut top) = (start, height(&start));
    let mut step = how.step;
    for _ in 0..how.sweeps {
        let (from, mut gains) = (pose, [0.0; 6]);
        for (direction, gain) in directions.iter().zip(&mut gains) {
            let before = top;
            (pose, top) = line(height, pose, top, direction, step);
            *gain = top - before;
        }
        let moved: Pose = std::array::from_fn(|a| pose[a] - from[a]);
        let length = moved.iter().map(|m| m * m).sum::<f64>().sqrt();
        if length < how.tolerance && step <= 2.0 * how.tolerance {
            break;
        }
        if length > 1e-9 {
            let along = moved.map(|m| m / length);
            (pose, top) = line(height, pose, top, &along, step.min(length));
            let most = (0..6).max_by(|&a, &b| gains[a].total_cmp(&gains[b])).unwrap_or(0);
            if along.iter().zip(directions[most]).all(|(a, d)| (a * d).abs() < 0.9) {
                directions[most] = along;
            }
        }
        step = (0.5 * step).max(how.tolerance);
    }
    (pose, top)
}

/// Maximises along a direction: brackets by doubled steps, then fits parabolas to three points.
fn line(height: &impl Fn(&Pose) -> f64, pose: Pose, top: f64, direction: &Pose, step: f64) -> (Pose, f64) {
    let place = |t: f64| -> Pose { std::array::from_fn(|a| pose[a] + t * direction[a]) };
    let at = |t: f64| (t, height(&place(t)));
    let (mut left, mut best, mut right) = (at(-step), (0.0, top), at(step));
    for _ in 0..4 {
        if left.1 > best.1 && left.1 >= right.1 {
            (right, best) = (best, left);
            left = at(best.0 - 2.0 * (right.0 - best.0));
        } else if right.1 > best.1 {
            (left, best) = (best, right);
            right = at(best.0 + 2.0 * (best.0 - left.0));
        }
    }
    for _ in 0..3 {
        let (a, b) = (best.0 - left.0, right.0 - best.0);
        let (up, down) = (a * (best.1 - right.1), b * (best.1 - left.1));
        let shift = 0.5 * (b * down - a * up) / (down + up);
        if !(shift.is_finite() && shift.abs() > 0.02 * step && shift > -a && shift < b) {
            break;
        }
        let next = at(best.0 + shift);
        match (next.1 > best.1, shift > 0.0) {
            (true, true) => (left, best) = (best, next),
            (true, false) => (right, best) = (best, next),
            (false, true) => right = next,
            (false, false) => left = next,
        }
    }
    (place(best.0), best.1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_top_of_a_skewed_hill_is_reached() {
        let peak: Pose = [3.0, -2.0, 1.0, 8.0, -5.0, 0.5];
        let hill = |p: &Pose| {
            let d: Pose = std::array::from_fn(|a| p[a] - peak[a]);
            -(0..6).map(|a| (d[a] + 0.6 * d[(a + 1) % 6]).powi(2)).sum::<f64>()
        };
        let (pose, top) = climb(&hill, [0.0; 6], Climb { step: 4.0, tolerance: 0.01, sweeps: 40 });
        let away = pose.iter().zip(peak).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(away < 0.05 && top > -1e-2, "{away} {top}");
    }
}
