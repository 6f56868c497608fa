//! The built-in case, made ready once for all scenes.

use anyhow::Result;
use std::sync::Arc;
use trepan_bone::BoneVolume;
use trepan_patient::{Cache, Inputs, Plan, Recipe, Scene, TissueSource, open_case};
use trepan_stages::Program;
use trepan_volume::{DistanceField, VoxelVolume};

/// The built-in case's files.
pub fn inputs() -> Inputs {
    let case = trepan_fixtures::case_head();
    let tissues = TissueSource::regions_of_aseg(case.aseg);
    Inputs {
        name: Some(case.name),
        ct: Some(case.ct),
        mri: Some(case.mri),
        labels: Some(case.labels),
        tissues,
        ..Inputs::default()
    }
}

/// How it is imported: a skull of 1 mm.
pub fn recipe() -> Recipe {
    Recipe { spacing_mm: 1.0, tets: 12_000, ..Recipe::default() }
}

/// An operating table whose skull can be had whole again.
pub struct CaseFixture {
    /// What is planned: the burr hole.
    pub plan: Plan,
    /// The same with a flap.
    pub flap: Plan,
    skull: VoxelVolume<i16>,
    isovalue: i16,
    brain: Arc<DistanceField>,
}

impl CaseFixture {
    /// Imports the built-in case.
    pub fn new() -> Result<Self> {
        let case = open_case(Program::Integrated, &inputs(), &recipe(), &Cache::of_user()?)?;
        let scene = Scene::new(Program::Integrated, case)?;
        let lacks = || anyhow::anyhow!("the built-in case lacks skull or brain");
        let bone = scene.bone.ok_or_else(lacks)?;
        let brain = scene.brain.ok_or_else(lacks)?.field;
        let hole_mm = Program::Craniotomy.tray()[0].tip_radius_mm;
        let plan = |flap_mm| Plan::new(Some(&bone), scene.site, hole_mm, flap_mm).ok_or_else(lacks);
        Ok(Self { plan: plan(0.0)?, flap: plan(12.0)?, skull: bone.snapshot(), isovalue: bone.isovalue(), brain })
    }

    /// The skull as it was, and the brain.
    pub fn fresh(&self) -> (Arc<BoneVolume>, Arc<DistanceField>) {
        let bone = BoneVolume::new(&self.skull, self.isovalue).expect("it was loaded once");
        (Arc::new(bone), Arc::clone(&self.brain))
    }
}
