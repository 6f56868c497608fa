//! Scripted operations for demonstrations, tests and machines without a device.
//!
//! # Theory
//! Between waypoints the tip follows the minimum-jerk trajectory of human reaching (Flash and Hogan
//! 1985, J. Neurosci. 5): `x(τ) = x₀ + (x₁ - x₀)(10τ³ - 15τ⁴ + 6τ⁵)`, τ = t/T. It starts and ends
//! at rest; its velocity is continuous and peaks at 15/8 of the mean. Velocities are its exact
//! derivative.
//!
//! # Practice
//! A script is a pure function of time: equal times give bit-identical states, in any order. The
//! tool's shaft (+z) points out of the patient along the hole.
//!
//! ```text
//!  approach     drill, pedal down     retreat  change  approach   three presses          leave
//!  ╲___________╲____________________╱─────────────────╲__________╲╱─╲╱─╲╱───────────────╱
//! ```
//!
//! # When not to use it
//! To predict what a person would feel or do: it does not yield to force. Use [`crate::simulated`]
//! for that.

mod operation;
mod path;

pub use operation::{Plan, Rim, Site, Target};
pub use path::Waypoint;

use crate::{Capabilities, HapticDevice, Reading, Status};
use path::Path;
use trepan_contact::GuardedWrench;
use trepan_geometry::{ToolState, Wrench};

/// The names of the operations that [`Script::named`] knows.
///
/// `aspirate` and `suck` are for the second hand: its tool approaches beside the burr and rests on
/// the bone, or takes some of the brain away while the first hand does `retract`. `arm` leaves the
/// spatula with an arm and takes a ball of tissue away beside it. `cut` opens the brain with
/// scissors along a line and draws the slit apart with the spatula.
/// `flap` cuts a bone flap with burr and craniotome, lifts it and probes the brain; give it a
/// minute. `press` and `retract` hold the brain aside with the probe and with the spatula. `resect`
/// opens a flap, takes a ball of tissue away with the aspirator, layer by layer, and goes around
/// the wound with the bipolar; `bleed` does so with a small ball.
pub const NAMES: [&str; 12] = [
    "craniotomy-and-probe",
    "craniotomy",
    "probe",
    "aspirate",
    "suck",
    "flap",
    "press",
    "retract",
    "arm",
    "cut",
    "resect",
    "bleed",
];

/// A script could not be made.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ScriptError {
    /// There is no such operation.
    #[error("there is no script {name:?}; the scripts are {}", NAMES.join(", "))]
    UnknownName {
        /// The requested name.
        name: String,
    },
    /// The duration is out of range.
    #[error("a script cannot last {duration_ms} ms; give more than 0 and at most 86400000 (a day)")]
    Duration {
        /// The requested duration, ms.
        duration_ms: f64,
    },
    /// The site is invalid.
    #[error("the site's {field} is {value}; it must be {wanted}")]
    Site {
        /// The invalid field.
        field: &'static str,
        /// Its value.
        value: String,
        /// The valid range.
        wanted: &'static str,
    },
}

/// A scripted operation, and the device that performs it.
#[derive(Clone, Debug)]
pub struct Script {
    name: &'static str,
    path: Path,
    applied: GuardedWrench,
    closed: bool,
}

impl Script {
    /// The operation `name` (see [`NAMES`]) at `site`, with the recommended [`Plan`].
    pub fn named(name: &str, site: &Site, duration_ms: f64) -> Result<Self, ScriptError> {
        Self::planned(name, site, duration_ms, &Plan::default())
    }

    /// The operation `name` at `site`, with the given plan.
    pub fn planned(name: &str, site: &Site, duration_ms: f64, plan: &Plan) -> Result<Self, ScriptError> {
        let Some(name) = NAMES.into_iter().find(|&known| known == name) else {
            return Err(ScriptError::UnknownName { name: name.to_owned() });
        };
        if !(duration_ms > 0.0 && duration_ms <= 86_400_000.0) {
            return Err(ScriptError::Duration { duration_ms });
        }
        site.check()?;
        let path = operation::path(name, site, plan, duration_ms);
        Ok(Self { name, path, applied: GuardedWrench::ZERO, closed: false })
    }

    /// The operation's name.
    pub fn name(&self) -> &'static str {
        self.name
    }

    /// When the operation ends, ms after its start.
    pub fn duration_ms(&self) -> f64 {
        self.path.end_ms()
    }

    /// The waypoints; the tool waits at the first at time 0.
    pub fn waypoints(&self) -> &[Waypoint] {
        self.path.waypoints()
    }

    /// The tool state at a time; before 0 it waits, after the end it rests.
    pub fn at(&self, time_ms: f64) -> ToolState {
        self.path.at(time_ms)
    }

    /// The wrench last applied.
    pub fn applied(&self) -> Wrench {
        self.applied.wrench()
    }
}

impl HapticDevice for Script {
    fn read(&mut self, time_ms: f64) -> Reading {
        let status = if time_ms > self.duration_ms() { Status::Finished } else { Status::Fresh };
        Reading { tool: self.at(time_ms), status }
    }

    fn apply(&mut self, wrench: GuardedWrench) {
        if !self.closed {
            self.applied = wrench;
        }
    }

    fn capabilities(&self) -> Capabilities {
        Capabilities::passive(format!("script:{}", self.name))
    }

    fn close(&mut self) {
        (self.applied, self.closed) = (GuardedWrench::ZERO, true);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use trepan_geometry::{Buttons, ToolKind, Vec3};

    fn site() -> Site {
        Site {
            entry: Vec3::new(30.0, 40.0, 90.0),
            inward: Vec3::new(-0.3, -0.4, -0.866).normalize(),
            bone_mm: 6.0,
            brain_mm: 8.5,
        }
    }

    /// Depth of the tip's centre below the entry, mm.
    fn depth(site: &Site, tool: &ToolState) -> f32 {
        (tool.tip() - site.entry).dot(site.inward)
    }

    fn ticks(script: &Script) -> impl Iterator<Item = ToolState> {
        (0..=script.duration_ms() as u32).map(|tick| script.at(f64::from(tick)))
    }

    #[test]
    fn every_name_builds_and_an_unknown_one_lists_them() {
        for name in NAMES {
            let script = Script::named(name, &site(), 20_000.0).unwrap();
            assert_eq!((script.name(), script.duration_ms()), (name, 20_000.0));
        }
        let error = Script::named("lobotomy", &site(), 1000.0).unwrap_err().to_string();
        assert!(NAMES.iter().all(|name| error.contains(name)), "{error}");
    }

    #[test]
    fn the_burr_breaks_through_and_stops_at_the_brain() {
        let (site, plan) = (site(), Plan::default());
        let script = Script::named("craniotomy", &site, 20_000.0).unwrap();
        let drilled = ticks(&script).filter(|tool| tool.buttons.has(Buttons::PEDAL));
        let deepest = drilled.map(|tool| depth(&site, &tool)).fold(f32::MIN, f32::max);
        let foremost = deepest + plan.burr_radius_mm;
        assert!(foremost > site.bone_mm + 0.5, "foremost point {foremost} mm below the entry");
        assert!(foremost < site.brain_mm + plan.burr_overlap_mm + 1e-3, "foremost point {foremost} mm below the entry");
        let hole = (plan.burr_radius_mm.powi(2) - (site.bone_mm - deepest).max(0.0).powi(2)).sqrt();
        assert!(hole > plan.probe_radius_mm, "hole of {hole} mm");
        let share = ticks(&script).filter(|tool| tool.buttons.has(Buttons::PEDAL)).count() as f64 / 20_000.0;
        assert!(share > 0.4, "drilling for {share} of the time");
    }

    #[test]
    fn three_presses_reach_four_to_six_millimetres() {
        let (site, plan) = (site(), Plan::default());
        let script = Script::named("craniotomy-and-probe", &site, 20_000.0).unwrap();
        let changed = ticks(&script).position(|tool| tool.buttons.taken().is_some()).unwrap();
        let into_brain: Vec<f32> = ticks(&script)
            .skip(changed)
            .map(|tool| depth(&site, &tool) + plan.probe_radius_mm - site.brain_mm)
            .collect();
        let mut peaks = Vec::new();
        for press in into_brain.chunk_by(|a, b| (*a > 0.0) == (*b > 0.0)).filter(|chunk| chunk[0] > 0.0) {
            peaks.push(press.iter().copied().fold(0.0, f32::max));
        }
        assert_eq!(peaks.len(), 3, "{peaks:?}");
        assert!(peaks.iter().all(|p| (3.99..=6.01).contains(p)), "{peaks:?}");
    }

    #[test]
    fn a_press_and_a_retraction_hold_the_brain_at_their_depth() {
        let (site, plan) = (site(), Plan::default());
        for (name, radius_mm, aside_mm) in
            [("press", plan.probe_radius_mm, 0.0), ("retract", plan.spatula_radius_mm, plan.retract_mm[1])]
        {
            let script = Script::named(name, &site, 20_000.0).unwrap();
            let deep: Vec<ToolState> =
                ticks(&script).filter(|t| depth(&site, t) + radius_mm > site.brain_mm + 2.99).collect();
            let (first, last) = (deep[0].tip(), deep[deep.len() - 1].tip());
            assert!(deep.len() > 3000 && ((last - first).length() - aside_mm).abs() < 0.2, "{name}: {}", deep.len());
            let still = deep.iter().filter(|t| t.twist.linear == Vec3::ZERO).count();
            assert!(still > 3000, "{name}: {still} ms at rest");
        }
    }

    #[test]
    fn the_aspirator_stays_beside_the_burr_and_presses_no_button() {
        let (site, plan) = (site(), Plan::default());
        let burr = Script::named("craniotomy", &site, 20_000.0).unwrap();
        let aspirator = Script::named("aspirate", &site, 20_000.0).unwrap();
        let radii = plan.burr_radius_mm + plan.aspirator_radius_mm;
        for (burr, tool) in ticks(&burr).zip(ticks(&aspirator)) {
            assert!(tool.tip().distance(burr.tip()) > radii + 1.0, "{} {}", tool.tip(), burr.tip());
            assert_eq!(tool.buttons.0, 0);
        }
        let deepest = ticks(&aspirator).map(|tool| depth(&site, &tool)).fold(f32::MIN, f32::max);
        assert!(deepest + plan.aspirator_radius_mm > 0.4, "it touches: {deepest}");
    }

    #[test]
    fn the_second_hand_sucks_beside_the_spatula_that_holds_the_brain_aside() {
        let site = site();
        let [spatula, tube] = ["retract", "suck"].map(|name| Script::named(name, &site, 60_000.0).unwrap());
        let sucks: Vec<usize> = (0..60_000).filter(|&ms| tube.at(ms as f64).buttons.has(Buttons::PEDAL)).collect();
        assert!(sucks.len() > 10_000 && sucks[0] > 30_000, "{} from {}", sucks.len(), sucks[0]);
        let nearest = sucks.iter().map(|&ms| tube.at(ms as f64).tip().distance(spatula.at(ms as f64).tip()));
        assert!(nearest.fold(f32::MAX, f32::min) > 1.5, "the tube is not where the spatula is");
    }

    #[test]
    fn a_flap_is_cut_all_around_below_the_bone_and_lifted_with_the_tool_away() {
        let (site, plan) = (site(), Plan::default());
        let script = Script::named("flap", &site, 60_000.0).unwrap();
        let all: Vec<ToolState> = ticks(&script).collect();
        let cut = all.iter().filter(|t| t.buttons.has(Buttons::PEDAL) && depth(&site, t) > site.bone_mm);
        let foot: Vec<Vec3> = cut.map(|t| t.tip() - site.entry).collect();
        assert!(foot.len() > 25_000, "{}", foot.len());
        for tip in &foot[2_000..foot.len() - 2_000] {
            assert!((tip.dot(site.inward) - site.bone_mm - plan.foot_mm).abs() < 0.1, "{tip}");
            assert!((tip.reject_from(site.inward).length() - 10.0).abs() < 0.2, "{tip}");
        }
        let lift = all.iter().position(|t| t.buttons.has(Buttons::FLAP)).unwrap();
        let taken: Vec<_> = all.iter().filter_map(|t| t.buttons.taken()).collect::<Vec<_>>();
        assert!(depth(&site, &all[lift]) < -30.0);
        assert_eq!((taken[0], taken[taken.len() - 1]), (ToolKind::Craniotome, ToolKind::Probe));
    }

    #[test]
    fn a_resection_covers_its_target_through_a_keyhole_with_the_pedal_down() {
        let site = site();
        let target = Target { centre: site.entry + 16.0 * site.inward, radius_mm: 7.5, sinks_mm: 0.0 };
        let plan = Plan { target: Some(target), ..Plan::default() };
        let script = Script::planned("resect", &site, 120_000.0, &plan).unwrap();
        let all: Vec<ToolState> = ticks(&script).collect();
        let taken = all.iter().position(|t| t.buttons.taken() == Some(ToolKind::Aspirator)).unwrap();
        let closes = all.iter().position(|t| t.buttons.taken() == Some(ToolKind::Bipolar)).unwrap();
        let pressed = |t: &&ToolState| t.buttons.has(Buttons::PEDAL);
        let tips: Vec<&ToolState> = all[taken..closes].iter().filter(pressed).collect();
        let tip_mm = plan.aspirator_radius_mm;
        let inside = |t: &&&ToolState| depth(&site, t) > 10.1;
        for tool in tips.iter().filter(inside) {
            assert!(
                tool.tip().distance(target.centre) < target.radius_mm - tip_mm + 0.1,
                "never beyond: {}",
                tool.tip()
            );
            let shaft = tool.world_from_tool.rotation * Vec3::Z;
            let way = (site.entry - tool.tip()).dot(-site.inward);
            let crosses = tool.tip() + shaft * way / shaft.dot(-site.inward);
            assert!(way < 12.0 || crosses.distance(site.entry) < 0.1, "through the keyhole: {crosses}");
        }
        let grid = (0..512).map(|n| Vec3::new((n % 8) as f32, (n / 8 % 8) as f32, (n / 64) as f32) * 2.0 - 7.0);
        let places: Vec<Vec3> = grid.filter(|at| at.length() < target.radius_mm).map(|at| target.centre + at).collect();
        let near = |at: &&Vec3| tips.iter().any(|t| t.tip().distance(**at) < tip_mm + 0.3);
        let reached = places.iter().filter(near).count();
        assert!(20 * reached > 19 * places.len(), "{reached} of {} places", places.len());
        let burns: Vec<&ToolState> = all[closes..].iter().filter(pressed).collect();
        let wall = places.iter().filter(|at| at.distance(target.centre) > 6.5);
        let far = wall.filter(|at| burns.iter().all(|t| t.tip().distance(**at) > 2.5)).count();
        assert_eq!(far, 0, "the bipolar comes near every place of the wall");
        let (a, b) = (script.at(90_000.0), script.at(90_001.0));
        let turn = (b.world_from_tool.rotation * a.world_from_tool.rotation.inverse()).to_scaled_axis();
        assert!((turn - script.at(90_000.5).twist.angular).length() < 1e-4, "{turn}");
    }

    #[test]
    fn the_next_tool_is_asked_for_once_and_far_from_the_patient() {
        let script = Script::named("craniotomy-and-probe", &site(), 20_000.0).unwrap();
        let all: Vec<ToolState> = ticks(&script).collect();
        let presses = all.windows(2).filter(|w| w[0].buttons.taken().is_none() && w[1].buttons.taken().is_some());
        assert_eq!(presses.count(), 1);
        assert!(all.iter().filter(|t| t.buttons.taken().is_some()).all(|t| depth(&site(), t) < -30.0));
    }

    #[test]
    fn the_shaft_points_out_along_the_hole() {
        for inward in [Vec3::NEG_Z, Vec3::Z, Vec3::X, site().inward] {
            let script = Script::named("probe", &Site { inward, ..site() }, 1000.0).unwrap();
            assert!((script.at(500.0).world_from_tool.rotation * Vec3::Z + inward).length() < 1e-5);
        }
    }

    #[test]
    fn unusable_sites_and_durations_are_named() {
        let named = |site: &Site, ms: f64| Script::named("probe", site, ms).unwrap_err().to_string();
        assert!(named(&Site { inward: Vec3::ZERO, ..site() }, 1.0).contains("inward"));
        assert!(named(&Site { entry: Vec3::NAN, ..site() }, 1.0).contains("entry"));
        assert!(named(&Site { bone_mm: -1.0, ..site() }, 1.0).contains("bone_mm"));
        assert!(named(&Site { brain_mm: f32::NAN, ..site() }, 1.0).contains("brain_mm"));
        for duration in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert!(matches!(Script::named("probe", &site(), duration), Err(ScriptError::Duration { .. })));
        }
    }

    #[test]
    fn after_its_end_it_is_finished_and_at_rest() {
        let mut script = Script::named("craniotomy", &site(), 500.0).unwrap();
        assert_eq!(script.read(500.0).status, Status::Fresh);
        let end = script.read(501.0);
        assert_eq!((end.status, end.tool.twist.linear), (Status::Finished, Vec3::ZERO));
        assert!(depth(&site(), &end.tool) < -30.0);
    }

    proptest! {
        #[test]
        fn motion_is_continuous_and_velocity_is_its_derivative(name in 0..NAMES.len(), duration_ms in 50.0f64..60_000.0, at in 0.0f64..1.0) {
            let script = Script::named(NAMES[name], &site(), duration_ms).unwrap();
            let (t, h) = (at * duration_ms, duration_ms * 1e-4);
            let (a, b) = (script.at(t), script.at(t + h));
            let mean = (b.tip() - a.tip()) / h as f32;
            let mean_speed = |w: &[Waypoint]| w[1].tip.distance(w[0].tip) / (w[1].time_ms - w[0].time_ms).max(1e-9) as f32;
            let bound = 1.876 * script.waypoints().windows(2).map(mean_speed).fold(0.0, f32::max);
            prop_assert!(a.twist.linear.length() <= bound, "{} > {}", a.twist.linear.length(), bound);
            let middle = script.at(t + h / 2.0).twist.linear;
            prop_assert!((mean - middle).length() < 0.01 * bound + 1e-4 / h as f32, "{} against {}", mean, middle);
            prop_assert!(a.is_finite());
        }
    }
}
