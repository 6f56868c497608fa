//! Timing of the haptic loop at 1 and 4 kHz while a solver and a renderer run. An idle loop in the
//! same run is the comparison.
//!
//! # Practice
//! Slices of half a second alternate between both loops, so that other load on the machine
//! affects both. The tick is a session's: simulated device, burr on a plane of bone, force model,
//! guard. The solver is TLED with 10 368 tetrahedra in real time. The picture shows the same bone
//! and the solver's newest nodes, 640 x 400, at most 60 times per second, on the GPU if there is
//! one, else on the CPU. Counts and times are reported without gates.

use super::Scope;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::{Duration, Instant};
use thread_priority::{RealtimeThreadSchedulePolicy, ThreadPriority, ThreadSchedulePolicy};
use trepan_bone::BoneVolume;
use trepan_contact::{ForceGuard, ForceModel, Viscoelastic};
use trepan_evidence::suite::Row;
use trepan_evidence::timer::Samples;
use trepan_geometry::{Pose, Tool, ToolState, Vec3, units};
use trepan_gpu::Prefer;
use trepan_haptics::HapticDevice;
use trepan_haptics::replay::Replay;
use trepan_haptics::simulated::{Config, HandModel, Simulated};
use trepan_link::cell::{Reader, Writer, cell};
use trepan_mesh::TetMesh;
use trepan_render::{Camera, Frame, Painter, SceneData};
use trepan_rigid::{Method, RigidContact, RigidStep};
use trepan_soft::{Body, Loads, Material, SoftSolver, boxes};
use trepan_tled::Tled;
use trepan_volume::VoxelVolume;

/// Ticks per second.
const RATES_HZ: [u32; 2] = [1000, 4000];
/// Time before a deadline at which sleeping turns into spinning.
const SPIN: Duration = Duration::from_micros(120);
/// Slices per second.
const SLICES_HZ: u32 = 2;
/// Shortest interval between pictures.
const PICTURE: Duration = Duration::from_micros(16_667);
/// Picture size, px.
const SIZE: [u32; 2] = [640, 400];

/// Timing of a loop's ticks.
#[derive(Default)]
struct Pace {
    ticks: u32,
    late: u32,
    compute_us: Vec<f64>,
    wake_us: Vec<f64>,
}

/// Work done in parallel to the loops.
struct Beside {
    solver_factor: f64,
    pictures: f64,
    by: &'static str,
}

/// One row for each loop and rate.
pub fn rows(scope: Scope) -> Vec<Row> {
    RATES_HZ.into_iter().flat_map(|rate_hz| at_rate(rate_hz, scope)).collect()
}

fn at_rate(rate_hz: u32, scope: Scope) -> Vec<Row> {
    let slices = scope.pick(3, if rate_hz == RATES_HZ[0] { 120 } else { 20 });
    let (over, mut paces) = (AtomicBool::new(false), [Pace::default(), Pace::default()]);
    let (mesh, mut bench) = (boxes::split_box([12; 3], Vec3::splat(120.0)), Bench::new(rate_hz));
    let bone = bench.bone.clone();
    let (nodes, seen) = cell(mesh.positions.clone());
    let (mut real_time, mut beside) = (false, Beside { solver_factor: 0.0, pictures: 0.0, by: "nothing" });
    thread::scope(|scope| {
        let solving = scope.spawn(|| solve(&mesh, nodes, &over));
        let painting = scope.spawn(|| paint(bone, &mesh, seen, &over));
        let looping = scope.spawn(|| {
            let granted = ask_for_real_time();
            for _ in 0..slices {
                slice(&mut paces[0], rate_hz, || {});
                slice(&mut paces[1], rate_hz, || bench.tick());
            }
            granted
        });
        real_time = looping.join().unwrap_or_default();
        over.store(true, Ordering::Relaxed);
        beside.solver_factor = solving.join().unwrap_or(0.0);
        (beside.pictures, beside.by) = painting.join().unwrap_or((0.0, "nothing"));
    });
    let methods = ["empty loop", "haptic tick"];
    methods.into_iter().zip(paces).map(|(method, pace)| row(rate_hz, method, pace, real_time, &beside)).collect()
}

fn row(rate_hz: u32, method: &str, pace: Pace, real_time: bool, beside: &Beside) -> Row {
    let (compute, wake) = (Samples::from(pace.compute_us), Samples::from(pace.wake_us));
    Row::new(format!("{} kHz beside solver and picture", rate_hz / 1000), method)
        .with("real_time_priority", real_time)
        .with("picture_by", beside.by)
        .metric("ticks_count", pace.ticks.into())
        .metric("late_ticks_count", pace.late.into())
        .metric("compute_p50_us", compute.quantile(0.5))
        .metric("compute_p99_us", compute.quantile(0.99))
        .metric("wake_p99_us", wake.quantile(0.99))
        .metric("wake_max_us", wake.quantile(1.0))
        .metric("solver_real_time_factor", beside.solver_factor)
        .metric("pictures_count", beside.pictures)
}

/// Runs ticks for half a second on an absolute grid; a tick that misses its deadline is late, and
/// missed ticks are skipped.
fn slice(pace: &mut Pace, rate_hz: u32, mut tick: impl FnMut()) {
    let length = Duration::from_secs(1) / rate_hz;
    let mut next = Instant::now() + length;
    for _ in 0..rate_hz / SLICES_HZ {
        let left = next.saturating_duration_since(Instant::now());
        thread::sleep(left.saturating_sub(SPIN));
        while Instant::now() < next {
            std::hint::spin_loop();
        }
        let began = Instant::now();
        tick();
        let done = Instant::now();
        pace.ticks += 1;
        pace.compute_us.push((done - began).as_secs_f64() * 1e6);
        pace.wake_us.push((began - next).as_secs_f64() * 1e6);
        next += length;
        if done >= next {
            pace.late += 1;
            next = done + length;
        }
    }
}

fn ask_for_real_time() -> bool {
    let policy = ThreadSchedulePolicy::Realtime(RealtimeThreadSchedulePolicy::Fifo);
    let Ok(value) = 80u8.try_into() else { return false };
    let (thread, value) = (thread_priority::thread_native_id(), ThreadPriority::Crossplatform(value));
    thread_priority::set_thread_priority_and_policy(thread, value, policy).is_ok()
}

/// Burr that moves in and out of a plane of bone.
struct Bench {
    device: Simulated,
    bone: Arc<BoneVolume>,
    rigid: Box<dyn RigidContact>,
    out: RigidStep,
    force: Viscoelastic,
    guard: ForceGuard,
    time_ms: f64,
    dt_ms: f32,
}

impl Bench {
    fn new(rate_hz: u32) -> Self {
        let n = 64;
        let mut ct = VoxelVolume::isotropic([n; 3], Vec3::splat(-31.5), 1.0, 0i16);
        for at in 0..ct.data.len() {
            let z = -31.5 + (at / (n * n)) as f32;
            ct.data[at] = (400.0 - 800.0 * z).clamp(-1000.0, 1500.0) as i16;
        }
        // One recorded state per read: the hand is equally fast at every rate.
        let dt_ms = 1e3 / rate_hz as f32;
        let turn = 0.01 * f64::from(dt_ms);
        let hand = |t: u32| ToolState::at(Pose::from_translation(Vec3::Z * (3.0 + (f64::from(t) * turn).sin() as f32)));
        let intent = Replay::new((0..100_000).map(hand).collect());
        let device = Simulated::new(Config::default(), HandModel::FIRM, Box::new(intent));
        let device_wall = device.capabilities().coupled(Viscoelastic { stiffness: 2.0, damping: 0.5 }, dt_ms);
        let mut rigid = Method::RECOMMENDED.build(&Tool::burr(3.0));
        rigid.reset(Pose::from_translation(Vec3::Z * 5.0));
        Self {
            guard: ForceGuard::new(device.capabilities().guard_config()),
            device,
            bone: Arc::new(BoneVolume::new(&ct, 400).expect("half of the box is bone")),
            rigid,
            out: RigidStep::default(),
            force: device_wall,
            time_ms: 0.0,
            dt_ms,
        }
    }

    fn tick(&mut self) {
        self.time_ms += f64::from(self.dt_ms);
        let tool = ToolState { time_ms: self.time_ms, ..self.device.read(self.time_ms).tool };
        self.rigid.step(&self.bone, &tool, false, self.dt_ms, &mut self.out);
        let wanted = self.force.wrench(&tool, &self.out.manifold, self.dt_ms);
        self.device.apply(self.guard.guard(wanted, &tool, self.dt_ms));
    }
}

/// Steps a brain in real time and publishes its nodes 60 times per second; returns simulated over
/// wall time.
fn solve(mesh: &TetMesh, mut nodes: Writer<Vec<Vec3>>, over: &AtomicBool) -> f64 {
    let fixed = boxes::nodes_where(mesh, |p| p.z < mesh.bounds().min.z + 1e-3);
    let body = Body::uniform(mesh.clone(), fixed, Material::BRAIN);
    let mut solver = Tled::new(&body, &trepan_tled::Config::default()).expect("a split box is sound");
    let loads = Loads { gravity: Vec3::NEG_Z * units::GRAVITY_MM_PER_MS2, ..Loads::default() };
    let dt_ms = solver.stable_dt_ms();
    let (start, mut simulated_ms, mut told_ms) = (Instant::now(), 0.0, 0.0);
    while !over.load(Ordering::Relaxed) {
        let wall_ms = start.elapsed().as_secs_f64() * 1e3;
        if simulated_ms > wall_ms {
            thread::sleep(Duration::from_secs_f64((simulated_ms - wall_ms) * 1e-3));
        }
        solver.step(&loads, dt_ms);
        simulated_ms += f64::from(dt_ms);
        if simulated_ms - told_ms > 1e3 * PICTURE.as_secs_f64() {
            told_ms = simulated_ms;
            nodes.write(|newest| newest.copy_from_slice(solver.positions()));
        }
    }
    simulated_ms / (start.elapsed().as_secs_f64() * 1e3)
}

/// Draws the bone and the newest nodes; returns the number of pictures and the renderer.
fn paint(
    bone: Arc<BoneVolume>,
    mesh: &TetMesh,
    mut nodes: Reader<Vec<Vec3>>,
    over: &AtomicBool,
) -> (f64, &'static str) {
    let data = SceneData { bone: Some(bone), brain: Some(mesh), mri: None, tint: None, cortex: None };
    let mut painter = Painter::open(Prefer::Hardware, &data, SIZE).expect("the scene loads");
    let camera = Camera::viewed_from(mesh.bounds().centre(), Vec3::new(0.5, -1.0, 0.7), 250.0);
    let (mut next, mut pictures) = (Instant::now(), 0.0);
    while !over.load(Ordering::Relaxed) {
        let frame = Frame { brain_positions: Some(nodes.latest().0), ..Frame::of(camera) };
        painter.picture(&frame).expect("the picture is drawn");
        pictures += 1.0;
        next += PICTURE;
        match next.checked_duration_since(Instant::now()) {
            Some(left) => thread::sleep(left),
            None => next = Instant::now(),
        }
    }
    (pictures, if painter.renderer().is_some() { "device" } else { "processor" })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn late_ticks_are_counted_and_the_bench_touches_bone() {
        let mut pace = Pace::default();
        slice(&mut pace, 1000, || thread::sleep(Duration::from_micros(1200)));
        assert_eq!((pace.ticks, pace.late), (500, 500));
        let mut bench = Bench::new(1000);
        let mut felt = 0.0f32;
        (0..2000).for_each(|_| {
            bench.tick();
            felt = felt.max(bench.device.motor_force().length());
        });
        assert!(felt > 0.1, "{felt}");
    }
}
