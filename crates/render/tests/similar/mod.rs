//! Similarity of two pictures.

use trepan_render::Image;

/// Structural similarity of two pictures' green channels over windows of 8x8 pixels (Wang et al.
/// 2004).
pub fn similarity(a: &Image, b: &Image) -> f64 {
    let windows = (0..a.height / 8).flat_map(|y| (0..a.width / 8).map(move |x| (8 * x, 8 * y)));
    let index = |(x, y): (u32, u32)| {
        let pixels = (0..64).map(|n| (x + n % 8, y + n / 8));
        let pairs: Vec<(f64, f64)> = pixels.map(|(x, y)| (a.pixel(x, y)[1].into(), b.pixel(x, y)[1].into())).collect();
        let mean = |f: &dyn Fn(&(f64, f64)) -> f64| pairs.iter().map(f).sum::<f64>() / 64.0;
        let (ma, mb) = (mean(&|p| p.0), mean(&|p| p.1));
        let (va, vb) = (mean(&|p| (p.0 - ma).powi(2)), mean(&|p| (p.1 - mb).powi(2)));
        let cov = mean(&|p| (p.0 - ma) * (p.1 - mb));
        let (c1, c2) = (6.5025, 58.5225);
        (2.0 * ma * mb + c1) * (2.0 * cov + c2) / ((ma * ma + mb * mb + c1) * (va + vb + c2))
    };
    let all: Vec<f64> = windows.map(index).collect();
    all.iter().sum::<f64>() / all.len() as f64
}
