//! The renderer on the graphics device: one file a pass.

mod anaglyph;
mod average;
mod brain;
mod canvas;
mod contour;
mod cut;
mod enlarge;
mod eye;
mod light;
mod overlay;
mod paint;
mod passes;
mod renderer;
mod section;
mod skull;
mod slice;

pub use renderer::Renderer;
