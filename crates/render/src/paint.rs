//! Colours on bone or brain: a plan, distances to the dura, a force map, forbidden structures.
//!
//! # Theory
//! A coarse grid of colours, sampled trilinearly with premultiplied alpha, so that transparent
//! texels do not affect their neighbours. Alpha blends over the surface's colour before lighting.
//!
//! # Practice
//! World mm. The grid reaches half a spacing beyond the outer texels and is transparent outside. 4
//! bytes of device memory a texel; uploaded when the version or the dimensions change.
//!
//! # When not to use it
//! For data that changes at every voxel in every picture: that is the bone itself, which is updated
//! brick by brick.

use crate::RenderError;
use crate::mix::trilinear;
use glam::{Vec3, Vec4};

/// A grid of colours in world space.
#[derive(Clone, Debug, PartialEq)]
pub struct Paint {
    /// World centre of the texel (0, 0, 0), mm.
    pub origin: Vec3,
    /// Texel spacing along x, y, z, mm.
    pub spacing_mm: Vec3,
    /// Texels along x, y, z.
    pub dims: [u32; 3],
    /// Red, green, blue (linear light) and alpha of the texels, x fastest.
    pub rgba: Vec<[u8; 4]>,
    /// Changes whenever the colours change.
    pub version: u64,
}

impl Paint {
    /// Rejects an invalid grid.
    pub(crate) fn check(&self) -> Result<(), RenderError> {
        let wanted = self.dims.map(|n| n as usize).iter().product::<usize>();
        let sound = self.origin.is_finite() && self.spacing_mm.is_finite() && self.spacing_mm.min_element() > 0.0;
        if sound && wanted > 0 && wanted == self.rgba.len() {
            return Ok(());
        }
        Err(RenderError::Paint { dims: self.dims, spacing_mm: self.spacing_mm, given: self.rgba.len() })
    }

    /// Lower corner of the grid (w: 1) and the inverse of its size, as shaders read it; zeroes for
    /// none.
    pub(crate) fn placed(paint: Option<&Self>) -> [Vec4; 2] {
        paint.map_or([Vec4::ZERO; 2], |p| {
            let size = p.spacing_mm * Vec3::from(p.dims.map(|n| n as f32));
            [(p.origin - 0.5 * p.spacing_mm).extend(1.0), size.recip().extend(0.0)]
        })
    }

    /// Blends the paint over a colour at a world point.
    pub(crate) fn over(&self, colour: Vec3, point: Vec3) -> Vec3 {
        let texel = (point - self.origin) / self.spacing_mm;
        let dims = Vec3::from(self.dims.map(|n| n as f32));
        if texel.cmplt(Vec3::splat(-0.5)).any() || texel.cmpgt(dims - 0.5).any() {
            return colour;
        }
        let paint = trilinear(self.dims.map(|n| n as usize), texel, |at| premultiplied(self.rgba[at])) / 255.0;
        colour * (1.0 - paint.w) + paint.truncate()
    }
}

/// A colour with premultiplied alpha, 0 to 255.
pub(crate) fn premultiplied([r, g, b, a]: [u8; 4]) -> Vec4 {
    (Vec3::new(r.into(), g.into(), b.into()) * (f32::from(a) / 255.0)).extend(a.into())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn paint() -> Paint {
        let rgba = vec![[200, 100, 0, 255], [0, 0, 0, 0]];
        Paint { origin: Vec3::ONE, spacing_mm: Vec3::splat(2.0), dims: [2, 1, 1], rgba, version: 0 }
    }

    #[test]
    fn alpha_mixes_between_texels_and_nothing_is_painted_outside() {
        let (paint, white) = (paint(), Vec3::ONE);
        let solid = Vec3::new(200.0, 100.0, 0.0) / 255.0;
        for (x, share) in [(0.5, 1.0), (1.0, 1.0), (2.0, 0.5), (2.5, 0.25), (3.0, 0.0), (3.9, 0.0)] {
            let painted = paint.over(white, Vec3::new(x, 1.5, 0.5));
            assert!(painted.distance(white.lerp(solid, share)) < 1e-6, "{painted} at {x}");
        }
        for out in [Vec3::new(-0.1, 1.0, 1.0), Vec3::new(1.0, 2.1, 1.0), Vec3::new(1.0, 1.0, -0.1)] {
            assert_eq!(paint.over(white, out), white);
        }
    }

    #[test]
    fn invalid_paint_is_rejected() {
        assert!(paint().check().is_ok());
        let bad = [
            Paint { dims: [1; 3], ..paint() },
            Paint { dims: [0, 1, 1], rgba: Vec::new(), ..paint() },
            Paint { spacing_mm: Vec3::new(1.0, 0.0, 1.0), ..paint() },
            Paint { origin: Vec3::NAN, ..paint() },
        ];
        assert!(bad.iter().all(|p| matches!(p.check(), Err(RenderError::Paint { .. }))));
    }
}
