//! One window for a whole program: pages before, between and after sessions, and the sessions that
//! other threads send to it.
//!
//! ```text
//!  worker thread ──Stage::run: session, painter──> window (main thread) ──> shows it
//!                <──Closed: both back───────────── when it is over
//! ```
//!
//! # Practice
//! The window opens before anything is loaded. A session that is sent while another is shown takes
//! its place; the other goes back to its thread. When the window is closed, every session goes back
//! at once, also those that are sent later.

use crate::app::Window;
use crate::page::{self, Page, Textures};
use crate::palette::SKY;
use crate::{Closed, Session, Shared, SharedCell, Start, WindowError};
use eframe::{egui, egui_wgpu::RenderState};
use std::any::Any;
use std::cell::RefCell;
use std::path::PathBuf;
use std::rc::Rc;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::time::Duration;
use trepan_gpu::Gpu;
use trepan_render::Painter;

/// What a window shows.
pub enum Content<A> {
    /// A page.
    Page(Box<Page<A>>),
    /// The session that was sent to the window, and a strip with controls over it.
    Session(Option<Box<Page<A>>>),
    /// Nothing more: the window closes.
    Nothing,
}

/// The program behind the window. Called on the window's thread, once per picture; must not wait.
pub trait Host {
    /// What a press of a control does.
    type Action: Clone;

    /// Returns what to show now. `guest`: whether a session was sent to the window and is not over;
    /// a page in its place ends it.
    fn shown(&mut self, guest: bool) -> Content<Self::Action>;

    /// Does what the user pressed.
    fn act(&mut self, action: Self::Action);

    /// Takes files and folders that were dropped on the window.
    fn dropped(&mut self, paths: Vec<PathBuf>);

    /// What letting go of the files over the window would do, in a line.
    fn hovered(&self) -> String;
}

/// A session that another thread sent.
type Sent = Box<dyn Session + Send>;
/// What goes back to its thread.
type Returned = (Sent, Painter, Result<(), WindowError>);

/// A session on its way to the window.
struct Offer {
    session: Sent,
    painter: Painter,
    start: Start,
    back: Sender<Returned>,
}

/// The window, as seen by the threads that run sessions.
#[derive(Clone, Debug)]
pub struct Stage {
    offers: Sender<Offer>,
}

impl Stage {
    /// Shows a session in the window until it is over, or the window is closed or shows another.
    pub fn run<S: Session + Send + 'static>(&self, painter: Painter, session: S, start: Start) -> Closed<S, Painter> {
        let (back, returned) = channel();
        let offer = Offer { session: Box::new(session), painter, start, back };
        let (session, renderer, result) = match self.offers.send(offer) {
            Ok(()) => returned.recv().expect("the window returns every session"),
            Err(refused) => (refused.0.session, refused.0.painter, Ok(())),
        };
        let any: Box<dyn Any> = session;
        let session = *any.downcast().expect("the window returns the session that it was lent");
        Closed { session, renderer, result }
    }
}

/// Sessions that were sent to the window.
pub struct Offers(Receiver<Offer>);

/// Makes the way to a window, before it is opened.
pub fn stage() -> (Stage, Offers) {
    let (offers, receiver) = channel();
    (Stage { offers }, Offers(receiver))
}

impl Offers {
    /// Sends back what is still offered, until no [`Stage`] is left. Called after [`open`].
    pub fn refuse(self) {
        self.0.iter().for_each(|offer| give_back(offer.back, (offer.session, offer.painter), None));
    }
}

/// Time between two looks at what has changed, with a card and without. A picture of a page takes a
/// processor 70 to 90 ms, which an import beside it needs.
const POLL: [Duration; 2] = [Duration::from_millis(100), Duration::from_millis(500)];

/// Type of the session and the painter in the window.
type Lending = SharedCell<Sent, Painter>;

/// The session in the window.
struct Guest {
    window: Window<Sent, Painter>,
    lent: Lending,
    back: Sender<Returned>,
}

impl Guest {
    fn of(offer: Offer, device: Option<&Gpu>) -> Self {
        let Offer { session, painter, start, back } = offer;
        // A picture of another device cannot be shown without a copy.
        let same = |gpu: &Gpu| device.is_some_and(|device| device.device() == gpu.device());
        let copies = !painter.renderer().is_some_and(|renderer| same(renderer.gpu()));
        let shared = Shared { session, renderer: painter, shown: false, fault: None };
        let lent: Lending = Rc::new(RefCell::new(Some(shared)));
        Self { window: Window::new(lent.clone(), start, copies), lent, back }
    }

    fn leave(self) {
        if let Some(Shared { session, renderer, fault, .. }) = self.lent.borrow_mut().take() {
            give_back(self.back, (session, renderer), fault);
        }
    }
}

fn give_back(back: Sender<Returned>, (session, painter): (Sent, Painter), fault: Option<String>) {
    // A thread that panicked does not wait for its session.
    _ = back.send((session, painter, fault.map_or(Ok(()), |why| Err(WindowError::Failed(why)))));
}

/// What the window needs while it is open.
struct Open<H> {
    host: H,
    offers: Receiver<Offer>,
    guest: Option<Guest>,
}

/// Application of a window with pages and sessions, as [`open`] runs it.
pub struct Pages<H> {
    open: Rc<RefCell<Open<H>>>,
    device: Option<Gpu>,
    textures: Textures,
}

/// Size of the window at the start, points.
const SIZE: [f32; 2] = [1280.0, 800.0];

/// Opens the window at once and shows what the host says, until it is closed; returns the host.
/// Must be called on the main thread.
pub fn open<H: Host + 'static>(
    title: &str,
    gpu: Option<&Gpu>,
    offers: Offers,
    host: H,
) -> (H, Offers, Result<(), WindowError>) {
    let shared = gpu.filter(|gpu| gpu.can_be_shared()).cloned();
    let open = Rc::new(RefCell::new(Open { host, offers: offers.0, guest: None }));
    let shown = Rc::new(std::cell::Cell::new(false));
    let create = |device: Option<&Gpu>| -> Box<dyn eframe::App> {
        shown.set(true);
        Box::new(Pages { open: open.clone(), device: device.cloned(), textures: Textures::default() })
    };
    let result = crate::display().and_then(|()| crate::open_somehow(title, shared.as_ref(), SIZE, &create, &shown));
    open.borrow_mut().guest.take().into_iter().for_each(Guest::leave);
    let Ok(open) = Rc::try_unwrap(open) else { unreachable!("the window is closed and its application dropped") };
    let Open { host, offers, .. } = open.into_inner();
    (host, Offers(offers), result)
}

impl<H: Host> Pages<H> {
    /// An application that is drawn without a window of its own, with copied pictures.
    pub fn undisplayed(offers: Offers, host: H) -> Self {
        let open = Rc::new(RefCell::new(Open { host, offers: offers.0, guest: None }));
        Self { open, device: None, textures: Textures::default() }
    }

    /// Draws one picture of it.
    pub fn draw(&mut self, ui: &mut egui::Ui) {
        self.show(ui, None);
    }

    /// Hands the host to a function.
    pub fn with_host<T>(&self, does: impl FnOnce(&mut H) -> T) -> T {
        does(&mut self.open.borrow_mut().host)
    }

    fn show(&mut self, ui: &mut egui::Ui, state: Option<&RenderState>) {
        let open = self.open.clone();
        let Open { host, offers, guest } = &mut *open.borrow_mut();
        for offer in offers.try_iter() {
            guest.replace(Guest::of(offer, self.device.as_ref())).into_iter().for_each(Guest::leave);
        }
        let dropped = ui.input(|input| input.raw.dropped_files.clone());
        if !dropped.is_empty() {
            host.dropped(dropped.into_iter().map(|file| file.path().to_path_buf()).collect());
        }
        let poll = POLL[usize::from(self.device.as_ref().is_none_or(Gpu::is_software))];
        let actions = match host.shown(guest.is_some()) {
            Content::Page(page) => {
                guest.take().into_iter().for_each(Guest::leave);
                let frame = egui::Frame::central_panel(ui.style()).inner_margin(16.0);
                let drawn = egui::CentralPanel::default().frame(frame);
                let actions = drawn.show(ui, |ui| page::show(ui, &page, &mut self.textures)).inner;
                ui.request_repaint_after(poll);
                actions
            }
            Content::Session(strip) => {
                let strip = strip.map(|page| {
                    let panel = egui::Panel::top("strip").resizable(false).max_size(260.0);
                    panel.show(ui, |ui| page::strip(ui, &page, &mut self.textures)).inner
                });
                if let Some(mut shown) = guest.take() {
                    shown.window.show(ui, state);
                    if shown.window.is_over() {
                        shown.leave();
                        ui.request_repaint();
                    } else {
                        *guest = Some(shown);
                    }
                }
                ui.request_repaint_after(poll);
                strip.unwrap_or_default()
            }
            Content::Nothing => {
                ui.send_viewport_cmd(egui::ViewportCommand::Close);
                Vec::new()
            }
        };
        if ui.input(|input| !input.raw.hovered_files.is_empty()) {
            landing(ui.ctx(), &host.hovered());
        }
        actions.into_iter().for_each(|action| host.act(action));
    }
}

/// Shows over the whole window what happens if files over it are let go.
fn landing(context: &egui::Context, text: &str) {
    let area = context.content_rect();
    let layer = egui::LayerId::new(egui::Order::Foreground, egui::Id::unique("landing"));
    let painter = context.layer_painter(layer);
    painter.rect_filled(area, 0.0, egui::Color32::from_black_alpha(190));
    let frame = area.shrink(24.0);
    painter.rect_stroke(frame, 12.0, egui::Stroke::new(4.0, SKY), egui::StrokeKind::Inside);
    let font = egui::FontId::proportional(26.0);
    let galley = painter.layout(crate::tr(text), font, egui::Color32::WHITE, frame.width() - 40.0);
    painter.galley(frame.center() - 0.5 * galley.size(), galley, egui::Color32::WHITE);
}

impl<H: Host> eframe::App for Pages<H> {
    fn ui(&mut self, ui: &mut egui::Ui, frame: &mut eframe::Frame) {
        self.show(ui, frame.wgpu_render_state());
    }

    fn clear_color(&self, visuals: &egui::Visuals) -> [f32; 4] {
        crate::panel::background(visuals)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;
    use std::sync::Arc;

    /// A program that remembers what was dropped.
    #[derive(Default)]
    struct Desk(Vec<Vec<PathBuf>>);

    impl Host for Desk {
        type Action = ();

        fn shown(&mut self, _: bool) -> Content<()> {
            Content::Page(Box::default())
        }

        fn act(&mut self, (): ()) {}

        fn dropped(&mut self, paths: Vec<PathBuf>) {
            self.0.push(paths);
        }

        fn hovered(&self) -> String {
            "let go here".into()
        }
    }

    #[derive(Debug)]
    struct Dropped(&'static str);

    impl egui::DroppedFile for Dropped {
        fn path(&self) -> &Path {
            self.0.as_ref()
        }

        fn bytes(&self) -> Result<Vec<u8>, String> {
            Err("only its path counts".into())
        }
    }

    /// Shows a picture with files over the window and files let go; returns the texts on it.
    fn picture(pages: &mut Pages<Desk>, hovered: usize, dropped: &[&'static str]) -> String {
        let context = egui::Context::default();
        let input = egui::RawInput {
            hovered_files: vec![egui::HoveredFile::default(); hovered],
            dropped_files: dropped.iter().map(|path| Arc::new(Dropped(path)) as egui::DroppedFileHandle).collect(),
            ..Default::default()
        };
        let mut drawn = context.run_ui(input, |ui| pages.show(ui, None));
        drawn.textures_delta.clear();
        format!("{:?}", drawn.shapes)
    }

    #[test]
    fn files_over_the_window_are_announced_and_dropped_together() {
        let (_stage, Offers(offers)) = stage();
        let open = Rc::new(RefCell::new(Open { host: Desk::default(), offers, guest: None }));
        let mut pages = Pages { open: open.clone(), device: None, textures: Textures::default() };
        assert!(!picture(&mut pages, 0, &[]).contains("let go here"));
        assert!(picture(&mut pages, 2, &[]).contains("let go here"));
        assert!(open.borrow().host.0.is_empty());
        picture(&mut pages, 0, &["/ct/IM1", "/ct/IM2"]);
        assert_eq!(open.borrow().host.0, [[PathBuf::from("/ct/IM1"), PathBuf::from("/ct/IM2")]]);
    }
}
