//! Runs the operation along one path by one setup. It gives what the hand felt, what is gone of the
//! bone, where the brain was shown, and what it cost.

use super::Scope;
use super::bone;
use super::setups::{self, Candidate};
use crate::suites::simulators::case;
use anyhow::{Context, Result};
use clap::Parser;
use cpu_time::ThreadTime;
use trepan_contact::SurfacePatch;
use trepan_geometry::{ToolState, Vec3};
use trepan_haptics::script::{Script, Site};
use trepan_haptics::{Reading, Status};
use trepan_mesh::Surface;
use trepan_simulator::{Options, Phase, Program, Session, SoftFrame, Stages, TickInput};
use trepan_volume::BoneVolume;

/// Time between two looks at the brain, ms.
pub const LOOK_MS: u64 = 250;
/// Radius around the way in within which the brain is looked at, and bone is counted, mm: the hole
/// and its rim.
const LOOK_RADIUS_MM: f32 = 5.0;
const BONE_RADIUS_MM: f32 = 8.0;
/// Distance of two rays, and of two places where bone is looked for, mm.
pub const PLACE_MM: f32 = 0.5;
/// Above and below the entry, mm, in which it is.
const ABOVE_MM: f32 = 4.0;
const BELOW_MM: f32 = 10.0;

/// What one run came to.
pub struct Ride {
    /// What ran, in words.
    pub setup: String,
    /// Where the path of the hand is planned.
    pub site: Site,
    /// Felt at each tick, N.
    pub forces: Vec<Vec3>,
    /// From the device to where bone holds the tool, at each tick, mm.
    pub lifted: Vec<Vec3>,
    /// Whether the probe was in the hand at each tick.
    pub probing: Vec<bool>,
    /// Whether the tool touched bone at each tick; the probe may touch the rim of the hole.
    pub on_bone: Vec<bool>,
    /// The brain's surface, every [`LOOK_MS`].
    pub looks: Vec<Look>,
    /// From what is seen of the brain at rest to the surface of its mask, mm.
    pub from_mask_mm: Vec<f32>,
    /// Whether bone is gone, at places around the entry.
    pub removed: Vec<bool>,
    /// CPU time of haptic, collision and solver loop, s.
    pub cpu_s: [f64; 3],
    /// Solver steps.
    pub steps: u64,
    /// Length of the operation, s.
    pub seconds: f64,
    /// Memory that the session held more than the process before, MB.
    pub memory_mb: f64,
}

/// The brain's surface at one time.
pub struct Look {
    /// Where rays along the way in meet it first, mm.
    pub seen: Vec<Vec3>,
    /// Its triangles near there.
    pub triangles: Vec<[Vec3; 3]>,
}

impl Ride {
    /// Whether the probe came into the hand: only when the bone is open.
    pub fn opened(&self) -> bool {
        self.probing.iter().any(|&probing| probing)
    }
}

/// The finest run, along its own plan.
pub fn truth(scope: Scope) -> Result<Ride> {
    ride(scope, &setups::truth(scope), None)
}

/// A run along the plan of the finest one, or along its own.
pub fn ride(scope: Scope, candidate: &Candidate, truth: Option<&Ride>) -> Result<Ride> {
    let before_mb = memory_mb();
    let Vec3 { x, y, z } = bone::OPENING;
    let flags = format!("integrated --headless --frames-per-second 0 --opening {x},{y},{z} {}", candidate.flags);
    let options = Options::try_parse_from(flags.split_whitespace())?;
    let session = Session::open(Program::Integrated, options, case::inputs())?;
    let site = truth.map_or(session.scene().site, |truth| truth.site);
    let milliseconds = bone::milliseconds(scope);
    let path = bone::path(scope, &site)?;
    let stages = session.stages(path.at(0.0))?;
    let skull = session.scene().bone.as_ref().context("the built-in case has a skull")?;
    let brain = session.scene().brain.as_ref().context("the built-in case has a brain")?;
    let (places, was) = (places(&site), is_bone(skull, &places(&site)));
    let rays = Rays::new(&brain.mesh.positions, &Surface::of(&brain.mesh).triangles, site);
    let at_rest = rays.look(&brain.mesh.positions);
    let mut ride = Ride {
        setup: session.models().setup.to_string(),
        site,
        forces: Vec::new(),
        lifted: Vec::new(),
        probing: Vec::new(),
        on_bone: Vec::new(),
        looks: Vec::new(),
        from_mask_mm: at_rest.seen.iter().map(|seen| brain.field.sample(*seen).abs()).collect(),
        removed: Vec::new(),
        cpu_s: [0.0; 3],
        steps: 0,
        seconds: milliseconds as f64 * 1e-3,
        memory_mb: 0.0,
    };
    run(stages, milliseconds, &path, &rays, &mut ride);
    ride.removed = was.into_iter().zip(is_bone(skull, &places)).map(|(was, is)| was && !is).collect();
    ride.memory_mb = memory_mb() - before_mb;
    Ok(ride)
}

/// Turns the loops, each as if it kept pace.
fn run(mut stages: Stages, milliseconds: u64, path: &Script, rays: &Rays, ride: &mut Ride) {
    let mut tissue = stages.tissue.take().expect("the program has tissue");
    let (mut frame, mut patch) = (SoftFrame::default(), (0, SurfacePatch::default()));
    tissue.solver.publish(&mut frame);
    for ms in 1..=milliseconds {
        let tool = ToolState { time_ms: ms as f64, ..path.at(ms as f64) };
        let reading = Reading { tool, status: Status::Fresh };
        let input = TickInput { tick: ms, reading, patch: &patch.1, patch_seq: patch.0, second: None };
        let tick = timed(&mut ride.cpu_s[0], || stages.haptic.tick(&input, &mut |_| {}));
        let record = timed(&mut ride.cpu_s[1], || tissue.collision.step(&tick.sample, &frame));
        patch = (record.seq, *tissue.collision.patch());
        timed(&mut ride.cpu_s[2], || {
            while tissue.solver.time_ms() < ms as f64 {
                tissue.solver.step(tissue.collision.loads(), record.seq);
            }
        });
        tissue.solver.publish(&mut frame);
        ride.forces.push(tick.wrench.force());
        let touches = tick.record.depth_mm > 0.0;
        ride.lifted.push(if touches { tick.record.depth_mm * tick.record.contact_normal } else { Vec3::ZERO });
        ride.probing.push(tick.sample.phase() == Phase::Brain);
        ride.on_bone.push(touches);
        if ms % LOOK_MS == 0 {
            ride.looks.push(rays.look(&frame.positions));
        }
    }
    ride.steps = tissue.solver.steps();
}

fn timed<T>(seconds: &mut f64, call: impl FnOnce() -> T) -> T {
    let began = ThreadTime::now();
    let done = call();
    *seconds += began.elapsed().as_secs_f64();
    done
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

/// Places around the entry, a cylinder along the way in.
fn places(site: &Site) -> Vec<Vec3> {
    let levels = ((ABOVE_MM + BELOW_MM) / PLACE_MM) as i32;
    let level = |k: i32| site.entry + (PLACE_MM * k as f32 - ABOVE_MM) * site.inward;
    disc(site, BONE_RADIUS_MM).flat_map(|aside| (0..levels).map(move |k| level(k) + aside)).collect()
}

/// Whether there is bone at some places, by trilinear interpolation.
fn is_bone(bone: &BoneVolume, places: &[Vec3]) -> Vec<bool> {
    let at = |place: &Vec3| {
        let at = bone.grid_of(*place);
        let (low, t) = (at.floor().as_ivec3(), at - at.floor());
        let hu = |i, j, k| f32::from(bone.hu(low + glam::IVec3::new(i, j, k)));
        let mix = |a: f32, b: f32, t: f32| a + t * (b - a);
        let line = |j, k| mix(hu(0, j, k), hu(1, j, k), t.x);
        let plane = |k| mix(line(0, k), line(1, k), t.y);
        mix(plane(0), plane(1), t.z) >= f32::from(bone.isovalue())
    };
    places.iter().map(at).collect()
}

/// Looks along the way in at the brain's surface.
struct Rays {
    /// Origin of each, over the entry.
    origins: Vec<Vec3>,
    inward: Vec3,
    /// Triangles near the way in.
    triangles: Vec<[u32; 3]>,
}

/// Where rays begin, mm over the entry.
const OVER_MM: f32 = 30.0;
/// A triangle is near the way in when a corner is within this, mm: more than an edge and what the
/// brain moves.
const NEAR_MM: f32 = 25.0;

impl Rays {
    fn new(positions: &[Vec3], triangles: &[[u32; 3]], site: Site) -> Self {
        let near = |node: &u32| {
            let from = positions[*node as usize] - site.entry;
            let along = from.dot(site.inward);
            (from - along * site.inward).length() < NEAR_MM && (-OVER_MM..OVER_MM).contains(&along)
        };
        Self {
            origins: disc(&site, LOOK_RADIUS_MM).map(|aside| site.entry - OVER_MM * site.inward + aside).collect(),
            inward: site.inward,
            triangles: triangles.iter().filter(|corners| corners.iter().any(near)).copied().collect(),
        }
    }

    fn look(&self, positions: &[Vec3]) -> Look {
        let triangles: Vec<[Vec3; 3]> = self.triangles.iter().map(|t| t.map(|node| positions[node as usize])).collect();
        let first = |origin: &Vec3| {
            let hits = triangles.iter().filter_map(|corners| hit(*origin, self.inward, corners));
            hits.reduce(f32::min).map(|along| *origin + along * self.inward)
        };
        let seen = self.origins.iter().filter_map(first).collect();
        Look { seen, triangles }
    }
}

/// Where a ray meets a triangle, mm along it (Möller and Trumbore 1997).
fn hit(origin: Vec3, along: Vec3, [a, b, c]: &[Vec3; 3]) -> Option<f32> {
    let (ab, ac) = (b - a, c - a);
    let p = along.cross(ac);
    let det = ab.dot(p);
    if det.abs() < 1e-9 {
        return None;
    }
    let from = origin - a;
    let (u, q) = (from.dot(p) / det, from.cross(ab));
    let v = along.dot(q) / det;
    (u >= 0.0 && v >= 0.0 && u + v <= 1.0).then_some(ac.dot(q) / det)
}

/// Memory that this process holds, MB.
fn memory_mb() -> f64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find(|line| line.starts_with("VmRSS:"));
    let kb = line.and_then(|line| line.split_whitespace().nth(1)?.parse::<f64>().ok());
    kb.map_or(f64::NAN, |kb| kb * 1e-3)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ray_meets_a_triangle_where_it_lies() {
        let triangle = [Vec3::new(0.0, 0.0, -2.0), Vec3::new(4.0, 0.0, -2.0), Vec3::new(0.0, 4.0, 2.0)];
        assert_eq!(hit(Vec3::new(1.0, 1.0, 10.0), Vec3::NEG_Z, &triangle), Some(11.0));
        assert_eq!(hit(Vec3::new(3.0, 3.0, 10.0), Vec3::NEG_Z, &triangle), None);
    }

    #[test]
    fn a_plane_is_seen_where_it_lies() {
        let site = Site { entry: Vec3::ZERO, inward: Vec3::NEG_Z, bone_mm: 6.0, brain_mm: 8.0 };
        let square = [(-15.0, -15.0), (15.0, -15.0), (15.0, 15.0), (-15.0, 15.0)].map(|(x, y)| Vec3::new(x, y, -8.5));
        let look = Rays::new(&square, &[[0, 1, 2], [0, 2, 3]], site).look(&square);
        assert!(look.seen.len() > 300 && look.seen.iter().all(|seen| (seen.z + 8.5).abs() < 1e-4));
        assert!(look.seen.iter().all(|seen| seen.truncate().length() < LOOK_RADIUS_MM + 1e-3));
    }
}
