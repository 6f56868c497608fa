//! Drill: a burr goes through a vault of three layers, once under a steady load, once at a steady
//! feed.
//!
//! # Theory
//! Outputs: the time until it comes through under the load, at most a minute, and the mean force at
//! the feed once the ball is in the bone, to a millimetre before the far side. A hand that would
//! need more than people give counts as giving that. Newtons are those of the task; contact and
//! removal are those of the default method.

use super::scene::{Input, OUTPUTS, Scene};
use trepan_bone::BoneVolume;
use trepan_geometry::{Pose, Tool, ToolState, Vec3};
use trepan_measurements::{drilling, hands, sensitivity, skull};
use trepan_rigid::god_object_sphere::{Config, GodObjectSphere};
use trepan_rigid::removal::{Cutter, RemovalLaw};
use trepan_rigid::spindle::Spindle;
use trepan_rigid::{RigidContact, RigidStep};
use trepan_volume::VoxelVolume;

/// Radius of the burr, mm.
const BURR_MM: f32 = 3.0;
/// Edge of a voxel, mm.
const VOXEL_MM: f32 = 0.75;
/// Voxels across the slab, and through it with the air on both sides.
const DIMS: [usize; 3] = [13, 13, 30];
/// Height of the highest voxel over the outer surface, mm.
const ABOVE_MM: f32 = 3.0;
/// Share of the thickness that each table has.
const TABLE: f32 = 0.25;
/// Bone begins here, HU.
const ISOVALUE: i16 = 400;
/// A tick, ms: the law of removal does not depend on it.
const TICK_MS: f32 = 16.0;
/// Time after which a burr counts as not coming through, ms.
const LONGEST_MS: f32 = 60_000.0;
/// The steady feed, mm/ms.
const FEED_MM_PER_MS: f32 = 0.25e-3;

/// The scene with its constants.
pub fn scene() -> Scene {
    let inputs = vec![
        Input::of("energy of thick chips", drilling::BURR_ENERGY),
        Input::of("bluntness of the edges", drilling::BURR_EDGE),
        Input::of("length of edge", drilling::BURR_EDGES),
        Input::of("cutting ratio", drilling::BURR_CUTTING_RATIO),
        Input::of("speed without load", drilling::BURR_SPEED),
        Input::of("power of the drill", drilling::BURR_POWER),
        Input::of("energy of cancellous bone", skull::CUTTING_SHARE_OF_CANCELLOUS),
        Input::of("load of the hand", hands::DRILLING_FORCE),
        Input::of("thickness of the vault", skull::THICKNESS_PARIETAL),
        Input::of("density of the tables", skull::DENSITY_TEMPORAL_CORTEX),
        Input::of("density of the diploe", sensitivity::DIPLOE_DENSITY),
    ];
    Scene { name: "drill", inputs, outputs: ["time through, s", "force at 0.25 mm/s, N"], run }
}

/// The default law with other constants.
fn law([energy, edge_um, edges, ratio, speed, power, cancellous]: [f64; 7]) -> RemovalLaw {
    let RemovalLaw::Rate { cutter, perforator, stiffness, max_load_n, .. } = RemovalLaw::RATE else { unreachable!() };
    let slower = speed as f32 / cutter.spindle.free_rpm;
    let spindle =
        Spindle { free_rpm: speed as f32, power_w: power as f32, stall_rpm: slower * cutter.spindle.stall_rpm };
    let cutter = Cutter {
        spindle,
        cutting_ratio: ratio as f32,
        chip_energy_mpa: energy as f32,
        edge_mm: 1e-3 * edge_um as f32,
        edges: edges as f32,
        ..cutter
    };
    RemovalLaw::Rate { cutter, perforator, cancellous_share: cancellous as f32, stiffness, max_load_n }
}

fn run(values: &[f64]) -> [f64; OUTPUTS] {
    let &[energy, edge, edges, ratio, speed, power, cancellous, load, thickness, tables, diploe] = values else {
        unreachable!()
    };
    let removal = law([energy, edge, edges, ratio, speed, power, cancellous]);
    let RemovalLaw::Rate { stiffness, max_load_n, .. } = removal else { unreachable!() };
    let vault = || vault(thickness as f32, [tables as f32, diploe as f32]);
    let (thickness, lag) = (thickness as f32, load as f32 / stiffness);
    let mut time_ms = 0.0;
    drill(&vault(), removal, |proxy, step| {
        time_ms += TICK_MS;
        (!step.broke_through && time_ms < LONGEST_MS).then_some(proxy.z - lag)
    });
    let (mut fed, mut force, mut ticks) = (0.2, 0.0, 0.0);
    drill(&vault(), removal, |proxy, _| {
        let (tip, now) = (proxy.z - BURR_MM, stiffness * (proxy.z - BURR_MM - fed));
        if tip < -BURR_MM.min(0.5 * thickness) {
            force += f64::from(now);
            ticks += 1.0;
        }
        fed -= FEED_MM_PER_MS * TICK_MS;
        if now > max_load_n {
            (force, ticks) = (max_load_n.into(), 1.0);
        }
        (tip > 1.0 - thickness && now <= max_load_n).then_some(BURR_MM + fed)
    });
    [f64::from(time_ms) * 1e-3, force / f64::max(ticks, 1.0)]
}

/// Drills down with the hand at the height that `hand` returns, until it returns none.
fn drill(bone: &BoneVolume, removal: RemovalLaw, mut hand: impl FnMut(Vec3, &RigidStep) -> Option<f32>) {
    let mut burr = GodObjectSphere::new(&Tool::burr(BURR_MM), Config { removal, ..Config::RECOMMENDED });
    let start = Pose::from_translation((BURR_MM + 0.2) * Vec3::Z);
    burr.reset(start);
    let mut step = RigidStep::default();
    while let Some(height) = hand(burr.proxy().translation, &step) {
        let tool = ToolState::at(Pose::from_translation(height * Vec3::Z));
        burr.step(bone, &tool, true, TICK_MS, &mut step);
    }
}

/// Bone below z = 0 of a thickness, mm: table, diploe, table, of these densities.
fn vault(thickness: f32, [tables, diploe]: [f32; 2]) -> BoneVolume {
    let half = 0.5 * VOXEL_MM * (DIMS[0] as f32 - 1.0);
    let origin = Vec3::new(-half, -half, ABOVE_MM - VOXEL_MM * (DIMS[2] as f32 - 1.0));
    let mut ct = VoxelVolume::isotropic(DIMS, origin, VOXEL_MM, 0i16);
    for at in 0..ct.data.len() {
        let z = origin.z + VOXEL_MM * (at / (DIMS[0] * DIMS[1])) as f32;
        let in_table = (z.min(0.0) + thickness).min(-z) < TABLE * thickness;
        let full = if in_table { tables } else { diploe };
        // Partial volume: linear over one voxel around either surface.
        let inside = (-z).min(z + thickness) / VOXEL_MM;
        ct.data[at] = (f32::from(ISOVALUE) + 1000.0 * inside).min(full).max(-1000.0) as i16;
    }
    BoneVolume::new(&ct, ISOVALUE).expect("the vault has bone")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn time_rises_with_energy_and_falls_with_load() {
        let scene = scene();
        let values: Vec<f64> = scene.inputs.iter().map(|input| input.value).collect();
        let with = |input: usize, factor: f64| {
            let mut values = values.clone();
            values[input] *= factor;
            (scene.run)(&values)
        };
        let (usual, harder, heavier) = (with(0, 1.1), with(0, 1.21), with(7, 1.1));
        assert!(usual[0] > 1.0 && usual[0] < 40.0 && usual[1] > 0.0, "{usual:?}");
        assert!(harder[0] > 1.1 * usual[0] && harder[1] > 1.05 * usual[1], "{usual:?} {harder:?}");
        assert!(heavier[0] < with(0, 1.0)[0], "{heavier:?}");
    }
}
