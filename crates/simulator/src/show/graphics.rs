//! The painter of a session's pictures, and the coloured maps at its end.

use crate::SessionError;
use crate::session_setup::SessionSetup;
use crate::show::colours::{self, Colours};
use crate::show::picture::snap;
use std::path::Path;
use trepan_budget::Picture;
use trepan_gpu::{Gpu, GpuError};
use trepan_link::Recording;
use trepan_patient::RestBrain;
use trepan_render::{Camera, Cortex, Frame, Painter, RenderError, SceneData, SliceLook};
use trepan_report::page::Shot;

/// Caption of the map of bone.
const OF_BONE: &str = "bone against the plan: green as planned, blue planned and left, red taken outside the plan";
/// Caption of the map of the brain.
const OF_BRAIN: &str = "force on the brain over time: yellow little, red most";
/// Camera distance for the map of bone without a flap, mm.
const BONE_VIEW_MM: f32 = 75.0;
/// Camera distance for the map of the brain, mm.
const BRAIN_VIEW_MM: f32 = 150.0;

/// Why a session has no pictures.
#[derive(Debug, thiserror::Error)]
pub(crate) enum NoPicture {
    /// None was requested.
    #[error("no picture was requested")]
    NotRequested,
    /// The painter could not be made.
    #[error(transparent)]
    Failed(#[from] RenderError),
}

/// The painter and the name of its device.
pub(crate) struct Graphics {
    /// Name of the graphics adapter.
    pub adapter: String,
    /// The painter; `None` once it is taken.
    pub painter: Option<Painter>,
}

impl Graphics {
    /// Opens a painter for pictures of `size` pixels. The CPU painter replaces a software driver,
    /// which takes six times as long for a picture.
    pub fn open(setup: &SessionSetup, size: [u32; 2], device: Result<Gpu, GpuError>) -> Result<Self, RenderError> {
        let Picture { sparse, detail } = setup.models.setup.picture;
        let brain = setup.scene.brain.as_ref();
        let cortex = brain.map(RestBrain::cortex);
        let data = SceneData {
            bone: setup.scene.bone.clone(),
            brain: brain.map(|brain| &brain.mesh),
            mri: brain.map(|brain| &brain.mri),
            tint: brain.and_then(|brain| brain.tint.as_deref()),
            cortex: cortex.as_ref().map(|seen| Cortex { surface: &seen.surface, depth_mm: &seen.depth_mm }),
        };
        let by_processor = device.as_ref().is_ok_and(Gpu::is_software);
        let painter = if by_processor { Painter::by_processor(&data, size) } else { Painter::on(device, &data, size) };
        let mut painter = painter?;
        painter.set_quality(sparse, detail as f32)?;
        painter.notice().inspect(|notice| tracing::warn!("{notice}"));
        Ok(Self { adapter: painter.name(), painter: Some(painter) })
    }
}

impl SessionSetup {
    /// Makes the colour overlays shown during the operation.
    pub fn colours(&self) -> Colours {
        let brain = self.scene.brain.as_ref();
        let field = brain.map(|brain| &*brain.field);
        let bone = self.bone().map(|_| colours::planned(&self.plan, field));
        let forbidden =
            brain.and_then(|brain| Some((brain.distance_to(&self.operation.forbidden)?, brain.mesh.bounds())));
        Colours { bone, brain: forbidden.map(|(field, around)| colours::forbidden(&field, around)) }
    }

    /// Draws the maps at the end of a session: bone against the plan, force on the brain. A failed
    /// map gives its fault.
    pub fn maps(&self, painter: &mut Painter, recording: &Recording, folder: &Path) -> Vec<Result<Shot, SessionError>> {
        let removed = self.bone().map(|bone| colours::against(&self.plan, bone));
        let field = self.scene.brain.as_ref().map(|brain| &*brain.field);
        let forces = field.and_then(|field| colours::forces(field, self.program.tray(), &recording.ticks));
        let outward = -self.plan.site.inward;
        let side = outward.any_orthonormal_vector();
        let eye = |distance_mm| Camera::viewed_from(self.plan.site.entry, outward + 0.35 * side, distance_mm);
        let frame = |distance_mm| Frame {
            slices: SliceLook { shown: false, ..SliceLook::default() },
            ..Frame::of(eye(distance_mm))
        };
        let mut draw = |caption: &str, frame: Frame| {
            let (image, _) = painter.picture(&frame)?;
            snap(&image, folder, caption)
        };
        let of_bone = removed.as_ref().map(|paint| {
            draw(OF_BONE, Frame { bone_paint: Some(paint), ..frame(BONE_VIEW_MM + 3.0 * self.plan.flap_mm) })
        });
        let of_brain = forces
            .as_ref()
            .map(|paint| draw(OF_BRAIN, Frame { brain_paint: Some(paint), show_bone: false, ..frame(BRAIN_VIEW_MM) }));
        of_bone.into_iter().chain(of_brain).collect()
    }
}
