//! Settings of the TLED solver.

use crate::{Kernel, Relaxation};
use trepan_geometry::Vec3;
use trepan_soft::BodyError;

/// Settings of the TLED solver; `Default` is what the simulators use, but for `mass_scaling`: they
/// add a hundredth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Config {
    /// How motion dies away.
    pub damping: Damping,
    /// Share of the true stable bound that a step may use, over 0 and below 1. The rest is for
    /// elements that stiffen as they are compressed; springs of contact are implicit and need none
    /// of it.
    pub safety: f32,
    /// Most substeps in one call, taken when `dt_ms` is over the stable bound of the body as it is
    /// deformed now; a `dt_ms` that needs more is shortened, and the rest counted as skipped. 0 =
    /// obey `dt_ms` even where it is unstable (for experiments on stability).
    pub substeps: u32,
    /// Gravity under which the given mesh is already in equilibrium, mm/ms². The scan was taken
    /// lying in CSF, so the case's mesh is not stress-free: forces `-m g` are added that balance
    /// this gravity exactly. Give the same vector in `Loads::gravity` and nothing sags; turn the
    /// head there and only the difference acts. Zero = the mesh is free of load.
    pub balanced_gravity: Vec3,
    /// Share of the body's mass that may be added to the elements with the shortest stable step,
    /// 0 = none. A hundredth is not felt and lengthens the step where a mesh has slivers; weight
    /// stays as it was. Infinite = all elements get the same bound: only for
    /// [`settle`](crate::Tled::settle), whose way to rest does not matter.
    pub mass_scaling: f32,
    /// Fastest that a node may move, mm/ms (m/s). A surgeon's hand stays under 1; what is over is
    /// held to it and counted.
    pub max_speed: f32,
    /// Furthest that a node may get from its rest position, as a share of the body's largest
    /// extent; held to it and counted.
    pub max_displacement: f32,
    /// Averages the volume change over the elements of one material around each node, so that
    /// nearly incompressible tissue (ν over about 0.47) does not lock, and other tissue bends less
    /// stiffly. Costs about half a step.
    pub averaged_pressure: bool,
    /// Stress that fades while the tissue is held.
    pub relaxation: Relaxation,
    /// Where no node of some thousand neighbouring elements gets further than this in 50 ms, mm,
    /// they fall asleep until one does; 0 = every element in every step. What sleeps costs a tenth;
    /// what creeps more slowly is stopped some such lengths from where it would rest. Not with
    /// `relaxation`, under which everything creeps.
    pub still_mm: f32,
    /// Threads that compute elements, 1 to 64, the caller among them; 1 starts none. The result has
    /// the same bits for any number. More than the cores that are free gains nothing.
    pub threads: usize,
    /// Which implementation of the element forces; all give the same bytes.
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

/// How motion dies away. All are proportional to mass, so they cost no stability.
///
/// A body that its fixed nodes do not hold is damped relative to its own best-fitting rigid motion:
/// it falls and turns unbraked.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Damping {
    /// None: energy is kept.
    None,
    /// This share of critical damping of the lowest mode, without unit; 1 = back at rest soonest
    /// (under 1 s for a brain).
    Critical(f32),
    /// Rate α, 1/ms.
    Rate(f32),
}

impl Config {
    /// Refuses settings that make no sense.
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
