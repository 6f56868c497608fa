//! A draft of the scene in the window while its session is still loading.
//!
//! # Practice
//! It needs the cached case only, not the models that run: skull and brain are drawn with few rays
//! until the session takes its place.

use crate::case::cache::Cache;
use crate::case::folder;
use crate::error::SessionError;
use crate::progress::Progress;
use crate::show::picture::camera;
use std::sync::Arc;
use trepan_geometry::Pose;
use trepan_gpu::{Gpu, GpuError};
use trepan_render::window::{Capture, Panel, Session, Stage, Start, WindowInput};
use trepan_render::{Camera, Frame, Image, Painter, SceneData, SliceLook};
use trepan_volume::BoneVolume;

/// Share of the picture's pixels along an edge.
const DETAIL: f32 = 0.4;

/// A scene that can be looked at only.
struct Draft {
    case: String,
    has_bone: bool,
}

impl Session for Draft {
    fn update(&mut self, _: &WindowInput) -> Panel {
        let hint = "a draft of the scene: turn it with the right mouse button while the rest is loading";
        Panel { case: self.case.clone(), phase: "Loading".into(), hint: hint.into(), ..Panel::default() }
    }

    fn frame(&self, camera: Camera) -> Frame<'_> {
        let slices = SliceLook { half_height_mm: None, ..SliceLook::default() };
        Frame { show_bone: self.has_bone, slices, ..Frame::of(camera) }
    }

    fn capture(&mut self, _: Capture, _: Image) {}
}

/// Shows the draft of a cached case until another session takes the window; returns whether there
/// was one.
pub(crate) fn show(
    (cache, hash): (&Cache, &str),
    name: String,
    with_bone: bool,
    device: Result<Gpu, GpuError>,
    (stage, loading): (&Stage, &Progress),
) -> Result<bool, SessionError> {
    let Some(folder) = cache.find(hash) else { return Ok(false) };
    let case = folder::load(&folder)?;
    let Some(site) = case.opening.map(Into::into) else { return Ok(false) };
    let bone = case.skull.as_ref().filter(|_| with_bone).map(|skull| BoneVolume::new(skull, case.isovalue_hu));
    let bone = bone.transpose().map_err(|fault| SessionError::Case(fault.to_string()))?.map(Arc::new);
    let brain = case.brain.as_ref();
    let data = SceneData {
        bone: bone.clone(),
        brain: brain.map(|brain| &brain.mesh),
        mri: brain.map(|brain| &brain.mri),
        tint: None,
    };
    let mut painter = Painter::on(device, &data, [640, 480])?;
    painter.set_quality(true, DETAIL)?;
    let start = Start { detail: DETAIL, ..Start::with(camera(&site), Pose::IDENTITY) };
    // The session itself may be in the window already, or loading was given up.
    if loading.is_over() {
        return Ok(false);
    }
    stage.run(painter, Draft { case: name, has_bone: bone.is_some() }, start);
    Ok(true)
}
