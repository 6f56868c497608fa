//! The seam between the haptic tick and the methods: one call a tick, plain data out.

use crate::removal::RemovalLaw;
use trepan_bone::BoneVolume;
use trepan_contact::ContactManifold;
use trepan_geometry::{Pose, ToolState};

/// A tool against bone.
pub trait RigidContact: Send {
    /// One haptic tick of `dt_ms`: moves the proxy towards `tool`, finds the contact and, when
    /// `drilling` with a burr, takes bone away. `out` is overwritten.
    ///
    /// Never panics, allocates or waits. A tool whose pose is not finite leaves the proxy and the
    /// bone as they are, gives no contact and is counted in [`RigidStep::fallbacks`].
    fn step(&mut self, bone: &BoneVolume, tool: &ToolState, drilling: bool, dt_ms: f32, out: &mut RigidStep);

    /// Where the tool is seen: what the hand asks for, held back by the bone.
    fn proxy(&self) -> Pose;

    /// Puts the proxy at `pose` and forgets all history, as after a tool change or a pause. What
    /// others change of the bone, an undone stroke too, is noticed without it.
    fn reset(&mut self, pose: Pose);

    /// Cuts by another law from now on. A method without a burr of its own ignores it.
    fn cut_by(&mut self, _law: RemovalLaw) {}
}

/// What one step found and did.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RigidStep {
    /// The contact. Its depth is how far the hand is from the proxy, its normal points out of the
    /// bone.
    pub manifold: ContactManifold,
    /// Bone removed in this step, mm³.
    pub removed_mm3: f32,
    /// Speed of the spindle under the load of the cut, 1/min; 0 when it has stalled or nothing is
    /// cut. The per-tick law knows none.
    pub spindle_rpm: f32,
    /// Whether the cut came through to where there is no bone for 3 mm ahead: the inner table of a
    /// skull drilled from outside.
    pub broke_through: bool,
    /// Points of the tool's surface that touch, in the method's own sampling.
    pub points_in_contact: u32,
    /// Voxels that are touched.
    pub voxels_in_contact: u32,
    /// Voxels visited by sweep and search.
    pub voxels_swept: u32,
    /// Times that the method had to fall back: pose not finite, way too long for one tick,
    /// constraints that contradict.
    pub fallbacks: u32,
}

impl RigidStep {
    /// Forgets everything.
    pub fn clear(&mut self) {
        self.manifold.clear();
        (self.removed_mm3, self.spindle_rpm, self.broke_through, self.fallbacks) = (0.0, 0.0, false, 0);
        (self.points_in_contact, self.voxels_in_contact, self.voxels_swept) = (0, 0, 0);
    }
}
