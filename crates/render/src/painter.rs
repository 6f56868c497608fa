//! A picture on every machine: by the graphics device as long as there is one, else by the processor.
//!
//! # Practice
//! One call gives a finished picture. When no device opens, or the device is lost on the way, the processor goes on with the same scene and the reason is
//! kept for the user to read.
//!
//! # When not to use it
//! In a window, which shows the device's texture without a copy: use [`Renderer`].

use crate::brain::Border;
use crate::frame::{Frame, SceneData, bounds};
use crate::image::Image;
use crate::mri::Greys;
use crate::renderer::DrawReport;
use crate::{ProcessorRenderer, RenderError, Renderer};
use std::sync::Arc;
use trepan_geometry::Aabb;
use trepan_gpu::{Gpu, GpuError, Prefer};
use trepan_volume::BoneVolume;

/// Draws finished pictures of one scene, whatever the machine has.
#[derive(Debug)]
pub struct Painter {
    by: By,
    kept: Kept,
    notice: Option<String>,
}

#[derive(Debug)]
enum By {
    Device(Box<Renderer>),
    Processor(Box<ProcessorRenderer>),
}

/// What the processor needs if it has to take over.
#[derive(Clone, Debug)]
pub(crate) struct Kept {
    pub bone: Option<Arc<BoneVolume>>,
    /// What the slices show.
    pub bounds: Aabb,
    pub brain: Option<Border>,
    pub mri: Option<Greys>,
}

impl Kept {
    pub fn of(data: &SceneData) -> Result<Self, RenderError> {
        let mri = data.mri.map(Greys::of).transpose()?;
        Ok(Self { bone: data.bone.clone(), bounds: bounds(data), brain: data.brain.map(Border::of), mri })
    }
}

impl Painter {
    /// Loads a scene for pictures of `size` pixels onto the best device, or onto the processor where none opens.
    pub fn open(prefer: Prefer, data: &SceneData, size: [u32; 2]) -> Result<Self, RenderError> {
        Self::on(Gpu::open(prefer), data, size)
    }

    /// Loads a scene onto a device that was opened before, or onto the processor if that failed.
    pub fn on(device: Result<Gpu, GpuError>, data: &SceneData, size: [u32; 2]) -> Result<Self, RenderError> {
        let kept = Kept::of(data)?;
        let why = match device.map_err(RenderError::from).and_then(|gpu| Renderer::new(&gpu, data, size)) {
            Ok(renderer) => return Ok(Self { by: By::Device(Box::new(renderer)), kept, notice: None }),
            Err(RenderError::Gpu(why)) => why,
            Err(other) => return Err(other),
        };
        let processor = ProcessorRenderer::with(kept.clone(), size)?;
        Ok(Self { by: By::Processor(Box::new(processor)), kept, notice: Some(format!("{why}; the processor draws")) })
    }

    /// Draws a picture and waits for it.
    pub fn picture(&mut self, frame: &Frame) -> Result<(Image, DrawReport), RenderError> {
        let (why, size) = match &mut self.by {
            By::Processor(processor) => {
                let report = processor.draw(frame)?;
                return Ok((processor.image().clone(), report));
            }
            By::Device(renderer) => match on_device(renderer, frame) {
                Err(RenderError::Gpu(why)) => (why, renderer.size()),
                done => return done,
            },
        };
        self.notice = Some(format!("{why}; the processor draws from here on"));
        self.by = By::Processor(Box::new(ProcessorRenderer::with(self.kept.clone(), size)?));
        self.picture(frame)
    }

    /// Changes the size of the pictures, width and height.
    pub fn resize(&mut self, size: [u32; 2]) -> Result<(), RenderError> {
        match &mut self.by {
            By::Device(renderer) => renderer.resize(size),
            By::Processor(processor) => processor.resize(size),
        }
    }

    /// Who draws, for people.
    pub fn name(&self) -> String {
        match &self.by {
            By::Device(renderer) => renderer.gpu().name(),
            By::Processor(processor) => format!("processor, {} threads", processor.threads),
        }
    }

    /// Why the processor draws, if it does.
    pub fn notice(&self) -> Option<&str> {
        self.notice.as_deref()
    }

    /// The renderer on the device, for a window; the painter itself if the processor draws.
    pub fn into_renderer(self) -> Result<Renderer, Box<Self>> {
        match self.by {
            By::Device(renderer) => Ok(*renderer),
            by => Err(Box::new(Self { by, ..self })),
        }
    }
}

fn on_device(renderer: &mut Renderer, frame: &Frame) -> Result<(Image, DrawReport), RenderError> {
    let report = renderer.draw(frame)?;
    let image = renderer.image()?;
    // A device that was lost may still hand out memory.
    renderer.gpu().wait()?;
    Ok((image, report))
}
