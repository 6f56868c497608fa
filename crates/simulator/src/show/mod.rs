//! What the main thread does: pictures into files, or a window.

pub(crate) mod colours;
pub(crate) mod driver;
pub(crate) mod graphics;
mod keep;
pub(crate) mod picture;
pub(crate) mod player;
mod said;
pub(crate) mod window;
