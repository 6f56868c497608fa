//! The haptic loop at 1 kHz beside a solver and a painter: how late, beside a loop that does nothing, in the same run.
//!
//! # Practice
//! Slices of half a second alternate between both loops, so that whatever else the machine does falls on both. The tick is a session's:
//! simulated device, burr on a plane of bone, force model, guard. The solver is TLED with 10 368 tetrahedra in real time; the painter
//! sweeps 16 MB and computes for each pixel, sixty times a second. Counts and times are shown, none is a gate.

use super::Scope;
use crate::suite::Row;
use crate::timer::Samples;
use std::hint::black_box;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::{Duration, Instant};
use thread_priority::{RealtimeThreadSchedulePolicy, ThreadPriority, ThreadSchedulePolicy};
use trepan_contact::{ForceGuard, ForceModel, Viscoelastic};
use trepan_geometry::{Pose, Tool, ToolState, Vec3, units};
use trepan_haptics::HapticDevice;
use trepan_haptics::replay::Replay;
use trepan_haptics::simulated::{Config, Hand, Simulated};
use trepan_rigid::{Method, RigidContact, RigidStep};
use trepan_soft::{Body, Loads, Material, SoftSolver, boxes};
use trepan_tled::Tled;
use trepan_volume::{BoneVolume, VoxelVolume};

const TICK: Duration = Duration::from_millis(1);
/// How long before a deadline sleep turns into spinning.
const SPIN: Duration = Duration::from_micros(120);
const SLICE_TICKS: u32 = 500;

/// What a loop's ticks were like.
#[derive(Default)]
struct Pace {
    ticks: u32,
    late: u32,
    compute_us: Vec<f64>,
    wake_us: Vec<f64>,
}

/// One row for each loop.
pub fn rows(scope: Scope) -> Vec<Row> {
    let slices = scope.pick(6, 120);
    let (over, mut paces) = (AtomicBool::new(false), [Pace::default(), Pace::default()]);
    let (mut real_time, mut factor) = (false, 0.0);
    thread::scope(|scope| {
        let solving = scope.spawn(|| solve(&over));
        scope.spawn(|| paint(&over));
        let looping = scope.spawn(|| {
            let granted = ask_for_real_time();
            let mut bench = Bench::new();
            for _ in 0..slices {
                slice(&mut paces[0], || {});
                slice(&mut paces[1], || bench.tick());
            }
            over.store(true, Ordering::Relaxed);
            granted
        });
        real_time = looping.join().unwrap_or_default();
        over.store(true, Ordering::Relaxed);
        factor = solving.join().unwrap_or(0.0);
    });
    let methods = ["empty loop", "haptic tick"];
    methods.into_iter().zip(paces).map(|(method, pace)| row(method, pace, real_time, factor)).collect()
}

fn row(method: &str, pace: Pace, real_time: bool, factor: f64) -> Row {
    let (compute, wake) = (Samples::from(pace.compute_us), Samples::from(pace.wake_us));
    Row::new("1 kHz beside solver and picture", method)
        .with("real_time_priority", real_time)
        .metric("ticks_count", pace.ticks.into())
        .metric("late_ticks_count", pace.late.into())
        .metric("compute_p50_us", compute.quantile(0.5))
        .metric("compute_p99_us", compute.quantile(0.99))
        .metric("wake_p99_us", wake.quantile(0.99))
        .metric("wake_max_us", wake.quantile(1.0))
        .metric("solver_real_time_factor", factor)
}

/// Half a second of ticks on an absolute grid; a tick that misses its end is late, and what it missed is given up.
fn slice(pace: &mut Pace, mut tick: impl FnMut()) {
    let mut next = Instant::now() + TICK;
    for _ in 0..SLICE_TICKS {
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
        next += TICK;
        if done >= next {
            pace.late += 1;
            next = done + TICK;
        }
    }
}

fn ask_for_real_time() -> bool {
    let policy = ThreadSchedulePolicy::Realtime(RealtimeThreadSchedulePolicy::Fifo);
    let Ok(value) = 80u8.try_into() else { return false };
    let (thread, value) = (thread_priority::thread_native_id(), ThreadPriority::Crossplatform(value));
    thread_priority::set_thread_priority_and_policy(thread, value, policy).is_ok()
}

/// A burr that goes in and out of a plane of bone.
struct Bench {
    device: Simulated,
    bone: BoneVolume,
    rigid: Box<dyn RigidContact>,
    out: RigidStep,
    force: Viscoelastic,
    guard: ForceGuard,
    time_ms: f64,
}

impl Bench {
    fn new() -> Self {
        let n = 64;
        let mut ct = VoxelVolume::isotropic([n; 3], Vec3::splat(-31.5), 1.0, 0i16);
        for at in 0..ct.data.len() {
            let z = -31.5 + (at / (n * n)) as f32;
            ct.data[at] = (400.0 - 800.0 * z).clamp(-1000.0, 1500.0) as i16;
        }
        let hand = |t: u32| ToolState::at(Pose::from_translation(Vec3::Z * (3.0 + (f64::from(t) * 0.01).sin() as f32)));
        let intent = Replay::new((0..100_000).map(hand).collect());
        let device = Simulated::new(Config::default(), Hand::FIRM, Box::new(intent));
        let mut rigid = Method::RECOMMENDED.build(&Tool::burr(3.0));
        rigid.reset(Pose::from_translation(Vec3::Z * 5.0));
        Self {
            guard: ForceGuard::new(device.capabilities().guard_config()),
            device,
            bone: BoneVolume::new(&ct, 400).expect("half of the box is bone"),
            rigid,
            out: RigidStep::default(),
            force: Viscoelastic { stiffness: 2.0, damping: 0.5 },
            time_ms: 0.0,
        }
    }

    fn tick(&mut self) {
        self.time_ms += 1.0;
        let tool = ToolState { time_ms: self.time_ms, ..self.device.read(self.time_ms).tool };
        self.rigid.step(&self.bone, &tool, false, 1.0, &mut self.out);
        let wanted = self.force.wrench(&tool, &self.out.manifold, 1.0);
        self.device.apply(self.guard.guard(wanted, &tool, 1.0));
    }
}

/// Steps a brain in real time; gives simulated over wall time.
fn solve(over: &AtomicBool) -> f64 {
    let mesh = boxes::split_box([12; 3], Vec3::splat(120.0));
    let fixed = boxes::nodes_where(&mesh, |p| p.z < mesh.bounds().min.z + 1e-3);
    let body = Body::uniform(mesh, fixed, Material::BRAIN);
    let mut solver = Tled::new(&body, &trepan_tled::Config::default()).expect("a split box is sound");
    let loads = Loads { gravity: Vec3::NEG_Z * units::GRAVITY_MM_PER_MS2, ..Loads::default() };
    let dt_ms = solver.stable_dt_ms();
    let (start, mut simulated_ms) = (Instant::now(), 0.0);
    while !over.load(Ordering::Relaxed) {
        let wall_ms = start.elapsed().as_secs_f64() * 1e3;
        if simulated_ms > wall_ms {
            thread::sleep(Duration::from_secs_f64((simulated_ms - wall_ms) * 1e-3));
        }
        black_box(solver.step(&loads, dt_ms));
        simulated_ms += f64::from(dt_ms);
    }
    simulated_ms / (start.elapsed().as_secs_f64() * 1e3)
}

/// A picture's work, sixty times a second.
fn paint(over: &AtomicBool) {
    let mut pixels = vec![1.0f32; 4 << 20];
    let mut next = Instant::now();
    while !over.load(Ordering::Relaxed) {
        pixels.iter_mut().for_each(|pixel| *pixel = (*pixel * 1.01).sin());
        black_box(&pixels);
        next += Duration::from_micros(16_667);
        match next.checked_duration_since(Instant::now()) {
            Some(left) => thread::sleep(left),
            None => next = Instant::now(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn late_ticks_are_counted_and_the_bench_feels_bone() {
        let mut pace = Pace::default();
        slice(&mut pace, || thread::sleep(Duration::from_micros(1200)));
        assert_eq!((pace.ticks, pace.late), (SLICE_TICKS, SLICE_TICKS));
        let mut bench = Bench::new();
        let mut felt = 0.0f32;
        (0..2000).for_each(|_| {
            bench.tick();
            felt = felt.max(bench.device.motor_force().length());
        });
        assert!(felt > 0.1, "{felt}");
    }
}
