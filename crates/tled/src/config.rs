//! Settings of the TLED solver.

use crate::{Kernel, Relaxation};
use trepan_geometry::Vec3;
use trepan_soft::BodyError;

/// Settings of the TLED solver. The simulators use the defaults, except for a `mass_scaling` of a
/// hundredth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Config {
    /// Damping of motion.
    pub damping: Damping,
    /// Share of the stable time step that a step may use, over 0 and below 1. The margin is for
    /// elements that stiffen under compression; contact springs are implicit and need no margin.
    pub safety: f32,
    /// Largest number of substeps in one call. Substeps are used when `dt_ms` exceeds the stable
    /// step of the deformed body; a `dt_ms` that needs more is shortened, and the rest counted as
    /// skipped. 0 = one step of `dt_ms` even if unstable, for stability experiments.
    pub substeps: u32,
    /// Gravity under which the given mesh is already in equilibrium, mm/ms². The patient was
    /// scanned lying, with the brain in CSF, so the mesh is not stress-free: forces `-m g` are
    /// added that balance this gravity exactly. With the same vector in `Loads::gravity` nothing
    /// sags; with a turned head only the difference acts. Zero = the mesh is stress-free.
    pub balanced_gravity: Vec3,
    /// Share of the body's mass that may be added to the elements with the shortest stable step;
    /// 0 = none. A hundredth is imperceptible and lengthens the step of a mesh with slivers; weight
    /// does not change. Infinite = all elements get the same stable step; only for
    /// [`settle`](crate::Tled::settle), where only the equilibrium matters.
    pub mass_scaling: f32,
    /// Speed limit of a node, mm/ms (m/s). A surgeon's hand stays under 1. Faster nodes are clamped
    /// and counted.
    pub max_speed: f32,
    /// Limit of a node's displacement from rest, as a share of the body's largest extent. Nodes
    /// beyond are clamped and counted.
    pub max_displacement: f32,
    /// Averages the volume change over the elements of one material around each node (averaged
    /// nodal pressure). Nearly incompressible tissue (ν over about 0.47) then does not lock, and
    /// other tissue bends less stiffly. Costs about half a step.
    pub averaged_pressure: bool,
    /// Stress relaxation (Prony series).
    pub relaxation: Relaxation,
    /// Motion in 50 ms below which a part of about a thousand elements falls asleep, mm. It wakes
    /// when a node moves further; 0 = no sleeping. A sleeping part costs a tenth. Slower creep is
    /// stopped a few times this distance from the equilibrium. Not allowed with `relaxation`, under
    /// which everything creeps.
    pub still_mm: f32,
    /// Number of threads, 1 to 64, including the caller; 1 starts none. The result has the same
    /// bits for any number. More threads than free cores bring no speed.
    pub threads: usize,
    /// Implementation of the element forces; all give the same bytes.
    pub kernel: Kernel,
}

impl Default for Config {
    fn default() -> Self {
        Self {
            damping: Damping::Critical(1.0),
            safety: 0.8,
            substeps: 4,
            balanced_gravity: Vec3::ZERO,
            mass_scaling: 0.0,
            max_speed: 10.0,
            max_displacement: 2.0,
            averaged_pressure: false,
            relaxation: Relaxation::NONE,
            still_mm: 0.0,
            threads: 1,
            kernel: Kernel::Fastest,
        }
    }
}

/// Damping of motion, proportional to mass, so that the stable step does not shrink.
///
/// A body without enough fixed nodes is damped relative to its best-fitting rigid motion, so that
/// translation and rotation are not damped.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Damping {
    /// No damping: energy is conserved.
    None,
    /// Share of critical damping of the lowest mode, without unit; 1 = fastest return to rest
    /// (under 1 s for a brain).
    Critical(f32),
    /// Damping rate α, 1/ms.
    Rate(f32),
}

impl Config {
    /// Rejects invalid settings.
    pub fn check(&self) -> Result<(), BodyError> {
        let refuse = |field, value, right| Err(BodyError::Config { field, value, right });
        let damping = match self.damping {
            Damping::None => 0.0,
            Damping::Critical(share) => share,
            Damping::Rate(rate) => rate,
        };
        if !(damping.is_finite() && damping >= 0.0) {
            return refuse("damping", damping, "at least 0 and finite");
        }
        if !(self.safety > 0.0 && self.safety < 1.0) {
            return refuse("safety", self.safety, "over 0 and below 1");
        }
        if !self.balanced_gravity.is_finite() {
            return refuse("balanced_gravity", self.balanced_gravity.length(), "finite, 9.81e-3 mm/ms² on Earth");
        }
        if self.mass_scaling.is_nan() || self.mass_scaling < 0.0 {
            return refuse("mass_scaling", self.mass_scaling, "at least 0; 0.01 is not felt");
        }
        if !(self.max_speed > 0.0 && self.max_speed.is_finite()) {
            return refuse("max_speed", self.max_speed, "over 0 and finite");
        }
        if !(self.max_displacement > 0.0 && self.max_displacement.is_finite()) {
            return refuse("max_displacement", self.max_displacement, "over 0 and finite");
        }
        if !(self.still_mm >= 0.0 && self.still_mm.is_finite()) {
            return refuse("still_mm", self.still_mm, "at least 0 and finite; 0.001 mm is not felt");
        }
        if self.still_mm > 0.0 && !self.relaxation.is_none() {
            return refuse(
                "still_mm",
                self.still_mm,
                "0 where relaxation is not NONE: tissue that relaxes never rests",
            );
        }
        self.relaxation.check()?;
        if !(1..=64).contains(&self.threads) {
            return refuse("threads", self.threads as f32, "1 to 64");
        }
        if !self.kernel.runs_here() {
            return refuse("kernel", 0.0, "a kernel whose instructions this CPU has; Fastest always runs");
        }
        Ok(())
    }
}
