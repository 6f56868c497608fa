//! Prints the plan for a fast and for a slow machine, at three tolerances.

use trepan_budget::{Machine, PlanError, Scene, plan};

fn main() -> Result<(), PlanError> {
    let fast = Machine { threads: 16, ..Machine::default() };
    let slow = Machine { ns_per_tet_step: 60.0, us_per_rigid_tick: 15.0, ns_per_ray: 1000.0, ..Machine::default() };
    for (name, machine) in [("fast machine", fast), ("slow machine", slow)] {
        for share in [2.0, 1.0, 0.5] {
            let usual = Scene::default();
            let scene = Scene {
                force_error_n: share * usual.force_error_n,
                displacement_mm: share * usual.displacement_mm,
                picture_error_percent: share * usual.picture_error_percent,
                ..usual
            };
            println!("# {name}, {share} times the usual tolerances\n{}", plan(&machine, &scene)?);
        }
    }
    Ok(())
}
