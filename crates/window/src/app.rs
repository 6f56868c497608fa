//! One picture of the window: input → session → renderer → panel.

use crate::answers::{self, Answers};
use crate::capture::Captures;
use crate::guide::{Around, Guide};
use crate::input::ViewAndTool;
use crate::keys::{self, Command};
use crate::look::Look;
use crate::panel::{self, Clicks, Traces};
use crate::pointer::{Pointer, view_area};
use crate::quality::{Quality, Step};
use crate::screen::{Area, Screen};
use crate::surface::{Ray, Surfaces};
use crate::{Draws, Panel, Playback, Session, Shared, SharedCell, Start, WindowInput, aids, banner, slices, timeline};
use eframe::egui;
use eframe::egui_wgpu::RenderState;
use glam::Vec3;
use std::time::{Duration, Instant};
use trepan_geometry::Aabb;
use trepan_render::Plane;
use trepan_render::{Frame, View};

/// First and least width of the side panel, points; at most half of the window.
const PANEL_WIDTH: f32 = 270.0;
const PANEL_LEAST: f32 = 180.0;
/// Longest time between pictures that the tool is led by, s. A slow picture must not slow the feed.
const LONGEST_S: f32 = 0.4;
/// Largest height of the slices' own window, points.
const SLICES_HIGH: f32 = 900.0;
/// Scale of large type.
pub(crate) const LARGE: f32 = 1.4;

/// The application behind the window.
pub(crate) struct Window<S, D> {
    lent: SharedCell<S, D>,
    start: Start,
    hand: ViewAndTool,
    traces: Traces,
    panel: Panel,
    clicks: Clicks,
    look: Look,
    captures: Captures,
    pub(crate) answers: Answers,
    /// The tool's tip as contact allows it, world mm.
    tip: Vec3,
    help: bool,
    playback: Option<Playback>,
    #[cfg(feature = "sound")]
    audio: crate::loudspeaker::AudioOutput,
    screen: Screen,
    quality: Quality,
    /// The view of the last picture.
    last: Option<View>,
    /// Time of the last picture, s.
    pub(crate) drawn_at: f64,
    /// Time from the picture before to that, s.
    dt_s: f32,
    /// Whether the user is asked if the session shall end.
    asks: bool,
    over: bool,
}

/// Whether type is large, in sessions and on pages alike.
fn is_large(ui: &egui::Ui) -> bool {
    ui.ctx().zoom_factor() > 1.0
}

impl<S: Session, D: Draws> Window<S, D> {
    pub fn new(lent: SharedCell<S, D>, start: Start, copies: bool) -> Self {
        let hardware = lent.borrow().as_ref().and_then(|s| s.renderer.device()).is_some_and(|gpu| !gpu.is_software());
        let head = lent.borrow().as_ref().map(|shared| shared.renderer.bounds());
        Self {
            lent,
            hand: ViewAndTool { world_from_tool: start.world_from_tool, camera: start.camera, guide: Guide::default() },
            traces: Traces::default(),
            panel: Panel::default(),
            clicks: Clicks::default(),
            look: Look::with(start.microscope, head),
            start,
            captures: Captures::default(),
            answers: Answers::default(),
            tip: start.world_from_tool.translation,
            help: false,
            playback: None,
            #[cfg(feature = "sound")]
            audio: Default::default(),
            screen: Screen::new(copies),
            quality: Quality::new(!hardware, start.detail),
            last: None,
            drawn_at: 0.0,
            dt_s: 0.0,
            asks: false,
            over: false,
        }
    }

    /// Whether the session is finished, cannot be drawn, or was closed by the user.
    pub fn is_over(&self) -> bool {
        self.over
    }

    /// Draws one picture of the whole window.
    pub fn show(&mut self, ui: &mut egui::Ui, state: Option<&RenderState>) {
        let (lent, began) = (self.lent.clone(), Instant::now());
        let mut lent = lent.borrow_mut();
        let Some(shared) = lent.as_mut() else { return };
        self.captures.turn(ui.ctx(), &mut shared.session);
        self.react(ui);
        self.update(ui, shared);
        let widest = 0.5 * ui.available_width();
        let side = egui::Panel::right("panel").default_size(PANEL_WIDTH.min(widest));
        let frame = panel::frame(ui);
        side.size_range(PANEL_LEAST.min(widest)..=widest).frame(frame).show(ui, |ui| {
            let filming = self.captures.filming();
            self.clicks = panel::show(ui, &self.panel, &mut self.traces, &mut self.look, &mut self.hand, filming);
        });
        self.playback = self.panel.timeline.as_ref().and_then(|timeline| timeline::show(ui, timeline));
        let picture = egui::CentralPanel::default().frame(egui::Frame::NONE);
        let over = picture.show(ui, |ui| self.picture(ui, state, shared)).response.rect;
        if let Some(playback) = self.playback {
            self.answers.give(answers::played(playback), self.drawn_at);
        }
        banner::show(ui, over, &self.panel, self.answers.standing(self.drawn_at));
        if self.help {
            keys::help(ui.ctx(), &self.panel.actions);
        }
        self.ask(ui);
        self.over |= shared.fault.is_some();
        let rate_hz = self.start.rate_hz.min(self.quality.most_hz());
        let period = Duration::from_secs_f32(1.0 / rate_hz.clamp(1.0, 240.0));
        ui.request_repaint_after(period.saturating_sub(began.elapsed()));
    }

    /// Handles keys and clicks that concern the window itself.
    fn react(&mut self, ui: &egui::Ui) {
        let mut commands = std::mem::take(&mut self.clicks.commands);
        ui.input(|input| commands.extend(keys::pressed(input)));
        let now = ui.input(|i| i.time);
        if let Some(why) = ui.input(|i| answers::unused_key(i, &self.panel)) {
            self.answers.give(why, now);
        }
        for &command in &commands {
            if let Some(why) = answers::refusal(command, &self.panel, &self.look) {
                self.answers.give(format!("{}: {why}", keys::name(command)), now);
                continue;
            }
            match command {
                Command::Reset => self.hand.camera = self.look.home(self.start.camera, self.start.microscope),
                Command::FocusTool => self.hand.camera.target = self.tip,
                // A stroke is undone once the tool is out of its bone.
                Command::Withdraw | Command::Undo => self.hand.guide.withdraws = true,
                Command::Picture => self.captures.ask(),
                Command::Film => self.captures.film(),
                Command::Help => self.help ^= true,
                Command::LargeType => self.enlarge(ui),
                Command::Light => self.light(ui),
                Command::FullScreen => self.fill(ui),
                #[cfg(feature = "sound")]
                Command::Mute => self.audio.muted ^= true,
                Command::Close if std::mem::take(&mut self.help) || std::mem::take(&mut self.asks) => (),
                Command::Close if self.panel.by_hand => {
                    self.hand.guide.withdraws = true;
                    self.answers.give(keys::name(Command::Withdraw).into(), now);
                    continue;
                }
                Command::Close => (),
                // Closing a replay loses nothing.
                Command::Quit if self.panel.timeline.is_some() => self.over = true,
                Command::Quit => self.asks = true,
                of_view => self.look.react(of_view, &mut self.hand.camera),
            }
            self.answers.give(answers::done(command, keys::name(command), &self.look, is_large(ui)), now);
        }
        commands.retain(|command| answers::refusal(*command, &self.panel, &self.look).is_none());
        self.clicks.commands = commands;
    }

    /// Asks once whether the session shall end, also where the window is to be closed.
    fn ask(&mut self, ui: &egui::Ui) {
        let closes = ui.input(|input| input.viewport().close_requested());
        if closes && !self.asks && self.panel.timeline.is_none() && !self.over {
            ui.send_viewport_cmd(egui::ViewportCommand::CancelClose);
            self.asks = true;
        }
        if !self.asks {
            return;
        }
        match keys::end(ui.ctx()) {
            Some(true) => self.over = true,
            Some(false) => self.asks = false,
            None => (),
        }
    }

    fn enlarge(&mut self, ui: &egui::Ui) {
        ui.set_zoom_factor(if is_large(ui) { 1.0 } else { LARGE });
    }

    fn light(&mut self, ui: &egui::Ui) {
        let dark = ui.visuals().dark_mode;
        ui.set_theme(if dark { egui::Theme::Light } else { egui::Theme::Dark });
    }

    fn fill(&mut self, ui: &egui::Ui) {
        let fills = ui.input(|i| i.viewport().fullscreen.unwrap_or(false));
        ui.send_viewport_cmd(egui::ViewportCommand::Fullscreen(!fills));
    }

    /// Updates the session.
    fn update(&mut self, ui: &egui::Ui, shared: &mut Shared<S, D>) {
        let requested = |command| self.clicks.commands.contains(&command);
        let actions = self.panel.actions.iter().enumerate();
        let input = ui.input(|i| WindowInput {
            world_from_tool: self.hand.world_from_tool,
            pedal: i.key_down(egui::Key::Space) || self.clicks.pedal || self.hand.guide.pedal(),
            next_tool: requested(Command::NextTool),
            undo: requested(Command::Undo),
            redo: requested(Command::Redo),
            chosen: self.clicks.chosen.or_else(|| self.numbered(i)),
            actions: actions
                .filter(|(_, action)| action.why_not.is_none())
                .filter(|(_, action)| keys::of_action(action).is_some_and(|key| i.key_pressed(key)))
                .fold(self.clicks.actions, |bits, (at, _)| bits | 1 << at),
            playback: self.playback,
            camera: self.hand.camera,
            seconds: i.time,
            pace: self.quality.pace,
        });
        self.panel = shared.session.update(&input);
        self.hand.turn_view(&self.panel.knob, 1e3 * self.dt_s);
        #[cfg(feature = "sound")]
        self.panel.values.extend(self.audio.play(self.panel.sound).map(|why| ("sound".into(), why)));
        let now = self.panel.timeline.as_ref().map_or(input.seconds, |timeline| timeline.at_s);
        self.traces.force.push(now, self.panel.force_n.into());
        self.traces.rate.push(now, self.panel.rate_hz.into());
        self.over |= self.panel.finished;
    }

    /// The tool whose number key was pressed.
    fn numbered(&self, input: &egui::InputState) -> Option<[usize; 2]> {
        let slot = answers::NUMBERS.iter().position(|key| input.key_pressed(*key))?;
        let choice = self.panel.choices.first().filter(|choice| !choice.tools.is_empty())?;
        let open = choice.options.get(slot).is_some_and(|(_, why_not)| why_not.is_none()) && choice.chosen != slot;
        open.then_some([0, slot])
    }

    /// Draws the picture for an area of the window and shows it there.
    fn picture(&mut self, ui: &mut egui::Ui, state: Option<&RenderState>, shared: &mut Shared<S, D>) {
        let space = ui.available_size().max(egui::vec2(8.0, 8.0));
        let (area, response) = ui.allocate_exact_size(space, egui::Sense::click_and_drag());
        let now = ui.input(|i| i.time);
        self.dt_s = ((now - self.drawn_at) as f32).clamp(0.0, LONGEST_S);
        self.drawn_at = now;
        let scale = ui.pixels_per_point();
        let pixels = [space.x, space.y].map(|s| (s * scale).round().max(1.0) as u32);
        let frame = self.look.on(shared.session.frame(self.hand.camera));
        let parts = Area::of(pixels, self.look.apart && frame.slices.shown);
        let stale = shared.renderer.is_stale();
        let (step, began) = (self.quality.step(&frame, parts.size, stale, now), Instant::now());
        let shown = match (step, self.last) {
            (Step::Keep, Some(last)) => Ok(last),
            (Step::Refine, Some(last)) => {
                if !self.screen.refine(state, &mut shared.renderer, &frame) {
                    self.quality.complete();
                }
                Ok(last)
            }
            (Step::Draw(detail), _) => self.screen.draw(ui, state, &mut shared.renderer, &frame, &parts, detail),
            _ => self.screen.draw(ui, state, &mut shared.renderer, &frame, &parts, 1.0),
        };
        // A device draws while this thread goes on.
        self.quality.note(began.elapsed().as_secs_f64().max(shared.renderer.took_s()), now);
        match shown {
            Err(error) => shared.fault = Some(error.to_string()),
            Ok(view) => {
                self.last = Some(view);
                self.screen.paint(ui, area, 0);
                let chosen = match parts.slices_aspect() {
                    Some(aspect) => self.slices(ui, aspect, (&frame, shared.renderer.bounds())),
                    None => {
                        let left = view_area(area, &view).right();
                        let column = egui::Rect::from_min_max(egui::pos2(left, area.top()), area.max);
                        let ours = response.hovered() || response.is_pointer_button_down_on();
                        self.on_slices(ui, column, (&frame, shared.renderer.bounds()), ours)
                    }
                };
                if let Some(point) = chosen {
                    self.look.slices.through = Some(point);
                }
                self.lead(ui, &response, &view, &shared.session);
                let corner = area.left_bottom() + egui::vec2(6.0, -4.0);
                let (font, grey) = (egui::TextStyle::Small.resolve(ui.style()), egui::Color32::from_gray(170));
                ui.painter().text(
                    corner,
                    egui::Align2::LEFT_BOTTOM,
                    crate::words::tr(&self.quality.text()),
                    font,
                    grey,
                );
                shared.shown = true;
            }
        }
    }

    /// Shows the slices in a window of their own, for another screen; returns the point that the
    /// mouse chooses there.
    fn slices(&mut self, ui: &egui::Ui, aspect: f32, scene: (&Frame, Aabb)) -> Option<Vec3> {
        let id = egui::ViewportId::from_hash_of("slices");
        let screen_height = ui.input(|input| input.viewport().monitor_size).map_or(SLICES_HIGH, |size| 0.85 * size.y);
        let height = screen_height.min(SLICES_HIGH);
        let window = egui::ViewportBuilder::default()
            .with_title(crate::words::tr("Slices"))
            .with_inner_size([height * aspect, height]);
        ui.ctx().show_viewport_immediate(id, window, |ui, _| {
            let space = ui.max_rect();
            let size =
                egui::vec2(space.width().min(space.height() * aspect), space.height().min(space.width() / aspect));
            let column = egui::Rect::from_center_size(space.center(), size);
            self.screen.paint(ui, column, 1);
            self.look.apart &= !ui.input(|input| input.viewport().close_requested());
            self.on_slices(ui, column, scene, true)
        })
    }

    /// Draws the marks of the slices in a column, and returns the point that the mouse chooses
    /// there if the input is `ours`.
    fn on_slices(
        &self,
        ui: &egui::Ui,
        column: egui::Rect,
        (frame, bounds): (&Frame, Aabb),
        ours: bool,
    ) -> Option<Vec3> {
        if !frame.slices.shown || column.width() < 1.0 {
            return None;
        }
        let [width, height] = [column.width(), column.height() / 3.0].map(|points| points.round().max(1.0) as u32);
        let rectangles = [[0, 0, width, height]; 3];
        let planes = Plane::three(frame.focus(bounds), bounds, frame.slices.half_height_mm, &rectangles);
        let brain = frame.brain_positions.is_some_and(|positions| !positions.is_empty());
        slices::marks(ui, column, &planes, self.look.slices.through.is_some(), brain);
        ours.then(|| slices::chosen(ui, column, &planes)).flatten()
    }

    /// Moves view and tool by pointer and keys, and draws where the tool will land.
    fn lead(&mut self, ui: &egui::Ui, response: &egui::Response, view: &View, session: &S) {
        let frame = self.look.on(session.frame(self.hand.camera));
        let pointer = Pointer::over(ui, response, view);
        self.hand.follow(&pointer, view, response.rect.height());
        // A focused slider takes the arrow keys.
        if ui.memory(|memory| memory.focused().is_none()) {
            ui.input(|i| self.hand.keys(i, view));
        }
        let Some(tool) = frame.tool.filter(|_| self.panel.timeline.is_none()) else { return };
        let cast = |ray: &Ray| session.surface(ray);
        let around = Around {
            surfaces: Surfaces::new(&cast, [frame.show_bone, frame.show_brain], frame.cut),
            view,
            tool,
            world_from_tool: frame.world_from_tool,
            dt_s: self.dt_s,
            pedal: ui.input(|i| i.key_down(egui::Key::Space)) || self.clicks.pedal,
        };
        self.tip = frame.world_from_tool.translation;
        let ViewAndTool { world_from_tool, guide, .. } = &mut self.hand;
        guide.follow(world_from_tool, &pointer, &around);
        guide.through().into_iter().for_each(|text| self.answers.give(text.into(), self.drawn_at));
        if let Some(leash) = self.panel.leash {
            self.hand.hold(leash, &around.surfaces, tool.tip_radius_mm);
        }
        aids::show(ui, response.rect, &around, &self.panel, self.hand.guide.is_pressed());
    }
}

impl<S: Session, D: Draws> eframe::App for Window<S, D> {
    fn ui(&mut self, ui: &mut egui::Ui, frame: &mut eframe::Frame) {
        self.show(ui, frame.wgpu_render_state());
        if self.over {
            ui.send_viewport_cmd(egui::ViewportCommand::Close);
        }
    }

    fn clear_color(&self, visuals: &egui::Visuals) -> [f32; 4] {
        panel::background(visuals)
    }
}
