//! What a tick feels of tissue between two collision results: the newest patch, which fades.

use trepan_contact::{ContactManifold, SurfacePatch};
use trepan_geometry::{Tool, ToolState};

/// Age up to which a patch gives its full force, ms.
pub const FRESH_MS: f32 = 10.0;
/// Age from which a patch gives no force, ms.
pub const GONE_MS: f32 = 60.0;

/// Sets the contact of a tool with tissue by the newest patch; returns whether that is stale.
pub(crate) fn meet_patch(
    patch: &SurfacePatch,
    state: &ToolState,
    tool: &Tool,
    stiffness: f32,
    to: &mut ContactManifold,
) -> bool {
    to.clear();
    let age_ms = (state.time_ms - patch.time_ms) as f32;
    let depth = patch.depth_at(state.tip(), stiffness);
    if depth <= 0.0 || !patch.normal.is_finite() {
        return false;
    }
    let share = ((GONE_MS - age_ms) / (GONE_MS - FRESH_MS)).clamp(0.0, 1.0);
    to.normal = patch.normal;
    to.point = state.tip() - tool.tip_radius_mm * patch.normal;
    to.depth_mm = depth * share;
    to.couple_mm = patch.couple_mm;
    age_ms > FRESH_MS
}
