//! Press: a hand pushes a probe 5 mm into a block of brain and holds it.
//!
//! # Theory
//! The hand's spring and damper act on the surface nodes under the tip, as the collision step gives
//! them to the solver. The block stands on a fixed base; it is coarse, which changes all forces
//! alike.

use super::scene::{Input, OUTPUTS, Scene};
use trepan_contact::NodalContact;
use trepan_geometry::Vec3;
use trepan_measurements::{brain, sensitivity};
use trepan_simulator::{HapticConfig, Program, TissueClass};
use trepan_soft::{Body, Loads, Material, SoftSolver, boxes};
use trepan_tled::{Config, Relaxation, Tled};

/// Edge of the block, mm.
const EDGE_MM: f32 = 30.0;
/// Cells along an edge.
const CELLS: usize = 4;
/// Radius of the footprint, mm.
const TIP_MM: f32 = 8.0;
/// How far the hand goes, mm.
const PRESS_MM: f32 = 5.0;
/// Time in which it goes there, ms.
const GO_MS: f32 = 250.0;
/// Time at which the last force is taken, ms.
const END_MS: f32 = 1000.0;
/// Young's modulus of brain by default, MPa.
const YOUNG_MPA: f32 = 0.003;

/// The scene with its constants.
pub fn scene() -> Scene {
    let material = TissueClass::Brain.material(YOUNG_MPA);
    let compressible = 0.5 - f64::from(material.poisson());
    let relaxed = 1.0 - Relaxation::BRAIN.share.iter().map(|share| f64::from(*share)).sum::<f64>();
    let spring = HapticConfig::usual(Program::Brain).tissue_force.stiffness;
    let inputs = vec![
        Input { value: material.shear_mpa(), ..Input::of("shear modulus", sensitivity::SHEAR_MODULUS) },
        Input { value: compressible, ..Input::of("compressibility", sensitivity::COMPRESSIBILITY) },
        Input { value: material.density_g_mm3().into(), ..Input::of("density", brain::DENSITY) },
        Input { value: relaxed, ..Input::of("share of stress that stays", sensitivity::RELAXED_SHARE) },
        Input::of("times of relaxation", sensitivity::RELAXATION_TIMES),
        Input { value: spring.into(), ..Input::of("spring of the hand on tissue", sensitivity::TISSUE_COUPLING) },
    ];
    Scene { name: "press", inputs, outputs: ["greatest force, N", "force after 1 s, N"], run }
}

/// Brain of a shear modulus, MPa, a compressibility `0.5 - ν` and a density, g/mm³.
pub fn brain(shear_mpa: f64, compressibility: f64, density: f64) -> Material {
    let (poisson, density_g_mm3, shear_mpa) = (0.5 - compressibility as f32, density as f32, shear_mpa as f32);
    match TissueClass::Brain.material(YOUNG_MPA) {
        Material::Stiffening { share, bound, .. } => {
            Material::Stiffening { shear_mpa, share, bound, poisson, density_g_mm3 }
        }
        _ => Material::NeoHookean { young_mpa: 2.0 * shear_mpa * (1.0 + poisson), poisson, density_g_mm3 },
    }
}

/// Settings of the solver as `--quality auto` runs it.
pub fn config(relaxation: Relaxation) -> Config {
    Config { mass_scaling: 0.01, dynamic_mass_scaling: 16.0, averaged_pressure: true, relaxation, ..Config::default() }
}

fn run(values: &[f64]) -> [f64; OUTPUTS] {
    let &[shear_mpa, compressibility, density, relaxed, times, spring] = values else { unreachable!() };
    let usual = Relaxation::BRAIN;
    let kept: f32 = usual.share.iter().sum();
    let relaxation = Relaxation {
        share: usual.share.map(|share| share * (1.0 - relaxed as f32) / kept),
        time_ms: usual.time_ms.map(|ms| ms * times as f32),
    };
    let mesh = boxes::centred_box([CELLS; 3], Vec3::splat(EDGE_MM));
    let fixed = boxes::nodes_where(&mesh, |p| p.z < 1e-3);
    let middle = Vec3::new(0.5, 0.5, 1.0) * EDGE_MM;
    let pressed = boxes::nodes_where(&mesh, |p| p.distance(middle) < TIP_MM && p.z > EDGE_MM - 1e-3);
    let body = Body::uniform(mesh, fixed, brain(shear_mpa, compressibility, density));
    let mut solver = Tled::new(&body, &config(relaxation)).expect("a block on its base is held");
    let mut contact = NodalContact::none();
    pressed.iter().for_each(|node| contact.add(*node, 1.0));
    contact.normalise();
    let damping = HapticConfig::usual(Program::Brain).tissue_force.damping;
    (contact.normal, contact.stiffness, contact.damping) = (Vec3::Z, spring as f32, damping);
    let (mut loads, mut time_ms) = (Loads::default(), 0.0f32);
    let (mut force, mut greatest) = (0.0, 0.0f32);
    while time_ms < END_MS {
        let dt_ms = solver.next_dt_ms();
        time_ms += dt_ms;
        let goes = time_ms < GO_MS;
        contact.offset_mm = PRESS_MM * (time_ms / GO_MS).min(1.0) - EDGE_MM;
        contact.tool_normal_velocity = if goes { -PRESS_MM / GO_MS } else { 0.0 };
        loads.contacts = contact.into();
        force = solver.step(&loads, dt_ms).contact_n;
        greatest = greatest.max(force);
    }
    [greatest, force].map(f64::from)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn twice_the_stiffness_of_tissue_and_hand_is_twice_the_force() {
        let scene = scene();
        let values: Vec<f64> = scene.inputs.iter().map(|input| input.value).collect();
        let mut twice = values.clone();
        (twice[0], twice[5]) = (2.0 * values[0], 2.0 * values[5]);
        let (one, two) = ((scene.run)(&values), (scene.run)(&twice));
        assert!(one[0] > one[1] && one[1] > 0.01, "{one:?}");
        for (a, b) in one.iter().zip(two) {
            assert!((b / a / 2.0 - 1.0).abs() < 0.05, "{one:?} {two:?}");
        }
    }
}
