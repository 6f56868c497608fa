//! One picture of the window: input → session → renderer → panel.

use super::capture::Captures;
use super::input::{Pointer, ViewAndTool};
use super::keys::{self, Command};
use super::look::Look;
use super::panel::{self, Clicks, Traces};
use super::quality::Quality;
use super::{Draws, Lent, Panel, Playback, Session, Shared, Start, WindowInput, banner, timeline};
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
const PANEL_WIDTH: f32 = 270.0;
/// Scale of large type.
const LARGE: f32 = 1.4;

/// The application behind the window.
pub(super) struct Window<S, D> {
    lent: Lent<S, D>,
    start: Start,
    hand: ViewAndTool,
    traces: Traces,
    panel: Panel,
    clicks: Clicks,
    look: Look,
    captures: Captures,
    help: bool,
    large: bool,
    playback: Option<Playback>,
    #[cfg(feature = "sound")]
    audio: super::loudspeaker::AudioOutput,
    screen: Screen,
    quality: Quality,
    drawn_at: f64,
    over: bool,
}

impl<S: Session, D: Draws> Window<S, D> {
    pub fn new(lent: Lent<S, D>, start: Start, copies: bool) -> Self {
        let hardware = lent.borrow().as_ref().and_then(|s| s.renderer.device()).is_some_and(|gpu| !gpu.is_software());
        Self {
            lent,
            hand: ViewAndTool { world_from_tool: start.world_from_tool, camera: start.camera },
            traces: Traces::default(),
            panel: Panel::default(),
            clicks: Clicks::default(),
            look: Look::with(start.microscope),
            start,
            captures: Captures::default(),
            help: false,
            large: false,
            playback: None,
            #[cfg(feature = "sound")]
            audio: Default::default(),
            screen: if copies { Screen::Copies(None) } else { Screen::Shares(None) },
            quality: Quality::new(!hardware, start.detail),
            drawn_at: 0.0,
            over: false,
        }
    }

    /// Whether the session is finished, cannot be drawn, or was closed by the user.
    pub fn is_over(&self) -> bool {
        self.over
    }

    /// Draws one picture of the whole window.
    pub fn show(&mut self, ui: &mut egui::Ui, state: Option<&RenderState>) {
        let lent = self.lent.clone();
        let mut lent = lent.borrow_mut();
        let Some(shared) = lent.as_mut() else { return };
        self.captures.turn(ui.ctx(), &mut shared.session);
        self.react(ui);
        self.update(ui, shared);
        egui::Panel::right("panel").exact_size(PANEL_WIDTH).resizable(false).show(ui, |ui| {
            let (camera, filming) = (&mut self.hand.camera, self.captures.filming());
            self.clicks = panel::show(ui, &self.panel, &mut self.traces, &mut self.look, camera, filming);
        });
        self.playback = self.panel.timeline.as_ref().and_then(|timeline| timeline::show(ui, timeline));
        let picture = egui::CentralPanel::default().frame(egui::Frame::NONE);
        let over = picture.show(ui, |ui| self.picture(ui, state, shared)).response.rect;
        banner::show(ui, over, &self.panel.warnings, &self.panel.news);
        if self.help {
            keys::help(ui.ctx(), &self.panel.actions);
        }
        self.over |= shared.fault.is_some();
        ui.request_repaint_after(Duration::from_secs_f32(1.0 / self.start.rate_hz.clamp(1.0, 240.0)));
    }

    /// Handles keys and clicks that concern the window itself.
    fn react(&mut self, ui: &egui::Ui) {
        let mut commands = std::mem::take(&mut self.clicks.commands);
        ui.input(|input| commands.extend(keys::pressed(input)));
        for &command in &commands {
            match command {
                Command::Reset => self.hand.camera = self.look.home(self.start.camera, self.start.microscope),
                Command::Picture => self.captures.ask(),
                Command::Film => self.captures.film(),
                Command::Help => self.help ^= true,
                Command::LargeType => self.enlarge(ui),
                #[cfg(feature = "sound")]
                Command::Mute => self.audio.muted ^= true,
                Command::Quit if std::mem::take(&mut self.help) => (),
                Command::Quit => self.over = true,
                of_view => self.look.react(of_view, &mut self.hand.camera),
            }
        }
        self.clicks.commands = commands;
    }

    fn enlarge(&mut self, ui: &egui::Ui) {
        self.large ^= true;
        ui.set_zoom_factor(if self.large { LARGE } else { 1.0 });
    }

    /// Updates the session.
    fn update(&mut self, ui: &egui::Ui, shared: &mut Shared<S, D>) {
        let requested = |command| self.clicks.commands.contains(&command);
        let actions = self.panel.actions.iter().enumerate();
        let input = ui.input(|i| WindowInput {
            world_from_tool: self.hand.world_from_tool,
            pedal: i.key_down(egui::Key::Space) || self.clicks.pedal,
            next_tool: requested(Command::NextTool),
            undo: requested(Command::Undo),
            chosen: self.clicks.chosen,
            actions: actions
                .filter(|(_, action)| keys::of_action(action).is_some_and(|key| i.key_pressed(key)))
                .fold(self.clicks.actions, |bits, (at, _)| bits | 1 << at),
            playback: self.playback,
            camera: self.hand.camera,
            seconds: i.time,
        });
        self.panel = shared.session.update(&input);
        #[cfg(feature = "sound")]
        self.panel.values.extend(self.audio.play(self.panel.sound).map(|why| ("sound".into(), why)));
        self.panel.leash.into_iter().for_each(|leash| self.hand.hold(leash));
        let now = self.panel.timeline.as_ref().map_or(input.seconds, |timeline| timeline.at_s);
        self.traces.force.push(now, self.panel.force_n.into());
        self.traces.rate.push(now, self.panel.rate_hz.into());
        self.over |= self.panel.finished;
    }

    /// Draws the picture for an area of the window and shows it there.
    fn picture(&mut self, ui: &mut egui::Ui, state: Option<&RenderState>, shared: &mut Shared<S, D>) {
        let space = ui.available_size().max(egui::vec2(8.0, 8.0));
        let (area, response) = ui.allocate_exact_size(space, egui::Sense::click_and_drag());
        let now = ui.input(|i| i.time);
        self.quality.note(now - self.drawn_at);
        self.drawn_at = now;
        let scale = ui.pixels_per_point();
        let pixels = [space.x, space.y].map(|s| (s * scale).round().max(1.0) as u32);
        let frame = self.look.on(shared.session.frame(self.hand.camera));
        match self.screen.show(ui, state, &mut shared.renderer, &frame, pixels, self.quality.detail()) {
            Err(error) => shared.fault = Some(error.to_string()),
            Ok((view, id)) => {
                let pointer = Pointer::over(ui, &response);
                self.hand.follow(&pointer, &view, space.y);
                // A focused slider takes the arrow keys.
                if ui.memory(|memory| memory.focused().is_none()) {
                    ui.input(|i| self.hand.keys(i, &view));
                }
                let whole = egui::Rect::from_min_max(egui::pos2(0.0, 0.0), egui::pos2(1.0, 1.0));
                ui.painter().image(id, area, whole, egui::Color32::WHITE);
                shared.shown = true;
            }
        }
    }
}

/// Why a frame is not shown.
#[derive(Debug, thiserror::Error)]
enum ShowError {
    /// The window was opened without a graphics device.
    #[error("the window has no graphics device")]
    NoDevice,
    /// Rendering failed.
    #[error(transparent)]
    Render(#[from] RenderError),
}

impl Screen {
    /// Draws a frame and returns the window's texture of it.
    fn show(
        &mut self,
        ui: &egui::Ui,
        state: Option<&RenderState>,
        renderer: &mut impl Draws,
        frame: &Frame<'_>,
        pixels: [u32; 2],
        detail: f32,
    ) -> Result<(View, egui::TextureId), ShowError> {
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
        let state = state.ok_or(ShowError::NoDevice)?;
        let view = renderer.draw(frame, pixels, detail)?;
        if let Some(drawn) = renderer.texture() {
            return Ok((view, registered(texture, state, drawn.view())));
        }
        // The processor has taken over: its pictures are copied from now on.
        *self = Self::Copies(None);
        self.show(ui, Some(state), renderer, frame, pixels, detail)
    }
}

/// Registers the renderer's texture, again when it changed.
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
        self.show(ui, frame.wgpu_render_state());
        if self.over {
            ui.send_viewport_cmd(egui::ViewportCommand::Close);
        }
    }
}
