//! One random scene: opening, tools, push, view and tolerances.

use super::case::Case;
use std::sync::Arc;
use trepan_budget::{Machine, Scene};
use trepan_geometry::Vec3;
use trepan_models::measure::Sight;
use trepan_models::measure::bone::Slide;
use trepan_models::measure::picture::View;

/// Places that the eye goes to.
pub const EYES: usize = 3;
/// How far the eye moves off where it was, as a share of its distance: up to 15 degrees.
const MOVED: f32 = 0.25;

/// Machine of which a scene's is a multiple in speed; with enough threads that time never decides.
pub const MACHINE: Machine = Machine {
    ns_per_tet_step: 13.0,
    us_per_rigid_tick: 6.0,
    ns_per_ray: 450.0,
    threads: 64,
    solver_threads: None,
    device_draws: false,
};

/// Threads that a scene's machine may have, and how many times slower than [`MACHINE`] it may be.
const THREADS: [u32; 5] = [1, 2, 4, 8, 16];
const SLOWER: [f64; 2] = [0.5, 8.0];

/// What is done where.
#[derive(Clone, Debug)]
pub struct Situation {
    /// What the plan is told.
    pub scene: Scene,
    /// Machine that it plans for.
    pub machine: Machine,
    /// Direction of the opening from the middle of the head.
    pub towards: Vec3,
    /// Where the opening is on bone.
    pub bone_site: Vec3,
    /// Way along the surface: turn around the normal, rad.
    pub turn_rad: f32,
    /// How far the tools slide, mm.
    pub slide_mm: f32,
    /// Direction from there to the eye when the session starts.
    pub eye: Vec3,
    /// Directions to it later, which the plan is not told.
    pub eyes_later: [Vec3; EYES],
}

impl Situation {
    /// Draws one.
    pub fn draw(case: &Case, random: &mut fastrand::Rng) -> Self {
        let (towards, bone_site) = loop {
            let towards = direction(random);
            // The upper skull, away from the face and from where a scan is cut off.
            if let Some(site) = case.outer_bone(towards).filter(|_| towards.z > 0.3 && towards.z < 0.95) {
                break (towards, site);
            }
        };
        let mut log = |low: f64, high: f64| low * (high / low).powf(random.f64());
        let height = log(300.0, 600.0) as u32;
        let (tool_radius_mm, probe_radius_mm) = (log(0.5, 4.0), log(2.0, 5.0));
        let scene = Scene {
            force_error_n: log(0.06, 0.6),
            displacement_mm: log(0.2, 2.0),
            picture_error_percent: log(1.0, 10.0),
            stiffness: log(0.5, 2.0),
            tool_radius_mm,
            press_mm: log(0.2, tool_radius_mm.min(2.0)),
            finest_mm: case.finest_mm(),
            tissue_motion_mm: probe_radius_mm * log(0.3, 1.0),
            probe_radius_mm,
            brain_mm3: case.brain_mm3(),
            material: case.brain.material,
            picture_pixels: [height * 4 / 3, height],
            view_mm: log(60.0, 300.0),
            pictures_per_s: log(8.0, 30.0),
            ..Scene::default()
        };
        let slide_mm = log(3.0, 8.0) as f32;
        let eye = (towards + 0.6 * direction(random)).normalize();
        let aside = direction(random);
        let turned = |n: usize| glam::Quat::from_axis_angle(eye, core::f32::consts::TAU * n as f32 / EYES as f32);
        let eyes_later = core::array::from_fn(|n| eye + MOVED * (turned(n) * aside));
        let turn_rad = random.f32() * core::f32::consts::TAU;
        let times = SLOWER[0] * (SLOWER[1] / SLOWER[0]).powf(random.f64());
        let machine = Machine {
            ns_per_tet_step: times * MACHINE.ns_per_tet_step,
            us_per_rigid_tick: times * MACHINE.us_per_rigid_tick,
            ns_per_ray: times * MACHINE.ns_per_ray,
            threads: THREADS[random.usize(..THREADS.len())],
            ..MACHINE
        };
        Self { scene, machine, towards, bone_site, turn_rad, slide_mm, eye, eyes_later }
    }

    /// The burr's way over the bone.
    pub fn slide(&self) -> Slide {
        let Self { scene, bone_site: place, towards: outward, turn_rad, slide_mm: length_mm, .. } = *self;
        Slide { scene, place, outward, turn_rad, length_mm }
    }

    /// The probe's way over the brain.
    pub fn push(&self, case: &Case) -> Slide {
        Slide { place: case.outer_brain(self.towards), ..self.slide() }
    }

    /// What is seen later.
    pub fn views(&self, case: &Case) -> [View; EYES] {
        let view = |eye| View { bone: Arc::clone(&case.bone), scene: self.scene, target: self.bone_site, eye };
        self.eyes_later.map(view)
    }

    /// What a session could look at before it starts.
    pub fn sight(&self, case: &Case) -> Sight {
        let (skull, bone) = (case.skull.clone(), Arc::clone(&case.bone));
        let brain = Some((case.brain.clone(), case.outer_brain(self.towards)));
        Sight { skull: Some((skull, bone)), entry: self.bone_site, outward: self.towards, eye: self.eye, brain }
    }
}

fn direction(random: &mut fastrand::Rng) -> Vec3 {
    let (z, turn) = (2.0 * random.f32() - 1.0, random.f32() * core::f32::consts::TAU);
    let ring = (1.0 - z * z).sqrt();
    Vec3::new(ring * turn.cos(), ring * turn.sin(), z)
}
