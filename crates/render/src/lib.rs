//! The picture: ray-cast skull, deforming brain, tools, shadows and slices, headless or in a window.

mod brain;
mod bricks;
mod camera;
mod contour;
mod error;
mod frame;
mod image;
mod layout;
mod light;
mod mri;
mod renderer;
mod scene;
mod skull;
mod slice;
#[cfg(feature = "window")]
pub mod window;

pub use camera::{Camera, View};
pub use error::RenderError;
pub use frame::{Frame, SceneData, SliceLook};
pub use image::Image;
pub use layout::Layout;
pub use renderer::{BRICKS_PER_FRAME, DrawReport, Hit, Renderer};
