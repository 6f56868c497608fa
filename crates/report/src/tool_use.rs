//! How each tool was used on the brain, and how two hands worked together.
//!
//! # Theory
//! From the recorded ticks: path, time on tissue, pedal and force of each tool for the brain, and,
//! with a second hand, what both did at once. Resection simulators are judged by such numbers, with
//! the volumes in [`Resection`](crate::summary::Resection) and the blood lost: 13 metrics of
//! NeuroTouch, doi 10.1177/1553350615579729, and doi 10.1007/s11548-014-1091-z, abstracts. Their
//! formulas are not published there; these are ours, and none is validated against skill here.
//!
//! # When not to use it
//! For tools that cut bone: see the scores.

use serde::Serialize;
use trepan_geometry::{Buttons, Tool, Vec3};
use trepan_link::Recording;
use trepan_link::wire::{SecondRecord, TickRecord};
use trepan_stages::program::{Phase, called};
use trepan_stages::second_hand::SecondHand;

/// Longest time that counts for one tick, s.
const MAX_TICK_S: f64 = 0.1;

/// Use of one tool.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct ToolUse {
    /// The tool; that of the second hand is called so.
    pub name: String,
    /// Path of its tip, mm.
    pub path_mm: f64,
    /// Time in the hand, s.
    pub held_s: f64,
    /// Time on tissue, s.
    pub touching_s: f64,
    /// Share of the time in the hand that it was on tissue.
    pub efficiency: f64,
    /// How often its pedal was pressed.
    pub pedal_presses: u32,
    /// Force of tissue on it, integrated over time, N s.
    pub impulse_n_s: f64,
    /// Largest such force, N.
    pub peak_n: f32,
    /// Mean of it while on tissue, N.
    pub mean_n: f64,
    #[serde(skip)]
    last: Option<(u64, Vec3, bool)>,
}

/// Use of all tools for the brain.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct ToolUses {
    /// Each tool that was in a hand, in the order of the tray, the second hand's last.
    pub tools: Vec<ToolUse>,
    /// What both hands did at once; `null` with one.
    pub both_hands: Option<BothHands>,
}

/// What two hands did at once.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct BothHands {
    /// Time in which both tools were on tissue, s.
    pub together_s: f64,
    /// That over the time in which any of them was.
    pub coordination: f64,
    /// Mean distance of the tips in that time, mm.
    pub separation_mm: f64,
    /// Mean force of the first hand on tissue over that of the second; `null` without one.
    pub force_ratio: Option<f64>,
}

/// One tick of a hand, as its use counts it.
#[derive(Clone, Copy)]
struct Moment {
    tick: u64,
    tip: Vec3,
    /// On tissue, with a force, N.
    on_tissue: Option<f32>,
    pedal: bool,
}

impl Moment {
    fn of(record: &TickRecord) -> Self {
        let on_tissue = (record.tissue_depth_mm > 0.0).then(|| record.tissue_n());
        let (tip, pedal) = (record.proxy.translation, Buttons(record.buttons).has(Buttons::PEDAL));
        Self { tick: record.tick, tip, on_tissue, pedal }
    }

    /// A force that bone has part in does not count.
    fn of_second(record: &SecondRecord) -> Self {
        let is_on_tissue = record.tissue_depth_mm > 0.0 && record.depth_mm <= 0.0;
        let (tip, pedal) = (record.proxy.translation, Buttons(record.buttons).has(Buttons::PEDAL));
        Self { tick: record.tick, tip, on_tissue: is_on_tissue.then(|| record.wrench.force.length()), pedal }
    }
}

impl ToolUse {
    fn named(name: String) -> Self {
        Self { name, ..Self::default() }
    }

    fn add(&mut self, now: Moment, seconds: f64) {
        // After a change of the tool the way to its place in the hand does not count.
        let before = self.last.filter(|(tick, ..)| tick + 1 == now.tick);
        self.held_s += seconds;
        self.path_mm += before.map_or(0.0, |(_, tip, _)| f64::from(tip.distance(now.tip)));
        self.pedal_presses += u32::from(now.pedal && before.is_none_or(|(.., pedal)| !pedal));
        if let Some(force_n) = now.on_tissue {
            self.touching_s += seconds;
            self.impulse_n_s += seconds * f64::from(force_n);
            self.peak_n = self.peak_n.max(force_n);
        }
        self.last = Some((now.tick, now.tip, now.pedal));
    }

    fn finish(&mut self) {
        let per = |of: f64, whole: f64| if whole > 0.0 { of / whole } else { 0.0 };
        self.mean_n = per(self.impulse_n_s, self.touching_s);
        self.efficiency = per(self.touching_s, self.held_s);
    }
}

/// Returns the use of the tools of a tray in a session.
pub fn tool_use(tray: &[Tool], recording: &Recording) -> ToolUses {
    let mut tools: Vec<ToolUse> = tray.iter().map(|tool| ToolUse::named(called(tool))).collect();
    let mut second = ToolUse::named(format!("second hand, {}", called(&SecondHand::tool())));
    let (mut others, mut both, mut apart_mm_s) = (recording.second.iter().peekable(), BothHands::default(), 0.0);
    let mut any_s = 0.0;
    for pair in recording.ticks.windows(2) {
        let (before, tick) = (&pair[0], &pair[1]);
        let seconds = (1e-3 * (tick.time_ms - before.time_ms)).clamp(0.0, MAX_TICK_S);
        let first = Moment::of(tick);
        let is_brains = tray.get(usize::from(tick.tool)).is_some_and(|tool| Phase::of(tool) == Phase::Brain);
        if is_brains {
            tools[usize::from(tick.tool)].add(first, seconds);
        }
        while others.next_if(|other| other.tick < tick.tick).is_some() {}
        let other = others.next_if(|other| other.tick == tick.tick);
        // Before its device's first pose it is nowhere.
        let is_there = |other: &&SecondRecord| second.held_s > 0.0 || !other.has(TickRecord::STALE);
        let other = other.filter(is_there).map(Moment::of_second);
        other.iter().for_each(|other| second.add(*other, seconds));
        let touch = [first.on_tissue.filter(|_| is_brains), other.and_then(|other| other.on_tissue)];
        any_s += if touch.iter().any(Option::is_some) { seconds } else { 0.0 };
        if let ([Some(_), Some(_)], Some(other)) = (touch, other) {
            both.together_s += seconds;
            apart_mm_s += seconds * f64::from(first.tip.distance(other.tip));
        }
    }
    tools.iter_mut().chain([&mut second]).for_each(ToolUse::finish);
    let (first_s, first_n_s) =
        tools.iter().fold((0.0, 0.0), |(s, n_s), tool| (s + tool.touching_s, n_s + tool.impulse_n_s));
    let per = |of: f64, whole: f64| (whole > 0.0).then(|| of / whole);
    both.coordination = per(both.together_s, any_s).unwrap_or_default();
    both.separation_mm = per(apart_mm_s, both.together_s).unwrap_or_default();
    both.force_ratio = per(first_n_s, first_s).and_then(|first_n| per(first_n, second.mean_n));
    let is_two = second.held_s > 0.0;
    tools.push(second);
    tools.retain(|tool| tool.held_s > 0.0);
    ToolUses { tools, both_hands: is_two.then_some(both) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use trepan_geometry::{Pose, Wrench};
    use trepan_stages::program::Program;

    /// A second with the probe on tissue, one with the aspirator that sucks twice.
    ///
    /// The second hand stays 10 mm aside, on tissue from 0.5 s on, with half the force.
    fn recording() -> Recording {
        let tray = Program::Integrated.tray();
        let slot = |name: &str| tray.iter().position(|tool| called(tool) == name).unwrap() as u8;
        let tick = |n: u64| {
            let (tool, pedal) = if n < 1000 { ("probe", false) } else { ("aspirator", n % 500 < 250) };
            let force = 0.2 * Vec3::Z;
            TickRecord {
                tick: n,
                time_ms: n as f64,
                // 1 mm/s.
                proxy: Pose::from_translation(Vec3::X * 1e-3 * n as f32),
                tissue_depth_mm: 1.0,
                wrench: Wrench { force, torque: Vec3::ZERO },
                tissue_force: force,
                flags: TickRecord::TISSUE,
                buttons: if pedal { 1 } else { 0 },
                tool: slot(tool),
                phase: 1,
                ..TickRecord::default()
            }
        };
        let second = |n: u64| SecondRecord {
            tick: n,
            proxy: Pose::from_translation(Vec3::X * 1e-3 * n as f32 + 10.0 * Vec3::Y),
            wrench: Wrench { force: 0.1 * Vec3::Z, torque: Vec3::ZERO },
            tissue_depth_mm: if n >= 500 { 0.5 } else { 0.0 },
            ..SecondRecord::default()
        };
        let ticks = (0..2000).map(tick).collect();
        Recording { ticks, second: (0..2000).map(second).collect(), ..Recording::default() }
    }

    #[test]
    fn path_pedal_force_and_what_both_hands_do_are_counted() {
        let ToolUses { tools, both_hands } = tool_use(Program::Integrated.tray(), &recording());
        let names: Vec<&str> = tools.iter().map(|tool| tool.name.as_str()).collect();
        assert_eq!(names, ["probe", "aspirator", "second hand, aspirator"]);
        let near = |is: f64, wanted: f64| assert!((is - wanted).abs() < 0.01 * wanted.max(0.1), "{is} for {wanted}");
        near(tools[0].path_mm, 1.0);
        near(tools[1].touching_s, 1.0);
        near(tools[1].impulse_n_s, 0.2);
        assert_eq!([0, 1, 2].map(|at| tools[at].pedal_presses), [0, 2, 0]);
        near(tools[2].efficiency, 0.75);
        near(tools[2].mean_n, 0.1);
        let both = both_hands.unwrap();
        near(both.together_s, 1.5);
        near(both.coordination, 0.75);
        near(both.separation_mm, 10.0);
        near(both.force_ratio.unwrap(), 2.0);
    }

    #[test]
    fn one_hand_has_no_second_and_bone_does_not_count() {
        let mut alone = recording();
        alone.second.clear();
        alone.ticks.iter_mut().for_each(|tick| (tick.tool, tick.phase) = (0, 0));
        assert_eq!(tool_use(Program::Integrated.tray(), &alone), ToolUses::default());
    }
}
