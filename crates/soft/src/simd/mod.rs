//! Element kernels in f32, one element a lane: registers, their selection for this CPU, and the
//! order in memory. `trepan-tled` and `trepan-rivals` use the same, so that their times
//! compare methods and not code.

mod kernel;
mod lane;
mod layout;
mod pass;
#[cfg(target_arch = "x86_64")]
mod x86;

pub use kernel::Kernel;
pub use lane::{Lane, NODES, Quad, WIDTH, dot, squared};
pub use layout::{Layout, kind};
pub use pass::{Pass, PassReport};
