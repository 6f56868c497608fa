//! Whether 4 kHz can be held: deadlines missed by the drilling tick, beyond those that an empty
//! loop misses on the same machine.

use super::solid::RADIUS_MM;
use std::time::{Duration, Instant};
use trepan_bone::BoneVolume;
use trepan_contact::{ForceGuard, ForceModel, GuardConfig, Viscoelastic};
use trepan_evidence::suite::Row;
use trepan_geometry::{Buttons, Tool, ToolState};
use trepan_rigid::{Method, RigidStep};

const TICK: Duration = Duration::from_micros(250);
const TICK_MS: f32 = 0.25;
/// Ticks of one block; blocks with and without work take turns.
const BLOCK: usize = 4000;
const BLOCKS: usize = 10;

/// Twenty seconds of drilling ticks and empty ones.
pub fn row(bone: &BoneVolume, path: &[ToolState]) -> Row {
    let mut contact = Method::RECOMMENDED.build(&Tool::burr(RADIUS_MM));
    let (mut model, mut guard) = (Viscoelastic::BONE, ForceGuard::new(GuardConfig::default()));
    let mut out = RigidStep::default();
    let (mut missed, mut missed_empty, mut at) = (0, 0, 0);
    for _ in 0..BLOCKS {
        missed_empty += misses(|| {});
        missed += misses(|| {
            // Four ticks to each recorded one; at the end the path begins anew, without a jump that
            // counts as a way.
            let tool = &path[at / 4 % path.len()];
            if at % (4 * path.len()) == 0 {
                contact.reset(tool.world_from_tool);
            }
            at += 1;
            contact.step(bone, tool, tool.buttons.has(Buttons::PEDAL), TICK_MS, &mut out);
            let wrench = model.wrench(tool, &out.manifold, TICK_MS);
            std::hint::black_box(guard.guard(wrench, tool, TICK_MS));
        });
    }
    let ticks = (BLOCK * BLOCKS) as f64;
    Row::new("4 kHz, drilling in 48.5 million voxels", Method::RECOMMENDED.name())
        .with("rate_hz", 4000)
        .with("ticks", BLOCK * BLOCKS)
        .metric("late_percent", 100.0 * f64::from(missed) / ticks)
        .metric("late_empty_loop_percent", 100.0 * f64::from(missed_empty) / ticks)
        .metric("late_beyond_empty_count", f64::from(missed) - f64::from(missed_empty))
}

/// How many of a block's ticks ended after their deadline. A late tick is not caught up: the next
/// begins anew.
fn misses(mut work: impl FnMut()) -> u32 {
    let mut missed = 0;
    let mut due = Instant::now() + TICK;
    for _ in 0..BLOCK {
        work();
        let now = Instant::now();
        if now > due {
            missed += 1;
            due = now;
        }
        while Instant::now() < due {
            std::hint::spin_loop();
        }
        due += TICK;
    }
    missed
}
