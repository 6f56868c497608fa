//! Figures and the table of chapter 6: pictures of a session without a window, rates, tissue.
//!
//! # Practice
//! The scripted operation runs on the built-in head; the processor's renderer draws what a window
//! would show, the same on every machine. Rates are of this machine: of its graphics device where
//! there is one, else of its processor.

use super::comparison::{Comparison, Rule};
use super::deformable::DEVICE_N;
use super::rigid::{axis, changes, lines, most};
use crate::suites::deformable::recording::TETS;
use crate::suites::render::scenes;
use crate::suites::scripted::{LookInput, Prepared, Ride};
use crate::suites::{Part, Scope};
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use trepan_evidence::picture::{Series, Snapshot};
use trepan_evidence::suite::Findings;
use trepan_evidence::timer::Samples;
use trepan_geometry::{Vec3, units};
use trepan_gpu::{Gpu, Prefer};
use trepan_render::{Camera, Frame, Image, Painter, SceneData, SliceLook};
use trepan_soft::{Body, Loads, Material, SoftSolver};
use trepan_stages::Phase;
use trepan_tled::{Config, Tled};

/// Size of a picture on the page, pixels.
const SIZE: [u32; 2] = [640, 400];
/// Size of the thesis's window, pixels.
const WINDOW: [u32; 2] = [1680, 1050];
/// Slowest picture that the thesis gives, 15 frames a second, ms.
const PICTURE_MS: f64 = 1e3 / 15.0;
/// The thesis's time step for 22 thousand tetrahedra in real time, ms.
const STEP_MS: f32 = 0.33;
/// Distance from which the opening is seen, mm.
const NEAR_MM: f32 = 110.0;

/// Pictures, rates, tissue.
pub fn parts() -> Vec<Part> {
    vec![Part::new("session", session), Part::new("rates", rates), Part::new("tissue", |_, findings| tissue(findings))]
}

/// Whether the 3-D view stands alone, and what is hidden in it.
#[derive(Clone, Copy)]
enum Look {
    /// Slices and 3-D view, as the window opens.
    Window,
    /// The opening from near, with the tool.
    Opening,
    /// The skull as the window opens, without slices.
    Whole,
    /// The opening from near, without the tool.
    Untouched,
    /// The brain without the skull, from near.
    Brain,
}

/// Pictures of the operation, each taken once.
struct Album {
    painter: Option<Painter>,
    taken: Vec<Snapshot>,
    /// Looks at which the burr cut so far.
    drilled: usize,
    /// How far the probe has come along the way in, mm.
    deepest_mm: f32,
}

fn session(scope: Scope, findings: &mut Findings) {
    let prepared = Prepared::open(scope, "", None).expect("the built-in case opens");
    let mut album = Album { painter: None, taken: Vec::new(), drilled: 0, deepest_mm: f32::NEG_INFINITY };
    let ride = prepared.run(&mut |shown| album.watch(shown)).expect("the operation runs");
    findings.pictures.append(&mut album.taken);
    coupled(&ride, findings);
}

/// Force of the probe on tissue that yields, beside Figures 4.20 and 4.21, which leave that out.
fn coupled(ride: &Ride, findings: &mut Findings) {
    let probed = ride.forces.iter().zip(&ride.probing).filter(|(_, probing)| **probing);
    let forces: Vec<Vec3> = probed.map(|(force, _)| *force).collect();
    let lengths: Vec<f64> = forces.iter().map(|force| f64::from(force.length())).collect();
    let axes = [0, 1, 2].map(|n| axis(&forces, n));
    let title = "Figure 4.20: force at the hand, ours, on a brain that yields";
    let all = lines(&["x", "y", "z", "modulus"], axes.iter().chain([&lengths]));
    findings.series.push(Series::over_frames(title, "force, N", all));
    let varied = axes.each_ref().map(|values| changes(values));
    let title = "Figure 4.21: change of the force at the hand, ours, on a brain that yields";
    findings.series.push(Series::over_frames(title, "force, N", lines(&["x", "y", "z"], &varied)));
    let comparison = Comparison::new("Figure 4.20", "largest force on a brain that yields", "N");
    let why = "the thesis lets nothing yield: the bound is its device's limit";
    findings.rows.push(comparison.printed(Rule::Less, DEVICE_N).ours(most(&lengths)).why(why).row());
}

impl Album {
    /// Draws when drilling has begun, when the probe comes, and where it presses deepest.
    fn watch(&mut self, shown: &LookInput<'_>) {
        if shown.sample.drilling {
            self.drilled += 1;
            match self.drilled {
                1 => {
                    self.take(shown, Look::Opening, "Figure 6.1: the craniotomy simulator while the burr cuts");
                    self.take(shown, Look::Window, "Figure 6.3: slices and 3-D view of the craniotomy simulator");
                    self.take(shown, Look::Brain, "Figure 6.5: the brain's tetrahedra, textured with the MRI");
                }
                3 => self.take(shown, Look::Whole, "Figure 6.11: the integrated simulator while the burr cuts"),
                _ => {}
            }
        }
        if shown.sample.phase() == Phase::Brain {
            if !self.has("Figure 6.9:") {
                self.take(shown, Look::Untouched, "Figure 6.9: the drilled skull with the brain in it");
                self.take(shown, Look::Window, "Figure 6.7: the integrated simulator, the probe in the hand");
            }
            let site = shown.session.scene().site;
            let depth_mm = (shown.sample.state.tip() - site.entry).dot(site.inward);
            if depth_mm > self.deepest_mm.max(0.0) {
                self.deepest_mm = depth_mm;
                self.taken.retain(|snapshot| !snapshot.title.starts_with("Figure 6.6:"));
                self.take(shown, Look::Brain, "Figure 6.6: the brain under a ball that presses it in");
            }
        }
    }

    fn has(&self, figure: &str) -> bool {
        self.taken.iter().any(|snapshot| snapshot.title.starts_with(figure))
    }

    fn take(&mut self, shown: &LookInput<'_>, look: Look, title: &str) {
        let image = self.draw(shown, look);
        let png = STANDARD.encode(image.png().expect("a picture in memory can be packed"));
        self.taken.push(Snapshot { title: title.into(), png });
    }

    fn draw(&mut self, shown: &LookInput<'_>, look: Look) -> Image {
        let scene = shown.session.scene();
        let brain = scene.brain.as_ref();
        let data = SceneData {
            bone: scene.bone.clone(),
            brain: brain.map(|brain| &brain.mesh),
            mri: brain.map(|brain| &brain.mri),
            tint: brain.and_then(|brain| brain.tint.as_deref()),
            cortex: None,
        };
        let painter = self.painter.get_or_insert_with(|| Painter::by_processor(&data, SIZE).expect("the scene loads"));
        let near = Camera::viewed_from(scene.site.entry, -scene.site.inward + 0.35 * Vec3::X, NEAR_MM);
        let tool = Some(shown.sample.tool).filter(|_| !matches!(look, Look::Untouched));
        let frame = Frame {
            tool,
            world_from_tool: shown.sample.state.world_from_tool,
            drilling: shown.sample.drilling,
            brain_positions: Some(shown.positions),
            show_bone: !matches!(look, Look::Brain),
            slices: SliceLook { shown: matches!(look, Look::Window), ..SliceLook::default() },
            ..Frame::of(if matches!(look, Look::Window | Look::Whole) { shown.session.camera() } else { near })
        };
        painter.picture(&frame).expect("the processor draws").0
    }
}

/// Pictures a second at the thesis's size, and motion in real time at its number of tetrahedra.
fn rates(scope: Scope, findings: &mut Findings) {
    let (mesh, mri) = scenes::brain(TETS);
    let (_, dims, voxel_mm) = scenes::SKULLS[2];
    let bone = scenes::skull(dims, voxel_mm);
    let centre = bone.bounds().centre();
    let distance_mm = 1.9 * bone.bounds().size().max_element();
    let data = SceneData { bone: Some(bone), brain: Some(&mesh), mri: Some(&mri), tint: None, cortex: None };
    let device = Gpu::open(Prefer::Hardware).ok().filter(|gpu| !gpu.is_software());
    let by = device.as_ref().map_or("the processor, every pixel".into(), Gpu::name);
    let painter = match device {
        Some(gpu) => Painter::on(Ok(gpu), &data, WINDOW),
        None => Painter::by_processor(&data, WINDOW),
    };
    let mut painter = painter.expect("the scene loads");
    let times = Samples::of(scope.pick(3, 9), |turn| {
        let towards = Vec3::new(0.5 + 0.02 * turn as f32, 1.0, 0.45);
        let camera = Camera::viewed_from(centre, towards, distance_mm);
        let slices = SliceLook { shown: false, ..SliceLook::default() };
        painter.picture(&Frame { slices, ..Frame::of(camera) }).expect("the scene is drawn");
    });
    let quantity = "a picture of skull and brain at 1680x1050, least of some";
    let comparison = Comparison::new("Figure 6.9", quantity, "ms").printed(Rule::Time, PICTURE_MS);
    let why = format!("drawn by {by}; printed: 15 to 20 pictures a second by a graphics card of 2012");
    findings.rows.push(comparison.ours(1e-3 * times.quantile(0.0)).why(&why).row());
    let tets = mesh.tets.len();
    let body = Body::uniform(mesh, Vec::new(), Material::THESIS);
    let mut solver = Tled::new(&body, &Config::default()).expect("the brain is sound");
    let times = Samples::of(scope.pick(60, 600), |_| {
        solver.step(&Loads::default(), STEP_MS);
    });
    let quantity = format!("wall time of 0.33 ms of motion, {tets} tetrahedra, least of some");
    let comparison = Comparison::new("Figure 6.6", quantity, "ms").printed(Rule::Time, STEP_MS.into());
    let why = "by the processor; printed: real time by a graphics card of 2012";
    findings.rows.push(comparison.ours(1e-3 * times.quantile(0.0)).why(why).row());
}

/// Table 6.1 in its own units: mm, kg, s.
fn tissue(findings: &mut Findings) {
    let Material::NeoHookean { young_mpa, poisson, density_g_mm3 } = Material::BRAIN else {
        return;
    };
    let stiff = "the printed modulus is ten times that of living brain (errata)";
    let rows = [
        ("density", "kg/mm³", 1e-6, 1e-3 * f64::from(density_g_mm3), ""),
        ("Young's modulus", "kPa", 30.0, 1e3 * f64::from(young_mpa), stiff),
        ("Poisson's ratio", "", 0.3, poisson.into(), "living brain hardly changes its volume"),
        ("gravity", "mm/s²", 9810.0, 1e6 * f64::from(units::GRAVITY_MM_PER_MS2), ""),
    ];
    for (quantity, unit, printed, ours, why) in rows {
        let comparison = Comparison::new("Table 6.1", quantity, unit).printed(Rule::Equal(0.005), printed);
        findings.rows.push(comparison.ours(ours).why(why).row());
    }
}
