//! A plane that cuts the brain and shows the deformed MRI on the cut.
//!
//! # Theory
//! The plane cuts the deformed tetrahedra in triangles and quadrilaterals with known rest
//! positions, and so MRI values. Within a tetrahedron the deformation is linear, so that
//! interpolation between the corners is exact (Tejada and Ertl 2005 do the same along rays).
//!
//! # Practice
//! World mm. All tetrahedra are tested once per picture; triangles over the limit are counted in
//! the picture's report.

use glam::{Vec3, Vec4};

/// A cutting plane; the side that its normal points to is removed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cut {
    /// A point of the plane, world mm.
    pub point: Vec3,
    /// Direction of the removed side, of any length; zero cuts nothing.
    pub normal: Vec3,
    /// Whether bone is cut too; tools and overlay never are.
    pub bone: bool,
}

impl Cut {
    /// Unit normal n and offset w of the plane n·x = w, as the shaders read it; zeroes cut nothing.
    pub(crate) fn plane(cut: Option<&Self>) -> Vec4 {
        let sound = cut.filter(|c| c.point.is_finite()).and_then(|c| Some((c.point, c.normal.try_normalize()?)));
        sound.map_or(Vec4::ZERO, |(point, normal)| normal.extend(normal.dot(point)))
    }
}

/// Signed height of a point over a plane, mm; 0 without a plane.
pub(crate) fn height(plane: Vec4, point: Vec3) -> f32 {
    plane.truncate().dot(point) - plane.w
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_plane_without_a_normal_or_a_place_cuts_nothing() {
        let cut = Cut { point: Vec3::new(0.0, 0.0, 5.0), normal: 3.0 * Vec3::Z, bone: false };
        let plane = Cut::plane(Some(&cut));
        assert_eq!([Vec3::ZERO, Vec3::new(9.0, -4.0, 7.0)].map(|p| height(plane, p)), [-5.0, 2.0]);
        for none in [Cut { normal: Vec3::ZERO, ..cut }, Cut { point: Vec3::NAN, ..cut }] {
            assert_eq!(height(Cut::plane(Some(&none)), Vec3::splat(1e9)), 0.0);
        }
    }
}
