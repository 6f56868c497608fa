//! Runs the scripted operation (drill, open, press the brain) along a fixed path of the hand.
//!
//! The suites `operation` and `ablation` share it.
//!
//! # Theory
//! The hand goes the same way in every run: poses and buttons of the script, tick by tick at 1 kHz;
//! forces do not move it. Each run turns the bodies of the loops as if every loop kept pace: a
//! tick, a collision step, solver steps up to the tick's time. So two runs differ by their models
//! alone, and one setup gives the same forces, bit for bit, in every run.

mod distance;
mod ride;
pub mod surface;

pub use distance::surfaces;
pub use ride::{LookInput, Prepared, Ride};

use anyhow::Result;
use trepan_evidence::part::Scope;
use trepan_geometry::Vec3;
use trepan_haptics::script::{self, Script, Site};
use trepan_stages::Program;

/// Over the place that is opened, RAS mm: the same in every run.
pub const OPENING: Vec3 = Vec3::new(108.0, 8.0, 84.0);
/// Time between two looks at the brain, ms.
pub const LOOK_MS: u64 = 250;
/// Radius around the way in within which the brain is looked at, mm: the hole.
pub const LOOK_RADIUS_MM: f32 = 5.0;
/// Distance of two rays, and of two places where bone is looked for, mm.
pub const PLACE_MM: f32 = 0.5;
/// A force under this is no contact, N.
pub const FELT_N: f32 = 0.02;

/// Length of the operation, ms.
pub fn milliseconds(scope: Scope) -> u64 {
    scope.pick(6_000, 20_000)
}

/// The hand's poses: the planned script at a site.
pub fn path(scope: Scope, site: &Site) -> Result<Script> {
    Ok(Script::planned(Program::Integrated.script(), site, milliseconds(scope) as f64, &script::Plan::default())?)
}

/// The largest; not a number where one is none.
pub fn worst(all: impl IntoIterator<Item = f64>) -> f64 {
    all.into_iter().fold(0.0, |most, e| if e.is_nan() || most.is_nan() { f64::NAN } else { most.max(e) })
}

/// Two directions across the way in.
fn across(site: &Site) -> [Vec3; 2] {
    let right = site.inward.any_orthonormal_vector();
    [right, site.inward.cross(right)]
}

/// Points of a disc across the way in, from its middle.
fn disc(site: &Site, radius_mm: f32) -> impl Iterator<Item = Vec3> {
    let ([right, up], count) = (across(site), (radius_mm / PLACE_MM) as i32);
    let square = (-count..=count).flat_map(move |i| (-count..=count).map(move |j| (i, j)));
    let round = square.filter(move |(i, j)| i * i + j * j <= count * count);
    round.map(move |(i, j)| PLACE_MM * (i as f32 * right + j as f32 * up))
}

#[cfg(test)]
pub(crate) mod tests {
    use super::surface::Look;
    use super::*;
    use trepan_stages::SolverFaults;

    /// A run of a second: bone for half of it, then the probe on a plane that dips.
    pub fn hand_made(newtons: f32, depth_mm: f32, dip_mm: f32, gone: usize) -> Ride {
        let ticks = 4 * LOOK_MS as usize;
        let look = |dip_mm: f32| {
            let at = |x: f32, y: f32| Vec3::new(x, y, -depth_mm - dip_mm);
            Look {
                seen: vec![at(0.0, 0.0), at(1.0, 1.0)],
                triangles: vec![[at(-9.0, -9.0), at(20.0, -9.0), at(-9.0, 20.0)]],
            }
        };
        Ride {
            setup: String::new(),
            site: Site { entry: Vec3::ZERO, inward: Vec3::NEG_Z, bone_mm: 6.0, brain_mm: 8.0 },
            forces: vec![Vec3::X * newtons; ticks],
            lifted: vec![Vec3::ZERO; ticks],
            probing: (0..ticks).map(|tick| tick >= ticks / 2).collect(),
            on_bone: (0..ticks).map(|tick| tick < ticks / 2).collect(),
            looks: [0.0, 0.0, dip_mm, dip_mm].map(look).into(),
            from_mask_mm: vec![0.25],
            removed: (0..100).map(|place| place < gone).collect(),
            cpu_s: [0.0; 3],
            wall_s: [0.0; 3],
            faults: SolverFaults::default(),
            steps: 0,
            seconds: 1.0,
            memory_mb: 0.0,
        }
    }
}
