//! The recommended search: a walk through neighbours, with floods for the points that it loses.

mod degenerate;
mod flood;
mod lost;
pub mod walk;

pub(crate) use flood::Flood;
pub(crate) use lost::Lost;
