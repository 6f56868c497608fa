//! Which model does a scene need on which machine? Prints the plan for a laptop and for a slower one, at three tolerances.

use trepan_budget::{Machine, PlanError, Scene, plan};

fn main() -> Result<(), PlanError> {
    let laptop = Machine { ns_per_tet_step: 20.0, us_per_rigid_tick: 4.0, threads: 4 };
    let slow = Machine { ns_per_tet_step: 60.0, us_per_rigid_tick: 15.0, threads: 2 };
    for (name, machine) in [("laptop", laptop), ("slow machine", slow)] {
        for displacement_mm in [1.0, 0.5, 0.4] {
            let scene = Scene { displacement_mm, force_error_n: 0.1 * displacement_mm, ..Scene::default() };
            println!("# {name}, {displacement_mm} mm\n{}", plan(&machine, &scene)?);
        }
    }
    Ok(())
}
