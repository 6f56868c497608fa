//! A burr fed at a steady speed, against the closed form of its law: depth, volume, quiet.
//!
//! Whatever the voxels, the way through them and the length of a tick.

mod common;
use common::{at, bone};
use trepan_geometry::{Pose, Tool, Vec3};
use trepan_rigid::removal::{Pressed, RemovalLaw};
use trepan_rigid::{Method, RigidStep};

const FEED_MM_PER_MS: f32 = 1e-3;
const STIFFNESS: f32 = 2.0;
/// Density of the scene's bone over that of the law's reference, as energies.
const PRICE: f32 = 1500.0 / 1600.0;

struct Fed {
    /// Mean depth and its standard deviation in a bore deeper than the burr, mm.
    depth: (f32, f32),
    /// Largest change of the hand's distance from the proxy in a tick, mm.
    change: f32,
    /// Volume over that of the cylinder that the burr went through.
    volume: f32,
}

fn fed(voxel_mm: f32, axis: Vec3, radius: f32, dt_ms: f32) -> Fed {
    let bone = bone([(24.0 / voxel_mm) as usize; 3], voxel_mm, |p| p.dot(axis));
    let mut contact = Method::RECOMMENDED.build(&Tool::burr(radius));
    contact.reset(Pose::from_translation(axis * (radius + 0.2)));
    let (mut out, mut removed, mut depths, mut before) = (RigidStep::default(), 0.0f64, vec![], Vec3::ZERO);
    let (ticks, whole) = ((12_000.0 / dt_ms) as usize, (10_000.0 / dt_ms) as usize);
    let mut change = 0.0f32;
    for tick in 0..ticks {
        let device = axis * (radius + 0.2 - FEED_MM_PER_MS * tick as f32 * dt_ms);
        contact.step(&bone, &at(device), true, dt_ms, &mut out);
        let lifted = contact.proxy().translation - device;
        if tick > whole {
            depths.push(lifted.dot(axis));
            removed += f64::from(out.removed_mm3);
            change = change.max(lifted.distance(before));
        }
        before = lifted;
    }
    let mean = depths.iter().sum::<f32>() / depths.len() as f32;
    let spread = depths.iter().map(|d| (d - mean).powi(2)).sum::<f32>() / depths.len() as f32;
    let gone = FEED_MM_PER_MS * dt_ms * depths.len() as f32 - (depths[depths.len() - 1] - depths[0]);
    let volume = removed as f32 / (std::f32::consts::PI * radius * radius * gone);
    Fed { depth: (mean, spread.sqrt()), change, volume }
}

/// The depth at which the law takes a cylinder of the burr's width at the speed of the feed, mm.
///
/// `cosine` is that between the way and the tool's axis.
fn steady(radius_mm: f32, cosine: f32) -> f32 {
    let wanted = PRICE * std::f32::consts::PI * radius_mm * radius_mm * FEED_MM_PER_MS;
    let (mut low, mut high) = (0.0, 3.0);
    for _ in 0..40 {
        let middle = 0.5 * (low + high);
        let less = RemovalLaw::RATE.volume_mm3(&Pressed { radius_mm, depth_mm: middle, cosine, dt_ms: 1.0 }) < wanted;
        (low, high) = if less { (middle, high) } else { (low, middle) };
    }
    low
}

#[test]
fn a_steady_feed_settles_at_the_depth_of_the_law_without_a_buzz() {
    let oblique = Vec3::new(0.36, 0.48, 0.8);
    let runs = [
        (1.0, oblique, 3.0, 1.0),
        (0.75, oblique, 3.0, 1.0),
        (1.0, oblique, 2.0, 1.0),
        (0.5, oblique, 2.0, 2.0),
        (0.5, oblique, 2.0, 1.0),
        (0.5, oblique, 2.0, 0.25),
        (0.5, Vec3::Z, 2.0, 1.0),
    ];
    for (voxel_mm, axis, radius, dt_ms) in runs {
        let Fed { depth: (depth, spread), change, volume } = fed(voxel_mm, axis, radius, dt_ms);
        let truth = steady(radius, axis.z);
        println!(
            "voxel {voxel_mm} axis {axis} burr {radius} tick {dt_ms}: depth {depth} of {truth} mm, sd {spread}, \
             change {change} mm a tick, volume {volume}"
        );
        assert!((depth - truth).abs() < 0.01 && spread < 0.01, "depth {depth} sd {spread} of {truth}");
        assert!((volume - 1.0).abs() < 0.01, "{volume}");
        // The hand goes by a feed a tick; what is more is buzz.
        assert!(STIFFNESS * change < 0.02, "{change} mm a tick");
    }
}
