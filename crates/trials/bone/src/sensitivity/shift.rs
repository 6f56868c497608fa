//! Shift: a brain of ellipsoidal shape, held in its skull as the program holds one, after the fluid
//! has drained.
//!
//! # Theory
//! The lowest end is fixed, the surface hangs on the layer of arachnoid and fluid, and beside the
//! midline on bridging veins; above the fluid's level tissue has its weight and the layer is gone.
//! Outputs at rest: how far the top of the surface sinks, and how far the centre does.

use super::press::{brain, config, of_brain};
use super::scene::{Input, OUTPUTS, Scene};
use trepan_geometry::{Vec3, units};
use trepan_measurements::support;
use trepan_mesh::{Surface, TetMesh};
use trepan_soft::{Anchor, Body, Loads, SoftSolver, boxes};
use trepan_stages::{Phase, Settling};
use trepan_tled::{Config, Relaxation, Tled};

/// Half the axes of the ellipsoid, mm.
const HALF_MM: Vec3 = Vec3::new(65.0, 80.0, 60.0);
/// Cells along an axis.
const CELLS: usize = 6;
/// Thickness of the layer around the brain, mm.
const LAYER_MM: f64 = 2.0;
/// A time after which the fluid has drained, ms.
const DRAINED_MS: f64 = 1e9;

/// The scene with its constants.
pub fn scene() -> Scene {
    let mut inputs = of_brain();
    inputs.extend([
        Input::of("share of buoyancy that is lost", support::CSF_LOSS),
        Input::of("height of the stem", support::STEM_HEIGHT),
        Input::of("stiffness of the layer around the brain", support::LAYER_MODULUS),
        Input::of("shear of that layer", support::LAYER_SHEAR),
        Input::of("stiffness of bridging veins", support::VEIN_STIFFNESS),
    ]);
    Scene { name: "shift", inputs, outputs: ["sag of the top, mm", "sag of the centre, mm"], run }
}

fn run(values: &[f64]) -> [f64; OUTPUTS] {
    let &[shear, compressibility, density, share, bound, lost, stem, layer, layer_shear, veins] = values else {
        unreachable!()
    };
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
    let floor = HALF_MM.z * (2.0 * stem as f32 - 1.0);
    let fixed = boxes::nodes_where(&mesh, |p| p.z <= floor);
    let start = [top, centre].map(|node| mesh.positions[node].z);
    let mut settling = Settling::draining(&mesh, Vec3::Z, lost as f32, 1.0);
    let anchors = anchors(&mesh, [layer, layer_shear, veins]);
    let body = Body { anchors, ..Body::uniform(mesh, fixed, brain([shear, compressibility, density, share, bound])) };
    let config = Config { mass_scaling: f32::INFINITY, ..config(Relaxation::NONE) };
    let mut solver = Tled::new(&body, &config).expect("the stem is held");
    let mut loads = Loads::default();
    [0.0, DRAINED_MS].into_iter().for_each(|time_ms| settling.load(Phase::Brain, time_ms, &mut loads));
    loads.fluid.opening_mpa = 0.0;
    solver.settle(&loads, &trepan_tled::Settling::default());
    let sunk = |at: usize, node: usize| f64::from(start[at] - solver.positions()[node].z);
    [sunk(0, top), sunk(1, centre)]
}

/// Springs of the surface from the layer's modulus, kPa, shear over it, and that of veins, kPa/mm.
fn anchors(mesh: &TetMesh, [layer, layer_shear, veins]: [f64; 3]) -> Vec<Anchor> {
    let mut areas = vec![Vec3::ZERO; mesh.positions.len()];
    for triangle in Surface::of(mesh).triangles {
        let [a, b, c] = triangle.map(|node| mesh.positions[node as usize]);
        triangle.iter().for_each(|node| areas[*node as usize] += (b - a).cross(c - a) / 6.0);
    }
    let of = |(node, area): (usize, Vec3)| {
        let (normal, mm2) = (area.normalize(), area.length());
        let layer = units::mpa_from_kpa((layer / LAYER_MM) as f32) * mm2;
        let is_by_sinus = mesh.positions[node].x.abs() < support::VEIN_REACH.f32() && normal.z > 0.5;
        let vein = if is_by_sinus { units::mpa_from_kpa(veins as f32) * mm2 } else { 0.0 };
        let across = layer * layer_shear as f32 + vein;
        let in_fluid = layer / (layer + vein);
        Anchor { node: node as u32, normal, along: layer + vein, across, in_fluid, open_mm2: 0.0 }
    };
    areas.into_iter().enumerate().filter(|(_, area)| *area != Vec3::ZERO).map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_softer_brain_with_softer_supports_sinks_in_proportion() {
        let scene = scene();
        let mut values: Vec<f64> = scene.inputs.iter().map(|input| input.value).collect();
        // A small loss: what sinks far stiffens and leaves the fluid.
        values[5] = 0.1;
        let mut softer = values.clone();
        [0, 7, 9].into_iter().for_each(|stiffness| softer[stiffness] *= 0.8);
        let (one, two) = ((scene.run)(&values), (scene.run)(&softer));
        assert!(one[0] > one[1] && one[1] > 0.01, "{one:?}");
        for (a, b) in one.iter().zip(two) {
            // Less than in proportion, by what the law stiffens as it sinks further.
            assert!((0.9..1.01).contains(&(0.8 * b / a)), "{one:?} {two:?}");
        }
    }
}
