//! A draft of the scene in the window while its session is still loading.
//!
//! # Practice
//! It needs the skull of the cached case only, not the models that run, and is drawn with few rays
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

/// Width and height of the first picture, pixels.
const SIZE: [u32; 2] = [640, 480];

/// A scene that can be looked at only.
struct Draft {
    case: String,
}

impl Session for Draft {
    fn update(&mut self, _: &WindowInput) -> Panel {
        let hint = "a draft of the scene: turn it with the right mouse button while the rest is loading";
        Panel { case: self.case.clone(), phase: "Loading".into(), hint: hint.into(), ..Panel::default() }
    }

    fn frame(&self, camera: Camera) -> Frame<'_> {
        Frame { slices: SliceLook { shown: false, ..SliceLook::default() }, ..Frame::of(camera) }
    }

    fn capture(&mut self, _: Capture, _: Image) {}
}

/// Shows the draft of a cached case until another session takes the window; returns whether there
/// was one.
pub(crate) fn show(
    (cache, hash): (&Cache, &str),
    name: String,
    device: Result<Gpu, GpuError>,
    (stage, loading): (&Stage, &Progress),
) -> Result<bool, SessionError> {
    let Some(folder) = cache.find(hash) else { return Ok(false) };
    let Some(skull) = folder::draft_skull(&folder)? else { return Ok(false) };
    let bone = BoneVolume::new(&skull.hu, skull.isovalue_hu).map_err(|fault| SessionError::Case(fault.to_string()))?;
    let data = SceneData { bone: Some(Arc::new(bone)), brain: None, mri: None, tint: None };
    // A software driver needs seconds to compile its programs.
    let by_processor = device.as_ref().map_or(true, Gpu::is_software);
    let mut painter =
        if by_processor { Painter::by_processor(&data, SIZE)? } else { Painter::on(device, &data, SIZE)? };
    painter.set_quality(true, DETAIL)?;
    let start = Start { detail: DETAIL, ..Start::with(camera(&skull.opening.into()), Pose::IDENTITY) };
    // The session itself may be in the window already, or loading was given up.
    if loading.is_over() {
        return Ok(false);
    }
    tracing::debug!("draft of the scene after {:.0} ms", loading.so_far().1);
    stage.run(painter, Draft { case: name }, start);
    Ok(true)
}
