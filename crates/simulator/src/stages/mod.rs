//! Bodies of the three loops, without clocks or threads.

pub(crate) mod ahead;
pub(crate) mod alarms;
pub(crate) mod collision_step;
pub(crate) mod drill;
pub(crate) mod fault;
pub(crate) mod flap;
pub(crate) mod haptic_config;
pub(crate) mod haptic_tick;
pub(crate) mod motion;
pub(crate) mod notice;
pub(crate) mod score;
pub(crate) mod second_hand;
pub(crate) mod settling;
pub(crate) mod skull_wall;
pub(crate) mod solver_step;
pub(crate) mod tray;
pub(crate) mod undo;
