//! Renders on every machine: on the graphics device if there is one, else on the processor.
//!
//! # Practice
//! One call returns a finished picture. If no device opens, or the device is lost, the processor
//! continues with the same scene and the reason is stored for the user.
//!
//! # When not to use it
//! Where the device's texture is shown without a copy and a lost device is an error: use
//! [`Renderer`].

use crate::frame::{Frame, SceneData};
use crate::image::Image;
use crate::kept::SceneCache;
use crate::report::DrawReport;
use crate::{Casting, ProcessorRenderer, RenderError, Renderer, View};
use std::borrow::Cow;
use trepan_geometry::Aabb;
use trepan_gpu::{Gpu, GpuError, Prefer};

/// Draws finished pictures of one scene on any machine.
#[derive(Debug)]
pub struct Painter {
    by: By,
    kept: SceneCache,
    notice: Option<String>,
    /// Whether rays are sparse, and the fraction of the 3-D view's pixels along an edge.
    quality: (bool, f32),
}

#[derive(Debug)]
enum By {
    Device(Box<Renderer>),
    Processor(Box<ProcessorRenderer>),
}

impl Painter {
    /// Loads a scene for pictures of `size` pixels onto the best device, or the processor if none
    /// opens.
    pub fn open(prefer: Prefer, data: &SceneData, size: [u32; 2]) -> Result<Self, RenderError> {
        Self::on(Gpu::open(prefer), data, size)
    }

    /// Loads a scene onto an open device, or onto the processor if opening failed.
    pub fn on(device: Result<Gpu, GpuError>, data: &SceneData, size: [u32; 2]) -> Result<Self, RenderError> {
        let kept = SceneCache::of(data)?;
        let why = match device.map_err(RenderError::from).and_then(|gpu| Renderer::new(&gpu, data, size)) {
            Ok(renderer) => {
                return Ok(Self { by: By::Device(Box::new(renderer)), kept, notice: None, quality: (false, 1.0) });
            }
            Err(RenderError::Gpu(why)) => why,
            Err(other) => return Err(other),
        };
        Ok(Self { notice: Some(format!("{why}; the processor draws")), ..Self::processor(kept, size)? })
    }

    /// Loads a scene for rendering on the processor, ignoring devices.
    pub fn by_processor(data: &SceneData, size: [u32; 2]) -> Result<Self, RenderError> {
        Self::processor(SceneCache::of(data)?, size)
    }

    fn processor(kept: SceneCache, size: [u32; 2]) -> Result<Self, RenderError> {
        let processor = ProcessorRenderer::with(kept.clone(), size)?;
        Ok(Self { by: By::Processor(Box::new(processor)), kept, notice: None, quality: (false, 1.0) })
    }

    /// Draws the 3-D view with a fraction of the pixels along an edge, from 0.05 to 1, and enlarges
    /// it. With `sparse` the processor casts every second ray where bone is smooth.
    pub fn set_quality(&mut self, sparse: bool, detail: f32) -> Result<(), RenderError> {
        self.quality = (sparse, detail);
        match &mut self.by {
            By::Device(renderer) => renderer.set_detail(detail),
            By::Processor(processor) => {
                processor.set_casting(Casting { sparse, ..processor.casting() });
                processor.set_detail(detail)
            }
        }
    }

    /// Draws a picture and waits for it.
    pub fn picture(&mut self, frame: &Frame) -> Result<(Image, DrawReport), RenderError> {
        self.draw(frame).map(|(image, report)| (image.into_owned(), report))
    }

    /// Draws a picture and waits for it; the processor lends its own.
    pub fn draw(&mut self, frame: &Frame) -> Result<(Cow<'_, Image>, DrawReport), RenderError> {
        let lost = match &mut self.by {
            By::Processor(_) => None,
            By::Device(renderer) => match on_device(renderer, frame) {
                Err(RenderError::Gpu(why)) => Some((why, renderer.size())),
                done => return done.map(|(image, report)| (Cow::Owned(image), report)),
            },
        };
        if let Some((why, size)) = lost {
            self.notice = Some(format!("{why}; the processor draws from here on"));
            self.by = By::Processor(Box::new(ProcessorRenderer::with(self.kept.clone(), size)?));
            let (sparse, detail) = self.quality;
            self.set_quality(sparse, detail)?;
        }
        match &mut self.by {
            By::Processor(processor) => {
                let report = processor.draw(frame)?;
                Ok((Cow::Borrowed(processor.image()), report))
            }
            By::Device(renderer) => on_device(renderer, frame).map(|(image, report)| (Cow::Owned(image), report)),
        }
    }

    /// Smooths the edges of the last picture, of the same frame, by one more sample of a pixel;
    /// returns whether there was one to add.
    pub fn refine(&mut self, frame: &Frame) -> Result<bool, RenderError> {
        match &mut self.by {
            By::Processor(processor) => Ok(processor.refine(frame)),
            By::Device(renderer) => renderer.refine(frame),
        }
    }

    /// The last picture, as it is now.
    pub fn image(&self) -> Result<Image, RenderError> {
        match &self.by {
            By::Processor(processor) => Ok(processor.image().clone()),
            By::Device(renderer) => renderer.image(),
        }
    }

    /// The last picture, without a copy where the processor drew it.
    pub fn seen(&self) -> Result<Cow<'_, Image>, RenderError> {
        match &self.by {
            By::Processor(processor) => Ok(Cow::Borrowed(processor.image())),
            By::Device(renderer) => renderer.image().map(Cow::Owned),
        }
    }

    /// Whether bone has changed since the last picture.
    pub fn is_stale(&mut self) -> bool {
        match &mut self.by {
            By::Device(renderer) => renderer.is_stale(),
            By::Processor(processor) => processor.is_stale(),
        }
    }

    /// Changes the size of the pictures, width and height.
    pub fn resize(&mut self, size: [u32; 2]) -> Result<(), RenderError> {
        match &mut self.by {
            By::Device(renderer) => renderer.resize(size),
            By::Processor(processor) => processor.resize(size),
        }
    }

    /// Adapts the pictures to an area of `size` pixels, with a fraction `detail` of the 3-D view's
    /// pixels along an edge. Below 1 the processor also casts every second ray where bone is
    /// smooth, and draws one slice per picture.
    pub fn fit(&mut self, size: [u32; 2], detail: f32) -> Result<(), RenderError> {
        if let By::Processor(processor) = &mut self.by {
            processor.slices_per_frame = if detail < 1.0 { 1 } else { 3 };
        }
        self.set_quality(detail < 1.0, detail)?;
        self.resize(size)
    }

    /// The camera of a frame as vectors, for the 3-D view of this picture.
    pub fn view(&self, frame: &Frame) -> View {
        match &self.by {
            By::Device(renderer) => renderer.view(frame),
            By::Processor(processor) => processor.view(frame),
        }
    }

    /// The box that the slices show, world mm.
    pub fn bounds(&self) -> Aabb {
        self.kept.bounds
    }

    /// The renderer on the device, if in use.
    pub fn renderer(&self) -> Option<&Renderer> {
        match &self.by {
            By::Device(renderer) => Some(renderer),
            By::Processor(_) => None,
        }
    }

    /// The mutable renderer on the device, if in use.
    pub fn renderer_mut(&mut self) -> Option<&mut Renderer> {
        match &mut self.by {
            By::Device(renderer) => Some(renderer),
            By::Processor(_) => None,
        }
    }

    /// Display name of the device or processor in use.
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

    /// Converts into the renderer on the device; returns itself if the processor draws.
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
    // A lost device may still allocate memory.
    renderer.gpu().wait()?;
    Ok((image, report))
}
