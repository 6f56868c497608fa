//! A thin layer over wgpu: device, typed buffers, textures, kernels, pipelines, a named pass list,
//! timing, readback.
//!
//! # Practice
//! Open a [`Gpu`] once; it is cheap to clone and may be shared between threads. Make buffers,
//! textures, [`Kernel`]s and [`Pipeline`]s at load time, bind them to their shader's slots once,
//! then fill a [`Recorder`] each frame: pass names are timing labels. Nothing here waits for the
//! device but the `read` calls and [`Gpu::wait`], and these give up after [`PATIENCE`].
//!
//! Mistakes found by wgpu's validation do not panic: they are counted in [`Gpu::faults`], and a
//! test asserts that there are none.
//!
//! # When not to use it
//! For one-off experiments with features that only some devices have: [`Gpu::device`] and
//! [`Gpu::queue`] give the bare wgpu objects.

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;

mod bind;
mod buffer;
mod error;
mod gpu;
mod kernel;
mod pipeline;
mod record;
mod texture;
mod timer;

pub use bind::{Bindings, Resource, Slot};
pub use buffer::Buffer;
pub use error::GpuError;
pub use gpu::{Faults, Gpu, PATIENCE, Prefer};
pub use kernel::Kernel;
pub use pipeline::{Pipeline, PipelineSpec, Topology};
pub use record::{Depth, Dispatches, DrawTarget, Draws, Recorder, Target};
pub use texture::{Format, Texture, TextureSpec};
pub use timer::{PassTime, Timer};
pub use wgpu;
