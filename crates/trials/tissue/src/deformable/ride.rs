//! A tool taken along a path by one method, and what the truth says about every step.

use super::{finite, scene::RADIUS_MM, scene::Scene, truth::Truth};
use trepan_contact::Viscoelastic;
use trepan_deformable::{Config, Method, TissueCollision, TissueStep};
use trepan_evidence::suite::Row;
use trepan_evidence::timer::Samples;
use trepan_geometry::{Pointshell, Pose, Tool, ToolState, Vec3, quantile};

/// Steps in which a method may still get to know the mesh; their time is reported by itself.
pub const START: usize = 32;

/// What one method did along one path.
pub struct Ride {
    /// The method.
    pub method: Method,
    /// Points that lie clearly inside and were not found.
    pub missed: u64,
    /// Points found that lie clearly outside.
    pub invented: u64,
    /// Largest change of depth from one step to the next, mm.
    pub depth_jump_mm: f64,
    /// Largest fall of depth from one step to the next, mm.
    pub depth_fall_mm: f64,
    times_us: Vec<f64>,
    depth_errors_mm: Vec<f64>,
    inside: u64,
    tests: u64,
    overflow: u64,
    stale: u64,
    force_change_n: f64,
}

/// Takes a tool along its tips through the moving mesh.
pub fn ride(scene: &Scene, method: Method, tips: &[Vec3], truth: &[Truth]) -> Ride {
    let config = Config { method, ..Config::default() };
    let mut collision =
        TissueCollision::new(&scene.mesh, &Tool::probe(RADIUS_MM), &config).expect("the scene is sound");
    let still = vec![Vec3::ZERO; scene.mesh.positions.len()];
    let mut positions = scene.mesh.positions.clone();
    let mut out = TissueStep::default();
    let mut ride = Ride::new(method);
    let mut last: Option<(f32, Vec3)> = None;
    for (step, (tip, truth)) in tips.iter().zip(truth).enumerate() {
        scene.move_to(step, &mut positions);
        let tool = ToolState::at(Pose::from_translation(*tip));
        let time = Samples::of(1, |_| collision.step(&positions, &still, &tool, &mut out));
        ride.times_us.push(time.quantile(0.5));
        ride.compare(&out, truth);
        let depth_mm = out.manifold.depth_mm;
        let force = Viscoelastic::BRAIN.stiffness * depth_mm * out.manifold.normal;
        if let Some((before_mm, before)) = last {
            ride.depth_jump_mm = ride.depth_jump_mm.max(f64::from((depth_mm - before_mm).abs()));
            ride.depth_fall_mm = ride.depth_fall_mm.max(f64::from(before_mm - depth_mm));
            ride.force_change_n = ride.force_change_n.max(f64::from(force.distance(before)));
        }
        last = Some((depth_mm, force));
    }
    ride
}

impl Ride {
    fn new(method: Method) -> Self {
        Self {
            method,
            missed: 0,
            invented: 0,
            depth_jump_mm: 0.0,
            depth_fall_mm: 0.0,
            times_us: Vec::new(),
            depth_errors_mm: Vec::new(),
            inside: 0,
            tests: 0,
            overflow: 0,
            stale: 0,
            force_change_n: 0.0,
        }
    }

    /// Median time of a warm step, µs.
    pub fn p50_us(&self) -> f64 {
        quantile(&mut self.warm().to_vec(), 0.5)
    }

    /// How many times faster it is than another run along the same path. Counted are the steps of
    /// both, touching or not, by the mean of the middle nine in ten.
    pub fn times_faster_than(&self, other: &Self) -> f64 {
        let both = self.times_us.len().min(other.times_us.len());
        let mean = |times: &[f64]| {
            let mut sorted = times[if both > 2 * START { START } else { 0 }..both].to_vec();
            sorted.sort_by(f64::total_cmp);
            let cut = sorted.len() / 20;
            let middle = &sorted[cut..sorted.len() - cut];
            middle.iter().sum::<f64>() / middle.len() as f64
        };
        mean(&other.times_us) / mean(&self.times_us)
    }

    /// Times after the start, µs; all of them where there are few.
    fn warm(&self) -> &[f64] {
        &self.times_us[if self.times_us.len() > 2 * START { START } else { 0 }..]
    }

    fn compare(&mut self, out: &TissueStep, truth: &Truth) {
        let found = u64::from(out.points_in_contact);
        self.missed += truth.surely_inside.saturating_sub(found);
        self.invented += found.saturating_sub(truth.perhaps_inside);
        self.inside += truth.surely_inside;
        self.tests += u64::from(out.tests);
        self.overflow += u64::from(out.overflow);
        self.stale += u64::from(out.stale);
        if truth.depth_mm > 0.0 {
            self.depth_errors_mm.push((f64::from(out.manifold.depth_mm) - truth.depth_mm).abs());
        }
    }

    /// The row of this ride.
    pub fn row(&self, place: &str, scene: &Scene, scan: Option<&Self>) -> Row {
        let steps = self.times_us.len() as f64;
        let row = Row::new(place, self.method.name())
            .with("tets", scene.mesh.tets.len())
            .with("points", Pointshell::DEFORMABLE_COUNT)
            .with("steps", self.times_us.len())
            .metric("step_p50_us", self.p50_us())
            .metric("step_p99_us", quantile(&mut self.warm().to_vec(), 0.99))
            .metric(
                "step_max_at_start_us",
                quantile(&mut self.times_us[..START.min(self.times_us.len())].to_vec(), 1.0),
            )
            .metric("tests_per_point", self.tests as f64 / steps / Pointshell::DEFORMABLE_COUNT as f64)
            .metric("missed_points_count", self.missed as f64)
            .metric("invented_points_count", self.invented as f64)
            .metric("force_change_max_n", self.force_change_n)
            .metric("overflow_count", self.overflow as f64)
            .metric("stale_count", self.stale as f64);
        let missed_percent = 100.0 * self.missed as f64 / self.inside as f64;
        finite(
            row,
            &[
                ("missed_percent", missed_percent),
                ("depth_error_p95_mm", quantile(&mut self.depth_errors_mm.clone(), 0.95)),
                ("depth_error_max_mm", quantile(&mut self.depth_errors_mm.clone(), 1.0)),
                ("times_faster_than_scan", scan.map_or(f64::NAN, |scan| self.times_faster_than(scan))),
            ],
        )
    }
}
