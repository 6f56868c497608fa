//! The CPU solver and the passes of its step.

use crate::bound::Bound;
use crate::config::{Config, Damping};
use crate::elements::Elements;
use crate::layout::Layout;
use crate::nodes::{Nodes, Update, kick_ms};
use crate::part::CALM;
use crate::scaling::Scaling;
use trepan_geometry::Vec3;
use trepan_soft::{
    Body, BodyError, FreeNode, Gain, ImplicitSprings, Loads, SoftSolver, StepReport, Stiffness, SurfacePressure,
    lowest_frequency_of,
};

/// Total Lagrangian explicit solver of one body.
pub struct Tled {
    pub(crate) config: Config,
    pub(crate) elements: Elements,
    /// Positions at rest and now, mm, and velocities, mm/ms, by mesh node.
    rest: Vec<Vec3>,
    positions: Vec<Vec3>,
    velocities: Vec<Vec3>,
    springs: ImplicitSprings,
    /// Surface pressure, its triangles given by place.
    pressure: SurfacePressure,
    layout: Layout,
    pub(crate) bound: Bound,
    pub(crate) damping_per_ms: f32,
    /// Lowest frequency of the body at rest or its estimate, rad/ms.
    pub(crate) lowest_per_ms: f32,
    mass_added: f32,
    max_displacement_mm: f32,
    pub(crate) supported: bool,
    /// Length of the last substep, ms; 0 before the first one.
    elapsed_ms: f32,
    gravity: Vec3,
}

/// A pass of a step; the GPU passes have the same names.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pass {
    /// Mean volume change of each node group, with averaged pressure.
    Volumes,
    /// Element forces.
    Forces,
    /// Contact springs and surface pressure.
    Press,
    /// New velocities and positions.
    Update,
}

impl Pass {
    /// Every pass, in the order of a step.
    pub const ALL: [Self; 4] = [Self::Volumes, Self::Forces, Self::Press, Self::Update];

    /// Name in charts and benches.
    pub fn name(self) -> &'static str {
        match self {
            Self::Volumes => "volumes",
            Self::Forces => "forces",
            Self::Press => "press",
            Self::Update => "update",
        }
    }
}

/// Share of the present stable step that a substep may use.
pub(crate) const SUBSTEP_SAFETY: f32 = 0.95;
/// Tolerance that keeps rounding from adding a substep.
pub(crate) const NEARLY: f32 = 1.0 - 1e-5;

impl Tled {
    /// Creates a solver for a body at rest: orders it for the cache, precomputes gradients, finds
    /// the stable step and the damping.
    pub fn new(body: &Body, config: &Config) -> Result<Self, BodyError> {
        body.check()?;
        config.check()?;
        let layout = Layout::of(body);
        let extent = (body.mesh.bounds().max - body.mesh.bounds().min).max_element();
        let scaling = Scaling::of(body, config.mass_scaling);
        let stiffness = Stiffness::of(body).with_masses(scaling.masses_g(body));
        let lowest_per_ms = lowest_per_ms(body, config.damping, &stiffness);
        let nodes = Nodes::of(body, &layout, stiffness.masses_g());
        let elements = Elements::of(body, &layout, &scaling, nodes, config);
        Ok(Self {
            config: *config,
            elapsed_ms: 0.0,
            gravity: Vec3::ZERO,
            elements,
            rest: body.mesh.positions.clone(),
            positions: body.mesh.positions.clone(),
            velocities: vec![Vec3::ZERO; body.mesh.positions.len()],
            springs: ImplicitSprings::on_nodes(body.mesh.positions.len()),
            pressure: SurfacePressure::default(),
            bound: Bound::of(body, &stiffness, &scaling),
            damping_per_ms: damping_rate(config.damping, lowest_per_ms),
            lowest_per_ms,
            mass_added: scaling.added as f32,
            max_displacement_mm: config.max_displacement * extent,
            supported: body.is_supported(),
            layout,
        })
    }

    /// Stable (critical) time step without safety factor, ms.
    pub fn bound_ms(&self) -> f32 {
        self.bound.at_rest_ms
    }

    /// Mass-proportional damping α in use, 1/ms.
    pub fn damping_per_ms(&self) -> f32 {
        self.damping_per_ms
    }

    /// Mass added by [`Config::mass_scaling`], as a share of the body's mass.
    pub fn mass_added(&self) -> f32 {
        self.mass_added
    }

    /// Share of the elements that are awake; under 1 only with [`Config::still_mm`].
    pub fn awake_share(&self) -> f32 {
        self.elements.awake()
    }

    /// Sets the pressure on surface triangles from the next step on.
    ///
    /// Triangles with nodes outside the mesh are ignored. A contact spring on the same nodes does
    /// not account for the pressure: at rest its depth is off by the distance that the pressure
    /// moves its nodes in one step.
    pub fn set_pressure(&mut self, mut pressure: SurfacePressure) {
        let place_of = &self.layout.place_of;
        pressure.triangles.retain(|t| t.iter().all(|&n| (n as usize) < place_of.len()));
        pressure.triangles.iter_mut().flatten().for_each(|n| *n = place_of[*n as usize]);
        self.pressure = pressure;
    }

    /// Sets a node's displacement from rest, mm, and velocity, mm/ms. A fixed node keeps this
    /// velocity until the next call.
    pub fn set_node(&mut self, node: u32, displacement: Vec3, velocity: Vec3) {
        if let Some(&place) = self.layout.place_of.get(node as usize) {
            self.elements.nodes().set(place as usize, displacement, velocity);
            self.positions[node as usize] = self.elements.nodes().position(place as usize);
            self.velocities[node as usize] = velocity;
            self.elements.wake();
        }
    }

    /// Support force on a fixed node in the last step, N. For a free node: the accelerating force,
    /// reversed.
    pub fn support_force(&self, node: u32) -> Vec3 {
        self.layout.place_of.get(node as usize).map_or(Vec3::ZERO, |&place| -self.elements.force(place as usize))
    }

    /// Resets every node to its rest position with zero velocity, and clears the stress memory.
    pub fn reset(&mut self) {
        let nodes = self.elements.nodes();
        (0..nodes.u.len()).for_each(|place| nodes.set(place, Vec3::ZERO, Vec3::ZERO));
        self.publish();
        self.elements.forget();
        self.elapsed_ms = 0.0;
    }

    /// Does one pass of a step on the present state, for benches. A step is all passes in order.
    pub fn pass(&mut self, pass: Pass, loads: &Loads, dt_ms: f32) {
        let mut report = StepReport::default();
        match pass {
            Pass::Volumes => self.elements.average_volumes(dt_ms),
            Pass::Forces => _ = self.elements.find_forces(dt_ms),
            Pass::Press => {
                let update = self.update_of(loads, dt_ms);
                self.press(loads, &update, &mut report);
                self.push();
            }
            Pass::Update => self.update(self.update_of(loads, dt_ms), &mut report),
        }
    }

    /// Does one substep of at most `left_ms` and returns its length, ms. The length is the longest
    /// that is stable for the deformed elements and divides `left_ms` evenly.
    fn substep(&mut self, loads: &Loads, left_ms: f32, report: &mut StepReport) -> f32 {
        if std::mem::replace(&mut self.gravity, loads.gravity) != loads.gravity {
            self.elements.wake();
        }
        let pass = self.elements.compute(self.elapsed_ms);
        report.inverted = report.inverted.max(pass.inverted);
        let bound_ms = self.bound.deformed_ms(pass.growth);
        let longest = self.stable_dt_ms().min(SUBSTEP_SAFETY * bound_ms);
        let dt_ms =
            if self.config.substeps == 0 { left_ms } else { left_ms / (left_ms / longest * NEARLY).ceil().max(1.0) };
        let update = self.update_of(loads, dt_ms);
        self.press(loads, &update, report);
        self.push();
        self.update(update, report);
        dt_ms
    }

    /// Parameters of the node update in a substep.
    fn update_of(&self, loads: &Loads, dt_ms: f32) -> Update {
        let rigid = (!self.supported && self.damping_per_ms > 0.0).then(|| self.elements.nodes().rigid_motion());
        Update {
            dt_ms,
            kick_ms: kick_ms(self.elapsed_ms, dt_ms),
            damping_per_ms: self.damping_per_ms,
            gravity: loads.gravity - self.config.balanced_gravity,
            max_speed: self.config.max_speed,
            max_displacement_mm: self.max_displacement_mm,
            rigid,
            calm_mm: CALM * self.config.still_mm,
        }
    }

    /// Moves the nodes.
    fn update(&mut self, update: Update, report: &mut StepReport) {
        self.elements.update(update);
        let [limited, non_finite] = self.elements.nodes().finish();
        (report.limited, report.non_finite) = (report.limited + limited, report.non_finite + non_finite);
        self.elapsed_ms = update.dt_ms;
        self.publish();
    }

    /// Adds the surface pressure to the nodal forces.
    fn push(&mut self) {
        let nodes = self.elements.nodes();
        self.pressure.each(|place| nodes.position(place as usize), |place, force| nodes.push(place as usize, force));
    }

    /// Sets all velocities to zero.
    pub(crate) fn stop(&mut self) {
        let nodes = self.elements.nodes();
        (0..nodes.u.len()).for_each(|place| nodes.set(place, nodes.displacement(place), Vec3::ZERO));
        self.publish();
    }

    /// Writes positions and velocities in the mesh's node order.
    fn publish(&mut self) {
        let (nodes, from) = (self.elements.nodes(), self.layout.place_of.iter().zip(&self.rest));
        for ((&place, rest), (x, v)) in from.zip(self.positions.iter_mut().zip(&mut self.velocities)) {
            *x = *rest + nodes.displacement(place as usize);
            *v = nodes.velocity(place as usize);
        }
    }

    fn press(&mut self, loads: &Loads, update: &Update, report: &mut StepReport) {
        let (elements, place_of) = (&self.elements, &self.layout.place_of);
        let nodes = elements.nodes();
        let place = |n: u32| place_of[n as usize] as usize;
        let free = |n: u32| FreeNode {
            position: nodes.position(place(n)),
            velocity: nodes.free_velocity(place(n), elements.force(place(n)), update),
            inverse_mass: nodes.inverse_mass[place(n)],
        };
        let step = Gain { dt_ms: update.dt_ms, gain_ms: update.keep_and_gain()[1] };
        report.contact_n = self.springs.press(&loads.contacts, step, free, |n, force| nodes.push(place(n), force));
    }
}

impl SoftSolver for Tled {
    fn step(&mut self, loads: &Loads, dt_ms: f32) -> StepReport {
        let mut report = StepReport { converged: true, ..StepReport::default() };
        let mut left_ms = dt_ms.max(0.0);
        while left_ms > 1e-5 * dt_ms && report.substeps < self.config.substeps.max(1) {
            left_ms -= self.substep(loads, left_ms, &mut report);
            report.substeps += 1;
        }
        report.skipped_ms = if left_ms > 1e-5 * dt_ms { left_ms } else { 0.0 };
        report
    }

    fn positions(&self) -> &[Vec3] {
        &self.positions
    }

    fn velocities(&self) -> &[Vec3] {
        &self.velocities
    }

    fn stable_dt_ms(&self) -> f32 {
        self.config.safety * self.bound.elements_ms()
    }
}

/// Lowest natural frequency, rad/ms. If the damping does not depend on it, or the body has no
/// supports: the frequency of its slowest shear wave.
pub(crate) fn lowest_per_ms(body: &Body, damping: Damping, stiffness: &Stiffness) -> f32 {
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

/// Damping rate α, 1/ms; α = 2 ω₁ is critical.
pub(crate) fn damping_rate(damping: Damping, lowest_per_ms: f32) -> f32 {
    match damping {
        Damping::None => 0.0,
        Damping::Rate(rate) => rate,
        Damping::Critical(share) => share * 2.0 * lowest_per_ms,
    }
}
