//! Setup of a session: patient, plan and models, and the stages built from them.

use crate::device_limits::DeviceLimits;
use crate::error::SessionError;
use crate::models::Models;
use crate::operation::Operation;
use std::sync::{Arc, OnceLock};
use trepan_bone::{BoneVolume, Piece};
use trepan_budget::Bone;
use trepan_dura::Dura;
use trepan_geometry::{ToolState, Vec3, units};
use trepan_haptics::script::Target;
use trepan_link::Recording;
use trepan_measurements::{aspirator, shift, support};
use trepan_mesh::TetMesh;
use trepan_models::ingredients::{Ingredients, SolverDevice, Support};
use trepan_models::methods;
use trepan_models::perfusion::perfusion;
use trepan_models::solver::{self, SolverInfo};
use trepan_patient::Case;
use trepan_patient::Plan;
use trepan_patient::anchors::BrainSupport;
use trepan_patient::remark;
use trepan_patient::{RestBrain, Scene, TissueClass};
use trepan_report::regions::{Region, regions};
use trepan_report::summary::{Resected, Resection};
use trepan_rigid::{Extent, Method};
use trepan_runtime::{Stages, Tissue};
use trepan_stages::collision_step::CollisionStage;
use trepan_stages::haptic_config::{BONE, HapticConfig, TISSUE};
use trepan_stages::haptic_tick::HapticStage;
use trepan_stages::program::Program;
use trepan_stages::second_hand::SecondHand;
use trepan_stages::settling::Settling;
use trepan_stages::solver_step::SolverStage;
use trepan_voxel_size::{CostModel, Measures};

/// How far a tumour sinks over what the cortex does, in the built-in case, numerical.
const SINKS: f32 = 0.7;

/// How far the dura is modelled beyond the planned opening, mm, numerical.
const AROUND_MM: f32 = 8.0;
/// Share of the opening's radius that is incised, and parts of an incision, numerical.
const INCISED: f32 = 0.97;
const INCISION_PARTS: u8 = 10;

/// Patient, plan, settings and models of a session.
pub(crate) struct SessionSetup {
    /// The program.
    pub program: Program,
    /// The patient.
    pub scene: Scene,
    /// Planned removal of bone.
    pub plan: Plan,
    /// Settings of the operation.
    pub operation: Operation,
    /// Models that run.
    pub models: Models,
    /// Copy of the bone that a replay drills, because the window plays the scene's bone back and
    /// forth.
    filmed: Option<Arc<BoneVolume>>,
    young_mpa: f32,
    /// What runs as the solver, once it is built.
    ran: OnceLock<SolverInfo>,
}

impl SessionSetup {
    /// Prepares a case for a session. `filmed`: the window plays the shown bone back and forth, so
    /// a copy is drilled.
    pub fn new(
        program: Program,
        (case, models): (Case, Models),
        operation: Operation,
        filmed: bool,
    ) -> Result<Self, SessionError> {
        let scene = Scene::new(program, case)?;
        scene.remarks.iter().for_each(|remark| remark::log(remark));
        let copy = |bone: &Arc<BoneVolume>| BoneVolume::new(&bone.snapshot(), bone.isovalue()).map(Arc::new);
        let filmed = scene.bone.as_ref().filter(|_| filmed).map(copy).transpose();
        let mut setup = Self {
            program,
            plan: planned(&scene, &operation)?,
            young_mpa: units::mpa_from_kpa(operation.young_modulus_kpa),
            scene,
            operation,
            models,
            filmed: filmed.map_err(|fault| SessionError::Internal(fault.to_string()))?,
            ran: OnceLock::new(),
        };
        let anchored = setup.is_anchored();
        let usual = if anchored { support::CSF_LOSS } else { support::CSF_LOSS_UNIFORM };
        let loss = *setup.operation.csf_loss.get_or_insert(usual.f32());
        if let Some(target) = setup.plan.target.as_mut().filter(|_| anchored) {
            target.sinks_mm = SINKS * shift::LANDMARKS_END.f32() * loss / usual.f32();
        }
        let closed = setup.operation.dura.unwrap_or(setup.plan.target.is_some());
        if let Some((dura, radius_mm)) = setup.dura().filter(|_| closed) {
            setup.plan.incisions = dura.cross(INCISED * radius_mm, INCISION_PARTS).into();
        }
        setup.operation.dura = Some(!setup.plan.incisions.is_empty());
        Ok(setup)
    }

    /// The bone, if the program drills it.
    pub fn bone(&self) -> Option<&Arc<BoneVolume>> {
        self.filmed.as_ref().or(self.scene.bone.as_ref()).filter(|_| self.program.has_bone())
    }

    /// The brain, if it deforms.
    fn brain(&self) -> Option<&RestBrain> {
        self.scene.brain.as_ref().filter(|_| self.program.has_tissue())
    }

    /// Connected pieces of the bone in its current state.
    pub fn pieces(&self) -> Vec<Piece> {
        self.bone().map_or_else(Vec::new, |bone| Piece::all(bone))
    }

    /// Forces on the brain by region, from a recording.
    pub fn regions(&self, recording: &Recording) -> Vec<Region> {
        self.brain().map_or_else(Vec::new, |brain| regions(brain, self.program.tray(), &recording.ticks))
    }

    /// What is missing of the brain, from what is left of each tetrahedron, of 65535; `None` if
    /// nothing is.
    pub fn resection(&self, fills: &[u16]) -> Option<Resection> {
        let brain = self.brain().filter(|_| fills.iter().any(|fill| *fill < u16::MAX))?;
        let (whole, left) = (brain.left_mm3(&vec![u16::MAX; fills.len()]), brain.left_mm3(fills));
        let (mut made, mut tumour) = (Resection::default(), Resected::default());
        for (class, (whole, left_mm3)) in TissueClass::ALL.into_iter().zip(whole.into_iter().zip(left)) {
            let of = Resected { taken_mm3: whole - left_mm3, left_mm3 };
            match class {
                TissueClass::Tumour | TissueClass::SoftTumour => {
                    tumour.taken_mm3 += of.taken_mm3;
                    tumour.left_mm3 += left_mm3;
                }
                _ => made.healthy_mm3 += of.taken_mm3,
            }
            if of.taken_mm3 > 0.0 {
                made.tissues.insert(class.name().into(), of);
            }
        }
        made.tumour_share = tumour.taken_mm3 / (tumour.taken_mm3 + tumour.left_mm3).max(1e-9);
        Some(made)
    }

    /// Name of the tissue solver that runs.
    pub fn solver_name(&self) -> &str {
        self.ran.get().map_or(self.models.setup.tissue.solver, |ran| ran.name)
    }

    /// Ingredients of the models that run.
    pub fn ingredients(&self) -> Ingredients {
        let chosen = self.models.ingredients();
        Ingredients { device: self.ran.get().map_or(chosen.device, |ran| ran.device), ..chosen }
    }

    /// Nodes of the brain that do not move.
    pub fn fixed_nodes(&self) -> usize {
        self.ran.get().map_or(0, |ran| ran.fixed_nodes)
    }

    /// Remarks on the solver, for the report.
    pub fn solver_remarks(&self) -> Vec<String> {
        self.ran.get().map(SolverInfo::remarks).unwrap_or_default()
    }

    /// Creates the stages, with the tool at `start`.
    pub fn stages(
        &self,
        start: ToolState,
        tick_ms: f32,
        (limits, second): (&DeviceLimits, Option<&DeviceLimits>),
    ) -> Result<Stages, SessionError> {
        let (rigid, with) = (self.rigid()?, self.models.ingredients());
        let voxel_mm = self.models.setup.bone.spacing_mm as f32;
        let usual = HapticConfig::usual(self.program);
        let config = |limits: &DeviceLimits| HapticConfig {
            rigid: rigid.with_removal(limits.removal(limits.coupled(BONE, tick_ms).stiffness)),
            force_scale: limits.force_scale().0,
            dt_ms: tick_ms,
            bone_force: with.bone_models().on(limits.coupled(BONE, tick_ms), voxel_mm),
            tissue_force: limits.coupled(TISSUE, tick_ms),
            guard: limits.guard(),
            opening_needed: self.operation.opening_needed,
            force_waits: self.operation.force_waits,
            ..usual.clone()
        };
        let bone = self.bone().cloned();
        let field = self.scene.brain.as_ref().map(|brain| Arc::clone(&brain.field));
        let tissue = self.brain().map(|brain| self.tissue(brain, &rigid, &with, second.is_some())).transpose()?;
        let second = second.map(|limits| SecondHand::new(config(limits), bone.clone(), field.clone()));
        let search = bone.as_ref().map(|bone| self.plan.search(bone));
        let forbidden = self.scene.brain.as_ref().and_then(|brain| brain.distance_to(&self.operation.forbidden));
        let mut haptic = HapticStage::new(config(limits), bone, field, start);
        let planned = !self.plan.outline.is_empty();
        haptic = search.into_iter().fold(haptic, |haptic, search| haptic.with_flap(search, planned));
        haptic = forbidden.map(Arc::new).into_iter().fold(haptic, HapticStage::forbidding);
        Ok(Stages { haptic, second, tissue })
    }

    /// Method of contact with bone.
    fn rigid(&self) -> Result<Method, SessionError> {
        let Bone { method, points, .. } = self.models.setup.bone;
        let unknown = || SessionError::Internal(format!("no method {method} of contact with bone"));
        Ok(methods::bone_contact(method).ok_or_else(unknown)?.with_points(points))
    }

    /// Whether the brain is held by its anchors in a skull: rival solvers have none.
    fn is_anchored(&self) -> bool {
        let is_rival = methods::solver(self.models.setup.tissue.solver).is_some();
        self.bone().is_some() && self.models.ingredients().support == Support::Anchored && !is_rival
    }

    /// What holds the brain, and the loads on it once the dura is open.
    fn held(&self, brain: &RestBrain) -> Result<(BrainSupport, Settling), SessionError> {
        let csf_loss = self.operation.csf_loss.unwrap_or_default();
        let outward = -self.plan.site.inward;
        match self.bone().filter(|_| self.is_anchored()) {
            Some(bone) => {
                let settling = Settling::draining(&brain.mesh, outward, csf_loss, self.operation.csf_speed_up);
                brain.held_in_skull(Arc::clone(bone), &self.plan).map(|held| (held, settling))
            }
            None => {
                let settling = Settling::new(csf_loss, Vec3::NEG_Y, outward);
                brain.held_by_base(self.bone().cloned()).map(|held| (held, settling))
            }
        }
        .map_err(|fault| brain_error(&fault))
    }

    fn tissue(
        &self,
        brain: &RestBrain,
        rigid: &Method,
        with: &Ingredients,
        two_hands: bool,
    ) -> Result<Tissue, SessionError> {
        let (BrainSupport { fixed, anchors, mut wall }, settling) = self.held(brain)?;
        let body = brain.body(with.materials(self.young_mpa), with.pia_arachnoid_n_per_mm, &fixed, &anchors);
        // The graphics card cannot take tissue away yet.
        let resects = self.plan.target.is_some() && self.operation.aspiration_mm_s > 0.0;
        let device = if resects && with.device == SolverDevice::Fastest { SolverDevice::Cpu } else { with.device };
        let with = &Ingredients { device, ..with.clone() };
        let (solver, ran) = solver::build(&body, wall.as_mut(), &self.models.setup.tissue, with)?;
        let _first = self.ran.set(ran);
        let touch = touch(&brain.mesh, with)?;
        let collision = CollisionStage::new(self.program, &brain.mesh, &touch, wall)
            .and_then(|stage| if with.folds { stage.folding(&brain.mesh) } else { Ok(stage) })
            .and_then(|stage| if two_hands { stage.with_second_hand(&brain.mesh, &touch) } else { Ok(stage) })
            .map_err(|fault| brain_error(&fault))?
            .under_pressure(with.surface_pressure_mmhg > 0.0)
            .turning(rigid.descriptor().extent == Extent::BallAndShaft)
            .settling(settling);
        let dura = self.dura().filter(|_| self.operation.dura == Some(true));
        let collision = match self.bone().zip(dura) {
            Some((bone, (dura, _))) => collision.covered(dura, Arc::clone(bone)),
            None => collision,
        };
        let solver = SolverStage::new(solver);
        let rates = self.aspiration_rates(brain, with);
        if rates.is_empty() {
            return Ok(Tissue { collision, solver });
        }
        let collision = collision.aspirating(&brain.mesh, &rates).map_err(|fault| brain_error(&fault))?;
        let collision = collision.cutting(&brain.mesh, &rates);
        let collision = match self.operation.bleeding > 0.0 {
            true => collision.bleeding(&brain.mesh, &perfusion(brain, self.operation.bleeding), -self.plan.site.inward),
            false => collision,
        };
        Ok(Tissue { collision, solver: solver.resectable(rates.len()) })
    }

    /// The dura around the planned opening in a skull, and the radius of the opening, mm.
    fn dura(&self) -> Option<(Dura, f32)> {
        let Plan { site, flap_mm, hole_mm, .. } = self.plan;
        let (_, brain) = self.bone().zip(self.brain())?;
        let radius_mm = flap_mm.max(hole_mm);
        Dura::over(&brain.mesh, site.entry, -site.inward, radius_mm + AROUND_MM).map(|dura| (dura, radius_mm))
    }

    /// Rate at which an aspirator takes each tetrahedron, mm/ms, by its stiffness against that of
    /// brain; empty where none is taken.
    fn aspiration_rates(&self, brain: &RestBrain, with: &Ingredients) -> Vec<f32> {
        let mm_ms = 1e-3 * self.operation.aspiration_mm_s;
        if mm_ms <= 0.0 || self.no_aspiration().is_some() {
            return Vec::new();
        }
        let materials = brain.materials(with.materials(self.young_mpa));
        let usual_mpa = materials[TissueClass::Brain as usize].shear_mpa();
        let rate = |code: &u8| {
            let softer = (usual_mpa / materials[usize::from(code.saturating_sub(1))].shear_mpa()) as f32;
            let is_spared = softer * aspirator::SPARED.f32() <= 1.0;
            if is_spared { 0.0 } else { mm_ms * softer.min(aspirator::FASTEST.f32()) }
        };
        brain.class_of_tet.iter().map(rate).collect()
    }

    /// Why the aspirator takes no tissue with these models; `None` where it does.
    pub fn no_aspiration(&self) -> Option<String> {
        let with = self.models.ingredients();
        let device = self.ran.get().map_or(with.device, |ran| ran.device);
        let remedy = match (methods::solver(self.models.setup.tissue.solver), with.search, device) {
            (Some(_), ..) => "the solver tled",
            (_, search, _) if search != trepan_deformable::Method::RECOMMENDED => "search=walk",
            (.., SolverDevice::Gpu) => "device=cpu",
            _ => return None,
        };
        Some(format!("the aspirator takes no tissue with these models: it needs {remedy}"))
    }
}

/// Contact of tool and tissue; a rival's grid has the cells that are the cheapest for the mesh.
fn touch(mesh: &TetMesh, with: &Ingredients) -> Result<trepan_deformable::Config, SessionError> {
    let cheapest = || Measures::of(mesh).and_then(|measures| CostModel::default().analytic(&measures));
    let is_rival = with.search != trepan_deformable::Method::RECOMMENDED;
    let cell_mm = is_rival.then(cheapest).transpose().map_err(|fault| brain_error(&fault))?;
    Ok(trepan_deformable::Config {
        method: with.search,
        cell_mm: cell_mm.map(|mm| mm as f32),
        friction: with.friction,
        ..trepan_deformable::Config::default()
    })
}

fn brain_error(fault: &dyn std::fmt::Display) -> SessionError {
    SessionError::Internal(format!("the brain: {fault}"))
}

/// Plans the removal of bone; refuses a flap that the skull does not surround.
fn planned(scene: &Scene, operation: &Operation) -> Result<Plan, SessionError> {
    let hole_mm = Program::Craniotomy.tray()[0].tip_radius_mm;
    let target = scene.brain.as_ref().and_then(RestBrain::tumour);
    let target = target.map(|(centre, radius_mm)| Target { centre, radius_mm, sinks_mm: 0.0 });
    let line: Vec<Vec3> = operation.flap_line.iter().copied().map(Vec3::from).collect();
    if let (Some(bone), false) = (&scene.bone, line.is_empty()) {
        let fault = "the line of the flap is not on the skull around the opening; draw it again on the case's page";
        let plan = Plan::drawn(bone, scene.site, hole_mm, &line).ok_or_else(|| SessionError::Usage(fault.into()))?;
        return Ok(plan.with_target(target));
    }
    let plan = Plan::new(scene.bone.as_deref(), scene.site, hole_mm, 0.5 * operation.flap_mm);
    plan.map(|plan| plan.with_target(target)).ok_or_else(|| {
        let fault = format!(
            "--flap {}: the skull does not surround the flap: give a smaller one, or another --opening",
            operation.flap_mm
        );
        SessionError::Usage(fault)
    })
}
