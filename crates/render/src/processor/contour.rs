//! CPU version of `contour.wgsl`: the outline of the deformed brain on a slice.

use crate::report::OUTLINE;
use glam::{Vec2, Vec3};

/// Opacity of the line.
const ALPHA: f32 = 0.9;

/// Draws lines, given from -1 to 1, into a rectangle of the picture.
pub(crate) fn draw(pixels: &mut [[u8; 4]], width: usize, rectangle: [u32; 4], lines: impl Iterator<Item = [Vec2; 2]>) {
    let [x, y, w, h] = rectangle.map(|n| n as f32);
    let place = |p: Vec2| Vec2::new(x + (0.5 + 0.5 * p.x) * w, y + (0.5 - 0.5 * p.y) * h);
    for [a, b] in lines {
        let (a, b) = (place(a), place(b));
        let steps = (b - a).abs().max_element().ceil().clamp(1.0, 4.0 * (w + h)) as usize;
        for n in 0..steps {
            let p = a.lerp(b, (n as f32 + 0.5) / steps as f32).floor();
            if p.x >= x && p.x < x + w && p.y >= y && p.y < y + h {
                let pixel = &mut pixels[p.x as usize + width * p.y as usize];
                let below = Vec3::new(pixel[0].into(), pixel[1].into(), pixel[2].into()) / 255.0;
                *pixel = super::bytes(below.lerp(OUTLINE, ALPHA));
            }
        }
    }
}
