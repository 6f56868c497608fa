//! A soft-tissue solver in one file, of another crate.

use trepan_contact::NodalContacts;
use trepan_geometry::Vec3;
use trepan_soft::{Body, Descriptor, Loads, Material, Method, NodeState, SoftSolver, StepReport, boxes};

/// Lets every node that is not fixed fall.
struct Toy {
    free: Vec<bool>,
    state: NodeState,
}

const TOY: Descriptor = Descriptor {
    name: "toy",
    source: "none",
    is_static: false,
    build: |body: &Body| {
        let mut free = vec![true; body.mesh.positions.len()];
        body.fixed.iter().for_each(|&node| free[node as usize] = false);
        Ok(Box::new(Toy { free, state: NodeState::at_rest(&body.mesh) }))
    },
};

impl SoftSolver for Toy {
    fn step(&mut self, loads: &Loads, dt_ms: f32) -> StepReport {
        for node in (0..self.free.len()).filter(|&node| self.free[node]) {
            self.state.velocities[node] += dt_ms * loads.gravity;
            self.state.positions[node] += dt_ms * self.state.velocities[node];
        }
        StepReport { substeps: 1, converged: true, ..StepReport::default() }
    }

    fn state(&self) -> &NodeState {
        &self.state
    }

    fn stable_dt_ms(&self) -> f32 {
        1.0
    }
}

#[test]
fn a_solver_of_one_file_is_built_and_steps() {
    let mesh = boxes::split_box([1; 3], Vec3::splat(10.0));
    let fixed = boxes::nodes_where(&mesh, |p| p.z < 1e-3);
    let body = Body::uniform(mesh, fixed.clone(), Material::BRAIN);
    let toy = Method::of(&TOY);
    assert!(toy.name() == "toy" && toy != Method::of(&trepan_soft::reference::METHOD));
    let mut solver = toy.build(&body).unwrap();
    let loads = Loads { gravity: Vec3::NEG_Z, contacts: NodalContacts::none(), ..Loads::default() };
    solver.step(&loads, 1.0);
    for (node, (now, rest)) in solver.positions().iter().zip(&body.mesh.positions).enumerate() {
        let fell = if fixed.contains(&(node as u32)) { 0.0 } else { 1.0 };
        assert_eq!(rest.z - now.z, fell);
    }
}
