//! Settings of the TLED solver.

use crate::{Kernel, Relaxation};
use trepan_geometry::Vec3;
use trepan_soft::BodyError;

/// Settings of the TLED solver. The simulators take a `mass_scaling` of a hundredth, or of a tenth
/// where the processor is too slow, and dynamic and selective mass scaling.
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
    /// does not change. Infinite = all elements get the same stable step; only where the motion
    /// towards equilibrium does not matter.
    pub mass_scaling: f32,
    /// Largest factor on an element's mass while it is stiffer than at rest; 1 = none. A few such
    /// elements do not shorten the step of the whole body then; weight does not change.
    /// The simulators use 16. On the graphics card the step is shortened instead.
    pub dynamic_mass_scaling: f32,
    /// Averages accelerations over the elements (selective mass scaling): steps are √3 times as
    /// long, equilibria stay, and short waves are slower. Costs a third of a step in a session. Not
    /// used where the step is over 0.6 ms without it, nor on the graphics card.
    pub selective_mass_scaling: bool,
    /// Speed limit of a node, mm/ms (m/s). A surgeon's hand stays under 1. Faster nodes are clamped
    /// and counted.
    pub max_speed: f32,
    /// Limit of a node's displacement from rest, as a share of the body's largest extent. Nodes
    /// beyond are clamped and counted.
    pub max_displacement: f32,
    /// Averages the volume change over the elements of one material around each node (averaged
    /// nodal pressure). Nearly incompressible tissue (ν over about 0.47) then does not lock, and
    /// other tissue bends less stiffly. Costs about a quarter of a step.
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
            dynamic_mass_scaling: 1.0,
            selective_mass_scaling: false,
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
        let check = BodyError::check_config;
        let positive = |field, value: f32| check(value > 0.0 && value.is_finite(), field, value, "over 0 and finite");
        let damping = match self.damping {
            Damping::None => 0.0,
            Damping::Critical(share) => share,
            Damping::Rate(rate) => rate,
        };
        check(damping.is_finite() && damping >= 0.0, "damping", damping, "at least 0 and finite")?;
        check(self.safety > 0.0 && self.safety < 1.0, "safety", self.safety, "over 0 and below 1")?;
        let gravity = self.balanced_gravity;
        check(gravity.is_finite(), "balanced_gravity", gravity.length(), "finite, 9.81e-3 mm/ms² on Earth")?;
        check(self.mass_scaling >= 0.0, "mass_scaling", self.mass_scaling, "at least 0; 0.01 is not felt")?;
        let dynamic = self.dynamic_mass_scaling;
        check(dynamic >= 1.0 && dynamic.is_finite(), "dynamic_mass_scaling", dynamic, "at least 1 and finite")?;
        positive("max_speed", self.max_speed)?;
        positive("max_displacement", self.max_displacement)?;
        let still_mm = self.still_mm;
        let is_right = still_mm >= 0.0 && still_mm.is_finite();
        check(is_right, "still_mm", still_mm, "at least 0 and finite; 0.001 mm is not felt")?;
        let right = "0 where relaxation is not NONE: tissue that relaxes never rests";
        check(still_mm == 0.0 || self.relaxation.is_none(), "still_mm", still_mm, right)?;
        self.relaxation.check()?;
        check((1..=64).contains(&self.threads), "threads", self.threads as f32, "1 to 64")?;
        let right = "a kernel whose instructions this CPU has; Fastest always runs";
        check(self.kernel.runs_here(), "kernel", 0.0, right)
    }
}
