//! Tool motion and loads: twist, wrench, tool state.

use crate::{Pose, ToolKind, Vec3};

/// Velocity of a rigid body, world axes, at the tool's origin.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Twist {
    /// Linear velocity, mm/ms.
    pub linear: Vec3,
    /// Angular velocity, rad/ms.
    pub angular: Vec3,
}

/// Force and torque on a rigid body, world axes, at the tool's origin.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Wrench {
    /// Force, N.
    pub force: Vec3,
    /// Torque, N mm.
    pub torque: Vec3,
}

impl Wrench {
    /// No force, no torque.
    pub const ZERO: Self = Self { force: Vec3::ZERO, torque: Vec3::ZERO };

    /// Whether all six numbers are finite.
    #[inline]
    pub fn is_finite(&self) -> bool {
        self.force.is_finite() && self.torque.is_finite()
    }
}

impl core::ops::Add for Wrench {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self { force: self.force + other.force, torque: self.torque + other.torque }
    }
}

/// Pressed buttons, one bit each.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Buttons(pub u32);

impl Buttons {
    /// The drill's foot pedal.
    pub const PEDAL: Self = Self(1);
    /// Requests the next tool.
    pub const NEXT_TOOL: Self = Self(2);
    /// Requests an undo of the burr's last stroke.
    pub const UNDO: Self = Self(4);

    /// Requests that the bone flap, once free, be lifted away or put back.
    pub const FLAP: Self = Self(8);

    /// A teacher's pause: no force, and other buttons are ignored.
    pub const PAUSE: Self = Self(16);

    /// Requests a redo of the stroke that was undone last.
    pub const REDO: Self = Self(32);

    /// Requests that an arm hold the tool where it is, or that the arm be taken away.
    pub const ARM: Self = Self(64);

    /// Requests a tool of a kind; with one in the hand, the next of that kind.
    pub fn take(kind: ToolKind) -> Self {
        Self((kind as u32 + 1) << 8)
    }

    /// The requested kind of tool.
    pub fn taken(self) -> Option<ToolKind> {
        let wanted = (self.0 >> 8 & 0xf).checked_sub(1)?;
        ToolKind::ALL.into_iter().find(|kind| *kind as u32 == wanted)
    }

    /// Requests the tool in a slot of the tray, from 0; there are at most 15.
    pub fn slot(slot: usize) -> Self {
        Self((slot.min(14) as u32 + 1) << 12)
    }

    /// The requested slot of the tray.
    pub fn in_slot(self) -> Option<usize> {
        (self.0 >> 12 & 0xf).checked_sub(1).map(|slot| slot as usize)
    }

    /// Whether every button of `other` is pressed.
    #[inline]
    pub fn has(self, other: Self) -> bool {
        self.0 & other.0 == other.0
    }
}

impl std::ops::BitOr for Buttons {
    type Output = Self;

    fn bitor(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }
}

/// The tool at one instant, in world space.
#[derive(Clone, Copy, Debug)]
pub struct ToolState {
    /// Pose of the tool frame: origin at the centre of the tip, +z along the shaft, away from the
    /// patient.
    pub world_from_tool: Pose,
    /// Velocity of the tool.
    pub twist: Twist,
    /// Pressed buttons.
    pub buttons: Buttons,
    /// Time of measurement, ms since the session began.
    pub time_ms: f64,
}

impl ToolState {
    /// A tool at rest.
    #[inline]
    pub fn at(world_from_tool: Pose) -> Self {
        Self { world_from_tool, twist: Twist::default(), buttons: Buttons::default(), time_ms: 0.0 }
    }

    /// Centre of the tip, world mm.
    #[inline]
    pub fn tip(&self) -> Vec3 {
        self.world_from_tool.translation
    }

    /// Velocity of the tool's body at a world point, mm/ms.
    #[inline]
    pub fn velocity_at(&self, point: Vec3) -> Vec3 {
        self.twist.linear + self.twist.angular.cross(point - self.tip())
    }

    /// Whether pose and velocity are all finite and the rotation is a unit quaternion to 1e-3.
    #[inline]
    pub fn is_finite(&self) -> bool {
        let pose = &self.world_from_tool;
        pose.translation.is_finite()
            && pose.rotation.is_finite()
            && (pose.rotation.length_squared() - 1.0).abs() < 1e-3
            && self.twist.linear.is_finite()
            && self.twist.angular.is_finite()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_nan_pose_is_noticed() {
        let mut tool = ToolState::at(Pose::from_translation(Vec3::ONE));
        assert!(tool.is_finite());
        tool.world_from_tool.translation.y = f32::NAN;
        assert!(!tool.is_finite());
    }

    #[test]
    fn buttons_combine() {
        let both = Buttons::PEDAL | Buttons::NEXT_TOOL | Buttons::ARM;
        assert!(both.has(Buttons::PEDAL) && both.has(Buttons::NEXT_TOOL));
        assert!(!Buttons::PEDAL.has(Buttons(3)));
        for (at, kind) in ToolKind::ALL.into_iter().enumerate() {
            let asks = Buttons::take(kind) | Buttons::slot(at) | Buttons::UNDO;
            assert_eq!((asks.taken(), asks.in_slot(), asks.has(Buttons::PEDAL)), (Some(kind), Some(at), false));
        }
        assert_eq!((both.taken(), both.in_slot()), (None, None));
        let recorded = [ToolKind::Burr, ToolKind::Aspirator, ToolKind::Bipolar].map(Buttons::take);
        assert_eq!(recorded, [1, 6, 7].map(|kind| Buttons(kind << 8)), "a recording holds the kind by its number");
    }
}
