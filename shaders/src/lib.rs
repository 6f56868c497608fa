//! Trepan's WGSL shaders as strings: one file per pass, named like the Rust file that runs it.
//!
//! # Practice
//! A picture's passes start with the text of `scene.wgsl`, those of a soft-tissue step with
//! `step.wgsl`, which declare their shared data at binding 0. naga checks every entry point when
//! its pipeline is created; there is nothing to build and no path to find at run time.

/// Prepends the text of `scene.wgsl`.
macro_rules! picture {
    ($($file:literal),+) => {
        concat!(include_str!("../render/scene.wgsl"), $("\n", include_str!(concat!("../render/", $file))),+)
    };
}

/// The bone's isosurface by ray casting; `bricks.wgsl` traces the rays through the grid.
pub const RENDER_SKULL: &str = picture!("drilled.wgsl", "bricks.wgsl", "skull.wgsl");
/// The brain's deformed surface.
pub const RENDER_BRAIN: &str = picture!("brain.wgsl");
/// Lighting of bone, brain and tool, with the shadows of bone on the brain.
pub const RENDER_LIGHT: &str = picture!("drilled.wgsl", "bricks.wgsl", "tool.wgsl", "light.wgsl");
/// Mean of samples of the 3-D view.
pub const RENDER_AVERAGE: &str = picture!("average.wgsl");
/// Arrow, ghost and markers over the 3-D view.
pub const RENDER_OVERLAY: &str = picture!("tool.wgsl", "overlay.wgsl");
/// The cut surface of the brain.
pub const RENDER_CUT: &str = picture!("cut.wgsl");
/// One orthogonal slice.
pub const RENDER_SLICE: &str = picture!("drilled.wgsl", "slice.wgsl");
/// The brain's outline in a slice.
pub const RENDER_CONTOUR: &str = picture!("contour.wgsl");
/// Enlarges a coarser 3-D view.
pub const RENDER_ENLARGE: &str = picture!("enlarge.wgsl");
/// Both eyes' views in one picture.
pub const RENDER_ANAGLYPH: &str = picture!("anaglyph.wgsl");
/// The brain cut by a slice, as rest positions.
pub const RENDER_SECTION: &str = picture!("section.wgsl");

/// Shows a finished picture in a part of the window.
pub const WINDOW_SCREEN: &str = include_str!("../window/screen.wgsl");

/// Prepends the text of `step.wgsl`.
macro_rules! tled {
    ($($file:literal),+) => {
        concat!(include_str!("../tled/step.wgsl"), $("\n", include_str!(concat!("../tled/", $file))),+)
    };
}

/// Nodal forces of tetrahedra by constitutive law: neo-Hookean, St. Venant-Kirchhoff,
/// Mooney-Rivlin, Ogden, stiffening. They require `const RELAXES` and `const CURES` before them.
pub const TLED_FORCES: [&str; 5] = [
    tled!("element.wgsl", "neo_hookean.wgsl", "forces.wgsl"),
    tled!("element.wgsl", "st_venant_kirchhoff.wgsl", "forces.wgsl"),
    tled!("element.wgsl", "mooney_rivlin.wgsl", "forces.wgsl"),
    tled!("element.wgsl", "ogden.wgsl", "forces.wgsl"),
    tled!("element.wgsl", "stiffening.wgsl", "forces.wgsl"),
];
/// Volume change of every tetrahedron, and its mean around the nodes.
pub const TLED_VOLUMES: [&str; 2] = [tled!("element.wgsl", "volumes.wgsl"), tled!("node_groups.wgsl")];
/// Nodal forces of the triangles of a membrane.
pub const TLED_MEMBRANE: &str = tled!("membrane.wgsl");
/// The contact springs on the tissue surface.
pub const TLED_PRESS: &str = tled!("fluid.wgsl", "gather.wgsl", "press.wgsl");
/// Sums the forces at nodes and integrates their motion.
pub const TLED_UPDATE: &str = tled!("fluid.wgsl", "gather.wgsl", "update.wgsl");
