//! Minimum-jerk motion through waypoints.

use trepan_geometry::{Buttons, Pose, Quat, ToolState, Twist, Vec3};

/// A station of a scripted way.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Waypoint {
    /// What the hand does until it is here.
    pub label: &'static str,
    /// When the tip is here, ms.
    pub time_ms: f64,
    /// Centre of the tip, world mm.
    pub tip: Vec3,
    /// What is pressed on the way here.
    pub buttons: Buttons,
}

/// A way through waypoints in one orientation. There is at least one waypoint and times never
/// decrease.
#[derive(Clone, Debug)]
pub(super) struct Path {
    waypoints: Vec<Waypoint>,
    rotation: Quat,
}

impl Path {
    /// Waits at `start`, then goes on with [`Path::to`].
    pub(super) fn from(start: Vec3, rotation: Quat) -> Self {
        let first = Waypoint { label: "wait", time_ms: 0.0, tip: start, buttons: Buttons::default() };
        Self { waypoints: vec![first], rotation }
    }

    /// Goes on to `tip` in `duration_ms`.
    pub(super) fn to(&mut self, label: &'static str, duration_ms: f64, tip: Vec3, buttons: Buttons) {
        self.waypoints.push(Waypoint { label, time_ms: self.end_ms() + duration_ms, tip, buttons });
    }

    pub(super) fn waypoints(&self) -> &[Waypoint] {
        &self.waypoints
    }

    pub(super) fn end_ms(&self) -> f64 {
        self.waypoints[self.waypoints.len() - 1].time_ms
    }

    /// Sets the end exactly, after shares that did not add up to it by rounding.
    pub(super) fn end_at(&mut self, time_ms: f64) {
        if let Some(last) = self.waypoints.last_mut() {
            last.time_ms = time_ms;
        }
    }

    /// The tool at a time. Not a number counts as the start.
    pub(super) fn at(&self, time_ms: f64) -> ToolState {
        let after = self.waypoints.partition_point(|waypoint| waypoint.time_ms < time_ms);
        let (tip, linear, buttons) = match (after.checked_sub(1).map(|i| &self.waypoints[i]), self.waypoints.get(after))
        {
            (Some(from), Some(to)) => {
                let (tip, linear) = minimum_jerk(from, to, time_ms);
                (tip, linear, to.buttons)
            }
            (None, Some(first)) => (first.tip, Vec3::ZERO, first.buttons),
            (_, None) => (self.waypoints[self.waypoints.len() - 1].tip, Vec3::ZERO, Buttons::default()),
        };
        ToolState {
            world_from_tool: Pose::from_parts(tip, self.rotation),
            twist: Twist { linear, angular: Vec3::ZERO },
            buttons,
            time_ms,
        }
    }
}

/// Position and velocity between two waypoints; `from.time_ms < time_ms <= to.time_ms`.
fn minimum_jerk(from: &Waypoint, to: &Waypoint, time_ms: f64) -> (Vec3, Vec3) {
    let duration_ms = to.time_ms - from.time_ms;
    let t = (time_ms - from.time_ms) / duration_ms;
    let along = t * t * t * (10.0 + t * (-15.0 + 6.0 * t));
    let rate = 30.0 * t * t * (1.0 - t) * (1.0 - t) / duration_ms;
    let (start, way) = (from.tip.as_dvec3(), to.tip.as_dvec3() - from.tip.as_dvec3());
    ((start + way * along).as_vec3(), (way * rate).as_vec3())
}
