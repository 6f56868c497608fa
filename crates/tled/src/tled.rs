//! The CPU solver and the passes of its step.

use crate::averaging::Averaging;
use crate::base::{Base, left_of};
use crate::config::{Config, Damping};
use crate::elements::Elements;
use crate::nodes::{Nodes, Update, kick_ms};
use crate::part::CALM;
use std::any::Any;
use std::sync::Arc;
use trepan_geometry::Vec3;
use trepan_mesh::Split;
use trepan_soft::simd::Layout;
use trepan_soft::{
    Body, BodyError, Fluid, FreeNode, Gain, ImplicitSprings, Loads, MakeSolver, NodeState, SoftSolver, StepReport,
    SurfacePressure, split_triangles,
};

/// Total Lagrangian explicit solver of one body.
pub struct Tled {
    pub(crate) base: Base,
    pub(crate) elements: Elements,
    /// The body at rest.
    pub(crate) body: Arc<Body>,
    pub(crate) springs: ImplicitSprings,
    /// Surface pressure, its triangles given by place.
    pub(crate) pressure: SurfacePressure,
    mass_added: f32,
    gravity: Vec3,
    fluid: Fluid,
    /// Largest growth of an element's ω² in the last pass, 1/ms².
    growth: f32,
}

impl SoftSolver for Tled {
    fn step(&mut self, loads: &Loads, dt_ms: f32) -> StepReport {
        let mut report = StepReport { converged: true, ..StepReport::default() };
        self.elements.fall(&self.body, &self.base.layout);
        let mut left_ms = dt_ms.max(0.0);
        while left_ms > 1e-5 * dt_ms && report.substeps < self.base.config.substeps.max(1) {
            self.springs.elapsed_ms = dt_ms - left_ms;
            left_ms -= self.substep(loads, left_ms, &mut report);
            report.substeps += 1;
        }
        self.springs.elapsed_ms = 0.0;
        report.skipped_ms = left_of(dt_ms, left_ms);
        report
    }

    fn state(&self) -> &NodeState {
        &self.base.state
    }

    fn stable_dt_ms(&self) -> f32 {
        self.base.stable_dt_ms()
    }

    fn next_dt_ms(&self) -> f32 {
        self.base.next_dt_ms(self.growth)
    }

    fn lower_fills(&mut self, fills: &[u16]) {
        (0u32..).zip(fills).for_each(|(tet, &fill)| self.elements.fills.lower(tet, fill));
    }

    /// The same with a [`Config::mass_scaling`] of a tenth: longer steps.
    fn cheaper(&self) -> Option<MakeSolver> {
        let config = Config { mass_scaling: CHEAPER_MASS_SCALING, ..self.base.config };
        if self.base.config.mass_scaling >= CHEAPER_MASS_SCALING {
            return None;
        }
        let (body, pressure, fills) = (Arc::clone(&self.body), self.pressure.clone(), self.fills().to_vec());
        let tet_at = self.base.layout.tet_at.clone();
        Some(Box::new(move || {
            let mut solver = Self { pressure, ..Self::in_order(&body, &config, Some(tet_at)).ok()? };
            solver.elements.empty_to(&fills, &body, &solver.base.layout);
            solver.reset();
            Some(Box::new(solver))
        }))
    }

    /// The same, with its elements in the same order.
    fn split(&self, splits: &[Split]) -> Option<MakeSolver> {
        let damping = Damping::Rate(self.base.damping_per_ms);
        let config = Config { damping, ..self.base.config };
        let (body, fills, splits) = (Arc::clone(&self.body), self.fills().to_vec(), splits.to_vec());
        let Layout { node_at, tet_at, .. } = &self.base.layout;
        let (tet_at, mut pressure) = (tet_at.clone(), self.pressure.clone());
        pressure.triangles.iter_mut().flatten().for_each(|place| *place = node_at[*place as usize]);
        Some(Box::new(move || {
            let mut body = Body::clone(&body);
            split_triangles(&body.mesh, &splits, &mut pressure.triangles);
            body.split(&splits)?;
            let mut solver = Self::in_order(&body, &config, Some(tet_at)).ok()?;
            solver.set_pressure(pressure);
            solver.elements.empty_to(&fills, &body, &solver.base.layout);
            // Its pages are touched here, on the maker's thread.
            solver.reset();
            Some(Box::new(solver))
        }))
    }

    fn memory(&mut self) -> Option<&mut dyn Any> {
        Some(&mut self.elements)
    }

    fn last_step_ms(&self) -> f32 {
        self.base.elapsed_ms
    }

    fn fills(&self) -> &[u16] {
        &self.elements.fills.now
    }

    /// The stress memory of another solver starts anew.
    fn resume(&mut self, from: &mut dyn SoftSolver, splits: &[Split]) {
        let state = from.state();
        let whole = state.positions.len();
        let mut copies: Vec<usize> = Vec::with_capacity(splits.len());
        for Split { from, node, .. } in splits {
            if *node as usize == whole + copies.len() {
                let from = *from as usize;
                copies.push(copies.get(from.wrapping_sub(whole)).copied().unwrap_or(from));
            }
        }
        let (nodes, Base { layout, rest, state: own, .. }) = (self.elements.nodes(), &mut self.base);
        let to = own.positions.iter_mut().zip(&mut own.velocities);
        for (former, ((rest, &place), (x, v))) in
            (0..whole).chain(copies).zip(rest.iter().zip(&layout.place_of).zip(to))
        {
            let displacement = state.positions[former] - *rest;
            (*x, *v) = (*rest + displacement, state.velocities[former]);
            nodes.set(place as usize, displacement, *v);
        }
        for node in splits.iter().flat_map(|split| [split.from as usize, split.node as usize]) {
            if !self.elements.fills.is_left(node as u32) {
                own.velocities[node] = Vec3::ZERO;
                nodes.set(layout.place_of[node] as usize, own.positions[node] - rest[node], Vec3::ZERO);
            }
        }
        if self.fills() != from.fills() {
            self.elements.empty_to(from.fills(), &self.body, &self.base.layout);
            self.publish();
        }
        self.base.elapsed_ms = from.last_step_ms();
        match from.memory().and_then(|elements| elements.downcast_mut()) {
            Some(from) => self.elements.take_memory(from),
            None => self.elements.forget(),
        }
        self.elements.wake();
    }
}

/// Share of the mass that [`Tled::cheaper`](SoftSolver::cheaper) may add. On a block pressed at
/// 40 mm/s the hand gets 0.024 N more, at rest the same, for 0.46 of the cost; under a membrane
/// more, since its mass grows with the step's square (not measured).
const CHEAPER_MASS_SCALING: f32 = 0.1;

impl Tled {
    /// Does one substep of at most `left_ms` and returns its length, ms. The length is the longest
    /// that is stable for the deformed elements and divides `left_ms` evenly.
    fn substep(&mut self, loads: &Loads, left_ms: f32, report: &mut StepReport) -> f32 {
        if (self.gravity, self.fluid) != (loads.gravity, loads.fluid) {
            (self.gravity, self.fluid) = (loads.gravity, loads.fluid);
            self.elements.wake();
        }
        self.elements.volumes(self.base.elapsed_ms);
        let pass = self.elements.forces(self.base.elapsed_ms);
        report.inverted = report.inverted.max(pass.inverted);
        self.growth = pass.growth;
        let substeps = if self.base.config.substeps == 0 { 1.0 } else { self.base.substeps(left_ms, pass.growth) };
        let dt_ms = left_ms / substeps;
        let update = self.update_of(loads, dt_ms);
        self.elements.weigh(true);
        if self.base.config.selective_mass_scaling {
            self.press(loads, &update, report);
            self.elements.oppose(update);
        }
        self.press(loads, &update, report);
        self.update(update, report);
        self.elements.weigh(false);
        dt_ms
    }

    /// Adds the forces of contact springs and surface pressure to the nodes.
    fn press(&mut self, loads: &Loads, update: &Update, report: &mut StepReport) {
        let (elements, place_of) = (&self.elements, &self.base.layout.place_of);
        let nodes = elements.nodes();
        let place = |n: u32| place_of[n as usize] as usize;
        let free = |n: u32| FreeNode {
            position: nodes.position(place(n)),
            velocity: nodes.free_velocity(place(n), elements.force(place(n)), update),
            inverse_mass: nodes.present_inverse_mass(place(n), update),
        };
        let step = Gain { dt_ms: update.dt_ms, gain_ms: update.keep_and_gain()[1] };
        report.contact_n = self.springs.press(&loads.contacts, step, free, |n, force| nodes.push(place(n), force));
        self.pressure.each(|place| nodes.position(place as usize), |place, force| nodes.push(place as usize, force));
    }

    /// Moves the nodes.
    fn update(&mut self, update: Update, report: &mut StepReport) {
        self.elements.update(update);
        let [limited, non_finite] = self.elements.nodes().finish();
        (report.limited, report.non_finite) = (report.limited + limited, report.non_finite + non_finite);
        self.base.elapsed_ms = update.dt_ms;
        self.publish();
    }

    /// Parameters of the node update in a substep.
    fn update_of(&self, loads: &Loads, dt_ms: f32) -> Update {
        let Base { config, damping_per_ms, .. } = self.base;
        let rigid = (!self.base.supported && damping_per_ms > 0.0).then(|| self.elements.nodes().rigid_motion());
        Update {
            dt_ms,
            kick_ms: kick_ms(self.base.elapsed_ms, dt_ms),
            damping_per_ms,
            gravity: loads.gravity - config.balanced_gravity,
            fluid: loads.fluid,
            max_speed: config.max_speed,
            max_displacement_mm: self.base.max_displacement_mm,
            rigid,
            calm_mm: CALM * config.still_mm,
        }
    }

    /// Creates a solver for a body at rest: orders it for the cache, precomputes gradients, finds
    /// the stable step and the damping.
    pub fn new(body: &Body, config: &Config) -> Result<Self, BodyError> {
        Self::in_order(body, config, None)
    }

    /// The same, with the tetrahedra in a given order.
    fn in_order(body: &Body, config: &Config, tet_at: Option<Vec<u32>>) -> Result<Self, BodyError> {
        let (mut base, masses, scaling) = Base::of(body, config)?;
        base.layout.tet_at = tet_at.unwrap_or(base.layout.tet_at);
        let averages = base.config.selective_mass_scaling;
        let averaging = averages
            .then(|| Averaging::of(body, &base.layout, (&scaling, base.bound.stiffest), base.membrane_masses_g(body)));
        let nodes = Nodes::of(body, &base.layout, &masses, averaging);
        Ok(Self {
            gravity: Vec3::ZERO,
            fluid: Fluid::default(),
            growth: 0.0,
            elements: Elements::of(body, &base.layout, (&scaling, base.dynamic_scaling()), nodes, config),
            springs: ImplicitSprings::on_nodes(body.mesh.positions.len()),
            pressure: SurfacePressure::default(),
            mass_added: scaling.added as f32,
            body: Arc::new(body.clone()),
            base,
        })
    }

    /// Lets the fill of a tetrahedron fall to a share of its rest volume, in parts of
    /// [`FULL`](crate::FULL), over the next [`RAMP_STEPS`](crate::RAMP_STEPS) steps at most.
    ///
    /// A fill never rises: a higher one, or that of a tetrahedron that the mesh lacks, changes
    /// nothing. Costs 3 us in each of these steps, and no memory.
    pub fn lower_fill(&mut self, tet: u32, fill: u16) {
        self.elements.fills.lower(tet, fill);
    }

    /// Stable (critical) time step of the elements without safety factor and averaged
    /// accelerations, ms. A membrane bears [`stable_dt_ms`](SoftSolver::stable_dt_ms) only.
    pub fn bound_ms(&self) -> f32 {
        self.base.bound.at_rest_ms
    }

    /// Cost of simulated time with [`Config::selective_mass_scaling`] over that without; 1 where it
    /// would not be used.
    pub fn averaged_cost(&self) -> f64 {
        self.base.averaged_cost()
    }

    /// Mass-proportional damping α in use, 1/ms.
    pub fn damping_per_ms(&self) -> f32 {
        self.base.damping_per_ms
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
        let place_of = &self.base.layout.place_of;
        pressure.triangles.retain(|t| t.iter().all(|&n| (n as usize) < place_of.len()));
        pressure.triangles.iter_mut().flatten().for_each(|n| *n = place_of[*n as usize]);
        self.pressure = pressure;
    }

    /// Sets a node's displacement from rest, mm, and velocity, mm/ms. A fixed node keeps this
    /// velocity until the next call.
    pub fn set_node(&mut self, node: u32, displacement: Vec3, velocity: Vec3) {
        if let Some(&place) = self.base.layout.place_of.get(node as usize) {
            self.elements.nodes().set(place as usize, displacement, velocity);
            self.base.state.positions[node as usize] = self.elements.nodes().position(place as usize);
            self.base.state.velocities[node as usize] = velocity;
            self.elements.wake();
        }
    }

    /// Support force on a fixed node in the last step, N. For a free node: the accelerating force,
    /// reversed.
    pub fn support_force(&self, node: u32) -> Vec3 {
        self.base.layout.place_of.get(node as usize).map_or(Vec3::ZERO, |&place| -self.elements.force(place as usize))
    }

    /// Resets every node to its rest position with zero velocity, and clears the stress memory.
    pub fn reset(&mut self) {
        let nodes = self.elements.nodes();
        (0..nodes.u.len()).for_each(|place| nodes.set(place, Vec3::ZERO, Vec3::ZERO));
        self.publish();
        self.elements.forget();
        self.base.elapsed_ms = 0.0;
    }

    /// Does one pass of a step on the present state, for benches. A step without averaged
    /// accelerations is all passes in order.
    pub fn pass(&mut self, pass: Pass, loads: &Loads, dt_ms: f32) {
        let mut report = StepReport::default();
        match pass {
            Pass::Volumes => self.elements.volumes(dt_ms),
            Pass::Forces => _ = self.elements.forces(dt_ms),
            Pass::Press => self.press(loads, &self.update_of(loads, dt_ms), &mut report),
            Pass::Update => self.update(self.update_of(loads, dt_ms), &mut report),
        }
    }

    /// Takes the present displacements, with zero velocities, for the start of a motion.
    pub(crate) fn rest(&mut self) {
        self.elements.wake();
        self.base.elapsed_ms = 0.0;
        self.publish();
    }

    /// Writes positions and velocities in the mesh's node order.
    fn publish(&mut self) {
        let (nodes, Base { layout, rest, state, .. }) = (self.elements.nodes(), &mut self.base);
        let to = state.positions.iter_mut().zip(&mut state.velocities);
        for ((&place, rest), (x, v)) in layout.place_of.iter().zip(&*rest).zip(to) {
            *x = *rest + nodes.displacement(place as usize);
            *v = nodes.velocity(place as usize);
        }
    }
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
