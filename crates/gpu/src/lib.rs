//! A thin layer over wgpu: device, typed buffers, textures, kernels, pipelines, named passes,
//! timing, readback.
//!
//! # Practice
//! Open a [`Gpu`] once; it is cheap to clone and can be shared between threads. Create buffers,
//! textures, [`Kernel`]s and [`Pipeline`]s at load time and bind them to their shader's slots once;
//! then fill a [`Recorder`] each frame. Pass names are timing labels. Only the `read` calls and
//! [`Gpu::wait`] wait for the device, for at most [`PATIENCE`].
//!
//! Errors found by wgpu's validation do not panic: [`Gpu::faults`] counts them, and tests assert
//! that there are none.
//!
//! # When not to use it
//! For experiments with features of particular devices: [`Gpu::device`] and [`Gpu::queue`] return
//! the wgpu objects.

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;

mod bind;
mod buffer;
mod error;
mod gpu;
mod kernel;
mod pipeline;
mod readback;
mod record;
mod texture;
mod timer;

pub use bind::{Bindings, Resource, Slot};
pub use buffer::Buffer;
pub use error::GpuError;
#[doc(hidden)]
pub use gpu::adapter_for_tests;
pub use gpu::{Faults, Gpu, PATIENCE, Prefer};
pub use kernel::Kernel;
pub use pipeline::{DepthTest, Pipeline, PipelineSpec, Topology};
pub use readback::Readback;
pub use record::{Depth, Dispatches, DrawTarget, Draws, Recorder, Target};
pub use texture::{Format, Texture, TextureSpec};
pub use timer::{PassTime, Timer};
pub use wgpu;
