//! Masses and springs: the first idea that everybody has, here to be compared with.
//!
//! # Theory
//! Every edge is a spring, `f = k (l - l₀) e`. Springs that point evenly in all directions make a
//! solid with `λ = μ = Σ k l²/(15 V)`, so each tetrahedron gives each of its six edges
//! `k = 2.5 μ V/l²`. Such a solid has ν = 1/4 whatever is asked for (Cauchy's relation): the
//! tetrahedron adds the pressure `κ' (J - 1)`, `κ' = κ - 5/3 μ`, that makes up its bulk modulus;
//! none under ν = 1/4, where κ' would be a pressure that collapses single tetrahedra. Central
//! differences as in [`super::linear`].
//!
//! # Practice
//! About 20 ns a tetrahedron and step, f64, no allocation.
//!
//! # When not to use it
//! Where a force must be right: edges never point evenly, so stiffness depends on how they lie, and
//! no finer mesh makes it better.

use crate::body::Element;
use crate::energy::cofactor;
use crate::method::Descriptor;
use crate::rivals::nodes::Nodes;
use crate::{Body, BodyError, Loads, NodeState, SoftSolver, StepReport};
use glam::{DMat3, DVec3};
use std::collections::BTreeMap;

pub use crate::rivals::nodes::Config;

/// Settings of [`METHOD`].
const DEFAULT: Config = Config { damping_per_ms: None, safety: 0.9 };

/// Mass-spring solver.
pub struct MassSpring {
    springs: Vec<Spring>,
    elements: Vec<Element>,
    /// κ' by material, MPa.
    pressures: Vec<f64>,
    nodes: Nodes,
    force: Vec<DVec3>,
    stable_dt_ms: f64,
}

/// An edge.
struct Spring {
    ends: [u32; 2],
    length_mm: f64,
    stiffness: f64,
}

impl MassSpring {
    /// Takes a body at rest.
    pub fn new(body: &Body, config: &Config) -> Result<Self, BodyError> {
        let nodes = config.nodes(body)?;
        let made_up = |m: &crate::Material| (m.bulk_mpa() - m.shear_mpa() * 5.0 / 3.0).max(0.0);
        let mut solver = Self {
            springs: springs(body),
            elements: body.elements(),
            pressures: body.materials.iter().map(made_up).collect(),
            force: nodes.u.clone(),
            nodes,
            stable_dt_ms: 0.0,
        };
        solver.stable_dt_ms = f64::from(config.safety) * solver.bound_ms(body);
        Ok(solver)
    }

    /// `2/ω` with ω² no less than the largest: Gershgorin's circles for the springs, single
    /// elements for the pressure.
    fn bound_ms(&self, body: &Body) -> f64 {
        let mut around = vec![0.0; self.nodes.masses.len()];
        self.springs.iter().for_each(|s| s.ends.iter().for_each(|&n| around[n as usize] += 2.0 * s.stiffness));
        let of_springs = around.iter().zip(&self.nodes.masses).map(|(k, m)| k / m).fold(0.0, f64::max);
        let of_pressure = |t: usize| {
            let slopes: f64 = self.elements[t].shape.gradients.iter().map(|g| g.length_squared()).sum();
            let pressure = self.pressures[usize::from(self.elements[t].material)];
            4.0 * pressure * slopes / f64::from(body.material(t).density_g_mm3())
        };
        2.0 / (of_springs + (0..self.elements.len()).map(of_pressure).fold(0.0, f64::max)).sqrt()
    }

    /// Forces of springs and pressure; gives the number of inverted elements.
    fn pull(&mut self) -> u32 {
        self.force.fill(DVec3::ZERO);
        let Nodes { rest, u, .. } = &self.nodes;
        for Spring { ends: [a, b], length_mm, stiffness } in &self.springs {
            let [a, b] = [*a as usize, *b as usize];
            let apart = (rest[b] + u[b]) - (rest[a] + u[a]);
            let length = apart.length().max(1e-9);
            let force = apart * (stiffness * (1.0 - length_mm / length));
            self.force[a] += force;
            self.force[b] -= force;
        }
        let mut inverted = 0;
        for Element { corners, shape, material } in &self.elements {
            let f = DMat3::IDENTITY + shape.gradient_of(self.nodes.corners(corners));
            let j = f.determinant();
            inverted += u32::from(j <= 0.0);
            let stress = cofactor(f) * (self.pressures[usize::from(*material)] * (j - 1.0));
            for (&n, force) in corners.iter().zip(shape.forces_of(stress)) {
                self.force[n as usize] -= force;
            }
        }
        inverted
    }
}

impl SoftSolver for MassSpring {
    fn step(&mut self, loads: &Loads, dt_ms: f32) -> StepReport {
        let inverted = self.pull();
        let mut report = StepReport { substeps: 1, converged: true, inverted, ..StepReport::default() };
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

/// Every edge once, with what all tetrahedra around it give it.
fn springs(body: &Body) -> Vec<Spring> {
    let mut edges: BTreeMap<[u32; 2], f64> = BTreeMap::new();
    for (t, corners) in body.mesh.tets.iter().enumerate() {
        for (i, &a) in corners.iter().enumerate() {
            for &b in &corners[i + 1..] {
                let given = 2.5 * body.material(t).shear_mpa() * body.mesh.volume_mm3(t);
                *edges.entry([a.min(b), a.max(b)]).or_default() += given;
            }
        }
    }
    let spring = |(ends, given): ([u32; 2], f64)| {
        let [a, b] = ends.map(|n| body.mesh.positions[n as usize].as_dvec3());
        Spring { ends, length_mm: a.distance(b), stiffness: given / a.distance_squared(b) }
    };
    edges.into_iter().map(spring).collect()
}

/// What the solver says of itself.
pub const METHOD: Descriptor = Descriptor {
    name: "mass-spring",
    source: "Provot 1995, with a pressure that makes up the bulk modulus",
    is_static: false,
    build: |body| Ok(Box::new(MassSpring::new(body, &DEFAULT)?)),
};

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Material, boxes};
    use trepan_geometry::Vec3;

    #[test]
    fn swelling_has_the_bulk_modulus_of_the_material_and_turning_no_force() {
        let mesh = boxes::split_box([2; 3], Vec3::splat(20.0));
        let body = Body::uniform(mesh, vec![], Material::BRAIN);
        let mut solver = MassSpring::new(&body, &Config::default()).unwrap();
        let (strain, turn) = (1e-5, DMat3::from_rotation_y(0.7));
        solver.nodes.u = solver.nodes.rest.iter().map(|x| *x * strain).collect();
        solver.pull();
        // The virial of the nodal forces is -3 p V, p = 3 κ ε.
        let virial: f64 = solver.nodes.rest.iter().zip(&solver.force).map(|(x, f)| x.dot(*f)).sum();
        let exact = -9.0 * body.material(0).bulk_mpa() * strain * 8000.0;
        assert!((virial / exact - 1.0).abs() < 1e-3, "{virial} {exact}");
        solver.nodes.u = solver.nodes.rest.iter().map(|x| turn * *x - *x).collect();
        solver.pull();
        assert!(solver.force.iter().all(|f| f.length() < 1e-12));
    }
}
