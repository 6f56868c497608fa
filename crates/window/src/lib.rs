//! A window on the scene: the renderer's picture, a side panel, mouse and keys.
//!
//! # Practice
//! | input | does |
//! |---|---|
//! | pointer | the tool flies over what is under it |
//! | left button | lowers the tool, runs it, pushes at the set feed; a drag slides along |
//! | Shift + left drag | tilts the shaft |
//! | wheel | zooms to the pointer; with Shift pushes the tool in or pulls it out along its shaft |
//! | slices | a click sets the point through which they pass, the wheel turns pages |
//! | right drag; middle drag or Shift + right drag | orbits; pans |
//! | Space (held) | the drill's pedal |
//! | 1 to 9, 0, N | takes a tool; the next tool |
//! | U, Y, X | undoes a stroke; redoes it; draws the tool back |
//! | D, F2 to F6 | centres the tool; the whole head from the front, back, left, right, top |
//! | I, F11 | light or dark; full screen |
//! | arrows, Page Up, Page Down | move the tool by half a millimetre |
//! | + and -, R | zoom; back to the first view |
//! | M | the microscope: a narrow field down on the opening |
//! | B, T, S, O | skull, brain, slices, colours and arrows on and off |
//! | C, E | a section through the tool's tip; stereo: off, side by side, red-cyan |
//! | P, V | a picture of the window for the session to keep; every picture |
//! | L, F1 or ? | large type; all keys on a page |
//! | Space, \[ and \] | in a replay: run or stand still, to the event before and after |
//! | Q | asks once, then ends the session; closes a replay |
//! | Escape | closes what is open, or draws the tool back; never ends |
//!
//! The picture stays on the device: egui shows the renderer's own texture. Where that is impossible
//! (a GL device, a device that cannot present on this display, or rendering on the processor) the
//! window opens a second device and every picture is copied to it. While something moves,
//! resolution follows the frame time; at rest the picture is sharp, and its edges are smoothed.
//!
//! # When not to use it
//! Without a display: [`run`] returns an error and all arguments, so that the session can continue
//! headless.

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;

mod aids;
mod answers;
mod app;
mod banner;
mod capture;
mod draws;
#[cfg(test)]
mod ending_and_slices;
mod guide;
mod host;
mod input;
mod keys;
mod look;
#[cfg(feature = "sound")]
mod loudspeaker;
mod page;
mod palette;
mod panel;
mod panel_text;
mod plot;
mod pointer;
mod quality;
mod screen;
mod slices;
#[cfg(test)]
mod spoken;
mod surface;
#[cfg(any(feature = "sound", test))]
mod synthesis;
#[cfg(test)]
mod tests;
mod timeline;
mod tool_icon;
mod words;

pub use capture::Capture;
pub use draws::{Draws, Refined};
pub use host::{Content, Host, Offers, Pages, Stage, open, stage};
pub use input::{Pace, WindowInput};
pub use page::{Amount, Button, Choosable, Drag, Item, Page, Picture};
pub use panel_text::{Action, Choice, Leash, Mark, Panel, Playback, Sound, Timeline};
pub use surface::{Ray, SurfaceHit};
pub use words::{Language, missing, speak, tr};

use eframe::egui::style::Widgets;
use std::any::Any;
use std::cell::{Cell, RefCell};
use std::rc::Rc;
use trepan_geometry::Pose;
use trepan_gpu::Gpu;
use trepan_render::{Camera, Frame, Image, Renderer};

/// The session behind the window. Called on the window's thread, once per picture; must not wait.
pub trait Session: Any {
    /// Processes the user's input and returns the panel.
    fn update(&mut self, input: &WindowInput) -> Panel;

    /// The frame to draw, seen by `camera`.
    fn frame(&self, camera: Camera) -> Frame<'_>;

    /// The first surface that a ray meets from outside.
    fn surface(&self, _ray: &Ray) -> Option<SurfaceHit> {
        None
    }

    /// Receives a screenshot of the whole window.
    fn capture(&mut self, what: Capture, picture: Image);
}

impl Session for Box<dyn Session + Send> {
    fn update(&mut self, input: &WindowInput) -> Panel {
        (**self).update(input)
    }

    fn frame(&self, camera: Camera) -> Frame<'_> {
        (**self).frame(camera)
    }

    fn surface(&self, ray: &Ray) -> Option<SurfaceHit> {
        (**self).surface(ray)
    }

    fn capture(&mut self, what: Capture, picture: Image) {
        (**self).capture(what, picture);
    }
}

/// Initial state of the window.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Start {
    /// The initial view, restored by a reset.
    pub camera: Camera,
    /// The microscope's view, if there is one.
    pub microscope: Option<Camera>,
    /// The tool's initial pose.
    pub world_from_tool: Pose,
    /// Width and height of the window, points.
    pub size: [f32; 2],
    /// Largest frame rate, Hz.
    pub rate_hz: f32,
    /// Initial fraction of the 3-D view's pixels along an edge; later it adapts to the frame time.
    pub detail: f32,
}

impl Start {
    /// 1280 by 800 points at 30 pictures a second.
    pub fn with(camera: Camera, world_from_tool: Pose) -> Self {
        Self { camera, microscope: None, world_from_tool, size: [1280.0, 800.0], rate_hz: 30.0, detail: 1.0 }
    }
}

/// Why the window could not be opened or failed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum WindowError {
    /// There is no display.
    #[error("there is no display to open a window on ({0}); run headless, or set DISPLAY or WAYLAND_DISPLAY")]
    NoDisplay(String),
    /// The windowing system failed while opening or showing.
    #[error("the window failed: {0}; on Debian or Ubuntu a window needs libxkbcommon-x11-0 and mesa-vulkan-drivers")]
    Failed(String),
}

/// Everything passed to [`run`], returned.
#[derive(Debug)]
pub struct Closed<S, D = Renderer> {
    /// The session.
    pub session: S,
    /// The renderer.
    pub renderer: D,
    /// Whether the window was shown and closed normally.
    pub result: Result<(), WindowError>,
}

/// The state that the window uses while it is open.
pub(crate) struct Shared<S, D> {
    pub session: S,
    pub renderer: D,
    /// Whether a picture was shown.
    pub shown: bool,
    pub fault: Option<String>,
}

/// Lent to the window and taken back when it is closed.
pub(crate) type SharedCell<S, D> = Rc<RefCell<Option<Shared<S, D>>>>;

/// Shows the window until it is closed. Must be called on the main thread.
pub fn run<S, D>(title: &str, renderer: D, session: S, start: Start) -> Closed<S, D>
where
    S: Session + 'static,
    D: Draws + 'static,
{
    let shared = renderer.device().filter(|gpu| gpu.can_be_shared()).cloned();
    let lent: SharedCell<S, D> = Rc::new(RefCell::new(Some(Shared { session, renderer, shown: false, fault: None })));
    let shown = Rc::new(Cell::new(false));
    let create = |device: Option<&Gpu>| -> Box<dyn eframe::App> {
        shown.set(true);
        Box::new(app::Window::new(lent.clone(), start, device.is_none()))
    };
    let opened = display().and_then(|()| open_somehow(title, shared.as_ref(), start.size, &create, &shown));
    let back = lent.borrow_mut().take();
    let Some(Shared { session, renderer, fault, .. }) = back else {
        unreachable!("only this line takes what was lent")
    };
    Closed { session, renderer, result: fault.map_or(opened, |why| Err(WindowError::Failed(why))) }
}

/// Makes the application of a window on a device, or on a device of its own.
type Create<'a> = dyn Fn(Option<&Gpu>) -> Box<dyn eframe::App> + 'a;

/// Opens the window on the rendering device, or on a separate device if that cannot present.
/// `shown` is set once the application is made.
fn open_somehow(
    title: &str,
    gpu: Option<&Gpu>,
    size: [f32; 2],
    create: &Create<'_>,
    shown: &Cell<bool>,
) -> Result<(), WindowError> {
    match open_on(title, gpu, size, create) {
        Err(WindowError::Failed(why)) if gpu.is_some() && !shown.get() => {
            let again = open_on(title, None, size, create);
            if again.is_ok() || shown.get() { again } else { Err(WindowError::Failed(why)) }
        }
        result => result,
    }
}

/// Opens the window and runs it until it is closed.
fn open_on(title: &str, gpu: Option<&Gpu>, size: [f32; 2], create: &Create<'_>) -> Result<(), WindowError> {
    let show = || {
        let create: eframe::AppCreator<'_> = Box::new(|context| {
            context.egui_ctx.set_theme(eframe::egui::Theme::Dark);
            context.egui_ctx.all_styles_mut(readable);
            let kind = context.wgpu_render_state.as_ref().map(|state| state.adapter.get_info().device_type);
            if kind == Some(eframe::wgpu::DeviceType::Cpu) {
                context.egui_ctx.all_styles_mut(square);
            }
            Ok(create(gpu))
        });
        eframe::run_native(title, options(gpu, size), create)
    };
    // A missing system library makes the windowing crate panic; the session must survive that.
    match std::panic::catch_unwind(std::panic::AssertUnwindSafe(show)) {
        Ok(Ok(())) => Ok(()),
        Ok(Err(eframe::Error::WinitEventLoop(e))) => Err(WindowError::NoDisplay(e.to_string())),
        Ok(Err(e)) => Err(WindowError::Failed(e.to_string())),
        Err(panic) => Err(WindowError::Failed(words(panic.as_ref()))),
    }
}

/// Smallest text of the window, points.
const SMALLEST: f32 = 11.0;

/// Makes no text smaller than can be read.
fn readable(style: &mut eframe::egui::Style) {
    style.text_styles.values_mut().for_each(|font| font.size = font.size.max(SMALLEST));
}

/// Gives widgets square corners: a software driver spends twice as long on the slender triangles
/// of round ones as on all else of the panel.
fn square(style: &mut eframe::egui::Style) {
    let Widgets { noninteractive, inactive, hovered, active, open } = &mut style.visuals.widgets;
    for widget in [noninteractive, inactive, hovered, active, open] {
        widget.corner_radius = 0.into();
    }
}

/// Checks whether a display is configured.
pub fn display() -> Result<(), WindowError> {
    let named = |name: &str| std::env::var_os(name).is_some_and(|v| !v.is_empty());
    let needed = cfg!(all(unix, not(target_os = "macos")));
    if needed && !["DISPLAY", "WAYLAND_DISPLAY", "WAYLAND_SOCKET"].into_iter().any(named) {
        return Err(WindowError::NoDisplay("neither DISPLAY nor WAYLAND_DISPLAY is set".into()));
    }
    Ok(())
}

fn options(gpu: Option<&Gpu>, [width, height]: [f32; 2]) -> eframe::NativeOptions {
    let mut options = eframe::NativeOptions {
        viewport: eframe::egui::ViewportBuilder::default()
            .with_inner_size([width, height])
            .with_min_inner_size([480.0, 360.0]),
        renderer: eframe::Renderer::Wgpu,
        ..Default::default()
    };
    if let Some(gpu) = gpu {
        let shared = eframe::egui_wgpu::WgpuSetupExisting {
            instance: gpu.instance().clone(),
            adapter: gpu.adapter().clone(),
            device: gpu.device().clone(),
            queue: gpu.queue().clone(),
        };
        options.wgpu_options.wgpu_setup = eframe::egui_wgpu::WgpuSetup::Existing(shared);
    }
    options
}

fn words(panic: &(dyn Any + Send)) -> String {
    let text = panic.downcast_ref::<String>().map(String::as_str).or(panic.downcast_ref::<&str>().copied());
    text.unwrap_or("no reason given").into()
}
