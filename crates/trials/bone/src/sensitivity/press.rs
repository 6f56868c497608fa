//! Press: a hand pushes a probe 5 mm into a block of brain and holds it.
//!
//! # Theory
//! The hand's spring and damper act on the surface nodes under the tip, as the collision step gives
//! them to the solver. The block stands on a fixed base; it is coarse, which changes all forces
//! alike.

use super::scene::{Input, OUTPUTS, Scene};
use trepan_contact::NodalContact;
use trepan_geometry::Vec3;
use trepan_measurements::{brain_living, brain_membranes, fits, hands, sensitivity};
use trepan_mesh::Surface;
use trepan_patient::TissueClass;
use trepan_soft::{Body, Loads, Material, Membrane, SoftSolver, boxes};
use trepan_stages::{HapticConfig, Program};
use trepan_tled::{Config, Relaxation, Tled};

/// Megapascals in a kilopascal.
const MPA_PER_KPA: f32 = 1e-3;
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
/// The scene with its constants.
pub fn scene() -> Scene {
    let relaxed = 1.0 - Relaxation::SOLID_AND_FLUID.share.iter().map(|share| f64::from(*share)).sum::<f64>();
    let mut inputs = of_brain();
    inputs.extend([
        Input::of("stress at hand speed over that of a slow test", fits::HAND_SPEED_FACTOR),
        Input { value: relaxed, ..Input::of("share of stress that stays", sensitivity::RELAXED_SHARE) },
        Input::of("times of relaxation", sensitivity::RELAXATION_TIMES),
        Input::of("spring of the hand on tissue", hands::TISSUE_STIFFNESS),
        Input::of("stiffness of the pia-arachnoid", brain_membranes::PIA_SHEAR_STIFFNESS),
    ]);
    Scene { name: "press", inputs, outputs: ["greatest force, N", "force after 1 s, N"], run }
}

/// Constants of brain: those that [`brain`] takes.
pub fn of_brain() -> Vec<Input> {
    let usual = TissueClass::Brain.stiffening(MPA_PER_KPA * brain_living::YOUNG_MODULUS.f32());
    vec![
        Input { value: usual.shear_mpa(), ..Input::of("shear modulus", sensitivity::SHEAR_MODULUS) },
        Input { value: 0.5 - f64::from(usual.poisson()), ..Input::of("compressibility", sensitivity::COMPRESSIBILITY) },
        Input { value: usual.density_g_mm3().into(), ..Input::of("density", sensitivity::DENSITY) },
        Input::of("share that does not stiffen", fits::BRAIN_SHARE),
        Input::of("strain of stiffening", fits::BRAIN_BOUND),
    ]
}

/// Brain without a region, by the law of `--quality auto`: shear modulus, MPa, compressibility
/// `0.5 - ν`, density, g/mm³, and the two constants of stiffening.
pub fn brain([shear, compressibility, density, share, bound]: [f64; 5]) -> Material {
    Material::Stiffening {
        shear_mpa: shear as f32,
        share: share as f32,
        bound: bound as f32,
        poisson: 0.5 - compressibility as f32,
        density_g_mm3: density as f32,
    }
}

/// Settings of the solver as `--quality auto` runs it.
pub fn config(relaxation: Relaxation) -> Config {
    Config {
        mass_scaling: 0.01,
        dynamic_mass_scaling: 16.0,
        selective_mass_scaling: true,
        averaged_pressure: true,
        relaxation,
        ..Config::default()
    }
}

fn run(values: &[f64]) -> [f64; OUTPUTS] {
    let &[shear, compressibility, density, share, bound, at_speed, relaxed, times, spring, pia] = values else {
        unreachable!()
    };
    let usual = Relaxation::SOLID_AND_FLUID;
    let kept: f32 = usual.share.iter().sum();
    let relaxation = Relaxation {
        share: usual.share.map(|share| share * (1.0 - relaxed as f32) / kept),
        time_ms: usual.time_ms.map(|ms| ms * times as f32),
    };
    let mesh = boxes::centred_box([CELLS; 3], Vec3::splat(EDGE_MM));
    let fixed = boxes::nodes_where(&mesh, |p| p.z < 1e-3);
    let middle = Vec3::new(0.5, 0.5, 1.0) * EDGE_MM;
    let pressed = boxes::nodes_where(&mesh, |p| p.distance(middle) < TIP_MM && p.z > EDGE_MM - 1e-3);
    let top = |t: &[u32; 3]| t.iter().all(|&n| mesh.positions[n as usize].z > EDGE_MM - 1e-3);
    let triangles = Surface::of(&mesh).triangles.into_iter().filter(top).collect();
    let material = brain([at_speed * shear, compressibility, density, share, bound]);
    let membrane = Membrane { triangles, shear_n_per_mm: pia as f32 };
    let body = Body { membrane, ..Body::uniform(mesh, fixed, material) };
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
        let goes = time_ms < GO_MS;
        contact.offset_mm = PRESS_MM * (time_ms / GO_MS).min(1.0) - EDGE_MM;
        contact.tool_normal_velocity = if goes { -PRESS_MM / GO_MS } else { 0.0 };
        loads.contacts = contact.into();
        force = solver.step(&loads, dt_ms).contact_n;
        greatest = greatest.max(force);
        time_ms += dt_ms;
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
        (twice[0], twice[8], twice[9]) = (2.0 * values[0], 2.0 * values[8], 2.0 * values[9]);
        let (one, two) = ((scene.run)(&values), (scene.run)(&twice));
        assert!(one[0] > one[1] && one[1] > 0.01, "{one:?}");
        for (a, b) in one.iter().zip(two) {
            assert!((b / a / 2.0 - 1.0).abs() < 0.05, "{one:?} {two:?}");
        }
    }
}
