//! What the main thread does: pictures into files, or a window.

pub(crate) mod driver;
mod keep;
pub(crate) mod picture;
pub(crate) mod player;
mod said;
pub(crate) mod window;
