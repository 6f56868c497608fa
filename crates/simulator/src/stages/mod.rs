//! Bodies of the three loops, without clocks or threads.

pub(crate) mod ahead;
pub(crate) mod alarms;
pub(crate) mod collision_step;
mod drill;
mod fault;
pub(crate) mod flap;
pub(crate) mod haptic_config;
pub(crate) mod haptic_tick;
mod motion;
pub(crate) mod notice;
pub(crate) mod score;
pub(crate) mod second_hand;
pub(crate) mod settling;
pub(crate) mod skull_wall;
pub(crate) mod solver_step;
mod tray;
mod undo;

use serde::Serializer;
use trepan_contact::GuardCounters;

/// Writes the ticks in which the force guard acted, by cause.
pub(crate) fn by_cause<S: Serializer>(guard: &GuardCounters, to: S) -> Result<S::Ok, S::Error> {
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
