//! A page of the window as data: texts, buttons, choices, pictures. The window draws it and returns
//! the actions of what the user pressed.
//!
//! # Practice
//! A page is made anew for every picture, so it always shows the state it was made of. It scrolls
//! where the window is too small, and stands in one column where the window is narrow.
//!
//! # When not to use it
//! For a running session: its picture and panel are a [`Session`](crate::Session).

use crate::app::LARGE;
use crate::palette::{GREEN, ORANGE, SKY, VERMILION, ink, legible, pale};
use crate::words::tr;
use eframe::egui::{self, Color32, RichText};
use std::sync::Arc;
use trepan_render::Image;

/// A page; `A` is what a press of one of its controls does.
#[derive(Clone, Debug)]
pub struct Page<A> {
    /// The title on top.
    pub title: String,
    /// One line below it.
    pub line: String,
    /// Columns from left to right; one below the other in a narrow window.
    pub columns: Vec<Vec<Item<A>>>,
    /// Controls that stay in view at the bottom.
    pub foot: Vec<Item<A>>,
    /// The action of Escape, if it does something.
    pub escape: Option<A>,
    /// Whether it fills the window, so that nothing moves when its length changes.
    pub steady: bool,
}

impl<A> Default for Page<A> {
    fn default() -> Self {
        let (title, line, steady) = Default::default();
        Self { title, line, columns: Vec::new(), foot: Vec::new(), escape: None, steady }
    }
}

/// Part of a page.
#[derive(Clone, Debug)]
pub enum Item<A> {
    /// Heading of a part.
    Heading(String),
    /// A paragraph.
    Text(String),
    /// A paragraph of secondary text.
    Note(String),
    /// A verdict: passed or not, in words and colour.
    Verdict(bool, String),
    /// A text with a patch of a colour.
    Label(String, [u8; 3]),
    /// A remark that must be seen.
    Alert(String),
    /// A button.
    Button(Button<A>),
    /// Parts beside each other, which wrap.
    Row(Vec<Item<A>>),
    /// Free space in a row, as wide as a picture beside it.
    Gap,
    /// Switches for large letters and light colours, of the whole window.
    Look,
    /// One of several options: name, options, index of the chosen one.
    Choice(String, Vec<Choosable>, usize, fn(usize) -> A),
    /// A line of text: name, value, what stands in the empty field.
    Field(String, String, String, fn(String) -> A),
    /// A number on a slider.
    Amount(Amount, fn(f32) -> A),
    /// A share of work that is done, 0 to 1, with a text.
    Progress(f32, String),
    /// A picture.
    Picture(Picture<A>),
    /// Rows of equal length; the first is the heading.
    Table(Vec<Vec<String>>),
    /// Values in their order, as a curve with its title.
    Curve(String, Vec<f64>),
}

/// A button on a page.
#[derive(Clone, Debug)]
pub struct Button<A> {
    /// Its label.
    pub name: String,
    /// What it does, in a sentence; or why it cannot be used now.
    pub hint: String,
    /// Whether it is the usual next step.
    pub main: bool,
    /// Its action; `None` where it cannot be used.
    pub does: Option<A>,
    /// Whether the label is the name of something, the same in every language.
    pub is_name: bool,
}

/// An option of a choice.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Choosable {
    /// Its label.
    pub name: String,
    /// What it means, or why it cannot be chosen.
    pub hint: String,
    /// Whether it can be chosen.
    pub open: bool,
}

/// A number and its range.
#[derive(Clone, Debug, PartialEq)]
pub struct Amount {
    /// Name with the unit.
    pub name: String,
    /// Its value.
    pub value: f32,
    /// Smallest and largest value.
    pub range: [f32; 2],
    /// Size of a step.
    pub step: f32,
}

/// A picture on a page.
#[derive(Clone, Debug)]
pub struct Picture<A> {
    /// Name for people who do not see it.
    pub name: String,
    /// The picture; the same allocation means that it did not change.
    pub image: Arc<Image>,
    /// Largest height, points.
    pub height: f32,
    /// Letters on it: position as a share of width and height, text.
    pub letters: Vec<([f32; 2], String)>,
    /// The action of a click at a position, a share of width and height.
    pub clicked: Option<fn([f32; 2]) -> A>,
    /// The action of a drag.
    pub dragged: Option<fn(Drag) -> A>,
    /// The action of the wheel, by notches; the page does not scroll under it.
    pub scrolled: Option<fn(f32) -> A>,
}

/// What a drag over a picture did since the last time.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Drag {
    /// Its way, a share of width and height.
    pub by: [f32; 2],
    /// Where the pointer is, a share of width and height.
    pub at: [f32; 2],
    /// Whether the left button leads it.
    pub left: bool,
    /// Whether it begins now.
    pub begins: bool,
    /// Whether it is over.
    pub ends: bool,
}

impl<A> Item<A> {
    /// A button that can be used.
    pub fn button(name: impl Into<String>, hint: impl Into<String>, does: A) -> Self {
        Self::Button(Button { name: name.into(), hint: hint.into(), main: false, does: Some(does), is_name: false })
    }

    /// A button with the name of a file or a case, which is shown as it is.
    pub fn named(name: impl Into<String>, hint: impl Into<String>, does: A) -> Self {
        Self::Button(Button { name: name.into(), hint: hint.into(), main: false, does: Some(does), is_name: true })
    }

    /// The button of the usual next step.
    pub fn main(name: impl Into<String>, hint: impl Into<String>, does: A) -> Self {
        Self::Button(Button { name: name.into(), hint: hint.into(), main: true, does: Some(does), is_name: false })
    }

    /// A button that cannot be used now, and why.
    pub fn closed(name: impl Into<String>, why: impl Into<String>) -> Self {
        Self::Button(Button { name: name.into(), hint: why.into(), main: false, does: None, is_name: false })
    }
}

/// Width of a column below which columns stand below each other, points.
const NARROW: f32 = 300.0;
/// Largest width of a page of one, two and three columns, points.
const WIDEST: [f32; 3] = [760.0, 1180.0, 1280.0];
/// Share of the free height that stands above a page.
const ABOVE: f32 = 0.35;
/// Space around parts, and between columns, points.
const GAP: f32 = 8.0;
const BETWEEN: f32 = 28.0;
/// Name of the time at which a picture took the wheel, and for how long it keeps it, s.
const WHEEL: &str = "wheel over a picture";
const WHEEL_S: f64 = 0.3;
/// Points scrolled per notch of the wheel.
const NOTCH: f32 = 40.0;
/// Least width of a picture beside others, points.
const PICTURE_LEAST: f32 = 120.0;

/// Pictures of pages as textures of the window.
#[derive(Default)]
pub(crate) struct Textures(Vec<(String, Arc<Image>, egui::TextureHandle)>);

impl Textures {
    fn of<A>(&mut self, ui: &egui::Ui, picture: &Picture<A>) -> egui::TextureId {
        let image = &picture.image;
        let known = self.0.iter().position(|(name, ..)| *name == picture.name);
        if let Some((.., texture)) = known.map(|at| &self.0[at]).filter(|(_, shown, _)| Arc::ptr_eq(shown, image)) {
            return texture.id();
        }
        known.map(|at| self.0.swap_remove(at));
        let size = [image.width as usize, image.height as usize];
        let colours = egui::ColorImage::from_rgba_unmultiplied(size, &image.rgba);
        let texture = ui.ctx().load_texture(&picture.name, colours, egui::TextureOptions::LINEAR);
        self.0.push((picture.name.clone(), image.clone(), texture));
        self.0[self.0.len() - 1].2.id()
    }
}

/// Draws a page in the middle of the whole area; returns the actions of what was pressed.
pub(crate) fn show<A: Clone>(ui: &mut egui::Ui, page: &Page<A>, textures: &mut Textures) -> Vec<A> {
    let area = ui.available_rect_before_wrap();
    let widest = WIDEST[page.columns.len().clamp(1, WIDEST.len()) - 1];
    let middle = area.shrink2(egui::vec2((0.5 * (area.width() - widest)).max(0.0), 0.0));
    // Its height is known from the pass before.
    let key = egui::Id::unique(("page", &page.title));
    let spare = area.height() - ui.data(|data| data.get_temp::<f32>(key)).unwrap_or(area.height());
    let floats = spare > 0.0 && !page.steady;
    let drawn = ui.scope_builder(egui::UiBuilder::new().max_rect(middle), |ui| {
        if floats {
            ui.add_space(ABOVE * spare);
        }
        parts(ui, page, textures, floats)
    });
    let (done, height) = drawn.inner;
    if ui.data(|data| data.get_temp(key)) != Some(height) {
        ui.data_mut(|data| data.insert_temp(key, height));
        // Nobody sees it at the wrong height.
        ui.ctx().request_discard("the height of the page");
        ui.request_repaint();
    }
    done
}

/// Draws a page as a strip that is no higher than its content.
pub(crate) fn strip<A: Clone>(ui: &mut egui::Ui, page: &Page<A>, textures: &mut Textures) -> Vec<A> {
    parts(ui, page, textures, true).0
}

/// Draws head, columns and foot; returns the actions and the height of all. The foot follows the
/// columns where they float, else it keeps its place at the bottom.
fn parts<A: Clone>(ui: &mut egui::Ui, page: &Page<A>, textures: &mut Textures, floats: bool) -> (Vec<A>, f32) {
    let (mut done, top) = (Vec::new(), ui.cursor().top());
    ui.spacing_mut().item_spacing.y = 5.0;
    if ui.input(|input| input.key_pressed(egui::Key::Escape)) {
        done.extend(page.escape.clone());
    }
    ui.label(RichText::new(tr(&page.title)).size(26.0).strong());
    if !page.line.is_empty() {
        ui.label(RichText::new(tr(&page.line)).size(15.0).color(pale(ui)));
    }
    ui.separator();
    let mut height = ui.cursor().top() - top + GAP;
    if !floats && !page.foot.is_empty() {
        let panel = egui::Panel::bottom("foot").resizable(false).frame(egui::Frame::NONE);
        height += panel.show(ui, |ui| foot(ui, page, textures, &mut done)).inner;
    }
    let (taken, now) = (ui.data(|data| data.get_temp::<f64>(egui::Id::unique(WHEEL))), ui.input(|input| input.time));
    let mouse_wheel = taken.is_none_or(|at| now - at > WHEEL_S);
    let source = egui::containers::scroll_area::ScrollSource { mouse_wheel, ..Default::default() };
    let scroll = egui::ScrollArea::vertical().auto_shrink([false, floats]).scroll_source(source);
    let content = scroll.show(ui, |ui| columns(ui, page, textures, &mut done)).content_size;
    if floats && !page.foot.is_empty() {
        ui.add_space(GAP);
        ui.separator();
        height += foot(ui, page, textures, &mut done);
    }
    (done, height + content.y)
}

/// Draws the foot; returns its height.
fn foot<A: Clone>(ui: &mut egui::Ui, page: &Page<A>, textures: &mut Textures, done: &mut Vec<A>) -> f32 {
    ui.add_space(GAP);
    let row = ui.horizontal_wrapped(|ui| page.foot.iter().for_each(|item| draw(ui, item, textures, done)));
    ui.add_space(GAP);
    row.response.rect.height() + 4.0 * GAP
}

fn columns<A: Clone>(ui: &mut egui::Ui, page: &Page<A>, textures: &mut Textures, done: &mut Vec<A>) {
    let width = ui.available_width() - 12.0;
    let beside = page.columns.len().max(1);
    ui.set_max_width(width);
    if beside > 1 && width / beside as f32 > NARROW {
        ui.spacing_mut().item_spacing.x = BETWEEN;
        ui.columns(beside, |columns| {
            for (ui, items) in columns.iter_mut().zip(&page.columns) {
                ui.spacing_mut().item_spacing.x = GAP;
                items.iter().for_each(|item| draw(ui, item, textures, done));
            }
        });
    } else {
        page.columns.iter().flatten().for_each(|item| draw(ui, item, textures, done));
    }
}

fn draw<A: Clone>(ui: &mut egui::Ui, item: &Item<A>, textures: &mut Textures, done: &mut Vec<A>) {
    match item {
        Item::Heading(text) => {
            ui.add_space(8.0);
            ui.label(RichText::new(tr(text)).size(18.0).strong().color(legible(ui, SKY)));
        }
        Item::Text(text) => paragraph(ui, RichText::new(tr(text)).size(15.0).color(ink(ui))),
        Item::Note(text) => paragraph(ui, RichText::new(tr(text)).color(pale(ui))),
        Item::Verdict(passed, text) => {
            let colour = legible(ui, if *passed { GREEN } else { ORANGE });
            paragraph(ui, RichText::new(tr(text)).size(18.0).strong().color(colour));
        }
        Item::Label(text, [r, g, b]) => {
            let (patch, _) = ui.allocate_exact_size(egui::vec2(14.0, 14.0), egui::Sense::hover());
            ui.painter().rect_filled(patch, 2.0, Color32::from_rgb(*r, *g, *b));
            ui.label(RichText::new(tr(text)).color(ink(ui)));
        }
        Item::Alert(text) => {
            egui::Frame::new().fill(VERMILION).inner_margin(10.0).show(ui, |ui| {
                ui.label(RichText::new(tr(text)).size(16.0).strong().color(Color32::BLACK));
            });
        }
        Item::Button(button) => press(ui, button, done),
        Item::Row(items) => {
            let is_wide = |item: &&Item<A>| matches!(item, Item::Picture(_) | Item::Gap);
            let pictures = items.iter().filter(is_wide).count().max(1) as f32;
            let each = (ui.available_width() - GAP * (pictures - 1.0)) / pictures;
            _ = ui.horizontal_wrapped(|ui| {
                for item in items {
                    match item {
                        Item::Picture(picture) => look(ui, picture, each.max(PICTURE_LEAST), textures, done),
                        item => draw(ui, item, textures, done),
                    }
                }
            });
        }
        Item::Gap => (),
        Item::Look => _ = ui.horizontal_wrapped(appearance),
        Item::Choice(name, options, chosen, does) => choose(ui, (name, options, *chosen), *does, done),
        Item::Field(name, value, empty, does) => write(ui, [name, value, empty], *does, done),
        Item::Amount(amount, does) => _ = ui.horizontal_wrapped(|ui| slide(ui, amount, *does, done)),
        Item::Progress(share, text) => {
            // An animated bar would be drawn as often as the machine can, which the work needs.
            ui.add(egui::ProgressBar::new(*share).text(tr(text)).desired_height(22.0));
        }
        Item::Picture(picture) => look(ui, picture, f32::INFINITY, textures, done),
        Item::Table(rows) => table(ui, rows),
        Item::Curve(title, values) => curve(ui, title, values),
    }
}

/// Switches for large letters and light colours, which hold in sessions too.
fn appearance(ui: &mut egui::Ui) {
    let (mut large, mut light) = (ui.ctx().zoom_factor() > 1.0, !ui.visuals().dark_mode);
    if ui.checkbox(&mut large, tr("Large type")).changed() {
        ui.set_zoom_factor(if large { LARGE } else { 1.0 });
    }
    if ui.checkbox(&mut light, tr("Light")).changed() {
        ui.set_theme(if light { egui::Theme::Light } else { egui::Theme::Dark });
    }
}

/// Shows a text whose lines begin at the left and end where they end.
fn paragraph(ui: &mut egui::Ui, text: RichText) {
    match ui.layout().horizontal_justify() {
        true => _ = ui.with_layout(egui::Layout::top_down(egui::Align::LEFT), |ui| ui.label(text)),
        false => _ = ui.label(text),
    }
}

fn press<A: Clone>(ui: &mut egui::Ui, button: &Button<A>, done: &mut Vec<A>) {
    let name = if button.is_name { button.name.clone() } else { tr(&button.name) };
    let mut text = RichText::new(name).size(15.0);
    let mut shape = egui::Button::new(text.clone()).wrap().min_size(egui::vec2(44.0, 30.0));
    if button.main {
        text = text.strong().color(Color32::BLACK);
        shape = egui::Button::new(text).wrap().min_size(egui::vec2(44.0, 34.0)).fill(SKY);
    }
    let shown = ui.add_enabled(button.does.is_some(), shape);
    if shown.clicked() {
        done.extend(button.does.clone());
    }
    if !button.hint.is_empty() {
        shown.on_hover_text(tr(&button.hint)).on_disabled_hover_text(tr(&button.hint));
    }
}

fn choose<A>(
    ui: &mut egui::Ui,
    (name, options, chosen): (&str, &[Choosable], usize),
    does: fn(usize) -> A,
    done: &mut Vec<A>,
) {
    ui.add_space(2.0);
    ui.label(RichText::new(tr(name)).color(pale(ui)));
    ui.horizontal_wrapped(|ui| {
        ui.spacing_mut().item_spacing = egui::vec2(4.0, 4.0);
        for (at, option) in options.iter().enumerate() {
            let text = RichText::new(tr(&option.name));
            let shape = egui::Button::selectable(at == chosen, text).frame_when_inactive(true);
            let shown = ui.add_enabled(option.open || at == chosen, shape.min_size(egui::vec2(0.0, 26.0)));
            if shown.clicked() && at != chosen {
                done.push(does(at));
            }
            if !option.hint.is_empty() {
                shown.on_hover_text(tr(&option.hint)).on_disabled_hover_text(tr(&option.hint));
            }
        }
    });
}

fn write<A>(ui: &mut egui::Ui, [name, value, empty]: [&String; 3], does: fn(String) -> A, done: &mut Vec<A>) {
    ui.add_space(2.0);
    let label = ui.label(RichText::new(tr(name)).color(pale(ui)));
    let mut text = value.clone();
    let edit = egui::TextEdit::singleline(&mut text).hint_text(tr(empty)).margin(egui::vec2(8.0, 5.0));
    if ui.add(edit.desired_width(420.0_f32.min(ui.available_width() - 16.0))).labelled_by(label.id).changed() {
        done.push(does(text));
    }
}

fn slide<A>(ui: &mut egui::Ui, amount: &Amount, does: fn(f32) -> A, done: &mut Vec<A>) {
    let (mut value, [low, high]) = (amount.value, amount.range);
    ui.spacing_mut().slider_width = (0.5 * ui.available_width()).clamp(100.0, 240.0);
    let shown = egui::Slider::new(&mut value, low..=high).step_by(amount.step.into());
    let shown = ui.add(shown.fixed_decimals(if amount.step < 1.0 { 2 } else { 0 }));
    let name = ui.label(RichText::new(tr(&amount.name)).color(pale(ui)));
    if shown.labelled_by(name.id).changed() {
        done.push(does(value));
    }
}

/// Shows a picture that is not wider than `widest` points.
fn look<A>(ui: &mut egui::Ui, picture: &Picture<A>, widest: f32, textures: &mut Textures, done: &mut Vec<A>) {
    let id = textures.of(ui, picture);
    let image = &picture.image;
    let shape = image.width as f32 / image.height.max(1) as f32;
    let width = ui.max_rect().width().min(widest).min(picture.height * shape).max(16.0);
    let size = egui::vec2(width, width / shape);
    let (area, _) = ui.allocate_exact_size(size, egui::Sense::hover());
    // By its name it stays the same while others come and go, so that a drag goes on.
    let response = ui.interact(area, egui::Id::unique(("picture", &picture.name)), egui::Sense::click_and_drag());
    let whole = egui::Rect::from_min_max(egui::pos2(0.0, 0.0), egui::pos2(1.0, 1.0));
    ui.painter().image(id, area, whole, Color32::WHITE);
    response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::Image, true, tr(&picture.name)));
    for ([x, y], letter) in &picture.letters {
        let at = area.min + egui::vec2(x * area.width(), y * area.height());
        let font = egui::FontId::proportional(16.0);
        // On ivory as on black.
        let around =
            [[1.0, 1.0], [-1.0, 1.0], [1.0, -1.0], [-1.0, -1.0]].map(|[x, y]| (egui::vec2(x, y), Color32::BLACK));
        for (shift, colour) in around.into_iter().chain([(egui::Vec2::ZERO, Color32::WHITE)]) {
            ui.painter().text(at + shift, egui::Align2::CENTER_CENTER, letter, font.clone(), colour);
        }
    }
    let share = |v: egui::Vec2| [v.x / area.width(), v.y / area.height()];
    let notches = ui.input(|input| input.smooth_scroll_delta().y) / NOTCH;
    if let Some(does) = picture.scrolled.filter(|_| response.hovered()) {
        // The page itself does not scroll in the next picture.
        let now = ui.input(|input| input.time);
        ui.data_mut(|data| data.insert_temp(egui::Id::unique(WHEEL), now));
        done.extend((notches != 0.0).then(|| does(notches)));
    }
    if let (true, Some(does), Some(at)) = (response.clicked(), picture.clicked, response.interact_pointer_pos()) {
        done.push(does(share(at - area.min)));
    }
    if let Some(does) = picture.dragged.filter(|_| response.dragged() || response.drag_stopped()) {
        let left = egui::PointerButton::Primary;
        let from = ui.input(|input| input.pointer.press_origin());
        let pointer = ui.input(|input| input.pointer.latest_pos()).unwrap_or(area.min);
        let passes = |at: egui::Pos2| Drag {
            at: share(at - area.min),
            left: response.dragged_by(left) || response.drag_stopped_by(left),
            ..Drag::default()
        };
        // It counts as a drag only some points after the press.
        let start = from.filter(|_| response.drag_started()).map(|from| Drag { begins: true, ..passes(from) });
        done.extend(start.map(does));
        // A slow picture comes after several moves.
        let moves = |input: &egui::InputState| -> Vec<egui::Pos2> {
            let all = input.events.iter();
            all.filter_map(|event| if let egui::Event::PointerMoved(at) = event { Some(*at) } else { None }).collect()
        };
        done.extend(ui.input(moves).into_iter().map(|at| does(passes(at))));
        done.push(does(Drag { by: share(response.drag_delta()), ends: response.drag_stopped(), ..passes(pointer) }));
    }
}

fn curve(ui: &mut egui::Ui, title: &str, values: &[f64]) {
    ui.add_space(GAP);
    ui.label(RichText::new(tr(title)).size(14.0).color(ink(ui)));
    let points: Vec<[f64; 2]> = values.iter().enumerate().map(|(at, value)| [at as f64 + 1.0, *value]).collect();
    let still = egui_plot::Plot::new(title).height(120.0).allow_drag(false).allow_zoom(false).allow_scroll(false);
    still.show(ui, |plot| {
        plot.line(egui_plot::Line::new(title, points.clone()).color(SKY).width(2.0));
        plot.points(egui_plot::Points::new(title, points).color(SKY).radius(4.0));
    });
}

fn table(ui: &mut egui::Ui, rows: &[Vec<String>]) {
    let columns = rows.first().map_or(1, Vec::len);
    let grid = egui::Grid::new(("table", rows.first())).num_columns(columns).striped(true).spacing([12.0, 8.0]);
    let first = (0.32 * ui.available_width()).max(120.0);
    grid.show(ui, |ui| {
        for (at, row) in rows.iter().enumerate() {
            for (place, cell) in row.iter().enumerate() {
                let text = RichText::new(tr(cell)).size(14.0).color(ink(ui));
                let label = egui::Label::new(if at == 0 { text.strong() } else { text });
                // Only the first column holds sentences.
                match place {
                    0 => _ = ui.scope(|ui| (ui.set_max_width(first), ui.add(label.wrap()))),
                    _ => _ = ui.add(label.extend()),
                }
            }
            ui.end_row();
        }
    });
}
