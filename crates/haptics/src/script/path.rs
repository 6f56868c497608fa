//! Minimum-jerk motion through waypoints, upright or through a keyhole.

use trepan_geometry::{Buttons, Pose, Quat, ToolState, Twist, Vec3};

/// A waypoint of a scripted path.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Waypoint {
    /// What the tool does on the way to this waypoint.
    pub label: &'static str,
    /// When the tip arrives here, ms.
    pub time_ms: f64,
    /// Centre of the tip, world mm.
    pub tip: Vec3,
    /// Buttons pressed on the way here.
    pub buttons: Buttons,
}

/// Least depth below a keyhole at which the shaft is aimed at it, mm; above, it turns upright.
const LEVER_MM: f32 = 12.0;
/// Time over which an angular velocity is taken, ms.
const TURN_MS: f64 = 1.0;

/// A path through waypoints in one orientation, or with the shaft through a keyhole. It has at
/// least one waypoint, and times never decrease.
#[derive(Clone, Debug)]
pub(super) struct Path {
    waypoints: Vec<Waypoint>,
    rotation: Quat,
    /// The keyhole, and from when on the shaft goes through it, ms.
    keyhole: Option<(Vec3, f64)>,
}

impl Path {
    /// Starts a path at `start`; continue with [`Path::to`].
    pub(super) fn from(start: Vec3, rotation: Quat) -> Self {
        let first = Waypoint { label: "wait", time_ms: 0.0, tip: start, buttons: Buttons::default() };
        Self { waypoints: vec![first], rotation, keyhole: None }
    }

    /// From now on, aims the shaft at a point from below it; far above, it is upright.
    pub(super) fn through(&mut self, keyhole: Vec3) {
        self.keyhole = self.keyhole.or(Some((keyhole, self.end_ms())));
    }

    /// The tool's rotation with its tip at a place.
    fn rotation_at(&self, tip: Vec3, time_ms: f64) -> Quat {
        let Some((keyhole, _)) = self.keyhole.filter(|(_, from_ms)| time_ms >= *from_ms) else { return self.rotation };
        let outward = self.rotation * Vec3::Z;
        let (way, aside) = ((keyhole - tip).dot(outward), (keyhole - tip).reject_from(outward));
        let share = ((way + LEVER_MM) / LEVER_MM).clamp(0.0, 1.0);
        let aim = outward + share * aside / way.max(LEVER_MM);
        Quat::from_rotation_arc(outward, aim.normalize()) * self.rotation
    }

    /// Appends a move to `tip` in `duration_ms`.
    pub(super) fn to(&mut self, label: &'static str, duration_ms: f64, tip: Vec3, buttons: Buttons) {
        self.waypoints.push(Waypoint { label, time_ms: self.end_ms() + duration_ms, tip, buttons });
    }

    pub(super) fn waypoints(&self) -> &[Waypoint] {
        &self.waypoints
    }

    pub(super) fn end_ms(&self) -> f64 {
        self.waypoints[self.waypoints.len() - 1].time_ms
    }

    /// Sets the exact end time, which rounding of the shares may have missed.
    pub(super) fn end_at(&mut self, time_ms: f64) {
        if let Some(last) = self.waypoints.last_mut() {
            last.time_ms = time_ms;
        }
    }

    /// The tool at a time; NaN counts as the start.
    pub(super) fn at(&self, time_ms: f64) -> ToolState {
        let (tip, linear, buttons) = self.tip_at(time_ms);
        let rotation = self.rotation_at(tip, time_ms);
        let angular = match self.keyhole {
            Some(_) => {
                let [before, after] = [-0.5, 0.5].map(|share| self.tip_at(time_ms + share * TURN_MS).0);
                let turn = self.rotation_at(after, time_ms) * self.rotation_at(before, time_ms).inverse();
                turn.to_scaled_axis() / TURN_MS as f32
            }
            None => Vec3::ZERO,
        };
        let world_from_tool = Pose::from_parts(tip, rotation);
        ToolState { world_from_tool, twist: Twist { linear, angular }, buttons, time_ms }
    }

    /// Tip, its velocity, mm/ms, and the buttons at a time.
    fn tip_at(&self, time_ms: f64) -> (Vec3, Vec3, Buttons) {
        let after = self.waypoints.partition_point(|waypoint| waypoint.time_ms < time_ms);
        match (after.checked_sub(1).map(|i| &self.waypoints[i]), self.waypoints.get(after)) {
            (Some(from), Some(to)) => {
                let (tip, linear) = minimum_jerk(from, to, time_ms);
                (tip, linear, to.buttons)
            }
            (None, Some(first)) => (first.tip, Vec3::ZERO, first.buttons),
            (_, None) => (self.waypoints[self.waypoints.len() - 1].tip, Vec3::ZERO, Buttons::default()),
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
