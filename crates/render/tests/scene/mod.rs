//! Scenes with a closed-form picture.

use glam::{DVec3, Vec3};
use std::sync::Arc;
use trepan_bone::BoneVolume;
use trepan_gpu::Gpu;
pub use trepan_gpu::adapter_for_tests as device;
use trepan_render::{Renderer, SceneData};
use trepan_volume::VoxelVolume;

pub const ISO: i16 = 400;

/// A grid of `edge`³ voxels of 1 mm around the origin, with a density by world position.
pub fn volume(edge: usize, hu: impl Fn(DVec3) -> f64) -> VoxelVolume<i16> {
    let mut volume = VoxelVolume::isotropic([edge; 3], Vec3::splat(0.5 - 0.5 * edge as f32), 1.0, 0i16);
    for at in 0..volume.data.len() {
        let centre = volume.centre_of([at % edge, at / edge % edge, at / edge / edge]);
        volume.data[at] = hu(centre).round().clamp(-1000.0, 3000.0) as i16;
    }
    volume
}

/// Bone from a signed distance, mm, negative inside.
pub fn bone(edge: usize, distance: impl Fn(DVec3) -> f64) -> Arc<BoneVolume> {
    Arc::new(BoneVolume::new(&volume(edge, |p| f64::from(ISO) - 100.0 * distance(p)), ISO).expect("the scene has bone"))
}

/// A scene with bone only.
pub fn alone(bone: &Arc<BoneVolume>) -> SceneData<'static> {
    SceneData { bone: Some(bone.clone()), brain: None, mri: None, tint: None, cortex: None }
}

/// A renderer on the device.
pub fn renderer(gpu: &Gpu, data: &SceneData, size: [u32; 2]) -> Renderer {
    Renderer::new(gpu, data, size).expect("the scene loads")
}
