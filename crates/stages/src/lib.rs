//! Bodies of the three loops of a session, without clocks or threads.
//!
//! What the three programs share stands here too: phases, tools, scale of the force.
//!
//! # Theory
//! | stage | reads | returns |
//! |---|---|---|
//! | [`HapticStage::tick`] | device, newest patch | wrench, tool, record |
//! | [`CollisionStage::step`] | newest tool, newest node positions | patch, contacts, record |
//! | [`SolverStage::step`] | newest contact | moved nodes, record |
//!
//! A stage is a function of what it is given and of its own state: run live by threads, or from a
//! recording one after the other, it gives the same forces, bit for bit.
//!
//! # Practice
//! A step never panics, allocates, locks, logs or waits; faults of device, thread or input are
//! answers, and each is counted. The exceptions are the solver's and the collision's steps in which
//! another solver takes over, a cheaper one or one of a brain that was cut: these allocate, and log
//! where its body was refused. Only a
//! [`GuardedWrench`](trepan_contact::GuardedWrench) leaves a tick.
//!
//! # When not to use it
//! For a single method: use the method's crate.

pub mod ahead;
pub mod alarms;
mod aspirator;
mod bleeding;
pub mod collision_step;
mod drill;
mod dura;
mod fault;
pub mod flap;
pub mod force_scale;
pub mod haptic_config;
pub mod haptic_tick;
mod motion;
pub mod notice;
pub mod program;
pub mod scissors;
pub mod score;
pub mod second_hand;
pub mod settling;
pub mod skull_wall;
pub mod solver_step;
mod tissue;
mod tray;
mod undo;

pub use alarms::Limits;
pub use bleeding::Bleeding;
pub use collision_step::{CollisionStage, SoftFrame};
pub use dura::DuraState;
pub use haptic_config::{BoneModels, HapticConfig};
pub use haptic_tick::{HapticStage, TickInput, ToolSample};
pub use notice::{Hindrance, Notice, Warning, What};
pub use program::{Phase, Program};
pub use score::ScoreKeeper;
pub use settling::{Settling, dry_weight};
pub use skull_wall::SkullWall;
pub use solver_step::{SolverFaults, SolverStage};

use serde::Serializer;
use trepan_contact::GuardCounters;

/// Writes the ticks in which the force guard acted, by cause.
pub fn by_cause<S: Serializer>(guard: &GuardCounters, to: S) -> Result<S::Ok, S::Error> {
    let &GuardCounters { clamped, heated, slewed, non_finite, passivity, .. } = guard;
    let &GuardCounters { bounded, restarted, too_fast, stale, ramped, .. } = guard;
    to.collect_map([
        ("clamped", clamped),
        ("heated", heated),
        ("slewed", slewed),
        ("non_finite", non_finite),
        ("passivity", passivity),
        ("bounded", bounded),
        ("restarted", restarted),
        ("too_fast", too_fast),
        ("stale", stale),
        ("ramped", ramped),
    ])
}
