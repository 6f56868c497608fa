//! Stereo: layout of two eyes' views in the picture.
//!
//! # Theory
//! Off-axis frusta: both eyes look in parallel, and their pictures are shifted so that the camera's
//! target has no parallax (Bourke 1999). Converging eyes would cause vertical parallax in the
//! corners.
//!
//! # When not to use it
//! When frame rate or colour matters: it halves the frame rate, and anaglyphs lose the red of the
//! tissue.

use crate::camera::View;

/// Both eyes' views in one picture; slices have no depth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stereo {
    /// Layout of the views.
    pub look: StereoLook,
    /// Distance between the eyes, mm, at the scale of the scene: 1/30 of the distance to the target
    /// is comfortable. Negative swaps the eyes.
    pub eye_distance_mm: f32,
}

/// Layout of two views in a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StereoLook {
    /// The left half for the left eye: screens and glasses that split the picture.
    SideBySide,
    /// The left eye's brightness in red, the right eye's green and blue: red-cyan glasses.
    Anaglyph,
}

impl Stereo {
    /// The left and the right eye's views of a camera; the same view twice without stereo.
    pub(crate) fn views(stereo: Option<&Self>, view: View, target_mm: f32) -> [View; 2] {
        let aside = stereo.map(|s| 0.5 * s.eye_distance_mm).filter(|d| d.is_finite()).unwrap_or(0.0);
        [-aside, aside].map(|offset| view.from_aside(offset, target_mm))
    }
}

impl StereoLook {
    /// Rectangles of the left and the right eye's views in the picture's area; one if there is no
    /// room for two.
    pub(crate) fn areas(look: Option<Self>, [x, y, width, height]: [u32; 4]) -> Vec<[u32; 4]> {
        let half = width / 2;
        match look {
            Some(Self::SideBySide) if half > 0 => vec![[x, y, half, height], [x + half, y, width - half, height]],
            Some(Self::Anaglyph) => vec![[x, y, width, height]; 2],
            _ => vec![[x, y, width, height]],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn halves_tile_the_view() {
        let areas = StereoLook::areas(Some(StereoLook::SideBySide), [3, 4, 101, 50]);
        assert_eq!(areas, [[3, 4, 50, 50], [53, 4, 51, 50]]);
        assert_eq!(StereoLook::areas(Some(StereoLook::SideBySide), [0, 0, 1, 9]), [[0, 0, 1, 9]]);
    }
}
