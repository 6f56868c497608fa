//! Selects the rays to cast again: all after a camera move, otherwise only those that may see a
//! change.

use crate::camera::View;
use glam::{Vec2, Vec3, Vec4};
use trepan_geometry::Aabb;

/// Margin around changed bone that is cast again at once, mm.
const MARGIN_MM: f32 = 4.0;

/// Tracks which stored hits are still valid.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Recast {
    cast_for: Option<(View, Vec4)>,
    changed: Aabb,
    unsettled: bool,
}

impl Default for Recast {
    fn default() -> Self {
        Self { cast_for: None, changed: Aabb::EMPTY, unsettled: false }
    }
}

impl Recast {
    /// Invalidates the hits, so that the next picture casts all rays.
    pub fn forget(&mut self) {
        self.cast_for = None;
    }

    /// Adds a box in which bone changed, world mm.
    pub fn note(&mut self, changed: Aabb) {
        self.changed = Aabb { min: self.changed.min.min(changed.min), max: self.changed.max.max(changed.max) };
    }

    /// The pixel rectangle `[x, y, width, height]` to cast for this view and bone cut, if any. Once
    /// drilling stops everything is cast once more, since shadows and ambient light reach farther
    /// than the changed bricks.
    pub fn part(&mut self, view: &View, bone_cut: Vec4, [width, height]: [u32; 2]) -> Option<[u32; 4]> {
        let whole = [0, 0, width, height];
        let resting = self.cast_for == Some((*view, bone_cut));
        let (part, settled) = match (resting, self.changed.is_empty()) {
            (false, _) => (Some(whole), true),
            (true, true) => (self.unsettled.then_some(whole), true),
            (true, false) => (rectangle(view, self.changed.inflated(MARGIN_MM), [width, height]), false),
        };
        *self = Self { cast_for: Some((*view, bone_cut)), changed: Aabb::EMPTY, unsettled: !settled };
        part
    }
}

/// The smallest pixel rectangle that shows a box; `None` if it is out of sight.
fn rectangle(view: &View, of: Aabb, [width, height]: [u32; 2]) -> Option<[u32; 4]> {
    let mut low = Vec2::INFINITY;
    let mut high = Vec2::NEG_INFINITY;
    for n in 0..8 {
        let pick = |axis: usize| if n >> axis & 1 == 0 { of.min[axis] } else { of.max[axis] };
        let (at, depth) = view.project(Vec3::new(pick(0), pick(1), pick(2)));
        if depth < View::NEAR_MM {
            return Some([0, 0, width, height]);
        }
        (low, high) = (low.min(at), high.max(at));
    }
    let size = Vec2::new(width as f32, height as f32);
    let left_top = (Vec2::new(low.x, -high.y) * 0.5 + 0.5) * size;
    let right_bottom = (Vec2::new(high.x, -low.y) * 0.5 + 0.5) * size;
    let from = left_top.floor().max(Vec2::ZERO).as_uvec2();
    let to = right_bottom.ceil().clamp(Vec2::ZERO, size).as_uvec2();
    (to.x > from.x && to.y > from.y).then(|| [from.x, from.y, to.x - from.x, to.y - from.y])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Camera;

    #[test]
    fn the_rectangle_holds_the_box_and_nothing_out_of_sight() {
        let view = Camera::viewed_from(Vec3::ZERO, Vec3::Y, 100.0).view(2.0);
        let small = Aabb::of_sphere(Vec3::new(10.0, 0.0, 3.0), 2.0);
        let [x, y, w, h] = rectangle(&view, small, [200, 100]).unwrap();
        for n in 0..8 {
            let corner = Vec3::new(
                if n & 1 == 0 { 8.0 } else { 12.0 },
                if n & 2 == 0 { -2.0 } else { 2.0 },
                if n & 4 == 0 { 1.0 } else { 5.0 },
            );
            let (at, _) = view.project(corner);
            let pixel = Vec2::new((at.x * 0.5 + 0.5) * 200.0, (0.5 - at.y * 0.5) * 100.0);
            assert!(
                pixel.x >= x as f32 && pixel.x <= (x + w) as f32 && pixel.y >= y as f32 && pixel.y <= (y + h) as f32
            );
        }
        assert!(w < 40 && h < 20);
        assert_eq!(rectangle(&view, Aabb::of_sphere(Vec3::new(900.0, 0.0, 0.0), 1.0), [200, 100]), None);
        assert_eq!(
            rectangle(&view, Aabb::of_sphere(Vec3::new(0.0, 100.0, 0.0), 1.0), [200, 100]),
            Some([0, 0, 200, 100])
        );
    }
}
