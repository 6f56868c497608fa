//! What the main thread does: pictures into files, or a window.

pub(crate) mod driver;
pub(crate) mod picture;
pub(crate) mod window;
