//! One picture of the window: input → session → renderer → panel.

use super::input::{Hand, Pointer};
use super::plot::Trace;
use super::quality::Quality;
use super::{Draws, Lent, Panel, Session, Shared, Start, WindowInput, banner, panel};
use crate::{Frame, RenderError, View};
use eframe::egui_wgpu::RenderState;
use eframe::{egui, wgpu};
use std::time::Duration;

/// How the picture gets into the window.
enum Screen {
    /// The renderer's own texture is shown.
    Shares(Option<(egui::TextureId, wgpu::TextureView)>),
    /// Every picture is copied into one of the window's textures.
    Copies(Option<egui::TextureHandle>),
}

/// Width of the side panel, points.
const PANEL_WIDTH: f32 = 250.0;

/// The application behind the window.
pub(super) struct Window<S, D> {
    lent: Lent<S, D>,
    start: Start,
    hand: Hand,
    force: Trace,
    panel: Panel,
    clicks: panel::Clicks,
    screen: Screen,
    quality: Quality,
    drawn_at: f64,
}

impl<S: Session, D: Draws> Window<S, D> {
    pub fn new(context: &eframe::CreationContext<'_>, lent: Lent<S, D>, start: Start, copies: bool) -> Self {
        context.egui_ctx.set_visuals(egui::Visuals::dark());
        let hand = Hand { world_from_tool: start.world_from_tool, camera: start.camera };
        let hardware = lent.borrow().as_ref().and_then(|s| s.renderer.device()).is_some_and(|gpu| !gpu.is_software());
        let quality = Quality::new(!hardware);
        let force = Trace::over(panel::SECONDS_SHOWN);
        Self {
            lent,
            start,
            hand,
            force,
            panel: Panel::default(),
            clicks: Default::default(),
            screen: if copies { Screen::Copies(None) } else { Screen::Shares(None) },
            quality,
            drawn_at: 0.0,
        }
    }

    /// Asks the session what is new.
    fn update(&mut self, ui: &egui::Ui, shared: &mut Shared<S, D>) {
        let input = ui.input(|i| WindowInput {
            world_from_tool: self.hand.world_from_tool,
            pedal: i.key_down(egui::Key::Space) || self.clicks.pedal,
            next_tool: i.key_pressed(egui::Key::N) || self.clicks.next_tool,
            undo: i.key_pressed(egui::Key::U) || self.clicks.undo,
            camera: self.hand.camera,
            seconds: i.time,
        });
        self.panel = shared.session.update(&input);
        self.panel.leash.into_iter().for_each(|leash| self.hand.hold(leash));
        self.force.push(input.seconds, self.panel.force_n.into());
    }

    /// Acts on what concerns the window itself.
    fn react(&mut self, ui: &egui::Ui) {
        let pressed = |key| ui.input(|i| i.key_pressed(key));
        if self.clicks.reset || pressed(egui::Key::R) {
            self.hand.camera = self.start.camera;
        }
        if self.clicks.quit || self.panel.finished || pressed(egui::Key::Q) || pressed(egui::Key::Escape) {
            ui.ctx().send_viewport_cmd(egui::ViewportCommand::Close);
        }
    }

    /// Draws the picture for an area of the window and shows it there.
    fn picture(&mut self, ui: &mut egui::Ui, state: &RenderState, shared: &mut Shared<S, D>) {
        let space = ui.available_size().max(egui::vec2(8.0, 8.0));
        let (area, response) = ui.allocate_exact_size(space, egui::Sense::click_and_drag());
        let now = ui.input(|i| i.time);
        self.quality.note(now - self.drawn_at);
        self.drawn_at = now;
        let scale = ui.ctx().pixels_per_point();
        let pixels = [space.x, space.y].map(|s| (s * scale).round().max(1.0) as u32);
        let frame = shared.session.frame(self.hand.camera);
        match self.screen.show(ui, state, &mut shared.renderer, &frame, pixels, self.quality.detail()) {
            Err(error) => shared.fault = Some(error.to_string()),
            Ok((view, id)) => {
                let pointer = Pointer::over(ui, &response);
                self.hand.follow(&pointer, &view, space.y);
                ui.input(|i| self.hand.keys(i, &view));
                let whole = egui::Rect::from_min_max(egui::pos2(0.0, 0.0), egui::pos2(1.0, 1.0));
                ui.painter().image(id, area, whole, egui::Color32::WHITE);
                shared.shown = true;
            }
        }
    }
}

impl Screen {
    /// Draws a frame and gives the window's texture of it.
    fn show(
        &mut self,
        ui: &egui::Ui,
        state: &RenderState,
        renderer: &mut impl Draws,
        frame: &Frame<'_>,
        pixels: [u32; 2],
        detail: f32,
    ) -> Result<(View, egui::TextureId), RenderError> {
        let texture = match self {
            Self::Shares(texture) => texture,
            Self::Copies(copy) => {
                let (view, image) = renderer.picture(frame, pixels, detail)?;
                let size = [image.width as usize, image.height as usize];
                let image = egui::ColorImage::from_rgba_unmultiplied(size, &image.rgba);
                let linear = egui::TextureOptions::LINEAR;
                let copy =
                    copy.get_or_insert_with(|| ui.ctx().load_texture("picture", egui::ColorImage::default(), linear));
                copy.set(image, linear);
                return Ok((view, copy.id()));
            }
        };
        let view = renderer.draw(frame, pixels, detail)?;
        if let Some(drawn) = renderer.texture() {
            return Ok((view, registered(texture, state, drawn.view())));
        }
        // The processor has taken over: from now on its pictures are copied.
        *self = Self::Copies(None);
        self.show(ui, state, renderer, frame, pixels, detail)
    }
}

/// Registers the renderer's texture, anew when it is another one.
fn registered(
    texture: &mut Option<(egui::TextureId, wgpu::TextureView)>,
    state: &RenderState,
    view: &wgpu::TextureView,
) -> egui::TextureId {
    if let Some((id, shown)) = texture {
        if shown == view {
            return *id;
        }
        state.renderer.write().free_texture(id);
    }
    let id = state.renderer.write().register_native_texture(&state.device, view, wgpu::FilterMode::Linear);
    *texture = Some((id, view.clone()));
    id
}

impl<S: Session, D: Draws> eframe::App for Window<S, D> {
    fn ui(&mut self, ui: &mut egui::Ui, frame: &mut eframe::Frame) {
        let lent = self.lent.clone();
        let mut lent = lent.borrow_mut();
        let Some(shared) = lent.as_mut() else { return };
        self.update(ui, shared);
        self.react(ui);
        banner::show(ui, &self.panel.warnings);
        egui::Panel::right("panel").exact_size(PANEL_WIDTH).resizable(false).show(ui, |ui| {
            self.clicks = panel::show(ui, &self.panel, &self.force);
        });
        egui::CentralPanel::default().frame(egui::Frame::NONE).show(ui, |ui| match frame.wgpu_render_state() {
            Some(state) => self.picture(ui, state, shared),
            None => shared.fault = Some("the window has no graphics device".into()),
        });
        if shared.fault.is_some() {
            ui.ctx().send_viewport_cmd(egui::ViewportCommand::Close);
        }
        ui.ctx().request_repaint_after(Duration::from_secs_f32(1.0 / self.start.rate_hz.clamp(1.0, 240.0)));
    }
}
