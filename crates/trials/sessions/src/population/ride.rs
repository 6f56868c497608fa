//! One operation on one head: drill by a simulated hand, leave the brain alone, press it, leave it
//! again.
//!
//! # Practice
//! The loops turn on one thread as if each kept pace, as in the suite `operation`. Before the dura
//! is open nothing acts on the brain, so its solver waits until then. What is measured of the
//! untouched brain is measured over every millisecond in which no tool touched it, nor in the half
//! second before.

use anyhow::{Context, Result};
use trepan_contact::SurfacePatch;
use trepan_haptics::HapticDevice;
use trepan_haptics::script::{Plan, Script};
use trepan_haptics::simulated::{Config, HandModel, Simulated};
use trepan_link::wire::TickRecord;
use trepan_simulator::{Session, Stages};
use trepan_soft::Loads;
use trepan_stages::{Notice, Phase, SoftFrame, SolverFaults, TickInput, Warning, What};

/// Presses of the probe, mm.
const PRESSES_MM: [f32; 3] = [4.0, 6.0, 8.0];
/// Time after a touch in which the brain still moves back, ms.
const MOVES_BACK_MS: f64 = 500.0;
/// A hand that leans on its drill: what it means and where it is differ by a millimetre under 1.5
/// N.
const SURGEON: HandModel = HandModel { mass_g: 250.0, damping: 8.0, stiffness: 1.5 };
/// A tool that is slower stands still, mm/ms.
const STILL_MM_PER_MS: f32 = 2e-3;
/// Time in which tissue comes to rest under a tool that stands still, ms.
const HELD_MS: f64 = 150.0;
/// A brain is pressed hard from this force on, N.
const PRESSED_N: f32 = 0.5;

/// What is done, and for how long.
#[derive(Clone, Copy, Debug)]
pub struct Task {
    /// Name of the script.
    pub script: &'static str,
    /// Its length in bone of up to 7 mm, ms.
    pub milliseconds: u64,
}

/// A burr hole, and the brain pressed through it three times, up to 8 mm.
pub const HOLE: Task = Task { script: "craniotomy-and-probe", milliseconds: 14_000 };
/// A flap cut with burr and craniotome, lifted, and the brain pressed.
pub const FLAP: Task = Task { script: "flap", milliseconds: 60_000 };

/// What one operation came to.
#[derive(Clone, Debug, Default)]
pub struct Ride {
    /// What ran, in words.
    pub setup: String,
    /// Thickness of the bone at the opening, and depth of the brain under its outer surface, mm.
    pub bone_mm: f32,
    /// See above.
    pub brain_mm: f32,
    /// Whether the bone was open and the probe came into the hand.
    pub opened: bool,
    /// Longest way of a node in a millisecond in which nothing touched the brain, mm.
    pub jump_mm: f32,
    /// What the solver had to put right.
    pub solver_faults: SolverFaults,
    /// Longest way of a node in a millisecond in which a probe that stood still pressed the brain,
    /// mm.
    pub held_jump_mm: f32,
    /// Largest displacement, mm.
    pub most_mm: f32,
    /// Largest force of the brain on the probe, N, and largest force on the hand.
    pub tissue_n: f32,
    /// See above.
    pub peak_n: f32,
    /// Times that "the brain is pressed hard" was raised, and those without that force.
    pub pressed: u32,
    /// See above.
    pub falsely_pressed: u32,
    /// Times that the burr or a foot came on the brain, as warned, and as scored.
    pub touched: u32,
    /// See above.
    pub touches: u32,
}

/// Runs a task on a session.
pub fn ride(session: &Session, task: Task) -> Result<Ride> {
    let site = session.scene().site;
    let plan = Plan { presses_mm: PRESSES_MM, outline: session.plan().outline.clone(), ..Plan::default() };
    // Drilling takes 43 % of it; thicker bone takes longer.
    let milliseconds = (task.milliseconds as f64 * (0.57 + 0.43 * site.drilling_share())) as u64;
    let path = Script::planned(task.script, &site, milliseconds as f64, &plan)?;
    let stages = session.stages(path.at(0.0))?;
    let device = Simulated::new(Config::TOUCH, SURGEON, Box::new(path));
    let mut ride = Ride {
        setup: session.models().setup.to_string(),
        bone_mm: site.bone_mm,
        brain_mm: site.brain_mm,
        ..Ride::default()
    };
    operate(stages, Box::new(device), milliseconds, &mut ride).context("the program has tissue")?;
    Ok(ride)
}

impl Ride {
    fn note(&mut self, record: &TickRecord, notices: &[Notice]) {
        let force_n = record.wrench.force.length();
        self.peak_n = self.peak_n.max(force_n);
        let tissue_n = record.tissue_n();
        self.tissue_n = self.tissue_n.max(tissue_n);
        for notice in notices {
            match notice.what {
                What::Warning(Warning::BrainPressed, true, _) => {
                    self.pressed += 1;
                    self.falsely_pressed += u32::from(tissue_n < PRESSED_N);
                }
                What::Warning(Warning::BrainTouched, true, _) => self.touched += 1,
                _ => {}
            }
        }
    }
}

/// Turns the loops, each as if it kept pace; `None` for a program without tissue.
fn operate(mut stages: Stages, mut device: Box<dyn HapticDevice>, milliseconds: u64, ride: &mut Ride) -> Option<()> {
    let mut tissue = stages.tissue.take()?;
    let (mut frame, mut newest) = (SoftFrame::default(), (0, SurfacePatch::default()));
    tissue.solver.publish(&mut frame);
    let (mut opened_ms, mut touched_ms, mut moved_ms) = (None, f64::NEG_INFINITY, 0.0);
    let mut before = frame.positions.clone();
    for ms in 1..=milliseconds {
        let time_ms = ms as f64;
        let (reading, (patch_seq, patch)) = (device.read(time_ms), &newest);
        let input = TickInput { tick: ms, reading, patch, patch_seq: *patch_seq, second: None, second_n: 0.0 };
        let mut notices = Vec::new();
        let tick = stages.haptic.tick(&input, &mut |notice| notices.push(notice));
        device.apply(tick.wrench);
        ride.note(&tick.record, &notices);
        if tick.record.twist.linear.length() > STILL_MM_PER_MS {
            moved_ms = time_ms;
        }
        if opened_ms.is_none() && tick.sample.phase() == Phase::Brain {
            opened_ms = Some(time_ms);
            ride.opened = true;
        }
        let Some(opened_ms) = opened_ms else { continue };
        let record = tissue.collision.step(&tick.sample, &frame);
        newest = (record.seq, *tissue.collision.patch());
        let loads: &Loads = tissue.collision.loads();
        if !loads.contacts.is_empty() {
            touched_ms = time_ms;
        }
        while tissue.solver.time_ms() < time_ms - opened_ms {
            tissue.solver.step(loads, record.seq);
        }
        before.clone_from(&frame.positions);
        tissue.solver.publish(&mut frame);
        let moved = before.iter().zip(&frame.positions).map(|(a, b)| a.distance_squared(*b));
        let moved_mm = moved.fold(0.0, f32::max).sqrt();
        if time_ms - touched_ms > MOVES_BACK_MS {
            ride.jump_mm = ride.jump_mm.max(moved_mm);
        } else if touched_ms == time_ms && time_ms - moved_ms > HELD_MS {
            ride.held_jump_mm = ride.held_jump_mm.max(moved_mm);
        }
    }
    ride.solver_faults = *tissue.solver.solver_faults();
    ride.most_mm = tissue.solver.max_displacement_mm();
    ride.touches = stages.haptic.scores().burr_touches_of_brain;
    Some(())
}
