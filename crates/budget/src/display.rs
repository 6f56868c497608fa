//! Text of a plan: the choices, the reasons, and the costs of the neighbours.

use crate::{Choice, Plan, Scene};
use core::fmt;

impl fmt::Display for Plan {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let scene = &self.scene;
        if let Some(bone) = &self.bone {
            part(f, scene, "bone", bone, (scene.force_error_n, "N"))?;
        }
        if let Some(tissue) = &self.tissue {
            part(f, scene, "tissue", tissue, (scene.displacement_mm, "mm"))?;
        }
        if let Some((step_ms, edge_mm)) = self.step_and_edge() {
            let threads = self.solver_threads;
            writeln!(f, "  step {step_ms:.2} ms, edge {edge_mm:.1} mm, {threads} thread(s)")?;
        }
        part(f, scene, "picture", &self.picture, (scene.picture_error_percent, "%"))?;
        let (cores, fixed, threads) = (self.cores(), self.fixed_cores, self.machine.threads);
        writeln!(f, "all: {cores:.2} cores of {threads}, {fixed:.2} of them whatever is chosen")
    }
}

fn part<T: fmt::Display>(
    f: &mut fmt::Formatter<'_>,
    scene: &Scene,
    name: &str,
    choice: &Choice<T>,
    (tolerance, unit): (f64, &str),
) -> fmt::Result {
    let Choice { what, error, cost, .. } = choice;
    let why = match (choice.in_time, choice.meets_tolerance) {
        (true, true) => "cheapest within the tolerance",
        (true, false) => "tolerance not met, the most accurate that runs in time",
        (false, _) => "too slow even so, the cheapest there is",
    };
    writeln!(f, "{name}: {what}")?;
    write!(f, "  {why}: error {error:.3} {unit} of {tolerance:.3} allowed")?;
    if let Some(force) = choice.force {
        write!(f, ", force {:.3} N off of {:.3} allowed", force.error_n, force.allowed_n(scene))?;
    }
    writeln!(f, ", {cost:.3} cores")?;
    for (label, neighbour) in [("next better", &choice.better), ("next cheaper", &choice.cheaper)] {
        if let Some(n) = neighbour {
            let late = if n.in_time { "" } else { ", too slow here" };
            let force = n.force.map(|force| format!(", {:.3} N", force.error_n)).unwrap_or_default();
            writeln!(f, "  {label}: {}: error {:.3} {unit}{force}, {:.3} cores{late}", n.what, n.error, n.cost)?;
        }
    }
    Ok(())
}
