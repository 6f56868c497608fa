//! Small-strain elasticity with central differences: the cheapest right answer while nothing turns
//! or stretches much.
//!
//! # Theory
//! `M ü + α M u̇ + K u = f` with the constant stiffness of the rest state. Leapfrog:
//! `v⁺ = ((1 - α dt/2) v + dt M⁻¹ (f - K u)) / (1 + α dt/2)`, `u⁺ = u + dt v⁺`.
//!
//! # Practice
//! About 4 ns a tetrahedron and step, f32, sixteen elements at once, no allocation. Damping is
//! critical for the lowest mode unless set.
//!
//! # When not to use it
//! When anything rotates by more than a few degrees or stretches by more than a few percent: a
//! turned part swells, because small strain takes rotation for strain.
//!
//! # Sources
//! Zienkiewicz and Taylor, The Finite Element Method, vol. 1: the linear tetrahedron,
//! `K = ∫ Bᵀ D B`, and central differences. Liberties: K is applied element by element and never
//! assembled; masses are lumped.

use super::nodes::Nodes;
use super::parts::{Action, Block, Item, Parts, Rows, gradients_of, hooke, product, tetrahedra, times};
use glam::{DVec3, Vec4};
use trepan_soft::Descriptor;
use trepan_soft::Hooke;
use trepan_soft::simd::Lane;
use trepan_soft::{Body, BodyError, Loads, NodeState, SoftSolver, StepReport, Stiffness, power_bound_of_ms};

pub use super::nodes::Config;

/// Explicit small-strain solver.
pub struct Linear {
    elements: Parts<11>,
    nodes: Nodes,
    force: Vec<Vec4>,
    stable_dt_ms: f64,
}

/// Small-strain forces of elements with gradients and moduli from a row on.
pub(super) struct SmallStrain {
    /// Row of the first gradient; λV and μV follow `moduli` rows on.
    pub gradients: usize,
    /// Row of λV, before μV.
    pub moduli: usize,
}

impl<const K: usize> Action<K> for SmallStrain {
    #[inline(always)]
    fn act<L: Lane>(&self, block: &mut Block<K>, lanes: usize, x: &mut Rows, sums: &mut Rows) -> u32 {
        let gradients = block.gradients::<L>(lanes, self.gradients);
        let h = product(&block.edges::<L>(lanes, x), &gradients);
        let stress = hooke(&h, block.number(lanes, self.moduli), block.number(lanes, self.moduli + 1));
        block.add(lanes, times(&stress, &gradients), sums);
        0
    }
}

/// λV and μV of a tetrahedron, N mm.
pub(super) fn moduli_of(body: &Body, tet: usize) -> [f32; 2] {
    let (Hooke { lambda, mu }, volume) = (Hooke::of(body.material(tet)), body.shape(tet).volume_mm3);
    [(lambda * volume) as f32, (mu * volume) as f32]
}

impl Linear {
    /// Takes a body at rest.
    pub fn new(body: &Body, config: &Config) -> Result<Self, BodyError> {
        let nodes = config.nodes(body)?;
        let constants = |t: usize| {
            let (gradients, moduli) = (gradients_of(&body.shape(t)), moduli_of(body, t));
            std::array::from_fn(|i| if i < 9 { gradients[i] } else { moduli[i - 9] })
        };
        let items: Vec<Item<11>> = tetrahedra(body, constants);
        let stable_dt_ms = f64::from(config.safety) * power_bound_of_ms(body, &Stiffness::of(body));
        Ok(Self { elements: Parts::spread(&items), force: nodes.u.clone(), nodes, stable_dt_ms })
    }

    /// Sets the state of all free nodes by their rest position: displacement, mm, and velocity,
    /// mm/ms.
    pub fn set(&mut self, state: impl Fn(DVec3) -> (DVec3, DVec3)) {
        let Nodes { rest, u, v, inverse_masses, .. } = &mut self.nodes;
        for n in (0..u.len()).filter(|&n| inverse_masses[n] > 0.0) {
            let (displacement, velocity) = state(rest[n].as_dvec3());
            (u[n], v[n]) = (displacement.as_vec3().extend(0.0), velocity.as_vec3().extend(0.0));
        }
    }
}

impl SoftSolver for Linear {
    fn step(&mut self, loads: &Loads, dt_ms: f32) -> StepReport {
        let mut report = StepReport { substeps: 1, converged: true, ..StepReport::default() };
        self.elements.sum(&SmallStrain { gradients: 0, moduli: 9 }, &self.nodes.u, &mut self.force);
        self.force.iter_mut().for_each(|f| *f = -*f);
        report.contact_n = self.nodes.press(loads, &mut self.force);
        self.nodes.leapfrog(&self.force, loads.gravity, dt_ms, &mut report);
        report
    }

    fn state(&self) -> &NodeState {
        &self.nodes.state
    }

    fn stable_dt_ms(&self) -> f32 {
        self.stable_dt_ms as f32
    }
}

/// What the solver says of itself.
pub const METHOD: Descriptor = Descriptor {
    name: "linear",
    source: "Zienkiewicz, small strain, central differences",
    is_static: false,
    build: |body| Ok(Box::new(Linear::new(body, &Config::default())?)),
};
