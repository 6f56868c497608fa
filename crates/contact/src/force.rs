//! The seam of the force models: tool and contact in, wrench out.

use crate::ContactManifold;
use trepan_geometry::{ToolState, Wrench};

/// Turns a contact into the wrench on the hand. Called once per haptic tick: no allocation, no
/// lock, no panic.
pub trait ForceModel: Send {
    /// The wrench on the tool, N and N mm, world axes, at the tool's tip. `dt_ms` is the nominal
    /// tick length.
    fn wrench(&mut self, tool: &ToolState, manifold: &ContactManifold, dt_ms: f32) -> Wrench;

    /// Forgets all history, as after a pause or a tool change; nothing in a model without any.
    fn reset(&mut self) {}
}
