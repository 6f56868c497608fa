//! Smooth random vector field of uniform cubic B-splines.

use glam::DVec3;

/// Cubic B-spline on a grid of control points, extended by its border values.
///
/// The basis is a partition of unity with positive weights, so no value leaves the range of the
/// coefficients.
pub struct Spline {
    low: DVec3,
    spacing_mm: f64,
    dims: [usize; 3],
    coefficients: Vec<DVec3>,
}

impl Spline {
    /// Creates a field over a box with components drawn from -amplitude to amplitude.
    pub fn random((low, high): (DVec3, DVec3), spacing_mm: f64, amplitude: f64, random: &mut fastrand::Rng) -> Self {
        let cells = ((high - low) / spacing_mm).ceil().max(DVec3::ONE).as_uvec3();
        let dims = [cells.x, cells.y, cells.z].map(|n| n as usize + 3);
        let mut draw = || amplitude * (2.0 * random.f64() - 1.0);
        let coefficients = (0..dims.iter().product()).map(|_| DVec3::new(draw(), draw(), draw())).collect();
        Self { low, spacing_mm, dims, coefficients }
    }

    /// Field value at a point.
    pub fn at(&self, point: DVec3) -> DVec3 {
        let place = ((point - self.low) / self.spacing_mm).to_array();
        let [x, y, z]: [(usize, [f64; 4]); 3] = std::array::from_fn(|axis| {
            let cells = (self.dims[axis] - 3) as f64;
            let place = place[axis].clamp(0.0, cells);
            let cell = place.min(cells - 1.0).floor();
            (cell as usize, basis(place - cell))
        });
        let mut sum = DVec3::ZERO;
        for (c, wz) in z.1.into_iter().enumerate() {
            for (b, wy) in y.1.into_iter().enumerate() {
                let row = x.0 + self.dims[0] * (y.0 + b + self.dims[1] * (z.0 + c));
                for (a, wx) in x.1.into_iter().enumerate() {
                    sum += wx * wy * wz * self.coefficients[row + a];
                }
            }
        }
        sum
    }
}

/// Weights of the four control points around a position between the middle two.
fn basis(t: f64) -> [f64; 4] {
    let s = 1.0 - t;
    [
        s * s * s / 6.0,
        (3.0 * t * t * t - 6.0 * t * t + 4.0) / 6.0,
        (3.0 * s * s * s - 6.0 * s * s + 4.0) / 6.0,
        t * t * t / 6.0,
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_field_is_smooth_and_keeps_its_range() {
        let span = (DVec3::ZERO, DVec3::new(100.0, 90.0, 80.0));
        let spline = Spline::random(span, 30.0, 6.0, &mut fastrand::Rng::with_seed(3));
        let mut greatest = 0.0f64;
        for n in 0..4000 {
            let p = DVec3::new(0.025 * f64::from(n), 0.02 * f64::from(n), 0.021 * f64::from(n));
            let (here, next) = (spline.at(p), spline.at(p + DVec3::splat(1e-3)));
            assert!(here.abs().max_element() <= 6.0);
            // No component's slope along an axis exceeds 2 amplitudes per spacing.
            assert!((next - here).abs().max_element() <= 3.0 * 12.0 / 30.0 * 1e-3 + 1e-12, "a step at {p}");
            greatest = greatest.max(here.length());
        }
        assert!(greatest > 1.0);
    }
}
