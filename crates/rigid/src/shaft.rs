//! The bone voxels around a tool's shaft.
//!
//! # Theory
//! The shaft is long and thin and mostly in the air. It is cut into slices; a slice is looked into
//! only where a brick that it meets has ever held bone, and there row by row: along x the distance
//! from the axis is the root of a quadratic, so a row's ends are solved for.
//!
//! ```text
//!   ║  ║
//!  ┌╨──╨┐ slice: p + s a, s₀ ≤ s < s₁
//!  └╥──╥┘
//!   ║  ║
//! ```
//!
//! # Practice
//! Grid coordinates. About a microsecond for a shaft in the air, one load per voxel near bone.

use glam::IVec3;
use trepan_bone::BoneVolume;
use trepan_geometry::{Tool, Vec3};

/// Length of a slice, voxels.
const SLICE: f32 = 8.0;

/// A straight shaft in grid coordinates.
#[derive(Clone, Copy, Debug, Default)]
pub struct Shaft {
    /// A point of the axis.
    pub start: Vec3,
    /// Unit vector along the axis.
    pub axis: Vec3,
    /// Where along the axis the shaft begins and ends.
    pub span: (f32, f32),
    /// Radius.
    pub radius: f32,
}

impl Shaft {
    /// The shaft of a tool with its tip at `start` and its unit `axis`, on a grid of this spacing.
    #[inline]
    pub fn of(tool: &Tool, spacing: f32, start: Vec3, axis: Vec3) -> Self {
        let &Tool { tip_radius_mm, shaft_radius_mm, shaft_length_mm, .. } = tool;
        let span = (tip_radius_mm / spacing, shaft_length_mm.max(tip_radius_mm) / spacing);
        Self { start, axis, span, radius: shaft_radius_mm / spacing }
    }

    /// The shaft in another unit of length, of which there are `factor` in one of this.
    #[inline]
    pub fn scaled(&self, factor: f32) -> Self {
        let (from, to) = self.span;
        let span = (factor * from, factor * to);
        Self { start: factor * self.start, span, radius: factor * self.radius, ..*self }
    }

    /// Place along the shaft of what is nearest to `point`.
    #[inline]
    pub fn along(&self, point: Vec3) -> f32 {
        (point - self.start).dot(self.axis).clamp(self.span.0, self.span.1)
    }

    /// The point of the axis at `s`.
    #[inline]
    pub fn at(&self, s: f32) -> Vec3 {
        self.start + s * self.axis
    }

    /// Calls `visit` once with each bone voxel whose centre is within `reach` of the axis between
    /// the ends. Returns the voxels looked at.
    pub fn around(&self, bone: &BoneVolume, reach: f32, mut visit: impl FnMut(IVec3)) -> u32 {
        let [nx, ny, nz] = bone.dims().map(|n| n as i32);
        let last = IVec3::new(nx, ny, nz) - 1;
        let slices = ((self.span.1 - self.span.0) / SLICE).ceil().clamp(0.0, 1024.0) as u32;
        let mut visited = 0;
        for slice in 0..slices {
            let from = self.span.0 + SLICE * slice as f32;
            let to = (from + SLICE).min(self.span.1);
            let (p, q) = (self.at(from), self.at(to));
            let low = (p.min(q) - reach).ceil().as_ivec3().max(IVec3::ZERO);
            let high = (p.max(q) + reach).floor().as_ivec3().min(last);
            if bone.may_hold_bone(low, high) {
                visited += self.slice(bone, reach, (from, to), (low, high), &mut visit);
            }
        }
        visited
    }

    fn slice(
        &self,
        bone: &BoneVolume,
        reach: f32,
        span: (f32, f32),
        (low, high): (IVec3, IVec3),
        visit: &mut impl FnMut(IVec3),
    ) -> u32 {
        let (across, mut visited) = (Vec3::X.reject_from_normalized(self.axis), 0);
        let a = across.length_squared();
        for (j, k) in (low.z..=high.z).flat_map(|k| (low.y..=high.y).map(move |j| (j, k))) {
            let row = Vec3::new(0.0, j as f32, k as f32) - self.start;
            let along = row.dot(self.axis);
            let off = row - along * self.axis;
            let (b, c) = (off.dot(across), off.length_squared() - reach * reach);
            let (from, to) = if a > 1e-6 {
                let rest = b * b - a * c;
                if rest < 0.0 {
                    continue;
                }
                (((-b - rest.sqrt()) / a).ceil() as i32, ((-b + rest.sqrt()) / a).floor() as i32)
            } else if c <= 0.0 {
                (low.x, high.x)
            } else {
                continue;
            };
            for x in from.max(low.x)..=to.min(high.x) {
                let s = along + x as f32 * self.axis.x;
                visited += 1;
                if s >= span.0 && s < span.1 && bone.is_bone(IVec3::new(x, j, k)) {
                    visit(IVec3::new(x, j, k));
                }
            }
        }
        visited
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::collections::BTreeSet;
    use trepan_volume::VoxelVolume;

    proptest! {
        #[test]
        fn every_bone_voxel_around_the_shaft_comes_once(start in prop::array::uniform3(-4.0f32..24.0), axis in prop::array::uniform3(-1.0f32..1.0),
                                                        from in 0.0f32..9.0, length in 0.0f32..40.0, reach in 0.0f32..5.0) {
            let mut ct = VoxelVolume::isotropic([20, 19, 18], Vec3::ZERO, 1.0, -1000i16);
            ct.data.iter_mut().enumerate().filter(|(at, _)| at * 7 % 3 == 0 && at / 360 > 7).for_each(|(_, v)| *v = 900);
            let bone = BoneVolume::new(&ct, 400).unwrap();
            let shaft = Shaft { start: start.into(), axis: Vec3::from(axis).normalize_or(Vec3::X), span: (from, from + length), radius: 1.0 };
            let mut seen = BTreeSet::new();
            shaft.around(&bone, reach, |voxel| assert!(seen.insert(voxel.to_array())));
            for at in 0..20 * 19 * 18 {
                let voxel = IVec3::new(at % 20, at / 20 % 19, at / 380);
                let p = voxel.as_vec3() - shaft.start;
                let s = p.dot(shaft.axis);
                let out = (p - s * shaft.axis).length() - reach;
                if out.abs() > 1e-3 && (s - from).abs() > 1e-3 && (s - from - length).abs() > 1e-3 {
                    let near = out < 0.0 && s > from && s < from + length;
                    prop_assert_eq!(seen.contains(&voxel.to_array()), near && bone.is_bone(voxel), "{:?}", voxel);
                }
            }
        }
    }
}
