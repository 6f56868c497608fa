//! Runs the operation along one path by one setup. It gives what the hand felt, what is gone of the
//! bone, where the brain was shown, and what it cost.

use super::surface::{Look, Rays};
use super::{LOOK_MS, OPENING, PLACE_MM, Scope, disc};
use anyhow::{Context, Result};
use clap::Parser;
use cpu_time::ProcessTime;
use std::time::Instant;
use trepan_bone::BoneVolume;
use trepan_contact::SurfacePatch;
use trepan_evidence::memory::held_mb;
use trepan_geometry::{ToolState, Vec3};
use trepan_haptics::script::{Script, Site};
use trepan_haptics::{Reading, Status};
use trepan_mesh::Surface;
use trepan_simulator::{Options, Session, Stages};
use trepan_stages::{Phase, Program, SoftFrame, SolverFaults, TickInput, ToolSample};
use trepan_trials_scenes::case;

/// Radius around the way in within which bone is counted, mm: the hole and its rim.
const BONE_RADIUS_MM: f32 = 8.0;
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
    /// CPU time of haptic, collision and solver loop, of all their threads, s.
    pub cpu_s: [f64; 3],
    /// Time by the wall clock of the same, s.
    pub wall_s: [f64; 3],
    /// Faults of the solver.
    pub faults: SolverFaults,
    /// Solver steps.
    pub steps: u64,
    /// Length of the operation, s.
    pub seconds: f64,
    /// Memory that the session held more than the process before, MB.
    pub memory_mb: f64,
}

impl Ride {
    /// Nodes limited or reset, elements inverted and milliseconds skipped, summed: over 0, the
    /// brain's motion is not the law's.
    pub fn solver_faults(&self) -> f64 {
        let SolverFaults { inverted, limited, non_finite, skipped_ms, .. } = self.faults;
        (inverted + limited + non_finite) as f64 + skipped_ms
    }

    /// Whether the probe came into the hand: only when the bone is open.
    pub fn opened(&self) -> bool {
        self.probing.iter().any(|&probing| probing)
    }
}

/// What is shown at one look.
pub struct LookInput<'a> {
    /// The session, with the bone as it is drilled.
    pub session: &'a Session,
    /// Time of the operation, ms.
    pub ms: u64,
    /// The tool as it is shown.
    pub sample: &'a ToolSample,
    /// Nodes of the brain, mm.
    pub positions: &'a [Vec3],
}

/// A session that is ready to run the operation.
pub struct Prepared {
    session: Session,
    stages: Stages,
    site: Site,
    path: Script,
    milliseconds: u64,
    /// Memory of the process before, MB.
    before_mb: f64,
}

impl Prepared {
    /// Opens the built-in case at [`OPENING`] by a setup's flags. The hand goes along the plan at a
    /// site, else at the session's own.
    pub fn open(scope: Scope, flags: &str, site: Option<Site>) -> Result<Self> {
        let Vec3 { x, y, z } = OPENING;
        Self::at_own_opening(scope, &format!("--opening {x},{y},{z} {flags}"), site)
    }

    /// Opens the built-in case, or the images that the flags name, where the session opens it by
    /// itself.
    pub fn at_own_opening(scope: Scope, flags: &str, site: Option<Site>) -> Result<Self> {
        let before_mb = held_mb();
        let flags = format!("integrated --headless --frames-per-second 0 {flags}");
        let options = Options::try_parse_from(flags.split_whitespace())?;
        let session = Session::open(Program::Integrated, options, case::inputs())?;
        let site = site.unwrap_or(session.scene().site);
        let path = super::path(scope, &site)?;
        let stages = session.stages(path.at(0.0))?;
        Ok(Self { session, stages, site, path, milliseconds: super::milliseconds(scope), before_mb })
    }

    /// What the solver lacks of what was asked.
    pub fn remarks(&self) -> Vec<String> {
        self.session.solver_remarks()
    }

    /// Runs the operation; `watch` sees it every [`LOOK_MS`].
    pub fn run(self, watch: &mut dyn FnMut(&LookInput<'_>)) -> Result<Ride> {
        let Self { session, stages, site, path, milliseconds, before_mb } = self;
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
            wall_s: [0.0; 3],
            faults: SolverFaults::default(),
            steps: 0,
            seconds: milliseconds as f64 * 1e-3,
            memory_mb: 0.0,
        };
        let mut look = |ms: u64, sample: &ToolSample, positions: &[Vec3]| {
            watch(&LookInput { session: &session, ms, sample, positions });
            rays.look(positions)
        };
        run(stages, milliseconds, &path, &mut look, &mut ride);
        ride.removed = was.into_iter().zip(is_bone(skull, &places)).map(|(was, is)| was && !is).collect();
        ride.memory_mb -= before_mb;
        Ok(ride)
    }
}

/// Turns the loops, each as if it kept pace. The memory is that of the whole process.
fn run(
    mut stages: Stages,
    milliseconds: u64,
    path: &Script,
    look: &mut dyn FnMut(u64, &ToolSample, &[Vec3]) -> Look,
    ride: &mut Ride,
) {
    let mut tissue = stages.tissue.take().expect("the program has tissue");
    let (mut frame, mut patch) = (SoftFrame::default(), (0, SurfacePatch::default()));
    let [mut haptic, mut collision, mut solver] = [Spent::default(); 3];
    tissue.solver.publish(&mut frame);
    for ms in 1..=milliseconds {
        let tool = ToolState { time_ms: ms as f64, ..path.at(ms as f64) };
        let reading = Reading { tool, status: Status::Fresh };
        let input = TickInput { tick: ms, reading, patch: &patch.1, patch_seq: patch.0, second: None, second_n: 0.0 };
        let tick = haptic.timed(|| stages.haptic.tick(&input, &mut |_| {}));
        let record = collision.timed(|| tissue.collision.step(&tick.sample, &frame));
        patch = (record.seq, *tissue.collision.patch());
        solver.timed(|| {
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
            ride.looks.push(look(ms, &tick.sample, &frame.positions));
        }
    }
    ride.cpu_s = [haptic.cpu_s, collision.cpu_s, solver.cpu_s];
    ride.wall_s = [haptic.wall_s, collision.wall_s, solver.wall_s];
    ride.memory_mb = held_mb();
    ride.steps = tissue.solver.steps();
    ride.faults = *tissue.solver.solver_faults();
}

/// Time that a loop took, s.
#[derive(Clone, Copy, Default)]
struct Spent {
    cpu_s: f64,
    wall_s: f64,
}

impl Spent {
    fn timed<T>(&mut self, call: impl FnOnce() -> T) -> T {
        let (cpu, wall) = (ProcessTime::now(), Instant::now());
        let done = call();
        self.cpu_s += cpu.elapsed().as_secs_f64();
        self.wall_s += wall.elapsed().as_secs_f64();
        done
    }
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
