//! The three orthogonal slices through the tool's tip.
//!
//! # Practice
//! Radiological convention: the patient is seen from the feet (axial) and from the front (coronal),
//! so that the patient's right, R, is on the left of the picture. The sagittal slice looks from the
//! patient's left: the face, A, is on the left.
//!
//! ```text
//!  axial      coronal    sagittal
//!    A           S          S
//!  R   L       R   L      A   P
//!    P           I          I
//! ```

use glam::{Vec2, Vec3, Vec4};
use trepan_geometry::Aabb;

/// Indices of the letters R L A P S I in the shader's font.
pub(crate) const LETTERS: [[f32; 4]; 3] = [[0.0, 1.0, 2.0, 3.0], [0.0, 1.0, 4.0, 5.0], [2.0, 3.0, 4.0, 5.0]];

/// Picture axes (right, up) of axial, coronal and sagittal; +x is the patient's right, +y the
/// front, +z the head.
const AXES: [[Vec3; 2]; 3] = [[Vec3::NEG_X, Vec3::Y], [Vec3::NEG_X, Vec3::Z], [Vec3::NEG_Y, Vec3::Z]];

/// A slice plane and its visible area.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plane {
    /// Middle of the visible area, mm.
    pub centre: Vec3,
    /// The point common to all three planes.
    pub through: Vec3,
    /// Unit vector to the right in the picture.
    pub right: Vec3,
    /// Unit vector up in the picture.
    pub up: Vec3,
    /// Half width and half height of the visible area, mm.
    pub half: Vec2,
}

impl Plane {
    /// The three slices through a point, showing the whole box, centred, or the surroundings of the
    /// point.
    pub fn three(through: Vec3, bounds: Aabb, half_height_mm: Option<f32>, rectangles: &[[u32; 4]; 3]) -> [Self; 3] {
        [0, 1, 2].map(|n| {
            let [right, up] = AXES[n];
            let aspect = rectangles[n][2] as f32 / rectangles[n][3].max(1) as f32;
            let size = 0.5 * bounds.size();
            let whole = size.dot(up.abs()).max(size.dot(right.abs()) / aspect) * 1.04;
            let normal = right.cross(up);
            let around = if half_height_mm.is_some() { through } else { bounds.centre() };
            let centre = around + normal * normal.dot(through - around);
            let height = half_height_mm.unwrap_or(whole).max(1.0);
            Self { centre, through, right, up, half: Vec2::new(height * aspect, height) }
        })
    }

    /// Unit normal and offset of the plane.
    pub fn level(&self) -> Vec4 {
        let normal = self.right.cross(self.up);
        normal.extend(normal.dot(self.centre))
    }

    /// Picture coordinates of a point of the plane, from -1 to 1.
    pub fn at(&self, point: Vec3) -> Vec2 {
        let from = point - self.centre;
        Vec2::new(from.dot(self.right), from.dot(self.up)) / self.half
    }

    /// World point at picture coordinates from -1 to 1.
    pub fn point(&self, at: Vec2) -> Vec3 {
        let along = at * self.half;
        self.centre + along.x * self.right + along.y * self.up
    }

    /// Intersection of the plane with a triangle, in picture coordinates from -1 to 1.
    pub fn cut(&self, triangle: [Vec3; 3]) -> Option<[Vec2; 2]> {
        let normal = self.right.cross(self.up);
        let height = triangle.map(|p| (p - self.centre).dot(normal));
        let over = height.map(|h| h >= 0.0);
        if over == [over[0]; 3] {
            return None;
        }
        // The single corner on one side.
        let alone = (0..3).find(|&n| over[n] != over[(n + 1) % 3] && over[n] != over[(n + 2) % 3])?;
        let end = |other: usize| {
            let share = height[alone] / (height[alone] - height[other]);
            self.at(triangle[alone].lerp(triangle[other], share))
        };
        Some([end((alone + 1) % 3), end((alone + 2) % 3)])
    }
}
