//! The data that the processor needs to take over from the device.

use crate::RenderError;
use crate::border::Border;
use crate::frame::{SceneData, bounds};
use crate::mri::Signals;
use std::sync::Arc;
use trepan_bone::BoneVolume;
use trepan_geometry::Aabb;

/// The data that the processor needs to take over.
#[derive(Clone, Debug)]
pub(crate) struct SceneCache {
    pub bone: Option<Arc<BoneVolume>>,
    /// Box that the slices show.
    pub bounds: Aabb,
    pub brain: Option<Border>,
    pub mri: Option<Arc<Signals>>,
}

impl SceneCache {
    pub fn of(data: &SceneData) -> Result<Self, RenderError> {
        let mri = data.mri.map(|mri| Signals::of(mri, data.tint)).transpose()?.map(Arc::new);
        Ok(Self {
            bone: data.bone.clone(),
            bounds: bounds(data),
            brain: data.brain.map(|mesh| Border::of(mesh, data.cortex.as_ref())),
            mri,
        })
    }
}
