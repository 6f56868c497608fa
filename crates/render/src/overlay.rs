//! Overlay over the scene: the force as an arrow, a teacher's tool, markers.
//!
//! # Theory
//! Each item is ray-cast in closed form (ball, cylinder or cone) in the pixel rectangle around its
//! box. Far items are drawn first and blended by alpha.
//!
//! # Practice
//! World mm. Parts behind bone, brain or tool are faint, so that an arrow in a hole stays visible.
//! Without items there is no pass.

use crate::tool::ends;
use glam::{Vec3, Vec4};
use trepan_geometry::{Pose, Tool};

/// The overlay of a frame.
#[derive(Clone, Copy, Debug, Default)]
pub struct Overlay<'a> {
    /// An arrow between two world points, mm.
    pub force: Option<[Vec3; 2]>,
    /// A display-only tool and its pose, such as a teacher's.
    pub ghost: Option<(Tool, Pose)>,
    /// World points marked by small balls, mm; 256 at most.
    pub markers: &'a [Vec3],
}

/// Most markers, arrows and ghosts in a picture.
pub(crate) const MOST_ITEMS: usize = 258;

/// Radius of a marker, mm.
const MARKER_MM: f32 = 1.0;

// Colours distinguishable by the colour-blind (Okabe and Ito 2008), with alpha.
const FORCE: Vec4 = Vec4::new(0.90, 0.60, 0.0, 1.0);
const GHOST: Vec4 = Vec4::new(0.10, 0.45, 0.80, 0.45);
const MARKER: Vec4 = Vec4::new(0.80, 0.20, 0.50, 1.0);

/// A shape of the overlay; layout of the shader's `Item`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub(crate) struct Item {
    /// A tool's ball or an arrow's start; w: its radius.
    pub tip: Vec4,
    /// The far end of a tool's shaft or an arrow's point; w: the radius of the shaft or of the
    /// arrow's head.
    pub tail: Vec4,
    /// Red, green, blue, alpha.
    pub colour: Vec4,
    /// x: 1 for an arrow, 0 for a tool.
    pub kind: Vec4,
}

impl Item {
    fn tool([tip, tail]: [Vec4; 2], colour: Vec4) -> Self {
        Self { tip, tail, colour, kind: Vec4::ZERO }
    }

    fn arrow([from, to]: [Vec3; 2]) -> Self {
        let radius = (0.05 * from.distance(to)).clamp(0.15, 0.8);
        Self { tip: from.extend(radius), tail: to.extend(2.5 * radius), colour: FORCE, kind: Vec4::X }
    }

    fn is_valid(&self) -> bool {
        self.tip.is_finite() && self.tail.is_finite() && (self.kind == Vec4::ZERO || self.length() > 1e-3)
    }

    fn length(&self) -> f32 {
        self.tip.truncate().distance(self.tail.truncate())
    }
}

/// The shapes of an overlay, far ones first, and the number over the limit.
pub(crate) fn items(overlay: &Overlay, eye: Vec3) -> (Vec<Item>, u32) {
    let marker = |at: &Vec3| Item::tool([at.extend(MARKER_MM); 2], MARKER);
    let ghost = overlay.ghost.map(|(tool, pose)| Item::tool(ends(&tool, &pose), GHOST));
    let all = overlay.force.map(Item::arrow).into_iter().chain(ghost).chain(overlay.markers.iter().map(marker));
    let mut items: Vec<Item> = all.filter(Item::is_valid).take(MOST_ITEMS).collect();
    let distance = |item: &Item| (0.5 * (item.tip + item.tail)).truncate().distance(eye);
    items.sort_by(|a, b| distance(b).total_cmp(&distance(a)));
    let wanted = overlay.markers.len() + usize::from(overlay.force.is_some()) + usize::from(overlay.ghost.is_some());
    (items, wanted.saturating_sub(MOST_ITEMS) as u32)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn items_come_far_ones_first_and_what_is_not_finite_or_has_no_length_is_left_out() {
        let markers = [Vec3::X, 5.0 * Vec3::X, Vec3::NAN];
        let overlay = Overlay { force: Some([Vec3::ONE; 2]), ghost: None, markers: &markers };
        let (items, left) = items(&overlay, Vec3::ZERO);
        assert_eq!(items.iter().map(|i| i.tip.x).collect::<Vec<_>>(), [5.0, 1.0]);
        assert_eq!(left, 0);
        let many = vec![Vec3::Z; 300];
        assert_eq!(super::items(&Overlay { markers: &many, ..Overlay::default() }, Vec3::ZERO).1, 42);
    }
}
