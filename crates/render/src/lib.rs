//! The renderer: ray-cast skull, deforming brain, tools, shadows and slices.
//!
//! # Theory
//! Bone is the isosurface of a trilinear density: along a ray each voxel cell is a cubic, whose
//! first root is computed exactly. Empty space is skipped by the chessboard distance to the nearest
//! brick with bone. The brain is a fine cortex that its tetrahedra move, or their boundary. One
//! lighting pass combines the hits of bone and brain with the tool, a ball and a cylinder in closed
//! form.
//!
//! # Practice
//! Create a [`Renderer`] once per scene, then [`draw`](Renderer::draw) a [`Frame`] and take its
//! texture or its [`Image`]. Drilling is read through
//! [`BoneVolume::changed`](trepan_bone::BoneVolume::changed), up to a number of bricks a picture;
//! the haptic tick is never delayed.
//!
//! # Sources
//! Marmitt et al. 2004 (roots in a cell), Cohen and Sheffer 1994 (empty-space skipping), Cigolle et
//! al. 2014 (octahedral normals).
//!
//! # When not to use it
//! For translucent volumes: there is one isosurface and no transfer function.

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;

mod border;
mod bricks;
mod camera;
mod chunks;
mod cut;
mod device;
mod drilled;
mod embedding;
mod error;
mod frame;
mod image;
mod kept;
mod layout;
mod mix;
mod mri;
mod overlap;
mod overlay;
mod paint;
mod painter;
mod processor;
mod recast;
mod report;
mod scene;
mod section;
mod slice;
mod smooth;
mod stereo;
mod tool;
mod touch;
mod walls;

pub use camera::{Camera, View};
pub use cut::Cut;
pub use device::Renderer;
pub use error::RenderError;
pub use frame::{Cortex, Frame, Leaves, SceneData, SliceLook};
pub use image::Image;
pub use layout::Layout;
pub use overlap::{RgbPicture, overlap_pictures};
pub use overlay::Overlay;
pub use paint::Paint;
pub use painter::Painter;
pub use processor::{Casting, ProcessorRenderer};
pub use report::{BRICKS_PER_FRAME, DrawReport, Hit, OUTLINE};
pub use slice::Plane;
pub use stereo::{Stereo, StereoLook};
