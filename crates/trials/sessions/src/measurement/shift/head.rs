//! The built-in head at rest, step by step through states of equilibrium.
//!
//! # Theory
//! Over minutes tissue is at rest under its loads at every moment, with the stress that relaxation
//! has left by then. After a time t the share `Σ g_i (1 - e^(-t/τ_i))` of the stress has relaxed; a
//! solver whose whole relaxation is that share comes to rest under the same moduli whatever the
//! law. What a load of changing size does before t counts as if it had acted for t.
//!
//! # Practice
//! Contact with the skull is found anew in each round; a state takes some
//! ten evaluations of the forces.

use anyhow::{Context, Result};
use glam::Vec3;
use std::sync::Arc;
use trepan_bone::BoneVolume;
use trepan_budget::Quality;
use trepan_contact::NodalContacts;
use trepan_models::Ingredients;
use trepan_patient::{Cache, Plan, RestBrain, Scene, TissueClass, open_case};
use trepan_soft::{Body, Loads, SoftSolver};
use trepan_stages::{Program, SkullWall};
use trepan_tled::{Config, Relaxation, Settling, Tled};
use trepan_trials_scenes::case;

/// Radius of the opening, mm: the flap of the scripted operation.
const OPENING_MM: f32 = 12.0;
/// Young's modulus of the brain, MPa: the programs' default.
const BRAIN_MPA: f32 = 0.003;
/// Rounds of finding the skull anew, and the end of each.
const ROUNDS: usize = 2;
const REST: Settling = Settling { tolerance_mm: 0.02, steps: 300 };
/// Time constant of the terms, ms: at rest they are over.
const QUICK_MS: f32 = 1.0;

/// Brain, skull and opening of the built-in case.
pub struct Head {
    /// The brain.
    pub brain: RestBrain,
    /// The opening.
    pub plan: Plan,
    bone: Arc<BoneVolume>,
    wall: SkullWall,
}

impl Head {
    /// Opens the built-in case.
    pub fn new() -> Result<Self> {
        let case = open_case(Program::Integrated, &case::inputs(), &case::recipe(), &Cache::of_user()?)?;
        let scene = Scene::new(Program::Integrated, case)?;
        let (bone, brain) = (scene.bone.context("no skull")?, scene.brain.context("no brain")?);
        let hole_mm = Program::Craniotomy.tray()[0].tip_radius_mm;
        let plan = Plan::new(Some(&bone), scene.site, hole_mm, OPENING_MM).context("no room for the opening")?;
        let wall = SkullWall::new(Arc::clone(&bone), &brain.mesh, &brain.fixed)?;
        Ok(Self { brain, plan, bone, wall })
    }

    /// The unit vector out of the opening, which points up.
    pub fn up(&self) -> Vec3 {
        -self.plan.site.inward
    }

    /// Distance from a place to the skull at rest, mm.
    pub fn gap_mm(&self, place: Vec3) -> f32 {
        self.wall.gap_mm(place)
    }

    /// The brain at rest as the programs hold it, after a time of relaxation, minutes.
    pub fn at_rest(&self) -> Result<Still> {
        let with = Ingredients::of(Quality::Auto);
        let held = self.brain.held_in_skull(Arc::clone(&self.bone), &self.plan)?;
        let body = self.brain.body(with.materials(BRAIN_MPA), with.pia_arachnoid_n_per_mm, &held.fixed, &held.anchors);
        Ok(Still {
            wall: held.wall,
            solver: solver(&body, with.relaxation(), 0.0)?,
            relaxation: with.relaxation(),
            body,
            loads: Loads::default(),
        })
    }
}

/// A brain at rest.
pub struct Still {
    /// Loads on it, without those of the skull.
    pub loads: Loads,
    /// What is simulated.
    pub body: Body,
    solver: Tled,
    relaxation: Relaxation,
    wall: Option<SkullWall>,
}

impl Still {
    /// Brings the brain to rest under its loads, with what relaxes in some minutes gone.
    pub fn rest(&mut self, minutes: f64) -> Result<()> {
        let before = self.solver.positions().to_vec();
        self.solver = solver(&self.body, self.relaxation, minutes)?;
        for (node, at) in (0u32..).zip(&before) {
            self.solver.set_node(node, *at - self.body.mesh.positions[node as usize], Vec3::ZERO);
        }
        for _ in 0..ROUNDS {
            let contacts = self.with_skull();
            let loads = Loads { contacts, ..self.loads.clone() };
            self.solver.settle(&loads, &REST);
        }
        Ok(())
    }

    /// The contacts with those of the skull, but not under an opening.
    fn with_skull(&mut self) -> NodalContacts {
        let mut skull = NodalContacts::none();
        self.wall.iter_mut().for_each(|wall| wall.press(self.solver.positions(), false, &mut skull));
        let mut all = self.loads.contacts.clone();
        let is_bared = |node: u32| self.body.anchors.iter().any(|anchor| anchor.node == node && anchor.open_mm2 > 0.0);
        skull.planes().iter().filter(|plane| !is_bared(plane.node)).for_each(|plane| all.push_plane(*plane));
        all
    }

    /// Displacement of a node from rest, mm.
    pub fn moved(&self, node: usize) -> Vec3 {
        self.solver.positions()[node] - self.body.mesh.positions[node]
    }

    /// Present position of a node, mm.
    pub fn place(&self, node: usize) -> Vec3 {
        self.solver.positions()[node]
    }

    /// The nodes of the cortex in the opening, with their areas, mm².
    pub fn bared(&self) -> Vec<(usize, f32)> {
        let open = self.body.anchors.iter().filter(|anchor| anchor.open_mm2 > 0.0);
        open.map(|anchor| (anchor.node as usize, anchor.open_mm2)).collect()
    }

    /// Mean displacement of the cortex in the opening, mm.
    pub fn cortex_moved(&self) -> Vec3 {
        let bared = self.bared();
        bared.iter().map(|(node, _)| self.moved(*node)).sum::<Vec3>() / bared.len().max(1) as f32
    }

    /// The nodes within a distance of a place at rest, mm.
    pub fn around(&self, place: Vec3, radius_mm: f32) -> Vec<usize> {
        let positions = &self.body.mesh.positions;
        let near: Vec<usize> = (0..positions.len()).filter(|n| positions[*n].distance(place) < radius_mm).collect();
        let nearest = |a: &usize, b: &usize| {
            positions[*a].distance_squared(place).total_cmp(&positions[*b].distance_squared(place))
        };
        if near.is_empty() { (0..positions.len()).min_by(nearest).into_iter().collect() } else { near }
    }

    /// Whether a node lies in tissue alone, not at the fluid of a ventricle.
    pub fn is_tissue(&self, node: usize) -> bool {
        let is_fluid = |material: &u8| *material == TissueClass::Ventricle as u8;
        let pairs = self.body.mesh.tets.iter().zip(&self.body.material_of_tet);
        !pairs.filter(|(_, material)| is_fluid(material)).any(|(tet, _)| tet.contains(&(node as u32)))
    }

    /// Mean displacement of the nodes around a place at rest, mm.
    pub fn moved_around(&self, place: Vec3, radius_mm: f32) -> Vec3 {
        let near = self.around(place, radius_mm);
        near.iter().map(|node| self.moved(*node)).sum::<Vec3>() / near.len().max(1) as f32
    }
}

fn solver(body: &Body, relaxation: Relaxation, minutes: f64) -> Result<Tled> {
    let Relaxation { share, time_ms } = relaxation;
    let relaxed = |(share, time_ms): (&f32, &f32)| share * (1.0 - (-60e3 * minutes / f64::from(*time_ms)).exp()) as f32;
    let relaxed: f32 = share.iter().zip(&time_ms).map(relaxed).sum();
    let relaxation = Relaxation {
        share: std::array::from_fn(|term| if term == 0 { relaxed } else { 0.0 }),
        time_ms: std::array::from_fn(|_| QUICK_MS),
    };
    let config = Config { averaged_pressure: true, mass_scaling: f32::INFINITY, relaxation, ..Config::default() };
    Ok(Tled::new(body, &config)?)
}
