//! Builds the tissue's solver from the session's ingredients.
//!
//! # Practice
//! The graphics card is taken only when it is one: a software driver is slower than the processor.
//! What cannot run on the card runs on the processor, with a remark; so does the rest of a session
//! whose card is lost ([`WithSpare`]).

use crate::ModelError;
use crate::ingredients::{Element, Ingredients, Relaxation, SolverDevice};
use crate::measure::tissue::MASS_ADDED;
use crate::methods;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use trepan_budget::Tissue;
use trepan_gpu::{Gpu, Prefer};
use trepan_measurements::pulse;
use trepan_mesh::{Surface, TetMesh};
use trepan_patient::TissueClass;
use trepan_patient::progress::Stopwatch;
use trepan_soft::{Body, BodyError, Loads, Material, SoftSolver, SurfacePressure};
use trepan_stages::skull_wall::SkullWall;
use trepan_tled::gpu::WithSpare;
use trepan_tled::{Config, Settled, Settling, Tled, choice};

/// Times that the brain comes to rest in the skull under pressure, as the wall is found anew.
const ROUNDS: usize = 3;
/// End of each; what is left of the motion is seen in the session's first second.
const SETTLING: Settling = Settling { tolerance_mm: 0.01, steps: 200 };
/// Motion to go at which a brain counts as at rest, mm.
const AT_REST_MM: f32 = 0.05;
/// Time for which each device is tried to find the faster one, ms.
const TRIAL_MS: f64 = 100.0;

/// What runs as the solver.
#[derive(Clone, Debug)]
pub struct SolverInfo {
    /// Name of the solver.
    pub name: &'static str,
    /// Where it runs.
    pub device: SolverDevice,
    /// Nodes of the brain that do not move.
    pub fixed_nodes: usize,
    remark: Option<String>,
    lost: Arc<AtomicBool>,
}

impl SolverInfo {
    fn here(name: &'static str) -> Self {
        Self { name, device: SolverDevice::Cpu, fixed_nodes: 0, remark: None, lost: Arc::default() }
    }

    /// Remarks for the report: why it runs elsewhere than asked, and whether the card was lost.
    pub fn remarks(&self) -> Vec<String> {
        let lost = self.lost.load(Ordering::Relaxed).then(|| {
            "the graphics card was lost while the solver ran on it: the processor went on from the same positions; \
             update its driver, or use --set device=cpu"
                .into()
        });
        self.remark.iter().cloned().chain(lost).collect()
    }
}

/// Builds the solver of a body at rest, with the skull around it, if there is one. The body's
/// materials are the tissue classes, in their order.
pub fn build(
    body: &Body,
    wall: Option<&mut SkullWall>,
    tissue: &Tissue,
    ingredients: &Ingredients,
) -> Result<(Box<dyn SoftSolver>, SolverInfo), ModelError> {
    let (solver, ran) = on_any(body, wall, tissue, ingredients)?;
    Ok((solver, SolverInfo { fixed_nodes: body.fixed.len(), ..ran }))
}

fn on_any(
    body: &Body,
    wall: Option<&mut SkullWall>,
    tissue: &Tissue,
    ingredients: &Ingredients,
) -> Result<(Box<dyn SoftSolver>, SolverInfo), ModelError> {
    if let Some(method) = methods::solver(tissue.solver) {
        return Ok((method.build(body).map_err(refused)?, SolverInfo::here(method.name())));
    }
    let config = ingredients.config();
    let (on_card, remark) = match ingredients.device {
        SolverDevice::Cpu => (None, None),
        SolverDevice::Fastest if ingredients.surface_pressure_mmhg > 0.0 => (None, None),
        _ if ingredients.surface_pressure_mmhg > 0.0 => (None, Some(elsewhere("it has no surface pressure"))),
        SolverDevice::Fastest if !is_faster_on_card(body, &config)? => (None, None),
        _ => match WithSpare::on_a_card(body, &config) {
            Ok(solver) => (Some(solver), None),
            Err(fault) => (None, Some(elsewhere(&fault.to_string()))),
        },
    };
    remark.iter().for_each(|remark| tracing::warn!("{remark}"));
    match on_card {
        Some(solver) => {
            let ran = SolverInfo { lost: solver.lost(), device: SolverDevice::Gpu, ..SolverInfo::here("tled-gpu") };
            Ok((Box::new(solver), ran))
        }
        None => {
            let solver = on_processor(body, wall, &config, ingredients)?;
            Ok((Box::new(solver), SolverInfo { remark, ..SolverInfo::here("tled") }))
        }
    }
}

fn elsewhere(why: &str) -> String {
    format!("the solver runs on the processor, not on the graphics card: {why}")
}

fn refused(fault: BodyError) -> ModelError {
    ModelError::Internal(format!("the brain: {fault}"))
}

impl Ingredients {
    /// Material of every tissue class, in their order, for a Young's modulus of brain, MPa.
    pub fn materials(&self, young_mpa: f32) -> Vec<Material> {
        let young_mpa = young_mpa * self.relaxation.hand_speed_factor();
        TissueClass::ALL.map(|class| self.laws[class as usize].material(class, young_mpa)).to_vec()
    }

    /// Stress relaxation.
    pub fn relaxation(&self) -> trepan_tled::Relaxation {
        match self.relaxation {
            Relaxation::Off => trepan_tled::Relaxation::NONE,
            Relaxation::Prony => trepan_tled::Relaxation::BRAIN,
            Relaxation::SolidAndFluid => trepan_tled::Relaxation::SOLID_AND_FLUID,
        }
    }

    /// Settings of TLED.
    pub fn config(&self) -> Config {
        Config {
            mass_scaling: MASS_ADDED,
            dynamic_mass_scaling: self.dynamic_mass_scaling,
            selective_mass_scaling: self.selective_mass_scaling,
            averaged_pressure: self.element == Element::LockingFree,
            relaxation: self.relaxation(),
            threads: self.threads.unwrap_or(1),
            still_mm: if self.steps_all() { 0.0 } else { self.still_mm },
            ..Config::default()
        }
    }
}

/// The solver on the processor, at rest under the pressure on its surface within the skull.
fn on_processor(
    body: &Body,
    mut wall: Option<&mut SkullWall>,
    config: &Config,
    ingredients: &Ingredients,
) -> Result<Tled, ModelError> {
    let mut solver = Tled::new(body, config).map_err(refused)?;
    let mmhg = ingredients.surface_pressure_mmhg;
    if mmhg > 0.0 {
        solver.set_pressure(SurfacePressure { triangles: wet(body), mpa: pulse::MMHG.f32() * mmhg });
        let (mut loads, mut settled) = (Loads::default(), Settled::default());
        for _ in 0..ROUNDS {
            loads.contacts.clear();
            wall.iter_mut().for_each(|wall| wall.press(solver.positions(), false, &mut loads.contacts));
            settled = solver.settle(&loads, &SETTLING);
        }
        let Settled { left_mm, last, .. } = settled;
        if left_mm > AT_REST_MM || last.inverted > 0 {
            return Err(ModelError::Usage(format!(
                "--set surface-pressure={mmhg}: the brain does not come to rest under it, with {} elements inverted \
                 and {left_mm:.2} mm to go: give less, or --set law=neo-hookean",
                last.inverted
            )));
        }
    }
    Ok(solver)
}

/// Triangles between tissue and fluid: the brain's surface and the walls of the ventricles. On the
/// surface alone the pressure would close the ventricles.
fn wet(body: &Body) -> Vec<[u32; 3]> {
    let is_tissue = |(_, material): &(_, &u8)| **material != TissueClass::Ventricle as u8;
    let tets = body.mesh.tets.iter().zip(&body.material_of_tet).filter(is_tissue).map(|(tet, _)| *tet).collect();
    Surface::of(&TetMesh { positions: body.mesh.positions.clone(), tets }).triangles
}

/// Tries both devices for a time, if there is a card.
fn is_faster_on_card(body: &Body, config: &Config) -> Result<bool, ModelError> {
    if Gpu::open(Prefer::Hardware).map_or(true, |gpu| gpu.is_software()) {
        return Ok(false);
    }
    let clock = Stopwatch::start();
    let all = choice::candidates(body, config);
    let chosen = choice::fastest(&all, &Loads::default(), TRIAL_MS, &|| clock.now_ms());
    let chosen = chosen.map_err(|fault| ModelError::Internal(format!("the brain: {fault}")))?;
    tracing::info!("solver {}: {}", chosen.name, chosen.why);
    Ok(chosen.name != "tled")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ingredients::Law;
    use trepan_contact::NodalContact;
    use trepan_geometry::Vec3;
    use trepan_soft::boxes;

    const TLED: Tissue = Tissue { solver: "tled", tets: 0, halvings: 0 };

    /// A block of brain, 30 mm wide, fixed at the bottom.
    fn block(laws: &Ingredients) -> Body {
        let mesh = boxes::split_box([6; 3], Vec3::splat(30.0));
        let fixed = boxes::nodes_where(&mesh, |p| p.z < 1e-3);
        Body::uniform(mesh, fixed, laws.laws[0].material(TissueClass::Brain, 0.003))
    }

    /// Depth of the middle of the top, mm, 60 ms after a spring began to press on it, and the
    /// force, N.
    fn pressed(ingredients: &Ingredients) -> ([f32; 2], SolverInfo) {
        let body = block(ingredients);
        let (mut solver, ran) = build(&body, None, &TLED, ingredients).unwrap();
        let mut spring = NodalContact::none();
        let top = boxes::nodes_where(&body.mesh, |p| p.z > 29.99 && p.truncate().distance([15.0; 2].into()) < 7.0);
        top.iter().for_each(|node| spring.add(*node, 1.0));
        spring.normalise();
        (spring.normal, spring.stiffness, spring.damping) = (Vec3::Z, 0.3, 0.3);
        let place = spring;
        let height = |solver: &dyn SoftSolver| place.mean(|node| solver.positions()[node as usize]).z;
        let start = height(&*solver);
        spring.offset_mm = 2.5 - start;
        let loads = Loads { contacts: spring.into(), ..Loads::default() };
        let (mut force, dt_ms) = (0.0, solver.stable_dt_ms());
        (0..(60.0 / dt_ms) as u32).for_each(|_| force = solver.step(&loads, dt_ms).contact_n);
        ([start - height(&*solver), force], ran)
    }

    #[test]
    fn each_ingredient_of_the_solver_reaches_it() {
        let plain = Ingredients::default();
        let (usual, ran) = pressed(&plain);
        assert_eq!((ran.name, ran.device, ran.remarks().len()), ("tled", SolverDevice::Cpu, 0));
        assert!(usual[0] > 0.5 && usual[1] > 0.01, "{usual:?}");
        assert_eq!(pressed(&Ingredients { threads: Some(2), ..plain.clone() }).0, usual, "threads change no bit");
        let short_steps = Ingredients { selective_mass_scaling: false, ..plain.clone() };
        let change = pressed(&short_steps).0[1] / usual[1] - 1.0;
        assert!(change != 0.0 && change.abs() < 0.05, "{change}");
        let softer = [
            Ingredients { element: Element::LockingFree, ..plain.clone() },
            Ingredients { relaxation: Relaxation::Prony, ..plain.clone() },
        ];
        for with in softer {
            let (is, _) = pressed(&with);
            assert!(is[0] > 1.002 * usual[0] && is[1] < usual[1], "{with:?}: {is:?} of {usual:?}");
        }
        for law in [Law::StVenantKirchhoff, Law::MooneyRivlin, Law::Ogden, Law::Stiffening] {
            let (is, _) = pressed(&Ingredients { laws: [law; TissueClass::ALL.len()], ..plain.clone() });
            let change = (is[1] / usual[1] - 1.0).abs();
            assert!((1e-4..1.0).contains(&change), "{law:?}: {is:?} of {usual:?}");
        }
    }

    #[test]
    fn a_body_under_surface_pressure_is_at_rest_and_smaller() {
        let with = Ingredients { surface_pressure_mmhg: 10.0, ..Ingredients::default() };
        let body = block(&with);
        let (mut solver, _) = build(&body, None, &TLED, &with).unwrap();
        let (before, dt_ms) = (solver.positions().to_vec(), solver.stable_dt_ms());
        let top = boxes::nodes_where(&body.mesh, |p| p.z > 29.99);
        let sunk = top.into_iter().map(|n| 30.0 - before[n as usize].z);
        assert!(sunk.fold(f32::INFINITY, f32::min) > 0.2, "1.3 kPa on a bulk modulus of 10 kPa");
        let centre = |tet: usize| body.mesh.corners(tet).iter().sum::<Vec3>() / 4.0;
        let is_inside = |tet: &usize| (centre(*tet) - 15.0).abs().max_element() < 5.0;
        let mut hollow = block(&with);
        hollow.materials = TissueClass::ALL.map(|class| class.material(0.003)).to_vec();
        let all = hollow.mesh.tets.len();
        (0..all).filter(is_inside).for_each(|tet| hollow.material_of_tet[tet] = TissueClass::Ventricle as u8);
        let (filled, _) = build(&hollow, None, &TLED, &with).unwrap();
        let volume = |tet: usize, positions: &[Vec3]| {
            let [a, b, c, d] = hollow.mesh.tets[tet].map(|n| positions[n as usize]);
            (b - a).cross(c - a).dot(d - a) / 6.0
        };
        let of_ventricle =
            |positions: &[Vec3]| (0..all).filter(is_inside).map(|tet| volume(tet, positions)).sum::<f32>();
        let share = of_ventricle(filled.positions()) / of_ventricle(&hollow.mesh.positions);
        assert!(share > 0.8, "the ventricle keeps {share} of its volume");
        let much = Ingredients {
            surface_pressure_mmhg: 60.0,
            laws: [Law::StVenantKirchhoff; TissueClass::ALL.len()],
            ..with.clone()
        };
        let fault = build(&block(&much), None, &TLED, &much).err().map(|fault| fault.to_string());
        assert!(
            fault.as_ref().is_some_and(|fault| fault.contains("surface-pressure=60: the brain does not")),
            "{fault:?}"
        );
        (0..100).for_each(|_| _ = solver.step(&Loads::default(), dt_ms));
        let moved = before.iter().zip(solver.positions()).map(|(a, b)| a.distance(*b)).fold(0.0, f32::max);
        assert!(moved < 0.02, "{moved} mm");
    }

    #[test]
    fn without_a_graphics_card_the_processor_takes_over_with_a_remark() {
        let plain = Ingredients::default();
        let usual = pressed(&plain).0;
        for device in [SolverDevice::Gpu, SolverDevice::Fastest] {
            let (is, ran) = pressed(&Ingredients { device, ..plain.clone() });
            let on_card = ran.device == SolverDevice::Gpu;
            let is_card = Gpu::open(Prefer::Hardware).is_ok_and(|gpu| !gpu.is_software());
            assert!(!on_card || is_card, "a software driver was taken");
            assert!((is[1] / usual[1] - 1.0).abs() < if on_card { 1e-3 } else { 1e-9 });
            let remarks = ran.remarks();
            assert_eq!(remarks.len(), usize::from(device == SolverDevice::Gpu && !on_card), "{remarks:?}");
            assert!(remarks.iter().all(|text| text.contains("runs on the processor")), "{remarks:?}");
        }
        let both = Ingredients { device: SolverDevice::Gpu, surface_pressure_mmhg: 5.0, ..plain };
        let (_, ran) = build(&block(&both), None, &TLED, &both).unwrap();
        assert!(ran.remarks()[0].contains("no surface pressure"));
        ran.lost.store(true, Ordering::Relaxed);
        assert!(ran.remarks()[1].contains("the graphics card was lost"));
    }
}
