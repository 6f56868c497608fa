//! The picture's way into the window: the renderer's own texture, or a copy of its pixels.
//!
//! # Practice
//! egui's shader computes both of its ways to filter a texture on a software driver, about 80 ns a
//! pixel. A copied picture, as the processor draws it, is therefore shown by a pass of its own.

use crate::{Draws, Refined};
use eframe::egui_wgpu::{self, RenderState};
use eframe::{egui, wgpu};
use trepan_render::Layout;
use trepan_render::{Frame, Image, RenderError, View};

/// The picture in the window, whole or in parts.
pub(crate) struct Screen {
    way: Way,
    area: Area,
}

/// A picture's size and its parts, `[x, y, width, height]`, pixels.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Area {
    pub size: [u32; 2],
    parts: Vec<[u32; 4]>,
}

impl Area {
    /// A picture in one part, or the 3-D view of so many pixels and the slices apart from it.
    pub fn of(view: [u32; 2], apart: bool) -> Self {
        let size @ [width, height] = if apart { Layout::around(view) } else { view };
        let whole = [0, 0, width, height];
        let layout = Layout::of(width, height, apart);
        let parts = layout.column().map_or_else(|| vec![whole], |column| vec![layout.view, column]);
        Self { size, parts }
    }

    /// Width over height of the slices, if they are apart.
    pub fn slices_aspect(&self) -> Option<f32> {
        self.parts.get(1).map(|[_, _, width, height]| *width as f32 / *height as f32)
    }
}

/// How the picture gets into the window.
enum Way {
    /// The renderer's own texture is shown.
    Shares(Option<(egui::TextureId, wgpu::TextureView)>),
    /// Every picture is copied into a texture of the window.
    Copies(Option<Copied>),
}

/// The window's copy of the picture.
enum Copied {
    /// Shown by a pass of its own.
    Plain(Plain),
    /// Shown by egui, in a window without wgpu.
    Egui(egui::TextureHandle),
}

/// Why a frame is not shown.
#[derive(Debug, thiserror::Error)]
pub(crate) enum ShowError {
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
        let way = if copies { Way::Copies(None) } else { Way::Shares(None) };
        Self { way, area: Area::of([1, 1], false) }
    }

    /// Draws a frame for an area of the window.
    pub fn draw(
        &mut self,
        ui: &egui::Ui,
        state: Option<&RenderState>,
        renderer: &mut impl Draws,
        frame: &Frame<'_>,
        area: &Area,
        detail: f32,
    ) -> Result<View, ShowError> {
        self.area.clone_from(area);
        let texture = match &mut self.way {
            Way::Shares(texture) => texture,
            Way::Copies(copied) => {
                let (view, image) = renderer.picture(frame, area.size, detail)?;
                copied.get_or_insert_with(|| Copied::new(ui, state)).set(state, &image, area);
                return Ok(view);
            }
        };
        let state = state.ok_or(ShowError::NoDevice)?;
        let view = renderer.draw(frame, area.size, detail)?;
        if let Some(drawn) = renderer.texture() {
            register(texture, state, drawn.view());
            return Ok(view);
        }
        // The processor has taken over: its pictures are copied from now on.
        self.way = Way::Copies(None);
        self.draw(ui, Some(state), renderer, frame, area, detail)
    }

    /// Smooths the edges of the last picture by one more sample; returns whether there was one to
    /// add.
    pub fn refine(&mut self, state: Option<&RenderState>, renderer: &mut impl Draws, frame: &Frame<'_>) -> bool {
        // A lost device is met by the next picture.
        match (renderer.refine(frame, matches!(self.way, Way::Copies(_))), &mut self.way) {
            (Ok(Refined::Copied(image)), Way::Copies(Some(copied))) => {
                copied.set(state, &image, &self.area);
                true
            }
            (refined, _) => matches!(refined, Ok(Refined::Drawn)),
        }
    }

    /// Shows a part of the last picture in an area of a window.
    pub fn paint(&self, ui: &egui::Ui, to: egui::Rect, part: usize) {
        let Some(&[x, y, width, height]) = self.area.parts.get(part) else { return };
        let id = match &self.way {
            Way::Copies(Some(Copied::Plain(plain))) => {
                let Some((_, group)) = plain.parts.get(part) else { return };
                let pass = Pass { pipeline: plain.pipeline.clone(), group: group.clone() };
                ui.painter().add(egui_wgpu::Callback::new_paint_callback(to, pass));
                return;
            }
            Way::Copies(Some(Copied::Egui(texture))) => texture.id(),
            Way::Shares(Some((id, _))) => *id,
            Way::Copies(None) | Way::Shares(None) => return,
        };
        let share =
            |x: u32, y: u32| egui::pos2(x as f32 / self.area.size[0] as f32, y as f32 / self.area.size[1] as f32);
        let part = egui::Rect::from_min_max(share(x, y), share(x + width, y + height));
        ui.painter().image(id, to, part, egui::Color32::WHITE);
    }
}

impl Copied {
    fn new(ui: &egui::Ui, state: Option<&RenderState>) -> Self {
        let handle = || ui.ctx().load_texture("picture", egui::ColorImage::default(), egui::TextureOptions::LINEAR);
        state.map_or_else(|| Self::Egui(handle()), |state| Self::Plain(Plain::new(state)))
    }

    fn set(&mut self, state: Option<&RenderState>, image: &Image, area: &Area) {
        match (self, state) {
            (Self::Plain(plain), Some(state)) => plain.set(state, image, area),
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

/// Textures of the picture's parts, and the pass that shows them.
struct Plain {
    pipeline: wgpu::RenderPipeline,
    format: wgpu::TextureFormat,
    parts: Vec<(wgpu::Texture, wgpu::BindGroup)>,
}

impl Plain {
    fn new(state: &RenderState) -> Self {
        let module = state.device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some("plain"),
            source: wgpu::ShaderSource::Wgsl(trepan_shaders::WINDOW_SCREEN.into()),
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
        Self { pipeline, format, parts: Vec::new() }
    }

    fn set(&mut self, state: &RenderState, image: &Image, area: &Area) {
        self.parts.truncate(area.parts.len());
        for (n, &[x, y, width, height]) in area.parts.iter().enumerate() {
            let size = wgpu::Extent3d { width, height, depth_or_array_layers: 1 };
            if self.parts.get(n).is_none_or(|(texture, _)| texture.size() != size) {
                self.parts.truncate(n);
                // The first part is shown pixel by pixel, slices may be enlarged.
                let filter = if n == 0 { wgpu::FilterMode::Nearest } else { wgpu::FilterMode::Linear };
                self.parts.push(self.sized(state, size, filter));
            }
            let layout = wgpu::TexelCopyBufferLayout {
                offset: 4 * (u64::from(x) + u64::from(image.width) * u64::from(y)),
                bytes_per_row: Some(4 * image.width),
                rows_per_image: None,
            };
            state.queue.write_texture(self.parts[n].0.as_image_copy(), &image.rgba, layout, size);
        }
    }

    fn sized(
        &self,
        state: &RenderState,
        size: wgpu::Extent3d,
        filter: wgpu::FilterMode,
    ) -> (wgpu::Texture, wgpu::BindGroup) {
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
        let sampler = state.device.create_sampler(&wgpu::SamplerDescriptor {
            mag_filter: filter,
            min_filter: filter,
            ..Default::default()
        });
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
