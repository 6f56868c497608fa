//! Overlay over the scene: the force as an arrow, a teacher's tool, markers.
//!
//! # Theory
//! Each item is ray-cast in closed form (ball, cylinder or cone) in the pixel rectangle around its
//! box. Far items are drawn first and blended by alpha.
//!
//! # Practice
//! World mm. Parts behind bone, brain or tool are faint, so that an arrow in a hole stays visible.
//! Without items there is no pass.

use crate::tool::ToolShape;
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
    /// A tool, or an arrow from `tip` to `tail`: the radii of its stem and of its head.
    pub tool: ToolShape,
    /// Red, green, blue, alpha.
    pub colour: Vec4,
}

impl Item {
    fn arrow([from, to]: [Vec3; 2]) -> Self {
        let radius = (0.05 * from.distance(to)).clamp(0.15, 0.8);
        let (tip, tail) = (from.extend(radius), to.extend(2.5 * radius));
        let look = Vec4::new(-1.0, 0.0, tail.w, from.distance(to));
        Self { tool: ToolShape { tip, tail, across: Vec4::ZERO, look }, colour: FORCE }
    }

    /// Whether it is an arrow, not a tool.
    pub fn is_arrow(&self) -> bool {
        self.tool.look.x < 0.0
    }

    fn is_valid(&self) -> bool {
        let ToolShape { tip, tail, look, .. } = self.tool;
        tip.is_finite() && tail.is_finite() && look.w > 1e-3
    }
}

/// The shapes of an overlay, far ones first, and the number over the limit.
pub(crate) fn items(overlay: &Overlay, eye: Vec3) -> (Vec<Item>, u32) {
    let marker = |at: &Vec3| Item { tool: ToolShape::ball(*at, MARKER_MM), colour: MARKER };
    let ghost = overlay.ghost.map(|(tool, pose)| Item { tool: ToolShape::of(&tool, &pose, 0.0), colour: GHOST });
    let all = overlay.force.map(Item::arrow).into_iter().chain(ghost).chain(overlay.markers.iter().map(marker));
    let mut items: Vec<Item> = all.filter(Item::is_valid).take(MOST_ITEMS).collect();
    let distance = |item: &Item| (0.5 * (item.tool.tip + item.tool.tail)).truncate().distance(eye);
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
        assert_eq!(items.iter().map(|i| i.tool.tip.x).collect::<Vec<_>>(), [5.0, 1.0]);
        assert_eq!(left, 0);
        let many = vec![Vec3::Z; 300];
        assert_eq!(super::items(&Overlay { markers: &many, ..Overlay::default() }, Vec3::ZERO).1, 42);
    }
}
