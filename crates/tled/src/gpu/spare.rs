//! The device's solver with the processor's in reserve, for when the device is lost.
//!
//! # Practice
//! When the device does not answer, the processor's solver takes positions and velocities over as
//! they were before that step, and steps from there on. So positions are continuous, and with them
//! the force of a tool that presses. The stress memory of a relaxation starts anew.

use super::{GpuTled, GpuTledError};
use crate::config::Config;
use crate::tled::Tled;
use std::any::Any;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use trepan_gpu::{Gpu, Prefer};
use trepan_soft::{Body, Loads, MakeSolver, NodeState, SoftSolver, StepReport};

/// Solver on the graphics device that goes on on the processor when the device is lost.
pub struct WithSpare {
    card: GpuTled,
    spare: Tled,
    lost: Arc<AtomicBool>,
}

impl WithSpare {
    /// Takes a body at rest to a graphics card.
    ///
    /// # Errors
    /// When there is no card but a software driver, which is slower than [`Tled`], or when the card
    /// does not take the body.
    pub fn on_a_card(body: &Body, config: &Config) -> Result<Self, GpuTledError> {
        let gpu = Gpu::open(Prefer::Hardware)?;
        match gpu.is_software() {
            true => Err(GpuTledError::Software(gpu.name())),
            false => Self::new(&gpu, body, config),
        }
    }

    /// Takes a body at rest to a device, whatever its kind.
    pub fn new(gpu: &Gpu, body: &Body, config: &Config) -> Result<Self, GpuTledError> {
        let card = GpuTled::new(gpu, body, config)?;
        Ok(Self { card, spare: Tled::new(body, config)?, lost: Arc::default() })
    }

    /// Whether the device was lost, readable while another thread steps.
    pub fn lost(&self) -> Arc<AtomicBool> {
        Arc::clone(&self.lost)
    }

    fn is_lost(&self) -> bool {
        self.lost.load(Ordering::Relaxed)
    }
}

impl SoftSolver for WithSpare {
    fn step(&mut self, loads: &Loads, dt_ms: f32) -> StepReport {
        if !self.is_lost() {
            let report = self.card.step(loads, dt_ms);
            if self.card.fault().is_none() {
                return report;
            }
            self.spare.resume(&mut self.card, &[]);
            self.lost.store(true, Ordering::Relaxed);
        }
        self.spare.step(loads, dt_ms)
    }

    fn state(&self) -> &NodeState {
        if self.is_lost() { self.spare.state() } else { self.card.state() }
    }

    fn stable_dt_ms(&self) -> f32 {
        self.card.stable_dt_ms()
    }

    fn next_dt_ms(&self) -> f32 {
        if self.is_lost() { self.spare.next_dt_ms() } else { self.card.next_dt_ms() }
    }

    fn cheaper(&self) -> Option<MakeSolver> {
        if self.is_lost() { self.spare.cheaper() } else { None }
    }

    fn memory(&mut self) -> Option<&mut dyn Any> {
        if self.is_lost() { self.spare.memory() } else { None }
    }
}
