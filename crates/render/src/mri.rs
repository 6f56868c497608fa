//! The MRI as a texture of grey values, with its marks.

use crate::RenderError;
use glam::{DAffine3, DMat4, DVec3, Mat4};
use trepan_gpu::{Format, Gpu, Texture, TextureSpec};
use trepan_volume::VoxelVolume;

/// The MRI on the device; one dark texel if there is none.
#[derive(Debug)]
pub(crate) struct Mri {
    pub texture: Texture,
    /// Texture coordinates of a world point.
    pub texture_from_world: Option<Mat4>,
}

/// The MRI as texels: a mark colour, black for none, and the grey value.
#[derive(Clone, Debug)]
pub(crate) struct Signals {
    pub dims: [usize; 3],
    pub texels: Vec<[u8; 4]>,
    /// Whether any texel has a mark.
    pub is_marked: bool,
    /// Texture coordinates, 0 to 1, of a world point.
    pub texture_from_world: Mat4,
}

impl Mri {
    pub fn new(gpu: &Gpu, volume: Option<&VoxelVolume<f32>>, tint: Option<&[[u8; 3]]>) -> Result<Self, RenderError> {
        let signals = volume.map(|volume| Signals::of(volume, tint)).transpose()?;
        let size = signals.as_ref().map_or([1; 3], |g| g.dims.map(|n| n as u32));
        let format = Format::Rgba8Unorm;
        let spec = TextureSpec { label: "mri", size, volume: true, format, drawn_to: false, stored_to: false };
        let texture = Texture::new(gpu, &spec)?;
        if let Some(signals) = &signals {
            texture.write(gpu, [0; 3], size, &signals.texels);
        }
        Ok(Self { texture, texture_from_world: signals.map(|g| g.texture_from_world) })
    }
}

impl Signals {
    pub fn of(volume: &VoxelVolume<f32>, tint: Option<&[[u8; 3]]>) -> Result<Self, RenderError> {
        let wanted = volume.data.len();
        if let Some(given) = tint.map(<[_]>::len).filter(|&given| given != wanted) {
            return Err(RenderError::Tint { wanted, given });
        }
        let white = white(&volume.data);
        let texel = |(at, &v): (usize, &f32)| {
            let [r, g, b] = tint.map_or([0; 3], |tint| tint[at]);
            [r, g, b, (v / white * 255.0).clamp(0.0, 255.0) as u8]
        };
        let texels = volume.data.iter().enumerate().map(texel).collect();
        let voxel_from_world = volume.world_from_voxel.inverse();
        if !voxel_from_world.is_finite() {
            return Err(RenderError::Mri);
        }
        let dims = DVec3::from(volume.dims.map(|n| n as f64));
        let texture_from_voxel = DAffine3::from_scale(1.0 / dims) * DAffine3::from_translation(DVec3::splat(0.5));
        let texture_from_world = DMat4::from(texture_from_voxel * voxel_from_world).as_mat4();
        let is_marked = tint.is_some_and(|tint| tint.iter().any(|mark| *mark != [0; 3]));
        Ok(Self { dims: volume.dims, texels, is_marked, texture_from_world })
    }
}

/// The signal shown as white: the 99.5th percentile of positive values in a sample of at most
/// 100,000 voxels.
fn white(data: &[f32]) -> f32 {
    let step = (data.len() / 100_000).max(1);
    let mut signal: Vec<f32> = data.iter().step_by(step).copied().filter(|v| v.is_finite() && *v > 0.0).collect();
    signal.sort_unstable_by(f32::total_cmp);
    signal.get(signal.len() * 995 / 1000).copied().unwrap_or(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tint_of_another_volume_is_refused() {
        let mri = VoxelVolume::isotropic([2, 1, 1], glam::Vec3::ZERO, 1.0, 100.0f32);
        let tinted = Signals::of(&mri, Some(&[[0; 3], [9, 8, 7]])).unwrap();
        assert_eq!(tinted.texels, [[0, 0, 0, 255], [9, 8, 7, 255]]);
        assert_eq!(Signals::of(&mri, Some(&[[0; 3]])).unwrap_err(), RenderError::Tint { wanted: 2, given: 1 });
    }

    #[test]
    fn white_ignores_a_few_hot_voxels_and_survives_none() {
        let mut data: Vec<f32> = (0..1000).map(|i| (i % 100) as f32).collect();
        data[7] = 1e9;
        data[8] = f32::NAN;
        assert!((98.0..=99.0).contains(&white(&data)));
        assert_eq!(white(&[0.0; 5]), 1.0);
        assert_eq!(white(&[]), 1.0);
    }
}
