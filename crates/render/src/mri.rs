//! The MRI as a texture of grey values.

use crate::RenderError;
use glam::{DAffine3, DMat4, DVec3, Mat4};
use trepan_gpu::{Format, Gpu, Texture, TextureSpec};
use trepan_volume::VoxelVolume;

/// The MRI on the device; one dark texel where there is none.
#[derive(Debug)]
pub(crate) struct Mri {
    pub texture: Texture,
    /// Texture coordinates of a world point.
    pub texture_from_world: Option<Mat4>,
}

/// The MRI as grey values.
#[derive(Clone, Debug)]
pub(crate) struct Greys {
    pub dims: [usize; 3],
    pub values: Vec<u8>,
    /// Texture coordinates, 0 to 1, of a world point.
    pub texture_from_world: Mat4,
}

impl Mri {
    pub fn new(gpu: &Gpu, volume: Option<&VoxelVolume<f32>>) -> Result<Self, RenderError> {
        let greys = volume.map(Greys::of).transpose()?;
        let size = greys.as_ref().map_or([1; 3], |g| g.dims.map(|n| n as u32));
        let spec = TextureSpec { label: "mri", size, volume: true, format: Format::R8Unorm, drawn_to: false };
        let texture = Texture::new(gpu, &spec)?;
        if let Some(greys) = &greys {
            texture.write(gpu, [0; 3], size, &greys.values);
        }
        Ok(Self { texture, texture_from_world: greys.map(|g| g.texture_from_world) })
    }
}

impl Greys {
    pub fn of(volume: &VoxelVolume<f32>) -> Result<Self, RenderError> {
        let white = white(&volume.data);
        let values = volume.data.iter().map(|&v| (v / white * 255.0).clamp(0.0, 255.0) as u8).collect();
        let voxel_from_world = volume.world_from_voxel.inverse();
        if !voxel_from_world.is_finite() {
            return Err(RenderError::Mri);
        }
        let dims = DVec3::from(volume.dims.map(|n| n as f64));
        let texture_from_voxel = DAffine3::from_scale(1.0 / dims) * DAffine3::from_translation(DVec3::splat(0.5));
        let texture_from_world = DMat4::from(texture_from_voxel * voxel_from_world).as_mat4();
        Ok(Self { dims: volume.dims, values, texture_from_world })
    }
}

/// The signal that is shown white: the 99.5th percentile of what is over zero, from a sample of at most 100,000 voxels.
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
    fn white_ignores_a_few_hot_voxels_and_survives_none() {
        let mut data: Vec<f32> = (0..1000).map(|i| (i % 100) as f32).collect();
        data[7] = 1e9;
        data[8] = f32::NAN;
        assert!((98.0..=99.0).contains(&white(&data)));
        assert_eq!(white(&[0.0; 5]), 1.0);
        assert_eq!(white(&[]), 1.0);
    }
}
