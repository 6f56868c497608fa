//! The window: the newest picture, a panel of what matters, and the mouse as a tool.
use crate::picture::Album;
use crate::program::Program;
use crate::run::Eyes;
use crate::scene::Scene;
use crate::stop::Stop;
use std::path::Path;
use trepan_haptics::mouse::MouseHandle;
use trepan_render::Renderer;

/// Whether a window can be opened here.
pub fn has_display() -> bool {
    ["DISPLAY", "WAYLAND_DISPLAY"].iter().any(|name| std::env::var_os(name).is_some_and(|value| !value.is_empty()))
}

/// Shows the session until it ends or the window is closed.
pub fn show(
    eyes: Eyes,
    _renderer: Renderer,
    _scene: &Scene,
    _program: Program,
    _pointer: Option<MouseHandle>,
    _out: &Path,
    stop: &Stop,
) -> Album {
    crate::picture::wait(eyes, stop);
    Album::default()
}
