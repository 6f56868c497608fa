//! CPU version of `section.wgsl`: rest positions of the brain at the pixels of a slice.

use crate::border::Border;
use crate::section::triangles;
use crate::slice::Plane;
use glam::{Vec2, Vec3};

/// Rest position at every pixel of a slice, row by row; `None` outside the brain.
pub(crate) fn places([width, height]: [usize; 2], plane: &Plane, brain: &Border) -> Vec<Option<Vec3>> {
    let mut places = vec![None; width * height];
    let size = Vec2::new(width as f32, height as f32);
    for triangle in triangles(plane.level(), brain) {
        let [a, b, c] = triangle.map(|corner| (plane.at(corner.place) * Vec2::new(0.5, -0.5) + 0.5) * size);
        let double_area = (b - a).perp_dot(c - a);
        let low = a.min(b).min(c).floor().clamp(Vec2::ZERO, size).as_uvec2();
        let high = a.max(b).max(c).ceil().clamp(Vec2::ZERO, size).as_uvec2();
        if double_area == 0.0 || !double_area.is_finite() {
            continue;
        }
        for (y, x) in (low.y..high.y).flat_map(|y| (low.x..high.x).map(move |x| (y, x))) {
            let p = Vec2::new(x as f32 + 0.5, y as f32 + 0.5);
            let share =
                [(c - b).perp_dot(p - b), (a - c).perp_dot(p - c), (b - a).perp_dot(p - a)].map(|w| w / double_area);
            if share.iter().all(|&w| w >= 0.0) {
                let rest = (0..3).map(|n| share[n] * triangle[n].rest).sum();
                places[x as usize + width * y as usize] = Some(rest);
            }
        }
    }
    places
}
