//! What the solvers of both devices keep of a body: settings, order, stable step, damping, state.

use crate::averaging;
use crate::bound::Bound;
use crate::config::{Config, Damping};
use crate::dynamic_scaling::DynamicScaling;
use crate::scaling::Scaling;
use trepan_geometry::Vec3;
use trepan_soft::simd::Layout;
use trepan_soft::{Body, BodyError, NodeState, Stiffness, lowest_frequency_of};

/// Share of the present stable step that a substep may use.
const SUBSTEP_SAFETY: f32 = 0.95;
/// Growth that the next step is to bear, as a multiple of the present one.
const GROWTH_AHEAD: f32 = 1.1;
/// Shortest recommended step, as a share of the stable one at rest. What needs a shorter one is
/// recovering from inversion, and takes substeps.
const SHORTEST: f32 = 0.5;
/// Step from which accelerations are not averaged: contacts come once in a millisecond.
const LONG_ENOUGH_MS: f32 = 0.6;
/// Tolerance that keeps rounding from adding a substep.
const NEARLY: f32 = 1.0 - 1e-5;

/// A body with the settings, bounds and published state of its solver.
pub(crate) struct Base {
    pub config: Config,
    pub layout: Layout,
    /// Rest positions by mesh node, mm.
    pub rest: Vec<Vec3>,
    pub state: NodeState,
    pub bound: Bound,
    /// Mass-proportional damping α in use, 1/ms.
    pub damping_per_ms: f32,
    pub max_displacement_mm: f32,
    pub supported: bool,
    /// Length of the last substep, ms; 0 before the first one.
    pub elapsed_ms: f32,
}

impl Base {
    /// Checks a body and its settings and finds its bounds; also returns its masses, g, by mesh
    /// node and what was added to them.
    pub fn of(body: &Body, config: &Config) -> Result<(Self, Vec<f64>, Scaling), BodyError> {
        body.check()?;
        config.check()?;
        let scaling = Scaling::of(body, config.mass_scaling);
        let stiffness = Stiffness::of(body).with_masses(scaling.masses_g(body));
        let lowest_per_ms = lowest_per_ms(body, config.damping, &stiffness);
        let bound = Bound::of(body, &stiffness, &scaling);
        let needs_longer = config.safety * bound.elements_ms() < LONG_ENOUGH_MS;
        let selective_mass_scaling = config.selective_mass_scaling && needs_longer;
        let base = Self {
            config: Config { selective_mass_scaling, ..*config },
            layout: Layout::of(body),
            rest: body.mesh.positions.clone(),
            state: NodeState::at_rest(&body.mesh),
            bound,
            // α = 2 ω₁ is critical.
            damping_per_ms: match config.damping {
                Damping::None => 0.0,
                Damping::Rate(rate) => rate,
                Damping::Critical(share) => share * 2.0 * lowest_per_ms,
            },
            max_displacement_mm: config.max_displacement * body.mesh.bounds().size().max_element(),
            supported: body.is_supported(),
            elapsed_ms: 0.0,
        };
        let mut masses = stiffness.masses_g().to_vec();
        for (corners, grams) in body.membrane.triangles.iter().zip(base.membrane_masses_g(body)) {
            corners.iter().for_each(|&n| masses[n as usize] += grams);
        }
        Ok((base, masses, scaling))
    }

    /// Mass, g, that each corner of each triangle of the membrane needs for the stable step.
    pub fn membrane_masses_g(&self, body: &Body) -> impl Iterator<Item = f64> {
        let share = if self.config.selective_mass_scaling { 1.0 / 12.0 } else { 0.25 };
        let of_stiffness = share * f64::from(self.stable_dt_ms()).powi(2);
        let membrane = &body.membrane;
        (0..membrane.triangles.len()).map(move |t| of_stiffness * membrane.stiffest(t, &body.mesh.positions))
    }

    /// Longest step that is stable with margin at rest, ms.
    pub fn stable_dt_ms(&self) -> f32 {
        self.config.safety * self.bound.elements_ms() * self.longer()
    }

    /// Cost of simulated time with averaged accelerations over that without; 1 where they would not
    /// be used.
    pub fn averaged_cost(&self) -> f64 {
        let is_used = self.config.safety * self.bound.elements_ms() < LONG_ENOUGH_MS;
        if is_used { averaging::COST / f64::from(averaging::LONGER) } else { 1.0 }
    }

    /// Factor on the stable step of averaged accelerations.
    fn longer(&self) -> f32 {
        if self.config.selective_mass_scaling { averaging::LONGER } else { 1.0 }
    }

    /// Which elements get mass: those that have stiffened more than the step at rest bears.
    pub fn dynamic_scaling(&self) -> DynamicScaling {
        let most = self.config.dynamic_mass_scaling;
        let stiffest = self.bound.stiffest;
        // Of the growth with which `longest_ms` is still the stable step at rest.
        let limit = ((SUBSTEP_SAFETY / self.config.safety).powi(2) - 1.0) / GROWTH_AHEAD * stiffest;
        let averages = self.config.selective_mass_scaling;
        match averages || (most > 1.0 && limit > 0.0) {
            true => DynamicScaling { limit: limit.max(0.0), stiffest, most, averages },
            false => DynamicScaling::NONE,
        }
    }

    /// Recommended length of the next step, ms, where an element's ω² grew by `growth` in the last
    /// one, 1/ms². A call of this length is mostly a single substep.
    pub fn next_dt_ms(&self, growth: f32) -> f32 {
        self.longest_ms(GROWTH_AHEAD * growth).max(SHORTEST * self.stable_dt_ms())
    }

    /// Number of equal substeps that `ms` takes where an element's ω² grew by `growth`, 1/ms².
    pub fn substeps(&self, ms: f32, growth: f32) -> f32 {
        (ms / self.longest_ms(growth) * NEARLY).ceil().max(1.0)
    }

    /// Longest substep where an element's ω² grew by `growth`, 1/ms².
    pub fn longest_ms(&self, growth: f32) -> f32 {
        self.stable_dt_ms().min(SUBSTEP_SAFETY * self.longer() * self.bound.deformed_ms(growth))
    }
}

/// Time left of a step, ms; 0 where it is only rounding.
pub(crate) fn left_of(dt_ms: f32, left_ms: f32) -> f32 {
    if left_ms > 1e-5 * dt_ms { left_ms } else { 0.0 }
}

/// Lowest natural frequency, rad/ms. If the damping does not depend on it, or the body has no
/// supports: the frequency of its slowest shear wave.
fn lowest_per_ms(body: &Body, damping: Damping, stiffness: &Stiffness) -> f32 {
    let requested = matches!(damping, Damping::Critical(_));
    let lowest = requested.then(|| lowest_frequency_of(body, stiffness)).flatten();
    let shear_wave = || {
        let total = |of: &dyn Fn(usize) -> f64| -> f64 {
            (0..body.mesh.tets.len()).map(|t| body.mesh.volume_mm3(t) * of(t)).sum()
        };
        let shear = total(&|t| body.material(t).shear_mpa());
        let shear_speed = (shear / total(&|t| body.material(t).density_g_mm3().into())).sqrt();
        std::f64::consts::PI * shear_speed / f64::from(body.mesh.bounds().size().max_element())
    };
    lowest.unwrap_or_else(shear_wave) as f32
}
