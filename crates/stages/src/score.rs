//! Scores of a session, accumulated tick by tick.
//!
//! # Theory
//! - Tip of the tool: path, idle time and smoothness (`motion.rs`).
//! - Burr: drilling time, volume of bone removed, plunge (depth of its ball past the brain's rest
//!   surface), separate touches of the brain.
//! - Probe on the brain: time, impulse `∫ F dt` and largest force.
//! - Changes of the tool.
//!
//! They are physical quantities; none is validated against clinical skill.

use crate::force_scale::ForceScale;
use crate::motion::Motion;
use serde::Serialize;
use trepan_geometry::Vec3;
use trepan_link::wire::TickRecord;

/// Running sums of the scores.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct ScoreKeeper {
    /// Path of the tip, mm.
    pub path_mm: f64,
    /// Time in which the tip was slower than 5 mm/s, s.
    pub idle_s: f64,
    /// Smoothness of the tip's motion below 5 Hz, larger is smoother; `null` without motion.
    pub log_dimensionless_jerk: Option<f64>,
    /// Tools taken after the first.
    pub tool_changes: u32,
    /// Time of drilling, s.
    pub drilling_s: f64,
    /// Bone removed, mm³.
    pub bone_removed_mm3: f64,
    /// Strokes of the burr that came through the bone.
    pub times_through: u32,
    /// Largest depth of the cutting part past the brain's rest surface, mm. A craniotome's foot
    /// does not cut.
    pub plunge_mm: f32,
    /// Separate touches of the brain's rest surface, where the dura lies, with a tool for bone.
    pub burr_touches_of_brain: u32,
    /// Time of these touches, s.
    pub burr_on_brain_s: f64,
    /// Largest force of the task during them, N.
    pub peak_burr_on_brain_n: f32,
    /// Time in which the tool pressed on tissue, s.
    pub tissue_s: f64,
    /// Force of the tissue on the hand, integrated over that time, N s, without the force of bone.
    pub tissue_impulse_n_s: f64,
    /// Largest force of the tissue on the hand, N.
    pub peak_tissue_force_n: f32,
    /// Largest depth of the probe in tissue, mm.
    pub peak_tissue_depth_mm: f32,
    /// Largest depth of a tool for the brain past its rest surface, mm.
    pub deepest_press_mm: f32,
    /// Longest time in which the tool rested on tissue, s: its tip stayed within 0.5 mm.
    pub longest_hold_s: f64,
    /// Largest force of bone, N of the task.
    pub peak_bone_force_n: f32,
    /// Largest force on the hand, N.
    pub hand_peak_force_n: f32,
    /// Largest change of the force on the hand between two ticks, N.
    pub hand_peak_force_step_n: f32,
    /// Newtons at the hand per newton of the task, on bone.
    #[serde(skip)]
    force_scale: ForceScale,
    /// How far the hand was past the brain's rest surface at the largest force of the tissue, and
    /// how deep in its present surface, mm.
    #[serde(skip)]
    pub peak_tissue: [f32; 2],
    /// Force of bone on the hand while it is cut, integrated over time, N s, and that time, s.
    #[serde(skip)]
    pub cutting: [f64; 2],
    /// Time of undoing and redoing, ms.
    #[serde(skip)]
    undoing_ms: f64,
    #[serde(skip)]
    motion: Motion,
    #[serde(skip)]
    tool: u8,
    /// Where the tool came to rest on tissue, and the time since, s.
    #[serde(skip)]
    rest: Option<(Vec3, f64)>,
    #[serde(skip)]
    last_force: Vec3,
    #[serde(skip)]
    touching: bool,
    #[serde(skip)]
    last_ms: Option<f64>,
}

/// Longest time that counts for one tick, s.
const MAX_TICK_S: f64 = 0.1;

/// Distance within which a tip rests, mm: over the tremor of a hand, some 0.1 mm. A numerical
/// parameter.
const REST_MM: f32 = 0.5;

/// Whether a tool for bone is past the brain's rest surface. This is a touch of the brain in
/// warnings and scores.
pub fn cuts_into_brain(record: &TickRecord) -> bool {
    record.phase == 0 && record.brain_distance_mm <= 0.0
}

impl ScoreKeeper {
    /// Makes the sums of a session whose device has a force scale.
    pub fn at(force_scale: ForceScale) -> Self {
        Self { force_scale, ..Self::default() }
    }

    /// Returns the time of the newest tick, ms; 0 before the first.
    pub fn time_ms(&self) -> f64 {
        self.last_ms.unwrap_or(0.0)
    }

    /// Adds a tick, weighted with the time since the last.
    pub fn add(&mut self, record: &TickRecord) {
        let since_s = self.last_ms.map_or(0.0, |last| 1e-3 * (record.time_ms - last));
        let undoes = record.has(TickRecord::UNDOING);
        let (force, seconds) = (record.wrench.force, if undoes { 0.0 } else { since_s.clamp(0.0, MAX_TICK_S) });
        self.last_ms = Some(record.time_ms);
        // Undoing takes no time: the motion goes on where it was.
        self.undoing_ms += if undoes { 1e3 * since_s } else { 0.0 };
        if !undoes {
            self.motion.add(record.time_ms - self.undoing_ms, record.proxy.translation);
        }
        (self.path_mm, self.idle_s) = (self.motion.path_mm, self.motion.idle_s);
        self.log_dimensionless_jerk = self.motion.log_dimensionless_jerk();
        self.tool_changes += u32::from(record.tool != self.tool);
        self.tool = record.tool;
        self.hand_peak_force_n = self.hand_peak_force_n.max(force.length());
        self.peak_bone_force_n = self.peak_bone_force_n.max(self.force_scale.bone_n(record));
        self.hand_peak_force_step_n = self.hand_peak_force_step_n.max((force - self.last_force).length());
        self.last_force = force;
        self.bone_removed_mm3 += f64::from(record.removed_mm3);
        self.times_through += u32::from(record.has(TickRecord::THROUGH));
        if record.has(TickRecord::DRILLING) {
            self.drilling_s += seconds;
            if record.depth_mm > 0.0 {
                let bone_n = f64::from((force - record.tissue_force).length());
                self.cutting = [self.cutting[0] + seconds * bone_n, self.cutting[1] + seconds];
            }
        }
        self.follow_rest(record, seconds);
        if record.phase == 0 {
            self.plunge_mm = self.plunge_mm.max(-record.brain_distance_mm);
            let touching = cuts_into_brain(record);
            self.burr_touches_of_brain += u32::from(touching && !self.touching);
            if touching {
                self.burr_on_brain_s += seconds;
                self.peak_burr_on_brain_n = self.peak_burr_on_brain_n.max(self.force_scale.task_n(record));
            }
            self.touching = touching;
        } else if record.tissue_depth_mm > 0.0 {
            self.tissue_s += seconds;
            self.deepest_press_mm = self.deepest_press_mm.max(-record.brain_distance_mm);
            self.tissue_impulse_n_s += seconds * f64::from(record.tissue_n());
            self.peak_tissue_depth_mm = self.peak_tissue_depth_mm.max(record.tissue_depth_mm);
            if record.tissue_n() > self.peak_tissue_force_n {
                self.peak_tissue_force_n = record.tissue_n();
                self.peak_tissue = [-record.brain_distance_mm, record.tissue_depth_mm];
            }
        }
    }

    /// Measures how long the tool rests on tissue.
    fn follow_rest(&mut self, record: &TickRecord, seconds: f64) {
        let tip = record.proxy.translation;
        self.rest = match self.rest {
            _ if record.phase == 0 || record.tissue_depth_mm <= 0.0 => None,
            Some((at, since_s)) if at.distance(tip) <= REST_MM => Some((at, since_s + seconds)),
            _ => Some((tip, 0.0)),
        };
        self.longest_hold_s = self.rest.map_or(self.longest_hold_s, |(_, s)| self.longest_hold_s.max(s));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use trepan_geometry::{Pose, Quat, Wrench};

    #[test]
    fn undoing_costs_no_time() {
        let score = |undoing: std::ops::Range<u16>| {
            let mut keeper = ScoreKeeper::default();
            for i in 0..300u16 {
                let flags = if undoing.contains(&i) { TickRecord::UNDOING } else { 0 };
                keeper.add(&TickRecord { time_ms: f64::from(i), flags, ..TickRecord::default() });
            }
            keeper.idle_s
        };
        assert!((score(0..0) - score(100..200) - 0.1).abs() < 0.021, "{} {}", score(0..0), score(100..200));
    }

    #[test]
    fn the_force_of_bone_is_of_the_task_and_apart_from_that_of_tissue() {
        let wrench = Wrench { force: 3.0 * Vec3::Z, torque: Vec3::ZERO };
        let mut keeper = ScoreKeeper::at(ForceScale(0.2));
        keeper.add(&TickRecord { wrench, phase: 1, tissue_depth_mm: 1.0, ..TickRecord::default() });
        assert_eq!((keeper.peak_bone_force_n, keeper.hand_peak_force_n), (0.0, 3.0), "no bone is touched");
        keeper.add(&TickRecord { wrench, depth_mm: 0.1, time_ms: 1.0, ..TickRecord::default() });
        assert_eq!((keeper.peak_bone_force_n, keeper.hand_peak_force_n), (15.0, 3.0));
    }

    #[test]
    fn a_hold_is_the_longest_rest_on_tissue() {
        let mut keeper = ScoreKeeper::default();
        for i in 0..3000u16 {
            // 1 s at rest, 0.1 s of motion, then 1.5 s at rest; in between the tissue is left.
            let x = if i < 1000 { 0.0 } else { 0.05 * f32::from(i.min(1100) - 1000) };
            let tissue_depth_mm = if i < 2600 { 1.0 } else { 0.0 };
            let proxy = Pose::from_translation(Vec3::new(x, 0.0, 0.0));
            let (time_ms, brain_distance_mm) = (f64::from(i), -2.5);
            keeper.add(&TickRecord {
                time_ms,
                phase: 1,
                proxy,
                tissue_depth_mm,
                brain_distance_mm,
                ..Default::default()
            });
        }
        assert!((keeper.longest_hold_s - 1.5).abs() < 0.02, "{}", keeper.longest_hold_s);
        assert_eq!(keeper.deepest_press_mm, 2.5);
    }

    #[test]
    fn a_known_path_gives_known_scores() {
        let mut keeper = ScoreKeeper::default();
        for i in 0..=100u16 {
            let x = f32::from(i) * 0.1;
            let record = TickRecord {
                proxy: Pose::from_parts(Vec3::new(x, 0.0, 0.0), Quat::IDENTITY),
                wrench: Wrench { force: Vec3::new(0.0, 0.0, if i < 50 { 1.0 } else { 0.25 }), torque: Vec3::ZERO },
                removed_mm3: 0.5,
                brain_distance_mm: if (20..30).contains(&i) || i == 40 { -0.75 } else { 3.0 },
                time_ms: 20.0 * f64::from(i),
                flags: TickRecord::DRILLING | if i % 50 == 7 { TickRecord::THROUGH } else { 0 },
                ..TickRecord::default()
            };
            keeper.add(&record);
        }
        // From the middle of the first step to that of the last.
        assert!((keeper.path_mm - 9.9).abs() < 1e-4, "{}", keeper.path_mm);
        assert!((keeper.drilling_s - 2.0).abs() < 1e-9);
        assert!((keeper.bone_removed_mm3 - 50.5).abs() < 1e-9);
        assert_eq!((keeper.plunge_mm, keeper.burr_touches_of_brain), (0.75, 2));
        assert!((keeper.burr_on_brain_s - 0.22).abs() < 1e-9 && keeper.peak_burr_on_brain_n == 1.0);
        assert_eq!(keeper.times_through, 2);
        assert_eq!((keeper.hand_peak_force_n, keeper.hand_peak_force_step_n), (1.0, 1.0));
        for i in 0..200u16 {
            let wrench = Wrench { force: Vec3::Y * 0.5, torque: Vec3::ZERO };
            let (time_ms, tissue_depth_mm) = (2001.0 + f64::from(i), if i < 80 { 2.0 } else { 0.0 });
            keeper.add(&TickRecord { time_ms, phase: 1, tool: 1, wrench, tissue_depth_mm, ..TickRecord::default() });
        }
        assert_eq!((keeper.tool_changes, keeper.peak_tissue_force_n, keeper.peak_tissue_depth_mm), (1, 0.5, 2.0));
        assert!((keeper.tissue_s - 0.08).abs() < 1e-9 && (keeper.tissue_impulse_n_s - 0.04).abs() < 1e-9);
    }
}
