//! The frame of the penalty methods: feel the bone at the hand's own pose, push back in proportion,
//! remember nothing.
//!
//! # Theory
//! A [`PenaltyProbe`] looks at the bone with the tool where the hand has it and answers with a
//! normal and a depth. The proxy is drawn that depth out along the normal.
//!
//! # When not to use it
//! Against thin walls: past the middle of a wall the nearest way out leads to the far side, and a
//! fast tool is through between two ticks.

use crate::removal::{Burr, Cut, RemovalLaw};
use crate::rows::EVERYWHERE;
use crate::{RigidContact, RigidStep};
use trepan_geometry::{Pose, Tool, ToolState, Vec3};
use trepan_volume::BoneVolume;

/// Most voxels that a burr bites at once.
const MAX_BITES: usize = 16384;

/// What a penalty method knows to answer.
pub(crate) trait PenaltyProbe: Send {
    /// What the tool at `pose` feels; `None` without contact. Fills contacts and counts of `out`.
    fn feel(&mut self, bone: &BoneVolume, pose: &Pose, out: &mut RigidStep) -> Option<Felt>;
}

/// A contact as a whole.
pub(crate) struct Felt {
    /// Unit vector out of the bone.
    pub normal: Vec3,
    /// Depth along it, mm.
    pub depth_mm: f32,
    /// What the burr alone is pushed, mm: what it cuts with.
    pub burr: Vec3,
}

/// A tool handled by a penalty method.
pub(crate) struct Penalty<F> {
    feel: F,
    tool: Tool,
    proxy: Pose,
    burr: Burr,
}

impl<F: PenaltyProbe> Penalty<F> {
    pub fn new(tool: &Tool, feel: F, removal: RemovalLaw) -> Self {
        Self { feel, tool: *tool, proxy: Pose::IDENTITY, burr: Burr::new(removal, MAX_BITES) }
    }
}

impl<F: PenaltyProbe> RigidContact for Penalty<F> {
    fn step(&mut self, bone: &BoneVolume, tool: &ToolState, drilling: bool, dt_ms: f32, out: &mut RigidStep) {
        out.clear();
        if !tool.is_finite() {
            out.fallbacks = 1;
            return;
        }
        self.proxy = tool.world_from_tool;
        let (device, radius_mm) = (tool.tip(), self.tool.tip_radius_mm);
        let Some(Felt { normal, depth_mm, burr }) = self.feel.feel(bone, &tool.world_from_tool, out) else { return };
        self.proxy.translation += depth_mm * normal;
        out.manifold.normal = normal;
        out.manifold.depth_mm = depth_mm;
        out.manifold.point = self.proxy.translation - radius_mm * normal;
        if drilling && self.tool.kind.cuts() && burr != Vec3::ZERO {
            let cut =
                Cut { device, proxy: device + burr, radius_mm, depth_mm: burr.length(), dt_ms, within: EVERYWHERE };
            self.burr.cut(bone, &cut, |voxel| move |x| bone.hu(voxel.with_x(x)), out);
        }
    }

    fn proxy(&self) -> Pose {
        self.proxy
    }

    fn reset(&mut self, pose: Pose) {
        self.proxy = pose;
        self.burr.reset();
    }
}

/// The direction of `push` and `depth`, if both are something.
pub(crate) fn answer(push: Vec3, depth_mm: f32, out: &mut RigidStep) -> Option<Felt> {
    let normal = push.normalize_or_zero();
    if normal == Vec3::ZERO {
        // Opposed contacts cancel: there is no way to push.
        out.fallbacks += u32::from(out.points_in_contact > 0);
        return None;
    }
    (depth_mm > 0.0 && depth_mm.is_finite()).then_some(Felt { normal, depth_mm, burr: depth_mm * normal })
}
