//! Shift: a brain of ellipsoidal shape, held below, sinks as fluid is lost.
//!
//! # Theory
//! The share of the fluid's buoyancy that is lost acts as a body force. Outputs: how far the top of
//! the surface sinks at rest, and how far the centre does.

use super::press::{brain, config};
use super::scene::{Input, OUTPUTS, Scene};
use trepan_geometry::{Vec3, units};
use trepan_measurements::{brain, sensitivity};
use trepan_mesh::Surface;
use trepan_simulator::TissueClass;
use trepan_soft::{Body, Loads, SoftSolver, boxes};
use trepan_tled::{Config, Relaxation, Settling, Tled};

/// Half the axes of the ellipsoid, mm.
const HALF_MM: Vec3 = Vec3::new(65.0, 80.0, 60.0);
/// Cells along an axis.
const CELLS: usize = 6;

/// The scene with its constants.
pub fn scene() -> Scene {
    let material = TissueClass::Brain.material(0.003);
    let compressible = 0.5 - f64::from(material.poisson());
    let inputs = vec![
        Input { value: material.shear_mpa(), ..Input::of("shear modulus", sensitivity::SHEAR_MODULUS) },
        Input { value: compressible, ..Input::of("compressibility", sensitivity::COMPRESSIBILITY) },
        Input { value: material.density_g_mm3().into(), ..Input::of("density", brain::DENSITY) },
        Input::of("share of buoyancy that is lost", sensitivity::CSF_LOSS),
        Input::of("share of the height that is held", sensitivity::SUPPORTED_SHARE),
    ];
    Scene { name: "shift", inputs, outputs: ["sag of the top, mm", "sag of the centre, mm"], run }
}

fn run(values: &[f64]) -> [f64; OUTPUTS] {
    let &[shear_mpa, compressibility, density, lost, held] = values else { unreachable!() };
    let mut mesh = boxes::centred_box([CELLS; 3], Vec3::splat(2.0));
    for p in &mut mesh.positions {
        let from = *p - 1.0;
        *p = HALF_MM * from * (from.abs().max_element() / from.length().max(1e-9));
    }
    let nearest = |place: Vec3| {
        let away = |node: &usize| mesh.positions[*node].distance(place);
        (0..mesh.positions.len()).min_by(|a, b| away(a).total_cmp(&away(b))).expect("a mesh has nodes")
    };
    let (top, centre) = (nearest(HALF_MM * Vec3::Z), nearest(Vec3::ZERO));
    let floor = HALF_MM.z * (2.0 * held as f32 - 1.0);
    let mut fixed: Vec<u32> = Surface::of(&mesh).triangles.into_iter().flatten().collect();
    fixed.retain(|node| mesh.positions[*node as usize].z <= floor);
    let start = [top, centre].map(|node| mesh.positions[node].z);
    let body = Body::uniform(mesh, fixed, brain(shear_mpa, compressibility, density));
    let config = Config { mass_scaling: f32::INFINITY, ..config(Relaxation::NONE) };
    let mut solver = Tled::new(&body, &config).expect("the base is held");
    let gravity = lost as f32 * units::GRAVITY_MM_PER_MS2 * Vec3::NEG_Z;
    solver.settle(&Loads { gravity, ..Loads::default() }, &Settling { tolerance_mm: 0.01, steps: 2000 });
    let sunk = |at: usize, node: usize| f64::from(start[at] - solver.positions()[node].z);
    [sunk(0, top), sunk(1, centre)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sag_is_in_proportion_to_the_load_over_the_stiffness() {
        let scene = scene();
        let values: Vec<f64> = scene.inputs.iter().map(|input| input.value).collect();
        let mut other = values.clone();
        (other[0], other[3]) = (0.5 * values[0], 0.5 * values[3]);
        let (one, two) = ((scene.run)(&values), (scene.run)(&other));
        assert!(one[0] > one[1] && one[1] > 0.05, "{one:?}");
        for (a, b) in one.iter().zip(two) {
            assert!((b / a - 1.0).abs() < 0.02, "{one:?} {two:?}");
        }
    }
}
