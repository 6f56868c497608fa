//! How far two pictures are apart.

use glam::{Vec2, Vec3};
use trepan_render::Image;

/// A smaller picture at another size, linearly.
pub fn enlarged(image: &Image, [width, height]: [u32; 2]) -> Image {
    if [image.width, image.height] == [width, height] {
        return image.clone();
    }
    let mut rgba = Vec::with_capacity(4 * (width * height) as usize);
    let scale = Vec2::new(image.width as f32 / width as f32, image.height as f32 / height as f32);
    let last = Vec2::new(image.width as f32, image.height as f32) - 1.0;
    for n in 0..width * height {
        let at = ((Vec2::new((n % width) as f32, (n / width) as f32) + 0.5) * scale - 0.5).clamp(Vec2::ZERO, last);
        let (low, share) = (at.floor(), at.fract());
        let pixel = |x: f32, y: f32| {
            let [r, g, b, _] = image.pixel((low.x + x).min(last.x) as u32, (low.y + y).min(last.y) as u32);
            Vec3::new(r.into(), g.into(), b.into())
        };
        let row = |y: f32| pixel(0.0, y).lerp(pixel(1.0, y), share.x);
        let [r, g, b] = row(0.0).lerp(row(1.0), share.y).round().to_array();
        rgba.extend([r as u8, g as u8, b as u8, 255]);
    }
    Image { width, height, rgba }
}

/// Root mean square difference of all colours, percent of white.
pub fn error_percent(a: &Image, b: &Image) -> f64 {
    let squares = a.rgba.iter().zip(&b.rgba).map(|(&a, &b)| (f64::from(a) - f64::from(b)).powi(2));
    // The fourth byte never differs.
    (squares.sum::<f64>() / (0.75 * a.rgba.len() as f64)).sqrt() / 2.55
}

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
        assert_eq!(error_percent(&of(0), &of(0)), 0.0);
        assert!((similarity(&of(0), &of(0)) - 1.0).abs() < 1e-12);
        assert!(error_percent(&of(0), &of(3)) > 1.0 && similarity(&of(0), &of(30)) < 0.9);
        assert_eq!(enlarged(&of(0), [32, 16]), of(0));
        assert_eq!(enlarged(&enlarged(&of(0), [64, 32]), [32, 16]).width, 32);
    }
}
