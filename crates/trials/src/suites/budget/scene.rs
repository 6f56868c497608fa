//! One random scene: opening, tools, push, view and tolerances.

use super::case::Case;
use trepan_budget::{Machine, Scene};
use trepan_geometry::Vec3;

/// Machine for which choices are priced: enough threads that time never decides, so that accuracy does.
pub const MACHINE: Machine =
    Machine { ns_per_tet_step: 13.0, us_per_rigid_tick: 6.0, ns_per_ray: 450.0, threads: 64, device_draws: false };

/// What is done where.
#[derive(Clone, Debug)]
pub struct Situation {
    /// What the plan is told.
    pub scene: Scene,
    /// Direction of the opening from the middle of the head.
    pub towards: Vec3,
    /// Where the opening is on bone.
    pub bone_site: Vec3,
    /// Way along the surface: turn around the normal, rad.
    pub turn_rad: f32,
    /// How far the tools slide, mm.
    pub slide_mm: f32,
    /// How far the view is tilted off the normal.
    pub tilt: Vec3,
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
        let scene = Scene {
            force_error_n: log(0.03, 0.3),
            displacement_mm: log(0.2, 2.0),
            picture_error_percent: log(1.0, 10.0),
            stiffness: log(0.5, 2.0),
            tool_radius_mm: log(0.5, 4.0),
            press_mm: log(0.2, 2.0),
            finest_mm: case.finest_mm(),
            tissue_motion_mm: log(1.0, 8.0),
            probe_radius_mm: log(2.0, 5.0),
            brain_mm3: case.brain_mm3(),
            material: case.material(),
            picture_pixels: [height * 4 / 3, height],
            view_mm: log(60.0, 300.0),
            pictures_per_s: log(8.0, 30.0),
            ..Scene::default()
        };
        let slide_mm = log(3.0, 8.0) as f32;
        let tilt = 0.6 * direction(random);
        Self { scene, towards, bone_site, turn_rad: random.f32() * core::f32::consts::TAU, slide_mm, tilt }
    }

    /// A unit vector at right angles to a normal, along which tools slide.
    pub fn along(&self, normal: Vec3) -> Vec3 {
        let (a, b) = normal.any_orthonormal_pair();
        self.turn_rad.cos() * a + self.turn_rad.sin() * b
    }
}

fn direction(random: &mut fastrand::Rng) -> Vec3 {
    let (z, turn) = (2.0 * random.f32() - 1.0, random.f32() * core::f32::consts::TAU);
    let ring = (1.0 - z * z).sqrt();
    Vec3::new(ring * turn.cos(), ring * turn.sin(), z)
}
