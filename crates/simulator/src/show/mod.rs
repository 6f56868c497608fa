//! Rendering on the main thread: into files or a window.

mod closeups;
mod colours;
pub(crate) mod driver;
pub(crate) mod graphics;
mod keep;
pub(crate) mod notice_text;
pub(crate) mod picture;
pub(crate) mod player;
mod raycast;
pub(crate) mod window;
