//! A draft of the scene in the window while its session is still loading.
//!
//! # Practice
//! It needs only the skull, of a cached case or of the CT once it is read, not the models that run,
//! and is drawn with few rays until the session takes its place.

use crate::error::SessionError;
use crate::show::picture::first_view;
use std::path::Path;
use std::sync::Arc;
use std::sync::mpsc::Receiver;
use trepan_bone::BoneVolume;
use trepan_geometry::{Pose, Vec3};
use trepan_gpu::{Gpu, GpuError};
use trepan_patient::folder;
use trepan_patient::opening::Opening;
use trepan_patient::progress::{DraftSkull, Progress};
use trepan_render::{Camera, Frame, Image, Painter, SceneData, SliceLook};
use trepan_window::{Capture, Panel, Session, Stage, Start, WindowInput};

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

/// The skull of a draft, and the camera that looks at it.
pub(crate) struct DraftView {
    skull: DraftSkull,
    camera: Camera,
}

impl DraftView {
    /// The skull of a cached case, seen over its opening.
    pub fn cached(folder: &Path) -> Result<Option<Self>, SessionError> {
        let of = |(skull, opening): (_, Opening)| Self { skull, camera: first_view(&opening.into()) };
        Ok(folder::draft_skull(folder)?.map(of))
    }

    /// The skull of a CT that is being read, seen from the upper right front; `None` if it does not
    /// come.
    pub fn read(from: &Receiver<DraftSkull>) -> Option<Self> {
        let skull = from.recv().ok()?;
        let place = |share: f64| {
            let voxel = glam::DVec3::from_array(skull.hu.dims.map(|n| share * n.saturating_sub(1) as f64));
            skull.hu.world_from_voxel.transform_point3(voxel).as_vec3()
        };
        let size_mm = place(0.0).distance(place(1.0));
        let camera = Camera::viewed_from(place(0.5), Vec3::new(0.6, 0.8, 0.5), 1.2 * size_mm);
        Some(Self { skull, camera })
    }
}

/// Shows a draft until another session takes the window; returns whether it came to that.
pub(crate) fn show(
    DraftView { skull, camera }: DraftView,
    name: String,
    device: Result<Gpu, GpuError>,
    (stage, loading): (&Stage, &Progress),
) -> Result<bool, SessionError> {
    let bone = BoneVolume::new(&skull.hu, skull.isovalue_hu).map_err(|fault| SessionError::Case(fault.to_string()))?;
    let data = SceneData { bone: Some(Arc::new(bone)), brain: None, mri: None, tint: None, cortex: None };
    // A software driver needs seconds to compile its programs.
    let by_processor = device.as_ref().map_or(true, Gpu::is_software);
    let mut painter =
        if by_processor { Painter::by_processor(&data, SIZE)? } else { Painter::on(device, &data, SIZE)? };
    painter.set_quality(true, DETAIL)?;
    let start = Start { detail: DETAIL, ..Start::with(camera, Pose::IDENTITY) };
    // The session itself may be in the window already, or loading was given up.
    if loading.is_over() {
        return Ok(false);
    }
    tracing::debug!("draft of the scene after {:.0} ms", loading.so_far().1);
    stage.run(painter, Draft { case: name }, start);
    Ok(true)
}
