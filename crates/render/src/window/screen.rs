//! The picture's way into the window: the renderer's own texture, or a copy of its pixels.
//!
//! # Practice
//! egui's shader computes both of its ways to filter a texture on a software driver, about 80 ns a
//! pixel. A copied picture, as the processor draws it, is therefore shown by a pass of its own.

use super::{Draws, Refined};
use crate::{Frame, Image, RenderError, View};
use eframe::egui_wgpu::{self, RenderState};
use eframe::{egui, wgpu};

/// How the picture gets into the window.
pub(super) enum Screen {
    /// The renderer's own texture is shown.
    Shares(Option<(egui::TextureId, wgpu::TextureView)>),
    /// Every picture is copied into a texture of the window.
    Copies(Option<Copied>),
}

/// The window's copy of the picture.
pub(super) enum Copied {
    /// Shown by a pass of its own.
    Plain(Plain),
    /// Shown by egui, in a window without wgpu.
    Egui(egui::TextureHandle),
}

/// Why a frame is not shown.
#[derive(Debug, thiserror::Error)]
pub(super) enum ShowError {
    /// The window was opened without a graphics device.
    #[error("the window has no graphics device")]
    NoDevice,
    /// Rendering failed.
    #[error(transparent)]
    Render(#[from] RenderError),
}

impl Screen {
    /// Shares the renderer's texture, or copies its pictures.
    pub fn new(copies: bool) -> Self {
        if copies { Self::Copies(None) } else { Self::Shares(None) }
    }

    /// Draws a frame for an area of the window.
    pub fn draw(
        &mut self,
        ui: &egui::Ui,
        state: Option<&RenderState>,
        renderer: &mut impl Draws,
        frame: &Frame<'_>,
        pixels: [u32; 2],
        detail: f32,
    ) -> Result<View, ShowError> {
        let texture = match self {
            Self::Shares(texture) => texture,
            Self::Copies(copied) => {
                let (view, image) = renderer.picture(frame, pixels, detail)?;
                copied.get_or_insert_with(|| Copied::new(ui, state)).set(state, &image);
                return Ok(view);
            }
        };
        let state = state.ok_or(ShowError::NoDevice)?;
        let view = renderer.draw(frame, pixels, detail)?;
        if let Some(drawn) = renderer.texture() {
            register(texture, state, drawn.view());
            return Ok(view);
        }
        // The processor has taken over: its pictures are copied from now on.
        *self = Self::Copies(None);
        self.draw(ui, Some(state), renderer, frame, pixels, detail)
    }

    /// Smooths the edges of the last picture by one more sample; returns whether there was one to
    /// add.
    pub fn refine(&mut self, state: Option<&RenderState>, renderer: &mut impl Draws, frame: &Frame<'_>) -> bool {
        // A lost device is met by the next picture.
        match (renderer.refine(frame, matches!(self, Self::Copies(_))), self) {
            (Ok(Refined::Copied(image)), Self::Copies(Some(copied))) => {
                copied.set(state, &image);
                true
            }
            (refined, _) => matches!(refined, Ok(Refined::Drawn)),
        }
    }

    /// Shows the last picture in an area of the window.
    pub fn paint(&self, ui: &egui::Ui, area: egui::Rect) {
        let id = match self {
            Self::Copies(Some(Copied::Plain(plain))) => {
                let Some(group) = plain.shown.as_ref().map(|(_, group)| group.clone()) else { return };
                let pass = Pass { pipeline: plain.pipeline.clone(), group };
                ui.painter().add(egui_wgpu::Callback::new_paint_callback(area, pass));
                return;
            }
            Self::Copies(Some(Copied::Egui(texture))) => texture.id(),
            Self::Shares(Some((id, _))) => *id,
            Self::Copies(None) | Self::Shares(None) => return,
        };
        let whole = egui::Rect::from_min_max(egui::pos2(0.0, 0.0), egui::pos2(1.0, 1.0));
        ui.painter().image(id, area, whole, egui::Color32::WHITE);
    }
}

impl Copied {
    fn new(ui: &egui::Ui, state: Option<&RenderState>) -> Self {
        let handle = || ui.ctx().load_texture("picture", egui::ColorImage::default(), egui::TextureOptions::LINEAR);
        state.map_or_else(|| Self::Egui(handle()), |state| Self::Plain(Plain::new(state)))
    }

    fn set(&mut self, state: Option<&RenderState>, image: &Image) {
        match (self, state) {
            (Self::Plain(plain), Some(state)) => plain.set(state, image),
            (Self::Plain(_), None) => (),
            (Self::Egui(texture), _) => {
                let size = [image.width, image.height].map(|n| n as usize);
                // It is opaque, so that nothing is to be multiplied.
                let colours = egui::ColorImage::from_rgba_premultiplied(size, &image.rgba);
                texture.set(colours, egui::TextureOptions::LINEAR);
            }
        }
    }
}

/// Registers the renderer's texture, again when it changed.
fn register(texture: &mut Option<(egui::TextureId, wgpu::TextureView)>, state: &RenderState, view: &wgpu::TextureView) {
    if let Some((id, shown)) = texture {
        if shown == view {
            return;
        }
        state.renderer.write().free_texture(id);
    }
    let id = state.renderer.write().register_native_texture(&state.device, view, wgpu::FilterMode::Linear);
    *texture = Some((id, view.clone()));
}

/// A texture of the picture's pixels, and the pass that shows it.
pub(super) struct Plain {
    pipeline: wgpu::RenderPipeline,
    format: wgpu::TextureFormat,
    shown: Option<(wgpu::Texture, wgpu::BindGroup)>,
}

impl Plain {
    fn new(state: &RenderState) -> Self {
        let module = state.device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some("plain"),
            source: wgpu::ShaderSource::Wgsl(trepan_shaders::RENDER_PLAIN.into()),
        });
        let target = state.target_format;
        let pipeline = state.device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
            label: Some("plain"),
            layout: None,
            vertex: wgpu::VertexState {
                module: &module,
                entry_point: Some("vertex"),
                compilation_options: Default::default(),
                buffers: &[],
            },
            primitive: Default::default(),
            depth_stencil: None,
            multisample: Default::default(),
            fragment: Some(wgpu::FragmentState {
                module: &module,
                entry_point: Some("fragment"),
                compilation_options: Default::default(),
                targets: &[Some(target.into())],
            }),
            multiview_mask: None,
            cache: None,
        });
        // What a target turns into sRGB must be read from sRGB.
        let format =
            if target.is_srgb() { wgpu::TextureFormat::Rgba8UnormSrgb } else { wgpu::TextureFormat::Rgba8Unorm };
        Self { pipeline, format, shown: None }
    }

    fn set(&mut self, state: &RenderState, image: &Image) {
        let size = wgpu::Extent3d { width: image.width, height: image.height, depth_or_array_layers: 1 };
        if self.shown.as_ref().is_none_or(|(texture, _)| texture.size() != size) {
            self.shown = Some(self.sized(state, size));
        }
        let Some((texture, _)) = &self.shown else { return };
        let layout =
            wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(4 * image.width), rows_per_image: None };
        state.queue.write_texture(texture.as_image_copy(), &image.rgba, layout, size);
    }

    fn sized(&self, state: &RenderState, size: wgpu::Extent3d) -> (wgpu::Texture, wgpu::BindGroup) {
        let texture = state.device.create_texture(&wgpu::TextureDescriptor {
            label: Some("picture"),
            size,
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: self.format,
            usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
            view_formats: &[],
        });
        let view = texture.create_view(&Default::default());
        let sampler = state.device.create_sampler(&Default::default());
        let group = state.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("plain"),
            layout: &self.pipeline.get_bind_group_layout(0),
            entries: &[
                wgpu::BindGroupEntry { binding: 0, resource: wgpu::BindingResource::TextureView(&view) },
                wgpu::BindGroupEntry { binding: 1, resource: wgpu::BindingResource::Sampler(&sampler) },
            ],
        });
        (texture, group)
    }
}

/// Draws the picture where egui asks for it.
struct Pass {
    pipeline: wgpu::RenderPipeline,
    group: wgpu::BindGroup,
}

impl egui_wgpu::CallbackTrait for Pass {
    fn paint(
        &self,
        _: egui::PaintCallbackInfo,
        pass: &mut wgpu::RenderPass<'static>,
        _: &egui_wgpu::CallbackResources,
    ) {
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, &self.group, &[]);
        pass.draw(0..3, 0..1);
    }
}
