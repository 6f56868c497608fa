//! Bodies of the three loops, without clocks or threads.

mod ahead;
pub(crate) mod alarms;
pub(crate) mod collision_step;
mod drill;
mod fault;
mod flap;
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
