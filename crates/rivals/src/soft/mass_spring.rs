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
//! About 7 ns a tetrahedron and step, f32, sixteen elements and springs at once, no allocation.
//!
//! # When not to use it
//! Where a force must be right: edges never point evenly, so stiffness depends on how they lie, and
//! no finer mesh makes it better.
//!
//! # Sources
//! Provot 1995: internal force of a mesh of masses and springs, `-Σ K (l - l₀ l/|l|)`. Liberties:
//! tetrahedra instead of a cloth's grid; stiffness from the shear modulus, as Lloyd, Székely and
//! Harders 2007 derive it from the linear element; the pressure, whose energy is that of a
//! tetrahedron's volume in Teschner et al. 2004; central differences instead of Euler's step;
//! damping by mass instead of along springs; no limit on stretch.

use super::nodes::Nodes;
use super::parts::{Action, Block, Item, Motion, Parts, Rows, gradients_of, minus, plus, scaled, tetrahedra, times};
use glam::Vec4;
use std::collections::BTreeMap;
use trepan_soft::Descriptor;
use trepan_soft::simd::{Lane, dot};
use trepan_soft::{Body, BodyError, Loads, Material, NodeState, SoftSolver, StepReport};

pub use super::nodes::Config;

/// Settings of [`METHOD`].
const DEFAULT: Config = Config { damping_per_ms: None, safety: 0.9 };

/// Mass-spring solver.
pub struct MassSpring {
    /// Two springs a lane.
    springs: Parts<10>,
    elements: Parts<10>,
    nodes: Nodes,
    of_springs: Vec<Vec4>,
    force: Vec<Vec4>,
    stable_dt_ms: f64,
}

/// An edge.
#[derive(Clone, Copy)]
struct Spring {
    ends: [u32; 2],
    length_mm: f64,
    stiffness: f64,
}

/// Forces of two springs a lane: edge at rest, stiffness and length of each.
struct Pull;

impl Action<10> for Pull {
    #[inline(always)]
    fn act<L: Lane>(&self, block: &mut Block<10>, lanes: usize, x: &mut Rows, sums: &mut Rows) -> u32 {
        let corners = block.corners::<L>(lanes);
        let [a, b, c, d] =
            [L::gather(x, corners[0]), L::gather(x, corners[1]), L::gather(x, corners[2]), L::gather(x, corners[3])];
        let (f, g) = (pull(block, lanes, 0, &minus(&b, &a)), pull(block, lanes, 5, &minus(&d, &c)));
        let none = [L::splat(0.0); 3];
        L::add_rows([f, minus(&none, &f), g, minus(&none, &g)], sums, corners);
        0
    }
}

/// Force on the first end of a spring whose ends moved apart by `d`, N. Without a difference of
/// large numbers, `l - l₀ = (2 e·d + d·d)/(l + l₀)`, e the edge at rest.
#[inline(always)]
fn pull<L: Lane>(block: &Block<10>, lanes: usize, first: usize, d: &[L; 3]) -> [L; 3] {
    let (edge, at_rest) = (block.vector(lanes, first), block.number::<L>(lanes, first + 4));
    let apart = plus(&edge, d);
    let length = dot(&apart, &apart).sqrt().at_least(1e-9);
    let longer = (dot(&edge, d) + dot(&edge, d) + dot(d, d)) / (length + at_rest);
    scaled(&apart, block.number::<L>(lanes, first + 3) * longer / length)
}

/// Forces of the pressure `κ' (J - 1)`: gradients and κ'V of each tetrahedron.
struct Press;

impl Action<10> for Press {
    #[inline(always)]
    fn act<L: Lane>(&self, block: &mut Block<10>, lanes: usize, x: &mut Rows, sums: &mut Rows) -> u32 {
        let gradients = block.gradients::<L>(lanes, 0);
        let motion = Motion::of(&block.edges::<L>(lanes, x), &gradients);
        let pressure = L::splat(0.0) - block.number::<L>(lanes, 9) * motion.excess;
        let [g, h, i] = gradients;
        let more = times(&motion.cofactor_less_one(), &gradients);
        let forces = [
            scaled(&plus(&g, &more[0]), pressure),
            scaled(&plus(&h, &more[1]), pressure),
            scaled(&plus(&i, &more[2]), pressure),
        ];
        block.add(lanes, forces, sums);
        motion.inverted()
    }
}

/// κ' of a material, MPa.
fn made_up(material: &Material) -> f64 {
    (material.bulk_mpa() - material.shear_mpa() * 5.0 / 3.0).max(0.0)
}

impl MassSpring {
    /// Takes a body at rest.
    pub fn new(body: &Body, config: &Config) -> Result<Self, BodyError> {
        let nodes = config.nodes(body)?;
        let springs = springs(body);
        let constants = |t: usize| {
            let shape = body.shape(t);
            let gradients = gradients_of(&shape);
            let pressure = (made_up(body.material(t)) * shape.volume_mm3) as f32;
            std::array::from_fn(|row| if row < 9 { gradients[row] } else { pressure })
        };
        Ok(Self {
            stable_dt_ms: f64::from(config.safety) * bound_ms(body, &springs),
            springs: Parts::spread(&pairs(body, &springs)),
            elements: Parts::spread(&tetrahedra(body, constants)),
            of_springs: nodes.u.clone(),
            force: nodes.u.clone(),
            nodes,
        })
    }

    /// Forces of springs and pressure; gives the number of inverted elements.
    fn pull(&mut self) -> u32 {
        self.springs.sum(&Pull, &self.nodes.u, &mut self.of_springs);
        let inverted = self.elements.sum(&Press, &self.nodes.u, &mut self.force);
        self.force.iter_mut().zip(&self.of_springs).for_each(|(f, of_springs)| *f += *of_springs);
        inverted
    }
}

/// `2/ω` with ω² no less than the largest, ms: Gershgorin's circles for the springs, single
/// elements for the pressure.
fn bound_ms(body: &Body, springs: &[Spring]) -> f64 {
    let masses = body.lumped_masses_g();
    let mut around = vec![0.0; masses.len()];
    springs.iter().for_each(|s| s.ends.iter().for_each(|&n| around[n as usize] += 2.0 * s.stiffness));
    let of_springs = around.iter().zip(&masses).map(|(k, m)| k / m).fold(0.0, f64::max);
    let of_pressure = |t: usize| {
        let slopes: f64 = body.shape(t).gradients.iter().map(|g| g.length_squared()).sum();
        4.0 * made_up(body.material(t)) * slopes / f64::from(body.material(t).density_g_mm3())
    };
    2.0 / (of_springs + (0..body.mesh.tets.len()).map(of_pressure).fold(0.0, f64::max)).sqrt()
}

/// Two springs each; the last may stand alone.
fn pairs(body: &Body, springs: &[Spring]) -> Vec<Item<10>> {
    let rows = |spring: &Spring| {
        let [a, b] = spring.ends.map(|n| body.mesh.positions[n as usize].as_dvec3());
        let edge = (b - a).as_vec3();
        [edge.x, edge.y, edge.z, spring.stiffness as f32, spring.length_mm as f32]
    };
    let pair = |two: &[Spring]| {
        let other = two.get(1).copied().unwrap_or(Spring { stiffness: 0.0, ..two[0] });
        let (nodes, rows) = ([two[0].ends, other.ends].concat(), [rows(&two[0]), rows(&other)].concat());
        Item { nodes: std::array::from_fn(|i| nodes[i]), constants: std::array::from_fn(|i| rows[i]) }
    };
    springs.chunks(2).map(pair).collect()
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
    use glam::Mat3;
    use trepan_geometry::Vec3;
    use trepan_soft::boxes;

    #[test]
    fn swelling_has_the_bulk_modulus_of_the_material_and_turning_no_force() {
        let mesh = boxes::split_box([2; 3], Vec3::splat(20.0));
        let body = Body::uniform(mesh, vec![], Material::BRAIN);
        let mut solver = MassSpring::new(&body, &Config::default()).unwrap();
        let (strain, turn) = (1e-5, Mat3::from_rotation_y(0.7));
        solver.nodes.u = solver.nodes.rest.iter().map(|x| (*x * strain).extend(0.0)).collect();
        solver.pull();
        // The virial of the nodal forces is -3 p V, p = 3 κ ε.
        let virial: f64 =
            solver.nodes.rest.iter().zip(&solver.force).map(|(x, f)| f64::from(x.dot(f.truncate()))).sum();
        let exact = -9.0 * body.material(0).bulk_mpa() * f64::from(strain) * 8000.0;
        assert!((virial / exact - 1.0).abs() < 1e-3, "{virial} {exact}");
        solver.nodes.u = solver.nodes.rest.iter().map(|x| (turn * *x - *x).extend(0.0)).collect();
        solver.pull();
        // The same nodes moved by their displacements along one axis: what is no rigid motion.
        let turned = solver.force.iter().map(|f| f.length()).fold(0.0, f32::max);
        solver.nodes.u.iter_mut().for_each(|u| *u *= Vec4::X);
        solver.pull();
        let sheared = solver.force.iter().map(|f| f.length()).fold(0.0, f32::max);
        assert!(turned < 1e-6 * sheared, "{turned} N turned, {sheared} N sheared");
    }
}
