//! Trepan's WGSL shaders as strings: one file per pass, named like the Rust file that runs it.
//!
//! # Practice
//! Passes of the picture start with the text of `scene.wgsl`, which declares what all of them know at binding 0.
//! Every entry is checked by naga when its pipeline is made; there is nothing to build and no path to find at run time.

macro_rules! picture {
    ($file:literal) => {
        concat!(include_str!("../render/scene.wgsl"), "\n", include_str!(concat!("../render/", $file)))
    };
}

/// The bone's isosurface by ray casting.
pub const RENDER_SKULL: &str = picture!("skull.wgsl");
/// The brain's deformed surface.
pub const RENDER_BRAIN: &str = picture!("brain.wgsl");
/// Bone, brain and tool together, lit.
pub const RENDER_LIGHT: &str = picture!("light.wgsl");
/// One orthogonal slice.
pub const RENDER_SLICE: &str = picture!("slice.wgsl");
/// The brain's outline in a slice.
pub const RENDER_CONTOUR: &str = picture!("contour.wgsl");
