//! How far two pictures are apart.

use trepan_render::Image;

/// Mean structural similarity of the green channels over windows of 8x8 pixels (Wang et al. 2004).
pub fn similarity(a: &Image, b: &Image) -> f64 {
    let index = |x: u32, y: u32| {
        let mut sums = [0.0f64; 5];
        for n in 0..64 {
            let green = |image: &Image| f64::from(image.pixel(x + n % 8, y + n / 8)[1]);
            let (p, q) = (green(a), green(b));
            for (sum, value) in sums.iter_mut().zip([p, q, p * p, q * q, p * q]) {
                *sum += value / 64.0;
            }
        }
        let [ma, mb, aa, bb, ab] = sums;
        let (c1, c2) = (6.5025, 58.5225);
        (2.0 * ma * mb + c1) * (2.0 * (ab - ma * mb) + c2)
            / ((ma * ma + mb * mb + c1) * (aa - ma * ma + bb - mb * mb + c2))
    };
    let (columns, rows) = (a.width / 8, a.height / 8);
    let sum: f64 = (0..columns * rows).map(|n| index(8 * (n % columns), 8 * (n / columns))).sum();
    sum / f64::from(columns * rows)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_measures_of_pictures_are_zero_and_one_for_equal_ones_and_see_a_difference() {
        let of = |shift: u32| Image {
            width: 32,
            height: 16,
            rgba: (0..512u32)
                .flat_map(|n| [((n * 7 + shift) % 200) as u8, ((n * 13 + shift * 5) % 250) as u8, 9, 255])
                .collect(),
        };
        assert_eq!(of(0).error_percent(&of(0)), 0.0);
        assert!((similarity(&of(0), &of(0)) - 1.0).abs() < 1e-12);
        assert!(of(0).error_percent(&of(3)) > 1.0 && similarity(&of(0), &of(30)) < 0.9);
    }
}
